//! The kernel, the CPU and the exported file put every point of the default head in the same place.

use glam::{Mat4, Vec3};
use rubor_assets::{export, import};
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{AntialiasMethod, Output, Quality, ScatterMethod, Settings, TransmitMethod};
use rubor_renderer::{Camera, ColorTable, HeadInstance, HeadOnGpu, RenderError, Renderer, Scene, native};
use rubor_rig::deform;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use std::io::Write;

/// Largest distance between two of the three, in heights of the head.
const TOLERANCE: f32 = 1e-5;

fn default_head() -> Head {
    let bytes = include_bytes!("../../assets/head.glb");
    import::gltf::from_bytes(bytes, "head.glb".as_ref()).expect("the default head is readable").head
}

fn renderer() -> Option<Renderer> {
    match native::open(None).and_then(Renderer::new) {
        Ok(renderer) => Some(renderer),
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            writeln!(std::io::stderr(), "SKIPPED: {error}").expect("stderr is open");
            None
        }
    }
}

fn farthest(a: &[Vec3], b: &[Vec3]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn kernel_and_cpu_agree_over_the_demo() -> Result<(), RenderError> {
    let Some(mut renderer) = renderer() else { return Ok(()) };
    let gpu = renderer.gpu().clone();
    let head = default_head();
    let table = ColorTable { width: 1, height: 1, texels: &[[0.5; 3]] };
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &table)?;
    let sequence = Sequence::demo().expect("the demo is valid");
    let rig = Rig::default_rig().expect("the default rig is valid");
    let (evaluator, _) = Evaluator::new(&head, &rig, &sequence).expect("the demo plays on the default head");
    let settings = Settings {
        output: Output { size: [16, 16], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::None,
            transmit: TransmitMethod::None,
            antialias: AntialiasMethod::None,
            shadow_size: 16,
            ..Quality::default()
        },
        ..Settings::default()
    };
    for step in 0..10 {
        let face = evaluator.at(f64::from(step) * 1.2 + 0.1).face;
        let instance = [HeadInstance { head: &on_gpu, state: &face, world_from_head: Mat4::IDENTITY }];
        let scene = Scene {
            heads: &instance,
            camera: Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 30.0 },
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
        };
        native::wait(&gpu, renderer.render(&scene, &settings))?;
        let place = Mat4::from_rotation_translation(face.head_rotation, face.head_translation);
        let cpu: Vec<Vec3> = deform::deform_points(&head.mesh, &head.shapes, &face.shapes)
            .into_iter()
            .map(|p| place.transform_point3(p))
            .collect();
        let positions = native::wait(&gpu, renderer.read(Channel::Positions))?;
        let positions: Vec<Vec3> = positions.texels::<3>().map(Vec3::from_array).collect();
        let distance = farthest(&positions, &cpu);
        assert!(distance < TOLERANCE * head.height(), "step {step}: {distance} m");
    }
    Ok(())
}

#[test]
fn an_exported_head_deforms_like_the_one_it_was_made_from() {
    let head = default_head();
    let options = export::gltf::Options { morph_normals: true, ..export::gltf::Options::default() };
    let bytes = export::gltf::to_bytes(&head, &options).expect("the head can be written");
    let again = import::gltf::from_bytes(&bytes, "again.glb".as_ref()).expect("and read").head;
    let weights: Vec<f32> = (0..head.shapes.len()).map(|i| (i % 3) as f32 * 0.4).collect();
    let here = deform::deform_points(&head.mesh, &head.shapes, &weights);
    let there = deform::deform_points(&again.mesh, &again.shapes, &weights);
    assert!(farthest(&here, &there) < TOLERANCE * head.height());
}
