//! Levels of the default head: what they save, what they change in a picture, and that nothing pops in a slow zoom.

use glam::Vec3;
use rubor::{Outcome, Studio};
use rubor_assets::compare::{Pixels, flip};
use rubor_assets::import;
use rubor_renderer::settings::{AntialiasMethod, DetailMethod, Output, Quality, ScatterMethod, Settings};
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use rubor_tests::can_draw;

const SIDE: u32 = 96;

fn default_head() -> Head {
    let bytes = include_bytes!("../../assets/head.glb");
    import::gltf::from_bytes(bytes, "head.glb".as_ref()).expect("the default head is readable").head
}

fn settings(detail: DetailMethod) -> Settings {
    Settings {
        output: Output { size: [SIDE; 2], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::Separable(17),
            antialias: AntialiasMethod::Smaa1x,
            shadow_size: 512,
            detail,
            ..Quality::default()
        },
        ..Settings::default()
    }
}

/// A smiling head from a distance, in a field of view of 22 degrees.
fn shot(head: &Head, metres: f32) -> Outcome<Shot> {
    let text = r#"{ "fps": 1, "duration": 1, "expressions": { "joy": 1 },
        "camera": { "position": [0.1, -0.01, 1], "target": [0, -0.035, 0], "fovDegrees": 22 },
        "lights": [{ "kind": "spot", "intensity": 4, "position": [0.75, 0.45, 0.6], "coneDegrees": [46, 62] }],
        "environment": { "name": "studio", "intensity": 0.1 } }"#;
    let sequence = Sequence::from_json("zoom.json", text)?;
    let mut shot = Evaluator::new(head, &Rig::default_rig()?, &sequence)?.0.at(0.0);
    let away = (shot.camera.position - shot.camera.target).normalize();
    shot.camera.position = shot.camera.target + metres * away;
    Ok(shot)
}

struct Drawn {
    pixels: Pixels,
    triangles: u64,
}

fn draw(studio: &mut Studio, shot: &Shot, detail: DetailMethod) -> Outcome<Drawn> {
    studio.cut(0);
    let frame = studio.render(std::slice::from_ref(shot), 0.0, &settings(detail))?;
    let linear = frame.picture().pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect();
    Ok(Drawn {
        pixels: Pixels { width: SIDE as usize, height: SIDE as usize, linear },
        triangles: frame.stats.triangles,
    })
}

#[test]
fn a_small_head_needs_few_triangles_and_looks_the_same() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = default_head();
    let mut studio = Studio::open(None)?;
    studio.set_heads([&head])?;
    // Triangles over all of them, and the largest mean FLIP over the picture, from which distance.
    let mut missed = Vec::new();
    for (metres, share, most) in
        [(0.62, 0.75, 0.011), (2.0, 0.4, 0.004), (4.0, 0.3, 0.002), (8.0, 0.25, 0.001)]
    {
        let shot = shot(&head, metres)?;
        let [full, auto] = [DetailMethod::Full, DetailMethod::Auto].map(|d| draw(&mut studio, &shot, d));
        let (full, auto) = (full?, auto?);
        let map = flip::ldr(&auto.pixels, &full.pixels, flip::PIXELS_PER_DEGREE);
        let mean = map.iter().sum::<f32>() / map.len() as f32;
        let found = auto.triangles as f32 / full.triangles as f32;
        eprintln!("{metres} m: {found:.2} of the triangles, FLIP {mean:.5}");
        if found > share || mean > most {
            missed.push(format!("{metres} m: {found} of the triangles, FLIP {mean}"));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
    Ok(())
}

#[test]
fn nothing_pops_in_a_slow_zoom() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = default_head();
    let mut studio = Studio::open(None)?;
    studio.set_heads([&head])?;
    let mut run = |detail| -> Outcome<(Vec<Drawn>, usize)> {
        let mut frames = Vec::new();
        for step in 0..40 {
            frames.push(draw(&mut studio, &shot(&head, 0.45 * 1.04f32.powi(step))?, detail)?);
        }
        let switches = frames.windows(2).filter(|w| w[0].triangles != w[1].triangles).count();
        Ok((frames, switches))
    };
    let ((full, none), (auto, switches)) = (run(DetailMethod::Full)?, run(DetailMethod::Auto)?);
    assert_eq!(none, 0);
    assert!((2..8).contains(&switches), "{switches} switches");
    let change = |frames: &[Drawn]| -> Vec<f32> {
        let of = |w: &[Drawn]| {
            let (a, b) = (&w[0].pixels.linear, &w[1].pixels.linear);
            let sum: f32 =
                a.iter().zip(b).map(|(a, b)| Vec3::from(*a).distance_squared(Vec3::from(*b))).sum();
            (sum / a.len() as f32).sqrt()
        };
        frames.windows(2).map(of).collect()
    };
    let (of_full, of_auto) = (change(&full), change(&auto));
    let largest = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
    eprintln!("largest change {} and {}", largest(&of_full), largest(&of_auto));
    assert!(largest(&of_auto) < 1.05 * largest(&of_full), "{of_auto:?}, {of_full:?}");
    for (i, (auto, full)) in of_auto.iter().zip(&of_full).enumerate() {
        assert!(*auto < 1.25 * full, "step {i}: {auto} and {full}");
    }
    Ok(())
}
