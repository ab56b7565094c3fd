//! Vertices to points: seams of textures close, edges that are meant to be sharp stay.
//!
//! Two vertices are one point where positions and all offsets lie within a distance and normals within an angle. Bits
//! are not compared: two copies of a vertex that went through a transform, a text or a quantisation often differ in the
//! last place. Lips that touch at rest part in the offsets of the jaw and stay two.

use std::collections::HashMap;

use glam::Vec3;

/// Distance of one place, as part of the size of the mesh: 2.5 micrometres on a head; vertices of lids stand 0.1 mm apart.
const DISTANCE: f32 = 1e-5;
/// Cosine of 5 degrees: normals of bytes are off by less than one, edges that show are more than twenty.
const COSINE: f32 = 0.996_194_7;
/// Vertices of one place that are compared with a new one. Files that have more there keep them apart: time stays
/// linear.
const MOST_COMPARED: usize = 64;

/// A vertex in the space of the head.
pub(super) struct Corner {
    pub(super) position: Vec3,
    /// Unit, or zero where the file has none.
    pub(super) normal: Vec3,
    /// Shape and offset, shapes ascending, no offset of length 0.
    pub(super) moved: Vec<(u32, Vec3)>,
}

/// Point of each vertex, and the first vertex of each point.
pub(super) fn weld(corners: &[Corner]) -> (Vec<u32>, Vec<usize>) {
    let low = corners.iter().map(|c| c.position).fold(Vec3::INFINITY, Vec3::min);
    let high = corners.iter().map(|c| c.position).fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = if corners.is_empty() { 0.0 } else { (high - low).max_element() };
    let distance = (DISTANCE * size).max(f32::MIN_POSITIVE);
    // Cells much larger than the distance: most vertices look into one.
    let cell = 16.0 * f64::from(distance);
    let index = |p: f32, from: f32, shift: f32| {
        ((f64::from(p) - f64::from(from) + f64::from(shift)) / cell).floor() as i64
    };
    let mut points_of: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut first_of: Vec<usize> = Vec::new();
    let mut point_of = Vec::with_capacity(corners.len());
    for (v, corner) in corners.iter().enumerate() {
        let cells = |shift: f32| [0, 1, 2].map(|k| index(corner.position[k], low[k], shift));
        let (from, to) = (cells(-distance), cells(distance));
        let mut found: Option<u32> = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let there = points_of.get(&[x, y, z]).map_or(&[][..], Vec::as_slice);
                    let same = there.iter().rev().take(MOST_COMPARED).copied();
                    let same =
                        same.filter(|p| is_one(&corners[first_of[*p as usize]], corner, distance)).min();
                    found = [found, same].into_iter().flatten().min();
                }
            }
        }
        point_of.push(found.unwrap_or_else(|| {
            let point = first_of.len() as u32;
            first_of.push(v);
            points_of.entry(cells(0.0)).or_default().push(point);
            point
        }));
    }
    (point_of, first_of)
}

fn is_one(a: &Corner, b: &Corner, distance: f32) -> bool {
    let near = |a: Vec3, b: Vec3| a.distance_squared(b) <= distance * distance || a == b;
    let smooth = a.normal == Vec3::ZERO || b.normal == Vec3::ZERO || a.normal.dot(b.normal) >= COSINE;
    if !smooth || !near(a.position, b.position) {
        return false;
    }
    let (mut i, mut k) = (0, 0);
    loop {
        let (offset_a, offset_b) = match (a.moved.get(i), b.moved.get(k)) {
            (None, None) => return true,
            (Some(x), Some(y)) if x.0 == y.0 => {
                (i, k) = (i + 1, k + 1);
                (x.1, y.1)
            }
            (Some(x), y) if y.is_none_or(|y| x.0 < y.0) => {
                i += 1;
                (x.1, Vec3::ZERO)
            }
            (_, Some(y)) => {
                k += 1;
                (Vec3::ZERO, y.1)
            }
            (Some(x), None) => {
                i += 1;
                (x.1, Vec3::ZERO)
            }
        };
        if !near(offset_a, offset_b) {
            return false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(position: Vec3, normal: Vec3, moved: &[(u32, Vec3)]) -> Corner {
        Corner { position, normal, moved: moved.to_vec() }
    }

    #[test]
    fn distance_and_angle_decide_and_not_bits() {
        let far = corner(Vec3::ONE, Vec3::Z, &[]);
        let a = corner(Vec3::ZERO, Vec3::Z, &[(2, Vec3::X)]);
        let slightly = |degrees: f32| Vec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        let points = |b: Corner| {
            let (point_of, _) = weld(&[far_copy(&far), far_copy(&a), b]);
            point_of[1] == point_of[2]
        };
        assert!(points(corner(Vec3::splat(4e-6), slightly(4.0), &[(2, Vec3::X)])));
        assert!(points(corner(Vec3::splat(-4e-6), slightly(0.0), &[(1, Vec3::splat(1e-6)), (2, Vec3::X)])));
        assert!(points(corner(Vec3::ZERO, Vec3::ZERO, &[(2, Vec3::X), (3, Vec3::splat(1e-6))])));
        assert!(!points(corner(Vec3::splat(1e-4), Vec3::Z, &[(2, Vec3::X)])), "another place");
        assert!(!points(corner(Vec3::ZERO, slightly(20.0), &[(2, Vec3::X)])), "a sharp edge");
        assert!(!points(corner(Vec3::ZERO, Vec3::Z, &[(2, Vec3::Y)])), "another way");
        assert!(!points(corner(Vec3::ZERO, Vec3::Z, &[])), "lips that part");
        assert!(!points(corner(Vec3::ZERO, Vec3::Z, &[(1, Vec3::X)])), "another shape");
    }

    fn far_copy(c: &Corner) -> Corner {
        Corner { position: c.position, normal: c.normal, moved: c.moved.clone() }
    }

    #[test]
    fn a_place_with_many_sides_takes_linear_time() {
        let corners: Vec<Corner> = (0..200_000)
            .map(|i| corner(Vec3::ZERO, Vec3::ZERO, &[(0, Vec3::X * (1.0 + i as f32))]))
            .collect();
        let start = std::time::Instant::now();
        assert_eq!(weld(&corners).1.len(), corners.len());
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }
}
