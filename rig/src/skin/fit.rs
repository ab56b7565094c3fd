//! Fits of any profile to a few Gaussians or exponentials.
//!
//! The lengths of the terms are searched by Levenberg-Marquardt; for given lengths the weights are a linear problem
//! with the constraints `w >= 0` and `sum w = total`, solved exactly (variable projection, Golub and Pereyra 1973).
//! The channels of a fit share their lengths, so one blur serves R, G and B (d'Eon, Luebke and Enderton 2007).

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::diffusion::{ExponentialSum, ExponentialTerm, NormalizedDiffusion};
use super::gaussians::{GaussianSum, GaussianTerm};
use super::numerics::{levenberg_marquardt, non_negative_least_squares};
use super::profile::{Profile, RadialProfile};
use crate::error::SkinError;

/// Terms that a fit may have.
pub const TERMS: std::ops::RangeInclusive<usize> = 1..=12;

/// The error that a fit minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Emphasis {
    /// Integral of `r (R - fit)^2` (Jimenez 2012, eq. 2.2): the centre, where R is large.
    Peak,
    /// Integral of `r^3 (R - fit)^2`, the squared error of the light per unit of `ln r`: near and far alike.
    Energy,
}

/// Family of the terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Basis {
    Gaussian,
    Exponential,
}

impl Basis {
    /// A term of weight one, mm^-2; `length` is the standard deviation or the decay length.
    fn value(self, length: f64, r: f64) -> f64 {
        match self {
            Self::Gaussian => (-0.5 * (r / length).powi(2)).exp() / (2.0 * PI * length * length),
            Self::Exponential => (-r / length).exp() / (2.0 * PI * length * r),
        }
    }
}

/// Distance of a fit from its profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitError {
    /// Root of the integral of `r (R - fit)^2` over that of `r R^2` (eq. 2.2 made relative).
    ///
    /// Over the radii that hold the light from its 10^-4 to its 1 - 10^-6 quantile: where R rises as 1/r to the
    /// centre the integral has no limit.
    pub root_mean_square: f64,
    /// Integral of `r |R - fit|` over that of `r R`: the fraction of the light in the wrong place.
    pub radial: f64,
}

/// A Gaussian with a weight for each channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RgbGaussian {
    /// Variance along one axis, mm^2.
    pub variance_mm2: f64,
    /// R, G, B weights.
    pub weights: [f64; 3],
}

/// Gaussians of a profile, narrowest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GaussianFit {
    /// The terms; the weights of a channel sum to its total.
    pub gaussians: Vec<RgbGaussian>,
    /// Error of each channel.
    pub errors: [FitError; 3],
}

impl GaussianFit {
    /// The fit as a profile.
    pub fn profile(&self, name: &str) -> Result<Profile, SkinError> {
        let channel = |c: usize| {
            let terms = self
                .gaussians
                .iter()
                .map(|g| GaussianTerm { variance_mm2: g.variance_mm2, weight: g.weights[c] });
            Ok(RadialProfile::Gaussians(GaussianSum::new(terms.collect())?))
        };
        Ok(Profile { name: name.into(), channels: [channel(0)?, channel(1)?, channel(2)?] })
    }
}

/// Fits `k` Gaussians with common variances to a profile.
pub fn fit_gaussians(profile: &Profile, k: usize, emphasis: Emphasis) -> Result<GaussianFit, SkinError> {
    let fit = fit(&profile.channels, k, Basis::Gaussian, emphasis)?;
    let gaussians = (0..k)
        .map(|i| RgbGaussian {
            variance_mm2: fit.lengths[i].powi(2),
            weights: std::array::from_fn(|c| fit.weights[c][i]),
        })
        .collect();
    Ok(GaussianFit { gaussians, errors: std::array::from_fn(|c| fit.errors[c]) })
}

/// Fits `k` Gaussians to one channel.
pub fn fit_channel_gaussians(
    profile: &RadialProfile,
    k: usize,
    emphasis: Emphasis,
) -> Result<(GaussianSum, FitError), SkinError> {
    let fit = fit(std::slice::from_ref(profile), k, Basis::Gaussian, emphasis)?;
    let term =
        |(length, weight): (&f64, &f64)| GaussianTerm { variance_mm2: length * length, weight: *weight };
    let sum = GaussianSum::new(fit.lengths.iter().zip(&fit.weights[0]).map(term).collect())?;
    Ok((sum, fit.errors[0]))
}

