//! Kernels against the CPU, look-ups against the integrals that they stand for, limits and hostile input.

use glam::{DMat3, Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, SkinMaps, Vertex};
use rubor_rig::map::Map;
use rubor_rig::skin::diffusion::NormalizedDiffusion;
use rubor_rig::skin::preintegrated::{Shape, band_shares, disk_edge, scattered_cosine, wave_shares};
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::curvature::Curvature;
use super::reference::{curvatures, principal};
use super::*;
use crate::channels::Channel;
use crate::passes::geometry::{morph::Morph, tangent_frames::TangentFrames};
use crate::passes::shade::directional_albedo::entering;
use crate::scene::posed_head::{Instance, posed};
use crate::settings::{
    AntialiasMethod, Look, Output, Quality, ScatterMethod, Settings, TransmitMethod, WrinkleMethod,
};
use crate::testing::{assert_layout, assert_workgroups, offsets, own_gpu, read_storage, recorded};
use crate::tests::{WHITE_TABLE, dome, read_texels, render, renderer};
use crate::{Camera, EnvironmentMap, FrameStats, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene};

const MM: f32 = 1e-3;
const THREE: ScatterMethod = ScatterMethod::PreIntegrated(3);

#[test]
fn shaders_are_valid_and_laid_out_as_in_rust() {
    for by_channel in [false, true] {
        for on_screen in [false, true] {
            let program = program(by_channel, on_screen);
            assert_workgroups(&program, &[("shade", [8, 8, 1])]);
            assert_layout(
                &program,
                "shade",
                "SkinLight",
                size_of::<Params>(),
                &offsets!(Params; reach_mm as "reach_mm", widest_mm as "widest_mm", middle_per_mm as "middle_per_mm",
                    curvature_scale as "curvature_scale", first_blurred as "first_blurred",
                    relief_layer as "relief_layer", sharp as "sharp", micro as "micro", blurred as "blurred"),
            );
            // What WebGPU guarantees for one stage.
            let linked = program.link(&["shade"], false).wgsl;
            let is_sampled = |line: &&str| {
                line.contains("var ") && line.contains(": texture_") && !line.contains(": texture_storage")
            };
            let count = linked.lines().filter(is_sampled).count();
            assert!((10..=16).contains(&count), "{count}");
            assert!(linked.matches("var<storage").count() <= 8);
        }
        let blur = relief::program(by_channel);
        for entry in ["copy_map", "blur_across", "blur_down"] {
            assert_workgroups(&blur, &[(entry, [8, 8, 1])]);
        }
        assert_layout(
            &blur,
            "blur_across",
            "Params",
            size_of::<relief::Params>(),
            &offsets!(relief::Params; size as "size", level as "level", layer as "layer", radius as "radius",
                target_layer as "target_layer", has_variance as "has_variance", taps as "taps"),
        );
    }
    assert_workgroups(&relief::halve_program(), &[("halve_maps", [8, 8, 1])]);
    let curvature = curvature::program();
    assert_workgroups(
        &curvature,
        &[("list_spokes", [64, 1, 1]), ("curvature_of_points", [64, 1, 1]), ("smooth_curvature", [64, 1, 1])],
    );
    // Without the rule nothing of it is in the kernel of other methods.
    let plain = crate::passes::shade::program().link(&["shade"], false).wgsl;
    assert!(!plain.contains("skin_tables") && !plain.contains("ScatteredSkin"));
}

