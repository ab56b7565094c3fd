use super::*;
use crate::skin::medium::{SKIN1, SKIN2, rgb_media};
use crate::skin::profile::RadialProfile;

fn media() -> Vec<Medium> {
    let mut media = vec![Medium::new(1.0, 0.0, 1.4).unwrap(), Medium::new(0.5, 2.0, 1.0).unwrap()];
    for (skin, eta) in [(&SKIN1, 1.3), (&SKIN1, 1.4), (&SKIN2, 1.4)] {
        media.extend(rgb_media(skin, eta).unwrap());
    }
    media
}

fn models(medium: Medium) -> Vec<RadialProfile> {
    let slab = |side| SlabShape { medium, thickness_mm: 2.5, side };
    let mut models = vec![
        RadialProfile::StandardDipole(StandardDipole::new(medium).unwrap()),
        RadialProfile::BetterDipole(BetterDipole::new(medium).unwrap()),
        RadialProfile::MultipoleSlab(MultipoleSlab::new(slab(SlabSide::Lit)).unwrap()),
        RadialProfile::MultipoleSlab(MultipoleSlab::new(slab(SlabSide::Far)).unwrap()),
        RadialProfile::NormalizedDiffusion(
            NormalizedDiffusion::published(medium.albedo(), medium.mean_free_path_mm()).unwrap(),
        ),
    ];
    if medium.sigma_a_per_mm > 0.0 {
        models.push(RadialProfile::PhotonBeamDiffusion(PhotonBeamDiffusion::new(medium).unwrap()));
    }
    models
}

#[test]
fn closed_forms_match_quadrature_of_the_profile() {
    let rule = gauss_legendre(8);
    for medium in media() {
        for model in models(medium) {
            for (a, b) in [(0.01f64, 0.3), (0.3, 1.0), (1.0, 5.0), (5.0, 20.0)] {
                let panels = 64;
                let edge = |i: i32| a * (b / a).powf(i as f64 / panels as f64);
                let quadrature: f64 = (0..panels)
                    .map(|i| integrate(&rule, edge(i), edge(i + 1), |r| 2.0 * PI * r * model.reflectance(r)))
                    .sum();
                let closed = model.mass_beyond(a) - model.mass_beyond(b);
                assert!(
                    (quadrature - closed).abs() < 1e-6 * model.total(),
                    "{model:?} {a}..{b}: {quadrature} {closed}"
                );
            }
        }
    }
}

#[test]
fn profiles_fall_and_are_finite_from_a_micrometre_to_a_metre() {
    for medium in media() {
        for model in models(medium) {
            let (mut previous, mut beyond) = (f64::INFINITY, f64::INFINITY);
            for i in 0..61 {
                let r = 1e-3 * 10f64.powf(i as f64 / 10.0);
                let value = model.reflectance(r);
                // The part that a slab's truncated series leaves out.
                let rounding = 1e-6 * model.total();
                assert!(
                    value.is_finite() && value >= 0.0 && value <= previous + rounding,
                    "{model:?} {r}: {value}"
                );
                let mass = model.mass_beyond(r);
                assert!((0.0..=beyond + rounding).contains(&mass), "{model:?} {r}: {mass}");
                (previous, beyond) = (value, mass);
            }
        }
    }
}

#[test]
fn nothing_is_lost_without_absorption() {
    let medium = Medium::new(1.3, 0.0, 1.4).unwrap();
    assert!((StandardDipole::new(medium).unwrap().mass_beyond(0.0) - 1.0).abs() < 1e-12);
    assert!((BetterDipole::new(medium).unwrap().mass_beyond(0.0) - 1.0).abs() < 1e-9);
    let side = |side| MultipoleSlab::new(SlabShape { medium, thickness_mm: 3.0, side }).unwrap().total();
    assert!((side(SlabSide::Lit) + side(SlabSide::Far) - 1.0).abs() < 1e-12);
    // The limit is continuous.
    let almost = Medium::new(1.3, 1e-9, 1.4).unwrap();
    let side =
        |side| MultipoleSlab::new(SlabShape { medium: almost, thickness_mm: 3.0, side }).unwrap().total();
    assert!((side(SlabSide::Lit) + side(SlabSide::Far) - 1.0).abs() < 1e-6);
}

