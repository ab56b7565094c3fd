use super::invert::SkinInverse;
use super::monte_carlo::{self, Walk};
use super::published::{PUBLISHED, Source};
use super::*;
use crate::color::{
    ciede2000, individual_typology_angle_degrees, lab_from_rec709, lab_from_xyz, rec709_from_lab,
};

fn skin() -> (ChromophoreModel, SkinModel) {
    let model = ChromophoreModel::default();
    (model, SkinModel::new(&model))
}

fn lab(color: [f32; 3]) -> [f64; 3] {
    lab_from_rec709(color.map(f64::from))
}

#[test]
fn a_perfect_reflector_is_white_in_every_primary() {
    let sum = spectral_weights().iter().fold([0.0; 3], |s, (_, w)| [0, 1, 2].map(|i| s[i] + w[i]));
    assert!(sum.iter().all(|s| (s - 1.0).abs() < 1e-12), "{sum:?}");
    let (mut xyz, mut norm) = ([0.0; 3], 0.0);
    for (cmf, power) in OBSERVER.iter().zip(&D65) {
        norm += cmf[1] * power;
        xyz = [0, 1, 2].map(|i| xyz[i] + cmf[i] * power);
    }
    let white = lab_from_xyz(xyz.map(|c| c / norm));
    assert!((white[0] - 100.0).abs() < 1e-9 && white[1].hypot(white[2]) < 1e-9, "{white:?}");
}

#[test]
fn the_table_is_the_direct_solution() {
    let (model, skin) = skin();
    for (u, v) in [(0.02, 0.03), (0.31, 0.27), (0.55, 0.9), (0.83, 0.48), (0.97, 0.96)] {
        let [m, h] = fractions_at(u, v);
        let d =
            ciede2000(lab_from_rec709(skin.color_at(u, v)), lab_from_rec709(skin_color_direct(&model, m, h)));
        assert!(d < 0.03, "({u}, {v}): {d}");
    }
}

/// Each wavelength is compared within 4.5 standard errors, so the tolerance is that of the photons alone.
#[test]
fn reflectance_is_that_of_photon_walks() {
    let model = ChromophoreModel::default();
    let walk = Walk { photons: 4000, seed: 11, mean_cosine: 0.0 };
    for (m, h) in [(0.0, 0.0), (0.02, 0.015), (0.1, 0.05), (0.5, 0.32)] {
        for nm in [410.0, 450.0, 500.0, 545.0, 575.0, 620.0, 700.0] {
            let (truth, error) = monte_carlo::reflectance(&model, nm, m, h, walk);
            let fast = spectral_reflectance(&model, nm, m, h);
            assert!(
                (fast - truth).abs() < 4.5 * error,
                "{m} {h} {nm} nm: {fast}, photons {truth} +- {error}"
            );
        }
    }
}

#[test]
fn a_skin_without_absorption_returns_all_that_enters() {
    // Nearly: the solver clamps the albedo, so it is asked a little below 1.
    let directions = layers::Directions::new(1.4);
    let white = coefficients::Medium { absorption_per_mm: 1e-9, scattering_per_mm: 10.0 };
    let r = directions.reflectance(white, 0.1, &directions.half_space(white));
    let entering = 1.0 - layers::fresnel_reflectance(1.0, 1.4);
    assert!((r - entering).abs() < 2e-3, "{r} {entering}");
    // Two layers of one medium are one: the thickness of the upper does not matter.
    let grey = coefficients::Medium { absorption_per_mm: 0.7, scattering_per_mm: 5.0 };
    let base = directions.half_space(grey);
    let [a, b] = [0.01, 3.0].map(|t| directions.reflectance(grey, t, &base));
    assert!((a - b).abs() < 1e-9, "{a} {b}");
    // The same holds for three layers of any thickness.
    let three = directions.reflectance(grey, 0.02, &directions.over(grey, 0.1, &base));
    assert!((a - three).abs() < 1e-9, "{a} {three}");
    let odd = coefficients::Medium { absorption_per_mm: 3.0, scattering_per_mm: 6.0 };
    let once = directions.reflectance(grey, 0.05, &directions.over(odd, 0.07, &base));
    let split = directions.over(odd, 0.03, &directions.over(odd, 0.04, &base));
    assert!((once - directions.reflectance(grey, 0.05, &split)).abs() < 1e-9);
    // Without a surface and at normal incidence an isotropic half space has Chandrasekhar's H functions:
    // R = 1 - H(1) sqrt(1 - omega), H(1) = 2.0771 at omega = 0.9 (his table XI gives H to 4 digits).
    let open = layers::Directions::new(1.0);
    let medium = coefficients::Medium { absorption_per_mm: 0.1, scattering_per_mm: 0.9 };
    let r = open.reflectance(medium, 1.0, &open.half_space(medium));
    let h = h_function_at_1(0.9);
    assert!((r - (1.0 - h * 0.1f64.sqrt())).abs() < 1e-4, "{r} {}", 1.0 - h * 0.1f64.sqrt());
}

