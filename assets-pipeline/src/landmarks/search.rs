//! Where in a surface a face may be: relief seen from many directions, compared with that of the canonical face.
//!
//! ```text
//! directions: upright first; else those in planes of symmetry
//!   --depth picture, relief at many scales--> normalised correlation with the canonical relief --> poses, best first
//! ```
//!
//! Relief is what stands out of its surroundings, so the roundness that a face shares with a ball does not count.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::raster::{Depth, DepthSums, Window};
use super::surface::{Similarity, Surface};
use super::template::{RELIEF_HEIGHT, RELIEF_LOW_MM, RELIEF_PIXEL_MM, RELIEF_RADIUS, RELIEF_WIDTH, template};
use super::tree::Tree;

/// A guess.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Canonical mm from the space of the head.
    pub pose: Similarity,
    /// Correlation of relief, -1 to 1.
    pub score: f32,
}

/// Scales that are tried.
#[derive(Clone, Copy)]
struct Scales {
    /// Height of the window that is looked for as part of the height of everything.
    largest: f32,
    smallest: f32,
    /// From one to the next.
    step: f32,
}

/// From a mask of a face to a whole body.
const UPRIGHT: Scales = Scales { largest: 1.1, smallest: 0.06, step: 1.13 };
/// Of heads that may be turned.
const TURNED: Scales = Scales { largest: 1.1, smallest: 0.26, step: 1.2 };
/// Candidates under this correlation are not looked at closer, but for the best.
const LEAST: f32 = 0.5;
/// Correlation from which an upright face is not looked for in other directions.
const CLEAR: f32 = 0.72;
/// Candidates that are handed on.
const MOST: usize = 5;

/// Poses, best first.
pub(super) fn candidates(surface: &Surface) -> Vec<Candidate> {
    let upright = [0.0f32, -18.0, 18.0].map(|pitch| Mat3::from_rotation_x(-pitch.to_radians()));
    let mut found = scan(surface, &upright, UPRIGHT);
    if found.first().is_none_or(|c| c.score < CLEAR) {
        let mut turns = Vec::new();
        for normal in symmetry_normals(surface) {
            let first = normal.any_orthonormal_vector();
            let second = normal.cross(first);
            for step in 0..12 {
                let (sin, cos) = (step as f32 * std::f32::consts::TAU / 12.0).sin_cos();
                let front = first * cos + second * sin;
                for up in [normal.cross(front), -normal.cross(front)] {
                    turns.push(Mat3::from_cols(up.cross(front), up, front).transpose());
                }
            }
        }
        found.extend(scan(surface, &turns, TURNED));
        found = distinct(found);
    }
    found
}

/// The best candidate of each direction and scale.
fn scan(surface: &Surface, turns: &[Mat3], scales: Scales) -> Vec<Candidate> {
    let found: Vec<Candidate> =
        turns.par_iter().flat_map_iter(|turn| scan_view(surface, turn, scales)).collect();
    distinct(found)
}

fn distinct(mut found: Vec<Candidate>) -> Vec<Candidate> {
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in found {
        let nose = Vec3::new(0.0, -33.0, 110.0);
        let is_new = |k: &Candidate| {
            // The nose of one in the canonical space of the other, and the directions of both.
            let between = candidate.pose.inverse().then(&k.pose);
            let turned = (between.linear * Vec3::Z).normalize_or_zero().dot(Vec3::Z);
            between.apply(nose).distance(nose) > 25.0 || turned < 0.85
        };
        let is_good = kept.is_empty() || candidate.score > LEAST;
        if is_good && kept.len() < MOST && kept.iter().all(is_new) {
            kept.push(candidate);
        }
    }
    kept
}

/// Pixels of the template that are compared: x, y, relief.
fn probes() -> Vec<(f32, f32, f32)> {
    let relief = &template().relief;
    let inside = |i: &usize| !relief[*i].is_nan();
    let every_other =
        |i: &usize| (i % RELIEF_WIDTH).is_multiple_of(2) && (i / RELIEF_WIDTH).is_multiple_of(2);
    (0..relief.len())
        .filter(inside)
        .filter(every_other)
        .map(|i| ((i % RELIEF_WIDTH) as f32, (i / RELIEF_WIDTH) as f32, relief[i]))
        .collect()
}

