use super::*;
use crate::skin::diffusion::BetterDipole;
use crate::skin::gaussians::{GaussianSum, GaussianTerm};
use crate::skin::medium::{SKIN1, rgb_media};

const METHODS: [KernelMethod; 4] =
    [KernelMethod::Edges, KernelMethod::LineSpread, KernelMethod::LeastSquares, KernelMethod::SingularValue];

fn better_dipole() -> Profile {
    let channel = |m| RadialProfile::BetterDipole(BetterDipole::new(m).unwrap());
    Profile { name: "better".into(), channels: rgb_media(&SKIN1, 1.4).unwrap().map(channel) }
}

fn assert_sound(kernel: &SeparableKernel, samples: usize) {
    assert_eq!((kernel.offsets_mm.len(), kernel.weights.len()), (samples, samples));
    assert_eq!(kernel.offsets_mm[samples / 2], 0.0);
    for c in 0..3 {
        let sum: f64 = kernel.weights.iter().map(|w| w[c]).sum();
        assert!((sum - 1.0).abs() < 1e-14);
    }
    for i in 0..samples {
        assert_eq!(kernel.weights[i], kernel.weights[samples - 1 - i]);
        assert_eq!(kernel.offsets_mm[i], -kernel.offsets_mm[samples - 1 - i]);
        assert!(kernel.weights[i].iter().all(|w| (0.0..=1.0).contains(w)));
    }
    let steps: Vec<f64> = kernel.offsets_mm[samples / 2..].windows(2).map(|w| w[1] - w[0]).collect();
    assert!(steps.windows(2).all(|s| s[1] > s[0]));
}

#[test]
fn kernels_sum_to_one_mirror_and_are_denser_near_the_centre() {
    for samples in SAMPLES.step_by(2) {
        assert_sound(&SeparableKernel::of(&Profile::deon_six(), samples).unwrap(), samples);
        assert_sound(&SeparableKernel::artist(&ArtistKernel::thesis(3.0), samples).unwrap(), samples);
    }
    for samples in [5, 17, 33] {
        for method in METHODS {
            for profile in [Profile::deon_six(), better_dipole()] {
                assert_sound(&kernel_report(&profile, method, samples).unwrap().kernel, samples);
            }
        }
    }
}

#[test]
fn a_single_gaussian_separates_exactly() {
    let gaussian = GaussianSum::new(vec![GaussianTerm { variance_mm2: 0.5, weight: 0.7 }]).unwrap();
    let channel = RadialProfile::Gaussians(gaussian);
    let profile = Profile { name: "one".into(), channels: [channel.clone(), channel.clone(), channel] };
    for method in [KernelMethod::LineSpread, KernelMethod::SingularValue] {
        let report = kernel_report(&profile, method, 33).unwrap();
        assert!(report.separability[0] > 1.0 - 1e-6, "{}", report.separability[0]);
        // Only the light outside of the grid is missing from the exact kernel.
        assert!(report.errors[0].root_mean_square < 0.015, "{:?}", report.errors[0]);
        let variance: f64 =
            report.kernel.offsets_mm.iter().zip(&report.kernel.weights).map(|(x, w)| x * x * w[0]).sum();
        // A Gaussian that ends where 99 % of its light is has 0.925 of the variance.
        assert!((0.92..1.0).contains(&(variance / 0.5)), "{variance}");
    }
}

#[test]
fn singular_value_has_a_smaller_squared_error_than_the_line_spread() {
    for profile in [Profile::deon_six(), better_dipole()] {
        let [_, line, _, singular] = METHODS.map(|m| kernel_report(&profile, m, 17).unwrap());
        for c in 0..3 {
            let error = |r: &KernelReport| r.errors[c].root_mean_square;
            assert!(error(&singular) < error(&line), "{c}: {} {}", error(&singular), error(&line));
        }
        assert!(singular.separability.iter().all(|s| (0.5..1.0).contains(s)), "{:?}", singular.separability);
    }
}

#[test]
fn fitted_parameters_make_the_fitted_kernel() {
    let report = kernel_report(&Profile::deon_six(), KernelMethod::LeastSquares, 17).unwrap();
    let artist = report.artist.unwrap();
    assert_eq!(SeparableKernel::artist(&artist, 17).unwrap(), report.kernel);
}

