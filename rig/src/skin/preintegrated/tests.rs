//! The tables against independent integrals, a walk of photons and closed forms.

use super::*;
use crate::random::SplitMix64;
use crate::skin::diffusion::NormalizedDiffusion;

fn profiles() -> Vec<RadialProfile> {
    let mut all = Profile::deon_six().channels.to_vec();
    all.push(RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 0.6 }));
    all
}

/// Sphere or cylinder by sums over a fine grid of its surface, weighted by R times area: knows no closed form.
fn brute(profile: &RadialProfile, is_sphere: bool, cosine: f64, radius: f64) -> f64 {
    let start = cosine.acos();
    let (mut sum, mut weight) = (0.0, 0.0);
    // Polar coordinates around the point, in steps that grow: R may be infinite at 0.
    let n = 240;
    let reach = if is_sphere { PI * radius } else { 60.0 };
    for i in 0..n {
        let at = |i: usize| reach * (i as f64 / n as f64).powi(4);
        let (from, to) = (at(i), at(i + 1));
        let s = 0.5 * (from + to);
        for j in 0..96 {
            let phi = 2.0 * PI * (f64::from(j) + 0.5) / 96.0;
            let (light, chord, area) = if is_sphere {
                let a = s / radius;
                // The lamp is at `start` from the point, in the direction phi = 0.
                let cosine = start.cos() * a.cos() + start.sin() * a.sin() * phi.cos();
                (cosine, 2.0 * radius * (0.5 * a).sin(), radius * a.sin() * (to - from))
            } else {
                let (x, z) = (s * phi.cos(), s * phi.sin());
                if x.abs() > PI * radius {
                    continue;
                }
                let a = x / radius;
                ((start + a).cos(), (2.0 * radius * (0.5 * a).sin()).hypot(z), s * (to - from))
            };
            let w = profile.reflectance(chord) * area;
            sum += w * light.max(0.0);
            weight += w;
        }
    }
    sum / weight
}

