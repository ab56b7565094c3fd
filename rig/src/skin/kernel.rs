//! Separable kernels: a profile as two one-dimensional passes.

use serde::{Deserialize, Serialize};

use super::profile::Profile;
use crate::error::SkinError;

/// Smallest and largest number of taps of a kernel.
pub const SAMPLES: std::ops::RangeInclusive<usize> = 5..=65;

/// Fraction of the light of the widest channel that lies inside of a kernel's half width.
///
/// The rest is folded into the taps; a larger fraction spends taps on light that nobody sees.
const COVERAGE: f64 = 0.99;

/// A kernel that is applied along x and then along y.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeparableKernel {
    /// Places of the taps, mm, ascending and symmetric; the middle one is 0.
    pub offsets_mm: Vec<f64>,
    /// R, G, B weight of each tap; each channel sums to one.
    pub weights: Vec<[f64; 3]>,
}

impl SeparableKernel {
    /// The kernel of a profile's line spread function, exact for light that varies along the pass only.
    ///
    /// `samples` is odd and 5 to 65.
    pub fn of(profile: &Profile, samples: usize) -> Result<Self, SkinError> {
        check_samples(samples)?;
        let half_width_mm = half_width_mm(profile);
        let offsets_mm = offsets(samples, half_width_mm);
        let weights = cells(&offsets_mm)
            .map(|(a, b)| profile.channels.each_ref().map(|c| 0.5 * (odd(a, |x| c.line_cdf(x), b))))
            .collect();
        let mut kernel = Self { offsets_mm, weights };
        kernel.normalize();
        Ok(kernel)
    }

    /// Half the width, mm: the last offset.
    pub fn half_width_mm(&self) -> f64 {
        self.offsets_mm.last().copied().unwrap_or(0.0)
    }

    /// Makes each channel sum to one, exactly symmetric.
    fn normalize(&mut self) {
        let n = self.weights.len();
        for c in 0..3 {
            for i in 0..n / 2 {
                let mean = 0.5 * (self.weights[i][c] + self.weights[n - 1 - i][c]);
                self.weights[i][c] = mean;
                self.weights[n - 1 - i][c] = mean;
            }
            let sum: f64 = self.weights.iter().map(|w| w[c]).sum();
            for w in &mut self.weights {
                w[c] /= sum;
            }
        }
    }
}

/// `f(b) - f(a)` of an `f` that is given for positive arguments and odd.
fn odd(a: f64, f: impl Fn(f64) -> f64, b: f64) -> f64 {
    let at = |x: f64| f(x.abs()).copysign(x);
    at(b) - at(a)
}

fn check_samples(samples: usize) -> Result<(), SkinError> {
    if samples.is_multiple_of(2) || !SAMPLES.contains(&samples) {
        return Err(SkinError::new("kernel.samples", samples, "an odd number from 5 to 65"));
    }
    Ok(())
}

/// Where the line spread of the widest channel reaches [`COVERAGE`], mm.
fn half_width_mm(profile: &Profile) -> f64 {
    let width = |c: &super::profile::RadialProfile| {
        super::numerics::invert_cdf(COVERAGE, c.scale_mm(), |x| c.line_cdf(x))
    };
    profile.channels.iter().map(width).fold(0.0, f64::max)
}

/// Offsets that are quadratically denser near the centre (the spacing of Jimenez 2012, section 6.2.2).
fn offsets(samples: usize, half_width_mm: f64) -> Vec<f64> {
    let half = (samples / 2) as f64;
    (0..samples)
        .map(|i| {
            let t = (i as f64 - half) / half;
            half_width_mm * t * t.abs()
        })
        .collect()
}

/// The interval that each tap stands for: midpoint to midpoint, the outer ones mirrored about their tap.
fn cells(offsets: &[f64]) -> impl Iterator<Item = (f64, f64)> + '_ {
    let n = offsets.len();
    (0..n).map(move |i| {
        let low =
            if i == 0 { 1.5 * offsets[0] - 0.5 * offsets[1] } else { 0.5 * (offsets[i - 1] + offsets[i]) };
        let high = if i == n - 1 {
            1.5 * offsets[i] - 0.5 * offsets[i - 1]
        } else {
            0.5 * (offsets[i] + offsets[i + 1])
        };
        (low, high)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_sum_to_one_mirror_and_are_denser_near_the_centre() {
        for samples in SAMPLES.step_by(4) {
            let kernel = SeparableKernel::of(&Profile::deon_six(), samples).unwrap();
            assert_eq!(kernel.offsets_mm.len(), samples);
            assert_eq!(kernel.offsets_mm[samples / 2], 0.0);
            for c in 0..3 {
                let sum: f64 = kernel.weights.iter().map(|w| w[c]).sum();
                assert!((sum - 1.0).abs() < 1e-14);
            }
            for i in 0..samples {
                assert_eq!(kernel.weights[i], kernel.weights[samples - 1 - i]);
                assert_eq!(kernel.offsets_mm[i], -kernel.offsets_mm[samples - 1 - i]);
                assert!(kernel.weights[i].iter().all(|&w| (0.0..1.0).contains(&w)));
            }
            let steps: Vec<f64> = kernel.offsets_mm[samples / 2..].windows(2).map(|w| w[1] - w[0]).collect();
            assert!(steps.windows(2).all(|s| s[1] > s[0]));
        }
    }

    #[test]
    fn wrong_sample_counts_are_errors() {
        for samples in [0, 1, 3, 16, 66, 67] {
            let error = SeparableKernel::of(&Profile::deon_six(), samples).unwrap_err();
            assert_eq!(error.at, "kernel.samples");
        }
    }
}