/// Rows of points closed around an axis or not; `place` of u and v from 0 to 1.
fn grid(columns: usize, rows: usize, is_closed: bool, place: impl Fn(f32, f32) -> Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    let around = if is_closed { columns - 1 } else { columns };
    for y in 0..rows {
        for x in 0..columns {
            let (u, v) = (x as f32 / (columns - 1) as f32, y as f32 / (rows - 1) as f32);
            let point = (y * around + x % around) as u32;
            mesh.vertices.push(Vertex { point, uv: Vec2::new(u, v) });
            if x < around {
                mesh.points.push(MM * place(u, v));
            }
        }
    }
    for y in 0..rows - 1 {
        for x in 0..columns - 1 {
            let v = |x: usize, y: usize| (y * columns + x) as u32;
            mesh.triangles.push([v(x, y), v(x, y + 1), v(x + 1, y + 1)]);
            mesh.triangles.push([v(x, y), v(x + 1, y + 1), v(x + 1, y)]);
        }
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    mesh
}

/// A sphere about the origin by latitude and longitude, its normals outwards; radius in mm.
fn sphere(radius: f32, columns: usize) -> Mesh {
    grid(columns, columns / 2 + 1, true, |u, v| {
        let (phi, theta) = (std::f32::consts::TAU * u, std::f32::consts::PI * (0.002 + 0.996 * v));
        radius * Vec3::new(phi.sin() * theta.sin(), theta.cos(), phi.cos() * theta.sin())
    })
}

/// A cylinder about y, radius in mm.
fn cylinder(radius: f32, columns: usize) -> Mesh {
    grid(columns, 12, true, |u, v| {
        let phi = std::f32::consts::TAU * u;
        Vec3::new(radius * phi.sin(), 30.0 - 60.0 * v, radius * phi.cos())
    })
}

fn bare(mesh: Mesh) -> Head {
    Head { name: "test".into(), mesh, ..Head::default() }
}

fn found_curvatures(head: &Head) -> Option<Vec<DMat3>> {
    let gpu = own_gpu()?;
    let on_gpu = HeadOnGpu::new(&gpu, head, &WHITE_TABLE).unwrap();
    let state = FaceState::neutral(head);
    let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
    let scene = scene(&heads, &[], None, 60.0);
    let instances = [Instance::new(&gpu, &on_gpu)];
    let posed = posed(&scene, &instances, false);
    let mut buffers = None;
    recorded(&gpu, |r| {
        Morph::new(&gpu).record(r, &posed);
        TangentFrames::new(&gpu).record(r, &posed);
        let passes = Curvature::new(&gpu);
        let made = buffers.insert(passes.prepare(r, &posed[0]));
        passes.record(r, &[(&posed[0], made)]);
    });
    let tensor = |t: &[f32; 8]| {
        let [x, y, z, _, yz, zx, xy, _] = t.map(f64::from);
        DMat3::from_cols_array(&[x, xy, zx, xy, y, yz, zx, yz, z])
    };
    Some(read_storage::<[f32; 8]>(&gpu, buffers.as_ref()?.smooth()).iter().map(tensor).collect())
}

#[test]
fn spheres_and_cylinders_have_their_curvature() {
    for (head, expected) in [
        (bare(sphere(20.0, 48)), [0.05, 0.05]),
        (bare(sphere(4.0, 48)), [0.25, 0.25]),
        (bare(cylinder(15.0, 40)), [1.0 / 15.0, 0.0]),
    ] {
        let Some(found) = found_curvatures(&head) else { return };
        let mut compared = 0;
        for (tensor, p) in found.iter().zip(&head.mesh.points) {
            // Not the poles, whose triangles are slivers, nor the rims of the cylinder.
            let is_inside = if expected[1] == 0.0 { p.y.abs() < 0.015 } else { p.y.abs() < 0.7 * p.length() };
            if !is_inside {
                continue;
            }
            let principal = principal(tensor);
            for (found, expected) in principal.iter().zip(expected) {
                assert!((found - expected).abs() < 0.03 * expected.max(0.05), "{p}: {principal:?}");
            }
            compared += 1;
        }
        assert!(compared > 100, "{compared}");
    }
}

#[test]
fn curvature_is_that_of_the_cpu() {
    // Bulges, saddles and a texture seam, and triangles of every shape.
    let head = dome();
    let Some(found) = found_curvatures(&head) else { return };
    let expected = curvatures(&head.mesh, &head.mesh.points, 2);
    let largest = expected.iter().map(|t| principal(t)[0].abs()).fold(0.0, f64::max);
    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let error = (*found - *expected).to_cols_array().iter().fold(0.0f64, |a, b| a.max(b.abs()));
        assert!(error < 2e-3 * largest, "point {i}: {found} {expected}");
    }
}

