//! A small map of the current state in a corner of a frame, as in the figures of Jimenez 2012 chapter 7.

use clap::ValueEnum;
use glam::Vec2;
use image::RgbImage;
use image::imageops::{FilterType, replace, resize};
use rubor_assets::convert::skin_texels::SkinTexels;
use rubor_assets::convert::transfer::landmark_correspondences;
use rubor_renderer::settings::{ColorMethod, Quality, WrinkleMethod};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::hemoglobin::blend;
use rubor_rig::map;
use rubor_rig::mask::{Mask, resize_area};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Outcome};

/// Side of the map that is blended, texels: that of the distributions.
const SIDE: u32 = 256;
/// Share of the frame's smaller side that the inset takes.
const SHARE: f32 = 0.3;
/// Pixels between the inset and the border of the frame.
const MARGIN: u32 = 4;
/// Flushed cheeks have two to three times the blood of the redder parts of a calm face.
const BLACK: f32 = 2.8;
/// Landmarks at the border of a face.
const FACE: [&str; 6] = ["trichion", "menton", "gonion-left", "gonion-right", "zygion-left", "zygion-right"];
/// Grey around the skin.
const BACKGROUND: u8 = 255;

/// Choice of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Map {
    /// Current blood: dark is more, as in the thesis
    Hemoglobin,
    /// Current weight of the wrinkles: white is full
    Wrinkles,
}

/// An inset of one head.
pub struct Inset {
    map: Map,
    head: Head,
    neutral: map::Map,
    skin: Mask,
    /// Part of the texture that is shown, the face: left, top, width, height, texels.
    crop: [u32; 4],
    /// Hemoglobin that is black: [`BLACK`] times the 95th percentile of the neutral map.
    black: f32,
}

impl Inset {
    /// Prepares the map of a head.
    ///
    /// # Errors
    /// A head without the maps that are to be shown.
    pub fn new(map: Map, head: &Head) -> Outcome<Self> {
        let lacks = |what: &str| {
            Failure::input(format!("inset: found a head without {what}, expected one that has them"))
        };
        let hemoglobin = head.maps.hemoglobin.as_ref().ok_or_else(|| lacks("hemoglobin maps"))?;
        if map == Map::Wrinkles && head.maps.zones.is_empty() {
            return Err(lacks("wrinkle zones"));
        }
        let all = Mask::full(hemoglobin.width, hemoglobin.height);
        let neutral = resize_area(hemoglobin, &all, SIDE, SIDE).0;
        let skin = SkinTexels::new(head, SIDE, SIDE).mask();
        let mut sorted: Vec<f32> =
            neutral.values.iter().zip(&skin.mapped).filter(|(_, m)| **m).map(|(v, _)| *v).collect();
        sorted.sort_by(f32::total_cmp);
        let high = sorted.get(sorted.len() * 95 / 100).copied().unwrap_or(0.01);
        // Copies only the data that the blend reads, not the geometry.
        let crop = face(head).unwrap_or_else(|| bounds(&skin));
        let head = Head { maps: head.maps.clone(), ..Head::default() };
        Ok(Self { map, head, neutral, skin, crop, black: (BLACK * high).max(1e-4) })
    }

    /// Draws the map of a face into the lower left corner.
    pub fn draw(&self, face: &FaceState, methods: &Quality, picture: &mut RgbImage) {
        let grey = match self.map {
            Map::Hemoglobin => self.hemoglobin(face, methods.color),
            Map::Wrinkles => self.wrinkles(face, methods.wrinkles),
        };
        let [left, top, width, height] = self.crop;
        let small = RgbImage::from_fn(width, height, |x, y| {
            let i = ((y + top) * SIDE + x + left) as usize;
            let code = if self.skin.mapped[i] { (grey[i] * 255.0).round() as u8 } else { BACKGROUND };
            image::Rgb([code; 3])
        });
        let [x, y, w, h] = self.place([picture.width(), picture.height()]);
        let small = resize(&small, w, h, FilterType::Triangle);
        replace(picture, &small, i64::from(x), i64::from(y));
    }

