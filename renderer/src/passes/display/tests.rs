use super::*;
use crate::settings::{DitherMethod, NEUTRAL_KELVIN};
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};
use glam::{DMat3, DVec3, Vec3};

/// Tone maps in f64, from their definitions.
fn displayed(light: [f64; 3], tone_map: ToneMap) -> [f64; 3] {
    let hable = |x: f64| (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3;
    let of_rows = |rows: [[f64; 3]; 3], v: DVec3| DVec3::from(rows.map(|row| DVec3::from(row).dot(v)));
    let light = DVec3::from(light);
    match tone_map {
        ToneMap::Linear => light.to_array(),
        ToneMap::Filmic => light.to_array().map(|x| hable(x) / hable(4.0)),
        ToneMap::Aces => {
            let input = [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]];
            let output =
                [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];
            let curve =
                |v: f64| (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
            let bent = of_rows(input, light / 0.6).to_array().map(curve);
            of_rows(output, DVec3::from(bent)).to_array()
        }
        ToneMap::Agx => {
            let into = DMat3::from_cols_array(&[
                0.842479062253094,
                0.0423282422610123,
                0.0423756549057051,
                0.0784335999999992,
                0.878468636469772,
                0.0784336,
                0.0792237451477643,
                0.0791661274605434,
                0.879142973793104,
            ]);
            let powers = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];
            let sigmoid = |v: f64| {
                let x = (v.max(1e-10).log2().clamp(-12.47393, 4.026069) + 12.47393) / 16.499999;
                powers.iter().rev().fold(0.0, |sum, c| sum * x + c)
            };
            let bent = DVec3::from((into * light).to_array().map(sigmoid));
            // The published inverse is that of the matrix to six digits.
            (into.inverse() * bent).to_array().map(|v| v.clamp(0.0, 1.0).powf(2.2))
        }
        ToneMap::Neutral => {
            let least = light.min_element();
            let color = light - if least < 0.08 { least - 6.25 * least * least } else { 0.04 };
            let peak = color.max_element();
            if peak < 0.76 {
                return color.to_array();
            }
            let shown = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
            let white = 1.0 - 1.0 / (0.15 * (peak - shown) + 1.0);
            (color * (shown / peak)).lerp(DVec3::splat(shown), white).to_array()
        }
    }
}

/// IEC 61966-2-1.
fn encoded(light: f64) -> f64 {
    let x = light.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn half(v: f32) -> f64 {
    f64::from(half::f16::from_f32(v).to_f32())
}

const CAMERA: Camera = Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 40.0 };

fn shown(gpu: &Gpu, look: &Look, size: [u32; 2], texels: &[[f32; 4]]) -> Vec<[u8; 4]> {
    let hdr = half_image(gpu, size, texels);
    let display = Display::new(gpu, Flavour::of(look));
    let image = recorded(gpu, |r| display.record(r, look, &CAMERA, &hdr, None));
    read_image(gpu, &image)
}

#[test]
fn the_shader_is_as_the_pass_counts_on() {
    let usual = Flavour::of(&Look::default());
    let on = Flavour { is_balanced: true, has_vignette: true, has_bloom: true, halves: true, ..usual };
    for tone_map in ToneMap::all() {
        for flavour in [usual, on] {
            assert_workgroups(&program(Flavour { tone_map, ..flavour }), &[("display", [8, 8, 1])]);
        }
    }
    assert_layout(
        &program(on),
        "display",
        "Params",
        size_of::<Params>(),
        &offsets!(Params; exposure as "exposure", spread as "spread", falloff as "falloff",
            tangents as "tangents", size as "size", balance_r as "balance_r", balance_g as "balance_g",
            balance_b as "balance_b"),
    );
}

#[test]
fn radiance_is_shown_as_the_curves_say_and_brighter_is_never_darker() {
    let Some(gpu) = gpu() else { return };
    let ramp: Vec<[f32; 4]> = (0..51 * 27).map(|i| [1e-4 * 1.01f32.powi(i), 0.3, 0.0, 1.0]).collect();
    for tone_map in ToneMap::all() {
        let look = Look { exposure: 0.65, ev: 1.0, tone_map, ..Look::default() };
        let found = shown(gpu, &look, [51, 27], &ramp);
        for (i, (f, texel)) in found.iter().zip(&ramp).enumerate() {
            let light = displayed([0, 1, 2].map(|c| 1.3 * half(texel[c])), tone_map);
            for c in 0..3 {
                let expected = 255.0 * encoded(light[c]);
                // Half a step of rounding; near to black the transfer makes much of the last bits of matrices.
                let bound = if expected < 12.0 { 0.62 } else { 0.53 };
                let error = (f64::from(f[c]) - expected).abs();
                assert!(error < bound, "{tone_map}, pixel {i}: {f:?}, expected {expected}");
            }
            assert_eq!(f[3], 255);
        }
    }
}