fn scan_view(surface: &Surface, turn: &Mat3, scales: Scales) -> Vec<Candidate> {
    let Scales { largest, smallest, step } = scales;
    let triangles: Vec<[Vec3; 3]> = surface.corners.iter().map(|t| t.map(|p| *turn * p)).collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for p in triangles.iter().flatten() {
        (low, high) = (low.min(*p), high.max(*p));
    }
    let height = high.y - low.y;
    if height.is_nan() || height <= 0.0 {
        return Vec::new();
    }
    let probes = probes();
    let mut found = Vec::new();
    let mut part = largest;
    while part > smallest {
        // Scales of an octave share a picture, fine enough for the smallest.
        let mut octave = Vec::new();
        while part > smallest && octave.first().is_none_or(|first| part > 0.5 * first) {
            octave.push(part);
            part /= step;
        }
        let window_height = RELIEF_HEIGHT as f32;
        let pixel = octave.last().map_or(1.0, |p| p * height / window_height);
        // Faces look forward out of the middle of what they belong to.
        let reach = octave[0] * height * (RELIEF_WIDTH as f32 / window_height);
        let middle = 0.5 * (low.x + high.x);
        let left = (middle - reach).max(low.x - 0.6 * reach);
        let right = (middle + reach).min(high.x + 0.6 * reach);
        let margin = Vec2::splat(0.1 * octave[0] * height);
        let window =
            Window::covering(Vec2::new(left, low.y) - margin, Vec2::new(right, high.y) + margin, pixel);
        let depth = Depth::draw(window, triangles.iter().copied());
        let sums = depth.sums();
        for part in octave {
            // Head units and picture pixels of a pixel of the template.
            let unit = part * height / window_height;
            let stride = unit / pixel;
            if let Some(candidate) = best_place((&depth, &sums), turn, unit, stride, &probes) {
                found.push(candidate);
            }
        }
    }
    found
}

/// The place of the template in a picture that correlates best.
fn best_place(
    (depth, sums): (&Depth, &DepthSums),
    turn: &Mat3,
    unit: f32,
    stride: f32,
    probes: &[(f32, f32, f32)],
) -> Option<Candidate> {
    let window = depth.window;
    let relief = depth.relief(sums, (RELIEF_RADIUS as f32 * stride).round() as usize);
    let mm = RELIEF_PIXEL_MM / unit;
    let offsets: Vec<(isize, f32)> = (probes.iter())
        .map(|(x, y, r)| {
            let (x, y) = ((x * stride).round() as isize, (y * stride).round() as isize);
            (y * window.width as isize + x, *r)
        })
        .collect();
    let count = offsets.len() as f32;
    let (sum, sum2) = offsets.iter().fold((0.0, 0.0), |(s, s2), (_, r)| (s + r, s2 + r * r));
    let own_spread = (sum2 - sum * sum / count).max(1e-6);
    let extent = (
        ((RELIEF_WIDTH - 1) as f32 * stride).ceil() as usize + 1,
        ((RELIEF_HEIGHT - 1) as f32 * stride).ceil() as usize + 1,
    );
    if extent.0 >= window.width || extent.1 >= window.height {
        return None;
    }
    let step = (stride.round() as usize).max(1);
    let mut best: Option<(f32, usize, usize)> = None;
    for y in (0..window.height - extent.1).step_by(step) {
        for x in (0..window.width - extent.0).step_by(step) {
            let start = (y * window.width + x) as isize;
            let (mut n, mut b, mut b2, mut ab, mut a) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
            for (offset, r) in &offsets {
                let i = (start + offset) as usize;
                if depth.covers(i) {
                    // Relief over 12 mm is an edge of something in front.
                    let v = (relief[i] * mm).clamp(-12.0, 12.0);
                    n += 1.0;
                    a += r;
                    b += v;
                    b2 += v * v;
                    ab += r * v;
                }
            }
            if n < 0.85 * count {
                continue;
            }
            let spread = (b2 - b * b / n).max(0.0);
            // Less than a third of the relief of a face, or more than twice, is no face.
            let amplitude = (spread * count / n / own_spread).sqrt();
            let plausible = (amplitude / 0.35).min(1.0) * (2.4 / amplitude.max(1e-6)).min(1.0);
            let correlation = (ab - a * b / n) / (own_spread * spread).sqrt().max(1e-6);
            let score = correlation * plausible * (n / count);
            if best.is_none_or(|(s, ..)| score > s) {
                best = Some((score, x, y));
            }
        }
    }
    let (score, x, y) = best?;
    // The template's first pixel lies on this one.
    let corner = window.center(x, y);
    let flat = RELIEF_LOW_MM + Vec2::splat(0.5 * RELIEF_PIXEL_MM) - mm * corner;
    // Depth: the middle of what the inner points of the template ask for.
    let cloud = &template().cloud;
    let mut shifts: Vec<f32> = (cloud.places.iter())
        .filter(|p| super::template::is_inner(**p))
        .filter_map(|p| {
            let i = window.index((p.truncate() - flat) / mm)?;
            depth.covers(i).then(|| p.z - mm * depth.z[i])
        })
        .collect();
    if shifts.is_empty() {
        return None;
    }
    let middle = shifts.len() / 2;
    let (_, shift, _) = shifts.select_nth_unstable_by(middle, f32::total_cmp);
    let pose = Similarity { linear: *turn * mm, shift: flat.extend(*shift) };
    Some(Candidate { pose, score })
}

