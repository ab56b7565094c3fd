//! Monte Carlo: photons walk through a half space under a pencil beam at normal incidence.
//!
//! ```text
//! enter at the origin -> flight (-ln u mean free paths) -> surface? Fresnel: out, into the ring of its radius | back in
//!                            ^                                |
//!                            +---- Henyey-Greenstein <----- collision: the weight of every albedo times that albedo
//! ```
//!
//! The walk runs in mean free paths and does not know the albedo: a photon that leaves after n collisions counts
//! `albedo^n`, for all albedos of the walk at once. One walk therefore gives the profile of every medium with its
//! anisotropy and index ([`AlbedoTable`]): `R(r) = sigma_t^2 R_unit(sigma_t r; albedo)`.
//!
//! Everything is per photon that passed the boundary; reflectance on the way in is not part of it.
//! Results depend on the seed and the number of photons, not on the number of threads.

use std::f64::consts::{LN_10, PI};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::medium::{ETA, Medium, fresnel_from_inside};
use super::profile::RadialProfile;
use super::table::RadialTable;
use crate::error::SkinError;
use crate::random::SplitMix64;

/// Photons are dealt to this many independent streams; the spread of their sums gives the standard errors.
const BATCHES: u64 = 64;

/// Largest albedo of a walk. The mean number of collisions grows as `1 / sqrt(1 - albedo)`: without absorption it is
/// infinite.
pub const MAX_ALBEDO: f64 = 0.9999;

/// How photons that meet the surface are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// When it leaves. Unbiased by construction; checks the other estimator.
    Analog,
    /// On each upward flight by the probability that it leaves on that flight. Same mean, less noise.
    Expected,
}

/// Rings of equal width in `ln r`: the singular centre and the tail get as many rings as the middle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rings {
    /// Outer radius of the innermost ring (a disk), mean free paths.
    pub inner: f64,
    /// Radius outside of which photons are only counted, mean free paths.
    pub outer: f64,
    /// Rings per decade of radius.
    pub per_decade: u32,
}

impl Default for Rings {
    fn default() -> Self {
        Self { inner: 1e-3, outer: 400.0, per_decade: 16 }
    }
}

impl Rings {
    fn count(&self) -> usize {
        1 + ((self.outer / self.inner).log10() * self.per_decade as f64).ceil() as usize
    }

    /// Edges, one more than rings, from 0, in mean free paths.
    pub fn edges(&self) -> Vec<f64> {
        let edge = |i: usize| self.inner * 10f64.powf(i as f64 / self.per_decade as f64);
        std::iter::once(0.0).chain((0..self.count()).map(edge)).collect()
    }
}

/// Parameters of a walk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotonWalk {
    /// Mean cosine g of the Henyey-Greenstein phase function; 0 for a reduced medium.
    pub anisotropy: f64,
    /// Index of refraction inside over outside.
    pub eta: f64,
    /// Albedos to count, each above 0 and at most [`MAX_ALBEDO`].
    pub albedos: Vec<f64>,
    /// Number of photons (rounded up to a multiple of 64).
    pub photons: u64,
    /// Seed of the random streams.
    pub seed: u64,
    /// How photons are counted.
    pub estimator: Estimator,
    /// Where they are counted.
    pub rings: Rings,
}

/// Light by ring, in mean free paths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WalkResult {
    /// The parameters of the walk.
    pub walk: PhotonWalk,
    /// Edges of the rings, mean free paths, from 0.
    pub edges: Vec<f64>,
    /// Fraction of the entered light that left in each ring, for each albedo; the last entry is outside of all rings.
    pub ring_light: Vec<Vec<f64>>,
    /// Standard error of each.
    pub ring_error: Vec<Vec<f64>>,
    /// Total diffuse reflectance for each albedo.
    pub total: Vec<f64>,
    /// Standard error of each.
    pub total_error: Vec<f64>,
}

impl PhotonWalk {
    /// A walk in a reduced medium (g = 0) with the defaults: expected counts, default rings.
    pub fn isotropic(eta: f64, albedos: Vec<f64>, photons: u64, seed: u64) -> Self {
        let (estimator, rings) = (Estimator::Expected, Rings::default());
        Self { anisotropy: 0.0, eta, albedos, photons, seed, estimator, rings }
    }

