//! Memory of a long sequence, in a process of its own.

use glam::{Mat4, Vec2, Vec3};
use rubor_renderer::settings::{AntialiasMethod, Output, Quality, Settings};
use rubor_renderer::{
    Camera, ColorTable, EnvironmentMap, HeadInstance, HeadOnGpu, Light, LightKind, Renderer, Scene, native,
};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{BlendShape, Head, Material, Mesh, Part, SkinMaps, Vertex};
use rubor_rig::map::Map;

/// A bulging sheet of skin 16 cm wide with hair, maps and a shape.
fn sheet() -> Head {
    const N: u32 = 12;
    let mut mesh = Mesh::default();
    for i in 0..N * N {
        let uv = Vec2::new((i % N) as f32, (i / N) as f32) / (N - 1) as f32;
        let p = 0.16 * (uv - 0.5);
        mesh.points.push(Vec3::new(p.x, -p.y, 0.05 - 4.0 * p.length_squared()));
        mesh.vertices.push(Vertex { point: i, uv });
    }
    for i in (0..N * (N - 1)).filter(|i| i % N != N - 1) {
        mesh.triangles.push([i, i + N, i + N + 1]);
        mesh.triangles.push([i, i + N + 1, i + 1]);
    }
    let triangles = 0..mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles });
    let points: Vec<u32> = (0..N * N).collect();
    let offsets = points.iter().map(|_| Vec3::new(0.0, 0.0, 0.01)).collect();
    let shapes = vec![BlendShape { name: "out".into(), points, offsets, ..BlendShape::default() }];
    let maps = SkinMaps {
        melanin: Some(Map::filled(8, 8, &[0.05])),
        hemoglobin: Some(Map::filled(8, 8, &[0.04])),
        hair: Some(Map::filled(8, 8, &[0.5])),
        ..SkinMaps::default()
    };
    Head { name: "sheet".into(), mesh, shapes, maps, ..Head::default() }
}

/// Resident bytes of this process.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    text.split_whitespace().nth(1)?.parse::<u64>().ok().map(|pages| pages * 4096)
}

/// Reports that the test cannot run. The test harness hides what passing tests print, but not what they write.
fn skipped(why: &str) {
    let _ = std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("SKIPPED: {why}\n"));
}

/// Mesa's software driver recompiled shaders for each value of a uniform and kept the code: 4 to 8 MB per frame.
#[test]
fn memory_stays_flat_over_frames() {
    if resident().is_none() {
        skipped("this system does not tell the memory of a process in /proc/self/statm");
        return;
    }
    let gpu = match native::open(std::env::var("RUBOR_ADAPTER").ok().as_deref()) {
        Ok(gpu) => gpu,
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            skipped(&error.to_string());
            return;
        }
    };
    let head = sheet();
    let table = ColorTable { width: 2, height: 2, texels: &[[0.5; 3]; 4] };
    let on_gpu = HeadOnGpu::new(&gpu, &head, &table).expect("the head uploads");
    let environment = EnvironmentMap::studio().upload(&gpu);
    let mut renderer = Renderer::new(gpu.clone()).expect("the passes compile");
    for antialias in [AntialiasMethod::None, AntialiasMethod::Smaa4x] {
        let settings = Settings {
            output: Output { size: [48, 48], ..Output::default() },
            quality: Quality { antialias, shadow_size: 64, ..Quality::default() },
            ..Settings::default()
        };
        let mut draw = |frame: u32| {
            let t = frame as f32 * 0.01;
            let mut state = FaceState::neutral(&head);
            state.shapes = vec![t.sin()];
            let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
            let lamp = |x: f32| Light {
                kind: LightKind::Point { position: Vec3::new(x + 0.1 * t.sin(), 0.4, 0.6) },
                color_linear: Vec3::splat(1.0),
                radius: 0.03,
                casts_shadow: true,
            };
            let scene = Scene {
                heads: &heads,
                camera: Camera {
                    position: Vec3::Z,
                    target: Vec3::ZERO,
                    up: Vec3::Y,
                    fov_degrees: 12.0 + t.cos(),
                },
                lights: &[lamp(0.4), lamp(-0.4)],
                environment: Some(&environment),
                environment_rotation: t,
                environment_intensity: 0.5,
                background_linear: Vec3::ZERO,
                optics: Default::default(),
            };
            native::wait(&gpu, renderer.render(&scene, &settings)).expect("it draws");
        };
        (0..40).for_each(&mut draw);
        let before = resident().unwrap_or(0);
        (40..240).for_each(&mut draw);
        let grown = resident().unwrap_or(0).saturating_sub(before) as f64 / 200.0;
        assert!(grown < 20e3, "{antialias}: memory grows by {:.0} kB per frame", grown / 1e3);
    }
}
