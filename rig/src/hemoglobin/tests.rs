use super::histogram_matching::{map_difference, match_locally};
use super::*;
use crate::random;

/// Standard normal deviates from a counter (Box and Muller 1958).
fn normal(i: usize) -> f32 {
    let uniform =
        |k: u64| random::unit(random::mixed(k.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678)));
    let (a, b) = (uniform(2 * i as u64), uniform(2 * i as u64 + 1));
    ((-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()) as f32
}

fn texture(width: u32, height: u32, mean: f32, deviation: f32, seed: usize) -> Map {
    let values =
        (0..(width * height) as usize).map(|i| mean + deviation * normal(i + seed * 1_000_003)).collect();
    Map { width, height, channels: 1, values }
}

#[test]
fn an_affine_change_comes_back_as_scale_and_bias_and_is_reproduced() {
    let (w, h, r) = (160, 120, 12);
    let mask = Mask::full(w, h);
    for relative_deviation in [0.15, 1e-4] {
        let base = texture(w, h, 0.04, 0.04 * relative_deviation, 1);
        let target =
            Map { values: base.values.iter().map(|v| 0.07 + 1.6 * (v - 0.04)).collect(), ..base.clone() };
        let neutral = neutral(&base, &mask, r, 160).unwrap();
        let joy = distribution("joy", &neutral, &target, &mask, r, 160).unwrap();
        for (i, s) in joy.scale.values.iter().enumerate() {
            assert!((s - 1.6).abs() < 1.6e-3, "deviation {relative_deviation}: scale {s}");
            let expected = 0.07 + 1.6 * (neutral.mean.values[i] - 0.04);
            assert!((joy.bias.values[i] - expected).abs() < 1e-6);
        }
        let found = blend(&base, &neutral.mean, &[joy], &[1.0], 1.0);
        let worst = map_difference(&target, &found, &mask).max;
        assert!(worst < f64::from(MAX_HEMOGLOBIN as f32) / 255.0, "{worst}");
        assert!(worst < 2e-5, "{worst}");
    }
}

#[test]
fn statistics_of_gaussian_maps_come_back() {
    let (w, h, r) = (200, 200, 40);
    let mask = Mask::full(w, h);
    let n = neutral(&texture(w, h, 0.05, 0.006, 3), &mask, r, 64).unwrap();
    let d = distribution("anger", &n, &texture(w, h, 0.08, 0.009, 9), &mask, r, 64).unwrap();
    // A window holds 5025 samples: its deviation is known to 1 %, a ratio of two to 1.4 %.
    let mean = |m: &Map| m.values.iter().sum::<f32>() / m.values.len() as f32;
    assert!((mean(&d.scale) - 1.5).abs() < 0.02 && (mean(&d.bias) - 0.08).abs() < 2e-4);
}

#[test]
fn neutral_weights_reproduce_the_neutral_map_bit_for_bit() {
    let base = texture(61, 47, 0.05, 0.01, 5);
    let base = Map { values: base.values.iter().map(|v| v.max(0.0)).collect(), ..base };
    let mean = Map::filled(8, 8, &[0.0499]);
    let d = Distribution {
        name: "x".into(),
        scale: Map::filled(8, 8, &[3.7]),
        bias: Map::filled(8, 8, &[0.0913]),
    };
    for weights in [&[][..], &[0.0], &[-0.0]] {
        assert_eq!(blend(&base, &mean, std::slice::from_ref(&d), weights, 1.0).values, base.values);
    }
}

#[test]
fn any_weights_stay_in_the_physical_range() {
    for weight in [0.0, 0.5, -3.0, 1e30, f32::MAX, f32::NAN, f32::INFINITY] {
        for global in [0.0, 0.81, 1.27, 1e30, -1.0] {
            for (scale, bias) in [(0.0, 0.0), (100.0, 0.3), (1.0, 0.05)] {
                let parts = [(weight, scale, bias), (weight, 2.0, 0.1)];
                let h = blend_texel(0.06, 0.05, parts, global);
                assert!((0.0..=MAX_HEMOGLOBIN as f32).contains(&h), "{weight} {global}: {h}");
            }
        }
    }
}

#[test]
fn weights_that_sum_to_one_are_equation_7_6() {
    let (h_n, mean) = (0.061f32, 0.05f32);
    let parts = [(0.3f32, 1.4f32, 0.08f32), (0.2, 0.7, 0.03)];
    let bias = 0.5 * mean + parts.iter().map(|p| p.0 * p.2).sum::<f32>();
    let scale = 0.5 + parts.iter().map(|p| p.0 * p.1).sum::<f32>();
    assert!((blend_texel(h_n, mean, parts, 1.0) - (bias + (h_n - mean) * scale)).abs() < 1e-7);
    assert!((blend_texel(h_n, mean, parts, 1.27) - 1.27 * (bias + (h_n - mean) * scale)).abs() < 1e-7);
}

