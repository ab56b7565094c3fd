//! What places of a head see of each other: the ways of light that bounces.
//!
//! ```text
//! points, triangles in each pose --rays, cosine weighted--> point that each meets, or none
//! points that rays meet --cuts by place and normal--> patches
//! ```
//!
//! The light that reaches a point from other places of the head is the mean over cosine-weighted directions of the radiance that
//! the ray of each meets, `E / pi = (1 / N) sum_k L(patch_k)`: the rendering equation without what the sky sends (Kajiya 1986;
//! for diffuse surfaces radiosity, Goral et al. 1984). A patch has one radiance, the mean over its points.
//!
//! How wrong that is grows with what differs within a patch and with how many rays of visible places meet it. So the patch that is cut next is
//! the one whose places and normals differ most, each weighted by the rays that meet it: many small patches in the mouth, behind the ears and beside the nose,
//! few large ones elsewhere, and none where no ray arrives. Patches of equal numbers of points mixed the front of teeth with their back and both sides
//! of an ear (`docs/light.md`).
//!
//! Rays meet the head in some poses: at rest, and with an open mouth, where a palate does not see the tongue on which it lay. Between such poses, who
//! uses this scales the sum by how much more or less of the sky a point sees ([`crate::head::BlendShape::occlusion`]).
//!
//! Does not: meet parts that are seen through or of hair, carry light between heads.

use std::collections::BinaryHeap;

use glam::Vec3;
use rayon::prelude::*;

use crate::bvh::Bvh;

/// Rays of a point. Neighbours have other ones, and results are smoothed over them.
pub const RAYS: usize = 32;
/// The patch of a ray that meets nothing, or a surface from behind.
pub const NONE: u16 = u16::MAX;
/// Patches of a head, at most.
pub const MOST_PATCHES: usize = 1024;
/// Rays start this far off the surface, as part of the head's height: 0.1 mm on an adult head.
const START: f32 = 3e-4;
/// Distance at which places are as different as unit normals at right angles, as part of the head's height: 15 mm.
const NORMAL_SCALE: f32 = 0.05;
/// Ambient visibility from which a point is not asked for what it sees of the head.
const OPEN: f32 = 0.995;
/// What a ray counts that starts where nothing is seen of the sky, beside one that starts in the open.
const HIDDEN: f32 = 0.02;

/// A surface in one pose.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a> {
    /// Places, in any unit of length.
    pub points: &'a [Vec3],
    /// Ambient visibility of each point, 0 to 1; empty where it is not known.
    pub visibility: &'a [f32],
}

/// The ways of light between places of a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// First entry of `patch_points` of each patch, and their number.
    pub patch_starts: Vec<u32>,
    /// Points that rays meet, patch by patch.
    pub patch_points: Vec<u32>,
    /// [`RAYS`] patches of each point, pose after pose; [`NONE`] where a ray leaves the head.
    pub seen: Vec<u16>,
}

