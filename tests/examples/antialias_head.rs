//! Antialiasing of the default head: error of every mode at rest, and of a head that turns and talks.
//!
//! Prints the tables of `docs/antialiasing.md`: `antialias_head [rest|motion|all] [FOLDER]`. With a folder, frames of
//! the turning head are written into it. `RUBOR_FRAMES` (default 120) sets their number.

use std::path::PathBuf;

use glam::{Quat, Vec3};
use rubor::studio::Frame;
use rubor::{Studio, inputs};
use rubor_renderer::Image;
use rubor_renderer::antialias::reference::linear_from_srgb;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{AntialiasMethod, Output, Quality, ScatterMethod, Settings, TransmitMethod};
use rubor_rig::evaluate::{CameraState, EnvironmentState, LightState, Shot};
use rubor_rig::face_state::FaceState;
use rubor_rig::framing::FaceFrame;
use rubor_rig::timeline::LightKind;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Pixels on a side.
const SIDE: u32 = 192;
/// Samples on a side of a pixel for the truth at rest and in motion.
const SAMPLES: [u32; 2] = [8, 4];
/// Contrast of luma that makes a pixel count as one at an edge: the threshold of the preset.
const EDGE: f32 = 0.1;

/// Pictures, and the motion of each of their pixels.
type Film = (Vec<Image>, Vec<Vec<[f32; 2]>>);

/// The filters; supersampling is what they are compared with.
fn modes() -> Vec<AntialiasMethod> {
    AntialiasMethod::all().filter(|m| m.number().is_none()).collect()
}

fn settings(antialias: AntialiasMethod) -> Settings {
    Settings {
        output: Output { size: [SIDE; 2], ..Output::default() },
        quality: Quality {
            // What scatters has no edges.
            scatter: ScatterMethod::None,
            transmit: TransmitMethod::None,
            antialias,
            shadow_size: 512,
            ..Quality::default()
        },
        ..Settings::default()
    }
}

fn camera(position: Vec3, target: Vec3) -> CameraState {
    CameraState { position, target, up: Vec3::Y, fov_y: 24f32.to_radians(), lens: Default::default() }
}

/// Light of each pixel.
fn light(image: &Image) -> Vec<[f32; 3]> {
    let value = |byte: u8| linear_from_srgb(f32::from(byte) / 255.0);
    image.rgba.chunks(4).map(|p| [value(p[0]), value(p[1]), value(p[2])]).collect()
}

/// Pixels of an image without antialiasing that have an edge, and their neighbours.
fn at_edges(image: &Image) -> Vec<bool> {
    let side = SIDE as usize;
    let luma = |i: usize| {
        let p = &image.rgba[4 * i..];
        (0.2126 * f32::from(p[0]) + 0.7152 * f32::from(p[1]) + 0.0722 * f32::from(p[2])) / 255.0
    };
    let mut found = vec![false; side * side];
    for i in 0..side * side {
        for (other, inside) in [(i + 1, i % side + 1 < side), (i + side, i + side < side * side)] {
            if inside && (luma(i) - luma(other)).abs() >= EDGE {
                found[i] = true;
                found[other] = true;
            }
        }
    }
    found
}

fn rms(a: &[[f32; 3]], b: &[[f32; 3]], counts: &[bool]) -> (f64, f64) {
    let squares = a
        .iter()
        .zip(b)
        .zip(counts)
        .filter(|(_, counts)| **counts)
        .flat_map(|((a, b), _)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).collect::<Vec<_>>());
    squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0))
}

/// The face of frame `frame`: the head turns to both sides and nods, the jaw and the lips move as in speech.
fn talking(head: &rubor_rig::head::Head, frame: u32) -> FaceState {
    let seconds = frame as f32 / 30.0;
    let mut state = FaceState::neutral(head);
    let mut set = |name: &str, weight: f32| {
        if let Some(i) = head.shapes.iter().position(|shape| shape.name == name) {
            state.shapes[i] = weight.clamp(0.0, 1.0);
        }
    };
    let wave = |hertz: f32| 0.5 + 0.5 * (std::f32::consts::TAU * hertz * seconds).sin();
    set("jawOpen", 0.6 * wave(3.1));
    set("mouthFunnel", 0.5 * wave(1.7));
    set("mouthSmileLeft", 0.4 * wave(0.6));
    set("mouthSmileRight", 0.4 * wave(0.6));
    set("browInnerUp", 0.7 * wave(0.5));
    let blink = if frame % 45 < 6 { 1.0 } else { 0.0 };
    set("eyeBlinkLeft", blink);
    set("eyeBlinkRight", blink);
    let yaw = 0.7 * (std::f32::consts::TAU * 0.25 * seconds).sin();
    state.head_rotation = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(0.12 * (2.3 * seconds).sin());
    state
}

