//! Random rigs, sequences and qualities: frames without NaN, panic or error of the device, twice the same bytes.
//!
//! A few by default; `RUBOR_PROPERTIES=10000` (`make check-hardening`) draws more, `RUBOR_PROPERTIES=1700..10000` some of them. A failure prints its number, and
//! `RUBOR_PROPERTY=n` draws that one alone.

use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rubor::inputs::LoadedHead;
use rubor::job::InputFile;
use rubor::{Job, Plan, Studio};
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{
    AntialiasMethod, AntialiasPreset, BackdropMethod, BounceMethod, ColorMethod, CurvatureMethod,
    DepthOfFieldMethod, DetailMethod, DitherMethod, MapSaving, RasterMethod, ScatterMethod, Settings,
    SpecularMethod, ToneMap, TransmitMethod, WrinkleMethod,
};
use rubor_rig::expression::Rig;
use rubor_rig::head::{BlendShape, Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::map::Map;
use rubor_rig::random::SplitMix64;
use rubor_rig::timeline::Sequence;
use serde_json::{Value, json};

/// Shapes of the head, all of which rubor knows.
const SHAPES: [&str; 6] =
    ["jawOpen", "mouthSmileLeft", "mouthSmileRight", "eyeBlinkLeft", "eyeBlinkRight", "browInnerUp"];
const SIDE: u32 = 64;
/// Jobs in a row with the same methods: shaders of new ones take most of the time.
const JOBS_OF_METHODS: u64 = 100;

/// A bulging sheet of skin 20 cm wide, with hair, maps, zones and shapes.
fn head() -> LoadedHead {
    const N: u32 = 14;
    let mut mesh = Mesh::default();
    for i in 0..N * N {
        let uv = glam::Vec2::new((i % N) as f32, (i / N) as f32) / (N - 1) as f32;
        let p = 0.2 * (uv - 0.5);
        mesh.points.push(glam::Vec3::new(p.x, -p.y, 0.06 - 4.0 * p.length_squared()));
        mesh.vertices.push(Vertex { point: i, uv });
    }
    for i in (0..N * (N - 1)).filter(|i| i % N != N - 1) {
        mesh.triangles.push([i, i + N, i + N + 1]);
        mesh.triangles.push([i, i + N + 1, i + 1]);
    }
    let triangles = 0..mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles });
    let shape = |(k, name): (usize, &&str)| {
        let points: Vec<u32> = (0..N * N).filter(|p| *p as usize % SHAPES.len() == k).collect();
        let offsets = points.iter().map(|p| glam::Vec3::new(0.0, 0.01, 0.002 * (p % 5) as f32)).collect();
        BlendShape { name: (*name).into(), points, offsets, ..BlendShape::default() }
    };
    let stripes = |channels: u32, low: f32, high: f32| Map {
        width: 16,
        height: 16,
        channels,
        values: (0..256 * channels).map(|i| if i % 3 == 0 { low } else { high }).collect(),
    };
    let maps = SkinMaps {
        melanin: Some(stripes(1, 0.01, 0.2)),
        hemoglobin: Some(stripes(1, 0.01, 0.1)),
        hemoglobin_mean: Some(stripes(1, 0.03, 0.05)),
        slopes: Some(stripes(2, -0.4, 0.4)),
        hair: Some(stripes(1, 0.0, 0.7)),
        distributions: ["joy", "anger"]
            .map(|name| Distribution {
                name: name.into(),
                scale: stripes(1, 0.8, 1.4),
                bias: stripes(1, -0.01, 0.02),
            })
            .to_vec(),
        wrinkle_slopes: vec![stripes(2, -0.8, 0.8)],
        zones: ["forehead", "nose"]
            .map(|name| WrinkleZone { name: name.into(), wrinkle_map: 0, mask: stripes(1, 0.0, 1.0) })
            .to_vec(),
        ..SkinMaps::default()
    };
    let shapes = SHAPES.iter().enumerate().map(shape).collect();
    let head = Head { name: "sheet".into(), mesh, shapes, maps, ..Head::default() };
    head.validate().expect("a head");
    LoadedHead {
        head,
        rig: None,
        sequence: None,
        animation: None,
        source: InputFile { file: None, fingerprint: rubor::job::Fingerprint::default() },
        extent: rubor_assets::import::gltf::Extent::default(),
        notes: Vec::new(),
    }
}