/// Chandrasekhar's H(1) of isotropic scattering by iterating its integral equation (1950, ch. 5).
fn h_function_at_1(albedo: f64) -> f64 {
    const N: usize = 400;
    let mu = |i: usize| (i as f64 + 0.5) / N as f64;
    let mut h = vec![1.0; N];
    let root = (1.0 - albedo).sqrt();
    let at = |h: &[f64], x: f64| {
        let integral: f64 = (0..N).map(|i| mu(i) * h[i] / (x + mu(i))).sum::<f64>() / N as f64;
        1.0 / (root + 0.5 * albedo * integral)
    };
    for _ in 0..60 {
        h = (0..N).map(|i| at(&h, mu(i))).collect();
    }
    at(&h, 1.0)
}

#[test]
fn published_skin_lies_near_the_table() {
    let (_, skin) = skin();
    let lookup = skin.bake(64, 64);
    let inverse = SkinInverse::new(&lookup);
    let mut measured = Vec::new();
    for color in PUBLISHED {
        let fit = inverse.fit(rec709_from_lab(color.lab).map(|c| c as f32));
        assert!(f64::from(fit.residual) < color.source.tolerance(), "{}: {fit:?}", color.name);
        if color.source == Source::Xiao2017 {
            let plausible = (0.003..0.06).contains(&fit.melanin) && (0.002..0.03).contains(&fit.hemoglobin);
            assert!(plausible, "{}: {fit:?}", color.name);
            measured.push(fit.residual);
        }
    }
    let mean = measured.iter().sum::<f32>() / measured.len() as f32;
    assert!(mean < 0.8, "mean {mean}");
}

#[test]
fn melanin_darkens_and_blood_reddens() {
    let (_, skin) = skin();
    let at = |i: i32, j: i32| lab_from_rec709(skin.color_at(f64::from(i) / 40.0, f64::from(j) / 40.0));
    for j in 0..=40 {
        for i in 0..=40 {
            let here = at(i, j);
            if i < 40 {
                assert!(at(i + 1, j)[0] < here[0], "L* grows with melanin at {i} {j}");
            }
            if j < 40 {
                let next = at(i, j + 1);
                assert!(next[0] < here[0], "L* grows with hemoglobin at {i} {j}");
                // Beyond about 10 % blood skin darkens as a whole and a* levels off with L*; redness for its
                // lightness still grows.
                // Dark skin hides its blood, and beyond a quarter of blood most of the light comes from the horny
                // layer.
                let [m, h] = fractions_at(f64::from(i) / 40.0, f64::from(j + 1) / 40.0);
                if m < 0.1 && h < 0.25 {
                    let redness = |lab: [f64; 3]| lab[1] / lab[0];
                    assert!(redness(next) > redness(here), "redness falls with hemoglobin at {i} {j}");
                }
                if m < 0.06 && h < 0.08 {
                    assert!(next[1] > here[1], "a* falls with hemoglobin at {i} {j}");
                }
            }
        }
    }
}

