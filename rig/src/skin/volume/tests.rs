use glam::{Quat, Vec3};

use super::picture::HalfSpace;
use super::walk::Walker;
use super::*;
use crate::evaluate::{CameraState, LightState};
use crate::face_state::FaceState;
use crate::head::{Head, Material, Mesh, Part, Vertex};
use crate::random::SplitMix64;
use crate::skin::medium::{SKIN1, rgb_media};
use crate::skin::monte_carlo::PhotonWalk;
use crate::timeline::LightKind;

fn flesh(media: [[f64; 2]; 3], alpha: f64) -> Flesh {
    let media = media.map(|[s, a]| Medium { sigma_s_prime_per_mm: s, sigma_a_per_mm: a, eta: 1.4 });
    Flesh::new(&media, alpha, Masking::Separable).unwrap()
}

fn skin1(alpha: f64) -> Flesh {
    Flesh::new(&rgb_media(&SKIN1, 1.4).unwrap(), alpha, Masking::Separable).unwrap()
}

/// A ball about the origin, radius in metres; `open` leaves out the triangles below a height.
fn ball(radius: f32, rows: u32, open: Option<f32>) -> Head {
    let mut points = vec![Vec3::Y * radius];
    for i in 1..rows {
        let (sin, cos) = (std::f32::consts::PI * i as f32 / rows as f32).sin_cos();
        for j in 0..2 * rows {
            let (s, c) = (std::f32::consts::PI * j as f32 / rows as f32).sin_cos();
            points.push(radius * Vec3::new(sin * s, cos, sin * c));
        }
    }
    points.push(-Vec3::Y * radius);
    let at = |i: u32, j: u32| 1 + (i - 1) * 2 * rows + j % (2 * rows);
    let last = points.len() as u32 - 1;
    let mut triangles = Vec::new();
    for j in 0..2 * rows {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        for i in 1..rows - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        triangles.push([at(rows - 1, j), last, at(rows - 1, j + 1)]);
    }
    if let Some(height) = open {
        triangles.retain(|t| t.iter().all(|p| points[*p as usize].y > height));
    }
    let vertices = (0..points.len() as u32).map(|point| Vertex { point, uv: glam::Vec2::ZERO }).collect();
    let parts =
        vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..triangles.len() as u32 }];
    Head { mesh: Mesh { points, vertices, triangles, parts, ..Mesh::default() }, ..Head::default() }
}

fn body(head: &Head, normals: Normals) -> Body {
    Body::new(head, &FaceState::neutral(head), normals).unwrap()
}

fn camera(z: f32, degrees: f32) -> CameraState {
    CameraState {
        position: Vec3::Z * z,
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_y: degrees.to_radians(),
        lens: Default::default(),
    }
}

fn sun(direction: Vec3) -> LightState {
    LightState {
        name: String::new(),
        kind: LightKind::Directional,
        power_linear: Vec3::ONE,
        position: Vec3::ZERO,
        direction: direction.normalize(),
        cone_half_angles: [0.0; 2],
        radius: 0.05,
        shadow: true,
    }
}

fn options(paths: u32, seed: u64) -> Options {
    Options { paths, seed, filter: Filter::Middle }
}

/// Mean of all pixels and channels and its standard error, as pixels are independent.
fn mean(light: &[[f32; 3]], error: &[[f32; 3]], c: usize) -> [f64; 2] {
    let n = light.len() as f64;
    let sum: f64 = light.iter().map(|p| f64::from(p[c])).sum();
    let variance: f64 = error.iter().map(|p| f64::from(p[c]).powi(2)).sum();
    [sum / n, variance.sqrt() / n]
}

#[test]
fn a_smooth_flat_half_space_returns_what_a_photon_walk_says() {
    let flesh = skin1(0.002);
    let [found, error] = flat_reflectance(&flesh, 1.0, 150_000, 1);
    for (c, medium) in rgb_media(&SKIN1, 1.4).unwrap().iter().enumerate() {
        let walk = PhotonWalk::isotropic(1.4, vec![medium.albedo()], 150_000, 2).run().unwrap();
        let entering = 1.0 - (0.4f64 / 2.4).powi(2);
        let (expected, spread) = (entering * walk.total[0], walk.total_error[0].hypot(error[c]));
        assert!((found[c] - expected).abs() < 4.0 * spread, "{}: {found:?} {expected} +- {spread}", c);
        assert!(error[c] < 0.01 * found[c]);
    }
}

