//! Hemoglobin distributions: how the blood of a face moves (Jimenez 2012 section 7.4).
//!
//! ```text
//! neutral map H_n ----local_statistics--> mu_n, sigma_n --+
//! expression map ---- local_statistics--> mu_i, sigma_i --+--scale_and_bias--> Distribution (256 x 256)
//!                                                                                   |
//! H_n, mu_n, weights of a moment ---------------------------------------------------+--blend--> H
//! histogram_matching: the exact mapping that scale and bias approximate
//! ```
//!
//! Rules for cases that the equations leave open:
//! - `sigma_n = 0`: `scale = (sigma_i + d) / (sigma_n + d)` with `d = 1e-8 mu_n`, at most [`MAX_SCALE`]. Where
//!   `sigma_n` is 1e-4 of the mean this changes the scale by 1e-4 of itself; where both deviations are 0 it is 1.
//! - The neutral distribution has the weight that the others leave, and `H` is computed as `H_n` plus differences to it:
//!   algebraically equation 7.6, and neutral weights give `H_n` bit for bit.
//! - `H` is clamped to 0..[`crate::skin::chromophores::MAX_HEMOGLOBIN`].

pub mod histogram_matching;
mod local_statistics;

pub use local_statistics::{LocalStatistics, MAX_RADIUS_PX, local_statistics};

use rayon::prelude::*;

use crate::head::Distribution;
use crate::map::Map;
use crate::mask::{Mask, fill_unmapped, resize_area};
use crate::skin::chromophores::MAX_HEMOGLOBIN;

/// Largest scale of a distribution: limits the contrast asked of a window that has none in the neutral map.
pub const MAX_SCALE: f32 = 100.0;

/// Regularisation of the scale relative to the neutral mean.
const RELATIVE_FLOOR: f64 = 1e-8;

/// Side of a distribution map unless asked otherwise, texels (Jimenez 2012 section 7.6).
pub const DISTRIBUTION_SIZE: u32 = 256;

/// Input that the hemoglobin model cannot use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: found {found}, expected {expected}")]
pub struct HemoglobinError {
    /// Place: a map with a texel, the radius, the weights.
    pub at: String,
    /// The value there.
    pub found: String,
    /// The values that are allowed.
    pub expected: String,
}

/// Checks that a map has one channel, the size of the mask and finite values where mapped.
fn check_map(name: &str, map: &Map, mask: &Mask) -> Result<(), HemoglobinError> {
    let fail = |at: String, found: String, expected: String| Err(HemoglobinError { at, found, expected });
    let size = map.width as usize * map.height as usize;
    if map.channels != 1 || size == 0 || map.values.len() != size {
        let found = format!(
            "{}x{} texels, {} channels, {} values",
            map.width,
            map.height,
            map.channels,
            map.values.len()
        );
        return fail(name.into(), found, "a filled map of 1 channel".into());
    }
    if (map.width, map.height) != (mask.width, mask.height) || mask.mapped.len() != size {
        let found = format!("a mask of {}x{}", mask.width, mask.height);
        return fail(name.into(), found, format!("{}x{} as the map", map.width, map.height));
    }
    match map.values.iter().zip(&mask.mapped).position(|(v, m)| *m && !v.is_finite()) {
        None => Ok(()),
        Some(i) => {
            let at = format!("{name}, texel ({}, {})", i % map.width as usize, i / map.width as usize);
            fail(at, map.values[i].to_string(), "a finite value, or an unmapped texel".into())
        }
    }
}

/// `scale` and `bias` (Jimenez 2012 eq. 7.5) at full resolution, and where both maps have data.
///
/// # Errors
/// Statistics of different sizes.
pub fn scale_and_bias(
    neutral: &LocalStatistics,
    target: &LocalStatistics,
) -> Result<(Map, Map, Mask), HemoglobinError> {
    let size = |s: &LocalStatistics| (s.mean.width, s.mean.height);
    if size(neutral) != size(target) {
        return Err(HemoglobinError {
            at: "target statistics".into(),
            found: format!("{:?} texels", size(target)),
            expected: format!("{:?} as the neutral ones", size(neutral)),
        });
    }
    let covered = neutral.covered.and(&target.covered);
    let ratio = |i: usize| {
        if !covered.mapped[i] {
            return 1.0;
        }
        let floor = RELATIVE_FLOOR * f64::from(neutral.mean.values[i].abs()) + f64::from(f32::MIN_POSITIVE);
        let ratio = (f64::from(target.deviation.values[i]) + floor)
            / (f64::from(neutral.deviation.values[i]) + floor);
        (ratio as f32).min(MAX_SCALE)
    };
    let values = (0..covered.mapped.len()).into_par_iter().map(ratio).collect();
    let (width, height) = size(neutral);
    let scale = Map { width, height, channels: 1, values };
    Ok((scale, target.mean.clone(), covered))
}

