//! The canonical face: points of the default head, warped so that its landmarks lie on those of the canonical face.
//!
//! `face.bin` holds them; `cargo run -p rubor-assets --example landmark_confidence -- face` makes it of the built-in head, and
//! a test compares. Little-endian: the number of points (u32); of each its place (three i16, 0.01 mm), its
//! normal (three i8, 1/127) and its bump (i8, 1/25 mm); then landmarks in the order of [`names`] (three i16 each), then rows of relief from below (i16, 0.01 mm; i16::MIN is none).

use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rubor_rig::head::Head;
use rubor_rig::landmarks::{MIDDLE, PAIRED, paired};

use super::raster::{Depth, Window};
use super::surface::{Cloud, Surface, is_seen};
use crate::synthesize::FaceSpace;

static BYTES: &[u8] = include_bytes!("face.bin");

/// Side of a pixel of the relief, mm.
pub(super) const RELIEF_PIXEL_MM: f32 = 3.0;
/// Half the side of the square that the relief stands out of, pixels.
pub(super) const RELIEF_RADIUS: usize = 6;
/// Lower left corner of the relief on the canonical face, mm, and its extent in pixels.
pub(super) const RELIEF_LOW_MM: Vec2 = Vec2::new(-66.0, -108.0);
pub(super) const RELIEF_WIDTH: usize = 44;
pub(super) const RELIEF_HEIGHT: usize = 55;
/// Pixels of the picture that points are taken of, mm.
pub(super) const PIXEL_MM: f32 = 2.0;

/// The canonical face.
pub(super) struct Template {
    pub cloud: Cloud,
    /// How much each point counts, 0 to 1.
    pub weights: Vec<f32>,
    /// Names and places of the landmarks, mm.
    pub landmarks: Vec<(String, Vec3)>,
    /// Relief seen from the front, mm; NaN where there is none.
    pub relief: Vec<f32>,
}

/// The one of the default head.
pub(super) fn template() -> &'static Template {
    static TEMPLATE: LazyLock<Template> = LazyLock::new(|| Template::from_bytes(BYTES));
    &TEMPLATE
}

/// How much a place of the canonical face counts: the inner face most, what hair and collars hide little, the gap between
/// the lids hardly.
fn weight(p: Vec3) -> f32 {
    let inner = is_inner(p);
    let in_eye = Vec2::new((p.x.abs() - 32.0) / 13.0, (p.y + 3.0) / 5.0).length() < 1.0 && p.z > 40.0;
    if in_eye {
        0.15
    } else if inner {
        1.0
    } else if p.z < 20.0 || p.y > 62.0 {
        0.25
    } else {
        0.6
    }
}

/// Whether a place belongs to the part of the face that tells it from other things: brows to chin.
pub(super) fn is_inner(p: Vec3) -> bool {
    p.x.abs() < 52.0 && (-112.0..34.0).contains(&p.y) && p.z > 38.0
}

/// Names of all landmarks, left before right.
pub(super) fn names() -> Vec<String> {
    let middle = MIDDLE.iter().map(|n| (*n).to_owned());
    middle.chain(PAIRED.iter().flat_map(|n| [paired(n, true), paired(n, false)])).collect()
}

/// Where the canonical face has the landmarks of a head, both sides alike. Places that the warp of `synthesize` follows
/// loosely (brows, ears) are those of the head, not those of its table.
fn canonical_places(head: &Head, space: &FaceSpace) -> Vec<(String, Vec3)> {
    let mirror = Vec3::new(-1.0, 1.0, 1.0);
    let at = |name: &str| head.landmarks.get(name).map_or(Vec3::ZERO, |p| space.warp(*p));
    let middle = MIDDLE.iter().map(|n| ((*n).to_owned(), at(n) * Vec3::new(0.0, 1.0, 1.0)));
    let sides = PAIRED.iter().flat_map(|n| {
        let mean = 0.5 * (at(&paired(n, true)) + mirror * at(&paired(n, false)));
        [(paired(n, true), mean), (paired(n, false), mirror * mean)]
    });
    middle.chain(sides).collect()
}

