//! `rubor check --budget` as a person uses it, on a small head: a dome with a smile, a frown and a jaw.

mod support;

use std::path::Path;
use std::process::{Command, Output};

use glam::{Vec2, Vec3};
use rubor::auto::Bound;
use rubor::measure::budget::{self, Options, Scene};
use rubor::{Studio, inputs};
use rubor_assets::compare::{Pixels, flip};
use rubor_assets::export::gltf;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{Preset, Settings};
use rubor_rig::color::srgb_decode;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::{BlendShape, Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::map::Map;
use rubor_rig::timeline::Sequence;
use serde_json::Value;

const RIG: &str = r#"{
    "expressions": {
        "joy": { "shapes": { "mouthSmile": 1, "jawOpen": 0.002 }, "hemoglobin": { "joy": 1 } },
        "anger": { "shapes": { "browDown": 1 }, "wrinkles": { "forehead": 1 }, "hemoglobin": { "anger": 1 } },
        "yawn": { "shapes": { "jawOpen": 1 } }
    },
    "states": { "blush": { "hemoglobin": { "anger": 0.5 }, "hemoglobinScale": 1.1 } },
    "combinations": [{ "shape": "smileFrown", "drivers": ["mouthSmileLeft", "browDownLeft"] }]
}"#;
const CLOSE: &str = r#""camera": { "framing": "close" },
    "lights": [{ "kind": "spot", "intensity": 3, "position": [0.6, 0.5, 0.4] }]"#;

/// Points on a side of the dome.
const SIDE: u32 = 25;

fn map(side: u32, channels: usize, texel: impl Fn(f32, f32) -> [f32; 2]) -> Map {
    let at = |i: u32| (i as f32 + 0.5) / side as f32;
    let values =
        (0..side * side).flat_map(|i| texel(at(i % side), at(i / side))[..channels].to_vec()).collect();
    Map { width: side, height: side, channels: channels as u32, values }
}