struct Stage {
    studio: Studio,
    head: rubor_rig::head::Head,
}

impl Stage {
    fn new() -> Result<Self> {
        let mut studio = Studio::open(None)?;
        let head = inputs::head(None)?.head;
        studio.set_heads([&head])?;
        Ok(Self { studio, head })
    }

    fn draw(&mut self, state: &FaceState, camera: CameraState, settings: &Settings) -> Result<Frame> {
        let key = LightState {
            name: "key".into(),
            kind: LightKind::Directional,
            power_linear: Vec3::splat(1.1),
            position: Vec3::ZERO,
            direction: Vec3::new(-0.6, -0.5, -0.8).normalize(),
            cone_half_angles: [0.0; 2],
            radius: 0.05,
            shadow: true,
        };
        let environment = EnvironmentState { name: "studio".into(), intensity: 0.6, rotation_y: 0.0 };
        let shot = Shot {
            time_s: 0.0,
            frame: 0,
            place: FaceFrame { origin: Vec3::ZERO, head_height: 0.23 },
            face: state.clone(),
            camera,
            lights: vec![key],
            environment: Some(environment),
        };
        Ok(self.studio.render(&[shot], 0.0, settings)?)
    }
}

fn main() -> Result<()> {
    let mut stage = Stage::new()?;
    println!("adapter: {}", stage.studio.adapter().name);
    let part = std::env::args().nth(1).unwrap_or_else(|| "all".to_owned());
    if part != "motion" {
        at_rest(&mut stage)?;
    }
    if part != "rest" {
        in_motion(&mut stage, std::env::args().nth(2).map(PathBuf::from))?;
    }
    Ok(())
}

