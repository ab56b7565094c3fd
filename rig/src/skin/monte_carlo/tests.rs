use super::*;
use crate::skin::numerics::gauss_legendre;

/// Total reflectance of an index-matched half space of isotropic scatterers under a normal beam, `1 - sqrt(1-a) H(1)`,
/// from Chandrasekhar 1960: H by iteration of its integral equation.
fn exact_total(albedo: f64) -> f64 {
    let rule: Vec<(f64, f64)> = gauss_legendre(64).iter().map(|(x, w)| (0.5 * (x + 1.0), 0.5 * w)).collect();
    let root = (1.0 - albedo).sqrt();
    let mut h = vec![1.0; rule.len()];
    // 1/H(mu) = sqrt(1-a) + a/2 integral of m H(m) / (mu + m) dm, the form that converges for every albedo.
    let next = |h: &[f64], mu: f64| {
        let integral: f64 = rule.iter().zip(h).map(|((m, w), h)| w * m * h / (mu + m)).sum();
        1.0 / (root + 0.5 * albedo * integral)
    };
    for _ in 0..2000 {
        h = rule.iter().map(|(mu, _)| next(&h, *mu)).collect();
    }
    1.0 - root * next(&h, 1.0)
}

#[test]
fn totals_match_the_exact_solution_at_a_matched_index() {
    let albedos = vec![0.3, 0.6, 0.9, 0.99];
    let result = PhotonWalk::isotropic(1.0, albedos.clone(), 60_000, 1).run().unwrap();
    for (k, &albedo) in albedos.iter().enumerate() {
        let (found, error, exact) = (result.total[k], result.total_error[k], exact_total(albedo));
        assert!(error > 0.0 && error < 0.01 * exact, "albedo {albedo}: {error}");
        assert!((found - exact).abs() < 4.0 * error, "albedo {albedo}: {found} +- {error}, exact {exact}");
    }
    // van de Hulst 1980, albedo 0.9.
    assert!((exact_total(0.9) - 0.4149).abs() < 2e-4, "{}", exact_total(0.9));
}

#[test]
fn total_with_a_refracting_surface_matches_giovanelli() {
    // Giovanelli 1955: eta 1.5, sigma_a 10 and sigma_s 90 per cm, isotropic: 0.2600 with the 4 % that the beam loses
    // on the way in.
    let result = PhotonWalk::isotropic(1.5, vec![0.9], 100_000, 2).run().unwrap();
    let total = 0.04 + 0.96 * result.total[0];
    assert!((total - 0.2600).abs() < 4.0 * result.total_error[0] + 0.0005, "{total}");
}

#[test]
fn scattered_directions_have_the_mean_cosine_of_henyey_and_greenstein() {
    let mut random = Random::new(13, 0);
    let from: (f64, f64, f64) = (0.6, 0.0, -0.8);
    for g in [-0.5, 0.3, 0.9] {
        let (mut first, mut second, n) = (0.0, 0.0, 200_000);
        for _ in 0..n {
            let (x, y, z) = scatter(from, g, &mut random);
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-12);
            let cos = x * from.0 + y * from.1 + z * from.2;
            first += cos / n as f64;
            second += 0.5 * (3.0 * cos * cos - 1.0) / n as f64;
        }
        // The moments of Legendre polynomials are g and g^2.
        assert!((first - g).abs() < 4e-3 && (second - g * g).abs() < 4e-3, "{g}: {first} {second}");
    }
}

#[test]
fn weak_anisotropic_scattering_matches_the_single_scattering_integral() {
    // At a matched index and a small albedo a: a integral 2 pi p(-mu) mu / (1 + mu) dmu.
    let (albedo, g) = (1e-4, 0.5f64);
    let phase = |mu: f64| (1.0 - g * g) / (4.0 * PI * (1.0 + g * g + 2.0 * g * mu).powf(1.5));
    let rule = gauss_legendre(32);
    let single: f64 = rule
        .iter()
        .map(|(x, w)| (0.5 * (x + 1.0), 0.5 * w))
        .map(|(mu, w)| w * 2.0 * PI * phase(mu) * mu / (1.0 + mu))
        .sum();
    let walk = PhotonWalk { anisotropy: g, ..PhotonWalk::isotropic(1.0, vec![albedo], 200_000, 14) };
    let result = walk.run().unwrap();
    let (found, error) = (result.total[0] / albedo, result.total_error[0] / albedo);
    assert!((found - single).abs() < 4.0 * error + 1e-3 * single, "{found} +- {error}, exact {single}");
}

#[test]
fn forward_scattering_approaches_its_reduced_medium_in_total() {
    let walk = PhotonWalk {
        anisotropy: 0.8,
        rings: Rings { outer: 2000.0, ..Rings::default() },
        ..PhotonWalk::isotropic(1.4, vec![0.99], 20_000, 3)
    };
    let forward = walk.run().unwrap();
    let reduced = (0.99 * 0.2) / (0.99 * 0.2 + 0.01);
    let isotropic = PhotonWalk::isotropic(1.4, vec![reduced], 40_000, 4).run().unwrap();
    let ratio = forward.total[0] / isotropic.total[0];
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
}

#[test]
fn estimators_agree_and_the_expected_one_is_quieter() {
    let expected = PhotonWalk::isotropic(1.4, vec![0.85], 40_000, 5);
    let analog = PhotonWalk { estimator: Estimator::Analog, seed: 6, ..expected.clone() };
    let (expected, analog) = (expected.run().unwrap(), analog.run().unwrap());
    let spread = expected.total_error[0].hypot(analog.total_error[0]);
    assert!((expected.total[0] - analog.total[0]).abs() < 4.0 * spread);
    let noise = |result: &WalkResult| result.ring_error[0].iter().sum::<f64>();
    assert!(noise(&expected) < 0.85 * noise(&analog));
}

