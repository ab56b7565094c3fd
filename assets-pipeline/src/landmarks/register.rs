//! The canonical face laid over a surface: first rigid with its size, then bending.
//!
//! Corresponding points are nearest in place, normal and bump together, so that lips meet lips and not the cheek beside
//! them. The bend is a map of radial functions (as in `synthesize::face_space`) fitted with a price on bending, which
//! falls from round to round (iterative closest points that bend: B. Amberg, S. Romdhani and T. Vetter 2007).

use glam::{DVec3, Mat3, Vec3};
use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

use super::surface::{Cloud, Similarity};
use super::template::{Template, is_inner, template};
use super::tree::Tree;

/// The nearest points of a surface.
pub(super) struct Target<'a> {
    pub cloud: &'a Cloud,
    tree: Tree<7>,
}

/// A point of the template and where it belongs.
struct Match {
    /// Index of the point of the template.
    point: usize,
    /// Index of the point of the cloud.
    target: usize,
    weight: f32,
}

impl<'a> Target<'a> {
    pub(super) fn new(cloud: &'a Cloud) -> Self {
        Self { cloud, tree: Tree::new(&cloud.keys()) }
    }

    /// Corresponding points of moved places; `reach` is in centimetres of the keys.
    fn matches(&self, template: &Template, moved: &[Vec3], normals: &[Vec3], reach: f32) -> Vec<Match> {
        (0..moved.len())
            .into_par_iter()
            .filter_map(|i| {
                let key = Cloud::key(moved[i], normals[i], template.cloud.bumps[i]);
                let (target, d2) = self.tree.nearest(&key, reach)?;
                // Biweight of J. Tukey: what is far off does not pull.
                let t = 1.0 - d2 / (reach * reach);
                let is_facing = self.cloud.normals[target].dot(normals[i]) > 0.4;
                is_facing.then(|| Match { point: i, target, weight: template.weights[i] * t * t })
            })
            .collect()
    }
}

/// Corrects a pose of a cloud in nearly canonical space: the similarity from the cloud's space to the canonical one.
pub(super) fn align(target: &Target<'_>, rounds: usize) -> Similarity {
    let template = template();
    let mut pose = Similarity::IDENTITY;
    for round in 0..rounds {
        let moved: Vec<Vec3> = template.cloud.places.iter().map(|p| pose.apply(*p)).collect();
        let turn = pose.linear * (1.0 / pose.scale());
        let normals: Vec<Vec3> = template.cloud.normals.iter().map(|n| turn * *n).collect();
        let reach = 3.2 - 1.4 * round as f32 / rounds.max(1) as f32;
        let matches = target.matches(template, &moved, &normals, reach);
        let Some(next) = fit_similarity(template, target.cloud, &matches, &moved) else { break };
        pose = next;
    }
    pose.inverse()
}

/// The pose of corresponding points. They slide along the surface: of the way along it only a part counts.
fn fit_similarity(
    template: &Template,
    cloud: &Cloud,
    matches: &[Match],
    moved: &[Vec3],
) -> Option<Similarity> {
    let total: f32 = matches.iter().map(|m| m.weight).sum();
    if matches.len() < 30 || total <= 0.0 {
        return None;
    }
    let pairs: Vec<(Vec3, Vec3, f32)> = (matches.iter())
        .map(|m| {
            (template.cloud.places[m.point], aim(moved[m.point], cloud, m.target, 0.5), m.weight / total)
        })
        .collect();
    similarity_of(&pairs, (0.5, 2.0))
}