/// A neutral map as the runtime needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Neutral {
    /// Statistics at full resolution.
    pub statistics: LocalStatistics,
    /// `mu_n` at the resolution of the distributions, holes filled: `bias_0` of equation 7.5.
    pub mean: Map,
}

/// Statistics of a neutral map and its mean at `size` by `size` texels.
///
/// # Errors
/// As [`local_statistics`].
pub fn neutral(map: &Map, mask: &Mask, radius_px: u32, size: u32) -> Result<Neutral, HemoglobinError> {
    let statistics = local_statistics(map, mask, radius_px)?;
    let mean = reduce(&statistics.mean, &statistics.covered.and(mask), size);
    Ok(Neutral { statistics, mean })
}

/// The distribution of a target map relative to a neutral one, `size` by `size` texels, holes filled.
///
/// Target and neutral may differ in size: the target is then brought to the size of the neutral map first, by area.
///
/// # Errors
/// As [`local_statistics`].
pub fn distribution(
    name: &str,
    neutral: &Neutral,
    target: &Map,
    target_mask: &Mask,
    radius_px: u32,
    size: u32,
) -> Result<Distribution, HemoglobinError> {
    check_map(name, target, target_mask)?;
    let (width, height) = (neutral.statistics.mean.width, neutral.statistics.mean.height);
    let resized;
    let (target, target_mask) = if (target.width, target.height) == (width, height) {
        (target, target_mask)
    } else {
        resized = resize_area(target, target_mask, width, height);
        (&resized.0, &resized.1)
    };
    let statistics = local_statistics(target, target_mask, radius_px)?;
    let (scale, bias, covered) = scale_and_bias(&neutral.statistics, &statistics)?;
    let covered = covered.and(target_mask);
    Ok(Distribution {
        name: name.to_owned(),
        scale: reduce(&scale, &covered, size),
        bias: reduce(&bias, &covered, size),
    })
}

/// Mask-aware reduction with the holes filled.
fn reduce(map: &Map, mask: &Mask, size: u32) -> Map {
    let (mut small, small_mask) = resize_area(map, mask, size.min(map.width), size.min(map.height));
    fill_unmapped(&mut small, &small_mask);
    small
}

/// Equation 7.6 at one texel: hemoglobin of `neutral` (H_n) with local mean `mean` (mu_n) under weighted
/// `(weight, scale, bias)`, times a global factor; clamped to the physical range.
///
/// A weight that is not finite counts as 0.
pub fn blend_texel(
    neutral: f32,
    mean: f32,
    distributions: impl IntoIterator<Item = (f32, f32, f32)>,
    global_scale: f32,
) -> f32 {
    let (mut shift, mut gain) = (0.0, 0.0);
    for (weight, scale, bias) in distributions {
        if weight.is_finite() {
            shift += weight * (bias - mean);
            gain += weight * (scale - 1.0);
        }
    }
    let h = (neutral + shift + (neutral - mean) * gain) * global_scale;
    // NaN, from weights that overflow, becomes 0 as well.
    if h > 0.0 { h.min(MAX_HEMOGLOBIN as f32) } else { 0.0 }
}

/// Equation 7.6 for a whole map: H at the resolution of the neutral map; scale, bias and mean are sampled bilinearly.
///
/// `weights` has one value per distribution; missing ones count as 0.
pub fn blend(
    neutral: &Map,
    neutral_mean: &Map,
    distributions: &[Distribution],
    weights: &[f32],
    global_scale: f32,
) -> Map {
    let active: Vec<_> =
        distributions.iter().zip(weights).filter(|(_, w)| **w != 0.0).map(|(d, w)| (*w, d)).collect();
    let (width, height) = (neutral.width, neutral.height);
    let texel = |(i, h): (usize, &f32)| {
        let u = ((i % width as usize) as f32 + 0.5) / width as f32;
        let v = ((i / width as usize) as f32 + 0.5) / height as f32;
        let parts = active.iter().map(|(w, d)| (*w, d.scale.sample(u, v, 0), d.bias.sample(u, v, 0)));
        blend_texel(*h, neutral_mean.sample(u, v, 0), parts, global_scale)
    };
    let values = neutral.values.par_iter().enumerate().map(texel).collect();
    Map { values, ..neutral.clone() }
}

#[cfg(test)]
mod tests;