impl Template {
    fn from_bytes(bytes: &[u8]) -> Self {
        let (count, rest) = bytes.split_at(4);
        let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
        let (points, rest) = rest.split_at((10 * count).min(rest.len()));
        let names = names();
        let (marks, relief) = rest.split_at((6 * names.len()).min(rest.len()));
        let i16_at = |b: &[u8], i: usize| i16::from_le_bytes([b[i], b[i + 1]]);
        let place = |b: &[u8]| Vec3::from_array([0, 2, 4].map(|i| f32::from(i16_at(b, i)) * 0.01));
        let landmarks =
            names.into_iter().zip(marks.chunks_exact(6)).map(|(name, b)| (name, place(b))).collect();
        let mut cloud = Cloud::default();
        for p in points.chunks_exact(10) {
            cloud.places.push(place(p));
            let normal = Vec3::from_array([6, 7, 8].map(|i| f32::from(p[i] as i8)));
            cloud.normals.push(normal.normalize_or(Vec3::Z));
            cloud.bumps.push(f32::from(p[9] as i8) / 25.0);
        }
        let relief = (0..relief.len() / 2)
            .map(|i| match i16_at(relief, 2 * i) {
                i16::MIN => f32::NAN,
                v => f32::from(v) * 0.01,
            })
            .collect();
        let weights = cloud.places.iter().map(|p| weight(*p)).collect();
        Self { cloud, weights, landmarks, relief }
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = (self.cloud.places.len() as u32).to_le_bytes().to_vec();
        let hundredths = |v: f32| ((v * 100.0).round() as i16).to_le_bytes();
        for i in 0..self.cloud.places.len() {
            bytes.extend(self.cloud.places[i].to_array().map(hundredths).concat());
            bytes.extend(self.cloud.normals[i].to_array().map(|v| (v * 127.0).round() as i8 as u8));
            bytes.push((self.cloud.bumps[i] * 25.0).round().clamp(-127.0, 127.0) as i8 as u8);
        }
        for (_, place) in &self.landmarks {
            bytes.extend(place.to_array().map(hundredths).concat());
        }
        for v in &self.relief {
            let v = if v.is_nan() { i16::MIN } else { (v * 100.0).round() as i16 };
            bytes.extend(v.to_le_bytes());
        }
        bytes
    }
}

/// The contents of `face.bin`, made of a head that has all landmarks: the default head.
pub fn canonical_face(head: &Head) -> Vec<u8> {
    let space = FaceSpace::fit(head);
    let mut surface = Surface::of(head, |part| is_seen(head, part));
    surface.corners.iter_mut().for_each(|t| *t = t.map(|p| space.warp(p)));
    // Both sides alike: what is asymmetric of one person says nothing about another.
    let mut mirrored = surface.clone();
    for (t, n) in mirrored.corners.iter_mut().zip(&mut mirrored.normals) {
        *t = t.map(|p| p * Vec3::new(-1.0, 1.0, 1.0));
        *n = n.map(|n| n * Vec3::new(-1.0, 1.0, 1.0));
    }
    let (own, other) = (Cloud::of(&surface, PIXEL_MM), Cloud::of(&mirrored, PIXEL_MM));
    let mut left: Vec<(Vec3, Vec3, f32)> = Vec::new();
    for cloud in [own, other] {
        for i in 0..cloud.places.len() {
            left.push((cloud.places[i], cloud.normals[i], cloud.bumps[i]));
        }
    }
    left.retain(|(p, ..)| p.x >= 0.0 && (-125.0..92.0).contains(&p.y) && p.z > -40.0);
    // Thinned out from the nose outwards, which keeps more of what has more shape.
    left.sort_by(|a, b| {
        a.0.distance(Vec3::new(0.0, -33.0, 110.0)).total_cmp(&b.0.distance(Vec3::new(0.0, -33.0, 110.0)))
    });
    let mut kept: Vec<(Vec3, Vec3, f32)> = Vec::new();
    for p in left {
        let spacing = if is_inner(p.0) { 4.2 } else { 7.5 };
        if kept.iter().all(|k| k.0.distance(p.0) > spacing) {
            kept.push(p);
        }
    }
    let mut cloud = Cloud::default();
    for side in [1.0, -1.0] {
        let mirror = Vec3::new(side, 1.0, 1.0);
        for (place, normal, bump) in &kept {
            cloud.places.push(*place * mirror);
            cloud.normals.push(*normal * mirror);
            cloud.bumps.push(*bump);
        }
    }
    let window = Window {
        low: RELIEF_LOW_MM - Vec2::splat(RELIEF_RADIUS as f32 * RELIEF_PIXEL_MM),
        pixel: RELIEF_PIXEL_MM,
        width: RELIEF_WIDTH + 2 * RELIEF_RADIUS,
        height: RELIEF_HEIGHT + 2 * RELIEF_RADIUS,
    };
    let depth = Depth::draw(window, surface.corners.iter().copied());
    let full = depth.relief(&depth.sums(), RELIEF_RADIUS);
    let at = |x: usize, y: usize| (y + RELIEF_RADIUS) * window.width + x + RELIEF_RADIUS;
    let relief = (0..RELIEF_WIDTH * RELIEF_HEIGHT)
        .map(|i| {
            let (x, y) = (i % RELIEF_WIDTH, i / RELIEF_WIDTH);
            let (here, there) = (at(x, y), at(RELIEF_WIDTH - 1 - x, y));
            let middle = window.center(x + RELIEF_RADIUS, y + RELIEF_RADIUS);
            // An oval from the brows to the chin.
            let oval =
                Vec2::new(middle.x / 60.0, (middle.y + 34.0) / if middle.y > -34.0 { 84.0 } else { 72.0 });
            if oval.length() > 1.0 || !depth.covers(here) || !depth.covers(there) {
                return f32::NAN;
            }
            0.5 * (full[here] + full[there])
        })
        .collect();
    let landmarks = canonical_places(head, &space);
    Template { cloud, weights: Vec::new(), landmarks, relief }.to_bytes()
}