/// Least squares rotation, scale (within limits) and translation of pairs whose weights sum to one (S. Umeyama 1991).
pub(super) fn similarity_of(pairs: &[(Vec3, Vec3, f32)], scales: (f64, f64)) -> Option<Similarity> {
    let mean = |of: fn(&(Vec3, Vec3, f32)) -> Vec3| pairs.iter().map(|p| of(p) * p.2).sum::<Vec3>();
    let (from, to) = (mean(|p| p.0), mean(|p| p.1));
    let mut h = Matrix3::<f64>::zeros();
    let mut spread = 0.0f64;
    for (a, b, w) in pairs {
        let (a, b) = ((*a - from).as_dvec3(), (*b - to).as_dvec3());
        spread += f64::from(*w) * a.length_squared();
        for i in 0..3 {
            for j in 0..3 {
                h[(i, j)] += f64::from(*w) * b[i] * a[j];
            }
        }
    }
    let svd = h.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    let sign = if (u * vt).determinant() < 0.0 { -1.0 } else { 1.0 };
    let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign));
    let r = u * flip * vt;
    let trace = svd.singular_values[0] + svd.singular_values[1] + sign * svd.singular_values[2];
    let scale = (trace / spread.max(1e-9)).clamp(scales.0, scales.1);
    let linear = Mat3::from_cols_array(&std::array::from_fn(|i| (scale * r[(i % 3, i / 3)]) as f32));
    Some(Similarity { linear, shift: to - linear * from })
}

/// Where a point should go: onto the plane of its counterpart, and a part of the way along it.
fn aim(place: Vec3, cloud: &Cloud, target: usize, slide: f32) -> Vec3 {
    let way = cloud.places[target] - place;
    let normal = cloud.normals[target];
    let across = normal * normal.dot(way);
    place + across + (way - across) * slide
}

/// A smooth map of canonical places, near the identity.
#[derive(Clone, Debug)]
pub(super) struct Bend {
    centers: Vec<Vec3>,
    /// One per center, then those of 1, x, y, z (in units of 100 mm).
    weights: Vec<DVec3>,
}

/// Smoothing length of the radial functions, mm.
const ROUNDING_MM: f64 = 12.0;
/// Centers of radial functions.
const CENTERS: usize = 110;

fn kernel(d: Vec3) -> f64 {
    // Negative distance is conditionally positive definite: -w K w is the price of bending.
    -(f64::from(d.length_squared()) + ROUNDING_MM * ROUNDING_MM).sqrt() * 0.01
}

fn linear_terms(p: Vec3) -> [f64; 4] {
    [1.0, f64::from(p.x) * 0.01, f64::from(p.y) * 0.01, f64::from(p.z) * 0.01]
}

impl Bend {
    fn identity() -> Self {
        let template = template();
        // Points far from each other (the greedy choice of T. Gonzalez 1985), from the tip of the nose on.
        let places = &template.cloud.places;
        let mut distance = vec![f32::MAX; places.len()];
        let mut centers = Vec::new();
        let mut next = (0..places.len()).max_by(|a, b| places[*a].z.total_cmp(&places[*b].z)).unwrap_or(0);
        for _ in 0..CENTERS.min(places.len()) {
            centers.push(places[next]);
            for (i, d) in distance.iter_mut().enumerate() {
                // Denser on the inner face.
                let share = if is_inner(places[i]) { 1.6 } else { 1.0 };
                *d = d.min(places[i].distance(places[next]) * share);
            }
            next = (0..places.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0);
        }
        let mut weights = vec![DVec3::ZERO; centers.len() + 4];
        let n = centers.len();
        weights[n + 1] = DVec3::X * 100.0;
        weights[n + 2] = DVec3::Y * 100.0;
        weights[n + 3] = DVec3::Z * 100.0;
        Self { centers, weights }
    }

    pub(super) fn apply(&self, p: Vec3) -> Vec3 {
        let n = self.centers.len();
        let radial: DVec3 = self.centers.iter().zip(&self.weights).map(|(c, w)| *w * kernel(p - *c)).sum();
        let linear: DVec3 = linear_terms(p).iter().zip(&self.weights[n..]).map(|(t, w)| *w * *t).sum();
        (radial + linear).as_vec3()
    }

    /// Places and normals of the template, bent.
    fn moved(&self, template: &Template) -> (Vec<Vec3>, Vec<Vec3>) {
        let cloud = &template.cloud;
        (0..cloud.places.len())
            .into_par_iter()
            .map(|i| {
                let (p, n) = (cloud.places[i], cloud.normals[i]);
                // Tangents move with the bend; their cross product is the normal.
                let (a, b) = n.any_orthonormal_pair();
                let along = |d: Vec3| self.apply(p + d * 2.0) - self.apply(p - d * 2.0);
                (self.apply(p), along(a).cross(along(b)).normalize_or(n))
            })
            .unzip()
    }