/// Fits `k` exponentials over r to one channel: few terms follow a Monte Carlo profile from its singular centre out.
pub fn fit_channel_exponentials(
    profile: &RadialProfile,
    k: usize,
    emphasis: Emphasis,
) -> Result<(ExponentialSum, FitError), SkinError> {
    let fit = fit(std::slice::from_ref(profile), k, Basis::Exponential, emphasis)?;
    let term = |(length, weight): (&f64, &f64)| ExponentialTerm { length_mm: *length, weight: *weight };
    let sum = ExponentialSum::new(fit.lengths.iter().zip(&fit.weights[0]).map(term).collect())?;
    Ok((sum, fit.errors[0]))
}

/// Normalized diffusion with the profile's total and the width that misplaces the least light.
///
/// The published widths were fitted to index-matched media; this is the refit for any other. Also returns the fraction
/// of misplaced light, by 120 rings.
pub fn refit_normalized_diffusion(profile: &RadialProfile) -> Result<(NormalizedDiffusion, f64), SkinError> {
    let total = profile.total();
    let (low, middle, high) =
        (profile.sample_radius(1e-4), profile.sample_radius(0.5), profile.sample_radius(1.0 - 1e-6));
    if !(low > 0.0 && high > low && high.is_finite()) {
        let found = format!("light from {low} to {high} mm");
        return Err(SkinError::new("fit.profile", found, "a profile that holds its light in a finite disk"));
    }
    let edges: Vec<f64> = (0..=NODES).map(|i| low * (high / low).powf(i as f64 / NODES as f64)).collect();
    let aim: Vec<f64> = edges.iter().map(|&e| profile.mass_beyond(e)).collect();
    let misplaced = |log_d: f64| {
        let candidate = NormalizedDiffusion { albedo: total, d_mm: log_d.exp() };
        let light: Vec<f64> = edges.iter().map(|&e| candidate.mass_beyond(e)).collect();
        let rings = (0..NODES).map(|i| (light[i] - light[i + 1] - aim[i] + aim[i + 1]).abs());
        rings.sum::<f64>() / total
    };
    // Golden section: the error has one minimum in the width of a one-parameter family.
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (middle.ln() - 3.0, middle.ln() + 3.0);
    while b - a > 1e-6 {
        let (left, right) = (b - ratio * (b - a), a + ratio * (b - a));
        if misplaced(left) < misplaced(right) {
            b = right;
        } else {
            a = left;
        }
    }
    let log_d = 0.5 * (a + b);
    Ok((NormalizedDiffusion::new(total, log_d.exp())?, misplaced(log_d)))
}

struct Fit {
    lengths: Vec<f64>,
    /// Indexed by channel, then term.
    weights: Vec<Vec<f64>>,
    errors: Vec<FitError>,
}

/// Radii at which a fit is evaluated.
const NODES: usize = 120;

/// Weight of the row that constrains the sum of the weights to the total, relative to the norm of a channel's rows.
const SUM_ROW: f64 = 100.0;

/// A channel at the nodes.
struct Target {
    values: Vec<f64>,
    total: f64,
    /// Scales of the rows: the emphasis, divided by the norm of the channel.
    rows: Vec<f64>,
}