#[test]
fn a_smooth_flat_half_space_matches_giovanelli() {
    // Giovanelli 1955: index 1.5, sigma_a 10 and sigma_s 90 per cm, isotropic: 0.2600 with the 4 % that the surface reflects.
    let medium = Medium::new(9.0, 1.0, 1.5).unwrap();
    let flesh = Flesh::new(&[medium; 3], 0.002, Masking::Separable).unwrap();
    let [found, error] = flat_reflectance(&flesh, 1.0, 200_000, 3);
    assert!((0.04 + found[0] - 0.2600).abs() < 4.0 * error[0] + 5e-4, "{found:?} {error:?}");
}

#[test]
fn channels_do_not_disturb_each_other() {
    // The same medium with other neighbours: the balance heuristic changes noise, not light.
    let [alone, noise] = flat_reflectance(&flesh([[1.0, 0.1]; 3], 0.3), 0.7, 100_000, 4);
    let [joined, joined_noise] =
        flat_reflectance(&flesh([[1.0, 0.1], [4.0, 0.02], [0.3, 0.5]], 0.3), 0.7, 100_000, 5);
    let spread = noise[0].hypot(joined_noise[0]);
    assert!((alone[0] - joined[0]).abs() < 4.0 * spread, "{alone:?} {joined:?} +- {spread}");
}

/// Mean light of a ball under a sky of 1.
fn furnace(body: &Body, flesh: &Flesh, paths: u32) -> ([f64; 2], f64) {
    let walker = Walker { flesh, around: body, lamps: &[], sky: 1.0 };
    let mut random = SplitMix64(9);
    let (mut sum, mut squares, mut lost) = (0.0, 0.0, 0);
    for _ in 0..paths {
        let x = 0.9 * (2.0 * random.uniform() as f32 - 1.0);
        let seen = body.meet(Vec3::new(x, 0.3, 100.0), Vec3::NEG_Z, f32::INFINITY, None).unwrap();
        let brought = walker.path(&seen, Vec3::Z, &mut random);
        let light = f64::from((brought.refracted + brought.reflected).x);
        sum += light;
        squares += light * light;
        lost += brought.lost;
    }
    let n = f64::from(paths);
    let mean = sum / n;
    ([mean, ((squares / n - mean * mean) / n).sqrt()], f64::from(lost) / n)
}

#[test]
fn a_ball_that_absorbs_nothing_shows_an_even_sky_less_what_it_reflects() {
    // All that is refracted comes out again: the light is 1 - the share reflected, whatever path it took. The camera sees
    // heights of 0.3 and places from -0.9 to 0.9 of a ball of radius 2, mm.
    let head = ball(0.002, 40, None);
    let body = body(&head, Normals::Facets);
    let ([found, error], lost) = furnace(&body, &flesh([[2.0, 0.0]; 3], 0.002), 6_000);
    let reflected = |x: f64| {
        let mu = (1.0 - (x * x + 0.09) / 4.0).sqrt();
        crate::skin::medium::fresnel_from_inside(mu, 1.0 / 1.4)
    };
    let n = 200;
    let lost_by_surface: f64 =
        (0..n).map(|i| reflected(0.9 * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0))).sum::<f64>()
            / f64::from(n);
    // A few rays pass through such a small ball unscattered; their light does not count.
    let through = 0.02;
    let expected = 1.0 - lost_by_surface;
    assert!(
        found < expected + 4.0 * error && found > expected - through - 4.0 * error,
        "{found} {expected} {error}"
    );
    assert!(lost < 1e-4, "{lost}");
    // Light that meets a second microfacet is lost, more of it where the boundary is rougher.
    let of = |alpha| furnace(&body, &flesh([[2.0, 0.0]; 3], alpha), 6_000).0;
    let ([fine, fine_error], [rough, rough_error]) = (of(0.1), of(0.3));
    assert!(fine < expected + 4.0 * fine_error && fine > 0.9 * expected, "{fine} {expected}");
    assert!(rough < fine - 4.0 * rough_error && rough > 0.65 * expected, "{rough} {fine}");
}

