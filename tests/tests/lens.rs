//! Depth of field beside a real lens: the mean of cameras that stand all over its aperture and look at the plane in focus.

use glam::Vec3;
use rubor::{Outcome, Studio};
use rubor_assets::compare::{Pixels, flip};
use rubor_assets::import;
use rubor_renderer::settings::{
    AntialiasMethod, DepthOfFieldMethod, Look, Output, Quality, ScatterMethod, Settings, ToneMap,
};
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use rubor_tests::can_draw;

const SIDE: u32 = 192;
/// Cameras of the reference.
const CAMERAS: usize = 48;

fn default_head() -> Head {
    let bytes = include_bytes!("../../assets/head.glb");
    import::gltf::from_bytes(bytes, "head.glb".as_ref()).expect("the default head is readable").head
}

fn settings(depth_of_field: DepthOfFieldMethod) -> Settings {
    Settings {
        output: Output { size: [SIDE; 2], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::Separable(17),
            antialias: AntialiasMethod::Ssaa(2),
            shadow_size: 1024,
            depth_of_field,
            ..Quality::default()
        },
        // Light as it is, dark enough to leave highlights whole: then pictures can be averaged.
        look: Look { exposure: 0.8, tone_map: ToneMap::Linear, ..Look::default() },
    }
}

fn shot(head: &Head, camera: &str) -> Outcome<Shot> {
    let text = format!(
        r#"{{ "fps": 1, "duration": 1, "camera": {camera},
        "lights": [{{ "kind": "spot", "intensity": 3, "position": [-0.75, 0.45, 0.6], "coneDegrees": [46, 62] }}],
        "environment": {{ "name": "studio", "intensity": 0.25 }} }}"#
    );
    let sequence = Sequence::from_json("lens.json", &text)?;
    Ok(Evaluator::new(head, &Rig::default_rig()?, &sequence)?.0.at(0.0))
}

/// Displayed values, 0 to 1.
fn draw(studio: &mut Studio, shot: &Shot, depth_of_field: DepthOfFieldMethod) -> Outcome<Vec<[f32; 3]>> {
    studio.cut(0);
    let frame = studio.render(std::slice::from_ref(shot), 0.0, &settings(depth_of_field))?;
    Ok(frame.picture().pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect())
}

fn light(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn shown(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// The mean over the aperture.
fn through_a_lens(studio: &mut Studio, shot: &Shot) -> Outcome<Vec<[f32; 3]>> {
    let camera = shot.camera;
    let lens = camera.lens;
    let focal_mm = 0.5 * lens.sensor_height_mm / (0.5 * camera.fov_y).tan();
    let radius = 0.5e-3 * focal_mm / lens.f_stop.unwrap_or(f32::INFINITY);
    let forward = (camera.target - camera.position).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let in_focus = camera.position + lens.focus_metres * forward;
    let mut sum = vec![[0.0; 3]; (SIDE * SIDE) as usize];
    for i in 0..CAMERAS {
        let away = radius * ((i as f32 + 0.5) / CAMERAS as f32).sqrt();
        let (sine, cosine) = (i as f32 * std::f32::consts::PI * (3.0 - 5f32.sqrt())).sin_cos();
        let mut from = shot.clone();
        // Turned instead of shifted: over this aperture the plane in focus tilts by less than two degrees.
        from.camera.position += away * (cosine * right + sine * up);
        from.camera.target = in_focus;
        from.camera.fov_y = camera.fov_y;
        for (sum, pixel) in sum.iter_mut().zip(draw(studio, &from, DepthOfFieldMethod::None)?) {
            *sum = std::array::from_fn(|c| sum[c] + light(pixel[c]) / CAMERAS as f32);
        }
    }
    Ok(sum.into_iter().map(|p| p.map(shown)).collect())
}

fn mean_flip(a: Vec<[f32; 3]>, b: Vec<[f32; 3]>) -> f32 {
    let [a, b] = [a, b].map(|linear| Pixels { width: SIDE as usize, height: SIDE as usize, linear });
    let map = flip::ldr(&a, &b, flip::PIXELS_PER_DEGREE);
    map.iter().sum::<f32>() / map.len() as f32
}

#[test]
fn blur_is_that_of_cameras_all_over_the_aperture() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = default_head();
    let mut studio = Studio::open(None)?;
    studio.set_heads([&head])?;
    let shots = [
        ("portrait", r#"{ "orbitDegrees": 35, "focalLength": 85, "fStop": 1.4 }"#),
        ("wide open", r#"{ "orbitDegrees": 35, "focalLength": 85, "fStop": 0.7 }"#),
        (
            "ear",
            r#"{ "framing": "close", "orbitDegrees": 45, "focalLength": 85, "fStop": 2, "focus": "ear-left" }"#,
        ),
    ];
    for (name, camera) in shots {
        let shot = shot(&head, camera)?;
        let right = through_a_lens(&mut studio, &shot)?;
        let sharp = draw(&mut studio, &shot, DepthOfFieldMethod::None)?;
        let found = draw(&mut studio, &shot, DepthOfFieldMethod::Gather(48))?;
        if let Some(folder) = std::env::var_os("RUBOR_KEEP_PICTURES") {
            for (what, pixels) in [("right", &right), ("found", &found), ("sharp", &sharp)] {
                let file = std::path::Path::new(&folder).join(format!("lens-{name}-{what}.png"));
                let pixel = |x, y| {
                    let p: [f32; 3] = pixels[(y * SIDE + x) as usize];
                    image::Rgb(p.map(|v| (255.0 * v).round() as u8))
                };
                image::RgbImage::from_fn(SIDE, SIDE, pixel).save(file).map_err(rubor::Failure::job)?;
            }
        }
        let (of_found, of_sharp) = (mean_flip(found, right.clone()), mean_flip(sharp, right));
        println!("{name}: FLIP {of_found:.4} with depth of field, {of_sharp:.4} without");
        // The mean of many cameras has smooth edges too, which neither picture has.
        assert!(of_found < 0.03 && of_found < of_sharp, "{name}: FLIP {of_found}, without {of_sharp}");
    }
    Ok(())
}
