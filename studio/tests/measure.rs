//! `profile`, `kernel`, `compare` and `chart` as a person uses them.

mod support;

use std::path::Path;
use std::process::{Command, Output};

use rubor_assets::image_io::{SampleKind, save_image};
use rubor_rig::map::Map;
use serde_json::Value;

/// A fresh folder, also the cache of the commands, that is removed when the test ends.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_rubor"))
            .args(arguments)
            .env("XDG_CACHE_HOME", self.0.path().join("cache"))
            .output()
            .expect("the command starts")
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?} said {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("the output is JSON")
    }

    /// Exit code 2 and every phrase in the message.
    fn refused(&self, arguments: &[&str], phrases: &[&str]) {
        let output = self.run(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?} said {said}");
        for phrase in phrases {
            assert!(said.contains(phrase), "{arguments:?} said {said:?}, expected {phrase:?}");
        }
    }

    /// An image of 24 x 16 pixels (or `size`) of a grey ramp times `factor`.
    fn image(&self, name: &str, size: [u32; 2], factor: f32) -> String {
        let path = self.path(name);
        let values = (0..size[0] * size[1])
            .flat_map(|i| [factor * (i % size[0]) as f32 / size[0] as f32; 3])
            .collect();
        let map = Map { width: size[0], height: size[1], channels: 3, values };
        let kind = if name.ends_with(".exr") { SampleKind::F32 } else { SampleKind::U8 };
        std::fs::create_dir_all(Path::new(&path).parent().expect("a folder")).expect("a folder");
        save_image(Path::new(&path), &map, kind).expect("an image");
        path
    }
}

const SIZE: [u32; 2] = [24, 16];

#[test]
fn profiles_print_light_fit_and_transmittance() {
    let folder = Folder::new();
    let report = folder.json(&["profile", "--points", "16", "--json"]);
    assert_eq!(report["reflectance"].as_array().map(Vec::len), Some(16));
    assert!(report["fit"]["errors"][0]["root_mean_square"].as_f64().is_some_and(|e| e < 0.05), "{report}");
    assert_eq!(report["transmittance"]["values"].as_array().map(Vec::len), Some(64));
    let medium = ["profile", "--sigma-s", "0.74,0.88,1.01", "--sigma-a", "0.032,0.17,0.48"];
    let own = folder.json(&[&medium[..], &["--model", "better-dipole"]].concat());
    let named = folder.json(&["profile", "--profile", "skin1", "--model", "better-dipole"]);
    assert_eq!(own["total"], named["total"]);
    // Forward scattering with its own walk: ten times the scattering at g = 0.9 is the same reduced medium.
    let walk = ["--photons", "6400", "--anisotropy", "0.9", "--sigma-a", "0.1", "--sigma-s"];
    let forward = folder.json(&[&["profile"], &walk[..], &["10"]].concat());
    let total = forward["total"][0].as_f64().expect("a number");
    assert!((0.1..0.5).contains(&total), "{total}");
}

#[test]
fn walks_are_kept_between_runs() {
    let folder = Folder::new();
    let profile = ["profile", "--profile", "skin1", "--photons", "400000"];
    let first = folder.json(&profile);
    let cache = folder.0.path().join("cache/rubor");
    let kept: Vec<_> = std::fs::read_dir(&cache).into_iter().flatten().flatten().map(|e| e.path()).collect();
    assert!(first == folder.json(&profile), "the second run printed other numbers");
    // What is kept is read.
    let [file] = &kept[..] else { panic!("one walk is kept: {kept:?}") };
    let mut walk: Value = serde_json::from_slice(&std::fs::read(file).expect("the walk")).expect("JSON");
    for light in walk["ring_light"].as_array_mut().into_iter().flatten() {
        for value in light.as_array_mut().into_iter().flatten() {
            *value = (1.1 * value.as_f64().unwrap_or_default()).into();
        }
    }
    std::fs::write(file, walk.to_string()).expect("another walk");
    assert!(first != folder.json(&profile), "what was kept is not read");
}

