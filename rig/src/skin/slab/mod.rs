//! Light through a slab, by photons: what thin parts such as ears let pass.
//!
//! ```text
//! straight in -> flight (-ln u mean free paths) -> near or far side? Fresnel: out | back in
//!                          ^                             far side: counts
//!                          +---- isotropic <----- collision: the weight of every albedo times that albedo
//! ```
//!
//! The profile of a half space says nothing of a slab: its far side reflects what would have gone on, and what crosses has not come
//! back. A slab that vanishes passes all light whatever its albedo, where a profile passes no more than the half space reflects.
//!
//! A [`SlabTable`] has the light that passes by the albedo of the *surface*, which is the diffuse reflectance of a half space of
//! the medium, and by the thickness over the mean radius of its profile. So it needs no medium: a channel of a profile has a mean
//! radius ([`super::profile::RadialProfile::mean_radius_mm`]), a place of the skin a colour, and there is one medium of isotropic
//! scatterers that has both.
//!
//! Light counts per unit that passed the near boundary, as in [`super::monte_carlo`]. It includes light that crosses without a
//! collision: isotropic scatterers stand for a medium that scatters forward (similarity), where that light has been scattered.
//!
//! Does not: layers, slant light (in the medium it is refracted to within 46 degrees of the normal), indices other than 1.4 in the
//! kept table.

use std::sync::LazyLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::medium::{ETA, fresnel_from_inside};
use super::monte_carlo::{MAX_ALBEDO, survives};
use crate::error::SkinError;
use crate::random::SplitMix64;

/// Photons are dealt to this many independent streams.
const BATCHES: u64 = 64;

/// Photons through a slab, for several albedos at once.
#[derive(Clone, Debug, PartialEq)]
pub struct SlabWalk {
    /// Index of refraction inside over outside, on both sides.
    pub eta: f64,
    /// Thickness in mean free paths; infinite for a half space.
    pub thickness: f64,
    /// Albedos of a single collision, each from 0 to [`MAX_ALBEDO`].
    pub albedos: Vec<f64>,
    /// Number of photons (rounded up to a multiple of 64).
    pub photons: u64,
    /// Seed of the random streams.
    pub seed: u64,
}

/// What came out of a slab, per photon that entered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlabLight {
    /// Through the near side.
    pub reflected: f64,
    /// Through the far side.
    pub passed: f64,
    /// Sum over the reflected light of its distance from where it entered, mean free paths.
    pub distance: f64,
}

impl SlabWalk {
    /// Walks all photons on all threads; one result for each albedo.
    ///
    /// # Errors
    /// A number out of range.
    pub fn run(&self) -> Result<Vec<SlabLight>, SkinError> {
        if !ETA.contains(&self.eta) {
            return Err(SkinError::new("slab.eta", self.eta, "a relative index of refraction from 0.5 to 3"));
        }
        if self.thickness.is_nan() || self.thickness < 0.0 {
            return Err(SkinError::new("slab.thickness", self.thickness, "0 mean free paths or more"));
        }
        if let Some(albedo) = self.albedos.iter().find(|a| !(0.0..=MAX_ALBEDO).contains(*a)) {
            return Err(SkinError::new("slab.albedos", albedo, "albedos from 0 to 0.9999"));
        }
        let per_batch = self.photons.div_ceil(BATCHES).max(1);
        let batch = |batch: u64| {
            let mut random = SplitMix64(self.seed ^ batch.wrapping_mul(0xd134_2543_de82_ef95));
            let mut sums = vec![SlabLight::default(); self.albedos.len()];
            let mut weights = vec![0.0; self.albedos.len()];
            for _ in 0..per_batch {
                weights.fill(1.0);
                self.walk(&mut random, &mut weights, &mut sums);
            }
            sums
        };
        // Collected first, so that the order of additions is always the same.
        let batches: Vec<_> = (0..BATCHES).into_par_iter().map(batch).collect();
        let all = (BATCHES * per_batch) as f64;
        let mean = |k: usize| {
            let sum = |f: fn(&SlabLight) -> f64| batches.iter().map(|b| f(&b[k])).sum::<f64>() / all;
            SlabLight {
                reflected: sum(|l| l.reflected),
                passed: sum(|l| l.passed),
                distance: sum(|l| l.distance),
            }
        };
        Ok((0..self.albedos.len()).map(mean).collect())
    }

    fn walk(&self, random: &mut SplitMix64, weights: &mut [f64], sums: &mut [SlabLight]) {
        let (mut x, mut y, mut z) = (0.0f64, 0.0f64, 0.0f64);
        let (mut u, mut v, mut w) = (0.0f64, 0.0f64, 1.0f64);
        loop {
            let mut flight = -(1.0 - random.uniform()).ln();
            // Each meeting with a side counts what is expected to leave there.
            loop {
                let way = if w < 0.0 { -z / w } else { (self.thickness - z) / w };
                let fresnel = fresnel_from_inside(w.abs(), self.eta);
                let leaving = (1.0 - fresnel) * (-way).exp();
                if leaving > 1e-30 {
                    let radius = (x + u * way).hypot(y + v * way);
                    for (sum, weight) in sums.iter_mut().zip(&*weights) {
                        let light = weight * leaving;
                        if w < 0.0 {
                            sum.reflected += light;
                            sum.distance += light * radius;
                        } else {
                            sum.passed += light;
                        }
                    }
                }
                if flight < way {
                    break;
                }
                if random.uniform() >= fresnel {
                    return;
                }
                (x, y) = (x + u * way, y + v * way);
                z = if w < 0.0 { 0.0 } else { self.thickness };
                w = -w;
                flight -= way;
            }
            (x, y, z) = (x + u * flight, y + v * flight, z + w * flight);
            if !survives(weights, &self.albedos, || random.uniform()) {
                return;
            }
            w = 2.0 * random.uniform() - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * random.uniform()).sin_cos();
            let across = (1.0 - w * w).sqrt();
            (u, v) = (across * cos, across * sin);
        }
    }
}