#[test]
fn triangles_without_area_and_lone_points_have_a_finite_curvature() {
    let mut mesh = sphere(10.0, 16);
    let first = mesh.points[20];
    for p in &mut mesh.points[21..24] {
        *p = first;
    }
    mesh.points.push(Vec3::splat(0.05));
    let Some(found) = found_curvatures(&bare(mesh)) else { return };
    assert!(found.iter().all(|t| t.is_finite()));
    assert_eq!(found.last(), Some(&DMat3::ZERO));
}

// ---- Frames ----

fn scene<'a>(
    heads: &'a [HeadInstance<'a>],
    lights: &'a [Light],
    environment: Option<&'a crate::Environment>,
    across_mm: f32,
) -> Scene<'a> {
    // From so far that all rays are nearly parallel.
    let distance = 2.0;
    Scene {
        heads,
        camera: Camera {
            position: distance * Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_degrees: 2.0 * (0.5 * MM * across_mm / distance).atan().to_degrees(),
        },
        lights,
        environment,
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    }
}

/// A lamp far away.
fn lamp(direction: Vec3, casts_shadow: bool) -> Light {
    let kind = LightKind::Directional { direction };
    Light { kind, color_linear: Vec3::splat(3.0), radius: 0.0, casts_shadow }
}

struct Drawn {
    diffuse: Vec<[f32; 4]>,
    strength: Vec<f32>,
    radiance: Vec<[f32; 4]>,
    stats: FrameStats,
}

struct Wanted {
    scatter: ScatterMethod,
    pixels: u32,
    across_mm: f32,
    profile: Profile,
    wrinkles: WrinkleMethod,
    sky: Option<EnvironmentMap>,
}

impl Wanted {
    fn of(scatter: ScatterMethod, pixels: u32, across_mm: f32) -> Self {
        let wrinkles = WrinkleMethod::PartialDerivative;
        Self { scatter, pixels, across_mm, profile: Profile::deon_six(), wrinkles, sky: None }
    }
}

fn draw(renderer: &mut Renderer, head: &Head, state: &FaceState, lights: &[Light], wanted: &Wanted) -> Drawn {
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).unwrap();
    let heads = [HeadInstance { head: &on_gpu, state, world_from_head: Mat4::IDENTITY }];
    let sky = wanted.sky.as_ref().map(|map| map.upload(renderer.gpu()));
    let scene = scene(&heads, lights, sky.as_ref(), wanted.across_mm);
    let settings = Settings {
        output: Output {
            size: [wanted.pixels; 2],
            channels: vec![Channel::Diffuse, Channel::Albedo, Channel::Radiance],
            ..Output::default()
        },
        quality: Quality {
            scatter: wanted.scatter,
            transmit: TransmitMethod::None,
            antialias: AntialiasMethod::None,
            wrinkles: wanted.wrinkles,
            profile: wanted.profile.clone().into(),
            shadow_size: 1024,
            ..Quality::default()
        },
        look: Look { exposure: 1.0, ..Look::default() },
    };
    let (_, stats) = render(renderer, &scene, &settings).unwrap();
    Drawn {
        diffuse: read_texels(renderer, Channel::Diffuse),
        strength: read_texels(renderer, Channel::Albedo).iter().map(|t| t[3]).collect(),
        radiance: read_texels(renderer, Channel::Radiance),
        stats,
    }
}