#[test]
fn kernels_sum_to_one() {
    let folder = Folder::new();
    let sums = |kernel: &Value| -> Vec<f64> {
        let weights = kernel["weights"].as_array().expect("weights");
        (0..3).map(|c| weights.iter().map(|w| w[c].as_f64().unwrap_or(f64::NAN)).sum()).collect()
    };
    for method in ["edges", "line-spread", "least-squares", "singular-value"] {
        let report = folder.json(&["kernel", "--samples", "9", "--method", method]);
        assert_eq!(report["method"], method);
        assert!(sums(&report["kernel"]).iter().all(|s| (s - 1.0).abs() < 1e-9), "{report}");
    }
    let artist = folder.json(&["kernel", "--width-mm", "3", "--strength", "0", "--samples", "5"]);
    assert_eq!(artist["weights"][2], serde_json::json!([1.0, 1.0, 1.0]), "no strength is no blur");
}

#[test]
fn what_no_medium_or_kernel_can_be_is_refused() {
    let folder = Folder::new();
    let medium = |s: &str, a: &str, phrases: &[&str]| {
        folder.refused(&["profile", "--sigma-s", s, "--sigma-a", a, "--photons", "640"], phrases);
    };
    medium("0", "0.1", &["sigma_s", "found 0", "positive"]);
    medium("inf", "0.1", &["sigma_s", "inf"]);
    medium("NaN", "0.1", &["sigma_s", "NaN"]);
    medium("1", "-0.1", &["sigma_a", "-0.1"]);
    medium("1,1,1", "0.1,inf,0.1", &["sigma_a", "inf"]);
    medium("1,2", "0.1", &["1,2", "R,G,B"]);
    medium("1", "0", &["albedo", "found 1", "0.999"]);
    folder.refused(&["profile", "--sigma-s", "1"], &["--sigma-a"]);
    folder.refused(&["profile", "--profile", "skin3"], &["skin3", "did you mean", "skin"]);
    folder.refused(&["profile", "--profile", "skin1", "--model", "beter-dipole"], &["better-dipole"]);
    folder.refused(&["profile", "--profile", "skin1", "--eta", "0"], &["eta", "found 0"]);
    folder.refused(
        &["profile", "--sigma-s", "1", "--sigma-a", "1", "--anisotropy", "1"],
        &["anisotropy", "between -1 and 1"],
    );
    folder.refused(&["profile", "--points", "1"], &["points", "found 1"]);
    folder.refused(&["profile", "--terms", "0"], &["terms", "found 0"]);
    for samples in ["16", "3", "67", "0"] {
        folder.refused(&["kernel", "--samples", samples], &["samples", samples, "odd number from 5 to 65"]);
    }
    folder.refused(&["kernel", "--width-mm", "0"], &["width_mm", "found 0"]);
    folder.refused(&["kernel", "--width-mm", "inf"], &["width_mm", "inf"]);
    folder.refused(&["kernel", "--width-mm", "3", "--strength", "-0.5"], &["strength[0]", "-0.5", "0 to 1"]);
    folder.refused(&["kernel", "--width-mm", "3", "--strength", "1,1.5,1"], &["strength[1]", "1.5"]);
    folder.refused(&["kernel", "--width-mm", "3", "--falloff", "-1"], &["falloff[0]", "-1"]);
    folder.refused(&["kernel", "--method", "line-spred"], &["line-spread"]);
}

#[test]
fn comparisons_of_images_and_folders() {
    let folder = Folder::new();
    let (a, b) = (folder.image("a.png", SIZE, 1.0), folder.image("b.png", SIZE, 0.9));
    let same = folder.json(&["compare", &a, &a, "--json"]);
    assert_eq!(same[0]["flipMean"], 0.0);
    assert_eq!(same[0]["relativeRmse"], 0.0);
    let picture = folder.path("difference.png");
    let other = folder.json(&["compare", &b, &a, "--json", "-o", &picture]);
    assert!(other[0]["flipMean"].as_f64().is_some_and(|f| f > 0.001 && f < 0.5), "{other}");
    assert_eq!(image::image_dimensions(&picture).expect("a picture"), (SIZE[0], SIZE[1]));
    let judged = folder.run(&["compare", &b, &a, "--most", "0.0001"]);
    assert_eq!(judged.status.code(), Some(1));

    // Light in EXR is compared as light: a tenth less is a tenth of error.
    let (x, y) = (folder.image("x.exr", SIZE, 4.0), folder.image("y.exr", SIZE, 3.6));
    let light = folder.json(&["compare", &y, &x, "--json"]);
    assert!(light[0]["relativeRmse"].as_f64().is_some_and(|e| (e - 0.1).abs() < 1e-3), "{light}");

    for (name, factor) in
        [("test/1.png", 0.9), ("test/2.exr", 1.0), ("right/1.png", 1.0), ("right/2.exr", 1.0)]
    {
        folder.image(name, SIZE, factor);
    }
    let pairs = folder.json(&["compare", &folder.path("test"), &folder.path("right"), "--json"]);
    assert_eq!(pairs.as_array().map(Vec::len), Some(2));
    assert_eq!((&pairs[0]["name"], &pairs[1]["flipMean"]), (&"1.png".into(), &0.0.into()));

    folder.image("right/3.png", SIZE, 1.0);
    folder.refused(&["compare", &folder.path("test"), &folder.path("right")], &["3.png", "test"]);
    let small = folder.image("small.png", [12, 16], 1.0);
    folder.refused(&["compare", &small, &a], &["small.png", "12x16", "24x16"]);
    folder.refused(&["compare", &folder.path("none.png"), &a], &["none.png"]);
    folder.refused(&["compare", &a, &a, "--pixels-per-degree", "0"], &["found 0"]);
    std::fs::create_dir(folder.0.path().join("empty")).expect("a folder");
    let empty = folder.path("empty");
    folder.refused(&["compare", &empty, &empty], &["empty", "no images"]);
    std::fs::write(folder.0.path().join("broken.png"), b"no picture").expect("a file");
    folder.refused(&["compare", &folder.path("broken.png"), &a], &["broken.png"]);
}

