//! Analytic cases: the integral over a plane, and transmittance through a wedge.

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};
use rubor_rig::skin::profile::Profile;
use rubor_rig::skin::slab::SlabTable;

use crate::channels::Channel;
use crate::passes::shade::directional_albedo::entering;
use crate::settings::{AntialiasMethod, Look, Output, Quality, ScatterMethod, Settings, TransmitMethod};
use crate::testing::own_gpu;
use crate::tests::{read_texels, render};
use crate::{
    Camera, ColorTable, EnvironmentMap, FrameStats, HeadInstance, HeadOnGpu, Light, LightKind, Renderer,
    Scene,
};

const MM: f32 = 1e-3;

/// A head of quads (corners in mm, counter-clockwise as seen from outside) of one material each.
fn head(quads: &[([[f32; 3]; 4], Material)]) -> Head {
    let mut mesh = Mesh::default();
    for (i, (corners, material)) in quads.iter().enumerate() {
        let first = mesh.points.len() as u32;
        for corner in corners {
            mesh.vertices
                .push(Vertex { point: mesh.points.len() as u32, uv: Vec2::new(corner[0], corner[1]) });
            mesh.points.push(MM * Vec3::from_array(*corner));
        }
        let range = mesh.triangles.len() as u32;
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([first, first + 2, first + 3]);
        mesh.parts.push(Part { name: i.to_string(), material: *material, triangles: range..range + 2 });
    }
    Head { name: "test".into(), mesh, ..Head::default() }
}

/// The light of a test.
struct Lit {
    lights: Vec<Light>,
    sky: Option<EnvironmentMap>,
}

impl From<Light> for Lit {
    fn from(light: Light) -> Self {
        Self { lights: vec![light], sky: None }
    }
}

/// Diffuse light seen from +Z; the picture is `across_mm` wide on the plane z = 0.
fn draw(
    head: &Head,
    light: impl Into<Lit>,
    across_mm: f32,
    pixels: u32,
    scatter: ScatterMethod,
    transmit: TransmitMethod,
) -> Option<(Vec<[f32; 4]>, FrameStats)> {
    let device = own_gpu()?;
    let mut renderer = Renderer::new(device).unwrap();
    let color = ColorTable { width: 1, height: 1, texels: &[[0.5; 3]] };
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &color).unwrap();
    let state = FaceState::neutral(head);
    let distance_mm = 30.0;
    let Lit { lights, sky } = light.into();
    let sky = sky.map(|map| map.upload(renderer.gpu()));
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: Camera {
            position: Vec3::Z * distance_mm * MM,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_degrees: 2.0 * (0.5 * across_mm / distance_mm).atan().to_degrees(),
        },
        lights: &lights,
        environment: sky.as_ref(),
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let settings = Settings {
        output: Output {
            size: [pixels; 2],
            channels: vec![Channel::Diffuse, Channel::Albedo],
            ..Output::default()
        },
        quality: Quality { scatter, transmit, antialias: AntialiasMethod::None, ..Quality::default() },
        look: Look { exposure: 1.0, ..Look::default() },
    };
    let (_, stats) = render(&mut renderer, &scene, &settings).unwrap();
    let strength = read_texels(&renderer, Channel::Albedo);
    let diffuse = read_texels(&renderer, Channel::Diffuse);
    Some((diffuse.into_iter().zip(strength).map(|([r, g, b, _], [.., a])| [r, g, b, a]).collect(), stats))
}

fn square(half: f32, z: f32) -> [[f32; 3]; 4] {
    [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]
}

/// Place of a pixel on the plane, mm.
fn place(i: usize, pixels: usize, across_mm: f64) -> [f64; 2] {
    let at = |n: usize| (n as f64 + 0.5) / pixels as f64 - 0.5;
    [at(i % pixels) * across_mm, -at(i / pixels) * across_mm]
}

