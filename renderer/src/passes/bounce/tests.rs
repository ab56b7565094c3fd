//! Light between two squares, from form factors, and in a ball, from the integrating sphere.

use std::f64::consts::PI;

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{BlendShape, Head, Material, Mesh, Part, Vertex};

use super::{Poses, bounce_program, emit_program, smooth_program};
use crate::channels::Channel;
use crate::passes::shade::directional_albedo::entering;
use crate::settings::{
    AntialiasMethod, BounceMethod, Look, Output, Quality, ScatterMethod, Settings, TransmitMethod,
};
use crate::testing::{assert_layout, assert_workgroups, offsets, own_gpu};
use crate::tests::{read_texels, render};
use crate::{Camera, ColorTable, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene};

const MM: f32 = 1e-3;

#[test]
fn shaders_and_layouts_match() {
    for shares_lamps in [false, true] {
        assert_workgroups(&emit_program(shares_lamps), &[("emit", [64, 1, 1])]);
    }
    let program = bounce_program();
    for entry in ["send_on", "gather"] {
        assert_workgroups(&program, &[(entry, [64, 1, 1])]);
    }
    assert_workgroups(&smooth_program(), &[("smooth_light", [64, 1, 1])]);
    let poses = offsets!(Poses; weights as "weights", point_count as "point_count");
    assert_layout(&program, "gather", "Poses", size_of::<Poses>(), &poses);
}

/// Diffuse light of a head without maps whose skin has an albedo, 9 by 9 pixels.
fn diffuse(
    bounce: BounceMethod,
    head: &Head,
    weights: &[f32],
    albedo: [f32; 3],
    lamp: Light,
    camera: Camera,
) -> Option<Vec<[f32; 4]>> {
    let mut renderer = Renderer::new(own_gpu()?).expect("a renderer");
    let color = ColorTable { width: 1, height: 1, texels: &[albedo] };
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &color).expect("it uploads");
    let state = FaceState { shapes: weights.to_vec(), ..FaceState::neutral(head) };
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera,
        lights: &[lamp],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let settings = Settings {
        output: Output { size: [9; 2], channels: vec![Channel::Diffuse], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::None,
            transmit: TransmitMethod::None,
            bounce,
            antialias: AntialiasMethod::None,
            ..Quality::default()
        },
        look: Look::default(),
    };
    render(&mut renderer, &scene, &settings).expect("it draws");
    Some(read_texels(&renderer, Channel::Diffuse))
}

const CELLS: u32 = 24;

/// Squares of 200 mm: one at z = 0 that faces +Z, one at z = 100 mm that faces it, and that `jawOpen` moves to z = 200 mm.
fn squares(visibility: f32) -> Head {
    let mut mesh = Mesh::default();
    for (z, faces_up) in [(0.0, true), (100.0, false)] {
        let first = mesh.points.len() as u32;
        let side = CELLS + 1;
        for i in 0..side * side {
            let at = |k: u32| 200.0 * (k as f32 / CELLS as f32 - 0.5);
            mesh.vertices.push(Vertex { point: mesh.points.len() as u32, uv: Vec2::new(0.1, 0.1) });
            mesh.points.push(MM * Vec3::new(at(i % side), at(i / side), z));
        }
        let start = mesh.triangles.len() as u32;
        for i in 0..CELLS * CELLS {
            let a = first + i / CELLS * side + i % CELLS;
            let [b, c, d] = [a + 1, a + side, a + side + 1];
            mesh.triangles.extend(if faces_up { [[a, b, c], [b, d, c]] } else { [[a, c, b], [b, c, d]] });
        }
        let triangles = start..mesh.triangles.len() as u32;
        mesh.parts.push(Part { name: z.to_string(), material: Material::Skin, triangles });
    }
    mesh.occlusion = vec![visibility; mesh.points.len()];
    let upper: Vec<u32> = (mesh.points.len() as u32 / 2..mesh.points.len() as u32).collect();
    let offsets = vec![100.0 * MM * Vec3::Z; upper.len()];
    let jaw = BlendShape { name: "jawOpen".into(), points: upper, offsets, ..BlendShape::default() };
    Head { name: "squares".into(), mesh, shapes: vec![jaw], ..Head::default() }
}

/// Diffuse light of the lower square, seen from between both, while a lamp lights the upper one, which is moved by a weight.
fn lower_square(bounce: BounceMethod, visibility: f32, moved: f32) -> Option<Vec<[f32; 4]>> {
    let lamp = Light {
        kind: LightKind::Directional { direction: Vec3::Z },
        color_linear: Vec3::splat(2.0),
        radius: 0.0,
        casts_shadow: false,
    };
    let camera = Camera { position: 0.03 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 };
    diffuse(bounce, &squares(visibility), &[moved], [0.6, 0.4, 0.2], lamp, camera)
}