struct Dice(SplitMix64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0.below(n)
    }

    fn number(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.below(10_001) as f64 / 10_000.0
    }

    fn one<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }

    /// A constant, or some keys.
    fn track(&mut self, low: f64, high: f64) -> Value {
        if self.below(2) == 0 {
            return json!(self.number(low, high));
        }
        let ease = ["linear", "smooth", "step", "easeIn", "easeOut"];
        let keys = (0..1 + self.below(4))
            .map(|k| json!({ "t": 0.07 * k as f64, "v": self.number(low, high), "ease": self.one(&ease) }));
        Value::Array(keys.collect())
    }

    fn weights(&mut self, names: &[&str], low: f64, high: f64) -> Value {
        let chosen: Vec<&str> = names.iter().copied().filter(|_| self.below(2) == 0).collect();
        Value::Object(chosen.into_iter().map(|n| (n.to_owned(), json!(self.number(low, high)))).collect())
    }
}

fn rig(dice: &mut Dice) -> Value {
    let expressions: serde_json::Map<String, Value> = (0..dice.below(4))
        .map(|i| {
            let mut expression = json!({
                "shapes": dice.weights(&SHAPES, -1.5, 2.0),
                "wrinkles": dice.weights(&["forehead", "nose"], -1.0, 1.0),
                "hemoglobin": dice.weights(&["joy", "anger"], 0.0, 0.5),
            });
            expression["hemoglobinScale"] = json!(dice.number(0.0, 4.0));
            (format!("e{i}"), expression)
        })
        .collect();
    let mut rig = json!({ "expressions": expressions, "states": { "s0": { "hemoglobinScale": dice.number(0.0, 5.0) } } });
    if dice.below(2) == 0 {
        rig["combinations"] = json!([{ "shape": "jawOpen", "drivers": ["mouthSmileLeft", "browInnerUp"] }]);
        rig["inbetweens"] =
            json!([{ "shape": "jawOpen", "target": "browInnerUp", "weight": dice.number(0.01, 0.99) }]);
    }
    rig
}

fn sequence(dice: &mut Dice, expressions: usize) -> Value {
    let tracks: serde_json::Map<String, Value> =
        (0..expressions).map(|i| (format!("e{i}"), dice.track(0.0, 2.0))).collect();
    let shapes: serde_json::Map<String, Value> = SHAPES
        .iter()
        .filter(|_| dice.below(3) == 0)
        .map(|n| (*n).to_owned())
        .collect::<Vec<_>>()
        .into_iter()
        .map(|n| (n, dice.track(-2.0, 3.0)))
        .collect();
    let kinds = ["directional", "point", "spot"];
    let lights: Vec<Value> = (0..dice.below(4))
        .map(|_| {
            let brightest = if dice.below(5) == 0 { 1e5 } else { 3.0 };
            json!({
                "kind": dice.one(&kinds), "position": [dice.number(-1.0, 1.0), dice.number(-1.0, 1.0), dice.number(-0.5, 1.0)],
                "direction": [dice.number(-1.0, 1.0), -0.3, dice.number(-1.0, 1.0)], "color": [1.0, dice.number(0.0, 1.0), 0.5],
                "intensity": dice.track(0.0, brightest), "shadow": dice.below(2) == 0,
                "coneDegrees": [dice.number(0.0, 30.0), dice.number(31.0, 120.0)],
            })
        })
        .collect();
    let mut all = json!({
        "fps": 10, "duration": 0.2, "expressions": tracks, "states": { "s0": dice.track(0.0, 2.0) }, "shapes": shapes,
        "head": { "yawDegrees": dice.track(-120.0, 120.0), "pitchDegrees": dice.track(-90.0, 90.0),
            "rollDegrees": dice.track(-180.0, 180.0) },
        "camera": { "fovDegrees": dice.track(1.0, 120.0), "orbitDegrees": dice.track(-180.0, 180.0),
            "elevationDegrees": dice.track(-89.0, 89.0) },
        "lights": lights,
        "life": { "seed": dice.below(100), "blinks": dice.number(0.0, 4.0), "saccades": dice.number(0.0, 5.0),
            "breathing": dice.number(0.0, 5.0), "sway": dice.number(0.0, 5.0) },
    });
    if dice.below(2) == 0 {
        let names = ["studio", "sky", "soft-box"];
        all["environment"] = json!({ "name": dice.one(&names), "intensity": dice.track(0.0, 4.0), "rotationDegrees": dice.track(-360.0, 360.0) });
    }
    if dice.below(3) == 0 {
        all["camera"]["fStop"] = dice.track(0.5, 128.0);
        all["camera"]["focus"] = dice.track(0.05, 30.0);
    }
    if dice.below(4) == 0 {
        // In the face, or far away.
        let distance = *dice.one(&[0.0, 0.02, 0.1, 30.0, 1e4]);
        all["camera"]["position"] = json!([0.01, 0.0, 0.05 + distance]);
        all["camera"]["target"] = json!([0.0, 0.0, 0.0]);
    }
    all
}