/// Root mean square difference of bare skin relative to that of the second.
fn relative_error(found: &Drawn, expected: &Drawn) -> f64 {
    let (mut error, mut signal) = (0.0, 0.0);
    for ((f, e), strength) in found.diffuse.iter().zip(&expected.diffuse).zip(&expected.strength) {
        for c in 0..if *strength > 0.5 { 3 } else { 0 } {
            error += f64::from(f[c] - e[c]).powi(2);
            signal += f64::from(e[c]).powi(2);
        }
    }
    (error / signal).sqrt()
}

#[test]
fn a_sphere_is_lit_as_the_integral_says() {
    let Some(mut renderer) = renderer() else { return };
    let radius = 10.0;
    let head = bare(sphere(radius, 96));
    let state = FaceState::neutral(&head);
    let light = lamp(Vec3::new(-1.0, 0.0, -0.2), true);
    let pixels = 48;
    let found = draw(&mut renderer, &head, &state, &[light], &Wanted::of(THREE, pixels, 22.0));
    let LightKind::Directional { direction } = light.kind else { panic!("a directional lamp") };
    let profile = Profile::deon_six();
    let mut compared = 0;
    for (i, f) in found.diffuse.iter().enumerate() {
        let at = |k: usize| ((k as f32 + 0.5) / pixels as f32 - 0.5) * 22.0;
        let (x, y) = (at(i % pixels as usize), -at(i / pixels as usize));
        let square = radius * radius - x * x - y * y;
        // The rim, where a pixel covers many normals, is left out.
        if square < 0.16 * radius * radius {
            continue;
        }
        let normal = Vec3::new(x, y, square.sqrt()) / radius;
        let cosine = f64::from(normal.dot(-direction.normalize()));
        for (c, channel) in profile.channels.iter().enumerate() {
            let light = scattered_cosine(channel, Shape::Sphere, cosine, f64::from(radius)).unwrap();
            let green =
                scattered_cosine(&profile.channels[1], Shape::Sphere, cosine, f64::from(radius)).unwrap();
            // Skin without maps has a gloss of 0.6 and a roughness of 0.32.
            let expected = 3.0 / std::f64::consts::PI * light * entering(0.6, 0.32, green as f32);
            // A fiftieth of the light, and of full light where there is little: facets, and steps of the tables.
            let bound = 0.02 * expected + 0.01;
            assert!((f64::from(f[c]) - expected).abs() < bound, "{cosine}, channel {c}: {} {expected}", f[c]);
            compared += 1;
        }
    }
    assert!(compared > 3000, "{compared}");
}

#[test]
fn error_to_the_reference_on_spheres_has_a_bound() {
    let Some(mut renderer) = renderer() else { return };
    // Relative root mean square; where light goes far for the size of the sphere no scattering is much farther off.
    for (radius, bound, factor) in [(6.0, 0.03, 0.4), (25.0, 0.01, 2.0)] {
        let head = bare(sphere(radius, 80));
        let state = FaceState::neutral(&head);
        let lights = [lamp(Vec3::new(-1.0, -0.1, -0.4), true)];
        let mut of =
            |scatter| draw(&mut renderer, &head, &state, &lights, &Wanted::of(scatter, 24, 1.7 * radius));
        let reference = of(ScatterMethod::ReferenceSurface(6));
        let [found, none] = [THREE, ScatterMethod::None].map(|m| relative_error(&of(m), &reference));
        let limits = found < bound && found < factor * none;
        assert!(limits, "{radius} mm: {found}, without scattering {none}");
    }
}

