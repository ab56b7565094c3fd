//! Eyeballs: the base mesh has a ball of 70 quads without a cornea; it is replaced by a smooth one in the same place.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec2, Vec3};
use nalgebra::Matrix3;

use super::append_points;
use crate::import::eye_projection::{LIMBUS_RADIUS, fit_sphere, limbus_angle, uv_radius};
use crate::poly::{Corner, PolyMesh, Shape};

/// Points of the two helper balls.
const HELPERS: [(&str, std::ops::Range<usize>); 2] =
    [("eye-left", 14598..14670), ("eye-right", 14670..14742)];

/// Radius of curvature of the cornea, metres (Gullstrand's eye: 7.7 mm; larger here because the base mesh's eyeball is).
const CORNEA_RADIUS: f32 = 0.0085;
/// From the centre of the helper ball down to that of the eye, metres, and its size as part of the helper's: the lids
/// open below the helper's middle, and Catmull-Clark draws them closer to the ball. Set by eye on the default head, so that
/// no shape pushes the ball through a lid.
const LOWERED: f32 = 0.0006;
const SHRINK: f32 = 0.985;
/// Turn of the pupil axis outwards and down, radians: 4 and 3 degrees. The pupil axis of a human eye that looks at
/// something stands 3 to 5 degrees outside of the line of sight (angle kappa).
const TURN: (f32, f32) = (0.070, 0.052);
/// Segments around the axis.
const SEGMENTS: u32 = 32;
/// An eyeball and how the shapes turn it.
pub(super) struct Eye {
    pub(super) group: &'static str,
    pub(super) center: Vec3,
    pub(super) radius: f32,
    /// (shape, rotation about the centre at weight 1, translation).
    moves: Vec<(usize, Mat3, Vec3)>,
}

/// Fits spheres to the helper balls and rigid motions to their offsets. Left eye first.
pub(super) fn fit(mesh: &PolyMesh, shapes: &[Shape]) -> Vec<Eye> {
    let eye = |(group, range): &(&'static str, std::ops::Range<usize>)| {
        let points = &mesh.points[range.clone()];
        let (middle, radius) = fit_sphere(points);
        let (center, radius) = (middle - LOWERED * Vec3::Y, SHRINK * radius);
        let moves = (shapes.iter().enumerate())
            .filter(|(_, s)| s.offsets[range.clone()].iter().any(|o| *o != Vec3::ZERO))
            .map(|(i, s)| {
                let (rotation, translation) = fit_motion(points, &s.offsets[range.clone()], center);
                (i, rotation, translation)
            })
            .collect();
        Eye { group, center, radius, moves }
    };
    HELPERS.iter().map(eye).collect()
}

/// Least squares rotation about `center` and translation (W. Kabsch 1976).
fn fit_motion(points: &[Vec3], offsets: &[Vec3], center: Vec3) -> (Mat3, Vec3) {
    let n = points.len() as f32;
    let mean = points.iter().sum::<Vec3>() / n;
    let mean_offset = offsets.iter().sum::<Vec3>() / n;
    let mut h = Matrix3::<f64>::zeros();
    for (p, o) in points.iter().zip(offsets) {
        let (a, b) = (*p - mean, *p + *o - mean - mean_offset);
        for i in 0..3 {
            for j in 0..3 {
                h[(i, j)] += f64::from(b[i]) * f64::from(a[j]);
            }
        }
    }
    let svd = h.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return (Mat3::IDENTITY, mean_offset) };
    let flip = if (u * vt).determinant() < 0.0 { -1.0 } else { 1.0 };
    let r = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, flip)) * vt;
    let rotation = Mat3::from_cols_array(&std::array::from_fn(|i| r[(i % 3, i / 3)] as f32));
    // p -> R (p - mean) + mean + mean_offset, rewritten about the centre of the eye.
    (rotation, mean + mean_offset - center - rotation * (mean - center))
}

