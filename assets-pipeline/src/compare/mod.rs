//! How far two images are apart: relative errors in linear light, FLIP as a person sees it.
//!
//! ```text
//! test, reference --relative_rmse, rel_mse--> numbers
//!                 +--flip::ldr / flip::hdr--> a map of visible differences --> mean, 99th percentile
//! ```

pub mod flip;

/// RGB pixels in rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear Rec. 709.
    pub linear: Vec<[f32; 3]>,
}

/// Root of the sum of squared differences over that of the squared reference. 0 for two black images, infinite where
/// only the reference is black.
pub fn relative_rmse(test: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let (mut error, mut signal) = (0.0, 0.0);
    for (t, r) in test.iter().flatten().zip(reference.iter().flatten()) {
        error += (f64::from(*t) - f64::from(*r)).powi(2);
        signal += f64::from(*r).powi(2);
    }
    if error == 0.0 { 0.0 } else { (error / signal).sqrt() }
}

/// Mean of the squared difference over the squared reference plus 0.01 (Rousselle, Knaus and Zwicker 2011).
pub fn rel_mse(test: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let n = 3 * reference.len().max(1);
    let term = |(t, r): (&f32, &f32)| {
        let (t, r) = (f64::from(*t), f64::from(*r));
        (t - r).powi(2) / (r * r + 0.01)
    };
    test.iter().flatten().zip(reference.iter().flatten()).map(term).sum::<f64>() / n as f64
}

/// Mean and 99th percentile of a map.
pub fn mean_and_percentile(map: &[f32]) -> (f64, f64) {
    let mut sorted = map.to_vec();
    sorted.sort_by(f32::total_cmp);
    let mean = map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len().max(1) as f64;
    let at = (0.99 * sorted.len().saturating_sub(1) as f64).round() as usize;
    (mean, sorted.get(at).map_or(0.0, |v| f64::from(*v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        let reference = vec![[1.0, 2.0, 2.0]; 4];
        let test = vec![[1.1, 2.2, 2.2]; 4];
        assert!((relative_rmse(&test, &reference) - 0.1).abs() < 1e-6);
        let expected = (0.01 / 1.01 + 2.0 * 0.04 / 4.01) / 3.0;
        assert!((rel_mse(&test, &reference) - expected).abs() < 1e-7);
        assert_eq!(relative_rmse(&reference, &reference), 0.0);
        assert_eq!(relative_rmse(&reference, &[[0.0; 3]; 4]), f64::INFINITY);
        let map: Vec<f32> = (0..=100).map(|i| i as f32).collect();
        assert_eq!(mean_and_percentile(&map), (50.0, 99.0));
        assert_eq!(mean_and_percentile(&[]), (0.0, 0.0));
    }
}