    fn validate(&self) -> Result<(), SkinError> {
        let Self { anisotropy: g, eta, photons, rings, .. } = self;
        if !(-0.999..=0.999).contains(g) {
            return Err(SkinError::new("walk.anisotropy", g, "a mean cosine from -0.999 to 0.999"));
        }
        if !ETA.contains(eta) {
            return Err(SkinError::new("walk.eta", eta, "a relative index of refraction from 0.5 to 3"));
        }
        if self.albedos.is_empty() {
            return Err(SkinError::new("walk.albedos", "none", "at least one albedo"));
        }
        for (i, a) in self.albedos.iter().enumerate() {
            if !(*a > 0.0 && *a <= MAX_ALBEDO) {
                let at = format!("walk.albedos[{i}]");
                return Err(SkinError::new(at, a, "an albedo above 0 and at most 0.9999"));
            }
        }
        if *photons == 0 {
            return Err(SkinError::new("walk.photons", 0, "at least one photon"));
        }
        let sound = rings.inner > 0.0 && rings.outer > rings.inner && rings.outer.is_finite();
        if !sound || !(1..=1000).contains(&rings.per_decade) {
            return Err(SkinError::new(
                "walk.rings",
                format!("{rings:?}"),
                "0 < inner < outer and 1 to 1000 rings per decade",
            ));
        }
        Ok(())
    }

    /// Walks all photons on all threads.
    pub fn run(&self) -> Result<WalkResult, SkinError> {
        self.validate()?;
        let per_batch = self.photons.div_ceil(BATCHES);
        let batches: Vec<Tally> =
            (0..BATCHES).into_par_iter().map(|batch| self.run_batch(batch, per_batch)).collect();

        let slots = self.rings.count() + 1;
        let statistics = |value: &dyn Fn(&Tally) -> f64| {
            let n = BATCHES as f64;
            let values = batches.iter().map(|t| value(t) / per_batch as f64);
            let mean = values.clone().sum::<f64>() / n;
            let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean, (variance / n).sqrt())
        };
        let count = self.albedos.len();
        let (mut ring_light, mut ring_error, mut total, mut total_error) = (vec![], vec![], vec![], vec![]);
        for k in 0..count {
            let rings = (0..slots).map(|j| statistics(&|t: &Tally| t.light[j * count + k]));
            let (light, error): (Vec<f64>, Vec<f64>) = rings.unzip();
            let (sum, sum_error) =
                statistics(&|t: &Tally| (0..slots).map(|j| t.light[j * count + k]).sum::<f64>());
            ring_light.push(light);
            ring_error.push(error);
            total.push(sum);
            total_error.push(sum_error);
        }
        Ok(WalkResult {
            walk: self.clone(),
            edges: self.rings.edges(),
            ring_light,
            ring_error,
            total,
            total_error,
        })
    }

    fn run_batch(&self, batch: u64, photons: u64) -> Tally {
        let mut random = Random::new(self.seed, batch);
        let mut tally = Tally::new(&self.rings, self.albedos.len());
        let mut weights = vec![0.0; self.albedos.len()];
        for _ in 0..photons {
            weights.fill(1.0);
            self.walk_photon(&mut random, &mut weights, &mut tally);
        }
        tally
    }

    fn walk_photon(&self, random: &mut Random, weights: &mut [f64], tally: &mut Tally) {
        // z is the depth, so a photon with w < 0 is on its way out.
        let (mut x, mut y, mut z) = (0.0f64, 0.0f64, 0.0f64);
        let (mut u, mut v, mut w) = (0.0f64, 0.0f64, 1.0f64);
        loop {
            let mut flight = random.free_path();
            if w < 0.0 {
                let way_out = -z / w;
                let (exit_x, exit_y) = (x + u * way_out, y + v * way_out);
                let expected = self.estimator == Estimator::Expected;
                let leaves = flight >= way_out;
                if expected || leaves {
                    let fresnel = fresnel_from_inside(-w, self.eta);
                    if expected && fresnel < 1.0 {
                        tally.count(exit_x, exit_y, weights, (1.0 - fresnel) * (-way_out).exp());
                    }
                    if leaves {
                        if random.uniform() >= fresnel {
                            if !expected {
                                tally.count(exit_x, exit_y, weights, 1.0);
                            }
                            return;
                        }
                        // Reflected: the rest of the flight goes down again.
                        (x, y, z) = (exit_x, exit_y, 0.0);
                        w = -w;
                        flight -= way_out;
                    }
                }
            }
            x += u * flight;
            y += v * flight;
            z += w * flight;

            if !survives(weights, &self.albedos, || random.uniform()) {
                return;
            }
            (u, v, w) = scatter((u, v, w), self.anisotropy, random);
        }
    }
}

