//! Maps over the picture: what the surface is made of and what happens to it.
//!
//! ```text
//! ids, chromophores of the frame + head + shot --the place of each pixel on its triangle--> values --> colours
//! ```
//!
//! Drawn on the host from the channels of the frame, so any quantity of the surface can be shown; it costs a wait for the
//! device and some milliseconds, only while an overlay is on.

use glam::{Mat4, Vec2, Vec3};
use rayon::prelude::*;
use rubor_renderer::channels::{Channel, ChannelData};
use rubor_renderer::{Camera, triangles_of_ids};
use rubor_rig::bvh::Bvh;
use rubor_rig::deform::{deform_points, point_normals};
use rubor_rig::evaluate::Shot;
use rubor_rig::head::{Head, MM_PER_METRE, Material, Mesh};
use rubor_rig::strain::point_strain;

/// A map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlay {
    /// The picture alone.
    #[default]
    None,
    /// Wrinkle zones, each in a colour, as strong as it is active.
    Zones,
    /// Blood as it is now.
    Hemoglobin,
    /// Melanin.
    Melanin,
    /// Mean curvature of the deformed surface.
    Curvature,
    /// Depth of the head behind the surface, along its normal, at rest.
    Thickness,
    /// Texture coordinates.
    Uv,
    /// Edges of triangles.
    Wireframe,
    /// Change of area against rest.
    Strain,
    /// Normals.
    Normals,
}

/// What the colours of an overlay mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Legend {
    /// Colours from a least to a largest value, with a unit.
    Scale {
        /// Value of the first colour.
        low: f32,
        /// Value of the last colour.
        high: f32,
        /// Its unit.
        unit: &'static str,
        /// Whether the middle is a neutral white.
        diverges: bool,
    },
    /// Names with a colour.
    Names(Vec<(String, [u8; 3])>),
    /// Words.
    Words(&'static str),
}

/// Strength of the colours over the picture.
const ALPHA: u8 = 200;
/// Largest melanin and hemoglobin that colours tell, shares of the volume (`rubor_rig::skin::chromophores`).
const MOST_MELANIN: f32 = 0.43;
const MOST_HEMOGLOBIN: f32 = 0.12;
/// Largest mean curvature that colours tell, 1/mm: radii of 2.5 mm.
const MOST_CURVATURE: f32 = 0.4;
/// Largest thickness that colours tell, mm: beyond it no light comes through.
const MOST_THICKNESS_MM: f32 = 20.0;
/// Largest change of area that colours tell.
const MOST_STRAIN: f32 = 0.4;

impl Overlay {
    /// All, in the order of the menu.
    pub const ALL: [Self; 10] = [
        Self::None,
        Self::Zones,
        Self::Hemoglobin,
        Self::Melanin,
        Self::Curvature,
        Self::Thickness,
        Self::Strain,
        Self::Uv,
        Self::Wireframe,
        Self::Normals,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Zones => "zones",
            Self::Hemoglobin => "hemoglobin",
            Self::Melanin => "melanin",
            Self::Curvature => "curvature",
            Self::Thickness => "thickness",
            Self::Uv => "UV",
            Self::Wireframe => "wireframe",
            Self::Strain => "strain",
            Self::Normals => "normals",
        }
    }

    /// Channels of the frame that it is made from.
    pub fn channels(self) -> &'static [Channel] {
        match self {
            Self::None => &[],
            Self::Hemoglobin => &[Channel::Ids, Channel::Hemoglobin],
            Self::Melanin => &[Channel::Ids, Channel::Melanin],
            _ => &[Channel::Ids],
        }
    }

    /// What its colours mean.
    pub fn legend(self, head: &Head) -> Legend {
        let scale = |low, high, unit, diverges| Legend::Scale { low, high, unit, diverges };
        match self {
            Self::None => Legend::Words(""),
            Self::Zones => {
                let zones = head.maps.zones.iter().enumerate();
                Legend::Names(zones.map(|(i, z)| (z.name.clone(), hue(i, head.maps.zones.len()))).collect())
            }
            Self::Hemoglobin => scale(0.0, MOST_HEMOGLOBIN, "share of the dermis", false),
            Self::Melanin => scale(0.0, MOST_MELANIN, "share of the epidermis", false),
            Self::Curvature => scale(-MOST_CURVATURE, MOST_CURVATURE, "1/mm, hollow to bulging", true),
            Self::Thickness => scale(0.0, MOST_THICKNESS_MM, "mm at rest", false),
            Self::Strain => scale(-MOST_STRAIN, MOST_STRAIN, "change of area, compressed to stretched", true),
            Self::Uv => Legend::Words("u red, v green, a line every tenth"),
            Self::Wireframe => Legend::Words("triangles of the whole head"),
            Self::Normals => Legend::Words("x red, y green, z blue, world space"),
        }
    }
}

