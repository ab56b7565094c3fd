//! Light between two squares, from form factors.

use std::f64::consts::PI;

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};

use crate::channels::Channel;
use crate::passes::shade::directional_albedo::entering;
use crate::settings::{
    AntialiasMethod, BounceMethod, Look, Output, Quality, ScatterMethod, Settings, TransmitMethod,
};
use crate::testing::own_gpu;
use crate::tests::{read_texels, render};
use crate::{Camera, ColorTable, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene};

const MM: f32 = 1e-3;
const CELLS: u32 = 24;

/// Squares of 200 mm: one at z = 0 that faces +Z, one at z = 100 mm that faces it.
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
    Head { name: "squares".into(), mesh, ..Head::default() }
}

/// Diffuse light of the lower square, seen from between both, while a lamp lights the upper one.
fn lower_square(bounce: BounceMethod, visibility: f32) -> Option<Vec<[f32; 4]>> {
    let mut renderer = Renderer::new(own_gpu()?).expect("a renderer");
    let color = ColorTable { width: 1, height: 1, texels: &[[0.6, 0.4, 0.2]] };
    let head = squares(visibility);
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &color).expect("it uploads");
    let state = FaceState::neutral(&head);
    let lamp = Light {
        kind: LightKind::Directional { direction: Vec3::Z },
        color_linear: Vec3::splat(2.0),
        radius: 0.0,
        casts_shadow: false,
    };
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: Camera { position: 0.03 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 },
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

#[test]
fn a_lit_square_lights_the_one_before_it() {
    let Some(found) = lower_square(BounceMethod::Patches, 0.4) else { return };
    // Element over the middle of a square of twice the distance: four quarters of (1 / 2 pi) 2 (1 / sqrt 2) atan(1 / sqrt 2).
    let half = 0.5f64.sqrt();
    let factor = 4.0 / (2.0 * PI) * 2.0 * half * half.atan();
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
fn without_the_pass_or_with_nothing_hidden_there_is_none() {
    for (bounce, visibility) in [(BounceMethod::None, 0.4), (BounceMethod::Patches, 1.0)] {
        let Some(found) = lower_square(bounce, visibility) else { return };
        assert!(found.iter().all(|p| p[..3] == [0.0; 3]), "{bounce}: {:?}", found[40]);
    }
}
