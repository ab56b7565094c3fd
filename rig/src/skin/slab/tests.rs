use super::*;
use crate::skin::monte_carlo::AlbedoTable;
use crate::skin::profile::Profile;

fn walk(thickness: f64, albedos: &[f64], photons: u64) -> Vec<SlabLight> {
    SlabWalk { eta: 1.4, thickness, albedos: albedos.to_vec(), photons, seed: 7 }.run().unwrap()
}

#[test]
fn a_slab_that_vanishes_passes_all_that_its_far_side_lets_out() {
    let inside = fresnel_from_inside(1.0, 1.4);
    for light in walk(0.0, &[0.0, 0.5, 0.999], 640) {
        // Without a collision light goes to and fro along one line; each side lets out its share.
        assert!((light.passed - 1.0 / (1.0 + inside)).abs() < 0.01, "{light:?}");
        assert!((light.reflected + light.passed - 1.0).abs() < 0.01, "{light:?}");
    }
}

#[test]
fn without_scattering_light_falls_as_beer_and_lambert_say() {
    let f = fresnel_from_inside(1.0, 1.4);
    for thickness in [0.2, 1.0, 3.0] {
        let once = f64::exp(-thickness);
        // All ways to and fro between two mirrors (Airy, without interference).
        let expected = (1.0 - f) * once / (1.0 - (f * once).powi(2));
        let found = walk(thickness, &[0.0], 60_000)[0].passed;
        assert!((found - expected).abs() < 0.01 * expected + 1e-3, "{thickness}: {found} {expected}");
    }
}

#[test]
fn light_is_kept_where_nothing_absorbs_it() {
    for thickness in [0.5, 2.0] {
        let light = walk(thickness, &[MAX_ALBEDO], 20_000)[0];
        assert!((light.reflected + light.passed - 1.0).abs() < 0.01, "{light:?}");
    }
}

/// Decay of light deep in a medium of isotropic scatterers, per mean free path: the root of
/// `albedo / (2 k) ln((1 + k) / (1 - k)) = 1` (Case and Zweifel 1967).
fn exact_decay(albedo: f64) -> f64 {
    let (mut low, mut high) = (1e-9, 1.0 - 1e-12);
    for _ in 0..100 {
        let k = 0.5 * (low + high);
        if albedo / (2.0 * k) * ((1.0 + k) / (1.0 - k)).ln() < 1.0 { low = k } else { high = k }
    }
    0.5 * (low + high)
}

#[test]
fn thick_slabs_decay_as_transport_theory_says() {
    for albedo in [0.8, 0.95, 0.99] {
        let k = exact_decay(albedo);
        let [a, b] = [3.0, 5.0].map(|t| walk(t / k, &[albedo], 100_000)[0].passed);
        let found = (a / b).ln() * k / 2.0;
        assert!((found - k).abs() < 0.05 * k, "{albedo}: {found} not {k}");
    }
}

#[test]
fn a_half_space_reflects_what_the_other_walk_says() {
    let table = AlbedoTable::build(0.0, 1.4, 100_000, 9).unwrap();
    let albedos = [0.5, 0.9, 0.98];
    for (albedo, light) in albedos.iter().zip(walk(f64::INFINITY, &albedos, 100_000)) {
        let expected = table.total(*albedo).unwrap();
        assert!((light.reflected - expected).abs() < 0.015 * expected, "{albedo}: {light:?} {expected}");
        let medium = crate::skin::medium::Medium::new(*albedo, 1.0 - albedo, 1.4).unwrap();
        let profile = crate::skin::profile::RadialProfile::Tabulated(table.profile(&medium).unwrap());
        let (found, expected) = (light.distance / light.reflected, profile.mean_radius_mm());
        assert!((found - expected).abs() < 0.03 * expected, "{albedo}: {found} {expected}");
    }
}

#[test]
fn the_kept_table_is_that_of_a_walk() {
    let kept = SlabTable::kept();
    assert_eq!(kept.eta, 1.4);
    let columns = kept.rows[0].len();
    assert!(kept.rows.len() >= 8 && kept.rows.iter().all(|r| r.len() == columns));
    // Monotone: thicker slabs pass less, brighter media more.
    for row in &kept.rows {
        assert!(row.windows(2).all(|w| w[1] < w[0] + 2e-3), "{row:?}");
    }
    let again = SlabTable::build(1.4, 0.8, 2.25, [4, 5], 10_000, 99).unwrap();
    for (r, row) in again.rows.iter().enumerate() {
        for (c, expected) in row.iter().enumerate() {
            let thickness = 2.25 * (c as f64 / 3.0).powi(2);
            let found = kept.sample(0.2 * r as f64, thickness);
            assert!((found - expected).abs() < 0.02, "row {r}, thickness {thickness}: {found} {expected}");
        }
    }
}

#[test]
fn mean_radii_are_those_of_gaussians() {
    // Mean of r over 2 pi r G(r): sqrt(pi v / 2).
    let profile = Profile::deon_six();
    let terms =
        [(0.0064, 0.233), (0.0484, 0.1), (0.187, 0.118), (0.567, 0.113), (1.99, 0.358), (7.41, 0.078)];
    let expected: f64 = terms.iter().map(|(v, w)| w * (std::f64::consts::FRAC_PI_2 * v).sqrt()).sum();
    assert!((profile.channels[0].mean_radius_mm() - expected).abs() < 1e-3 * expected);
}

#[test]
fn numbers_out_of_range_are_errors() {
    let sound = SlabWalk { eta: 1.4, thickness: 1.0, albedos: vec![0.5], photons: 64, seed: 1 };
    let at = |walk: SlabWalk| walk.run().unwrap_err().at;
    assert_eq!(at(SlabWalk { eta: 9.0, ..sound.clone() }), "slab.eta");
    assert_eq!(at(SlabWalk { thickness: -1.0, ..sound.clone() }), "slab.thickness");
    assert_eq!(at(SlabWalk { albedos: vec![1.0], ..sound }), "slab.albedos");
    assert_eq!(SlabTable::build(1.4, 0.9, 9.0, [1, 4], 64, 1).unwrap_err().at, "slab.size");
}