fn fit(channels: &[RadialProfile], k: usize, basis: Basis, emphasis: Emphasis) -> Result<Fit, SkinError> {
    if !TERMS.contains(&k) {
        return Err(SkinError::new("fit.terms", k, "1 to 12 terms"));
    }
    let quantile = |u: f64, pick: fn(f64, f64) -> f64, from: f64| {
        channels.iter().map(|c| c.sample_radius(u)).fold(from, pick)
    };
    let low = quantile(1e-4, f64::min, f64::INFINITY);
    let high = quantile(1.0 - 1e-6, f64::max, 0.0);
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Err(SkinError::new(
            "fit.profile",
            format!("light from {low} to {high} mm"),
            "a profile that holds its light in a finite disk (with absorption)",
        ));
    }
    let radii: Vec<f64> =
        (0..NODES).map(|i| low * (high / low).powf(i as f64 / (NODES - 1) as f64)).collect();
    let targets: Vec<Target> = channels
        .iter()
        .map(|channel| {
            let values: Vec<f64> = radii.iter().map(|&r| channel.reflectance(r)).collect();
            // Nodes are even in ln r: an integral over r dr is a sum of r^2.
            let scale = |r: f64| if emphasis == Emphasis::Peak { r } else { r * r };
            let norm: f64 =
                radii.iter().zip(&values).map(|(&r, v)| (scale(r) * v).powi(2)).sum::<f64>().sqrt();
            Target { values, total: channel.total(), rows: radii.iter().map(|&r| scale(r) / norm).collect() }
        })
        .collect();

    let residual = |logs: &[f64]| {
        let lengths: Vec<f64> = logs.iter().map(|l| l.exp()).collect();
        let parts: Vec<DVector<f64>> =
            targets.iter().map(|t| project(t, &radii, &lengths, basis).1).collect();
        DVector::from_iterator(NODES * parts.len(), parts.iter().flat_map(|p| p.iter().copied()))
    };
    let bounds = vec![(low.ln() - 1.0, high.ln()); k];
    // Several starts: exchanging terms gives as many local minima.
    let mut starts = vec![from_dictionary(&targets, &radii, k, basis)];
    for (u_low, u_high) in [(0.02, 0.995), (0.1, 0.97)] {
        // Converts quantiles of the light to lengths.
        let reach = if basis == Basis::Gaussian { 1.1 } else { 1.6 };
        let a = quantile(u_low, f64::min, f64::INFINITY).ln();
        let b = quantile(u_high, f64::max, 0.0).ln() - reach;
        starts.push((0..k).map(|i| a + (b - a) * (i as f64 + 0.5) / k as f64).collect());
    }
    let mut best = (starts[0].clone(), f64::INFINITY);
    for start in starts {
        let found = levenberg_marquardt(residual, &start, &bounds, 1e-4);
        if found.1 < best.1 {
            best = found;
        }
    }
    // A term of weight 0 has no gradient: the lengths are perturbed and searched again.
    for shake in [0.3, -0.3, 0.8] {
        let shaken = best.0.iter().enumerate();
        let start: Vec<f64> = shaken.map(|(i, l)| if i % 2 == 0 { l + shake } else { l - shake }).collect();
        let found = levenberg_marquardt(residual, &start, &bounds, 1e-4);
        if found.1 < best.1 {
            best = found;
        }
    }
    let mut logs = best.0;
    logs.sort_by(f64::total_cmp);
    let lengths: Vec<f64> = logs.iter().map(|l| l.exp()).collect();

    let mut result = Fit { lengths: lengths.clone(), weights: vec![], errors: vec![] };
    for target in &targets {
        let (weights, _) = project(target, &radii, &lengths, basis);
        let (mut squares, mut norm, mut absolute, mut sum) = (0.0, 0.0, 0.0, 0.0);
        for (&r, &v) in radii.iter().zip(&target.values) {
            let fitted: f64 = lengths.iter().zip(weights.iter()).map(|(&l, w)| w * basis.value(l, r)).sum();
            squares += (r * (v - fitted)).powi(2);
            norm += (r * v).powi(2);
            absolute += r * r * (v - fitted).abs();
            sum += r * r * v;
        }
        result.errors.push(FitError { root_mean_square: (squares / norm).sqrt(), radial: absolute / sum });
        result.weights.push(weights.iter().copied().collect());
    }
    Ok(result)
}

/// Logarithms of `k` lengths to start from: the lengths that a non-negative fit of many fixed ones uses, neighbours
/// merged by their weight (or the largest gaps filled) until `k` are left.
fn from_dictionary(targets: &[Target], radii: &[f64], k: usize, basis: Basis) -> Vec<f64> {
    const COUNT: usize = 40;
    let (low, high) = (radii[0].ln(), radii[NODES - 1].ln());
    let logs: Vec<f64> = (0..COUNT).map(|i| low + (high - low) * i as f64 / COUNT as f64).collect();
    let lengths: Vec<f64> = logs.iter().map(|l| l.exp()).collect();
    let mut used = vec![0.0; COUNT];
    for target in targets {
        let (weights, _) = project(target, radii, &lengths, basis);
        used.iter_mut().zip(weights.iter()).for_each(|(sum, w)| *sum += w / target.total);
    }
    let mut clusters: Vec<(f64, f64)> =
        logs.iter().copied().zip(used).filter(|&(_, weight)| weight > 1e-4).collect();
    while clusters.len() > k {
        let merged = |a: (f64, f64), b: (f64, f64)| ((a.0 * a.1 + b.0 * b.1) / (a.1 + b.1), a.1 + b.1);
        // The pair whose merger moves the least weight over the least distance.
        let cost = |w: &[(f64, f64)]| (w[1].0 - w[0].0).powi(2) * w[0].1 * w[1].1 / (w[0].1 + w[1].1);
        let pair = clusters.windows(2).enumerate().min_by(|a, b| cost(a.1).total_cmp(&cost(b.1)));
        let Some((i, _)) = pair else { break };
        clusters[i] = merged(clusters[i], clusters[i + 1]);
        clusters.remove(i + 1);
    }
    let mut result: Vec<f64> = clusters.iter().map(|c| c.0).collect();
    while result.len() < k {
        let gap = |w: &[f64]| w[1] - w[0];
        match result.windows(2).enumerate().max_by(|a, b| gap(a.1).total_cmp(&gap(b.1))) {
            Some((i, w)) => result.insert(i + 1, 0.5 * (w[0] + w[1])),
            None => result.push(result.last().map_or(0.5 * (low + high), |l| l + 1.0)),
        }
    }
    result
}