/// Form factor of a square of 200 mm for an element over its middle, `z` mm away: four quarters of (1 / 2 pi) 2 a atan(a) with
/// a = x / sqrt(x^2 + z^2) and x = 100 mm (Howell, catalogue of configuration factors, B-4).
fn form_factor(z: f64) -> f64 {
    let a = 100.0 / 100f64.hypot(z);
    4.0 / (2.0 * PI) * 2.0 * a * a.atan()
}

/// What is seen of the lower square, beside the light of form factors.
fn is_lit_by(found: &[[f32; 4]], factor: f64) {
    let mean = |c: usize| found.iter().map(|p| f64::from(p[c])).sum::<f64>() / found.len() as f64;
    for (c, albedo) in [0.6f64, 0.4, 0.2].into_iter().enumerate() {
        let expected = albedo * 2.0 / PI * entering(0.6, 0.32, 1.0) * factor;
        // What is seen are some 12 points with 32 rays each: independent ones would have a deviation of 4.6 %.
        assert!((mean(c) / expected - 1.0).abs() < 0.1, "channel {c}: {} not {expected}", mean(c));
    }
    // Even over the small part that is seen.
    let spread = found.iter().map(|p| (f64::from(p[0]) / mean(0) - 1.0).abs()).fold(0.0, f64::max);
    assert!(spread < 0.1, "{spread}");
}

#[test]
fn a_lit_square_lights_the_one_before_it() {
    let Some(found) = lower_square(BounceMethod::Patches, 0.4, 0.0) else { return };
    is_lit_by(&found, form_factor(100.0));
}

#[test]
fn an_open_mouth_is_lit_by_what_it_sees() {
    let Some(open) = lower_square(BounceMethod::Patches, 0.4, 1.0) else { return };
    is_lit_by(&open, form_factor(200.0));
    // Half open: the mean of both.
    let Some(half) = lower_square(BounceMethod::Patches, 0.4, 0.5) else { return };
    is_lit_by(&half, 0.5 * (form_factor(100.0) + form_factor(200.0)));
}

#[test]
fn without_the_pass_or_with_nothing_hidden_there_is_none() {
    for (bounce, visibility) in [(BounceMethod::None, 0.4), (BounceMethod::Patches, 1.0)] {
        let Some(found) = lower_square(bounce, visibility, 0.0) else { return };
        assert!(found.iter().all(|p| p[..3] == [0.0; 3]), "{bounce}: {:?}", found[40]);
    }
}

/// A hollow ball of 100 mm, seen and lit from its middle; `albedo` of its skin.
fn inside_of_a_ball(bounce: BounceMethod, albedo: [f32; 3]) -> Option<[f32; 3]> {
    const RINGS: u32 = 24;
    const AROUND: u32 = 2 * RINGS;
    let mut mesh = Mesh::default();
    for i in 0..(RINGS + 1) * AROUND {
        let (polar, around) = (i / AROUND, i % AROUND);
        let theta = std::f32::consts::PI * (polar as f32 / RINGS as f32).clamp(0.001, 0.999);
        let phi = std::f32::consts::TAU * around as f32 / AROUND as f32;
        let way = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        mesh.vertices.push(Vertex { point: mesh.points.len() as u32, uv: Vec2::new(0.1, 0.1) });
        mesh.points.push(100.0 * MM * way);
    }
    for i in 0..RINGS * AROUND {
        let [a, b] = [i, i / AROUND * AROUND + (i + 1) % AROUND];
        let [c, d] = [a + AROUND, b + AROUND];
        mesh.triangles.extend([[a, c, b], [b, c, d]]);
    }
    mesh.parts.push(Part {
        name: "ball".into(),
        material: Material::Skin,
        triangles: 0..mesh.triangles.len() as u32,
    });
    mesh.occlusion = vec![0.0; mesh.points.len()];
    let head = Head { name: "ball".into(), mesh, ..Head::default() };
    let lamp = Light {
        kind: LightKind::Point { position: Vec3::ZERO },
        color_linear: Vec3::ONE,
        radius: 0.0,
        casts_shadow: false,
    };
    let camera = Camera { position: Vec3::ZERO, target: Vec3::Z, up: Vec3::Y, fov_degrees: 20.0 };
    let found = diffuse(bounce, &head, &[], albedo, lamp, camera)?;
    Some([0, 1, 2].map(|c| found.iter().map(|p| p[c]).sum::<f32>() / found.len() as f32))
}

#[test]
fn in_a_ball_light_bounces_as_in_an_integrating_sphere() {
    let albedo = [0.7, 0.4, 0.1];
    let Some(direct) = inside_of_a_ball(BounceMethod::None, albedo) else { return };
    let Some(all) = inside_of_a_ball(BounceMethod::Patches, albedo) else { return };
    // Of a sphere's even light each bounce is the albedo times the one before: albedo / (1 - albedo) of the first in all.
    for c in 0..3 {
        let expected = albedo[c] / (1.0 - albedo[c]);
        let found = all[c] / direct[c] - 1.0;
        assert!((found / expected - 1.0).abs() < 0.05, "channel {c}: {found}, not {expected}");
    }
}
