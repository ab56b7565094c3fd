//! Weights of the levels of a pyramid whose sum is a given spread of light.

/// Most levels below the picture.
const MOST_LEVELS: usize = 9;
/// Steps of coordinate descent; the last hundreds change nothing.
const STEPS: usize = 4000;
/// Radii at which the fit is judged, to one and a half times the end of the spread.
const RADII: usize = 96;

/// Share of the light within a distance, in units of the radius, of the spread `(1 - r)^4`.
pub(crate) fn share_within(x: f64) -> f64 {
    let rest = 1.0 - x.clamp(0.0, 1.0);
    6.0 * (1.0 - rest.powi(5)) - 5.0 * (1.0 - rest.powi(6))
}

/// Variance of what a level spreads, along an axis, square pixels: each step down and each step up adds 3/4 of the square of
/// its texel. Level 0 is the pixel itself.
pub(crate) fn variance_px2(level: usize) -> f64 {
    if level == 0 { 1.0 / 12.0 } else { 0.5 * (4f64.powi(level as i32) - 1.0) }
}

/// Share of each level, level 0 first; none is negative and they sum to one. Least squares over the share of light within
/// radii: levels are nearly Gaussian.
pub(crate) fn weights(radius_px: f64) -> Vec<f64> {
    let levels = (radius_px.max(2.0).log2().ceil() as usize).clamp(1, MOST_LEVELS);
    let radii: Vec<f64> = (1..=RADII).map(|i| 1.5 * i as f64 / RADII as f64).collect();
    let within = |level: usize, x: f64| 1.0 - (-0.5 * (x * radius_px).powi(2) / variance_px2(level)).exp();
    let columns: Vec<Vec<f64>> =
        (0..=levels).map(|level| radii.iter().map(|x| within(level, *x)).collect()).collect();
    let mut residual: Vec<f64> = radii.iter().map(|x| share_within(*x)).collect();
    let mut weights = vec![0.0; levels + 1];
    for _ in 0..STEPS {
        for (weight, column) in weights.iter_mut().zip(&columns) {
            let along: f64 = column.iter().zip(&residual).map(|(c, r)| c * r).sum();
            let length: f64 = column.iter().map(|c| c * c).sum();
            let next = (*weight + along / length).max(0.0);
            for (r, c) in residual.iter_mut().zip(column) {
                *r -= (next - *weight) * c;
            }
            *weight = next;
        }
    }
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    while weights.len() > 2 && weights.last().is_some_and(|w| *w < 1e-4) {
        weights.pop();
    }
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_make_the_spread() {
        for radius in [3.0, 8.0, 16.0, 54.0, 108.0, 216.0, 432.0] {
            let weights = weights(radius);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && weights.iter().all(|w| *w >= 0.0));
            let off = (1..=60).map(|i| {
                let x = i as f64 / 50.0;
                let of =
                    |(k, w): (usize, &f64)| w * (1.0 - (-0.5 * (x * radius).powi(2) / variance_px2(k)).exp());
                (weights.iter().enumerate().map(of).sum::<f64>() - share_within(x)).abs()
            });
            let worst = off.fold(0.0, f64::max);
            // Widths of levels double, and Gaussians end more slowly than the spread; a few pixels are coarse for it.
            let bound = if radius < 10.0 { 0.16 } else { 0.055 };
            assert!(worst < bound, "{radius} px: off by {worst}, {weights:?}");
        }
    }
}