#[test]
fn a_neutral_map_without_contrast_has_a_bounded_scale() {
    let mask = Mask::full(40, 40);
    let flat = neutral(&Map::filled(40, 40, &[0.05]), &mask, 5, 40).unwrap();
    let rough = distribution("rough", &flat, &texture(40, 40, 0.06, 0.01, 2), &mask, 5, 40).unwrap();
    assert!(rough.scale.values.iter().all(|s| *s == MAX_SCALE));
    let same = distribution("flat", &flat, &Map::filled(40, 40, &[0.09]), &mask, 5, 40).unwrap();
    assert!(same.scale.values.iter().all(|s| (*s - 1.0).abs() < 1e-6));
    assert!(same.bias.values.iter().all(|b| (*b - 0.09).abs() < 1e-7));
}

#[test]
fn background_does_not_leak_into_a_distribution() {
    // Skin in the left half at 0.05 and 0.08, background garbage in the right half.
    let (w, h) = (64, 64);
    let mask = Mask { width: w, height: h, mapped: (0..w * h).map(|i| i % w < 31).collect() };
    let halves = |value: f32, rest: f32| Map {
        width: w,
        height: h,
        channels: 1,
        values: (0..w * h).map(|i| if i % w < 31 { value } else { rest }).collect(),
    };
    let n = neutral(&halves(0.05, 0.0), &mask, 9, 16).unwrap();
    let d = distribution("joy", &n, &halves(0.08, f32::NAN), &mask, 9, 16).unwrap();
    assert!(n.mean.values.iter().all(|m| (*m - 0.05).abs() < 1e-7));
    assert!(d.bias.values.iter().all(|b| (*b - 0.08).abs() < 1e-7));
}

#[test]
fn targets_of_another_size_are_accepted() {
    let n = neutral(&Map::filled(48, 32, &[0.05]), &Mask::full(48, 32), 4, 16).unwrap();
    let d = distribution("big", &n, &Map::filled(96, 80, &[0.1]), &Mask::full(96, 80), 4, 16).unwrap();
    assert_eq!((d.bias.width, d.bias.height), (16, 16));
    assert!(d.bias.values.iter().all(|b| (*b - 0.1).abs() < 1e-6));
}

#[test]
fn exact_matching_of_a_map_with_itself_changes_nothing() {
    let map = texture(41, 33, 0.05, 0.01, 4);
    let mask = Mask { width: 41, height: 33, mapped: (0..41 * 33).map(|i| i % 7 != 3).collect() };
    let same = match_locally(&map, &map, &mask, 6).unwrap();
    // One level of 16 bits.
    assert!(map_difference(&map, &same, &Mask::full(41, 33)).max < 2e-6);
}

/// Sorts every window anew: the definition that the sliding histograms must agree with.
#[test]
fn sliding_histograms_agree_with_sorting() {
    let (w, h, r) = (23i64, 19i64, 4i64);
    let a = texture(w as u32, h as u32, 0.05, 0.01, 11);
    let b = texture(w as u32, h as u32, 0.09, 0.02, 12);
    let mask = Mask::full(w as u32, h as u32);
    let found = match_locally(&a, &b, &mask, r as u32).unwrap();
    for y in 0..h {
        for x in 0..w {
            let window = |m: &Map| {
                let mut v = Vec::new();
                for py in (y - r).max(0)..(y + r + 1).min(h) {
                    for px in (x - r).max(0)..(x + r + 1).min(w) {
                        if (px - x).pow(2) + (py - y).pow(2) <= r * r {
                            v.push(m.values[(py * w + px) as usize]);
                        }
                    }
                }
                v.sort_by(f32::total_cmp);
                v
            };
            let i = (y * w + x) as usize;
            let (wa, wb) = (window(&a), window(&b));
            let rank = wa.iter().position(|v| *v == a.values[i]).unwrap();
            assert!((found.values[i] - wb[rank]).abs() < 3e-6, "({x}, {y})");
        }
    }
}

#[test]
fn gaussians_approximate_exact_matching() {
    let (w, h, r) = (128, 128, 16);
    let mask = Mask::full(w, h);
    // Low-frequency change of mean and contrast over a Gaussian texture.
    let base = texture(w, h, 0.05, 0.006, 21);
    let values = (0..(w * h) as usize)
        .map(|i| {
            let u = (i % w as usize) as f32 / w as f32;
            0.06 + 0.03 * u + (0.8 + 0.8 * u) * (base.values[i] - 0.05)
        })
        .collect();
    let target = Map { values, ..base.clone() };
    let exact = match_locally(&base, &target, &mask, r).unwrap();
    let n = neutral(&base, &mask, r, 128).unwrap();
    let d = distribution("joy", &n, &target, &mask, r, 128).unwrap();
    let gaussian = blend(&base, &n.mean, &[d], &[1.0], 1.0);
    let e = map_difference(&exact, &gaussian, &mask);
    assert!(e.rms / e.reference_mean < 0.02, "{e:?}");
}