#[test]
fn on_a_plane_and_with_a_narrow_profile_light_is_lamberts() {
    let Some(mut renderer) = renderer() else { return };
    let plane = bare(grid(8, 8, false, |u, v| 60.0 * Vec3::new(u - 0.5, 0.5 - v, 0.0)));
    let state = FaceState::neutral(&plane);
    let lights = [lamp(Vec3::new(-0.6, -0.3, -0.5), true)];
    let mut draw_of = |head: &Head, state: &FaceState, scatter, profile: &Profile| {
        let wanted = Wanted { profile: profile.clone(), ..Wanted::of(scatter, 24, 50.0) };
        draw(&mut renderer, head, state, &lights, &wanted)
    };
    let skin = Profile::deon_six();
    let none = draw_of(&plane, &state, ScatterMethod::None, &skin);
    let error = relative_error(&draw_of(&plane, &state, THREE, &skin), &none);
    assert!(error < 2e-3, "{error}");

    let dome = dome();
    let narrow = RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 1e-5 });
    let narrow = Profile { name: "narrow".into(), channels: std::array::from_fn(|_| narrow.clone()) };
    let mut state = FaceState::neutral(&dome);
    state.zones = vec![0.6];
    let none = draw_of(&dome, &state, ScatterMethod::None, &narrow);
    for method in [ScatterMethod::PreIntegrated(1), THREE] {
        let error = relative_error(&draw_of(&dome, &state, method, &narrow), &none);
        assert!(error < 0.01, "{method}: {error}");
    }
}

/// A square of skin of 60 mm with a wave of slopes along x.
fn waves(wavelength_mm: f32, in_wrinkles: bool) -> Head {
    let mut mesh = grid(8, 8, false, |u, v| 60.0 * Vec3::new(u - 0.5, 0.5 - v, 0.0));
    mesh.occlusion.clear();
    let side = 256;
    let mut map = Map::filled(side, side, &[0.0, 0.0]);
    for (i, texel) in map.values.chunks_exact_mut(2).enumerate() {
        let x_mm = 60.0 * ((i as u32 % side) as f32 + 0.5) / side as f32;
        texel[0] = 0.1 * (std::f32::consts::TAU * x_mm / wavelength_mm).sin();
    }
    let flat = |value| Map::filled(4, 4, &[value]);
    let zero = Map::filled(4, 4, &[0.0, 0.0]);
    let (slopes, wrinkle) = if in_wrinkles { (zero, map) } else { (map, zero) };
    let maps = SkinMaps {
        melanin: Some(flat(0.03)),
        hemoglobin: Some(flat(0.02)),
        hemoglobin_mean: Some(flat(0.02)),
        slopes: Some(slopes),
        wrinkle_slopes: vec![wrinkle],
        zones: vec![rubor_rig::head::WrinkleZone { name: "all".into(), wrinkle_map: 0, mask: flat(1.0) }],
        // Lips, which have no net of furrows of their own.
        specular: Some(Map::filled(1, 1, &[0.7, 0.3])),
        scattering: Some(flat(1.0)),
        ..SkinMaps::default()
    };
    Head { name: "waves".into(), mesh, maps, ..Head::default() }
}

#[test]
fn relief_and_wrinkles_are_blurred_by_the_profile() {
    let Some(mut renderer) = renderer() else { return };
    let profile = Profile::deon_six();
    for (wavelength, in_wrinkles) in [(3.0, false), (7.5, false), (3.0, true)] {
        let head = waves(wavelength, in_wrinkles);
        let mut state = FaceState::neutral(&head);
        state.zones = vec![1.0];
        let lights = [lamp(Vec3::new(-0.6, 0.0, -0.8), false)];
        let mut amplitude = |scatter| {
            let drawn = draw(&mut renderer, &head, &state, &lights, &Wanted::of(scatter, 120, 15.0));
            // The wave along rows, by its Fourier sum; 15 mm hold whole waves, and pixels are finer than texels.
            [0, 1, 2].map(|c| {
                let (mut sine, mut cosine) = (0.0, 0.0);
                for (i, t) in drawn.diffuse.iter().enumerate() {
                    let x = (i % 120) as f32 * 0.125 + 0.0625;
                    let phase = std::f32::consts::TAU * x / wavelength;
                    sine += t[c] * phase.sin();
                    cosine += t[c] * phase.cos();
                }
                f64::from(sine.hypot(cosine))
            })
        };
        let none = amplitude(ScatterMethod::None);
        let expected = wave_shares(&profile, f64::from(wavelength));
        let three = amplitude(THREE);
        let one = amplitude(ScatterMethod::PreIntegrated(1));
        for c in 0..3 {
            let share = three[c] / none[c];
            assert!(
                (share - expected[c]).abs() < 0.04,
                "{wavelength} mm, channel {c}: {share} {}",
                expected[c]
            );
        }
        // One map is right in red and orders the channels.
        assert!((one[0] / none[0] - expected[0]).abs() < 0.04, "{one:?} {none:?}");
        let [r, g, b] = [0, 1, 2].map(|c| one[c] / none[c]);
        assert!(r < g && g <= b + 1e-3, "{r} {g} {b}");
    }
}

