//! A picture of a head from the front with its landmarks numbered.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use rubor_rig::head::{Head, Material};

use super::raster::{Depth, Window};
use super::surface::{Similarity, Surface, is_seen};
use super::{Fit, TRUSTED};

/// A picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB, row by row from the top.
    pub rgb: Vec<u8>,
    /// Names of the numbers, from 1 on.
    pub names: Vec<String>,
}

/// Rows of the picture.
const HEIGHT: f32 = 900.0;

/// Where the picture is taken from: in front of the face if one is found, else in front of all.
pub(super) struct Camera {
    picture_from_head: Similarity,
    window: Window,
}

impl Camera {
    pub(super) fn new(head: &Head, fit: Option<&Fit>) -> Option<Self> {
        if let Some(fit) = fit.filter(|f| f.confidence >= TRUSTED) {
            let (low, high) = (Vec2::new(-112.0, -160.0), Vec2::new(112.0, 130.0));
            let window = Window::covering(low, high, (high.y - low.y) / HEIGHT);
            return Some(Self { picture_from_head: fit.canonical_from_head, window });
        }
        let surface = Surface::of(head, |part| is_seen(head, part));
        let (low, high) = surface.bounds()?;
        let margin = 0.04 * (high - low).max_element();
        let (low, high) = (low.truncate() - margin, high.truncate() + margin);
        let window = Window::covering(low, high, (high - low).max_element() / HEIGHT);
        Some(Self { picture_from_head: Similarity::IDENTITY, window })
    }

    /// Pixel of a place, from the upper left corner.
    fn pixel(&self, place: Vec3) -> Vec2 {
        let at = self.window.at(self.picture_from_head.apply(place).truncate());
        Vec2::new(at.x, self.window.height as f32 - 1.0 - at.y)
    }

    /// The place of the head that a pixel shows.
    pub(super) fn place(&self, head: &Head, pixel: Vec2) -> Option<Vec3> {
        let surface = Surface::of(head, |part| is_seen(head, part)).mapped(&self.picture_from_head);
        let depth = Depth::draw(self.window, surface.corners.iter().copied());
        let (x, y) = (pixel.x.round(), self.window.height as f32 - 1.0 - pixel.y.round());
        if x < 0.0 || y < 0.0 || x >= self.window.width as f32 || y >= self.window.height as f32 {
            return None;
        }
        let index = y as usize * self.window.width + x as usize;
        depth.covers(index).then(|| self.picture_from_head.inverse().apply(depth.place(index)))
    }
}

/// Rows of digits 0 to 9, three pixels wide, five high; the top row in the highest bits.
const DIGITS: [u16; 10] = [
    0b111_101_101_101_111,
    0b010_110_010_010_111,
    0b111_001_111_100_111,
    0b111_001_111_001_111,
    0b101_101_111_001_001,
    0b111_100_111_001_111,
    0b111_100_111_101_111,
    0b111_001_010_010_010,
    0b111_101_111_101_111,
    0b111_101_111_001_111,
];

/// Draws a head and the given landmarks. `None` where there is nothing to draw.
pub fn draw(head: &Head, fit: Option<&Fit>, landmarks: &BTreeMap<String, Vec3>) -> Option<Picture> {
    let camera = Camera::new(head, fit)?;
    let surface = Surface::of(head, |part| is_seen(head, part)).mapped(&camera.picture_from_head);
    let depth = Depth::draw(camera.window, surface.corners.iter().copied());
    let (width, height) = (camera.window.width, camera.window.height);
    let mut kinds = vec![Material::Other; head.mesh.triangles.len()];
    for (i, part) in head.mesh.parts.iter().enumerate() {
        let range = part.triangles.start as usize..part.triangles.end as usize;
        kinds[range].fill(super::kind(head, i));
    }
    let mut rgb = vec![32u8; 3 * width * height];
    let light = Vec3::new(0.35, 0.5, 0.8).normalize();
    for i in 0..width * height {
        let Some(t) = depth.triangle_at(i) else { continue };
        let normal = surface.normal_at(t as usize, depth.place(i));
        let normal = if normal.z < 0.0 { -normal } else { normal };
        let tint = match kinds[surface.source[t as usize] as usize] {
            Material::Skin => Vec3::new(0.86, 0.72, 0.64),
            Material::Eye => Vec3::new(0.9, 0.95, 1.0),
            Material::Teeth => Vec3::new(0.95, 0.93, 0.85),
            Material::Mucosa | Material::Gums => Vec3::new(0.7, 0.35, 0.33),
            _ => Vec3::splat(0.7),
        };
        let shade = 0.18 + 0.72 * normal.dot(light).max(0.0);
        let at = 3 * ((height - 1 - i / width) * width + i % width);
        for (c, value) in (tint * shade).to_array().into_iter().enumerate() {
            rgb[at + c] = (255.0 * value.clamp(0.0, 1.0)) as u8;
        }
    }
    let mut picture = Picture {
        width: width as u32,
        height: height as u32,
        rgb,
        names: landmarks.keys().cloned().collect(),
    };
    let mut labels: Vec<Vec2> = Vec::new();
    for (number, place) in landmarks.values().enumerate() {
        let at = camera.pixel(*place);
        picture.disc(at, 3.2, [20, 20, 20]);
        picture.disc(at, 2.2, [80, 255, 120]);
        // Beside the mark, where no other number stands yet.
        let free = [(6.0, -11.0), (6.0, 3.0), (-22.0, -11.0), (-22.0, 3.0), (6.0, -24.0), (6.0, 16.0)]
            .into_iter()
            .map(|(x, y)| at + Vec2::new(x, y))
            .find(|p| labels.iter().all(|l| (*l - *p).abs().cmpgt(Vec2::new(20.0, 12.0)).any()))
            .unwrap_or(at + Vec2::new(6.0, -11.0));
        labels.push(free);
        picture.number(free, number + 1);
    }
    Some(picture)
}

impl Picture {
    fn set(&mut self, x: f32, y: f32, color: [u8; 3]) {
        if x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32 {
            let at = 3 * (y as usize * self.width as usize + x as usize);
            self.rgb[at..at + 3].copy_from_slice(&color);
        }
    }

    fn disc(&mut self, at: Vec2, radius: f32, color: [u8; 3]) {
        let reach = radius.ceil() as i32;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let p = at.round() + Vec2::new(dx as f32, dy as f32);
                if p.distance(at) <= radius {
                    self.set(p.x, p.y, color);
                }
            }
        }
    }

    fn number(&mut self, at: Vec2, number: usize) {
        const SCALE: f32 = 2.0;
        let digits: Vec<u16> = number.to_string().bytes().map(|b| DIGITS[usize::from(b - b'0')]).collect();
        for (k, digit) in digits.into_iter().enumerate() {
            for (color, grow) in [([20, 20, 20], 1.0), ([255, 255, 120], 0.0)] {
                for bit in (0..15).filter(|b| digit >> (14 - b) & 1 == 1) {
                    let corner =
                        at.round() + SCALE * Vec2::new((bit % 3) as f32 + 4.0 * k as f32, (bit / 3) as f32);
                    let mut y = -grow;
                    while y < SCALE + grow {
                        let mut x = -grow;
                        while x < SCALE + grow {
                            self.set(corner.x + x, corner.y + y, color);
                            x += 1.0;
                        }
                        y += 1.0;
                    }
                }
            }
        }
    }
}
