//! The nearest place of a surface.

use glam::Vec3;
use rubor_rig::bvh::Bvh;

/// Triangles and their tree.
pub(super) struct Surface {
    triangles: Vec<[Vec3; 3]>,
    tree: Bvh,
}

/// A place of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Distance from what it is nearest to.
    pub(super) distance: f32,
    /// Its triangle.
    pub(super) triangle: usize,
    /// Its weights of the corners.
    pub(super) weights: Vec3,
}

impl Surface {
    /// `None` where there is no surface: no triangles, or all of them in one point.
    pub(super) fn new(triangles: Vec<[Vec3; 3]>) -> Option<Self> {
        let tree = Bvh::new(triangles.clone());
        let (low, high) = tree.bounds();
        let extent = (high - low).max_element();
        (extent > 0.0 && extent.is_finite()).then_some(Self { triangles, tree })
    }

    /// The place nearest to a point; of several triangles that share it the first.
    pub(super) fn nearest(&self, p: Vec3) -> Place {
        let mut best = Place { distance: f32::INFINITY, triangle: 0, weights: Vec3::X };
        self.tree.nearest(p, |number| {
            let triangle = number as usize;
            let [a, b, c] = self.triangles[triangle];
            let weights = nearest_in_triangle(p, a, b, c);
            let distance = (a * weights.x + b * weights.y + c * weights.z).distance(p);
            if distance < best.distance || (distance == best.distance && triangle < best.triangle) {
                best = Place { distance, triangle, weights };
            }
            distance
        });
        best
    }
}

/// Barycentric weights of the point of a triangle nearest to `p`.
pub(super) fn nearest_in_triangle(p: Vec3, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d00, d01, d11, d20, d21) = (ab.dot(ab), ab.dot(ac), ac.dot(ac), ap.dot(ab), ap.dot(ac));
    let det = d00 * d11 - d01 * d01;
    if det > 1e-20 {
        let (v, w) = ((d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return Vec3::new(1.0 - v - w, v, w);
        }
    }
    // Outside: the nearest point lies on an edge.
    let edge = |from: Vec3, to: Vec3| {
        let d = to - from;
        let t = ((p - from).dot(d) / d.length_squared().max(1e-20)).clamp(0.0, 1.0);
        ((from + d * t).distance_squared(p), t)
    };
    let (e0, e1, e2) = (edge(a, b), edge(b, c), edge(c, a));
    if e0.0 <= e1.0 && e0.0 <= e2.0 {
        Vec3::new(1.0 - e0.1, e0.1, 0.0)
    } else if e1.0 <= e2.0 {
        Vec3::new(0.0, 1.0 - e1.1, e1.1)
    } else {
        Vec3::new(e2.1, 0.0, 1.0 - e2.1)
    }
}

#[cfg(test)]
mod tests {
    use rubor_rig::random::SplitMix64;

    use super::*;

    #[test]
    fn the_nearest_place_is_that_of_a_search_through_all() {
        let mut random = SplitMix64(7);
        let mut point = || Vec3::from_array([0; 3].map(|_| random.uniform() as f32));
        let triangles: Vec<[Vec3; 3]> = (0..200)
            .map(|_| {
                let a = point();
                [a, a + 0.1 * point(), a + 0.1 * point()]
            })
            .collect();
        let surface = Surface::new(triangles.clone()).unwrap();
        for _ in 0..200 {
            let p = 3.0 * point() - 1.0;
            let of = |t: &[Vec3; 3]| {
                let w = nearest_in_triangle(p, t[0], t[1], t[2]);
                (t[0] * w.x + t[1] * w.y + t[2] * w.z).distance(p)
            };
            let expected = triangles.iter().map(of).fold(f32::INFINITY, f32::min);
            let found = surface.nearest(p);
            assert_eq!(found.distance, expected);
            assert_eq!(of(&triangles[found.triangle]), expected);
        }
    }

    #[test]
    fn no_surface_is_none() {
        assert!(Surface::new(Vec::new()).is_none());
        assert!(Surface::new(vec![[Vec3::ONE; 3]]).is_none());
    }
}
