//! Teeth: fitted behind the lips, with texture coordinates that count millimetres along the arch and from the biting edge.
//!
//! The base mesh has one smooth band a jaw. u = 10 arc length to the left of the middle (metres), v = 0.5 + 10 height
//! over the biting edge, 0.5 to 1 for the upper row; 0.5 - 10 depth below it for the lower row. A renderer draws single
//! teeth and gums from them.

use std::collections::{BTreeSet, HashMap};

use glam::{Vec2, Vec3};

use super::landmarks;
use crate::poly::PolyMesh;

/// Texture units in a metre.
const SCALE: f32 = 10.0;
/// Biting edge of the upper incisors below the line where the lips meet, metres: at rest the lip shows a little of
/// them (2 mm in young adults), and the landmark lies on the lower lip's rim, 4 mm above.
const SHOWN: f32 = 0.0062;
/// How far the rows are moved forward after they were made narrower, metres: lips rest on the teeth.
const FORWARD: f32 = 0.0008;
/// How the tongue is moved, metres.
const TONGUE: Vec3 = Vec3::new(0.0, -0.007, -0.006);
/// The lower incisors reach behind the upper ones by this, metres.
const OVERBITE: f32 = 0.002;

/// Moves the rows in behind closed lips (those of the base mesh show at the corners) and to the height of the lips.
pub(super) fn fit(mesh: &mut PolyMesh) {
    let Some(lips) = landmarks::middle("stomion").map(|p| mesh.points[p as usize].y) else { return };
    // The tongue of the base mesh fills the mouth to the palate.
    if let Some(tongue) = mesh.groups.iter().position(|g| g == "helper-tongue") {
        let faces = (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == tongue as u32);
        let points: BTreeSet<u32> = faces.flat_map(|f| mesh.face(f)).map(|c| c.point).collect();
        points.iter().for_each(|p| mesh.points[*p as usize] += TONGUE);
    }
    for (group, upper) in [("helper-upper-teeth", true), ("helper-lower-teeth", false)] {
        let Some(index) = mesh.groups.iter().position(|g| g == group) else { continue };
        let faces: Vec<usize> =
            (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == index as u32).collect();
        let points: BTreeSet<u32> = faces.iter().flat_map(|f| mesh.face(*f)).map(|c| c.point).collect();
        let Some(front) = points.iter().map(|p| mesh.points[*p as usize].z).reduce(f32::max) else {
            continue;
        };
        let incisors = points.iter().map(|p| mesh.points[*p as usize]).filter(|p| p.z > front - 0.008);
        let sign = if upper { 1.0 } else { -1.0 };
        let edge = sign * incisors.map(|p| sign * p.y).fold(f32::INFINITY, f32::min);
        let wanted = lips - SHOWN + if upper { 0.0 } else { OVERBITE };
        for p in &points {
            let p = &mut mesh.points[*p as usize];
            *p = Vec3::new(0.92 * p.x, p.y + wanted - edge, p.z + FORWARD);
        }
        assign_texture_coordinates(mesh, &faces, &points, sign);
    }
}

fn assign_texture_coordinates(mesh: &mut PolyMesh, faces: &[usize], points: &BTreeSet<u32>, sign: f32) {
    let places: Vec<(u32, Vec3)> = points.iter().map(|p| (*p, mesh.points[*p as usize])).collect();
    let arch = Arch::of(places.iter().map(|(_, p)| *p));
    let along: Vec<f32> = places.iter().map(|(_, p)| arch.length(*p)).collect();
    let mut uv_of: HashMap<u32, u32> = HashMap::new();
    for ((point, place), s) in places.iter().zip(&along) {
        // The biting edge rises towards the back: take the lowest point nearby.
        let edge = (places.iter().zip(&along))
            .filter(|(_, t)| (**t - s).abs() < 0.007)
            .map(|((_, p), _)| sign * p.y)
            .fold(f32::INFINITY, f32::min);
        let height = sign * place.y - edge;
        uv_of.insert(*point, mesh.uvs.len() as u32);
        mesh.uvs.push(Vec2::new(SCALE * s, 0.5 + sign * SCALE * height));
    }
    for f in faces {
        for k in mesh.face_starts[*f]..mesh.face_starts[*f + 1] {
            let corner = &mut mesh.corners[k as usize];
            corner.uv = uv_of[&corner.point];
        }
    }
}

/// Half an ellipse seen from above that a row of teeth stands on.
struct Arch {
    back: f32,
    half_width: f32,
    depth: f32,
}

impl Arch {
    fn of(points: impl Iterator<Item = Vec3>) -> Self {
        let (mut back, mut front, mut half_width) = (f32::INFINITY, f32::NEG_INFINITY, 1e-6f32);
        for p in points {
            (back, front, half_width) = (back.min(p.z), front.max(p.z), half_width.max(p.x.abs()));
        }
        Self { back, half_width, depth: (front - back).max(1e-6) }
    }

    /// Arc length from the middle to the place on the arch in the direction of a point, metres, positive on the left.
    fn length(&self, p: Vec3) -> f32 {
        let end = (p.x / self.half_width).atan2((p.z - self.back) / self.depth);
        let steps = 24;
        let step = end / steps as f32;
        (0..steps)
            .map(|i| {
                let (sin, cos) = ((i as f32 + 0.5) * step).sin_cos();
                step * Vec2::new(self.half_width * cos, self.depth * sin).length()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_along_a_round_arch_is_radius_times_angle() {
        let arch = Arch { back: 0.01, half_width: 0.03, depth: 0.03 };
        for degrees in [-80.0f32, -20.0, 0.0, 45.0, 90.0] {
            let angle = degrees.to_radians();
            let p = Vec3::new(0.02 * angle.sin(), 0.4, 0.01 + 0.02 * angle.cos());
            assert!((arch.length(p) - 0.03 * angle).abs() < 1e-5, "{degrees}");
        }
    }
}