#[test]
fn lamps_from_all_sides_are_a_sky() {
    // Next-event estimation against paths that find the sky: a flat disk seen from above, far from its rim, under 256 suns.
    let head = ball(0.02, 24, None);
    let body = body(&head, Normals::Facets);
    let flesh = flesh([[3.0, 0.6], [3.0, 0.6], [2.0, 1.0]], 0.3);
    let view = View::new(&camera(0.5, 0.2), [6, 6]);
    // Cosine-weighted directions to suns, each with its share of the irradiance pi of a sky of 1.
    let suns = 64;
    let mut total = [[0.0; 2]; 3];
    for i in 0..suns {
        let u = (i as f32 + 0.5) / suns as f32;
        let phi = 2.399_963 * i as f32;
        let (r, z) = (u.sqrt(), (1.0 - u).sqrt());
        let lamp = Lamp::new(&sun(-Vec3::new(r * phi.cos(), r * phi.sin(), z)), 0.0, 0.0);
        let picture = picture(&flesh, &body, &[lamp], &view, &options(150, i));
        let irradiance = std::f32::consts::PI / suns as f32 / z;
        for (c, t) in total.iter_mut().enumerate() {
            let [m, e] = mean(&picture.diffuse, &picture.diffuse_error, c);
            t[0] += m * f64::from(irradiance);
            t[1] += (e * f64::from(irradiance)).powi(2);
        }
    }
    let [flat, noise] = flat_reflectance(&flesh, 1.0, 200_000, 8);
    for c in 0..3 {
        let spread = total[c][1].sqrt().hypot(noise[c]);
        // 64 suns in place of a sky, and a ball of 60 mean free paths in place of a plane, are worth 1.5 %.
        let difference = (total[c][0] - flat[c]).abs();
        assert!(difference < 4.0 * spread + 0.015 * flat[c], "{c}: {total:?} {flat:?} {spread}");
    }
}

#[test]
fn both_ways_of_finding_a_lamp_agree() {
    // A narrow lobe makes the free way noisy and leaves the guided one alone; without guides only the free way is left.
    let head = ball(0.01, 24, None);
    let smooth = body(&head, Normals::Smooth);
    let lamp = Lamp::new(&sun(Vec3::new(-0.5, -0.3, -1.0)), 0.0, 0.05);
    let view = View::new(&camera(0.5, 1.5), [8, 8]);
    struct Unguided<'a>(&'a Body);
    impl Surroundings for Unguided<'_> {
        fn meet(&self, o: Vec3, d: Vec3, far: f32, on: Option<u32>) -> Option<Meet> {
            self.0.meet(o, d, far, on)
        }
        fn is_blocked(&self, o: Vec3, d: Vec3, far: f32) -> bool {
            self.0.is_blocked(o, d, far)
        }
        fn bounds(&self) -> (Vec3, Vec3) {
            self.0.bounds()
        }
        fn is_guiding(&self) -> bool {
            false
        }
    }
    let flesh = skin1(0.4);
    let guided = picture(&flesh, &smooth, &[lamp], &view, &options(400, 1));
    let free = picture(&flesh, &Unguided(&smooth), &[lamp], &view, &options(4000, 2));
    for c in 0..3 {
        let [a, a_error] = mean(&guided.diffuse, &guided.diffuse_error, c);
        let [b, b_error] = mean(&free.diffuse, &free.diffuse_error, c);
        assert!((a - b).abs() < 4.0 * a_error.hypot(b_error), "{c}: {a} +- {a_error}, {b} +- {b_error}");
        assert!(a_error < 0.02 * a && b_error < 0.02 * b);
        // Ten times the paths do not make up for the missing guide.
        assert!(a_error < 1.2 * b_error, "{a_error} {b_error}");
    }
}