/// An ear with a lamp behind it.
const EAR: &str = r#"{ "fps": 1, "duration": 1,
    "camera": { "target": [0.08, -0.01, -0.08], "position": [0.15, 0, 0.15] },
    "lights": [{ "kind": "spot", "intensity": 14, "position": [0.28, 0.2, -0.9] }] }"#;

#[test]
fn a_chart_has_a_row_a_choice_its_pictures_and_its_page() {
    let folder = Folder::new();
    folder.refused(&["chart", "--scatter", "separable:8"], &["separable:8", "odd"]);
    folder.refused(&["chart", "--transmit", "shadow"], &["shadow-depth"]);
    folder.refused(&["chart", "--size", "0x8"], &["0x8"]);
    if !support::can_draw() {
        return;
    }
    let out = folder.path("out");
    let scene = folder.path("ear.json");
    std::fs::write(&scene, EAR).expect("a sequence");
    let small =
        ["chart", "--sequence", &scene, "--size", "48x48", "--frames", "1", "--rounds", "1", "--json"];
    let lists = ["--batches", "2", "--scatter", "none,separable:5", "--wrinkles", "none,partial-derivative"];
    let chart = folder.json(&[&small[..], &lists, &["-o", &out]].concat());
    let [scatter, wrinkles] = [0, 1].map(|g| &chart["groups"][g]);
    let names = |group: &Value| -> Vec<Value> {
        group["choices"].as_array().expect("choices").iter().map(|c| c["name"].clone()).collect()
    };
    assert_eq!(names(scatter), ["reference-screen", "none", "separable:5"]);
    assert_eq!(names(wrinkles), ["none", "partial-derivative"]);
    assert!(chart["scenes"][0]["noise"].as_f64().is_some_and(|n| n > 0.0 && n < 0.5), "{chart}");
    let error =
        |c: usize, name: &str| scatter["choices"][c]["points"][0]["error"][name].as_f64().unwrap_or(f64::NAN);
    let to_screen = [0, 1, 2].map(|c| error(c, "relativeRmseToScreen"));
    assert!(to_screen[0] == 0.0 && to_screen[1] > to_screen[2] && to_screen[2] > 0.0, "{chart}");
    assert!(error(1, "relativeRmseToSurface") > error(2, "relativeRmseToSurface"), "{chart}");
    assert_eq!(wrinkles["choices"][1]["overall"]["error"], 0.0, "what counts as right has no error");
    for file in [
        "ear/truth-scatter.png",
        "ear/truth-scatter.exr",
        "ear/scatter_separable-5.png",
        "ear/scatter_none-difference.png",
        "chart.json",
        "chart.csv",
        "chart.svg",
        "index.html",
    ] {
        assert!(Path::new(&out).join(file).is_file(), "{file}");
    }
    let page = std::fs::read_to_string(Path::new(&out).join("index.html")).expect("a page");
    assert!(page.contains("ear/scatter_separable-5.png") && !page.contains("http://localhost"));
    let lines = std::fs::read_to_string(Path::new(&out).join("chart.csv")).expect("a table");
    assert_eq!(lines.lines().count(), 1 + 5, "{lines}");
    // The page can be drawn again without a device.
    let again = folder.path("again");
    let json = Path::new(&out).join("chart.json").to_string_lossy().into_owned();
    assert!(folder.run(&["chart", "--from", &json, "-o", &again]).status.success());
    assert!(Path::new(&again).join("index.html").is_file());
    // JSON may round the last digit, which the table does not show.
    let same = std::fs::read_to_string(Path::new(&again).join("chart.csv")).expect("a table");
    assert_eq!(same, lines);
    folder.refused(&["chart", "--from", &scene, "-o", &again], &["ear.json", "chart.json"]);
    folder.refused(&[&small[..], &["--batches", "0"]].concat(), &["reference-surface:0", "1 to 4096"]);
    folder.refused(&[&small[..], &["--exposure", "nan"]].concat(), &["exposure"]);
    folder.refused(&[&small[..], &["--adapter", "abacus"]].concat(), &["abacus"]);
}