/// A dome of 20 cm with its pole towards the camera, and a bead on its back.
fn head() -> Head {
    let place = |i: u32| Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) / (SIDE - 1) as f32;
    let dome = |uv: Vec2| {
        let xy = (uv - 0.5) * Vec2::new(0.2, -0.24);
        xy.extend(0.1 * (1.0 - (2.0 * (uv - 0.5)).length_squared() / 2.0))
    };
    let count = SIDE * SIDE;
    let mut triangles: Vec<[u32; 3]> = (0..(SIDE - 1) * (SIDE - 1))
        .flat_map(|i| {
            let a = i / (SIDE - 1) * SIDE + i % (SIDE - 1);
            [[a, a + SIDE, a + 1], [a + 1, a + SIDE, a + SIDE + 1]]
        })
        .collect();
    let skin = triangles.len() as u32;
    // Within the dome, where no camera of the tests sees it.
    triangles.push([count, count + 1, count + 2]);
    let mut points: Vec<Vec3> = (0..count).map(|i| dome(place(i))).collect();
    points.extend([Vec3::ZERO, Vec3::new(0.01, 0.0, 0.0), Vec3::new(0.0, 0.01, 0.0)]);
    let vertices = (0..count + 3).map(|point| Vertex { point, uv: place(point.min(count - 1)) }).collect();
    // Moves the points near a place.
    let shape = |name: &str, at: [f32; 2], by: [f32; 3]| {
        let share = |i: &u32| (1.0 - 6.0 * place(*i).distance(Vec2::from(at))).max(0.0);
        let moved: Vec<u32> = (0..count).filter(|i| share(i) > 0.0).collect();
        BlendShape {
            name: name.into(),
            offsets: moved.iter().map(|i| Vec3::from(by) * share(i)).collect(),
            points: moved,
            ..BlendShape::default()
        }
    };
    let noise = |u: f32, v: f32| ((u * 311.0).sin() * (v * 273.0).cos()).abs();
    let distribution = |name: &str, bias: f32| Distribution {
        name: name.into(),
        scale: map(8, 1, |_, _| [1.0, 0.0]),
        bias: map(8, 1, |u, v| [bias * (0.6 + 0.4 * (5.0 * u + 3.0 * v).sin()), 0.0]),
    };
    Head {
        name: "dome".into(),
        mesh: Mesh {
            occlusion: vec![1.0; points.len()],
            points,
            vertices,
            triangles,
            parts: vec![
                Part { name: "dome".into(), material: Material::Skin, triangles: 0..skin },
                Part { name: "bead".into(), material: Material::Teeth, triangles: skin..skin + 1 },
            ],
        },
        shapes: vec![
            shape("mouthSmileLeft", [0.65, 0.7], [0.012, 0.012, 0.01]),
            shape("mouthSmileRight", [0.35, 0.7], [-0.012, 0.012, 0.01]),
            shape("browDownLeft", [0.62, 0.3], [0.0, -0.012, 0.012]),
            shape("browDownRight", [0.38, 0.3], [0.0, -0.012, 0.012]),
            shape("jawOpen", [0.5, 0.85], [0.0, -0.02, -0.01]),
            shape("smileFrown", [0.6, 0.5], [0.0, 0.0, 0.01]),
        ],
        maps: SkinMaps {
            melanin: Some(map(32, 1, |u, v| [0.02 + 0.01 * noise(u, v), 0.0])),
            hemoglobin: Some(map(32, 1, |u, v| [0.03 + 0.02 * noise(v, u), 0.0])),
            hemoglobin_mean: Some(map(8, 1, |_, _| [0.04, 0.0])),
            distributions: vec![distribution("joy", 0.08), distribution("anger", 0.14)],
            slopes: Some(map(32, 2, |u, v| [0.1 * (90.0 * u).sin(), 0.1 * (70.0 * v).cos()])),
            wrinkle_slopes: vec![map(32, 2, |_, v| [0.0, 0.9 * (60.0 * v).sin()])],
            zones: vec![WrinkleZone {
                name: "forehead".into(),
                wrinkle_map: 0,
                mask: map(8, 1, |_, v| [if v < 0.5 { 1.0 } else { 0.0 }, 0.0]),
            }],
            ..SkinMaps::default()
        },
        ..Head::default()
    }
}

/// Small pictures with small shadow maps: what is tested is what goes, not how skin looks.
const DRAFT: [&str; 6] = ["--size", "96x96", "--preset", "draft", "--shadow-size", "256"];

fn draft() -> Settings {
    let mut settings = Settings { quality: Preset::Draft.quality(), ..Settings::default() };
    settings.quality.shadow_size = 256;
    settings.output.size = [96, 96];
    settings
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(head: &Head, rig: &str) -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        let rig = Rig::from_json("rig.json", rig).expect("a rig");
        let options = gltf::Options { rig: Some(&rig), color_map_size: 64, ..gltf::Options::default() };
        gltf::write(head, &options, Path::new(&folder.path("head.glb"))).expect("a head");
        folder
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    fn sequence(&self, name: &str, text: &str) -> String {
        let path = self.path(name);
        std::fs::write(&path, format!(r#"{{ "fps": 4, "duration": 1, {text}, {CLOSE} }}"#))
            .expect("a sequence");
        path
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_rubor")).args(arguments).output().expect("the command starts")
    }

    /// The report of a budget of the head at 96 x 96.
    fn budget(&self, sequences: &[&str], more: &[&str]) -> Value {
        let head = self.path("head.glb");
        let mut arguments = vec!["check", "--budget", "--head", &head, "--json", "--rounds", "0"];
        sequences.iter().for_each(|s| arguments.extend(["--sequence", s]));
        let output = self.run(&[&arguments[..], &DRAFT[..], more].concat());
        assert!(output.status.success(), "{more:?} said {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("the output is JSON")
    }

    fn refused(&self, arguments: &[&str], phrases: &[&str]) {
        let output = self.run(&[&["check"], arguments].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?} said {said}");
        for phrase in phrases {
            assert!(said.contains(phrase), "{arguments:?} said {said:?}, expected {phrase:?}");
        }
    }
}

/// Fates by kind and name.
fn fate<'a>(report: &'a Value, kind: &str, name: &str) -> &'a str {
    let items = report["items"].as_array().expect("items");
    let item = items.iter().find(|i| i["kind"] == kind && i["name"] == name);
    item.and_then(|i| i["fate"].as_str()).unwrap_or_else(|| panic!("no {kind} {name}"))
}

fn number(report: &Value, path: &str) -> f64 {
    report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path}"))
}