/// Methods drawn from `methods`; size, map sizes and exposure from `dice`.
fn settings(methods: &mut Dice, dice: &mut Dice) -> Settings {
    let mut settings = Settings::default();
    macro_rules! any {
        ($kind:ty) => {{
            let all: Vec<$kind> = <$kind>::all().collect();
            *methods.one(&all)
        }};
    }
    let output = &mut settings.output;
    output.size = [1 + dice.below(SIDE as usize) as u32, 1 + dice.below(SIDE as usize) as u32];
    if dice.below(2) == 0 {
        output.size = [SIDE; 2];
    }
    output.channels = vec![Channel::Radiance];
    let quality = &mut settings.quality;
    quality.scatter = any!(ScatterMethod);
    quality.transmit = any!(TransmitMethod);
    quality.curvature = any!(CurvatureMethod);
    quality.color = any!(ColorMethod);
    quality.wrinkles = any!(WrinkleMethod);
    quality.specular = any!(SpecularMethod);
    quality.bounce = any!(BounceMethod);
    // A processor takes over a second for what a graphics card rasterises by compute.
    quality.raster = match methods.below(8) {
        0 => RasterMethod::Compute,
        1..4 => RasterMethod::Hardware,
        _ => RasterMethod::Auto,
    };
    quality.detail = any!(DetailMethod);
    quality.depth_of_field = any!(DepthOfFieldMethod);
    quality.antialias = any!(AntialiasMethod);
    quality.antialias_preset = *methods.one(&[
        AntialiasPreset::Low,
        AntialiasPreset::Medium,
        AntialiasPreset::High,
        AntialiasPreset::Ultra,
    ]);
    quality.pre_scatter = dice.number(0.0, 1.0) as f32;
    quality.map_savings = MapSaving::ALL.into_iter().filter(|_| methods.below(2) == 0).collect();
    quality.shadow_size = *dice.one(&[16, 33, 64, 128]);
    // The reference methods and the largest maps take seconds at this size, and are tested elsewhere.
    quality.scatter = match quality.scatter {
        ScatterMethod::ReferenceSurface(_) => ScatterMethod::ReferenceSurface(1),
        ScatterMethod::TextureSpace(_) => ScatterMethod::TextureSpace(64),
        other => other,
    };
    if !matches!(quality.scatter, ScatterMethod::TextureSpace(_))
        && quality.transmit == TransmitMethod::TranslucentShadowMap
    {
        quality.transmit = TransmitMethod::ShadowDepth;
    }
    settings.look.exposure = *dice.one(&[0.0, 1.0, 1.8, 1e6]);
    let look = &mut settings.look;
    look.tone_map = any!(ToneMap);
    look.dither = any!(DitherMethod);
    look.backdrop = any!(BackdropMethod);
    if methods.below(2) == 0 {
        (look.bloom, look.bloom_radius) = (dice.number(0.0, 1.0) as f32, dice.number(0.002, 1.0) as f32);
        (look.grain, look.grain_size) = (dice.number(0.0, 100.0) as f32, dice.number(1.0, 200.0) as f32);
        (look.vignette, look.fade) = (dice.number(0.0, 16.0) as f32, dice.number(0.0, 500.0) as f32);
        (look.temperature, look.tint) =
            (dice.number(1500.0, 15000.0) as f32, dice.number(-150.0, 150.0) as f32);
    }
    settings
}

fn can_draw() -> Option<Studio> {
    match Studio::open(None) {
        Ok(studio) => Some(studio),
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            writeln!(std::io::stderr(), "SKIPPED: {error}").expect("stderr is open");
            None
        }
    }
}

/// Draws two frames; their pictures, or why there are none.
fn drawn(studio: &mut Studio, job: &Job, heads: &[LoadedHead]) -> Result<Vec<Vec<u8>>, String> {
    let plan = Plan::new(job, heads).map_err(|e| e.to_string())?;
    let mut pictures = Vec::new();
    let mut odd = None;
    plan.draw(studio, plan.frames(), |shown| {
        for data in &shown.drawn.channels {
            if let Some(v) = data.values.iter().find(|v| !v.is_finite()) {
                odd = Some(format!("{v} in {} of frame {}", data.channel.name(), shown.frame));
            }
        }
        if std::env::var_os("RUBOR_PROPERTY").is_some() {
            let mut passes = shown.drawn.stats.passes_ms.clone();
            passes.sort_by(|a, b| b.1.total_cmp(&a.1));
            println!(
                "frame {}: {:?} of {}",
                shown.frame,
                &passes[..passes.len().min(5)],
                shown.drawn.stats.frame_ms
            );
        }
        pictures.push(shown.drawn.image.rgba);
        Ok(())
    })
    .map_err(|e| e.to_string())?;
    odd.map_or(Ok(pictures), Err)
}

