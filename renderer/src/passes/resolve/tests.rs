use super::*;
use crate::settings::Settings;
use crate::testing::{gpu, half_image, read_image, recorded};

/// Hable's curve over its value at white, from the definition.
fn display_light(x: f64) -> f64 {
    let curve = |x: f64| (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3;
    curve(x) / curve(4.0)
}

#[test]
fn the_mean_is_that_of_what_a_display_shows() {
    let Some(gpu) = gpu() else { return };
    // Pairs of a dark and an increasingly bright sample, each two pixels wide and high.
    let bright: Vec<f32> = (0..16).map(|i| 0.004 * 2f32.powi(i - 2)).collect();
    let size = [2 * bright.len() as u32, 2];
    let texels: Vec<[f32; 4]> = (0..2)
        .flat_map(|y| {
            bright.iter().flat_map(move |b| [[*b, 0.5 * b, 0.02, 1.0], [0.01 * y as f32, 0.2, 0.02, 1.0]])
        })
        .collect();
    let hdr = half_image(gpu, size, &texels);
    let look = Settings::default().look;
    let resolve = Resolve::new(gpu, ToneMap::Filmic);
    let resolved = recorded(gpu, |r| resolve.record(r, &look, 2, hdr));
    let found: Vec<[half::f16; 4]> = read_image(gpu, &resolved);
    assert_eq!(resolved.size(), [16, 1]);
    for (i, found) in found.iter().enumerate() {
        for c in 0..3 {
            let samples = [2 * i, 2 * i + 1, 32 + 2 * i, 32 + 2 * i + 1].map(|at| texels[at][c]);
            let exposure = f64::from(look.exposure);
            // The samples went through half floats.
            let shown = samples.map(|s| display_light(exposure * f64::from(half::f16::from_f32(s).to_f32())));
            let mean = shown.iter().sum::<f64>() / 4.0;
            let back = display_light(exposure * f64::from(found[c].to_f32()));
            assert!(
                (back - mean).abs() < 1e-3 * mean.max(0.1),
                "pair {i}, channel {c}: {back}, expected {mean}"
            );
        }
    }
}