/// Light through slabs by the albedo of the surface and by thickness; as [`SlabTable::kept`] of an index of 1.4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlabTable {
    /// Index of refraction inside over outside.
    pub eta: f64,
    /// Diffuse reflectance of a half space of the last row; the first is of 0, rows are evenly spaced.
    pub albedo_max: f64,
    /// Thickness of the last column over the mean radius of the profile; column j of n is at `(j / (n - 1))^2` of it.
    pub thickness_max: f64,
    /// Share of the light that passes, row by row.
    pub rows: Vec<Vec<f64>>,
}

impl SlabTable {
    /// The table that is part of this crate; `examples/slab_table.rs` makes it.
    pub fn kept() -> &'static Self {
        static TABLE: LazyLock<SlabTable> = LazyLock::new(|| {
            serde_json::from_str(include_str!("table.json")).expect("a test reads the kept table")
        });
        &TABLE
    }

    /// Walks photons for every entry of a table of `size` columns and rows.
    ///
    /// # Errors
    /// A number out of range.
    pub fn build(
        eta: f64,
        albedo_max: f64,
        thickness_max: f64,
        size: [usize; 2],
        photons: u64,
        seed: u64,
    ) -> Result<Self, SkinError> {
        let [columns, rows] = size;
        if columns < 2 || rows < 2 {
            return Err(SkinError::new("slab.size", format!("{size:?}"), "2 columns and rows or more"));
        }
        // Reflectance and mean radius over the albedo of a collision, in equal steps of x = sqrt(1 - albedo).
        const STEPS: usize = 256;
        let least = (1.0 - MAX_ALBEDO).sqrt();
        let x_of = |i: usize| 1.0 + (least - 1.0) * i as f64 / (STEPS - 1) as f64;
        let albedos: Vec<f64> = (0..STEPS).map(|i| 1.0 - x_of(i) * x_of(i)).collect();
        let half_space = SlabWalk { eta, thickness: f64::INFINITY, albedos, photons, seed };
        let light = half_space.run()?;
        // The first has neither reflectance nor radius; both have limits.
        let of: Vec<[f64; 3]> = (1..STEPS)
            .map(|i| [light[i].reflected, half_space.albedos[i], light[i].distance / light[i].reflected])
            .collect();
        let medium = |albedo: f64| {
            let next = of.partition_point(|m| m[0] < albedo).clamp(1, of.len() - 1);
            let (a, b) = (of[next - 1], of[next]);
            let t = ((albedo - a[0]) / (b[0] - a[0])).max(0.0);
            let between = |k: usize| a[k] + t * (b[k] - a[k]);
            // Below the first: the albedo of a collision falls to 0, the radius stays.
            if albedo < of[0][0] {
                (of[0][1] * albedo / of[0][0], of[0][2])
            } else {
                (between(1), between(2))
            }
        };
        let entry = |row: usize, column: usize| -> Result<f64, SkinError> {
            let (albedo, radius) = medium(albedo_max * row as f64 / (rows - 1) as f64);
            let thickness = thickness_max * (column as f64 / (columns - 1) as f64).powi(2) * radius;
            let seed = seed ^ (row * columns + column) as u64;
            let walk = SlabWalk { eta, thickness, albedos: vec![albedo.min(MAX_ALBEDO)], photons, seed };
            Ok(walk.run()?[0].passed)
        };
        let row = |row: usize| (0..columns).map(|column| entry(row, column)).collect::<Result<Vec<_>, _>>();
        Ok(Self { eta, albedo_max, thickness_max, rows: (0..rows).map(row).collect::<Result<_, _>>()? })
    }

    /// Share of the light that passes a slab, by linear interpolation as a sampler does it; clamped at all ends.
    ///
    /// `thickness` is over the mean radius of the profile.
    pub fn sample(&self, albedo: f64, thickness: f64) -> f64 {
        let place = |x: f64, count: usize| {
            let x = x.clamp(0.0, 1.0) * (count - 1) as f64;
            let low = (x as usize).min(count - 2);
            (low, x - low as f64)
        };
        let (row, t) = place(albedo / self.albedo_max, self.rows.len());
        let (column, s) = place((thickness / self.thickness_max).max(0.0).sqrt(), self.rows[0].len());
        let at = |r: &[f64]| r[column] * (1.0 - s) + r[column + 1] * s;
        at(&self.rows[row]) * (1.0 - t) + at(&self.rows[row + 1]) * t
    }
}

#[cfg(test)]
mod tests;