#[test]
fn a_wide_ball_is_lit_as_a_plane_is() {
    let head = ball(0.04, 80, None);
    let body = body(&head, Normals::Smooth);
    let flesh = skin1(0.3);
    let view = View::new(&camera(1.0, 0.3), [6, 6]);
    let lamp = Lamp::new(&sun(Vec3::new(-0.6, 0.0, -0.8)), 0.0, 0.0);
    let drawn = picture(&flesh, &body, &[lamp], &view, &options(1500, 3));
    let walker = Walker { flesh: &flesh, around: &HalfSpace, lamps: &[lamp], sky: 0.0 };
    let (mut random, n) = (SplitMix64(4), 40_000);
    let seen = HalfSpace::at(Vec3::ZERO, 1.0);
    let flat: Vec<[f32; 3]> =
        (0..n).map(|_| walker.path(&seen, Vec3::Z, &mut random).refracted.to_array()).collect();
    for c in 0..3 {
        let [light, error] = mean(&drawn.diffuse, &drawn.diffuse_error, c);
        let expected = flat.iter().map(|p| f64::from(p[c])).sum::<f64>() / f64::from(n);
        let variance = flat.iter().map(|p| (f64::from(p[c]) - expected).powi(2)).sum::<f64>() / f64::from(n);
        let spread = error.hypot((variance / f64::from(n)).sqrt());
        // A radius of 30 mean free paths is worth less than one part in a hundred.
        assert!(
            (light - expected).abs() < 4.0 * spread + 0.01 * expected,
            "{c}: {light} {expected} +- {spread}"
        );
        assert!(spread < 0.02 * expected);
    }
    assert!(drawn.lost < 1e-4, "{}", drawn.lost);
}

#[test]
fn mirrored_light_gives_the_mirrored_picture() {
    let head = ball(0.006, 24, None);
    let body = body(&head, Normals::Smooth);
    let flesh = skin1(0.3);
    let view = View::new(&camera(0.5, 1.6), [12, 12]);
    let drawn = |x: f32, seed| {
        let lamp = Lamp::new(&sun(Vec3::new(x, 0.0, -0.2)), 0.0, 0.05);
        picture(&flesh, &body, &[lamp], &view, &options(300, seed))
    };
    let (one, other) = (drawn(1.0, 1), drawn(-1.0, 2));
    let (mut chi, mut n) = (0.0, 0.0);
    for y in 0..12 {
        for x in 0..12 {
            let (i, j) = (12 * y + x, 12 * y + 11 - x);
            for c in 0..3 {
                let variance = one.diffuse_error[i][c].powi(2) + other.diffuse_error[j][c].powi(2);
                if variance > 0.0 {
                    chi += f64::from((one.diffuse[i][c] - other.diffuse[j][c]).powi(2) / variance);
                    n += 1.0;
                }
            }
        }
    }
    // Channels of a pixel share paths, so the spread of the mean is that of a third as many numbers.
    assert!((chi / n - 1.0).abs() < 4.0 * (6.0f64 / n).sqrt() + 0.1, "{} over {n}", chi / n);
}

#[test]
fn noise_falls_as_the_root_of_paths_and_is_what_errors_say() {
    let head = ball(0.01, 16, None);
    let body = body(&head, Normals::Smooth);
    let flesh = skin1(0.3);
    let view = View::new(&camera(0.5, 0.6), [8, 8]);
    let lamp = Lamp::new(&sun(Vec3::new(-0.5, 0.0, -1.0)), 0.0, 0.0);
    let drawn = |paths, seed| picture(&flesh, &body, &[lamp], &view, &options(paths, seed));
    let rms = |p: &[[f32; 3]]| {
        (p.iter().flatten().map(|v| f64::from(*v).powi(2)).sum::<f64>() / (3 * p.len()) as f64).sqrt()
    };
    let (few, many) = (drawn(50, 1), drawn(800, 2));
    let ratio = rms(&few.diffuse_error) / rms(&many.diffuse_error);
    assert!((3.2..4.8).contains(&ratio), "{ratio}");
    let difference: Vec<[f32; 3]> =
        few.diffuse.iter().zip(&many.diffuse).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    let expected = rms(&few.diffuse_error).hypot(rms(&many.diffuse_error));
    assert!((0.75..1.3).contains(&(rms(&difference) / expected)), "{} {expected}", rms(&difference));
}