/// Root mean square of the difference over the largest expected value.
fn difference(found: &[[f32; 4]], expected: impl Fn(usize) -> [f64; 3]) -> f64 {
    let (mut sum, mut largest) = (0.0, 0.0f64);
    for (i, f) in found.iter().enumerate() {
        let e = expected(i);
        for c in 0..3 {
            sum += (f64::from(f[c]) - e[c]).powi(2);
            largest = largest.max(e[c]);
        }
    }
    (sum / (3.0 * found.len() as f64)).sqrt() / largest
}

#[test]
fn half_a_plane_in_light_gives_the_line_spread() {
    let quads = [
        (square(45.0, 0.0), Material::Skin),
        // Casts a shadow on x < 0 from above the camera.
        ([[-45.0, -45.0, 40.0], [0.0, -45.0, 40.0], [0.0, 45.0, 40.0], [-45.0, 45.0, 40.0]], Material::Teeth),
    ];
    let light = Light {
        kind: LightKind::Directional { direction: Vec3::NEG_Z },
        color_linear: Vec3::splat(2.0),
        radius: 0.0,
        casts_shadow: true,
    };
    let method = ScatterMethod::ReferenceSurface(12);
    let Some((found, stats)) = draw(&head(&quads), light, 20.0, 24, method, TransmitMethod::None) else {
        return;
    };
    let profile = Profile::deon_six();
    let expected = |i: usize| {
        let x = place(i, 24, 20.0)[0];
        let side = profile.channels.each_ref().map(|c| 0.5 + 0.5 * x.signum() * c.line_cdf(x.abs()));
        // Skin without maps has a gloss of 0.6 and a roughness of 0.32.
        side.map(|s| s * entering(0.6, 0.32, 1.0) * 2.0 / std::f64::consts::PI)
    };
    let error = difference(&found, expected);
    assert!(error < 0.005, "{error}");
    let noise = stats.scatter_noise.unwrap();
    assert!(noise > 1e-4 && noise < 0.01, "{noise}");
}

#[test]
fn a_disk_of_light_gives_its_convolution() {
    // A lamp 100 mm above lights a disk of 8 mm radius; its edge is as soft as the smallest cone allows.
    let outer = (0.08f32).atan().to_degrees();
    let light = Light {
        kind: LightKind::Spot {
            position: Vec3::Z * 0.1,
            direction: Vec3::NEG_Z,
            outer_degrees: outer,
            inner_degrees: outer - 0.08,
        },
        color_linear: Vec3::splat(0.02),
        radius: 0.0,
        casts_shadow: false,
    };
    let method = ScatterMethod::ReferenceSurface(12);
    let plane = head(&[(square(45.0, 0.0), Material::Skin)]);
    let Some((found, _)) = draw(&plane, light, 24.0, 16, method, TransmitMethod::None) else { return };
    let (edge_out, edge_in) = {
        let out = f64::from(outer).to_radians().cos();
        (out, f64::from(outer - 0.08).to_radians().cos().max(out + 1e-4))
    };
    // Skin without maps has a gloss of 0.6 and a roughness of 0.32; rays stand within 5 degrees of upright.
    let entering = entering(0.6, 0.32, 0.998);
    let irradiance = |x: f64, y: f64| {
        let square_m = (x * x + y * y) * 1e-6 + 0.01;
        let cosine = 0.1 / square_m.sqrt();
        let t = ((cosine - edge_out) / (edge_in - edge_out)).clamp(0.0, 1.0);
        entering * 0.02 / square_m * cosine * t * t * (3.0 - 2.0 * t) / std::f64::consts::PI
    };
    let profile = Profile::deon_six();
    // Quantiles of the light in 160 rings of 160 angles.
    let radii: Vec<[f64; 3]> = (0..160)
        .map(|i| profile.channels.each_ref().map(|c| c.sample_radius((f64::from(i) + 0.5) / 160.0)))
        .collect();
    let expected = |i: usize| {
        let [x, y] = place(i, 16, 24.0);
        std::array::from_fn(|c| {
            let ring = |r: &[f64; 3]| {
                let at = |k: usize| {
                    let a = std::f64::consts::TAU * (k as f64 + 0.5) / 160.0;
                    irradiance(x + r[c] * a.cos(), y + r[c] * a.sin())
                };
                (0..160).map(at).sum::<f64>() / 160.0
            };
            radii.iter().map(ring).sum::<f64>() / 160.0
        })
    };
    let error = difference(&found, expected);
    assert!(error < 0.005, "{error}");
}

