//! What places of a head see of each other: the ways of light that bounces.
//!
//! ```text
//! points, triangles at rest --median cuts by place and normal--> patches
//! every point --rays, cosine weighted--> patch that each meets, or none
//! ```
//!
//! The light that reaches a point from other places of the head is the mean over cosine-weighted directions of the radiance that
//! the ray of each meets, `E / pi = (1 / N) sum_k L(patch_k)`: the rendering equation without what the sky sends (Kajiya 1986;
//! for diffuse surfaces radiosity, Goral et al. 1984). A patch is a few square centimetres of similar normals with one radiance: the
//! mean over its points. So a shadow's edge is known to a patch, and light that goes on from there is as soft as that.
//!
//! Rays meet the head at rest. Where a pose opens or closes a cavity, who uses this scales the sum by how much more or less of the
//! sky a point sees ([`crate::head::BlendShape::occlusion`]).
//!
//! Does not: meet parts that are seen through or of hair, carry light between heads.

use glam::Vec3;
use rayon::prelude::*;

use crate::bvh::Bvh;

/// Rays of a point. Neighbours have other ones, and results are smoothed over them.
pub const RAYS: usize = 32;
/// The patch of a ray that meets nothing, or a surface from behind.
pub const NONE: u16 = u16::MAX;
/// Patches of a head, at most.
pub const MOST_PATCHES: usize = 1024;
/// Points of a patch below which it is not cut.
const LEAST_POINTS: usize = 12;
/// Rays start this far off the surface, as part of the head's height: 0.1 mm on an adult head.
const START: f32 = 3e-4;
/// Millimetres at which places are as different as unit normals at right angles, as part of the head's height: 15 mm.
const NORMAL_SCALE: f32 = 0.05;
/// Ambient visibility from which a point is not asked for what it sees of the head.
const OPEN: f32 = 0.995;

/// The ways of light between places of a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// First entry of `patch_points` of each patch, and their number.
    pub patch_starts: Vec<u32>,
    /// Points of the surface, patch by patch.
    pub patch_points: Vec<u32>,
    /// [`RAYS`] patches of each point; [`NONE`] where a ray leaves the head.
    pub seen: Vec<u16>,
}

impl Exchange {
    /// Traces what each point of a closed or open surface sees of it. Triangles are counter-clockwise seen from outside;
    /// `visibility` is the ambient visibility of each point, where known.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]], visibility: &[f32]) -> Self {
        let mut normals = vec![Vec3::ZERO; points.len()];
        let mut is_used = vec![false; points.len()];
        for t in triangles {
            let [a, b, c] = t.map(|p| points[p as usize]);
            for p in t {
                normals[*p as usize] += (b - a).cross(c - a);
                is_used[*p as usize] = true;
            }
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Z));
        let used = (0..points.len() as u32).filter(|p| is_used[*p as usize]);
        let mut patch_points: Vec<u32> = used.collect();
        let (low, high) = patch_points
            .iter()
            .map(|p| points[*p as usize])
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let height = if patch_points.is_empty() { 1.0 } else { (high - low).y.max(f32::MIN_POSITIVE) };
        let key = |p: u32| {
            let (place, normal) = (points[p as usize], NORMAL_SCALE * height * normals[p as usize]);
            [place.x, place.y, place.z, normal.x, normal.y, normal.z]
        };
        let mut patch_starts = vec![0];
        cut(&mut patch_points, &key, MOST_PATCHES, 0, &mut patch_starts);
        let mut patch_of = vec![NONE; points.len()];
        for (patch, range) in patch_starts.windows(2).enumerate() {
            for p in &patch_points[range[0] as usize..range[1] as usize] {
                patch_of[*p as usize] = patch as u16;
            }
        }
        let bvh = Bvh::new(triangles.iter().map(|t| t.map(|p| points[p as usize])).collect());
        let near = START * height;
        let of_point = |p: usize| -> [u16; RAYS] {
            let mut seen = [NONE; RAYS];
            if !is_used[p] || visibility.get(p).is_some_and(|v| *v > OPEN) {
                return seen;
            }
            let (normal, turn) = (normals[p], (p as u32).wrapping_mul(0x9E37_79B9) as f32 / 2_f32.powi(32));
            let origin = points[p] + near * normal;
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            for (k, seen) in seen.iter_mut().enumerate() {
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
                let nearest = if u > v && u > w {
                    1
                } else if v > w {
                    2
                } else {
                    0
                };
                *seen = patch_of[corners[nearest] as usize];
            }
            seen
        };
        let seen = (0..points.len()).into_par_iter().flat_map_iter(of_point).collect();
        Self { patch_starts, patch_points, seen }
    }

    /// Number of patches.
    pub fn patches(&self) -> usize {
        self.patch_starts.len() - 1
    }

    /// Light that reaches each point from the surface, of the radiance of each patch, as radiance of a white surface.
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