/// Normals of planes in which the surface nearly mirrors itself, best first.
fn symmetry_normals(surface: &Surface) -> Vec<Vec3> {
    let places = scattered(surface, 1600);
    if places.len() < 50 {
        return Vec::new();
    }
    let center = places.iter().sum::<Vec3>() / places.len() as f32;
    let size = places.iter().map(|p| p.distance(center)).sum::<f32>() / places.len() as f32;
    let keys: Vec<[f32; 3]> = places.iter().map(|p| p.to_array()).collect();
    let tree = Tree::new(&keys);
    let cap = 0.3 * size;
    let cost = |normal: Vec3, offset: f32| -> f32 {
        let middle = center + normal * offset;
        let sum: f32 = (places.iter().step_by(6))
            .map(|p| {
                let mirrored = *p - normal * (2.0 * normal.dot(*p - middle));
                tree.nearest(&mirrored.to_array(), cap).map_or(cap, |(_, d2)| d2.sqrt())
            })
            .sum();
        sum
    };
    // Directions over a hemisphere (the spiral of R. Vogel 1979).
    const COUNT: usize = 220;
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let mut normals: Vec<(f32, Vec3, f32)> = (0..COUNT)
        .into_par_iter()
        .map(|i| {
            let z = (i as f32 + 0.5) / COUNT as f32;
            let (sin, cos) = (golden * i as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let normal = Vec3::new(r * cos, r * sin, z);
            (cost(normal, 0.0), normal, 0.0)
        })
        .collect();
    normals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<(f32, Vec3, f32)> = Vec::new();
    for n in normals {
        if kept.len() < 5 && kept.iter().all(|k| k.1.dot(n.1).abs() < 0.93) {
            kept.push(n);
        }
    }
    kept.par_iter_mut().for_each(|best| {
        let mut step = 0.10f32;
        while step > 0.012 {
            let (a, b) = best.1.any_orthonormal_pair();
            let tries = [
                (a * step, 0.0),
                (a * -step, 0.0),
                (b * step, 0.0),
                (b * -step, 0.0),
                (Vec3::ZERO, 0.5 * step * size),
                (Vec3::ZERO, -0.5 * step * size),
            ];
            let improved = tries
                .iter()
                .map(|(turn, shift)| {
                    let normal = (best.1 + *turn).normalize();
                    (cost(normal, best.2 + shift), normal, best.2 + shift)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match improved {
                Some(better) if better.0 < best.0 => *best = better,
                _ => step *= 0.6,
            }
        }
    });
    kept.sort_by(|a, b| a.0.total_cmp(&b.0));
    kept.truncate(3);
    kept.into_iter().map(|k| k.1).collect()
}

/// Points spread evenly by area.
fn scattered(surface: &Surface, count: usize) -> Vec<Vec3> {
    let area = |[a, b, c]: &[Vec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
    let total: f32 = surface.corners.iter().map(area).sum();
    let spacing = total / count as f32;
    let (mut next, mut sum, mut places) = (0.5 * spacing, 0.0, Vec::new());
    if spacing <= 0.0 || !spacing.is_finite() {
        return places;
    }
    for t in &surface.corners {
        let area = area(t);
        while next < sum + area && places.len() < count {
            // Low-discrepancy barycentric coordinates (M. Roberts 2018).
            let i = places.len() as f32;
            let (mut u, mut v) = ((0.754_877_7 * i).fract(), (0.569_840_3 * i).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            places.push(t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v);
            next += spacing;
        }
        sum += area;
    }
    places
}