const JOY: &str = r#""expressions": { "joy": [{ "t": 0, "v": 0 }, { "t": 0.75, "v": 1 }] }"#;
const ANGER: &str = r#""expressions": { "anger": 1 }"#;

#[test]
fn a_smile_needs_no_frown_and_the_stated_error_is_that_of_the_file() {
    if !support::can_draw() {
        return;
    }
    let folder = Folder::new(&head(), RIG);
    let joy = folder.sequence("joy.json", JOY);
    let reduced = folder.path("reduced.glb");
    let report = folder.budget(&[&joy], &["-o", &reduced, "--max-error", "flip=0.01"]);
    for (kind, name) in [
        ("shape", "browDownLeft"),
        ("shape", "browDownRight"),
        ("shape", "smileFrown"),
        ("distribution", "anger"),
        ("zone", "forehead"),
    ] {
        assert_eq!(fate(&report, kind, name), "unused", "{name}");
    }
    // A tenth of a pixel of the jaw, and a bead that is never seen.
    assert_eq!(fate(&report, "shape", "jawOpen"), "gone");
    assert_eq!(fate(&report, "part", "bead"), "gone");
    for name in ["mouthSmileLeft", "mouthSmileRight"] {
        assert_eq!(fate(&report, "shape", name), "needed", "{name}");
    }
    assert_eq!(report["written"], reduced.as_str());

    let read = inputs::head(Some(Path::new(&reduced))).expect("it reads");
    let names: Vec<&str> = read.head.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["mouthSmileLeft", "mouthSmileRight"]);
    assert!(read.head.maps.zones.is_empty() && read.head.maps.wrinkle_slopes.is_empty());
    let rig = read.rig.expect("its rig");
    // Yawn lost its jaw and anger all but nothing; blush has its scale.
    assert_eq!(rig.expressions.keys().collect::<Vec<_>>(), ["joy"]);
    assert_eq!(rig.states.keys().collect::<Vec<_>>(), ["blush"]);
    assert!(rig.combinations.is_empty() && rig.expressions["joy"].shapes.len() == 1);
    let notes = report["notes"].to_string();
    assert!(
        notes.contains("anger, yawn: nothing of these is left") && notes.contains("smileFrown"),
        "{notes}"
    );
    let checked = folder.run(&["check", &reduced, &joy, "--strict"]);
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stdout));

    let frames: Vec<u32> = report["sequences"][0]["lookedAt"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|f| Some(f.as_u64()? as u32))
        .collect();
    assert_eq!(frames, [1, 2, 3, 4]);
    let found = errors(&folder.path("head.glb"), &reduced, &joy, &frames);
    let largest = found.iter().copied().fold(0.0, f64::max);
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    assert!((largest - number(&report, "/error/largest")).abs() < 1e-9, "{found:?} {}", report["error"]);
    assert!((mean - number(&report, "/error/mean")).abs() < 1e-9);
    assert!(largest > 0.0 && largest <= 0.01, "{largest}");
    for total in ["deviceBytes", "fileBytes"] {
        let [whole, less] = ["whole", "reduced"].map(|of| number(&report, &format!("/{of}/{total}")));
        assert!(less < whole, "{total}: {less} of {whole}");
    }
    let bytes = std::fs::metadata(&reduced).expect("a file").len() as f64;
    assert_eq!(number(&report, "/reduced/fileBytes"), bytes);
    let came = std::fs::metadata(folder.path("head.glb")).expect("a file").len() as f64;
    assert_eq!(number(&report, "/inputBytes"), came);
}