/// Weights after a collision, one for each albedo, and whether the photon goes on: Russian roulette by the largest of
/// them, so that all weights die or are scaled together.
pub(super) fn survives(weights: &mut [f64], albedos: &[f64], uniform: impl FnOnce() -> f64) -> bool {
    const HEAVY: f64 = 0.1;
    const SURVIVAL: f64 = 0.25;
    let mut heaviest = 0.0f64;
    for (weight, albedo) in weights.iter_mut().zip(albedos) {
        // Nothing sees a weight so small, and subnormal numbers take a hundred times as long.
        *weight = if *weight < 1e-60 { 0.0 } else { *weight * albedo };
        heaviest = heaviest.max(*weight);
    }
    if heaviest >= HEAVY {
        return true;
    }
    let goes_on = uniform() < SURVIVAL;
    weights.iter_mut().for_each(|weight| *weight /= SURVIVAL);
    goes_on
}

/// A new direction by the phase function of Henyey and Greenstein 1941 (sampling: Witt 1977).
fn scatter((u, v, w): (f64, f64, f64), g: f64, random: &mut Random) -> (f64, f64, f64) {
    let cos = if g.abs() < 1e-3 {
        2.0 * random.uniform() - 1.0
    } else {
        let fraction = (1.0 - g * g) / (1.0 - g + 2.0 * g * random.uniform());
        ((1.0 + g * g - fraction * fraction) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let sin = (1.0 - cos * cos).sqrt();
    let (a, b) = random.unit_vector();
    if g.abs() < 1e-3 {
        return (sin * a, sin * b, cos);
    }
    // Basis without a pole (Duff et al. 2017).
    let sign = 1f64.copysign(w);
    let c = -1.0 / (sign + w);
    let d = u * v * c;
    let (a, b) = (sin * a, sin * b);
    let direction = (
        a * (1.0 + sign * u * u * c) + b * d + cos * u,
        a * sign * d + b * (sign + v * v * c) + cos * v,
        -a * sign * u - b * v + cos * w,
    );
    // Rounding would add up over thousands of collisions.
    let (x, y, z) = direction;
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    (x * scale, y * scale, z * scale)
}

/// Sums by ring, the albedos of a ring side by side.
struct Tally {
    light: Vec<f64>,
    albedos: usize,
    rings: usize,
    /// `ln(inner^2)` and rings per unit of `ln(r^2)`.
    log_inner2: f64,
    per_log2: f64,
}

impl Tally {
    fn new(rings: &Rings, albedos: usize) -> Self {
        Self {
            light: vec![0.0; (rings.count() + 1) * albedos],
            albedos,
            rings: rings.count(),
            log_inner2: 2.0 * rings.inner.ln(),
            per_log2: rings.per_decade as f64 / (2.0 * LN_10),
        }
    }

    fn count(&mut self, x: f64, y: f64, weights: &[f64], factor: f64) {
        // ln 0 is minus infinity, which the cast takes to ring 0.
        let steps = ((x * x + y * y).ln() - self.log_inner2) * self.per_log2;
        let ring = ((steps + 1.0).max(0.0) as usize).min(self.rings);
        let slot = &mut self.light[ring * self.albedos..][..self.albedos];
        for (sum, weight) in slot.iter_mut().zip(weights) {
            *sum += weight * factor;
        }
    }
}

impl WalkResult {
    /// The profile of albedo `k` in a medium of extinction `sigma_t_per_mm`.
    pub fn table(&self, k: usize, sigma_t_per_mm: f64) -> Result<RadialTable, SkinError> {
        check_extinction(sigma_t_per_mm)?;
        table(&self.edges, &self.ring_light[k], self.total[k], sigma_t_per_mm)
    }

    /// How far a profile in millimetres is from this walk for albedo `k` and extinction `sigma_t_per_mm`.
    pub fn compare(&self, k: usize, sigma_t_per_mm: f64, profile: &RadialProfile) -> RadialError {
        let rings = self.edges.len() - 1;
        let total = self.total[k];
        let beyond: Vec<f64> = self.edges.iter().map(|e| profile.mass_beyond(e / sigma_t_per_mm)).collect();
        let mut absolute = (beyond[rings] - self.ring_light[k][rings]).abs();
        for j in 0..rings {
            absolute += (beyond[j] - beyond[j + 1] - self.ring_light[k][j]).abs();
        }
        // The mean of |x| of a normal variable of standard deviation s is s sqrt(2 / pi).
        let noise: f64 = self.ring_error[k].iter().sum::<f64>() * (2.0 / PI).sqrt();
        RadialError { relative: absolute / total, noise: noise / total }
    }
}

fn check_extinction(sigma_t_per_mm: f64) -> Result<(), SkinError> {
    if sigma_t_per_mm > 0.0 && sigma_t_per_mm.is_finite() {
        return Ok(());
    }
    Err(SkinError::new("medium.sigma_t_per_mm", sigma_t_per_mm, "a positive finite coefficient"))
}

/// Rings in mean free paths to a profile in millimetres with the walk's total.
fn table(edges: &[f64], light: &[f64], total: f64, sigma_t_per_mm: f64) -> Result<RadialTable, SkinError> {
    // The innermost disk has no logarithmic middle: the table's own rule covers it.
    let edges_mm: Vec<f64> = edges[1..].iter().map(|e| e / sigma_t_per_mm).collect();
    let table = RadialTable::from_rings(&edges_mm, &light[1..edges.len() - 1])?;
    Ok(table.scaled(total / table.total()))
}

/// Distance of a profile from a Monte Carlo profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadialError {
    /// Integral of `|R - R_mc| 2 pi r` over the integral of `R_mc 2 pi r`, ring by ring.
    pub relative: f64,
    /// What the noise of the reference alone adds to that, for a perfect profile.
    pub noise: f64,
}

/// Profiles of every albedo, for one anisotropy and one index: a walk that can be stored.
///
/// The light of a ring over the albedo is interpolated by a polynomial in `x = sqrt(1 - albedo)` through Chebyshev
/// nodes, in the logarithm. In x it is smooth: Chandrasekhar's exact solution for the total is `1 - x H(1)`, and tails
/// fall with `sigma_tr ~ x`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WalkResult", into = "WalkResult")]
pub struct AlbedoTable {
    // Private: the nodes and rings of a table are what `try_from` checks.
    result: WalkResult,
}

impl From<AlbedoTable> for WalkResult {
    fn from(table: AlbedoTable) -> Self {
        table.result
    }
}

impl TryFrom<WalkResult> for AlbedoTable {
    type Error = SkinError;

    /// Checks that a walk (read from a file) has the nodes and rings that a table has.
    fn try_from(result: WalkResult) -> Result<Self, SkinError> {
        result.walk.validate()?;
        let nodes = chebyshev_nodes().map(|x| 1.0 - x * x);
        let albedos = &result.walk.albedos;
        if albedos.len() != nodes.len() || albedos.iter().zip(nodes).any(|(a, b)| (a - b).abs() > 1e-9) {
            let found = format!("{} other albedos", albedos.len());
            return Err(SkinError::new("table.walk.albedos", found, "the nodes of an albedo table"));
        }
        let edges = result.walk.rings.edges();
        let same = edges.len() == result.edges.len()
            && edges.iter().zip(&result.edges).all(|(a, b)| (a - b).abs() <= 1e-9 * b);
        if !same {
            return Err(SkinError::new("table.edges", result.edges.len(), "the edges of the walk's rings"));
        }
        let sound = |light: &[f64], count: usize| {
            light.len() == count && light.iter().all(|v| v.is_finite() && *v >= 0.0)
        };
        let rings = &result.ring_light;
        if rings.len() != nodes.len() || !rings.iter().all(|ring| sound(ring, edges.len())) {
            return Err(SkinError::new(
                "table.ring_light",
                "a wrong count or value",
                "light of every node and ring",
            ));
        }
        if !sound(&result.total, nodes.len()) || result.total.contains(&0.0) {
            return Err(SkinError::new(
                "table.total",
                "a wrong count or value",
                "a positive total of every node",
            ));
        }
        Ok(Self { result })
    }
}

/// Chebyshev nodes of an [`AlbedoTable`].
const ALBEDO_NODES: usize = 14;

/// Largest albedo that an [`AlbedoTable`] answers for.
pub const TABLE_MAX_ALBEDO: f64 = 0.999;

fn chebyshev_nodes() -> [f64; ALBEDO_NODES] {
    let low = (1.0 - TABLE_MAX_ALBEDO).sqrt();
    std::array::from_fn(|i| {
        let t = (PI * (i as f64 + 0.5) / ALBEDO_NODES as f64).cos();
        0.5 * (1.0 + low) + 0.5 * (1.0 - low) * t
    })
}

impl AlbedoTable {
    /// The walk, for the albedos of the nodes.
    pub fn result(&self) -> &WalkResult {
        &self.result
    }

    /// Walks photons for all albedos at once. A million photons take seconds.
    pub fn build(anisotropy: f64, eta: f64, photons: u64, seed: u64) -> Result<Self, SkinError> {
        let albedos = chebyshev_nodes().iter().map(|x| 1.0 - x * x).collect();
        let walk = PhotonWalk { anisotropy, ..PhotonWalk::isotropic(eta, albedos, photons, seed) };
        Ok(Self { result: walk.run()? })
    }

    /// Total diffuse reflectance for an albedo from 0 to [`TABLE_MAX_ALBEDO`].
    pub fn total(&self, albedo: f64) -> Result<f64, SkinError> {
        check_albedo(albedo)?;
        if albedo == 0.0 {
            return Ok(0.0);
        }
        let weights = interpolation(albedo);
        Ok(self.interpolate(&weights, albedo, |k| self.result.total[k]))
    }

    fn interpolate(&self, weights: &[f64], albedo: f64, light: impl Fn(usize) -> f64) -> f64 {
        let log = |(k, w): (usize, &f64)| w * (light(k) / self.result.walk.albedos[k]).ln();
        albedo * weights.iter().enumerate().map(log).sum::<f64>().exp()
    }

    /// The profile of a reduced medium; the table must be of g = 0 and of the medium's index.
    pub fn profile(&self, medium: &Medium) -> Result<RadialTable, SkinError> {
        medium.validate()?;
        if self.result.walk.eta != medium.eta {
            let found = format!("{} in a table of {}", medium.eta, self.result.walk.eta);
            return Err(SkinError::new("medium.eta", found, "the index of the table"));
        }
        if self.result.walk.anisotropy != 0.0 {
            let found = self.result.walk.anisotropy;
            return Err(SkinError::new("walk.anisotropy", found, "0 for a reduced medium"));
        }
        self.profile_of(medium.sigma_s_prime_per_mm, medium.sigma_a_per_mm)
    }

    /// The profile of a medium with the table's anisotropy and index, from its unreduced coefficients, mm^-1.
    pub fn profile_of(&self, sigma_s_per_mm: f64, sigma_a_per_mm: f64) -> Result<RadialTable, SkinError> {
        let sigma_t = sigma_s_per_mm + sigma_a_per_mm;
        check_extinction(sigma_t)?;
        let albedo = sigma_s_per_mm / sigma_t;
        check_albedo(albedo)?;
        if albedo == 0.0 {
            return Err(SkinError::new("medium.albedo", albedo, "scattering: without it no light returns"));
        }
        let weights = interpolation(albedo);
        let rings = self.result.edges.len() - 1;
        let light: Vec<f64> = (0..=rings)
            .map(|j| {
                let nodes = &self.result.ring_light;
                // The table ends at the first ring that is empty at some node.
                if nodes.iter().any(|node| node[j] <= 0.0) {
                    return 0.0;
                }
                self.interpolate(&weights, albedo, |k| nodes[k][j])
            })
            .collect();
        table(&self.result.edges, &light, self.total(albedo)?, sigma_t)
    }
}

fn check_albedo(albedo: f64) -> Result<(), SkinError> {
    if (0.0..=TABLE_MAX_ALBEDO).contains(&albedo) {
        return Ok(());
    }
    Err(SkinError::new("medium.albedo", albedo, "an albedo of at most 0.999 for a tabulated profile"))
}

/// Barycentric weights of the Chebyshev nodes at an albedo (Berrut and Trefethen 2004); they sum to one.
fn interpolation(albedo: f64) -> [f64; ALBEDO_NODES] {
    let x = (1.0 - albedo).sqrt();
    let nodes = chebyshev_nodes();
    if let Some(hit) = nodes.iter().position(|n| (n - x).abs() < 1e-12) {
        return std::array::from_fn(|i| if i == hit { 1.0 } else { 0.0 });
    }
    let raw: [f64; ALBEDO_NODES] = std::array::from_fn(|i| {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        sign * (PI * (i as f64 + 0.5) / ALBEDO_NODES as f64).sin() / (x - nodes[i])
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

/// xoshiro256++ (Blackman and Vigna 2019), seeded through [`SplitMix64`]: stored walks depend on its sequence, and its
/// period of 2^256 leaves every batch a stream of its own.
struct Random {
    state: [u64; 4],
}

impl Random {
    fn new(seed: u64, stream: u64) -> Self {
        let mut seeds = SplitMix64(seed ^ stream.wrapping_mul(0xd1342543de82ef95));
        Self { state: std::array::from_fn(|_| seeds.bits()) }
    }

    fn bits(&mut self) -> u64 {
        let s = &mut self.state;
        let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// In [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A flight in mean free paths.
    fn free_path(&mut self) -> f64 {
        -(1.0 - self.uniform()).ln()
    }

    /// A point of the unit circle, by rejection.
    fn unit_vector(&mut self) -> (f64, f64) {
        loop {
            let (a, b) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let s = a * a + b * b;
            if s > 0.0 && s <= 1.0 {
                let scale = 1.0 / s.sqrt();
                return (a * scale, b * scale);
            }
        }
    }
}

#[cfg(test)]
mod tests;
