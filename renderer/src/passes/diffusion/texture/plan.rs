//! Which Gaussians run on which map.

use rubor_rig::skin::fit::RgbGaussian;

/// Gaussians narrower than this part of a texel are the pixel's own light.
const SHARP_TEXELS: f64 = 0.3;
/// Gaussians narrower than this part of a texel are the unblurred map: reading it between texels blurs as much.
const UNBLURRED_TEXELS: f64 = 0.5;
/// Least deviation of a Gaussian in texels of the map that it runs on.
const TEXELS_A_DEVIATION: f64 = 1.0;
/// Halvings from the map of light to the smallest blurred map.
pub(crate) const MOST_HALVINGS: usize = 3;
/// Variance of interpolation between texels, square texels: that of a triangle as wide as two.
const INTERPOLATION: f64 = 1.0 / 6.0;
/// Distance of taps, deviations.
pub(crate) const TAP_STEP: f64 = 0.75;
/// Taps on each side.
const TAPS: i32 = 4;

/// One Gaussian, made from the one before it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Step {
    /// Halvings from the map of light to the map that it is written to.
    pub(crate) level: usize,
    /// Deviation that this step adds, mm.
    pub(crate) deviation_mm: f64,
    /// Its share of the result.
    pub(crate) weights: [f64; 3],
}

/// The terms of the sum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plan {
    /// Share of the pixel's own light.
    pub(crate) own: [f64; 3],
    /// Share of the unblurred map.
    pub(crate) unblurred: [f64; 3],
    pub(crate) steps: Vec<Step>,
}

/// Weights of the taps, the middle one first, and the variance of the whole line for a deviation of one.
pub(crate) fn taps() -> (Vec<f64>, f64) {
    let densities: Vec<f64> = (0..=TAPS).map(|i| (-0.5 * (f64::from(i) * TAP_STEP).powi(2)).exp()).collect();
    let sum = 2.0 * densities.iter().sum::<f64>() - densities[0];
    let weights: Vec<f64> = densities.iter().map(|d| d / sum).collect();
    let variance = weights.iter().zip(0..).map(|(w, i)| 2.0 * w * (f64::from(i) * TAP_STEP).powi(2)).sum();
    (weights, variance)
}

/// The plan for Gaussians, narrowest first, on a map whose texels have a width.
pub(crate) fn plan(gaussians: &[RgbGaussian], mm_per_texel: f64) -> Plan {
    let mut plan = Plan { own: [0.0; 3], unblurred: [0.0; 3], steps: Vec::new() };
    let (_, of_taps) = taps();
    // Of the last step: variance, mm^2, and level.
    let (mut reached_mm2, mut from) = (0.0, 0usize);
    for g in gaussians {
        let texels = g.variance_mm2.sqrt() / mm_per_texel;
        let add = |sum: &mut [f64; 3]| std::array::from_fn(|c| sum[c] + g.weights[c]);
        if plan.steps.is_empty() && texels < SHARP_TEXELS {
            plan.own = add(&mut plan.own);
            continue;
        }
        if plan.steps.is_empty() && texels < UNBLURRED_TEXELS {
            plan.unblurred = add(&mut plan.unblurred);
            continue;
        }
        let finest = (texels / TEXELS_A_DEVIATION).max(1.0).log2().floor() as usize;
        let level = finest.clamp(from, MOST_HALVINGS);
        let width = |level: usize| mm_per_texel * f64::from(1u32 << level);
        // Taps between texels of the source, and pixels between texels of the result.
        let read_mm2 = INTERPOLATION * width(from).powi(2);
        let shown_mm2 = INTERPOLATION * width(level).powi(2);
        let add_mm2 = (g.variance_mm2 - reached_mm2 - read_mm2 - shown_mm2).max(0.0);
        reached_mm2 += read_mm2 + add_mm2;
        plan.steps.push(Step { level, deviation_mm: (add_mm2 / of_taps).sqrt(), weights: g.weights });
        from = level;
    }
    plan
}