/// Weights at which shapes that bunch the cheek and close the lids meet in strong expressions.
const BUNCHED: [(&str, f32); 5] =
    [("cheekSquint", 0.75), ("eyeSquint", 0.45), ("noseSneer", 0.4), ("mouthSmile", 0.6), ("browDown", 0.3)];
/// Skin stays this far off the eyeball there, metres.
const CLEARANCE: f32 = 0.0011;

/// Moves the skin out of the eyeball where shapes push it in: points that are too deep in the combination of
/// [`BUNCHED`] is added to the shape of the cheek.
pub(super) fn clear_skin(mesh: &PolyMesh, shapes: &mut [Shape], eyes: &[Eye]) {
    let Some(skin) = mesh.groups.iter().position(|g| g == "skin") else { return };
    let mut on_skin = vec![false; mesh.points.len()];
    for f in (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == skin as u32) {
        mesh.face(f).iter().for_each(|c| on_skin[c.point as usize] = true);
    }
    for (eye, side) in eyes.iter().zip(["Left", "Right"]) {
        let used: Vec<(usize, f32)> = BUNCHED
            .iter()
            .filter_map(|(name, w)| {
                Some((shapes.iter().position(|s| s.name == format!("{name}{side}"))?, *w))
            })
            .collect();
        let Some((cheek, weight)) = used.first().copied() else { continue };
        for (i, p) in mesh.points.iter().enumerate().filter(|(i, _)| on_skin[*i]) {
            let moved = *p + used.iter().map(|(s, w)| *w * shapes[*s].offsets[i]).sum::<Vec3>() - eye.center;
            // Skin that rests on the ball, the lids' edges, may stay as near as it is.
            let least = (eye.radius + CLEARANCE).min(p.distance(eye.center));
            let short = least - moved.length();
            if short > 0.0 && moved.z > 0.0 && p.distance(eye.center) < 2.0 * eye.radius {
                shapes[cheek].offsets[i] += moved.normalize_or(Vec3::Z) * (short / weight);
            }
        }
    }
}

/// Adds the balls: groups `eye-left`, `eye-right`.
pub(super) fn add(mesh: &mut PolyMesh, shapes: &mut [Shape], eyes: &[Eye]) {
    for eye in eyes {
        let profile = Profile::new(eye.radius);
        let (mut points, uvs, quads) = ball(&profile);
        let look = Mat3::from_rotation_y(TURN.0 * eye.center.x.signum()) * Mat3::from_rotation_x(TURN.1);
        points.iter_mut().for_each(|p| *p = look * *p);
        let first = append_points(mesh, shapes, points.iter().map(|p| eye.center + *p));
        let first_uv = mesh.uvs.len() as u32;
        mesh.uvs.extend(uvs);
        let group = mesh.group(eye.group);
        for quad in quads {
            mesh.push_face(quad.iter().map(|i| Corner { point: first + i, uv: first_uv + i }), group);
        }
        for (shape, rotation, translation) in &eye.moves {
            for (i, p) in points.iter().enumerate() {
                shapes[*shape].offsets[first as usize + i] = *rotation * *p - *p + *translation;
            }
        }
    }
}

/// Distance from the centre to the surface as a function of the angle from the pupil axis.
struct Profile {
    radius: f32,
    limbus: f32,
    cornea: f32,
    cornea_center: f32,
}

impl Profile {
    fn new(radius: f32) -> Self {
        let limbus = limbus_angle(radius);
        let cornea = CORNEA_RADIUS.min(radius);
        let cornea_center = radius * limbus.cos() - (cornea * cornea - LIMBUS_RADIUS.powi(2)).max(0.0).sqrt();
        Self { radius, limbus, cornea, cornea_center }
    }

    fn at(&self, theta: f32) -> f32 {
        let (sin, cos) = theta.sin_cos();
        let root = self.cornea.powi(2) - (self.cornea_center * sin).powi(2);
        if root <= 0.0 || cos <= 0.0 {
            return self.radius;
        }
        // Smooth maximum over 0.3 mm: the corneal sulcus is a soft bend, not an edge.
        let cornea = self.cornea_center * cos + root.sqrt();
        let (d, width) = (cornea - self.radius, 0.0003);
        0.5 * (cornea + self.radius + (d * d + width * width).sqrt()) - 0.5 * width
    }
}