#[test]
fn same_seed_same_bits_on_any_number_of_threads() {
    let walk = PhotonWalk::isotropic(1.3, vec![0.5, 0.9], 2_000, 7);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| walk.run()).unwrap();
    let many =
        rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(|| walk.run()).unwrap();
    assert_eq!(one, many);
    let other = PhotonWalk { seed: 8, ..walk }.run().unwrap();
    assert_ne!(one.total, other.total);
}

#[test]
fn all_light_is_counted_once() {
    let result = PhotonWalk::isotropic(1.4, vec![0.9], 3_000, 9).run().unwrap();
    let sum: f64 = result.ring_light[0].iter().sum();
    assert!((sum - result.total[0]).abs() < 1e-12);
    assert_eq!(result.edges.len(), result.ring_light[0].len());
    let table = result.table(0, 2.0).unwrap();
    assert!((table.total() - result.total[0]).abs() < 1e-12);
}

#[test]
fn interpolated_profile_matches_a_walk_of_its_own() {
    // The albedo is no node of the table and the seeds differ.
    let table = AlbedoTable::build(0.0, 1.4, 30_000, 10).unwrap();
    let medium = Medium::new(0.88, 0.17, 1.4).unwrap();
    let walk = PhotonWalk::isotropic(1.4, vec![medium.albedo()], 120_000, 11).run().unwrap();
    let profile = RadialProfile::Tabulated(table.profile(&medium).unwrap());
    let error = walk.compare(0, medium.sigma_t_prime_per_mm(), &profile);
    // The table has a quarter of the photons, so both together have the root of 5 times the walk's noise: anything
    // more would be an error of the interpolation.
    assert!(error.relative < 1.2 * 5f64.sqrt() * error.noise, "{error:?}");
    let total = table.total(medium.albedo()).unwrap();
    assert!((total - walk.total[0]).abs() < 0.02 * total, "{total} {}", walk.total[0]);
}

#[test]
fn table_survives_serialisation() {
    let table = AlbedoTable::build(0.0, 1.3, 500, 12).unwrap();
    let again: AlbedoTable = serde_json::from_str(&serde_json::to_string(&table).unwrap()).unwrap();
    let ulp = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-15);
    assert!(ulp(&table.result.total, &again.result.total));
    assert!(ulp(&table.result.walk.albedos, &again.result.walk.albedos));
    let medium = Medium::new(1.0, 0.1, 1.3).unwrap();
    let (a, b) = (table.profile(&medium).unwrap(), again.profile(&medium).unwrap());
    assert!((a.mass_beyond(0.5) - b.mass_beyond(0.5)).abs() < 1e-12);
}

#[test]
fn damaged_tables_are_errors() {
    let good = WalkResult::from(AlbedoTable::build(0.0, 1.3, 500, 12).unwrap());
    let at = |damage: &dyn Fn(&mut WalkResult)| {
        let mut result = good.clone();
        damage(&mut result);
        AlbedoTable::try_from(result).unwrap_err().at
    };
    assert_eq!(at(&|r| r.walk.albedos[0] = 0.5), "table.walk.albedos");
    assert_eq!(at(&|r| r.walk.eta = 9.0), "walk.eta");
    assert_eq!(at(&|r| r.edges.truncate(3)), "table.edges");
    assert_eq!(at(&|r| r.ring_light[2].truncate(5)), "table.ring_light");
    assert_eq!(at(&|r| r.ring_light[2][3] = f64::NAN), "table.ring_light");
    assert_eq!(at(&|r| r.total.clear()), "table.total");
    assert!(AlbedoTable::try_from(good).is_ok());
}

#[test]
fn limits_are_errors() {
    let good = PhotonWalk::isotropic(1.4, vec![0.9], 100, 0);
    for albedo in [0.0, 1.0, -0.1, f64::NAN] {
        let walk = PhotonWalk { albedos: vec![albedo], ..good.clone() };
        assert_eq!(walk.run().unwrap_err().at, "walk.albedos[0]");
    }
    assert_eq!(PhotonWalk { photons: 0, ..good.clone() }.run().unwrap_err().at, "walk.photons");
    assert_eq!(PhotonWalk { anisotropy: 1.0, ..good.clone() }.run().unwrap_err().at, "walk.anisotropy");
    assert_eq!(PhotonWalk { eta: f64::NAN, ..good.clone() }.run().unwrap_err().at, "walk.eta");
    let rings = Rings { outer: f64::INFINITY, ..Rings::default() };
    assert_eq!(PhotonWalk { rings, ..good }.run().unwrap_err().at, "walk.rings");

    let table = AlbedoTable::build(0.0, 1.4, 500, 0).unwrap();
    assert_eq!(table.total(0.0).unwrap(), 0.0);
    assert_eq!(table.profile(&Medium::new(1.0, 0.0, 1.4).unwrap()).unwrap_err().at, "medium.albedo");
    assert_eq!(table.profile(&Medium::new(1.0, 0.1, 1.3).unwrap()).unwrap_err().at, "medium.eta");
    assert_eq!(table.profile_of(0.0, 1.0).unwrap_err().at, "medium.albedo");
    assert_eq!(table.profile_of(f64::INFINITY, 1.0).unwrap_err().at, "medium.sigma_t_per_mm");
}