#[test]
fn the_edge_of_a_shadow_is_blurred_by_the_line_spread() {
    let Some(mut renderer) = renderer() else { return };
    // Half of a plane in the shadow of a blind 30 mm before it.
    let mut mesh = grid(8, 8, false, |u, v| 120.0 * Vec3::new(u - 0.5, 0.5 - v, 0.0));
    let start = mesh.triangles.len() as u32;
    let blind = [[-60.0, -60.0], [0.0, -60.0], [0.0, 60.0], [-60.0, 60.0]];
    let first = mesh.vertices.len() as u32;
    for [x, y] in blind {
        mesh.vertices.push(Vertex { point: mesh.points.len() as u32, uv: Vec2::ZERO });
        mesh.points.push(MM * Vec3::new(x, y, 30.0));
    }
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh.parts.push(Part { name: "blind".into(), material: Material::Teeth, triangles: start..start + 2 });
    let head = bare(mesh);
    let state = FaceState::neutral(&head);
    for (slant, radius) in [(0.0f32, 0.0f32), (0.0, 0.05), (0.6, 0.02)] {
        // The shadow falls beside the blind, where the camera sees its edge.
        let direction = Vec3::new(0.5, slant, -1.0).normalize();
        let light = Light { radius, ..lamp(direction, true) };
        let pixels = 40;
        let found = draw(&mut renderer, &head, &state, &[light], &Wanted::of(THREE, pixels, 60.0));
        // The edge falls along the light; on the plane it stays parallel to y.
        let edge = 30.0 * f64::from(direction.x / -direction.z);
        // As wide as the lamp's disk, and wider by the slant across the edge, which lies along y.
        let [y, z] = [direction.y, -direction.z].map(f64::from);
        let penumbra = 30.0 / z * f64::from(radius) * (1.0 - y * y).sqrt() / z;
        let profile = Profile::deon_six();
        let (mut sum, mut compared) = (0.0, 0);
        for (i, f) in found.diffuse.iter().enumerate() {
            let x = ((i % pixels as usize) as f64 + 0.5) * 60.0 / f64::from(pixels) - 30.0;
            let beside = x - edge;
            if beside.abs() > 12.0 || found.strength[i] == 0.0 {
                continue;
            }
            let cosine = f64::from(-direction.z);
            let full = 3.0 / std::f64::consts::PI * cosine * entering(0.6, 0.32, cosine as f32);
            for (c, channel) in profile.channels.iter().enumerate() {
                let expected: f64 = (0..200)
                    .map(|j| {
                        let at = |j: f64| j / 100.0 - 1.0;
                        let slope = disk_edge(at(f64::from(j) + 1.0)) - disk_edge(at(f64::from(j)));
                        let y = beside - penumbra * at(f64::from(j) + 0.5);
                        slope * (0.5 + 0.5 * y.signum() * channel.line_cdf(y.abs()))
                    })
                    .sum();
                sum += (f64::from(f[c]) / full - expected).powi(2);
                compared += 1;
            }
        }
        let error = (sum / f64::from(compared)).sqrt();
        assert!(compared > 500 && error < 0.06, "{direction}, {radius}: {error} over {compared}");
    }
}