/// Thickness of the wedge per millimetre along x.
const SLOPE: f64 = 0.11;

/// From 0 mm at x = -50 to 11 mm at x = 50, seen from its flat side.
fn wedge() -> Head {
    head(&[
        (square(50.0, 0.0), Material::Skin),
        (
            [[-50.0, 50.0, 0.0], [50.0, 50.0, -11.0], [50.0, -50.0, -11.0], [-50.0, -50.0, 0.0]],
            Material::Skin,
        ),
    ])
}

#[test]
fn a_sky_behind_a_wedge_comes_through() {
    // Light only from behind: the order-2 harmonics of a half-lit sky.
    let map = || EnvironmentMap::from_fn(64, 32, |d| Vec3::splat(if d.z < 0.0 { 3.0 } else { 0.0 }));
    let lit = Lit { lights: Vec::new(), sky: Some(map()) };
    let method = TransmitMethod::ShadowDepth;
    let Some((found, _)) = draw(&wedge(), lit, 100.0, 40, ScatterMethod::None, method) else { return };
    let lit = Lit { lights: Vec::new(), sky: Some(map()) };
    let (without, _) = draw(&wedge(), lit, 100.0, 40, ScatterMethod::None, TransmitMethod::None).unwrap();
    let profile = Profile::deon_six();
    let mut compared = 0;
    for (i, (f, w)) in found.iter().zip(&without).enumerate() {
        let [x, y] = place(i, 40, 100.0);
        let thickness = (x + 50.0) * SLOPE;
        if !(1.0..9.9).contains(&thickness) || y.abs() > 45.0 {
            continue;
        }
        for c in 0..3 {
            let came = f64::from(f[c] - w[c]);
            // The irradiance of the back, over pi, is the radiance of the half sky.
            let channel = &profile.channels[c];
            let slab = SlabTable::kept().sample(0.5, thickness / channel.mean_radius_mm()) / 0.5;
            let expected = 3.0 * slab;
            assert!(
                (came - expected).abs() < 0.05 * expected + 3.0 / 400.0,
                "{thickness}: {came} {expected}"
            );
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn a_wedge_lit_from_behind_passes_what_slabs_do() {
    let head = wedge();
    let light = Light {
        kind: LightKind::Directional { direction: Vec3::Z },
        color_linear: Vec3::splat(100.0),
        radius: 0.0,
        casts_shadow: true,
    };
    let pixels = 40;
    let Some((found, _)) =
        draw(&head, light, 100.0, pixels, ScatterMethod::None, TransmitMethod::ShadowDepth)
    else {
        return;
    };
    let profile = Profile::deon_six();
    let mut compared = 0;
    for (i, f) in found.iter().enumerate() {
        let [x, y] = place(i, pixels as usize, 100.0);
        let thickness = (x + 50.0) * SLOPE;
        if !(1.0..9.9).contains(&thickness) || y.abs() > 45.0 {
            continue;
        }
        for (c, channel) in profile.channels.iter().enumerate() {
            // The back is at its distance from the pixel, and gets the light of its cross-section.
            let cosine = 1.0 / SLOPE.hypot(1.0);
            // What a slab passes, for a surface whose albedo of 0.5 is multiplied in later.
            let slab = SlabTable::kept().sample(0.5, thickness * cosine / channel.mean_radius_mm()) / 0.5;
            let expected = 100.0 / std::f64::consts::PI * cosine * slab;
            // The table ends at a 512th.
            let bound = 0.03 * expected + 100.0 / std::f64::consts::PI / 400.0;
            assert!(
                (f64::from(f[c]) - expected).abs() < bound,
                "{thickness} mm, channel {c}: {} not {expected}",
                f[c]
            );
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared}");
    // Without the method no light passes through.
    let dark = draw(&head, light, 100.0, 8, ScatterMethod::None, TransmitMethod::None).unwrap().0;
    assert!(dark.iter().all(|p| p[..3] == [0.0; 3]));
}

/// The integral over the surface passes what slabs do where `--transmit shadow-depth` does, and what the profile brings elsewhere.
#[test]
fn the_integral_over_a_wedge_passes_what_slabs_do() {
    let light = || Light {
        kind: LightKind::Directional { direction: Vec3::Z },
        color_linear: Vec3::splat(100.0),
        radius: 0.0,
        casts_shadow: true,
    };
    let profile = Profile::deon_six();
    let pixels = 20usize;
    for transmit in [TransmitMethod::ShadowDepth, TransmitMethod::None] {
        let method = ScatterMethod::ReferenceSurface(8);
        let Some((found, _)) = draw(&wedge(), light(), 100.0, pixels as u32, method, transmit) else {
            return;
        };
        let mut compared = 0;
        for column in 0..pixels {
            let thickness = (place(column, pixels, 100.0)[0] + 50.0) * SLOPE;
            if !(1.0..6.0).contains(&thickness) {
                continue;
            }
            let rows: Vec<_> = (3..pixels - 3).map(|row| found[row * pixels + column]).collect();
            for (c, channel) in profile.channels.iter().enumerate() {
                let came = rows.iter().map(|p| f64::from(p[c])).sum::<f64>() / rows.len() as f64;
                let cosine = 1.0 / SLOPE.hypot(1.0);
                let passes = match transmit {
                    // For a surface whose albedo of 0.5 is multiplied in later.
                    TransmitMethod::ShadowDepth => {
                        SlabTable::kept().sample(0.5, thickness / channel.mean_radius_mm()) / 0.5
                    }
                    _ => channel.mass_beyond(thickness) / channel.total(),
                };
                let expected =
                    100.0 / std::f64::consts::PI * cosine * entering(0.6, 0.32, cosine as f32) * passes;
                // The back is tilted, so what comes from its thinner side weighs more than what comes from the other.
                let bound = 0.08 * expected + 100.0 / std::f64::consts::PI / 1000.0;
                assert!(
                    (came - expected).abs() < bound,
                    "{transmit}, {thickness} mm, channel {c}: {came} not {expected}"
                );
                compared += 1;
            }
        }
        assert!(compared >= 24, "{compared}");
    }
}

#[test]
fn only_skin_scatters() {
    // Strips side by side, one of each opaque material.
    let materials: Vec<Material> = Material::ALL.into_iter().filter(|m| m.is_opaque()).collect();
    let strip = |i: usize| {
        let (left, right) = (-40.0 + 10.0 * i as f32, -30.0 + 10.0 * i as f32);
        [[left, -40.0, 0.0], [right, -40.0, 0.0], [right, 40.0, 0.0], [left, 40.0, 0.0]]
    };
    let quads: Vec<_> = materials.iter().enumerate().map(|(i, m)| (strip(i), *m)).collect();
    let light = Light {
        kind: LightKind::Directional { direction: Vec3::NEG_Z },
        color_linear: Vec3::splat(2.0),
        radius: 0.0,
        casts_shadow: false,
    };
    let pixels = 80;
    let method = ScatterMethod::Separable(17);
    let Some((found, _)) = draw(&head(&quads), light, 80.0, pixels, method, TransmitMethod::None) else {
        return;
    };
    let mut seen = 0;
    for (i, f) in found.iter().enumerate() {
        let [x, y] = place(i, pixels as usize, 80.0);
        let strip = ((x + 40.0) / 10.0).floor() as usize;
        if y.abs() > 35.0 || strip >= materials.len() || (x + 40.0) % 10.0 < 2.0 || (x + 40.0) % 10.0 > 8.0 {
            continue;
        }
        // Materials that do not scatter have no diffuse light of skin: black, without strength.
        let is_skin = materials[strip] == Material::Skin;
        assert_eq!(f[3] > 0.0, is_skin, "{:?}: {f:?}", materials[strip]);
        assert_eq!(f[..3] == [0.0; 3], !is_skin, "{:?}: {f:?}", materials[strip]);
        seen += 1;
    }
    assert!(seen > 100 * materials.len(), "{seen}");
}
