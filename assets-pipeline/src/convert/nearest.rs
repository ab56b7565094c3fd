//! The nearest place of a surface: triangles in a grid of cells.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

/// Cells along the longest side of the surface: some ten triangles each in a head.
const CELLS: f32 = 48.0;

/// Triangles in a grid.
pub(super) struct Surface {
    triangles: Vec<[Vec3; 3]>,
    cells: HashMap<IVec3, Vec<u32>>,
    cell: f32,
    low: IVec3,
    high: IVec3,
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
        let corners = || triangles.iter().flatten().copied();
        let (low, high) = (corners().reduce(Vec3::min)?, corners().reduce(Vec3::max)?);
        let cell = (high - low).max_element() / CELLS;
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let mut surface = Self { triangles, cells: HashMap::new(), cell, low: IVec3::MAX, high: IVec3::MIN };
        for (i, [a, b, c]) in surface.triangles.iter().enumerate() {
            let (low, high) = (surface.cell_of(a.min(*b).min(*c)), surface.cell_of(a.max(*b).max(*c)));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        surface.cells.entry(IVec3::new(x, y, z)).or_default().push(i as u32);
                    }
                }
            }
            (surface.low, surface.high) = (surface.low.min(low), surface.high.max(high));
        }
        Some(surface)
    }

    fn cell_of(&self, p: Vec3) -> IVec3 {
        (p / self.cell).floor().as_ivec3()
    }

    /// The place nearest to a point.
    pub(super) fn nearest(&self, p: Vec3) -> Place {
        let middle = self.cell_of(p);
        // Shells of cells about the point until no farther shell can hold anything nearer.
        let inside = middle.clamp(self.low, self.high);
        let first = (middle - inside).abs().max_element();
        let last = first + (self.high - self.low).max_element() + 1;
        let mut best = Place { distance: f32::INFINITY, triangle: 0, weights: Vec3::X };
        for shell in first..=last {
            if best.distance <= (shell - 1).max(0) as f32 * self.cell {
                break;
            }
            for cell in shell_cells(shell).map(|c| middle + c) {
                for i in self.cells.get(&cell).into_iter().flatten() {
                    let triangle = *i as usize;
                    let [a, b, c] = self.triangles[triangle];
                    let weights = nearest_in_triangle(p, a, b, c);
                    let distance = (a * weights.x + b * weights.y + c * weights.z).distance(p);
                    if distance < best.distance {
                        best = Place { distance, triangle, weights };
                    }
                }
            }
        }
        best
    }
}

/// Offsets of the cells at a Chebyshev distance.
fn shell_cells(n: i32) -> impl Iterator<Item = IVec3> {
    (-n..=n).flat_map(move |z| {
        (-n..=n).flat_map(move |y| {
            let is_face = z.abs() == n || y.abs() == n;
            let step = if is_face || n == 0 { 1 } else { 2 * n };
            (-n..=n).step_by(step as usize).map(move |x| IVec3::new(x, y, z))
        })
    })
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
    fn shells_hold_each_cell_once() {
        assert_eq!(shell_cells(2).count(), 5 * 5 * 5 - 27);
        assert_eq!(shell_cells(0).count(), 1);
    }

    #[test]
    fn no_surface_is_none() {
        assert!(Surface::new(Vec::new()).is_none());
        assert!(Surface::new(vec![[Vec3::ONE; 3]]).is_none());
    }
}