    /// The linear part alone.
    fn linear(&self) -> [DVec3; 3] {
        let n = self.centers.len();
        [1, 2, 3].map(|k| self.weights[n + k] * 0.01)
    }

    /// The bend that takes places to targets best. `stiffness` is the price of bending.
    fn fit(&mut self, pairs: &[(Vec3, Vec3, f32)], stiffness: f64) -> Option<()> {
        let (n, m) = (self.centers.len(), self.centers.len() + 4);
        // Rows of sqrt(weight) times the basis; normal equations.
        let mut rows = DMatrix::<f64>::zeros(pairs.len(), m);
        let mut right = DMatrix::<f64>::zeros(pairs.len(), 3);
        for (i, (from, to, weight)) in pairs.iter().enumerate() {
            let root = f64::from(weight.max(0.0)).sqrt();
            for (k, c) in self.centers.iter().enumerate() {
                rows[(i, k)] = root * kernel(*from - *c);
            }
            for (k, t) in linear_terms(*from).into_iter().enumerate() {
                rows[(i, n + k)] = root * t;
            }
            for axis in 0..3 {
                right[(i, axis)] = root * f64::from(to[axis]);
            }
        }
        let mut normal = rows.tr_mul(&rows);
        let right = rows.tr_mul(&right);
        // A ridge on the weights stands for the energy of the bend.
        for i in 0..n {
            normal[(i, i)] += stiffness;
        }
        for i in n..m {
            normal[(i, i)] += 1e-6;
        }
        let solution = normal.cholesky()?.solve(&right);
        if solution.iter().any(|v| !v.is_finite()) {
            return None;
        }
        self.weights =
            (0..m).map(|i| DVec3::new(solution[(i, 0)], solution[(i, 1)], solution[(i, 2)])).collect();
        Some(())
    }
}

/// How well a bent template lies on a surface; all over the inner face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quality {
    /// Mean distance from the surface along its normal, mm, up to 10.
    pub distance_mm: f32,
    /// Mean cosine between normals.
    pub normals: f32,
    /// Correlation of bumps.
    pub bumps: f32,
    /// Spread of the bumps of the surface over that of the template.
    pub relief: f32,
    /// Share of points with a counterpart.
    pub covered: f32,
    /// Root mean square of the bend without its linear part, mm.
    pub bend_mm: f32,
    /// Largest over smallest stretch of the linear part.
    pub stretch: f32,
}

/// Stiffness and slide by round.
const ROUNDS: [(f64, f32); 10] = [
    (3.0, 0.5),
    (1.0, 0.5),
    (0.3, 0.5),
    (0.1, 0.5),
    (0.05, 0.5),
    (0.02, 0.5),
    (0.01, 0.5),
    (0.006, 0.45),
    (0.004, 0.4),
    (0.004, 0.4),
];

/// Rounds that are left to a bend that starts from another.
const LAST_ROUNDS: usize = 4;

/// Bends the template onto a surface in nearly canonical space. `fixed` are canonical places whose targets are known; a
/// bend that was found without them is a start.
pub(super) fn bend(target: &Target<'_>, fixed: &[(Vec3, Vec3)], start: Option<Bend>) -> (Bend, Quality) {
    let template = template();
    let first = if start.is_some() { ROUNDS.len() - LAST_ROUNDS } else { 0 };
    let mut bend = start.unwrap_or_else(Bend::identity);
    let identity: &[Vec3] = &template.cloud.places;
    let (mut moved, mut normals) = bend.moved(template);
    let total: f32 = template.weights.iter().sum();
    for (round, (stiffness, slide)) in ROUNDS.into_iter().enumerate().skip(first) {
        let reach = 2.2 - 0.09 * round as f32;
        let matches = target.matches(template, &moved, &normals, reach);
        let mut pairs: Vec<(Vec3, Vec3, f32)> = (matches.iter())
            .map(|m| {
                let to = aim(moved[m.point], target.cloud, m.target, slide);
                (template.cloud.places[m.point], to, m.weight)
            })
            .collect();
        // Points without a counterpart stay in their surroundings.
        let mut is_matched = vec![false; moved.len()];
        matches.iter().for_each(|m| is_matched[m.point] = true);
        for i in (0..moved.len()).filter(|i| !is_matched[*i]) {
            pairs.push((identity[i], moved[i], 0.02));
        }
        pairs.extend(fixed.iter().map(|(from, to)| (*from, *to, 0.06 * total)));
        if bend.fit(&pairs, stiffness * f64::from(total) * 0.01).is_none() {
            break;
        }
        (moved, normals) = bend.moved(template);
    }
    let quality = quality(target, &bend, &moved, &normals);
    (bend, quality)
}