#[test]
fn a_thick_slab_is_a_half_space() {
    let medium = Medium::new(1.09, 0.3, 1.3).unwrap();
    let dipole = StandardDipole::new(medium).unwrap();
    let slab = MultipoleSlab::new(SlabShape { medium, thickness_mm: 60.0, side: SlabSide::Lit }).unwrap();
    for r in [0.0, 0.2, 1.0, 4.0] {
        // The slab places its image by z_b = 2A/(3 sigma_t'), as the dipole does.
        assert!((slab.reflectance(r) / dipole.reflectance(r) - 1.0).abs() < 1e-9, "{r}");
    }
    assert!((slab.total() - dipole.mass_beyond(0.0)).abs() < 1e-12);
}

#[test]
fn thinner_slabs_let_more_light_through() {
    let medium = Medium::new(1.09, 0.013, 1.4).unwrap();
    let total = |thickness_mm| {
        MultipoleSlab::new(SlabShape { medium, thickness_mm, side: SlabSide::Far }).unwrap().total()
    };
    let totals: Vec<f64> = [1.0, 2.0, 4.0, 8.0, 16.0].map(total).to_vec();
    assert!(totals.windows(2).all(|t| t[1] < t[0]), "{totals:?}");
}

#[test]
fn normalized_diffusion_inverts_exactly_and_is_a_sum_of_exponentials() {
    let burley = NormalizedDiffusion::new(0.6, 0.7).unwrap();
    let profile = RadialProfile::NormalizedDiffusion(burley);
    for u in [0.0, 1e-9, 0.01, 0.5, 0.99, 1.0 - 1e-9] {
        let r = profile.sample_radius(u);
        assert!((profile.cdf(r) - u).abs() < 1e-9, "{u}");
    }
    assert_eq!(profile.sample_radius(1.0), f64::INFINITY);
    let sum = ExponentialSum::new(vec![
        ExponentialTerm { length_mm: 2.1, weight: 0.45 },
        ExponentialTerm { length_mm: 0.7, weight: 0.15 },
    ])
    .unwrap();
    for r in [0.1, 1.0, 5.0] {
        assert!((sum.reflectance(r) / profile.reflectance(r) - 1.0).abs() < 1e-12);
        assert!((sum.mass_beyond(r) / profile.mass_beyond(r) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn values_outside_of_a_model_are_errors() {
    let medium = Medium::new(1.0, 0.1, 1.4).unwrap();
    for thickness_mm in [0.0, 0.5, -1.0, f64::INFINITY, f64::NAN] {
        let shape = SlabShape { medium, thickness_mm, side: SlabSide::Lit };
        assert_eq!(MultipoleSlab::new(shape).unwrap_err().at, "slab.thickness_mm");
    }
    for albedo in [0.0, 1.1, f64::NAN] {
        assert_eq!(NormalizedDiffusion::new(albedo, 1.0).unwrap_err().at, "normalized_diffusion.albedo");
    }
    assert!(NormalizedDiffusion::new(1.0, 1.0).is_ok());
    assert_eq!(NormalizedDiffusion::new(0.5, 0.0).unwrap_err().at, "normalized_diffusion.d_mm");
    let clear = Medium { sigma_a_per_mm: 0.0, ..medium };
    assert_eq!(PhotonBeamDiffusion::new(clear).unwrap_err().at, "medium.albedo");
    assert!(ExponentialSum::new(vec![]).is_err());
    assert!(ExponentialSum::new(vec![ExponentialTerm { length_mm: 1.0, weight: -0.1 }]).is_err());
}

#[test]
fn files_are_checked_as_values_are() {
    let profile =
        RadialProfile::BetterDipole(BetterDipole::new(Medium::new(1.0, 0.1, 1.4).unwrap()).unwrap());
    let json = serde_json::to_string(&profile).unwrap();
    assert_eq!(serde_json::from_str::<RadialProfile>(&json).unwrap(), profile);
    let wrong = json.replace("\"sigma_s_prime_per_mm\":1.0", "\"sigma_s_prime_per_mm\":-1.0");
    assert!(serde_json::from_str::<RadialProfile>(&wrong).unwrap_err().to_string().contains("sigma_s_prime"));
}
