//! Which texels of a map a head's skin shows, and values of points as maps.

use glam::{Vec2, Vec3};
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};

use super::ConvertError;

/// Distance beyond its edges at which a triangle still counts, texels: rounding. More would let the background of
/// photographs in; what a bilinear fetch reads beyond an edge is filled from the skin.
const GUTTER_TEXELS: f32 = 0.02;
const EMPTY: u32 = u32::MAX;

/// Share of a map's data that must lie on the skin of a head (or of the skin that must have data) to be its layout.
pub const LEAST_OVERLAP: f64 = 0.8;

/// The skin of a head seen from its texture.
#[derive(Clone, Debug)]
pub struct SkinTexels<'a> {
    head: &'a Head,
    width: u32,
    height: u32,
    /// Triangle of each texel, or none.
    shown: Vec<u32>,
}

impl<'a> SkinTexels<'a> {
    /// Rasterises the skin of a head into a map of this size. Texture coordinates outside of the unit square have no
    /// texel.
    pub fn new(head: &'a Head, width: u32, height: u32) -> Self {
        let mut shown = vec![EMPTY; width as usize * height as usize];
        let mut distance = vec![f32::MIN; shown.len()];
        let size = Vec2::new(width as f32, height as f32);
        for part in head.mesh.parts.iter().filter(|p| p.material == Material::Skin) {
            for index in part.triangles.clone() {
                let corners =
                    head.mesh.triangles[index as usize].map(|v| head.mesh.vertices[v as usize].uv * size);
                cover(corners, width, height, |i, d| {
                    if d > distance[i] {
                        (distance[i], shown[i]) = (d, index);
                    }
                });
            }
        }
        Self { head, width, height, shown }
    }

    /// Texels that show skin.
    pub fn mask(&self) -> Mask {
        let mapped = self.shown.iter().map(|t| *t != EMPTY).collect();
        Mask { width: self.width, height: self.height, mapped }
    }

    /// Triangle and barycentric weights at the centre of a texel.
    pub fn at(&self, x: u32, y: u32) -> Option<(u32, Vec3)> {
        let index = self.shown[(y * self.width + x) as usize];
        if index == EMPTY {
            return None;
        }
        let uv = Vec2::new((x as f32 + 0.5) / self.width as f32, (y as f32 + 0.5) / self.height as f32);
        let [a, b, c] =
            self.head.mesh.triangles[index as usize].map(|v| self.head.mesh.vertices[v as usize].uv);
        let area = (b - a).perp_dot(c - a);
        let (v, w) = ((uv - a).perp_dot(c - a) / area, (b - a).perp_dot(uv - a) / area);
        Some((index, Vec3::new(1.0 - v - w, v, w)))
    }

    /// Rest position at the centre of a texel, metres.
    pub fn position(&self, x: u32, y: u32) -> Option<Vec3> {
        let mesh = &self.head.mesh;
        let (index, weights) = self.at(x, y)?;
        let [a, b, c] =
            mesh.triangles[index as usize].map(|v| mesh.points[mesh.vertices[v as usize].point as usize]);
        Some(a * weights.x + b * weights.y + c * weights.z)
    }

    /// A map of 1 channel from one value per point of the mesh; texels without skin take the skin around them.
    ///
    /// # Panics
    /// When `values` has another length than the points.
    pub fn map_of_points(&self, values: &[f32]) -> Map {
        let mesh = &self.head.mesh;
        assert_eq!(values.len(), mesh.points.len(), "one value per point");
        let mut map = Map::filled(self.width, self.height, &[0.0]);
        for y in 0..self.height {
            for x in 0..self.width {
                if let Some((index, weights)) = self.at(x, y) {
                    let [a, b, c] = mesh.triangles[index as usize]
                        .map(|v| values[mesh.vertices[v as usize].point as usize]);
                    map.values[(y * self.width + x) as usize] = a * weights.x + b * weights.y + c * weights.z;
                }
            }
        }
        let mut mask = self.mask();
        // Filtering at the edge of the skin reads one texel beyond it.
        for (i, value) in edge_values(&map, &mask) {
            map.values[i] = value;
            mask.mapped[i] = true;
        }
        fill_unmapped(&mut map, &mask);
        map
    }
}

/// Texels without data that touch some, with the mean of those.
fn edge_values(map: &Map, mask: &Mask) -> Vec<(usize, f32)> {
    let (width, height) = (map.width as usize, map.height as usize);
    let around = |i: usize| i.saturating_sub(1)..=i + 1;
    (0..width * height)
        .filter(|i| !mask.mapped[*i])
        .filter_map(|i| {
            let (x, y) = (i % width, i / width);
            let neighbours = around(y).filter(|y| *y < height).flat_map(|y| around(x).map(move |x| (x, y)));
            let known = neighbours.filter(|(x, _)| *x < width).map(|(x, y)| y * width + x);
            let (count, sum) = known
                .filter(|j| mask.mapped[*j])
                .fold((0.0, 0.0), |(count, sum), j| (count + 1.0, sum + map.values[j]));
            (count > 0.0).then(|| (i, sum / count))
        })
        .collect()
}