fn at_rest(stage: &mut Stage) -> Result<()> {
    let neutral = FaceState::neutral(&stage.head);
    let (low, high) =
        stage.head.mesh.points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let middle = 0.5 * (low + high);
    let eyes = middle + Vec3::new(0.03, 0.02, 0.5 * (high.z - low.z));
    let modes = modes();
    let names: Vec<&str> = modes.iter().map(|m| m.name()).collect();
    println!("\n| view | {} |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(modes.len()));
    for (name, position, target) in [
        ("from the front", middle + Vec3::new(0.0, 0.0, 0.9), middle),
        ("from the side", middle + Vec3::new(0.75, 0.05, 0.5), middle),
        ("far", middle + Vec3::new(-0.6, 0.1, 2.2), middle),
        ("eye", eyes + Vec3::new(0.02, 0.0, 0.25), eyes),
    ] {
        let mut sums = vec![(0.0, 0.0); modes.len()];
        // The view is moved by parts of a pixel.
        for (dx, dy) in [(0.0, 0.0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.87)] {
            let distance = (position - target).length();
            let pixel = 2.0 * distance * 12f32.to_radians().tan() / SIDE as f32;
            let shift = Vec3::new(dx * pixel, dy * pixel, 0.0);
            let camera = camera(position + shift, target + shift);
            stage.studio.cut(0);
            let mut draw =
                |settings: &Settings| -> Result<Image> { Ok(stage.draw(&neutral, camera, settings)?.image) };
            let truth = light(&draw(&settings(AntialiasMethod::Ssaa(SAMPLES[0])))?);
            let counts = at_edges(&draw(&settings(AntialiasMethod::None))?);
            for (&mode, sum) in modes.iter().zip(&mut sums) {
                stage.studio.cut(0);
                let mut image = stage.draw(&neutral, camera, &settings(mode))?.image;
                for _ in 0..if mode.is_temporal() { 2 } else { 0 } {
                    image = stage.draw(&neutral, camera, &settings(mode))?.image;
                }
                let (square, count) = rms(&light(&image), &truth, &counts);
                *sum = (sum.0 + square, sum.1 + count);
            }
        }
        let cells: Vec<String> =
            sums.iter().map(|(square, count)| format!("{:.4}", (square / count).sqrt())).collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
    Ok(())
}

/// Mean absolute difference of light between a frame and the previous one moved by the velocities, at edges.
fn flicker(now: &[[f32; 3]], before: &[[f32; 3]], velocity: &[[f32; 2]], counts: &[bool]) -> f64 {
    let side = SIDE as usize;
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, counts) in counts.iter().enumerate() {
        let [x, y] = [i % side, i / side].map(|v| v as f32);
        let origin = [x - velocity[i][0], y - velocity[i][1]];
        if !counts || origin.iter().any(|v| *v < 0.0 || *v > (side - 1) as f32) {
            continue;
        }
        let base = origin.map(|v| (v.floor() as usize).min(side - 2));
        let part = [origin[0] - base[0] as f32, origin[1] - base[1] as f32];
        for c in 0..3 {
            let at = |x: usize, y: usize| before[(base[1] + y) * side + base[0] + x][c];
            let row = |y: usize| at(0, y) + (at(1, y) - at(0, y)) * part[0];
            let previous = row(0) + (row(1) - row(0)) * part[1];
            sum += f64::from((now[i][c] - previous).abs());
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

fn in_motion(stage: &mut Stage, folder: Option<PathBuf>) -> Result<()> {
    let frames: u32 = std::env::var("RUBOR_FRAMES").ok().and_then(|n| n.parse().ok()).unwrap_or(120);
    let (low, high) =
        stage.head.mesh.points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let middle = 0.5 * (low + high);
    let camera = camera(middle + Vec3::new(0.0, 0.0, 0.9), middle);
    // T2x first: it knows the velocities. Then the truth, which all are compared with.
    let mut sequence = |mode: AntialiasMethod| -> Result<Film> {
        stage.studio.cut(0);
        let (mut images, mut velocities) = (Vec::new(), Vec::new());
        let mut settings = settings(mode);
        if mode == AntialiasMethod::SmaaT2x {
            settings.output.channels.push(Channel::Velocity);
        }
        for frame in 0..frames {
            let state = talking(&stage.head, frame);
            let drawn = stage.draw(&state, camera, &settings)?;
            images.push(drawn.image);
            velocities.extend(drawn.channels.first().map(|velocity| velocity.texels().collect()));
        }
        Ok((images, velocities))
    };
    let (t2x, velocities) = sequence(AntialiasMethod::SmaaT2x)?;
    let (plain, _) = sequence(AntialiasMethod::None)?;
    let masks: Vec<Vec<bool>> = plain.iter().map(at_edges).collect();
    let (truth, _) = sequence(AntialiasMethod::Ssaa(SAMPLES[1]))?;
    let truth: Vec<Vec<[f32; 3]>> = truth.iter().map(light).collect();
    let change = |images: &[Vec<[f32; 3]>]| {
        let pairs = images.windows(2).zip(&velocities[1..]).zip(&masks[1..]);
        let sum: f64 =
            pairs.map(|((pair, velocity), mask)| flicker(&pair[1], &pair[0], velocity, mask)).sum();
        sum / f64::from(frames - 1)
    };
    let reference = change(&truth);
    println!("\n{frames} frames, warped difference of frames at edges; ssaa:{} {reference:.5}", SAMPLES[1]);
    println!("| mode | over ssaa:{} | error to ssaa:{} |", SAMPLES[1], SAMPLES[1]);
    println!("| --- | --- | --- |");
    for mode in modes() {
        let images = match mode {
            AntialiasMethod::SmaaT2x => t2x.clone(),
            AntialiasMethod::None => plain.clone(),
            _ => sequence(mode)?.0,
        };
        let lights: Vec<_> = images.iter().map(light).collect();
        let (square, count) = lights
            .iter()
            .zip(&truth)
            .zip(&masks)
            .skip(1)
            .map(|((image, truth), mask)| rms(image, truth, mask))
            .fold((0.0, 0.0), |sum, e| (sum.0 + e.0, sum.1 + e.1));
        println!("| {} | {:.5} | {:.4} |", mode.name(), change(&lights) - reference, (square / count).sqrt());
        if let Some(folder) = &folder {
            for (frame, image) in images.iter().enumerate().filter(|(frame, _)| frame % 12 == 7) {
                let path = folder.join(format!("{}.{frame:03}.png", mode.name()));
                image::save_buffer(path, &image.rgba, SIDE, SIDE, image::ExtendedColorType::Rgba8)?;
            }
        }
    }
    Ok(())
}