/// What is kept of a head between frames.
pub struct OverlayMaker {
    order: Vec<u32>,
    material_of_triangle: Vec<Material>,
    thickness_mm: Option<Vec<f32>>,
}

impl OverlayMaker {
    /// For a head.
    pub fn new(head: &Head) -> Self {
        let mut material_of_triangle = vec![Material::Other; head.mesh.triangles.len()];
        for part in &head.mesh.parts {
            for triangle in part.triangles.clone() {
                material_of_triangle[triangle as usize] = part.material;
            }
        }
        Self { order: triangles_of_ids(head), material_of_triangle, thickness_mm: None }
    }

    /// The overlay of a frame as RGBA with straight alpha, of the size of the ids. `values` is the chromophore that the overlay
    /// shows, if it shows one.
    pub fn paint(
        &mut self,
        overlay: Overlay,
        (head, shot): (&Head, &Shot),
        ids: &ChannelData,
        values: Option<&ChannelData>,
    ) -> Vec<u8> {
        let [width, height] = ids.size;
        let mesh = &head.mesh;
        let local = deform_points(mesh, &head.shapes, &shot.face.shapes);
        let place = Mat4::from_rotation_translation(shot.face.head_rotation, shot.face.head_translation);
        let points: Vec<Vec3> = local.iter().map(|p| place.transform_point3(*p)).collect();
        let of_points: Vec<f32> = match overlay {
            Overlay::Curvature => curvature(mesh, &local),
            Overlay::Thickness => self.thickness_mm.get_or_insert_with(|| thickness(mesh)).clone(),
            Overlay::Strain => point_strain(mesh, &local).iter().map(|s| s.area).collect(),
            _ => Vec::new(),
        };
        let normals = if overlay == Overlay::Normals { point_normals(mesh, &points) } else { Vec::new() };
        let camera = Camera {
            position: shot.camera.position,
            target: shot.camera.target,
            up: shot.camera.up,
            fov_degrees: shot.camera.fov_y.to_degrees(),
        };
        let clip = camera.clip_from_view(width as f32 / height as f32) * camera.view_from_world();
        let world = clip.inverse();
        let id = |x: u32, y: u32| ids.values[(y * width + x) as usize].to_bits();
        let triangle_of = |bits: u32| {
            let number = (bits & ((1 << 27) - 1)).checked_sub(1)?;
            self.order.get(number as usize).map(|t| *t as usize)
        };
        let pixel = |x: u32, y: u32| -> [u8; 4] {
            let bits = id(x, y);
            let Some(triangle) = triangle_of(bits) else { return [0; 4] };
            let corners = mesh.triangles[triangle];
            let vertex = corners.map(|v| mesh.vertices[v as usize]);
            let shares = || {
                let ndc = Vec2::new(
                    (x as f32 + 0.5) / width as f32 * 2.0 - 1.0,
                    1.0 - (y as f32 + 0.5) / height as f32 * 2.0,
                );
                let through = world.project_point3(ndc.extend(0.5));
                barycentric(vertex.map(|v| points[v.point as usize]), camera.position, through)
            };
            let is_skin = self.material_of_triangle[triangle] == Material::Skin;
            let value = |shares: Vec3| -> f32 {
                (0..3).map(|i| shares[i] * of_points[vertex[i].point as usize]).sum()
            };
            let uv = |shares: Vec3| -> Vec2 { (0..3).map(|i| shares[i] * vertex[i].uv).sum() };
            let solid = |rgb: [u8; 3]| [rgb[0], rgb[1], rgb[2], ALPHA];
            match overlay {
                Overlay::None => [0; 4],
                Overlay::Hemoglobin | Overlay::Melanin => {
                    if !is_skin {
                        return [0; 4];
                    }
                    let most = if overlay == Overlay::Melanin { MOST_MELANIN } else { MOST_HEMOGLOBIN };
                    let value = values.map_or(0.0, |v| v.values[(y * width + x) as usize]);
                    solid(heat(value / most))
                }
                Overlay::Curvature => solid(diverging(value(shares()) / MOST_CURVATURE)),
                Overlay::Strain => solid(diverging(value(shares()) / MOST_STRAIN)),
                Overlay::Thickness => solid(heat(value(shares()) / MOST_THICKNESS_MM)),
                Overlay::Zones => {
                    if !is_skin {
                        return [0; 4];
                    }
                    let at = uv(shares());
                    zones(head, &shot.face.zones, at)
                }
                Overlay::Uv => {
                    let at = uv(shares());
                    let (u, v) = (at.x.rem_euclid(1.0), at.y.rem_euclid(1.0));
                    let line = |t: f32| (t * 10.0 + 0.5).rem_euclid(1.0) - 0.5;
                    let is_line = line(u).abs() < 0.04 || line(v).abs() < 0.04;
                    if is_line { solid([255; 3]) } else { solid([(u * 255.0) as u8, (v * 255.0) as u8, 60]) }
                }
                Overlay::Wireframe => {
                    let right = if x + 1 < width { id(x + 1, y) } else { bits };
                    let below = if y + 1 < height { id(x, y + 1) } else { bits };
                    if right != bits || below != bits { [110, 220, 255, ALPHA] } else { [0; 4] }
                }
                Overlay::Normals => {
                    let s = shares();
                    let normal: Vec3 = (0..3).map(|i| s[i] * normals[vertex[i].point as usize]).sum();
                    let code = |c: f32| ((0.5 + 0.5 * c) * 255.0).round() as u8;
                    solid(normal.normalize_or_zero().to_array().map(code))
                }
            }
        };
        (0..width * height).into_par_iter().flat_map_iter(|i| pixel(i % width, i / width)).collect()
    }
}

