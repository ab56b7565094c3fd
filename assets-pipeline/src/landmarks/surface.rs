//! What a fit sees of a head: its outer triangles, and points sampled from where eyes can see them.

use glam::{Mat3, Vec2, Vec3};
use rubor_rig::deform::point_normals;
use rubor_rig::head::{Head, Material};

use super::raster::{Depth, Window};
use crate::import::materials::recognise;

/// Rotation, scale and translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Similarity {
    /// Rotation times scale.
    pub linear: Mat3,
    pub shift: Vec3,
}

impl Similarity {
    pub(super) const IDENTITY: Self = Self { linear: Mat3::IDENTITY, shift: Vec3::ZERO };

    pub(super) fn apply(&self, p: Vec3) -> Vec3 {
        self.linear * p + self.shift
    }

    pub(super) fn inverse(&self) -> Self {
        let linear = self.linear.inverse();
        Self { linear, shift: -(linear * self.shift) }
    }

    /// First `self`, then `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        Self { linear: next.linear * self.linear, shift: next.apply(self.shift) }
    }

    pub(super) fn scale(&self) -> f32 {
        self.linear.x_axis.length()
    }
}

/// Opaque triangles of a head.
#[derive(Clone, Default)]
pub(super) struct Surface {
    pub corners: Vec<[Vec3; 3]>,
    /// Smooth unit normals at the corners.
    pub normals: Vec<[Vec3; 3]>,
    /// Index of each triangle in the mesh of the head.
    pub source: Vec<u32>,
}

/// Whether a part can hide or be a face: hair, lashes, films, glasses and clothes are not seen.
pub(super) fn is_seen(head: &Head, part: usize) -> bool {
    let part_of = &head.mesh.parts[part];
    match part_of.material {
        Material::Lash | Material::Hair | Material::Wet | Material::Hidden => false,
        Material::Other => {
            let name = recognise(&part_of.name);
            !matches!(
                name,
                Some(Material::Lash | Material::Hair | Material::Wet | Material::Hidden | Material::Other)
            )
        }
        _ => true,
    }
}

impl Surface {
    /// Triangles of the parts that are chosen, in the space of the head.
    pub(super) fn of(head: &Head, chosen: impl Fn(usize) -> bool) -> Self {
        let mesh = &head.mesh;
        let normals = point_normals(mesh, &mesh.points);
        let mut surface = Self::default();
        for (_, part) in mesh.parts.iter().enumerate().filter(|(i, _)| chosen(*i)) {
            for t in part.triangles.clone() {
                let points = mesh.triangles[t as usize].map(|v| mesh.vertices[v as usize].point as usize);
                surface.corners.push(points.map(|p| mesh.points[p]));
                surface.normals.push(points.map(|p| normals[p]));
                surface.source.push(t);
            }
        }
        surface
    }

    pub(super) fn mapped(&self, by: &Similarity) -> Self {
        let turn = by.linear * (1.0 / by.scale());
        Self {
            corners: self.corners.iter().map(|t| t.map(|p| by.apply(p))).collect(),
            normals: self.normals.iter().map(|t| t.map(|n| turn * n)).collect(),
            source: self.source.clone(),
        }
    }

    /// Smallest and largest coordinates.
    pub(super) fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut corners = self.corners.iter().flatten();
        let first = *corners.next()?;
        Some(corners.fold((first, first), |(low, high), p| (low.min(*p), high.max(*p))))
    }

    /// Interpolated unit normal of a triangle at a place in its plane.
    pub(super) fn normal_at(&self, triangle: usize, place: Vec3) -> Vec3 {
        let [a, b, c] = self.corners[triangle];
        let face = (b - a).cross(c - a);
        let area = face.length_squared().max(1e-20);
        let wb = (place - a).cross(c - a).dot(face) / area;
        let wc = (b - a).cross(place - a).dot(face) / area;
        let [na, nb, nc] = self.normals[triangle];
        let normal = na * (1.0 - wb - wc) + nb * wb + nc * wc;
        normal.try_normalize().unwrap_or_else(|| face.normalize_or(Vec3::Z))
    }
}

/// Points of the surface of a face in (nearly) canonical millimetres, about evenly spaced.
#[derive(Clone, Debug, Default)]
pub(super) struct Cloud {
    pub places: Vec<Vec3>,
    /// Unit, towards the viewer.
    pub normals: Vec<Vec3>,
    /// How far the surface stands out of its surroundings, mm.
    pub bumps: Vec<f32>,
}

/// What is sampled, canonical mm: the head without its back.
const LOW: Vec3 = Vec3::new(-112.0, -165.0, -62.0);
const HIGH: Vec3 = Vec3::new(112.0, 125.0, 150.0);
/// Directions from which the surface is seen, degrees about the vertical axis.
const VIEWS: [f32; 3] = [0.0, 55.0, -55.0];
/// Radius of the surroundings of a bump, mm.
pub(super) const BUMP_RADIUS_MM: f32 = 8.0;
/// Larger bumps are edges of what hides something.
const MAX_BUMP_MM: f32 = 5.0;

impl Cloud {
    /// Samples a surface in canonical millimetres with pictures of this fineness.
    pub(super) fn of(surface: &Surface, pixel_mm: f32) -> Self {
        let mut cloud = Self::default();
        for degrees in VIEWS {
            let turn = Mat3::from_rotation_y(-degrees.to_radians());
            let window =
                Window::covering(Vec2::new(LOW.x - 20.0, LOW.y), Vec2::new(HIGH.x + 20.0, HIGH.y), pixel_mm);
            let corners = surface.corners.iter().map(|t| t.map(|p| turn * p));
            let depth = Depth::draw(window, corners);
            let radius = (BUMP_RADIUS_MM / pixel_mm).round() as usize;
            let relief = depth.relief(&depth.sums(), radius);
            for (i, relief) in relief.iter().enumerate() {
                let Some(triangle) = depth.triangle_at(i) else { continue };
                let place = turn.transpose() * depth.place(i);
                if place.cmplt(LOW).any() || place.cmpgt(HIGH).any() {
                    continue;
                }
                let normal = surface.normal_at(triangle as usize, place);
                let facing = (turn * normal).z;
                let normal = if facing < 0.0 { -normal } else { normal };
                let facing = facing.abs();
                // The front shows what faces it; the sides show the rest.
                if facing < 0.5 || (degrees != 0.0 && normal.z > 0.5) {
                    continue;
                }
                cloud.places.push(place);
                cloud.normals.push(normal);
                cloud.bumps.push((relief * facing).clamp(-MAX_BUMP_MM, MAX_BUMP_MM));
            }
        }
        cloud
    }

    /// Keys for the search of corresponding points: place in units of 10 mm, normal and bump.
    pub(super) fn key(place: Vec3, normal: Vec3, bump: f32) -> [f32; 7] {
        let p = place * 0.1;
        let n = normal * NORMAL_WEIGHT;
        [p.x, p.y, p.z, n.x, n.y, n.z, bump * BUMP_WEIGHT]
    }

    pub(super) fn keys(&self) -> Vec<[f32; 7]> {
        (0..self.places.len()).map(|i| Self::key(self.places[i], self.normals[i], self.bumps[i])).collect()
    }
}

/// A normal that is off by 60 degrees counts like this many centimetres.
const NORMAL_WEIGHT: f32 = 1.2;
/// A bump that is off by a millimetre counts like this many centimetres.
const BUMP_WEIGHT: f32 = 0.55;