/// A picture, and its pixels that count.
type Seen = (Pixels, Vec<bool>);

/// Mean FLIP over the first head and the pixels around it, for each frame: written apart from the library's.
fn errors(whole: &str, reduced: &str, sequence: &str, frames: &[u32]) -> Vec<f64> {
    let mut studio = Studio::open(None).expect("a device");
    let mut settings = draft();
    settings.output.channels = vec![Channel::Radiance];
    let (sequence, _) = inputs::sequence(Some(Path::new(sequence))).expect("a sequence");
    let mut draw = |path: &str| -> Vec<Seen> {
        let loaded = inputs::head(Some(Path::new(path))).expect("a head");
        let rig = loaded.rig.expect("a rig");
        let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence).expect("it fits");
        studio.set_heads([&loaded.head]).expect("it fits the device");
        let one = |frame: &u32| {
            studio.cut(0);
            let shot = evaluator.at(evaluator.frame_time_s(frame - 1));
            let frame = studio.render(&[shot], 0.0, &settings).expect("it draws");
            let decode = |p: &[u8]| [0, 1, 2].map(|c| srgb_decode(f32::from(p[c]) / 255.0));
            let linear = frame.image.rgba.chunks_exact(4).map(decode).collect();
            let samples = settings.samples_per_side() as usize;
            let covered: Vec<bool> = frame.channels[0].texels::<4>().map(|p| p[3] > 0.0).collect();
            let any = |x: i32, y: i32| {
                let inside = (0..96).contains(&x) && (0..96).contains(&y);
                let at = |s: usize| {
                    let (row, column) =
                        (y as usize * samples + s / samples, x as usize * samples + s % samples);
                    covered[row * 96 * samples + column]
                };
                inside && (0..samples * samples).any(at)
            };
            let near = |i: i32| (0..9).any(|k| any(i % 96 + k % 3 - 1, i / 96 + k / 3 - 1));
            (Pixels { width: 96, height: 96, linear }, (0..96 * 96).map(near).collect::<Vec<bool>>())
        };
        frames.iter().map(one).collect()
    };
    let (right, test) = (draw(whole), draw(reduced));
    let error = |((right, counts), (test, _)): (&Seen, &Seen)| {
        let map = flip::ldr(test, right, flip::PIXELS_PER_DEGREE);
        let counted: Vec<f64> =
            map.iter().zip(counts).filter(|(_, c)| **c).map(|(v, _)| f64::from(*v)).collect();
        counted.iter().sum::<f64>() / counted.len() as f64
    };
    right.iter().zip(&test).map(error).collect()
}