/// Points about the origin with the pupil along +Z, texture coordinates of [`rubor_rig::head::Material::Eye`], quads
/// (triangles at the poles have three corners). Rings are dense over the cornea.
fn ball(profile: &Profile) -> (Vec<Vec3>, Vec<Vec2>, Vec<Vec<u32>>) {
    let front = 1.3 * profile.limbus;
    let rings: Vec<f32> = (1..=10)
        .map(|i| front * i as f32 / 10.0)
        .chain((1..=12).map(|i| front + (PI - front) * i as f32 / 13.0))
        .collect();
    let direction = |theta: f32, phi: f32| {
        Vec3::new(theta.sin() * phi.cos(), -theta.sin() * phi.sin(), theta.cos()) * profile.at(theta)
    };
    let mut points = vec![direction(0.0, 0.0)];
    let mut uvs = vec![Vec2::splat(0.5)];
    for theta in &rings {
        for s in 0..SEGMENTS {
            let phi = TAU * s as f32 / SEGMENTS as f32;
            points.push(direction(*theta, phi));
            uvs.push(Vec2::splat(0.5) + uv_radius(*theta, profile.limbus) * Vec2::new(phi.cos(), phi.sin()));
        }
    }
    points.push(Vec3::new(0.0, 0.0, -profile.radius));
    uvs.push(Vec2::new(1.0, 0.5)); // the whole rim of the disk is this one point
    let back = points.len() as u32 - 1;
    let at = |ring: u32, s: u32| 1 + ring * SEGMENTS + s % SEGMENTS;
    let last = rings.len() as u32 - 1;
    let mut faces = Vec::new();
    for s in 0..SEGMENTS {
        faces.push(vec![0, at(0, s + 1), at(0, s)]);
        faces.extend((0..last).map(|r| vec![at(r, s), at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)]));
        faces.push(vec![back, at(last, s), at(last, s + 1)]);
    }
    (points, uvs, faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::eye_projection::LIMBUS_UV;

    #[test]
    fn a_ball_faces_outwards_and_bulges_at_the_cornea() {
        let profile = Profile::new(0.012);
        let (points, uvs, faces) = ball(&profile);
        for face in &faces {
            let [a, b, c] = [0, 1, 2].map(|k| points[face[k] as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "face {face:?} points inwards");
        }
        let bulge = points[0].z - 0.012;
        assert!((0.0005..0.002).contains(&bulge), "{bulge}");
        let limbus = points
            .iter()
            .zip(&uvs)
            .filter(|(p, _)| p.z > 0.0 && p.truncate().length() < LIMBUS_RADIUS * 0.98);
        assert!(limbus.clone().count() > 100);
        assert!(limbus.clone().all(|(_, uv)| uv.distance(Vec2::splat(0.5)) < LIMBUS_UV));
    }

    #[test]
    fn sphere_and_motion_are_recovered() {
        let center = Vec3::new(0.03, 0.1, 0.05);
        let points: Vec<Vec3> = (0..60)
            .map(|i| {
                let (a, b) = (i as f32 * 0.7, i as f32 * 0.37);
                center + 0.013 * Vec3::new(a.cos() * b.sin(), a.sin() * b.sin(), b.cos())
            })
            .collect();
        let (c, r) = fit_sphere(&points);
        assert!(c.distance(center) < 1e-5 && (r - 0.013).abs() < 1e-5, "{c} {r}");
        let turn = Mat3::from_rotation_y(0.4);
        let shift = Vec3::new(0.001, 0.0, -0.002);
        let offsets: Vec<Vec3> = points.iter().map(|p| turn * (*p - center) + center + shift - *p).collect();
        let (rotation, translation) = fit_motion(&points, &offsets, center);
        assert!(rotation.abs_diff_eq(turn, 1e-4), "{rotation}");
        assert!(translation.abs_diff_eq(shift, 1e-5), "{translation}");
    }
}
