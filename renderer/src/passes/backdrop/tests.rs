use super::*;
use crate::scene::view::view;
use crate::scene::{Camera, Optics};
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};

const WALL: Vec3 = Vec3::new(0.02, 0.03, 0.04);
const SIZE: [u32; 2] = [51, 27];

fn scene<'a>() -> Scene<'a> {
    let optics = Optics { subject: Vec3::new(0.05, 0.1, 0.0), subject_height: 0.25, ..Optics::default() };
    Scene {
        heads: &[],
        camera: Camera { position: 0.9 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 30.0 },
        lights: &[],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: WALL,
        optics,
    }
}

fn drawn(gpu: &Gpu, look: &Look) -> [Vec<[half::f16; 4]>; 2] {
    let scene = scene();
    let hdr = half_image(gpu, SIZE, &vec![[0.5; 4]; (SIZE[0] * SIZE[1]) as usize]);
    let spec = |format| ImageSpec::storage(SIZE, format);
    let seen = Seen {
        view: gpu.uniform("view", &view(&scene, &[], SIZE, [[0.0; 2]; 2], &[], None)),
        pixels_per_mm: 1.0,
        ids: Image::new(gpu, "ids", spec(wgpu::TextureFormat::R32Uint)),
        depth: Image::new(gpu, "depth", spec(wgpu::TextureFormat::R32Float)),
        windows: Vec::new(),
    };
    let pass = Backdrop::new(gpu, true);
    let (result, kept) = recorded(gpu, |r| pass.record(r, look, &scene, &seen, &[], &hdr));
    [result, kept.expect("it is kept")].map(|image| read_image(gpu, &image))
}

#[test]
fn the_shader_is_as_the_pass_counts_on() {
    for keeps in [false, true] {
        assert_workgroups(&program(keeps), &[("place_backdrop", [8, 8, 1])]);
    }
    assert_layout(
        &program(true),
        "place_backdrop",
        "Params",
        size_of::<Params>(),
        &offsets!(Params; color as "color", pool as "pool", pool_light as "pool_light", kind as "kind",
            level as "level", intensity as "intensity", fade as "fade"),
    );
}

#[test]
fn the_wall_is_lit_by_a_lamp_behind_the_subject() {
    let Some(gpu) = gpu() else { return };
    let look = Look { backdrop: BackdropMethod::Gradient, backdrop_light: 2.0, ..Look::default() };
    let [found, kept] = drawn(gpu, &look);
    assert_eq!(found, kept, "nothing stands before it");
    for (i, f) in found.iter().enumerate() {
        let [x, y] = [i as u32 % SIZE[0], i as u32 / SIZE[0]].map(|v| f64::from(v) + 0.5);
        // Place on the wall, metres from the axis of the camera, at the depth of the subject.
        let metres = 2.0 * 0.9 * 15f64.to_radians().tan() / 27.0;
        let at = [(x - 25.5) * metres, (13.5 - y) * metres];
        let middle = [0.05, 0.1 - f64::from(POOL_BELOW) * 0.25];
        let width = f64::from(POOL_WIDTH) * 0.25;
        let off = (at[0] - middle[0]).hypot(at[1] - middle[1]) / width;
        let light = 1.0 + f64::from(POOL_LIGHT) / (1.0 + off * off).powf(1.5);
        for c in 0..3 {
            let expected = 2.0 * f64::from(WALL[c]) * light;
            let error = (f64::from(f[c].to_f32()) / expected - 1.0).abs();
            assert!(error < 2e-3, "pixel {i}: {f:?}, expected {expected}");
        }
        assert_eq!(f[3].to_f32(), 0.0, "nothing covers it");
    }
}

#[test]
fn without_surroundings_the_wall_stays_plain() {
    let Some(gpu) = gpu() else { return };
    for backdrop in [BackdropMethod::Plain, BackdropMethod::Environment] {
        let [found, _] = drawn(gpu, &Look { backdrop, backdrop_light: 0.5, ..Look::default() });
        let expected = half::f16::from_f32(0.5 * WALL.x).to_f32();
        assert!(found.iter().all(|f| (f[0].to_f32() / expected - 1.0).abs() < 2e-3), "{:?}", found[0]);
    }
}

/// As the shader has it.
fn wholeness(fade: &Fade, place: Vec3) -> f32 {
    let at = |row: [f32; 4]| Vec4::from(row).dot(place.extend(1.0));
    let (above, inside) = (at(fade.up), fade.half_width - at(fade.side).abs());
    above.min(inside.max(above - 1.0)).clamp(0.0, 1.0)
}

#[test]
fn heads_fade_towards_their_lower_end_and_shoulders_to_the_sides() {
    let place = Mat4::from_rotation_translation(glam::Quat::from_rotation_z(0.5), Vec3::new(0.1, 0.2, 0.3));
    let bounds = (Vec3::new(-0.18, -0.15, -0.1), Vec3::new(0.14, 0.1, 0.1));
    let fade = Fade::new(&place, bounds, 0.05);
    // Distance to the right of the middle, height, share of the head.
    let cases = [
        (0.0, -0.15, 0.0),
        (0.0, -0.125, 0.5),
        (0.0, -0.10, 1.0),
        (0.16, -0.11, 0.0),
        (-0.135, -0.11, 0.5),
        (0.16, -0.075, 0.5),
        // Ears are as wide as they like.
        (0.16, -0.05, 1.0),
        (0.0, 0.05, 1.0),
    ];
    for (x, y, expected) in cases {
        let p = place.transform_point3(Vec3::new(x - 0.02, y, -0.02));
        let found = wholeness(&fade, p);
        assert!((found - expected).abs() < 1e-4, "{x} {y}: {found}, expected {expected}");
    }
    assert_eq!(wholeness(&Fade::new(&place, bounds, 0.0), Vec3::splat(-9.0)), 1.0, "off is whole everywhere");
}

#[test]
fn the_usual_look_needs_no_pass() {
    assert!(!is_needed(&Look::default()));
    assert!(is_needed(&Look { fade: 60.0, ..Look::default() }));
}
