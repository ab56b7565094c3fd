use glam::{Mat4, Vec2, Vec3};
use rubor_rig::authored::{AlphaMode, AuthoredMaterial};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};

use super::*;
use crate::channels::Channel;
use crate::tests::{WHITE_TABLE, read_texels, render, renderer, settings};
use crate::{Camera, HeadInstance, HeadOnGpu, Renderer, Scene};

const SIZE: u32 = 27;
const BACKGROUND: Vec3 = Vec3::new(0.1, 0.2, 0.4);

/// A square that faces +Z at a height, or turned about the vertical.
#[derive(Clone)]
struct Pane {
    z: f32,
    turn: f32,
    material: AuthoredMaterial,
}

/// Unlit, of a colour and an alpha.
fn pane(z: f32, color: [f32; 3], alpha: f32) -> Pane {
    let [r, g, b] = color;
    let material = AuthoredMaterial {
        base_color: [r, g, b, alpha],
        alpha: AlphaMode::Blend,
        is_unlit: true,
        ..Default::default()
    };
    Pane { z, turn: 0.0, material }
}

fn head(panes: &[Pane]) -> Head {
    let mut head = Head::default();
    let mesh: &mut Mesh = &mut head.mesh;
    for (i, pane) in panes.iter().enumerate() {
        let first = mesh.vertices.len() as u32;
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let point = mesh.points.len() as u32;
            let place = 0.1 * Vec3::new(x * pane.turn.cos(), y, x * pane.turn.sin());
            mesh.points.push(place + Vec3::new(0.0, 0.0, pane.z));
            mesh.vertices.push(Vertex { point, uv: Vec2::new(x, y) });
        }
        let start = mesh.triangles.len() as u32;
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let triangles = start..start + 2;
        mesh.parts.push(Part { name: format!("pane {i}"), material: Material::Other, triangles });
        head.authored.materials.push(pane.material.clone());
        head.authored.of_parts.push(Some(i as u32));
    }
    head
}

/// Radiance over the picture; the panes fill it.
fn draw(renderer: &mut Renderer, panes: &[Pane]) -> Vec<[f32; 4]> {
    let head = head(panes);
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
    let state = FaceState::neutral(&head);
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera: Camera { position: 0.5 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 10.0 },
        lights: &[],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: BACKGROUND,
        optics: Default::default(),
    };
    render(renderer, &scene, &settings([SIZE; 2])).expect("it draws");
    read_texels(renderer, Channel::Radiance)
}

fn middle(picture: &[[f32; 4]]) -> Vec3 {
    Vec3::from_slice(&picture[(SIZE / 2 * SIZE + SIZE / 2) as usize][..3])
}

/// Panes over the background, the nearest last.
fn over(panes: &[Pane]) -> Vec3 {
    panes.iter().fold(BACKGROUND, |behind, pane| {
        let [r, g, b, alpha] = pane.material.base_color;
        behind.lerp(Vec3::new(r, g, b), alpha)
    })
}

#[track_caller]
fn close(found: Vec3, expected: Vec3) {
    assert!((found - expected).abs().max_element() < 2e-3, "{found}, expected {expected}");
}

#[test]
fn panes_cover_what_is_behind_in_any_order_of_triangles() {
    let Some(mut renderer) = renderer() else { return };
    let panes = [
        pane(-0.02, [1.0, 0.0, 0.0], 0.5),
        pane(-0.01, [0.0, 1.0, 0.0], 0.25),
        pane(0.01, [0.0, 0.0, 1.0], 0.75),
        pane(0.02, [1.0, 1.0, 0.0], 0.3),
    ];
    let expected = over(&panes);
    for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]] {
        let shuffled = order.map(|i| panes[i].clone());
        let picture = draw(&mut renderer, &shuffled);
        close(middle(&picture), expected);
        assert!(picture.iter().all(|t| (Vec3::from_slice(&t[..3]) - expected).length() < 4e-3));
    }
}