/// A report by the library, of a frame of each sequence.
fn report(studio: &mut Studio, sequences: &[&str], most: f64) -> Value {
    let sequence = |text: &&str| {
        let text = format!(r#"{{ "fps": 4, "duration": 1, {text}, {CLOSE} }}"#);
        ("s.json".into(), Sequence::from_json("s.json", &text).expect("a sequence"))
    };
    let scene = Scene {
        head: head(),
        input_bytes: 0,
        rig: Rig::from_json("rig.json", RIG).expect("a rig"),
        sequences: sequences.iter().map(sequence).collect(),
    };
    let settings = vec![draft(); sequences.len()];
    let options = Options { bound: Bound::Flip(most), frames: 1, timing: None, settings };
    let found = budget::run(studio, &scene, &options, Path::new("reduced.glb"), &mut ()).expect("it runs");
    serde_json::to_value(found.report).expect("it is JSON")
}

#[test]
fn a_frown_keeps_its_wrinkles_and_a_tighter_bound_keeps_more() {
    if !support::can_draw() {
        return;
    }
    let mut studio = Studio::open(None).expect("a device");
    let loose = report(&mut studio, &[ANGER], 0.02);
    assert_eq!(fate(&loose, "zone", "forehead"), "needed");
    assert_eq!(fate(&loose, "shape", "mouthSmileLeft"), "unused");
    let tight = report(&mut studio, &[ANGER], 0.002);
    let bytes = |r: &Value| number(r, "/reduced/deviceBytes") + number(r, "/reduced/fileBytes");
    assert!(bytes(&loose) < bytes(&tight), "{} {}", bytes(&loose), bytes(&tight));
    assert!(number(&tight, "/error/largest") <= 0.002 && number(&loose, "/error/largest") <= 0.02);
    // Several sequences need what any of them needs.
    let both = report(&mut studio, &[ANGER, JOY], 0.005);
    assert_eq!(fate(&both, "zone", "forehead"), "needed");
    for name in ["browDownLeft", "mouthSmileLeft"] {
        assert_eq!(fate(&both, "shape", name), "needed", "{name}");
    }
    assert_eq!(fate(&both, "shape", "smileFrown"), "unused");
}

#[test]
fn wrong_words_are_refused() {
    let folder = Folder::new(&head(), RIG);
    let joy = folder.sequence("joy.json", JOY);
    let head = folder.path("head.glb");
    let with = |more: &[&str], phrases: &[&str]| {
        folder.refused(&[&["--budget", "--head", &head, "--sequence", &joy], more].concat(), phrases);
    };
    with(&["--max-error", "flip=0"], &["flip=0", "above 0"]);
    with(&["--max-error", "ms=3"], &["ms=3", "expected flip=X"]);
    with(&["-o", &head], &["the head itself"]);
    with(&["-o", "head.usda"], &["ends in .glb"]);
    with(&["-o", &folder.path("nowhere/a.glb")], &["no such folder"]);
    with(&[&joy], &["--sequence"]);
    with(&["--frames", "0"], &["--frames"]);
    folder.refused(&["--budget", "--head", &head], &["--sequence"]);
    folder.refused(&["--sequence", &joy, &head], &["--budget"]);
    folder.refused(&[&head, "--scatter", "none"], &["--scatter", "--budget"]);
    let sequence = |text: &str, phrases: &[&str]| {
        let path = folder.path("wrong.json");
        std::fs::write(&path, text).expect("a file");
        folder.refused(&["--budget", "--head", &head, "--sequence", &path], phrases);
    };
    sequence(r#"{ "fps": 4, "duration": 1, "expressions": { "jox": 1 } }"#, &["jox", "joy"]);
    sequence(r#"{ "fps": 4, "duration": 0 }"#, &["found 0", "more than 0"]);
    folder.refused(&["--budget", "--sequence", &folder.path("none.json")], &["no such file"]);
}

#[test]
fn a_head_without_shapes_and_maps_has_nothing_to_lose() {
    if !support::can_draw() {
        return;
    }
    let mut bare = head();
    bare.shapes.clear();
    bare.maps = SkinMaps::default();
    bare.mesh.parts.truncate(1);
    bare.mesh.triangles.pop();
    bare.mesh.points.truncate((SIDE * SIDE) as usize);
    bare.mesh.vertices.truncate((SIDE * SIDE) as usize);
    bare.mesh.occlusion.truncate((SIDE * SIDE) as usize);
    let folder = Folder::new(&bare, r#"{ "expressions": {} }"#);
    let still = folder.sequence("still.json", r#""head": { "yawDegrees": 5 }"#);
    let output = folder.path("reduced.glb");
    let report = folder.budget(&[&still], &["-o", &output, "--frames", "1"]);
    assert!(report["items"].as_array().is_some_and(Vec::is_empty), "{}", report["items"]);
    assert!(report["written"].is_null() && !Path::new(&output).exists());
    assert_eq!(number(&report, "/error/largest"), 0.0);
}