impl Exchange {
    /// Traces what each point of a closed or open surface sees of it in some poses, of which the first says what lies side by side in a patch. Triangles
    /// are counter-clockwise seen from outside.
    pub fn new(triangles: &[[u32; 3]], poses: &[Pose<'_>]) -> Self {
        let Some(first) = poses.first() else {
            return Self { patch_starts: vec![0], patch_points: Vec::new(), seen: Vec::new() };
        };
        let count = first.points.len();
        let traced: Vec<(Vec<Option<Vec3>>, Vec<u32>)> =
            poses.iter().map(|pose| traced(triangles, pose)).collect();
        let mut met = vec![0.0f32; count];
        for p in 0..count {
            let known = poses.iter().map(|pose| pose.visibility.get(p).copied().unwrap_or(1.0));
            let weight = known.fold(HIDDEN, f32::max);
            for (_, nearest) in &traced {
                let there = nearest[RAYS * p..RAYS * (p + 1)].iter().filter(|q| **q != NO_POINT);
                there.for_each(|q| met[*q as usize] += weight);
            }
        }
        let mut patch_points: Vec<u32> = (0..count as u32).filter(|p| met[*p as usize] > 0.0).collect();
        let scale = NORMAL_SCALE * height(first.points, &traced[0].0);
        let key = |p: u32| {
            let (place, normal) =
                (first.points[p as usize], scale * traced[0].0[p as usize].unwrap_or(Vec3::Z));
            [place.x, place.y, place.z, normal.x, normal.y, normal.z]
        };
        let patch_starts = cut(&mut patch_points, &key, &met);
        let mut patch_of = vec![NONE; count];
        for (patch, range) in patch_starts.windows(2).enumerate() {
            for p in &patch_points[range[0] as usize..range[1] as usize] {
                patch_of[*p as usize] = patch as u16;
            }
        }
        let patch = |q: &u32| patch_of.get(*q as usize).copied().unwrap_or(NONE);
        let seen = traced.iter().flat_map(|(_, nearest)| nearest.iter().map(patch)).collect();
        Self { patch_starts, patch_points, seen }
    }

    /// Number of patches.
    pub fn patches(&self) -> usize {
        self.patch_starts.len() - 1
    }

    /// Light that reaches each point from the surface, pose after pose, of the radiance of each patch, as radiance of a white surface.
    pub fn gathered(&self, radiance: &[Vec3]) -> Vec<Vec3> {
        let of = |seen: &[u16]| {
            let met = seen.iter().filter(|s| **s != NONE);
            met.map(|s| radiance[*s as usize]).sum::<Vec3>() / RAYS as f32
        };
        self.seen.chunks_exact(RAYS).map(of).collect()
    }

    /// Mean over the points of each patch.
    pub fn averaged(&self, of_points: &[Vec3]) -> Vec<Vec3> {
        let mean = |range: &[u32]| {
            let points = &self.patch_points[range[0] as usize..range[1] as usize];
            points.iter().map(|p| of_points[*p as usize]).sum::<Vec3>() / points.len().max(1) as f32
        };
        self.patch_starts.windows(2).map(mean).collect()
    }
}

/// Unit normal of each point that a triangle has; +Z where its triangles have no area.
fn normals_of(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Option<Vec3>> {
    let mut sums = vec![None; points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|p| points[p as usize]);
        for p in t {
            *sums[*p as usize].get_or_insert(Vec3::ZERO) += (b - a).cross(c - a);
        }
    }
    sums.into_iter().map(|n| n.map(|n| n.normalize_or(Vec3::Z))).collect()
}

/// From the lowest to the highest point that a triangle has.
fn height(points: &[Vec3], normals: &[Option<Vec3>]) -> f32 {
    let heights = points.iter().zip(normals).filter(|(_, n)| n.is_some()).map(|(p, _)| p.y);
    let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    (high - low).max(f32::MIN_POSITIVE)
}

/// In place of a point where a ray leaves the surface, or meets it from behind.
const NO_POINT: u32 = u32::MAX;

/// Normals of points, and the corner nearest to where each of their [`RAYS`] rays meets the surface.
fn traced(triangles: &[[u32; 3]], pose: &Pose<'_>) -> (Vec<Option<Vec3>>, Vec<u32>) {
    let Pose { points, visibility } = *pose;
    let normals = normals_of(points, triangles);
    let bvh = Bvh::new(triangles.iter().map(|t| t.map(|p| points[p as usize])).collect());
    let near = START * height(points, &normals);
    let of_point = |p: usize| -> [u32; RAYS] {
        let mut nearest = [NO_POINT; RAYS];
        let Some(normal) = normals[p].filter(|_| visibility.get(p).is_none_or(|v| *v <= OPEN)) else {
            return nearest;
        };
        let turn = (p as u32).wrapping_mul(0x9E37_79B9) as f32 / 2_f32.powi(32);
        let origin = points[p] + near * normal;
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        for (k, nearest) in nearest.iter_mut().enumerate() {
            let direction = cosine_weighted(k, turn);
            let way = direction.x * tangent + direction.y * bitangent + direction.z * normal;
            let Some(met) = bvh.first(origin, way, near, f32::INFINITY, None) else { continue };
            let corners = triangles[met.triangle as usize];
            let [a, b, c] = corners.map(|p| points[p as usize]);
            if (b - a).cross(c - a).dot(way) >= 0.0 {
                continue;
            }
            let [u, v] = met.uv;
            let w = 1.0 - u - v;
            *nearest = corners[if u > v && u > w {
                1
            } else if v > w {
                2
            } else {
                0
            }];
        }
        nearest
    };
    let nearest = (0..points.len()).into_par_iter().flat_map_iter(of_point).collect();
    (normals, nearest)
}

/// Direction `k` of [`RAYS`] about +Z: a Hammersley set, turned by `turn` (of 1) in both coordinates.
fn cosine_weighted(k: usize, turn: f32) -> Vec3 {
    let u = (k as f32 + (7.31 * turn).fract()) / RAYS as f32;
    let phi = std::f32::consts::TAU * ((k as u32).reverse_bits() as f32 / 2_f32.powi(32) + turn);
    let (r, z) = (u.sqrt(), (1.0 - u).max(0.0).sqrt());
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// A range of points, and how far their keys are apart: the sum of weighted squares of distances to their mean.
struct Cell {
    start: usize,
    end: usize,
    spread: f32,
    /// Across which coordinate they are apart most, and their mean there.
    axis: usize,
    mean: f32,
}

impl Cell {
    fn of(points: &[u32], start: usize, key: &impl Fn(u32) -> [f32; 6], weights: &[f32]) -> Self {
        let (mut sum, mut sums) = (0.0f64, [[0.0f64; 2]; 6]);
        for p in points {
            let weight = f64::from(weights[*p as usize]);
            sum += weight;
            for (k, [once, square]) in key(*p).into_iter().zip(&mut sums) {
                *once += weight * f64::from(k);
                *square += weight * f64::from(k) * f64::from(k);
            }
        }
        let spreads = sums.map(|[once, square]| (square - once * once / sum).max(0.0));
        let axis = (1..6).fold(0, |best, i| if spreads[i] > spreads[best] { i } else { best });
        let spread = spreads.iter().sum::<f64>() as f32;
        Self { start, end: start + points.len(), spread, axis, mean: (sums[axis][0] / sum) as f32 }
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.spread.total_cmp(&other.spread).then(other.start.cmp(&self.start))
    }
}

/// Cuts points into at most [`MOST_PATCHES`] patches, the one that is apart most each time, and returns where each starts and the last one ends.
fn cut(points: &mut [u32], key: &impl Fn(u32) -> [f32; 6], weights: &[f32]) -> Vec<u32> {
    let mut whole = Vec::new();
    let mut waiting = BinaryHeap::new();
    if !points.is_empty() {
        waiting.push(Cell::of(points, 0, key, weights));
    }
    while whole.len() + waiting.len() < MOST_PATCHES {
        let Some(cell) = waiting.pop() else { break };
        let of_cell = &mut points[cell.start..cell.end];
        of_cell.sort_by(|a, b| key(*a)[cell.axis].total_cmp(&key(*b)[cell.axis]).then(a.cmp(b)));
        let middle = of_cell.partition_point(|p| key(*p)[cell.axis] < cell.mean);
        if middle == 0 || middle == of_cell.len() {
            // All at one place.
            whole.push(cell);
            continue;
        }
        let (low, high) = of_cell.split_at(middle);
        waiting.push(Cell::of(low, cell.start, key, weights));
        waiting.push(Cell::of(high, cell.start + middle, key, weights));
    }
    let mut starts: Vec<u32> = whole.iter().chain(&waiting).map(|cell| cell.start as u32).collect();
    starts.sort_unstable();
    starts.push(points.len() as u32);
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of `n` by `n` cells about the origin, side 1, at a height; facing up or down.
    fn grid(n: u32, y: f32, up: bool, points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
        let first = points.len() as u32;
        for i in 0..(n + 1) * (n + 1) {
            let (x, z) = ((i % (n + 1)) as f32 / n as f32 - 0.5, (i / (n + 1)) as f32 / n as f32 - 0.5);
            points.push(Vec3::new(x, y, z));
        }
        for i in 0..n * n {
            let a = first + i / n * (n + 1) + i % n;
            let [b, c, d] = [a + 1, a + n + 1, a + n + 2];
            // Seen from +Y counter-clockwise: x to the right, z towards the viewer.
            let both = if up { [[a, c, b], [b, c, d]] } else { [[a, b, c], [b, d, c]] };
            triangles.extend(both);
        }
    }

    #[test]
    fn light_between_squares_is_that_of_the_form_factor() {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        const N: u32 = 24;
        grid(N, 0.0, true, &mut points, &mut triangles);
        grid(N, 1.0, false, &mut points, &mut triangles);
        let exchange = Exchange::new(&triangles, &[Pose { points: &points, visibility: &[] }]);
        assert!(exchange.patches() <= MOST_PATCHES);
        // The lower square shines.
        let half = points.len() / 2;
        let shining: Vec<Vec3> =
            (0..points.len()).map(|p| if p < half { Vec3::ONE } else { Vec3::ZERO }).collect();
        let patches = exchange.averaged(&shining);
        assert!(patches.iter().all(|v| v.x == 0.0 || v.x == 1.0), "a patch has points of both");
        let found = exchange.gathered(&patches);
        let mean = |range: std::ops::Range<usize>| {
            found[range.clone()].iter().map(|v| v.x).sum::<f32>() / range.len() as f32
        };
        assert!(mean(0..half) < 0.01, "{}", mean(0..half));
        // Equal squares at the distance of their side: 0.1998 (Howell, catalogue of configuration factors, C-11). Points of
        // the border count as much as inner ones here, so the mean over points is a little lower.
        assert!((mean(half..2 * half) - 0.1998).abs() < 0.006, "{}", mean(half..2 * half));
        let middle = half + (N / 2 * (N + 1) + N / 2) as usize;
        let near: Vec<usize> =
            (0..9).map(|i| middle + i % 3 - 1 + (i / 3) * (N as usize + 1) - (N as usize + 1)).collect();
        let centre = near.iter().map(|p| found[*p].x).sum::<f32>() / 9.0;
        // A point over the middle of a square: 4 times C-11's element to rectangle, 0.2394 in all.
        assert!((centre - 0.2394).abs() < 0.02, "{centre}");
    }

    #[test]
    fn backs_and_open_points_see_nothing() {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        grid(4, 0.0, true, &mut points, &mut triangles);
        // Faces away from the first.
        grid(4, 1.0, true, &mut points, &mut triangles);
        let of = |points: &[Vec3], triangles: &[[u32; 3]], visibility: &[f32]| {
            Exchange::new(triangles, &[Pose { points, visibility }])
        };
        let exchange = of(&points, &triangles, &[]);
        assert!(exchange.seen.iter().all(|s| *s == NONE));
        assert_eq!(exchange.patches(), 0, "no ray meets anything");
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        grid(4, 0.0, true, &mut points, &mut triangles);
        grid(4, 0.3, false, &mut points, &mut triangles);
        let some = of(&points, &triangles, &[]);
        assert!(some.seen.iter().any(|s| *s != NONE));
        let open = of(&points, &triangles, &vec![1.0; points.len()]);
        assert!(open.seen.iter().all(|s| *s == NONE));
        let none = of(&[], &[], &[]);
        assert_eq!((none.patches(), none.seen.len()), (0, 0));
    }

    #[test]
    fn both_sides_of_a_thin_plate_are_in_patches_of_their_own() {
        // A plate as thin as a tooth between two others, so that rays meet both of its sides.
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        const N: u32 = 40;
        for (y, up) in [(0.0, true), (0.3, false), (0.302, true), (0.6, false)] {
            grid(N, y, up, &mut points, &mut triangles);
        }
        let exchange = Exchange::new(&triangles, &[Pose { points: &points, visibility: &[] }]);
        let side = |p: u32| p / ((N + 1) * (N + 1));
        for range in exchange.patch_starts.windows(2) {
            let of_patch = &exchange.patch_points[range[0] as usize..range[1] as usize];
            assert!(of_patch.iter().all(|p| side(*p) == side(of_patch[0])), "{of_patch:?}");
        }
        assert!(exchange.patches() > MOST_PATCHES / 2, "{}", exchange.patches());
    }

    #[test]
    fn every_pose_has_ways_of_its_own() {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        grid(8, 0.0, true, &mut points, &mut triangles);
        grid(8, 0.1, false, &mut points, &mut triangles);
        let far: Vec<Vec3> =
            points.iter().map(|p| if p.y > 0.0 { *p + 100.0 * Vec3::Y } else { *p }).collect();
        let pose = |points| Pose { points, visibility: &[] };
        let exchange = Exchange::new(&triangles, &[pose(&points), pose(&far)]);
        let (near, away) = exchange.seen.split_at(RAYS * points.len());
        let met = |seen: &[u16]| seen.iter().filter(|s| **s != NONE).count();
        let alone = Exchange::new(&triangles, &[pose(&points)]);
        let light = |e: &Exchange| e.gathered(&vec![Vec3::ONE; e.patches()])[..points.len()].to_vec();
        assert_eq!(light(&exchange), light(&alone));
        assert!(met(near) > near.len() / 2 && met(away) < away.len() / 50, "{} {}", met(near), met(away));
    }
}