#[test]
fn fit_to_skin_is_at_least_as_close_as_table_6_1() {
    // The table's width, 0.014, is in units of the author's scene, so the table is given its best width here.
    let profile = Profile::deon_six();
    let grid = Grid::new(17, half_width_mm(&profile).unwrap());
    let exact = profile.channels.each_ref().map(|channel| grid.quadrant(channel));
    let squares = |artist: &ArtistKernel| -> f64 {
        let kernel = artist.kernel(&grid);
        (0..3).map(|c| (&exact[c] - grid.separable_quadrant(&kernel.half(c))).norm_squared()).sum()
    };
    let table = (1..60).map(|i| squares(&ArtistKernel::thesis(0.5 * i as f64))).fold(f64::INFINITY, f64::min);
    let fitted = fit_artist(&grid, &exact);
    assert!(squares(&fitted) < table, "{} {table}", squares(&fitted));
    // No other falloff and strength of the family is closer.
    for (c, exact) in exact.iter().enumerate() {
        let own = |artist: &ArtistKernel| {
            let half = artist.kernel(&grid).half(c);
            (exact - grid.separable_quadrant(&half)).norm_squared()
        };
        let best = own(&fitted);
        for i in 0..400 {
            let (falloff, strength) = (0.002 * 1.4f64.powi(i / 20), 0.05 * (1 + i % 20) as f64);
            let other = ArtistKernel { falloff: [falloff; 3], strength: [strength; 3], ..fitted };
            assert!(best <= own(&other) + 1e-12, "{c}: {best}, {falloff} {strength} {}", own(&other));
        }
    }
    // The table says: red reaches farthest, blue least, and most of the light of every channel scatters.
    assert!(fitted.falloff[0] > fitted.falloff[1] && fitted.falloff[1] > fitted.falloff[2], "{fitted:?}");
    assert!(fitted.strength.iter().all(|s| (0.7..=1.0).contains(s)), "{fitted:?}");
}

#[test]
fn strength_zero_is_no_blur() {
    let none = ArtistKernel { strength: [0.0; 3], ..ArtistKernel::thesis(3.0) };
    let kernel = SeparableKernel::artist(&none, 17).unwrap();
    for (i, w) in kernel.weights.iter().enumerate() {
        assert_eq!(*w, if i == 8 { [1.0; 3] } else { [0.0; 3] });
    }
}

#[test]
fn wrong_parameters_are_errors() {
    for samples in [0, 1, 3, 16, 66, 67] {
        let error = SeparableKernel::of(&Profile::deon_six(), samples).unwrap_err();
        assert_eq!(error.at, "kernel.samples");
        assert!(kernel_report(&Profile::deon_six(), KernelMethod::SingularValue, samples).is_err());
        assert!(SeparableKernel::artist(&ArtistKernel::thesis(3.0), samples).is_err());
    }
    let good = ArtistKernel::thesis(3.0);
    let at = |a: ArtistKernel| SeparableKernel::artist(&a, 17).unwrap_err().at;
    for width_mm in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(at(ArtistKernel { width_mm, ..good }), "kernel.width_mm");
    }
    for strength in [-0.1, 1.1, f64::NAN] {
        assert_eq!(at(ArtistKernel { strength: [0.5, strength, 0.5], ..good }), "kernel.strength[1]");
    }
    assert_eq!(at(ArtistKernel { falloff: [0.5, 0.5, -0.1], ..good }), "kernel.falloff[2]");
}

/// Root mean square error across straight edges of a direction, over the half width: the integrals of kernel and profile
/// up to a line.
fn edge_error(profile: &Profile, kernel: &SeparableKernel, angle: f64) -> f64 {
    let (sine, cosine) = angle.sin_cos();
    let width = kernel.half_width_mm();
    let (mut sum, n) = (0.0, 400);
    for i in 0..n {
        let x = width * ((i as f64 + 0.5) / n as f64 * 2.0 - 1.0);
        let truth = 0.5 + 0.5 * x.signum() * profile.channels[0].line_cdf(x.abs());
        let mut found = 0.0;
        for (a, u) in kernel.weights.iter().zip(&kernel.offsets_mm) {
            for (b, v) in kernel.weights.iter().zip(&kernel.offsets_mm) {
                // A tap between two texels weighs both, so an edge is as soft as a pixel of a 30th of the width.
                let side = (x - (cosine * u + sine * v)) / (width / 30.0) + 0.5;
                found += a[0] * b[0] * side.clamp(0.0, 1.0);
            }
        }
        sum += (found - truth).powi(2);
    }
    (sum / n as f64).sqrt()
}

#[test]
fn edges_of_all_directions_blur_best_and_better_with_more_taps() {
    let profile = Profile::deon_six();
    let mean = |kernel: &SeparableKernel| {
        let angles = (0..7).map(|i| std::f64::consts::FRAC_PI_4 * f64::from(i) / 6.0);
        (angles.map(|a| edge_error(&profile, kernel, a).powi(2)).sum::<f64>() / 7.0).sqrt()
    };
    let of = |method, samples| kernel_report(&profile, method, samples).unwrap().kernel;
    let errors = [9, 17, 33].map(|n| mean(&of(KernelMethod::Edges, n)));
    assert!(errors[1] < errors[0] && errors[2] < 1.02 * errors[1], "{errors:?}");
    for (samples, error) in [(17, errors[1]), (33, errors[2])] {
        let line = mean(&of(KernelMethod::LineSpread, samples));
        assert!(error < 0.75 * line, "{samples}: {error} {line}");
    }
    // The reason: across a diagonal edge the product of line spreads is at its worst, and more taps do not help.
    let line = of(KernelMethod::LineSpread, 33);
    let diagonal = edge_error(&profile, &line, std::f64::consts::FRAC_PI_4);
    assert!(diagonal > 3.0 * edge_error(&profile, &line, 0.0), "{diagonal}");
}