#[test]
fn greys_stay_in_order_through_every_tone_map() {
    let Some(gpu) = gpu() else { return };
    let ramp: Vec<[f32; 4]> =
        (0..51 * 27).map(|i| 1e-4 * 1.01f32.powi(i)).map(|grey| [grey, grey, grey, 1.0]).collect();
    for tone_map in ToneMap::all() {
        let look = Look { tone_map, ..Look::default() };
        let found = shown(gpu, &look, [51, 27], &ramp);
        assert!(found.windows(2).all(|w| (0..3).all(|c| w[0][c] <= w[1][c])), "{tone_map} is monotone");
        // AgX and ACES do not keep greys to the last bit: their matrices are rounded.
        let worst = found.iter().map(|f| f[..3].iter().max().unwrap() - f[..3].iter().min().unwrap()).max();
        assert!(worst.unwrap() <= 1, "{tone_map}: greys are off by {worst:?}");
        let (first, last) = (found[0][0], found[51 * 27 - 1][0]);
        assert!(first <= 3 && last >= 254, "{tone_map} shows {first} to {last}");
    }
}

#[test]
fn corners_fall_off_as_the_fourth_power_of_the_cosine() {
    let Some(gpu) = gpu() else { return };
    let size = [40u32, 20];
    let flat = vec![[0.5, 0.5, 0.5, 1.0]; 800];
    let look = |vignette| Look { exposure: 1.0, tone_map: ToneMap::Linear, vignette, ..Look::default() };
    for strength in [1.0, 2.5] {
        let found = shown(gpu, &look(strength), size, &flat);
        for (i, f) in found.iter().enumerate() {
            let tangent = 20f64.to_radians().tan();
            let [x, y] = [i as f64 % 40.0, (i / 40) as f64].map(|v| v + 0.5);
            let off = DVec3::new((x / 20.0 - 1.0) * 2.0 * tangent, (y / 10.0 - 1.0) * tangent, 1.0);
            let cosine = 1.0 / off.length();
            let expected = 255.0 * encoded(0.5 * cosine.powf(4.0 * f64::from(strength)));
            assert!((f64::from(f[0]) - expected).abs() < 0.52, "pixel {i}: {f:?}, expected {expected}");
        }
    }
}

#[test]
fn the_light_of_a_setting_is_shown_white() {
    let Some(gpu) = gpu() else { return };
    let look =
        Look { exposure: 1.0, tone_map: ToneMap::Linear, temperature: 3200.0, tint: 10.0, ..Look::default() };
    let back = white_balance::matrix(3200.0, 10.0).inverse();
    let lamp = (back * DVec3::splat(0.4)).as_vec3().extend(1.0).to_array();
    let found = shown(gpu, &look, [1, 1], &[lamp])[0];
    assert!(found[..3].iter().all(|v| v.abs_diff((255.0 * encoded(0.4)).round() as u8) <= 1), "{found:?}");
}

#[test]
fn what_is_off_is_not_compiled() {
    let off = Look::default();
    assert_eq!(
        Flavour::of(&off),
        Flavour {
            tone_map: ToneMap::Filmic,
            is_balanced: false,
            has_vignette: false,
            has_bloom: false,
            halves: false
        }
    );
    let linked = program(Flavour::of(&off)).link(&["display"], false);
    let names: Vec<&str> = linked.bindings.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["params", "hdr", "image"]);
    let on = Look {
        temperature: NEUTRAL_KELVIN + 1.0,
        vignette: 1.0,
        bloom: 0.1,
        dither: DitherMethod::Triangular,
        ..off
    };
    let linked = program(Flavour::of(&on)).link(&["display"], false);
    assert!(linked.wgsl.contains("rgba16float") && linked.bindings.len() == 5);
}