/// Direction `k` of [`RAYS`] about +Z: a Hammersley set, turned by `turn` (of 1) in both coordinates.
fn cosine_weighted(k: usize, turn: f32) -> Vec3 {
    let u = (k as f32 + (7.31 * turn).fract()) / RAYS as f32;
    let phi = std::f32::consts::TAU * ((k as u32).reverse_bits() as f32 / 2_f32.powi(32) + turn);
    let (r, z) = (u.sqrt(), (1.0 - u).max(0.0).sqrt());
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// Cuts points in halves across the longest side of their keys until there are `parts`, and adds the end of each.
fn cut(points: &mut [u32], key: &impl Fn(u32) -> [f32; 6], parts: usize, start: u32, ends: &mut Vec<u32>) {
    if parts < 2 || points.len() < 2 * LEAST_POINTS {
        if !points.is_empty() {
            ends.push(start + points.len() as u32);
        }
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 6], [f32::NEG_INFINITY; 6]);
    for p in points.iter() {
        for (i, k) in key(*p).into_iter().enumerate() {
            (low[i], high[i]) = (low[i].min(k), high[i].max(k));
        }
    }
    let longest = (0..6).fold(0, |best, i| if high[i] - low[i] > high[best] - low[best] { i } else { best });
    let middle = points.len() / 2;
    points
        .select_nth_unstable_by(middle, |a, b| key(*a)[longest].total_cmp(&key(*b)[longest]).then(a.cmp(b)));
    let (first, second) = points.split_at_mut(middle);
    cut(first, key, parts / 2, start, ends);
    cut(second, key, parts / 2, start + middle as u32, ends);
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
        let exchange = Exchange::new(&points, &triangles, &[]);
        assert!(exchange.patches() <= MOST_PATCHES);
        assert_eq!(exchange.patch_points.len(), points.len());
        // The lower square shines.
        let half = points.len() / 2;
        let shining: Vec<Vec3> =
            (0..points.len()).map(|p| if p < half { Vec3::ONE } else { Vec3::ZERO }).collect();
        let patches = exchange.averaged(&shining);
        // Cuts by halves leave a patch or two with points of both.
        let mixed = patches.iter().filter(|v| v.x > 0.0 && v.x < 1.0).count();
        assert!(20 * mixed < patches.len(), "{mixed} of {}", patches.len());
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
        let exchange = Exchange::new(&points, &triangles, &[]);
        assert!(exchange.seen.iter().all(|s| *s == NONE));
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        grid(4, 0.0, true, &mut points, &mut triangles);
        grid(4, 0.3, false, &mut points, &mut triangles);
        let some = Exchange::new(&points, &triangles, &[]);
        assert!(some.seen.iter().any(|s| *s != NONE));
        let open = Exchange::new(&points, &triangles, &vec![1.0; points.len()]);
        assert!(open.seen.iter().all(|s| *s == NONE));
        let none = Exchange::new(&[], &[], &[]);
        assert_eq!((none.patches(), none.seen.len()), (0, 0));
    }
}