/// Calls `inside` with the texels of a triangle (corners in texels) and their signed distance to its edges, 0 inside.
fn cover([a, b, c]: [Vec2; 3], width: u32, height: u32, mut inside: impl FnMut(usize, f32)) {
    let area = (b - a).perp_dot(c - a);
    if !area.is_finite() || area.abs() < 1e-9 {
        return;
    }
    let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| {
        let d = (q - p).normalize_or_zero() * area.signum();
        (p, Vec2::new(-d.y, d.x))
    });
    let low = (a.min(b).min(c) - GUTTER_TEXELS - 0.5).ceil().max(Vec2::ZERO);
    let high = a.max(b).max(c) + GUTTER_TEXELS - 0.5;
    if high.x < 0.0 || high.y < 0.0 {
        return;
    }
    let (right, bottom) = ((high.x as u32).min(width - 1), (high.y as u32).min(height - 1));
    for y in low.y as u32..=bottom {
        for x in low.x as u32..=right {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let d = edges.iter().map(|(q, n)| (p - *q).dot(*n)).fold(0.0, f32::min);
            if d >= -GUTTER_TEXELS {
                inside((y * width + x) as usize, d);
            }
        }
    }
}

/// Fails when a map's data lies elsewhere than the head's skin: the overlap is below [`LEAST_OVERLAP`] of the smaller
/// of both. A map without mask or background says nothing about its layout and passes.
///
/// # Errors
/// Another layout, or a head without skin in the unit square.
pub fn require_layout(name: &str, data: &Mask, skin: &Mask) -> Result<(), ConvertError> {
    let smaller = data.count().min(skin.count());
    if skin.count() == 0 {
        let expected = "skin with texture coordinates in the unit square";
        return Err(ConvertError::argument("head", "no texel that shows skin", expected));
    }
    let share = data.and(skin).count() as f64 / smaller.max(1) as f64;
    if share < LEAST_OVERLAP {
        let found = format!("data of which {:.0} % lie on the skin of the head", 100.0 * share);
        let expected = format!(
            "the texture layout of the head, {:.0} % or more (another layout crosses with `rubor maps transfer`)",
            100.0 * LEAST_OVERLAP
        );
        return Err(ConvertError::argument(name, found, expected));
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rubor_rig::head::{Mesh, Part, Vertex};

    /// A square sheet 1 m wide whose texture fills a part of the unit square.
    pub(crate) fn sheet(low: Vec2, high: Vec2) -> Head {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let vertices =
            corners.iter().enumerate().map(|(i, c)| Vertex { point: i as u32, uv: low + *c * (high - low) });
        let mesh = Mesh {
            points: corners.iter().map(|c| Vec3::new(c.x, 1.0 - c.y, 0.0)).collect(),
            vertices: vertices.collect(),
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            parts: vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..2 }],
            ..Mesh::default()
        };
        Head { name: "sheet".into(), mesh, ..Head::default() }
    }

    #[test]
    fn the_mask_is_the_part_of_the_texture_that_skin_uses() {
        let head = sheet(Vec2::new(0.25, 0.5), Vec2::new(0.75, 1.0));
        let texels = SkinTexels::new(&head, 64, 32);
        let mask = texels.mask();
        for y in 0..32u32 {
            for x in 0..64u32 {
                let inside = (16..48).contains(&x) && y >= 16;
                let near = (15..49).contains(&x) && y >= 15;
                let found = mask.mapped[(y * 64 + x) as usize];
                assert!(found || !inside, "({x}, {y}) is skin");
                assert!(near || !found, "({x}, {y}) is background");
            }
        }
        let p = texels.position(32, 24).expect("skin");
        assert!(p.distance(Vec3::new(0.515_625, 0.468_75, 0.0)) < 1e-5, "{p}");
        assert!(texels.at(2, 2).is_none());
    }

    #[test]
    fn values_of_points_are_linear_between_them_and_continued() {
        let head = sheet(Vec2::ZERO, Vec2::new(0.5, 1.0));
        let map = SkinTexels::new(&head, 32, 32).map_of_points(&[0.0, 1.0, 1.0, 0.0]);
        for x in 0..16u32 {
            assert!((map.texel(x, 9)[0] - (x as f32 + 0.5) / 16.0).abs() < 1e-5);
        }
        assert!((map.texel(16, 9)[0] - 15.5 / 16.0).abs() < 1e-5);
        assert!(map.texel(31, 9)[0] > 0.9);
    }

    #[test]
    fn another_layout_is_refused_and_a_part_of_the_own_one_is_not() {
        let skin = SkinTexels::new(&sheet(Vec2::ZERO, Vec2::new(0.5, 1.0)), 32, 32).mask();
        let left = Mask { mapped: (0..1024).map(|i| i % 32 < 10).collect(), ..skin };
        let right = Mask { mapped: (0..1024).map(|i| i % 32 > 12).collect(), ..skin };
        assert!(require_layout("map", &left, &skin).is_ok());
        assert!(require_layout("map", &Mask::full(32, 32), &skin).is_ok());
        let error = require_layout("map", &right, &skin).unwrap_err().to_string();
        assert!(error.contains("map: found data of which") && error.contains("transfer"), "{error}");
        let nothing = Mask { mapped: vec![false; 1024], ..skin };
        assert!(require_layout("map", &left, &nothing).is_err());
    }
}