#[test]
fn the_sky_is_blurred_by_curvature() {
    let Some(mut renderer) = renderer() else { return };
    let radius = 5.0;
    let head = bare(sphere(radius, 64));
    let state = FaceState::neutral(&head);
    // Of band 1 alone, and the mean.
    let sky = || Some(EnvironmentMap::from_fn(64, 32, |d| Vec3::splat(1.0 + d.y)));
    let mut of = |scatter| {
        draw(&mut renderer, &head, &state, &[], &Wanted { sky: sky(), ..Wanted::of(scatter, 24, 6.0) })
    };
    let none = of(ScatterMethod::None);
    let found = of(THREE);
    let profile = Profile::deon_six();
    for (f, n) in found.diffuse.iter().zip(&none.diffuse) {
        for (c, channel) in profile.channels.iter().enumerate() {
            let [_, first, _] = band_shares(channel, f64::from(radius));
            let expected = 1.0 + first * (f64::from(n[c]) - 1.0);
            assert!((f64::from(f[c]) - expected).abs() < 0.01, "channel {c}: {} {expected}", f[c]);
        }
    }
}

#[test]
fn hostile_input_gives_finite_light() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    // Triangles without area, and a point that nothing uses.
    let first = head.mesh.points[100];
    head.mesh.points[101] = first;
    head.mesh.points[124] = first;
    let mut state = FaceState::neutral(&head);
    state.shapes = vec![1.0, 1.0];
    state.zones = vec![1.0];
    let wide = RadialProfile::NormalizedDiffusion(NormalizedDiffusion { albedo: 0.8, d_mm: 300.0 });
    let wide = Profile { name: "wide".into(), channels: std::array::from_fn(|_| wide.clone()) };
    let inside = Light {
        kind: LightKind::Point { position: Vec3::new(0.0, 0.0, 0.04) },
        color_linear: Vec3::splat(0.01),
        radius: 0.02,
        casts_shadow: true,
    };
    let lights = [inside, lamp(Vec3::X, true), lamp(Vec3::Z, true)];
    use WrinkleMethod::{Difference, PartialDerivative};
    for (profile, scatter, wrinkles) in [
        (&wide, THREE, PartialDerivative),
        (&Profile::deon_six(), THREE, Difference),
        (&wide, ScatterMethod::PreIntegrated(1), Difference),
    ] {
        let wanted = Wanted { profile: profile.clone(), wrinkles, ..Wanted::of(scatter, 27, 180.0) };
        let found = draw(&mut renderer, &head, &state, &lights, &wanted);
        assert!(found.diffuse.iter().flatten().all(|v| v.is_finite() && *v >= -8192.0));
        assert!(found.radiance.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
        assert!(found.radiance.iter().any(|v| v[1] > 0.0));
    }
}

#[test]
fn memory_of_the_method_is_counted() {
    let Some(mut renderer) = renderer() else { return };
    let head = waves(5.0, false);
    let state = FaceState::neutral(&head);
    let mut bytes = |scatter| {
        // The images of the frame before are dropped two frames later.
        let mut frame = || draw(&mut renderer, &head, &state, &[], &Wanted::of(scatter, 16, 50.0)).stats;
        [frame(), frame(), frame(), frame()].map(|stats| stats.memory_bytes)[3]
    };
    let none = bytes(ScatterMethod::None);
    let [one, three] = [ScatterMethod::PreIntegrated(1), THREE].map(&mut bytes);
    // What one method keeps is gone with the next.
    assert_eq!(bytes(ScatterMethod::None), none);
    // 256 x 256 texels of 8 bytes with all levels, two layers more for each of two maps.
    assert!(three - one > 2 * 256 * 256 * 8 && one > none, "{none} {one} {three}");
}