    /// Left, top, width and height in a picture of a size, pixels.
    pub fn place(&self, [wide, high]: [u32; 2]) -> [u32; 4] {
        let [_, _, width, height] = self.crop;
        let factor = SHARE * wide.min(high) as f32 / width.max(height) as f32;
        let scaled = |n: u32| ((n as f32 * factor).round() as u32).max(1);
        let (w, h) = (scaled(width), scaled(height));
        [MARGIN, high.saturating_sub(h + MARGIN), w, h]
    }

    /// 0 to 1, dark where there is more blood.
    fn hemoglobin(&self, face: &FaceState, color: ColorMethod) -> Vec<f32> {
        let maps = &self.head.maps;
        let (weights, scale): (&[f32], f32) = match color {
            ColorMethod::Static => (&[], 1.0),
            ColorMethod::Hemoglobin => (&face.distributions, face.hemoglobin_scale),
        };
        let mean = maps.hemoglobin_mean.as_ref().unwrap_or(&self.neutral);
        let blood = blend(&self.neutral, mean, &maps.distributions, weights, scale);
        blood.values.iter().map(|h| 1.0 - (h / self.black).clamp(0.0, 1.0)).collect()
    }

    /// 0 to 1, the largest weight of any wrinkle map.
    fn wrinkles(&self, face: &FaceState, method: WrinkleMethod) -> Vec<f32> {
        let maps = &self.head.maps;
        let mut sums = vec![vec![0.0f32; (SIDE * SIDE) as usize]; maps.wrinkle_slopes.len()];
        if method != WrinkleMethod::None {
            for (zone, weight) in maps.zones.iter().zip(&face.zones).filter(|(_, w)| **w != 0.0) {
                for (i, sum) in sums[zone.wrinkle_map as usize].iter_mut().enumerate() {
                    let (x, y) = (i as u32 % SIDE, i as u32 / SIDE);
                    let place = |n: u32| (n as f32 + 0.5) / SIDE as f32;
                    *sum += weight * zone.mask.sample(place(x), place(y), 0);
                }
            }
        }
        let most = |i: usize| sums.iter().map(|s| s[i].clamp(0.0, 1.0)).fold(0.0, f32::max);
        (0..(SIDE * SIDE) as usize).map(most).collect()
    }
}

/// Left, top, width and height of the face in the texture, where landmarks tell; texels.
fn face(head: &Head) -> Option<[u32; 4]> {
    let landmarks = FACE.iter().filter_map(|n| Some(((*n).to_owned(), *head.landmarks.get(*n)?))).collect();
    let marked = Head { landmarks, mesh: head.mesh.clone(), ..Head::default() };
    let places = landmark_correspondences(&marked, &marked);
    if places.len() < FACE.len() {
        return None;
    }
    let uvs = || places.iter().map(|p| p.receiver);
    let (low, high) = uvs().fold((Vec2::ONE, Vec2::ZERO), |(l, h), p| (l.min(p), h.max(p)));
    let margin = 0.06 * (high - low);
    let low = ((low - margin).clamp(Vec2::ZERO, Vec2::ONE) * SIDE as f32).floor().as_uvec2();
    let high = ((high + margin).clamp(Vec2::ZERO, Vec2::ONE) * SIDE as f32).ceil().as_uvec2();
    let size = high.saturating_sub(low);
    (size.min_element() >= 8).then_some([low.x, low.y, size.x, size.y])
}

/// Left, top, width and height of the mapped texels; all of the mask where there are none.
fn bounds(mask: &Mask) -> [u32; 4] {
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for (i, _) in mask.mapped.iter().enumerate().filter(|(_, m)| **m) {
        let at = [i as u32 % mask.width, i as u32 / mask.width];
        for c in 0..2 {
            (low[c], high[c]) = (low[c].min(at[c]), high[c].max(at[c] + 1));
        }
    }
    if low[0] == u32::MAX {
        return [0, 0, mask.width, mask.height];
    }
    [low[0], low[1], high[0] - low[0], high[1] - low[1]]
}