#[test]
fn panes_that_cross_are_right_on_both_sides() {
    let Some(mut renderer) = renderer() else { return };
    let turned = |turn: f32, color| Pane { turn, ..pane(0.0, color, 0.5) };
    let (red, green) = (turned(0.5, [1.0, 0.0, 0.0]), turned(-0.5, [0.0, 1.0, 0.0]));
    let picture = draw(&mut renderer, &[red.clone(), green.clone()]);
    let row = &picture[(SIZE / 2 * SIZE) as usize..][..SIZE as usize];
    // The red one comes nearer to the right, the green one to the left.
    close(Vec3::from_slice(&row[SIZE as usize - 5][..3]), over(&[green.clone(), red.clone()]));
    close(Vec3::from_slice(&row[4][..3]), over(&[red, green]));
}

#[test]
fn what_is_opaque_hides_and_shows_through() {
    let Some(mut renderer) = renderer() else { return };
    // Alpha of 1 in a blended part is opaque and needs no layer; more layers than there are lose the farthest.
    let wall = pane(0.0, [0.3, 0.6, 0.9], 1.0);
    let hidden = pane(-0.01, [1.0, 0.0, 0.0], 0.9);
    let front = pane(0.01, [1.0, 1.0, 1.0], 0.5);
    let picture = draw(&mut renderer, &[front.clone(), hidden, wall.clone()]);
    close(middle(&picture), over(&[wall.clone(), front]));
    assert!(picture.iter().all(|t| (t[3] - 1.0).abs() < 1e-3), "coverage");
    let mut many: Vec<Pane> = (0..LAYERS + 2).map(|i| pane(0.01 + 0.005 * i as f32, [0.0; 3], 0.5)).collect();
    many.insert(0, wall.clone());
    let found = middle(&draw(&mut renderer, &many));
    many.drain(1..3);
    close(found, over(&many));
    // Nothing to see through: nothing changes.
    close(middle(&draw(&mut renderer, std::slice::from_ref(&wall))), over(std::slice::from_ref(&wall)));
}

#[test]
fn one_sided_parts_have_no_back() {
    let Some(mut renderer) = renderer() else { return };
    for (alpha, value) in [(AlphaMode::Blend, 0.5), (AlphaMode::Opaque, 1.0)] {
        let mut shown = |is_double_sided: bool, turn: f32| {
            let mut pane = Pane { turn, ..pane(0.0, [1.0, 0.0, 0.0], value) };
            pane.material.alpha = alpha;
            pane.material.is_double_sided = is_double_sided;
            (middle(&draw(&mut renderer, &[pane])) - BACKGROUND).length() > 0.1
        };
        assert!(shown(false, 0.0) && shown(true, 0.0), "{alpha:?}: fronts");
        assert!(!shown(false, std::f32::consts::PI), "{alpha:?}: the back of one side");
        assert!(shown(true, std::f32::consts::PI), "{alpha:?}: the back of two sides");
    }
}

#[test]
fn glass_tints_what_lies_behind() {
    let Some(mut renderer) = renderer() else { return };
    let wall = pane(0.0, [0.8, 0.6, 0.4], 1.0);
    let glass = |ior: f32, color: [f32; 4]| {
        let material = AuthoredMaterial {
            base_color: color,
            metallic: 0.0,
            roughness: 0.0,
            transmission: 1.0,
            ior,
            ..Default::default()
        };
        Pane { z: 0.02, turn: 0.0, material }
    };
    let behind = Vec3::new(0.8, 0.6, 0.4);
    for (ior, f0) in [(1.5, 0.04), (2.0, 1.0 / 9.0)] {
        // Without a lamp glass reflects nothing; its colour and what it would reflect are taken from what passes.
        let found = middle(&draw(&mut renderer, &[glass(ior, [0.5, 1.0, 0.25, 1.0]), wall.clone()]));
        close(found, (1.0 - f0) * behind * Vec3::new(0.5, 1.0, 0.25));
    }
}