/// Shares of the corners where the ray from the eye through a point meets the plane of a triangle, held inside of it.
fn barycentric([a, b, c]: [Vec3; 3], eye: Vec3, through: Vec3) -> Vec3 {
    let direction = through - eye;
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det.abs() < 1e-30 {
        return Vec3::splat(1.0 / 3.0);
    }
    let s = (eye - a) / det;
    let (u, v) = (s.dot(p), direction.dot(s.cross(e1)));
    let shares = Vec3::new(1.0 - u - v, u, v).clamp(Vec3::ZERO, Vec3::ONE);
    shares / shares.element_sum().max(1e-6)
}

/// The zones at a place: each in its colour as far as its mask reaches, brighter where it is active.
fn zones(head: &Head, weights: &[f32], at: Vec2) -> [u8; 4] {
    let mut rgb = Vec3::ZERO;
    let mut sum = 0.0;
    for (i, zone) in head.maps.zones.iter().enumerate() {
        let mask = zone.mask.sample(at.x, at.y, 0).clamp(0.0, 1.0);
        let weight = weights.get(i).copied().unwrap_or_default();
        let color = Vec3::from(hue(i, head.maps.zones.len()).map(f32::from));
        rgb += mask * (0.35 + 0.65 * weight) * color;
        sum += mask;
    }
    if sum < 0.02 {
        return [0; 4];
    }
    let [r, g, b] = (rgb / sum.max(1e-6)).to_array().map(|c| c.clamp(0.0, 255.0) as u8);
    [r, g, b, (f32::from(ALPHA) * sum.min(1.0)) as u8]
}

/// Mean curvature at each point, 1/mm: half the Laplacian of the position by cotangents (M. Desbrun et al. 1999, eq. 14)
/// along the normal; positive where the surface bulges.
fn curvature(mesh: &Mesh, points: &[Vec3]) -> Vec<f32> {
    let normals = point_normals(mesh, points);
    let mut sums = vec![Vec3::ZERO; points.len()];
    let mut areas = vec![0.0f32; points.len()];
    for triangle in &mesh.triangles {
        let p = triangle.map(|v| mesh.vertices[v as usize].point as usize);
        let area = (points[p[1]] - points[p[0]]).cross(points[p[2]] - points[p[0]]).length();
        for i in 0..3 {
            let (a, b, c) = (p[i], p[(i + 1) % 3], p[(i + 2) % 3]);
            let (to_a, to_b) = (points[a] - points[c], points[b] - points[c]);
            let cotangent = to_a.dot(to_b) / to_a.cross(to_b).length().max(1e-12);
            let edge = cotangent.clamp(-20.0, 20.0) * (points[b] - points[a]);
            sums[a] += edge;
            sums[b] -= edge;
            // A third of the area of each triangle.
            areas[a] += area / 6.0;
        }
    }
    let at = |i: usize| {
        let laplacian = sums[i] / (2.0 * areas[i].max(1e-12));
        -0.5 * laplacian.dot(normals[i]) / MM_PER_METRE
    };
    (0..points.len()).map(at).collect()
}

