//! Polygons to triangles, concave ones too.
//!
//! ```text
//! 3 corners ----------------------------------------------> as they stand
//! convex, 4 corners --------------------------------------> along the shorter diagonal
//! convex, more -------------------------------------------> a fan about the first corner
//! concave --plane of Newell's normal--> ear clipping -----> triangles that all face the way of the polygon
//! no plane, or a border that crosses itself --------------> a fan: no triangulation is right there
//! concave, more than 512 corners -------------------------> a fan: the time of ears grows with the square
//! ```
//!
//! Ears are clipped by `earcutr`. The crate `earcut` is newer and faster, but indexes its nodes without checks in unsafe
//! code; files are not trusted and concave faces are few. Ear clipping leaves out corners on a straight edge. They are
//! put back here: a corner that no triangle has would be a hole as soon as a shape moves it.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Corners of a concave polygon that is cut right.
pub const MOST_CORNERS: usize = 512;

/// Triangles of a polygon as indices into its corners, always `points.len() - 2` of them and each corner in at least
/// one; none for fewer than three corners. The triangles keep the direction of the polygon. Corners of a plane polygon
/// that does not cross itself are covered without overlap.
pub fn triangulate(points: &[Vec3]) -> Vec<[u32; 3]> {
    let count = points.len() as u32;
    match count {
        0..3 => return Vec::new(),
        3 => return vec![[0, 1, 2]],
        _ => {}
    }
    let fan = |first: u32| -> Vec<[u32; 3]> {
        (1..count - 1).map(|k| [0, k, k + 1].map(|corner| (corner + first) % count)).collect()
    };
    let corners: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
    let Some(normal) = newell_normal(&corners) else { return fan(0) };
    if is_convex(&corners, normal) || corners.len() > MOST_CORNERS {
        let shorter_second = points[1].distance_squared(points[3]) < points[0].distance_squared(points[2]);
        return fan(u32::from(count == 4 && shorter_second));
    }
    clip_ears(&corners, normal).unwrap_or_else(|| fan(0))
}

/// Unit normal of the mean plane (M. Newell; I. Sutherland et al. 1974, A characterization of ten hidden-surface
/// algorithms); `None` where the area is zero.
fn newell_normal(corners: &[DVec3]) -> Option<DVec3> {
    // About the first corner: a small polygon far from the origin keeps its digits.
    let origin = corners[0];
    let sum: DVec3 = edges(corners).map(|(a, b)| (a - origin).cross(b - origin)).sum();
    let longest = corners.iter().map(|c| c.distance_squared(origin)).fold(0.0, f64::max);
    (sum.is_finite() && sum.length() > 1e-12 * longest).then(|| sum.normalize())
}

fn edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]))
}

/// Whether every corner turns the way of the polygon and the border goes round once.
fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let count = corners.len();
    let mut turned = 0.0;
    for k in 0..count {
        let before = corners[k] - corners[(k + count - 1) % count];
        let after = corners[(k + 1) % count] - corners[k];
        let angle = before.cross(after).dot(normal).atan2(before.dot(after));
        if angle <= 1e-6 {
            return false;
        }
        turned += angle;
    }
    turned < 1.5 * std::f64::consts::TAU
}

/// `None` where the triangles do not cover the area of the polygon exactly once.
fn clip_ears(corners: &[DVec3], normal: DVec3) -> Option<Vec<[u32; 3]>> {
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = (corners.iter())
        .map(|c| {
            let from_first = *c - corners[0];
            [from_first.dot(right), from_first.dot(up)]
        })
        .collect();
    let doubled_area = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|k| flat[k as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    };
    let clipped = earcutr::earcut(flat.as_flattened(), &[], 2).ok()?;
    let mut triangles: Vec<[u32; 3]> = clipped
        .chunks_exact(3)
        .map(|t| {
            let [a, b, c] = [t[0] as u32, t[1] as u32, t[2] as u32];
            if doubled_area([a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] }
        })
        .collect();
    put_back(&mut triangles, corners.len())?;
    let count = corners.len() as u32;
    let expected: f64 = (1..count - 1).map(|k| doubled_area([0, k, k + 1])).sum();
    let covered: f64 = triangles.iter().map(|t| doubled_area(*t)).sum();
    let all_there = triangles.len() + 2 == corners.len();
    (all_there && (covered - expected).abs() <= 1e-6 * expected.abs()).then_some(triangles)
}