fn quality(target: &Target<'_>, bend: &Bend, moved: &[Vec3], normals: &[Vec3]) -> Quality {
    let template = template();
    let keys: Vec<[f32; 3]> = target.cloud.places.iter().map(|p| p.to_array()).collect();
    let tree = Tree::new(&keys);
    let inner: Vec<usize> = (0..moved.len())
        .filter(|i| is_inner(template.cloud.places[*i]) && template.weights[*i] > 0.5)
        .collect();
    let (mut distance, mut cosine, mut covered) = (0.0f32, 0.0f32, 0usize);
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for i in &inner {
        let found = tree.nearest(&moved[*i].to_array(), 10.0);
        let Some((j, _)) = found.filter(|(j, _)| target.cloud.normals[*j].dot(normals[*i]) > 0.0) else {
            distance += 10.0;
            continue;
        };
        covered += 1;
        distance += (target.cloud.places[j] - moved[*i]).dot(target.cloud.normals[j]).abs();
        cosine += target.cloud.normals[j].dot(normals[*i]);
        a.push(template.cloud.bumps[*i]);
        b.push(target.cloud.bumps[j]);
    }
    let count = inner.len().max(1) as f32;
    let n = covered.max(1) as f32;
    let spread = |v: &[f32]| {
        let mean = v.iter().sum::<f32>() / n;
        (v.iter().map(|x| (x - mean) * (x - mean)).sum::<f32>() / n).sqrt()
    };
    let (mean_a, mean_b) = (a.iter().sum::<f32>() / n, b.iter().sum::<f32>() / n);
    let product: f32 = a.iter().zip(&b).map(|(x, y)| (x - mean_a) * (y - mean_b)).sum::<f32>() / n;
    let (spread_a, spread_b) = (spread(&a).max(1e-3), spread(&b).max(1e-3));
    let linear = bend.linear();
    let lengths = linear.map(|v| v.length() as f32);
    let largest = lengths.into_iter().fold(0.0, f32::max);
    let smallest = lengths.into_iter().fold(f32::MAX, f32::min);
    let mut off = 0.0;
    let mean_of = |places: &[Vec3]| inner.iter().map(|i| places[*i]).sum::<Vec3>() / count;
    let (from, to) = (mean_of(&template.cloud.places), mean_of(moved));
    // The best linear map of the inner face, found by a few steps of least squares.
    let mut xx = Matrix3::<f64>::zeros();
    let mut yx = Matrix3::<f64>::zeros();
    for i in &inner {
        let (x, y) = ((template.cloud.places[*i] - from).as_dvec3(), (moved[*i] - to).as_dvec3());
        for r in 0..3 {
            for c in 0..3 {
                xx[(r, c)] += x[r] * x[c];
                yx[(r, c)] += y[r] * x[c];
            }
        }
    }
    if let Some(inverse) = xx.try_inverse() {
        let map = yx * inverse;
        for i in &inner {
            let (x, y) = ((template.cloud.places[*i] - from).as_dvec3(), (moved[*i] - to).as_dvec3());
            let fitted = map * nalgebra::Vector3::new(x.x, x.y, x.z);
            off += (DVec3::new(fitted.x, fitted.y, fitted.z) - y).length_squared() as f32;
        }
    }
    Quality {
        distance_mm: distance / count,
        normals: cosine / n,
        bumps: product / (spread_a * spread_b),
        relief: spread_b / spread_a,
        covered: covered as f32 / count,
        bend_mm: (off / count).sqrt(),
        stretch: largest / smallest.max(1e-3),
    }
}