#[test]
fn methods_stand_beside_the_volume_and_stills_go_to_other_programs() {
    let folder = Folder::new();
    folder.refused(&["chart", "--paths", "8"], &["--volume"]);
    folder.refused(&["chart", "--volume", "--still", "nose"], &["\"nose\"", "shadow-edge"]);
    folder.refused(&["chart", "--volume", "--export"], &["--output"]);
    // Stills for other programs need no device.
    let stills = folder.path("stills");
    let small = ["chart", "--volume", "--still", "light-through-ear", "--size", "20x16", "--paths", "16"];
    assert!(folder.run(&[&small[..], &["--export", "-o", &stills]].concat()).status.success());
    let still = Path::new(&stills).join("light-through-ear");
    let text = std::fs::read_to_string(still.join("scene.json")).expect("a scene");
    let scene: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&scene["size"], &scene["closedRims"]), (&serde_json::json!([20, 16]), &serde_json::json!(1)));
    assert_eq!(scene["lamps"][0]["kind"], "point");
    for (name, bytes) in [("scattered", 12), ("scattered-error", 12), ("scattered-all-facets", 12)] {
        let found = std::fs::metadata(still.join(format!("{name}.f32"))).expect("a picture").len();
        assert_eq!(found, 20 * 16 * bytes, "{name}");
    }
    let mesh = std::fs::read(still.join("surface.ply")).expect("a mesh");
    assert!(mesh.starts_with(b"ply\nformat binary_little_endian 1.0\n"));
    if !support::can_draw() {
        return;
    }
    let out = folder.path("out");
    let lists = ["--scatter", "none,separable:9", "--batches", "1", "--json", "-o", &out];
    let report = folder.json(&[&small[..], &lists].concat());
    let names: Vec<&Value> =
        report["choices"].as_array().expect("choices").iter().map(|c| &c["name"]).collect();
    assert_eq!(names, ["reference-screen", "none", "separable:9", "reference-surface:1"]);
    let error = |c: usize| report["choices"][c]["relativeRmse"].as_f64().unwrap_or(f64::NAN);
    // What the noise of so few paths explains is left out of errors, and may be all of them.
    assert!([1, 2].into_iter().all(|c| error(c) >= 0.0 && error(c) < 1.0), "{} {}", error(1), error(2));
    // Light that comes through the ear is there; that of the profile would be -0.7.
    let thin = report["choices"][2]["bias"]["thin"].as_f64().unwrap_or(f64::NAN);
    assert!((-0.4..0.8).contains(&thin), "{thin}");
    let noise = report["stills"][0]["noise"].as_f64().unwrap_or(f64::NAN);
    assert!(noise > 0.0 && noise < 1.0, "{noise}");
    for file in
        ["truth.exr", "truth-error.exr", "truth.json", "truth.png", "none.png", "separable-9-difference.png"]
    {
        assert!(Path::new(&out).join("light-through-ear").join(file).is_file(), "{file}");
    }
    let page = std::fs::read_to_string(Path::new(&out).join("index.html")).expect("a page");
    assert!(page.contains("light-through-ear/separable-9.png") && !page.contains("http://"));
    // Read again, not drawn again, and the page once more from its report.
    assert_eq!(folder.json(&[&small[..], &lists].concat())["stills"], report["stills"]);
    let again = folder.path("again");
    let json = Path::new(&out).join("volume.json").to_string_lossy().into_owned();
    assert!(folder.run(&["chart", "--from", &json, "-o", &again]).status.success());
    assert!(Path::new(&again).join("volume.csv").is_file());
}