#[test]
fn same_seed_same_light_on_any_number_of_threads() {
    let head = ball(0.01, 12, None);
    let body = body(&head, Normals::Smooth);
    let (flesh, view) = (skin1(0.3), View::new(&camera(0.5, 4.0), [9, 7]));
    let lamp = Lamp::new(&sun(Vec3::new(-0.5, 0.0, -1.0)), 0.0, 0.05);
    let drawn = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| picture(&flesh, &body, &[lamp], &view, &options(20, 7)))
    };
    let one = drawn(1);
    assert_eq!(one, drawn(3));
    assert!(one.diffuse.iter().flatten().any(|v| *v > 0.0));
    assert!(one.diffuse[0] == [0.0; 3], "the corner shows no skin");
    let flat = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| flat_reflectance(&flesh, 1.0, 1000, 3))
    };
    assert_eq!(flat(1), flat(3));
}

#[test]
fn open_rims_are_closed_and_parts_that_share_them_need_no_cap() {
    let whole = ball(0.01, 20, None);
    let closed = body(&whole, Normals::Smooth);
    assert_eq!(closed.holes(), 0);
    let sphere = 4.0 / 3.0 * std::f64::consts::PI * 1e3;
    assert!((closed.volume_mm3() / sphere - 1.0).abs() < 0.02, "{}", closed.volume_mm3());
    let open = ball(0.01, 20, Some(-0.006));
    let capped = body(&open, Normals::Smooth);
    assert_eq!(capped.holes(), 1);
    assert!(capped.volume_mm3() > 0.0 && capped.volume_mm3() < closed.volume_mm3());
    let mut count = std::collections::HashMap::new();
    for [a, b, c] in capped.surface() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *count.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
        }
    }
    assert!(count.values().all(|n| *n == 0), "every edge has both sides");
    // A pose moves it; a turn keeps its volume.
    let state = FaceState {
        head_rotation: Quat::from_rotation_y(0.7),
        head_translation: Vec3::X,
        ..FaceState::neutral(&open)
    };
    let turned = Body::new(&open, &state, Normals::Smooth).unwrap();
    assert!((turned.volume_mm3() / capped.volume_mm3() - 1.0).abs() < 1e-2);
}

#[test]
fn surfaces_without_an_inside_are_errors() {
    let mut head = ball(0.01, 8, None);
    let double = head.mesh.triangles[5];
    head.mesh.triangles.push(double);
    head.mesh.parts[0].triangles.end += 1;
    let error = Body::new(&head, &FaceState::neutral(&head), Normals::Smooth).err().unwrap();
    assert!(error.to_string().contains("3 edges"), "{error}");
}

#[test]
fn patches_follow_lamps_and_thickness() {
    let head = ball(0.003, 24, None);
    let (thin, view) = (body(&head, Normals::Smooth), View::new(&camera(0.5, 0.9), [21, 21]));
    let of = |body: &Body, direction: Vec3, x: usize| {
        patches(body, &[Lamp::new(&sun(direction), 0.0, 0.0)], &view)[21 * 10 + x]
    };
    assert_eq!(of(&thin, Vec3::NEG_Z, 10), Some(Patch::Lit));
    assert_eq!(of(&thin, Vec3::X, 10), Some(Patch::Terminator));
    assert_eq!(of(&thin, Vec3::X, 17), Some(Patch::Thin));
    assert_eq!(of(&thin, Vec3::NEG_Z, 0), None);
    let thick = body(&ball(0.03, 24, None), Normals::Smooth);
    assert_eq!(of(&thick, Vec3::Z, 10), Some(Patch::Shadow));
}

#[test]
fn limits_are_errors() {
    let media = rgb_media(&SKIN1, 1.4).unwrap();
    let at = |media: &[Medium; 3], alpha| Flesh::new(media, alpha, Masking::Separable).unwrap_err().at;
    assert_eq!(at(&media, 0.0), "boundary.alpha");
    assert_eq!(at(&media, f64::NAN), "boundary.alpha");
    let mut other = media;
    other[1].eta = 1.3;
    assert_eq!(at(&other, 0.3), "medium.eta");
    assert_eq!(at(&rgb_media(&SKIN1, 1.0).unwrap(), 0.3), "medium.eta");
}