/// Best weights for given lengths, and the residual.
fn project(target: &Target, radii: &[f64], lengths: &[f64], basis: Basis) -> (DVector<f64>, DVector<f64>) {
    let columns =
        DMatrix::from_fn(NODES, lengths.len(), |i, j| target.rows[i] * basis.value(lengths[j], radii[i]));
    let aim = DVector::from_fn(NODES, |i, _| target.rows[i] * target.values[i]);
    let tie = SUM_ROW / target.total;
    let normal = columns.tr_mul(&columns).add_scalar(tie * tie);
    let right = columns.tr_mul(&aim).add_scalar(tie * tie * target.total);
    let mut weights = non_negative_least_squares(&normal, &right);
    // The constraint row leaves an error of about 10^-4; the sum has to be exact.
    let sum = weights.sum();
    if sum > 0.0 {
        weights *= target.total / sum;
    }
    let residual = aim - columns * &weights;
    (weights, residual)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skin::diffusion::{BetterDipole, StandardDipole};
    use crate::skin::medium::{Medium, SKIN1, rgb_media};

    #[test]
    fn a_sum_of_gaussians_is_found_again() {
        let profile = Profile::deon_six();
        let fit = fit_gaussians(&profile, 6, Emphasis::Energy).unwrap();
        for c in 0..3 {
            let sum: f64 = fit.gaussians.iter().map(|g| g.weights[c]).sum();
            assert!((sum - 1.0).abs() < 1e-12);
            assert!(fit.gaussians.iter().all(|g| g.weights[c] >= 0.0));
            assert!(fit.errors[c].radial < 0.004, "{:?}", fit.errors[c]);
        }
    }

    #[test]
    fn more_terms_fit_dipoles_better_down_to_the_published_errors() {
        // d'Eon, Luebke and Enderton 2007 report 1.52 to 0.0793 percent.
        for medium in rgb_media(&SKIN1, 1.3).unwrap() {
            let dipole = RadialProfile::StandardDipole(StandardDipole::new(medium).unwrap());
            let error = |k| fit_channel_gaussians(&dipole, k, Emphasis::Peak).unwrap().1.root_mean_square;
            let (two, four, six) = (error(2), error(4), error(6));
            assert!(two > four && four > six, "{two} {four} {six}");
            assert!(four < 0.0152 && six < 0.003, "{four} {six}");
        }
    }

    #[test]
    fn exponentials_find_normalized_diffusion_again() {
        let burley = RadialProfile::NormalizedDiffusion(NormalizedDiffusion::new(0.5, 0.4).unwrap());
        let (sum, error) = fit_channel_exponentials(&burley, 2, Emphasis::Energy).unwrap();
        let [a, b] = sum.terms() else { panic!("{sum:?}") };
        assert!((a.length_mm - 0.4).abs() < 1e-3 && (b.length_mm - 1.2).abs() < 1e-3, "{sum:?}");
        assert!((a.weight - 0.125).abs() < 1e-3 && (b.weight - 0.375).abs() < 1e-3);
        assert!(error.radial < 1e-3);
    }

    #[test]
    fn normalized_diffusion_is_refitted_to_itself() {
        let burley = NormalizedDiffusion::new(0.5, 0.4).unwrap();
        let (found, error) = refit_normalized_diffusion(&RadialProfile::NormalizedDiffusion(burley)).unwrap();
        assert!((found.d_mm - 0.4).abs() < 1e-5 && error < 1e-4, "{found:?} {error}");
        assert!((found.albedo - 0.5).abs() < 1e-12);
    }

    #[test]
    fn totals_survive_a_fit() {
        let media = rgb_media(&SKIN1, 1.4).unwrap();
        let channel = |c: usize| RadialProfile::BetterDipole(BetterDipole::new(media[c]).unwrap());
        let profile = Profile { name: "better".into(), channels: [channel(0), channel(1), channel(2)] };
        let fit = fit_gaussians(&profile, 5, Emphasis::Peak).unwrap().profile("fit").unwrap();
        for (a, b) in profile.total().iter().zip(fit.total()) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_an_error() {
        let profile = Profile::deon_six();
        for k in [0, 13] {
            assert_eq!(fit_gaussians(&profile, k, Emphasis::Peak).unwrap_err().at, "fit.terms");
        }
        // Without absorption the tail falls as r^-3 and one part in a million lies beyond any useful radius; the fit
        // still answers, with the light in the terms that it has.
        let medium = Medium::new(1.0, 0.0, 1.4).unwrap();
        let dipole = RadialProfile::StandardDipole(StandardDipole::new(medium).unwrap());
        let (sum, error) = fit_channel_gaussians(&dipole, 8, Emphasis::Peak).unwrap();
        assert!((sum.total() - 1.0).abs() < 1e-9 && error.root_mean_square < 0.05, "{error:?}");
    }
}