/// Splits the border edge between the neighbours of each corner that is left out.
fn put_back(triangles: &mut Vec<[u32; 3]>, count: usize) -> Option<()> {
    let mut used = vec![false; count];
    triangles.as_flattened().iter().for_each(|corner| used[*corner as usize] = true);
    // Triangle and place in it of each directed edge.
    let mut edge: HashMap<(u32, u32), usize> = HashMap::new();
    let directed = |t: [u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    for (i, t) in triangles.iter().enumerate() {
        directed(*t).into_iter().for_each(|e| {
            edge.insert(e, i);
        });
    }
    let first = used.iter().position(|u| *u)?;
    let mut before = first;
    for step in 1..count {
        let corner = (first + step) % count;
        if !used[corner] {
            let after = (1..count).map(|k| (corner + k) % count).find(|k| used[*k])?;
            let (from, to, middle) = (before as u32, after as u32, corner as u32);
            let i = edge.remove(&(from, to))?;
            let across = triangles[i].into_iter().find(|c| *c != from && *c != to)?;
            triangles[i] = [from, middle, across];
            triangles.push([middle, to, across]);
            for (k, t) in [(i, triangles[i]), (triangles.len() - 1, [middle, to, across])] {
                directed(t).into_iter().for_each(|e| {
                    edge.insert(e, k);
                });
            }
            used[corner] = true;
        }
        before = corner;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(points: &[[f32; 2]]) -> Vec<Vec3> {
        points.iter().map(|[x, y]| Vec3::new(*x, *y, 0.0)).collect()
    }

    /// Signed areas about z.
    fn areas(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<f32> {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| points[k as usize]);
            (b - a).cross(c - a).z / 2.0
        };
        triangles.iter().map(area).collect()
    }

    fn covers(points: &[Vec3], expected: f32) {
        let triangles = triangulate(points);
        assert_eq!(triangles.len(), points.len() - 2);
        let areas = areas(points, &triangles);
        assert!(areas.iter().all(|a| *a > 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f32>() - expected).abs() < 1e-4 * expected, "{areas:?}");
        for corner in 0..points.len() as u32 {
            assert!(triangles.iter().any(|t| t.contains(&corner)), "corner {corner} is left out");
        }
    }

    #[test]
    fn a_concave_pentagon_from_any_first_corner() {
        let mut points = flat(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]]);
        for _ in 0..5 {
            points.rotate_left(1);
            covers(&points, 10.0);
        }
    }

    #[test]
    fn a_concave_quad_is_split_at_its_reflex_corner() {
        let mut points = flat(&[[0.0, 0.0], [5.0, -1.0], [1.0, 0.0], [5.0, 1.0]]);
        for _ in 0..4 {
            points.rotate_left(1);
            covers(&points, 1.0);
        }
    }

    #[test]
    fn convex_faces_stay_as_they_were() {
        let quad = flat(&[[0.0, 0.0], [3.0, 0.0], [2.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangulate(&quad), [[0, 1, 2], [0, 2, 3]]);
        let other = flat(&[[0.0, 0.0], [1.0, 0.0], [3.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangulate(&other), [[1, 2, 3], [1, 3, 0]]);
        assert_eq!(triangulate(&quad[..3]), [[0, 1, 2]]);
        assert!(triangulate(&quad[..2]).is_empty());
    }

    #[test]
    fn corners_on_a_straight_edge_stay_in_the_mesh() {
        covers(&flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]]), 6.0);
        // The letter L with points between its corners.
        let l =
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.5, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        covers(&flat(&l), 3.0);
    }

    #[test]
    fn the_plane_may_lie_anywhere() {
        let flat = flat(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]]);
        let turn = glam::Quat::from_euler(glam::EulerRot::YXZ, 1.1, 2.3, -0.4);
        let far = Vec3::new(0.3, 1.7, -40.0);
        let turned: Vec<Vec3> = flat.iter().map(|p| turn * (*p * 0.01) + far).collect();
        let triangles = triangulate(&turned);
        let areas = areas(&flat, &triangles);
        assert!(
            areas.iter().all(|a| *a > 0.0) && (areas.iter().sum::<f32>() - 10.0).abs() < 1e-3,
            "{areas:?}"
        );
    }

    #[test]
    fn broken_polygons_still_have_their_triangles() {
        let crossing = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        let star: Vec<Vec3> = (0..5)
            .map(|k| {
                let angle = k as f32 * 2.0 * std::f32::consts::TAU / 5.0;
                Vec3::new(angle.cos(), angle.sin(), 0.0)
            })
            .collect();
        let line = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]);
        let one_place = vec![Vec3::ONE; 6];
        let not_numbers = vec![Vec3::NAN; 5];
        for points in [crossing, star, line, one_place, not_numbers] {
            let triangles = triangulate(&points);
            assert_eq!(triangles.len(), points.len() - 2);
            assert!(triangles.as_flattened().iter().all(|c| (*c as usize) < points.len()));
        }
    }

    #[test]
    fn a_comb_of_many_teeth_is_covered_once() {
        let mut points = Vec::new();
        for k in 0..200 {
            points.extend([[k as f32, 1.0], [k as f32 + 0.5, 0.25]]);
        }
        points.extend([[200.0, 1.0], [200.0, 0.0], [0.0, 0.0]]);
        points.reverse();
        covers(&flat(&points), 200.0 * 0.625);
    }
}