#[test]
fn random_frames_are_finite_and_repeat() {
    let Some(mut studio) = can_draw() else { return };
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let (range, step) = match (number("RUBOR_PROPERTY"), std::env::var("RUBOR_PROPERTIES")) {
        (Some(one), _) => (one..one + 1, 1),
        (None, Ok(text)) => {
            (range_of(&text).expect("RUBOR_PROPERTIES is a number, or two with .. between"), 1)
        }
        // Each with methods of its own.
        (None, Err(_)) => (0..6 * JOBS_OF_METHODS, JOBS_OF_METHODS as usize),
    };
    let seconds = number("RUBOR_PROPERTY_SECONDS").unwrap_or(u64::MAX);
    let start = std::time::Instant::now();
    let heads = [head()];
    studio.set_heads([&heads[0].head]).expect("the head fits");
    let (mut count, mut refused, mut faults) = (0, 0, Vec::new());
    for case in range.step_by(step) {
        if start.elapsed().as_secs() >= seconds {
            break;
        }
        let mut dice = Dice(SplitMix64(case));
        let mut methods = Dice(SplitMix64(u64::MAX - case / JOBS_OF_METHODS));
        let rig_json = rig(&mut dice);
        let expressions = rig_json["expressions"].as_object().map_or(0, serde_json::Map::len);
        let sequence_json = sequence(&mut dice, expressions);
        let made = (|| -> Result<Job, String> {
            let rig = Rig::from_json("rig", &rig_json.to_string()).map_err(|e| e.to_string())?;
            let sequence = Sequence::from_json("s", &sequence_json.to_string()).map_err(|e| e.to_string())?;
            let mut job = Job::new(&heads, rig, sequence).map_err(|e| e.to_string())?;
            job.settings = settings(&mut methods, &mut dice);
            Ok(job)
        })();
        count += 1;
        let job = match made {
            Ok(job) => job,
            Err(why) => {
                faults.push(format!("{case}: the generator makes what is refused: {why}"));
                continue;
            }
        };
        if number("RUBOR_PROPERTY").is_some() {
            println!("{}", serde_json::to_string(&job.settings).unwrap_or_default());
        }
        let about = || format!("{case}: {}", serde_json::to_string(&job.settings).unwrap_or_default());
        let twice = catch_unwind(AssertUnwindSafe(|| {
            (drawn(&mut studio, &job, &heads), drawn(&mut studio, &job, &heads))
        }));
        match twice {
            Err(_) => {
                faults.push(format!("{}: panic", about()));
                studio = can_draw().expect("a device");
                studio.set_heads([&heads[0].head]).expect("the head fits");
            }
            Ok((Ok(a), Ok(b))) if a == b => {}
            Ok((Ok(_), Ok(_))) => faults.push(format!("{}: the second time has other bytes", about())),
            // Combinations that a method cannot draw are refused in words.
            Ok((Err(why), _)) if why.contains("expected") || why.contains("can:") => {
                refused += 1;
                if range_is_loud() {
                    println!("{case}: refused: {why}");
                }
            }
            Ok((Err(why), _) | (_, Err(why))) => faults.push(format!("{}: {why}", about())),
        }
    }
    if range_is_loud() {
        println!(
            "{count} random jobs of two frames, drawn twice: {refused} refused, {} faults",
            faults.len()
        );
    }
    assert!(faults.is_empty(), "{} faults of {count}:\n{}", faults.len(), faults.join("\n"));
}

/// `10000`, or `1700..10000` to go on from a run that was stopped or to share the work.
fn range_of(text: &str) -> Option<std::ops::Range<u64>> {
    match text.split_once("..") {
        Some((first, end)) => Some(first.parse().ok()?..end.parse().ok()?),
        None => Some(0..text.parse().ok()?),
    }
}

fn range_is_loud() -> bool {
    std::env::var_os("RUBOR_PROPERTIES").is_some() || std::env::var_os("RUBOR_PROPERTY").is_some()
}