/// Millimetres from each point to the other side, along the inward normal at rest.
fn thickness(mesh: &Mesh) -> Vec<f32> {
    // The ray starts this far inside, metres, so that it does not meet its own triangle.
    const START: f32 = 2e-4;
    let normals = point_normals(mesh, &mesh.points);
    let corners = |t: &[u32; 3]| t.map(|v| mesh.points[mesh.vertices[v as usize].point as usize]);
    let bvh = Bvh::new(mesh.triangles.iter().map(corners).collect());
    let at = |(p, n): (&Vec3, &Vec3)| {
        let met = bvh.first(*p - START * *n, -*n, 0.0, 1.0, None);
        met.map_or(MOST_THICKNESS_MM, |m| (m.distance + START) * MM_PER_METRE)
    };
    mesh.points.par_iter().zip(&normals).map(at).collect()
}

/// 0 to 1 as black, violet, orange, yellow, white: each brighter than the last.
pub fn heat(t: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [10.0, 8.0, 30.0],
        [87.0, 16.0, 110.0],
        [229.0, 92.0, 48.0],
        [252.0, 200.0, 60.0],
        [255.0, 255.0, 245.0],
    ];
    mixed(&STOPS, t)
}

/// -1 to 1 as blue, white, red.
pub fn diverging(t: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [25.0, 60.0, 170.0],
        [120.0, 170.0, 235.0],
        [240.0, 240.0, 240.0],
        [240.0, 140.0, 100.0],
        [170.0, 20.0, 35.0],
    ];
    mixed(&STOPS, 0.5 + 0.5 * t)
}

fn mixed(stops: &[[f32; 3]; 5], t: f32) -> [u8; 3] {
    let at = if t.is_finite() { t.clamp(0.0, 1.0) * 4.0 } else { 0.0 };
    let i = (at as usize).min(3);
    let share = at - i as f32;
    std::array::from_fn(|c| (stops[i][c] + share * (stops[i + 1][c] - stops[i][c])).round() as u8)
}

/// Colour number `i` of `n`, evenly around the circle with alternating brightness.
fn hue(i: usize, n: usize) -> [u8; 3] {
    let angle = i as f32 / n.max(1) as f32 * std::f32::consts::TAU;
    let value = if i.is_multiple_of(2) { 255.0 } else { 190.0 };
    let part = |shift: f32| (value * (0.55 + 0.45 * (angle + shift).cos())) as u8;
    [part(0.0), part(-std::f32::consts::TAU / 3.0), part(std::f32::consts::TAU / 3.0)]
}

#[cfg(test)]
mod tests {
    use rubor_rig::head::Vertex;

    use super::*;

    /// A sphere of a radius in millimetres, out of rings.
    fn sphere(radius_mm: f32) -> Mesh {
        let (rings, sides) = (24u32, 48u32);
        let mut mesh = Mesh::default();
        for r in 0..=rings {
            for s in 0..sides {
                let (polar, around) = (
                    std::f32::consts::PI * (r as f32 / rings as f32).clamp(0.01, 0.99),
                    std::f32::consts::TAU * s as f32 / sides as f32,
                );
                let p = Vec3::new(polar.sin() * around.cos(), polar.cos(), -polar.sin() * around.sin());
                mesh.points.push(p * radius_mm / MM_PER_METRE);
                mesh.vertices.push(Vertex { point: mesh.points.len() as u32 - 1, uv: Vec2::ZERO });
            }
        }
        for r in 0..rings {
            for s in 0..sides {
                let (a, b) = (r * sides + s, r * sides + (s + 1) % sides);
                mesh.triangles.extend([[a, a + sides, b], [b, a + sides, b + sides]]);
            }
        }
        mesh
    }

    #[test]
    fn a_sphere_has_the_curvature_and_the_thickness_of_a_sphere() {
        let mesh = sphere(5.0);
        let middle = 12 * 48;
        let (h, t) = (curvature(&mesh, &mesh.points), thickness(&mesh));
        assert!((h[middle] - 0.2).abs() < 0.004, "1/r = 0.2 per mm: {}", h[middle]);
        assert!((t[middle] - 10.0).abs() < 0.1, "2 r = 10 mm: {}", t[middle]);
    }

    #[test]
    fn places_on_triangles_and_colours_have_known_answers() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let at = Vec3::new(0.25, 0.5, 0.0);
        let shares = barycentric(corners, Vec3::new(0.3, 0.3, 2.0), at);
        assert!((shares - Vec3::new(0.25, 0.25, 0.5)).length() < 1e-5, "{shares}");
        assert_eq!((heat(0.0), heat(1.0), heat(f32::NAN)), ([10, 8, 30], [255, 255, 245], [10, 8, 30]));
        assert_eq!(diverging(0.0), [240; 3]);
    }
}
