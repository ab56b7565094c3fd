use super::*;
use crate::testing::{gpu, half_image, read_image, recorded};

/// Hable's curve over its value at white, or nothing; then IEC 61966-2-1.
fn shown(radiance: f64, tone_map: ToneMap) -> f64 {
    let curve = |x: f64| (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3;
    let light = match tone_map {
        ToneMap::Filmic => curve(radiance) / curve(4.0),
        ToneMap::Linear => radiance,
    };
    let x = light.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[test]
fn radiance_is_shown_as_the_curves_say_and_brighter_is_never_darker() {
    let Some(gpu) = gpu() else { return };
    let ramp: Vec<[f32; 4]> = (0..51 * 27).map(|i| [1e-4 * 1.01f32.powi(i), 0.3, 0.0, 1.0]).collect();
    let hdr = half_image(gpu, [51, 27], &ramp);
    for tone_map in ToneMap::all() {
        let look = Look { exposure: 1.3, tone_map };
        let display = Display::new(gpu, tone_map);
        let image = recorded(gpu, |r| display.record(r, &look, &hdr));
        let found = read_image::<[u8; 4]>(gpu, &image);
        for (i, (f, texel)) in found.iter().zip(&ramp).enumerate() {
            for c in 0..3 {
                let radiance = 1.3 * f64::from(half::f16::from_f32(texel[c]).to_f32());
                let error = (f64::from(f[c]) - 255.0 * shown(radiance, tone_map)).abs();
                assert!(
                    error < 0.52,
                    "{tone_map}, pixel {i}: {f:?}, expected {}",
                    255.0 * shown(radiance, tone_map)
                );
            }
            assert_eq!(f[3], 255);
        }
        assert!(found.windows(2).all(|w| w[0][0] <= w[1][0]), "{tone_map} is monotone");
    }
}
