//! Milliseconds of the appearance pass by the number of distributions and of wrinkle zones:
//! `cargo run --release -p rubor-renderer --example appearance_cost [ADAPTER]`.
//!
//! Prints the time of the pass by the device's timestamps and the wall-clock time of a whole frame of 16 x 16 pixels: a
//! software device writes timestamps when it accepts work, not when it does it.

use glam::{Mat4, Vec2, Vec3};
use rubor_renderer::settings::{
    AntialiasMethod, Look, Output, Quality, ScatterMethod, Settings, TransmitMethod,
};
use rubor_renderer::{Camera, ColorTable, HeadInstance, HeadOnGpu, RenderError, Renderer, Scene, native};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::map::Map;

const FRAMES: usize = 21;

fn main() -> Result<(), RenderError> {
    let gpu = native::open(std::env::args().nth(1).as_deref())?;
    println!("{}, {}", gpu.info.name, gpu.info.driver_info);
    let mut renderer = Renderer::new(gpu)?;
    let none = cost(&mut renderer, 0, 0)?;
    println!("nothing: pass {:.4} ms, frame {:.3} ms", none[0], none[1]);
    let line = |what: &str, n: usize, ms: [f64; 2]| {
        let each = [0, 1].map(|i| (ms[i] - none[i]) / n as f64);
        println!(
            "{n:2} {what}: pass {:.4} ms, frame {:.3} ms; each {:.4} and {:.4}",
            ms[0], ms[1], each[0], each[1]
        );
    };
    for n in [1, 2, 4, 8, 16, 32, 64] {
        line("distributions", n, cost(&mut renderer, n, 0)?);
    }
    for n in [4, 12, 64] {
        line("zones", n, cost(&mut renderer, 0, n)?);
    }
    Ok(())
}

/// Medians of the pass and of the frame over frames in which all distributions and zones have weights.
fn cost(renderer: &mut Renderer, distributions: usize, zones: usize) -> Result<[f64; 2], RenderError> {
    let head = head(distributions, zones);
    let table = ColorTable { width: 2, height: 2, texels: &[[0.5; 3]; 4] };
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &table)?;
    let gpu = renderer.gpu().clone();
    let mut state = FaceState::neutral(&head);
    state.distributions.fill(1.0 / distributions.max(1) as f32);
    state.zones.fill(0.5);
    let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
    let scene = Scene {
        heads: &heads,
        camera: Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 },
        lights: &[],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let settings = Settings {
        output: Output { size: [16, 16], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::None,
            transmit: TransmitMethod::None,
            antialias: AntialiasMethod::None,
            shadow_size: 16,
            ..Quality::default()
        },
        look: Look::default(),
    };
    let (mut times, mut frames) = (Vec::new(), Vec::new());
    for _ in 0..FRAMES {
        let start = std::time::Instant::now();
        let (_, stats) = native::wait(&gpu, renderer.render(&scene, &settings))?;
        frames.push(1e3 * start.elapsed().as_secs_f64());
        times.extend(stats.passes_ms.iter().filter(|(name, _)| *name == "appearance").map(|(_, ms)| *ms));
    }
    let median = |mut list: Vec<f64>| {
        list.sort_by(f64::total_cmp);
        list.get(list.len() / 2).copied().unwrap_or(f64::NAN)
    };
    Ok([median(times), median(frames)])
}

/// A square of skin with maps.
fn head(distributions: usize, zones: usize) -> Head {
    let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let mesh = Mesh {
        points: corners.iter().map(|c| (0.2 * (*c - 0.5)).extend(0.0)).collect(),
        vertices: corners.iter().enumerate().map(|(i, uv)| Vertex { point: i as u32, uv: *uv }).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..2 }],
        ..Mesh::default()
    };
    let flat = |v| Map::filled(256, 256, &[v]);
    let maps = SkinMaps {
        melanin: Some(flat(0.03)),
        hemoglobin: Some(flat(0.02)),
        hemoglobin_mean: Some(flat(0.02)),
        distributions: (0..distributions)
            .map(|i| Distribution { name: i.to_string(), scale: flat(1.2), bias: flat(0.03) })
            .collect(),
        wrinkle_slopes: vec![Map::filled(256, 256, &[0.1, 0.0])],
        zones: (0..zones)
            .map(|i| WrinkleZone { name: i.to_string(), wrinkle_map: 0, mask: Map::filled(128, 128, &[0.5]) })
            .collect(),
        ..SkinMaps::default()
    };
    Head { name: "square".into(), mesh, maps, ..Head::default() }
}