#[test]
fn spheres_and_cylinders_agree_with_sums_over_their_surface() {
    for profile in profiles() {
        for (shape, radius) in
            [(Shape::Sphere, 3.0), (Shape::Sphere, 12.0), (Shape::Cylinder, 4.0), (Shape::Cylinder, 15.0)]
        {
            for cosine in [-0.7, -0.2, 0.0, 0.15, 0.6, 1.0] {
                let found = scattered_cosine(&profile, shape, cosine, radius).unwrap();
                let expected = brute(&profile, shape == Shape::Sphere, cosine, radius);
                assert!(
                    (found - expected).abs() < 1.5e-3,
                    "{shape:?} {radius} mm, {cosine}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn the_table_is_within_two_percent_of_a_walk_on_a_sphere() {
    let profile = Profile::deon_six();
    let table = DiffuseTable::new(&profile, 129, 64).unwrap();
    let mut random = SplitMix64(7);
    // Photons that leave here entered at a distance of the profile, in any direction.
    let n = 6000;
    let walk = profile.channels.each_ref().map(|channel| {
        // Even in distance and direction together, so that few tell as much as many.
        let mut photon = |i: usize| {
            let chord = channel.sample_radius((i as f64 + random.uniform()) / n as f64);
            (chord, 2.0 * PI * (i as f64 * 0.618_033_988_749_895).fract())
        };
        (0..n).map(&mut photon).collect::<Vec<_>>()
    });
    for radius in [5.0, 9.0, 30.0, 100.0] {
        for cosine in [-0.15f64, 0.0, 0.1, 0.5, 0.95] {
            let found = table.sample(cosine, 1.0 / radius);
            for (c, photons) in walk.iter().enumerate() {
                let mut sum = 0.0;
                for (chord, phi) in photons.iter().filter(|p| p.0 < 2.0 * radius) {
                    let angle = 2.0 * (0.5 * chord / radius).asin();
                    let sine = (1.0 - cosine * cosine).sqrt();
                    sum += (cosine * angle.cos() + sine * angle.sin() * phi.cos()).max(0.0);
                }
                let expected = sum / n as f64;
                // 2 % of the light, and the noise of the walk where there is little.
                let bound = 0.02 * expected + 1e-3;
                assert!(
                    (found[c] - expected).abs() < bound,
                    "{radius} mm, {cosine}, channel {c}: {} {expected}",
                    found[c]
                );
            }
        }
    }
}

#[test]
fn a_sphere_keeps_its_light_and_weakens_its_bands() {
    for profile in profiles() {
        for radius in [0.5, 2.0, 10.0, 200.0] {
            let light = circles(&profile, radius);
            let d = |cosine| scattered(&light, cosine);
            // The mean of Lambert's law over a sphere is a quarter, wherever light goes.
            let n = 2000;
            let mean: f64 = (0..n).map(|i| d((f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0)).sum::<f64>();
            assert!((mean / f64::from(n) - 0.25).abs() < 1e-5, "{radius}: {mean}");
            // max(c, 0) - max(-c, 0) = c is of band 1 alone.
            let [_, first, second] = band_shares(&profile, radius);
            for cosine in [0.1, 0.4, 0.9] {
                assert!((d(cosine) - d(-cosine) - first * cosine).abs() < 1e-9);
            }
            assert!(second <= first && (0.0..=1.0).contains(&first), "{radius}: {first} {second}");
        }
    }
}

#[test]
fn planes_and_narrow_profiles_give_lambert() {
    let narrow = RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 1e-7 });
    let profile = Profile { name: "narrow".into(), channels: std::array::from_fn(|_| narrow.clone()) };
    let table = DiffuseTable::new(&Profile::deon_six(), 129, 16).unwrap();
    for i in 0..=40 {
        let cosine = f64::from(i) / 20.0 - 1.0;
        for shape in [Shape::Sphere, Shape::Cylinder] {
            let found = scattered_cosine(&narrow, shape, cosine, 10.0).unwrap();
            assert!((found - cosine.max(0.0)).abs() < 1e-6, "{shape:?} {cosine}: {found}");
        }
        for value in table.sample(cosine, 0.0) {
            assert!((value - cosine.max(0.0)).abs() < 1e-12, "{cosine}: {value}");
        }
    }
    let shadow = ShadowTable::new(&profile, [33, 8], 10.0, 10.0).unwrap();
    assert!(shadow.reach_mm[1] < 1e-5);
    let through = shadow.sample([0.3, 0.3], 2.0);
    assert!(through.iter().all(|v| (v - 0.3).abs() < 2e-3), "{through:?}");
}

#[test]
fn the_ring_of_the_paper_is_too_sharp_and_needs_a_finite_profile() {
    let red = &Profile::deon_six().channels[0];
    let [sphere, cylinder, ring] = [Shape::Sphere, Shape::Cylinder, Shape::Ring]
        .map(|shape| scattered_cosine(red, shape, 0.0, 10.0).unwrap());
    assert!((cylinder / sphere - 1.0).abs() < 0.1, "{cylinder} {sphere}");
    assert!(ring < 0.6 * sphere, "{ring} {sphere}");
    // One Gaussian is as wide along a line as its line spread is: ring and cylinder are the same.
    let one = crate::skin::gaussians::GaussianSum::new(vec![crate::skin::gaussians::GaussianTerm {
        variance_mm2: 1.0,
        weight: 1.0,
    }]);
    let one = RadialProfile::Gaussians(one.unwrap());
    for cosine in [-0.3, 0.0, 0.7] {
        let [a, b] = [Shape::Cylinder, Shape::Ring].map(|s| scattered_cosine(&one, s, cosine, 8.0).unwrap());
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
    let infinite = RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 1.0 });
    let error = scattered_cosine(&infinite, Shape::Ring, 0.2, 10.0).unwrap_err();
    assert!(error.to_string().contains("sphere or a cylinder"), "{error}");
}

#[test]
fn curvature_of_a_terminator_is_that_across_it() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    near(curvature_towards([0.1, 0.1], 0.4, 0.7), 0.1);
    near(curvature_towards([0.1, 0.0], 0.0, 0.0), 0.1);
    near(curvature_towards([0.1, 0.0], 0.0, FRAC_PI_2), 0.0);
    near(curvature_towards([0.1, -0.1], 1.0, 0.3), 0.1);
    near(curvedness([0.0, 0.2]), 0.2 / 2f64.sqrt());
}

#[test]
fn the_edge_of_a_disk_is_its_area_and_its_inverse_returns() {
    let mut random = SplitMix64(3);
    for x in [-1.0, -0.8, -0.1, 0.0, 0.35, 0.99, 1.0] {
        let n = 40_000;
        let inside = (0..n).filter(|_| {
            let (r, a) = (random.uniform().sqrt(), 2.0 * PI * random.uniform());
            r * a.cos() < x
        });
        let share = inside.count() as f64 / f64::from(n);
        assert!((disk_edge(x) - share).abs() < 0.01, "{x}");
        assert!((inverse_disk_edge(disk_edge(x)) - x).abs() < 1e-6, "{x}");
    }
}

#[test]
fn shadows_are_the_penumbra_blurred_by_the_line_spread() {
    let profile = Profile::deon_six();
    let table = ShadowTable::new(&profile, [129, 32], 12.0, 12.0).unwrap();
    for penumbra in [0.0, 0.5, 2.0, 7.0] {
        // As both parts take it.
        let sharp = f64::max(penumbra, LEAST_PENUMBRA * table.reach_mm[0]);
        let mut sums = [0.0; 3];
        let mut before = [0.0; 3];
        let steps = 160;
        let end = penumbra + table.reach_mm[1];
        for i in 0..=steps {
            let x = end * (2.0 * i as f64 / steps as f64 - 1.0);
            let shares = [0, 1].map(|part| disk_edge(x / (penumbra + table.reach_mm[part])));
            let found = table.sample(shares, penumbra);
            for (c, channel) in profile.channels.iter().enumerate() {
                // Light at x: penumbra times line spread, as a sum over the penumbra's own slope.
                let n = 400;
                let expected: f64 = (0..n)
                    .map(|j| {
                        let at = |j: f64| 2.0 * j / f64::from(n) - 1.0;
                        let slope = disk_edge(at(f64::from(j) + 1.0)) - disk_edge(at(f64::from(j)));
                        let y = x - sharp * at(f64::from(j) + 0.5);
                        slope * (0.5 + 0.5 * y.signum() * channel.line_cdf(y.abs()))
                    })
                    .sum();
                assert!((found[c] - expected).abs() < 0.012, "{penumbra} mm, {x}: {} {expected}", found[c]);
                assert!(found[c] >= before[c] - 1e-9, "{penumbra} mm, {x}: it falls");
                sums[c] += found[c];
                before[c] = found[c];
            }
            // The unscattered penumbra, for highlights.
            assert!((found[3] - disk_edge(x / sharp)).abs() < 0.02, "{penumbra} {x}: {}", found[3]);
        }
        // Energy: light that goes into the shadow is missing beside it.
        for sum in sums {
            assert!((sum / f64::from(steps + 1) - 0.5).abs() < 1e-3, "{sums:?}");
        }
        assert!(table.sample([0.0, 0.0], penumbra).iter().all(|v| v.abs() < 1e-6));
        assert!(table.sample([1.0, 1.0], penumbra).iter().all(|v| (v - 1.0).abs() < 1e-6));
    }
}

#[test]
fn waves_are_weakened_by_their_length() {
    let profile = Profile::deon_six();
    for wavelength in [0.3, 2.0, 20.0] {
        let found = wave_shares(&profile, wavelength);
        let q = 2.0 * PI / wavelength;
        for (c, channel) in profile.channels.iter().enumerate() {
            let RadialProfile::Gaussians(sum) = channel else { panic!("a sum of Gaussians") };
            let exact: f64 =
                sum.terms().iter().map(|t| t.weight * (-0.5 * q * q * t.variance_mm2).exp()).sum();
            assert!((found[c] - exact / sum.total()).abs() < 1e-4, "{wavelength}: {} {exact}", found[c]);
        }
    }
}

#[test]
fn hostile_input_is_refused_or_finite() {
    let wide = RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 300.0 });
    let profile = Profile { name: "wide".into(), channels: std::array::from_fn(|_| wide.clone()) };
    let table = DiffuseTable::new(&profile, 33, 16).unwrap();
    assert!(table.values.iter().flatten().all(|v| v.is_finite() && (0.0..=1.0).contains(v)));
    let shadow = ShadowTable::new(&profile, [17, 8], 12.0, 10.0).unwrap();
    assert!(
        shadow.values.iter().flatten().flatten().all(|v| v.is_finite() && (-1e-9..=1.0 + 1e-9).contains(v))
    );
    let bands = HarmonicTable::new(&profile, 16).unwrap();
    assert!(bands.bands.iter().flatten().flatten().all(|v| v.is_finite() && v.abs() <= 1.0));
    assert!(DiffuseTable::new(&profile, 32, 16).unwrap_err().to_string().contains("odd"));
    assert!(ShadowTable::new(&profile, [17, 8], f64::NAN, 1.0).is_err());
    assert!(scattered_cosine(&wide, Shape::Sphere, 0.5, 0.0).is_err());
    assert!(scattered_cosine(&wide, Shape::Sphere, 1.5, 2.0).is_err());
    assert_eq!(table.sample(0.5, f64::INFINITY).map(f64::is_finite), [true; 3]);
}