#[test]
fn typology_angles_span_light_to_dark() {
    let (_, skin) = skin();
    let angle = |m| individual_typology_angle_degrees(lab_from_rec709(skin.color(m, 0.015)));
    assert!(angle(0.005) > 50.0 && angle(0.02) > 30.0 && angle(0.05) < 20.0 && angle(0.2) < -30.0);
}

#[test]
fn colors_come_back_as_fractions() {
    let (_, skin) = skin();
    let lookup = skin.bake(64, 64);
    let inverse = SkinInverse::new(&lookup);
    let (mut sum, mut worst, mut n) = (0.0, 0.0f64, 0.0);
    for j in 0..20 {
        for i in 0..20 {
            let (u, v) = ((i as f32 + 0.37) / 20.0, (j as f32 + 0.61) / 20.0);
            let color = lookup.sample_at(u, v);
            let fit = inverse.fit(color);
            let d = ciede2000(lab(color), lab(lookup.sample(fit.melanin, fit.hemoglobin)));
            (sum, worst, n) = (sum + d, worst.max(d), n + 1.0);
        }
    }
    assert!(sum / n < 0.01 && worst < 0.2, "mean {} worst {worst}", sum / n);
    // A blue surface is not skin: the residual is large.
    assert!(inverse.fit([0.05, 0.1, 0.6]).residual > 20.0);
}

#[test]
fn addresses_are_clamped_and_invert() {
    assert_eq!(lookup_address(-1.0, 9.0), [0.0, 1.0]);
    let [u, v] = lookup_address(0.03, 0.02);
    let [m, h] = fractions_at(u, v);
    assert!((m - 0.03).abs() < 1e-12 && (h - 0.02).abs() < 1e-12);
    let (_, skin) = skin();
    let lookup = skin.bake(2, 3);
    assert_eq!(lookup.sample_at(f32::NAN, -3.0), lookup.texels[0]);
    let last = lookup.sample(1.0, 1.0);
    assert!((0..3).all(|i| (last[i] - lookup.texels[5][i]).abs() < 1e-6), "{last:?}");
}

#[test]
fn a_colour_of_its_own_follows_blood_as_the_look_up_does() {
    let (_, skin) = skin();
    let lookup = skin.bake(64, 64);
    let (m, h) = (0.02, 0.02);
    for own in [[0.0; 3], [1.0; 3], [0.02, 0.01, 0.01], [0.9, 0.75, 0.7], [0.1, 0.2, 0.9]] {
        assert_eq!(lookup.with_blood(own, m, h, h), own, "nothing changes");
        for to in [0.0, 0.05, 0.32] {
            let moved = lookup.with_blood(own, m, h, to);
            assert!(moved.iter().all(|c| (0.0..=1.0).contains(c)), "{own:?} at {to}: {moved:?}");
        }
    }
    // The look-up's own colour moves along the look-up, but for the floor that keeps ratios finite.
    let moved = lookup.with_blood(lookup.sample(m, h), m, h, 0.06);
    let difference = ciede2000(lab(moved), lab(lookup.sample(m, 0.06)));
    assert!(difference < 0.3, "{difference}");
    // Blood takes green first, in painted colours too.
    let [r, g, b] = lookup.with_blood([0.95, 0.8, 0.75], m, h, 0.06);
    assert!(g / 0.8 < b / 0.75 && b / 0.75 < r / 0.95, "{r} {g} {b}");
    // From 1 % to 8 % blood, pale to flushed, nothing meets the bound.
    for i in 0..=50 {
        let m = fractions_at(f64::from(i) / 50.0, 0.0)[0] as f32;
        let both = [lookup.change(m, 0.01, 0.08), lookup.change(m, 0.08, 0.01)];
        for c in both.as_flattened() {
            assert!(*c < 0.95 * MOST_CHANGE && *c > 1.05 / MOST_CHANGE, "melanin {m}: {c}");
        }
    }
}
