//! `rubor maps` as a person uses it: images of every kind into a head file, and its messages on wrong input.

mod support;

use std::path::Path;
use std::process::{Command, Output};

use glam::{Vec2, Vec3};
use rubor_assets::export::gltf::Options;
use rubor_assets::image_io::{SampleKind, load_image, save_image};
use rubor_assets::{export, import};
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, Part, ProvenanceKind, SkinMaps, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

/// A fresh folder that is removed when the test ends.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    fn text(&self, name: &str, content: &str) -> String {
        std::fs::write(self.0.path().join(name), content).expect("a temporary file");
        self.path(name)
    }

    fn image(&self, name: &str, map: &Map, kind: SampleKind) -> String {
        save_image(&self.0.path().join(name), map, kind).expect("a temporary image");
        self.path(name)
    }

    fn head(&self, name: &str, head: &Head) -> String {
        export::gltf::write(head, &Options::default(), &self.0.path().join(name)).expect("a temporary head");
        self.path(name)
    }
}

fn maps(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
    command.arg("maps").args(arguments).output().expect("the command starts")
}

/// The report of a command that must do its work.
fn done(arguments: &[&str]) -> serde_json::Value {
    let output = maps(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{arguments:?} said {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("the report is JSON")
}

/// The command must refuse: exit code 2, every phrase in its message, and no result.
fn refused(folder: &Folder, arguments: &[&str], phrases: &[&str]) {
    let out = folder.path("refused.glb");
    let output = maps(&[arguments, &["-o", &out]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?} said {said}");
    for phrase in phrases {
        assert!(said.contains(phrase), "{arguments:?} said {said:?}, expected {phrase:?}");
    }
    assert!(!Path::new(&out).exists(), "{arguments:?} left a head");
}

fn read(path: &str) -> Head {
    import::gltf::read(Path::new(path)).expect("a head").head
}

fn flat(side: u32, value: f32) -> Map {
    Map::filled(side, side, &[value])
}

fn map(width: u32, height: u32, value: impl Fn(f32, f32) -> f32) -> Map {
    let at =
        |i: u32| value(((i % width) as f32 + 0.5) / width as f32, ((i / width) as f32 + 0.5) / height as f32);
    Map { width, height, channels: 1, values: (0..width * height).map(at).collect() }
}

/// Texture without a mean: -0.5 to 0.5.
fn ripple(u: f32, v: f32) -> f32 {
    0.5 * (171.0 * u + 13.0).sin() * (143.0 * v).cos()
}

/// A sheet of skin 20 cm wide whose texture fills the middle of the unit square, bent a little, with one shape.
fn head() -> Head {
    const N: u32 = 9;
    let mut mesh = Mesh::default();
    for i in 0..N * N {
        let p = Vec2::new((i % N) as f32, (i / N) as f32) / (N - 1) as f32;
        mesh.points.push(Vec3::new(0.2 * p.x - 0.1, 0.1 - 0.2 * p.y, 0.05 - 0.1 * (p.x - 0.5).powi(2)));
        mesh.vertices.push(Vertex { point: i, uv: Vec2::splat(0.1) + 0.8 * p });
    }
    for y in 0..N - 1 {
        for x in 0..N - 1 {
            let a = y * N + x;
            mesh.triangles.extend([[a, a + N, a + 1], [a + 1, a + N, a + N + 1]]);
        }
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    let squeeze = BlendShape {
        name: "mouthPucker".into(),
        points: (0..N * N).collect(),
        offsets: mesh.points.iter().map(|p| Vec3::new(-0.2 * p.x, 0.0, 0.0)).collect(),
        ..BlendShape::default()
    };
    let maps = SkinMaps {
        melanin: Some(flat(64, 0.03)),
        hemoglobin: Some(map(64, 64, |u, v| 0.02 + 0.004 * ripple(u, v))),
        hemoglobin_mean: Some(flat(32, 0.02)),
        distributions: vec![Distribution {
            name: "blush".into(),
            scale: flat(32, 1.2),
            bias: flat(32, 0.03),
        }],
        wrinkle_slopes: vec![Map::filled(16, 16, &[0.3, 0.0])],
        zones: vec![WrinkleZone { name: "chin".into(), wrinkle_map: 0, mask: flat(8, 1.0) }],
        ..SkinMaps::default()
    };
    let marks = [
        ("pronasale", 0.0, 0.0, 0.05),
        ("menton", 0.0, -0.09, 0.05),
        ("glabella", 0.0, 0.08, 0.05),
        ("ear-left", 0.09, 0.0, 0.03),
        ("ear-right", -0.09, 0.0, 0.03),
        ("subnasale", 0.0, -0.02, 0.049),
    ];
    let landmarks = marks.iter().map(|(n, x, y, z)| ((*n).to_owned(), Vec3::new(*x, *y, *z))).collect();
    Head { name: "sheet".into(), mesh, shapes: vec![squeeze], maps, landmarks, ..Head::default() }
}

#[test]
fn hemoglobin_of_every_format_goes_into_a_head() {
    let folder = Folder::new();
    let head = folder.head("head.glb", &head());
    let neutral = |u, v| 0.04 + 0.016 * ripple(u, v);
    // Twice the contrast about a mean of 7 %.
    let target = |u, v| 0.07 + 0.032 * ripple(u, v);
    let code = |value: f32| value / 0.32;
    let neutral = folder.image("neutral.exr", &map(192, 192, neutral), SampleKind::F32);
    let coded = |side| map(side, side, |u, v| code(target(u, v)));
    let anger = folder.image("anger.png", &coded(192), SampleKind::U8);
    let joy = folder.image("joy.png", &coded(192), SampleKind::U16);
    // Each texel four times: the average by area is the texel again.
    let middle = |t: f32| ((t * 192.0).floor() + 0.5) / 192.0;
    let doubled = map(384, 384, |u, v| code(target(middle(u), middle(v))));
    let fear = folder.image("fear.tif", &doubled, SampleKind::U16);
    let disgust = folder.image("disgust.exr", &map(192, 192, target), SampleKind::F32);
    let out = folder.path("out.glb");
    let [anger, joy, fear, disgust] = [("anger", anger), ("joy", joy), ("fear", fear), ("disgust", disgust)]
        .map(|(n, f)| format!("{n}={f}"));
    let report = done(&[
        "hemoglobin",
        "--into",
        &head,
        "-o",
        &out,
        "--neutral",
        &neutral,
        "--target",
        &anger,
        "--target",
        &joy,
        "--target",
        &fear,
        "--target",
        &disgust,
        "--radius",
        "24",
        "--size",
        "32",
        "--licence",
        "CC-BY-4.0",
    ]);
    assert_eq!((&report["clamped_texels"], &report["radius_px"]), (&0.into(), &24.into()));
    assert_eq!(report["kept_distributions"], serde_json::json!(["blush"]));

    let found = read(&out);
    assert!(found.maps.distributions.len() == 5 && found.shapes.len() == 1);
    let mean = found.maps.hemoglobin_mean.as_ref().expect("a mean");
    assert!(mean.values.iter().all(|m| (m - 0.04).abs() < 4e-3), "local means of a texture about 4 %");
    for d in &found.maps.distributions[1..] {
        // 8 bits are steps of 0.00126 beside a deviation of 0.008.
        let tolerance = if d.name == "anger" { 0.04 } else { 0.02 };
        for (i, (scale, bias)) in d.scale.values.iter().zip(&d.bias.values).enumerate() {
            assert!((scale - 2.0).abs() < tolerance, "{}: scale {scale}", d.name);
            let expected = 0.07 + 2.0 * (mean.values[i] - 0.04);
            assert!((bias - expected).abs() < 2e-4, "{}: bias {bias}, expected {expected}", d.name);
        }
    }
    // The change that the head had was a half more blood, and still is.
    let blush = &found.maps.distributions[0];
    for (bias, m) in blush.bias.values.iter().zip(&mean.values) {
        assert!((bias - 1.5 * m).abs() < 1e-4, "{bias} {m}");
    }
    let origin = |of: &str| found.provenance.iter().find(|p| p.of == of).expect("a provenance").clone();
    assert_eq!(origin("maps.hemoglobin").kind, ProvenanceKind::Measured);
    assert_eq!(origin("maps.distributions").licence, "CC-BY-4.0");
    assert!(origin("maps.distributions").source.contains("anger.png"));

    // A manifest with calibrations, on the head's own neutral blood.
    folder.image("percent.exr", &map(192, 192, |u, v| 50.0 - 100.0 * target(u, v)), SampleKind::F32);
    let manifest = folder.text(
        "maps.json",
        r#"{ "distributions": [{ "name": "exercise", "file": "percent.exr",
            "calibration": { "unit": "percent", "gain": -1, "offset": 50 } }], "radius_px": 8, "size": 64 }"#,
    );
    let second = folder.path("second.glb");
    done(&["hemoglobin", "--into", &out, "-o", &second, "--manifest", &manifest]);
    let second = read(&second);
    let exercise = second.maps.distributions.iter().find(|d| d.name == "exercise").expect("exercise");
    let average = |m: &Map| m.values.iter().sum::<f32>() / m.values.len() as f32;
    assert!((average(&exercise.bias) - 0.07).abs() < 1e-3 && (average(&exercise.scale) - 2.0).abs() < 0.1);
    assert_eq!(second.maps.distributions.len(), 6);
}

#[test]
fn masks_and_alpha_keep_the_background_out() {
    let folder = Folder::new();
    let head_file = folder.head("head.glb", &head());
    // Skin of 4 %, and beyond the skin of the head a background that would triple it.
    let inside = |u: f32, v: f32| (0.1..0.9).contains(&u) && (0.1..0.9).contains(&v);
    let blood = |level: f32| map(100, 100, move |u, v| if inside(u, v) { level } else { 0.3 });
    let neutral = folder.image("neutral.exr", &blood(0.04), SampleKind::F32);
    let joy = format!("joy={}", folder.image("joy.exr", &blood(0.06), SampleKind::F32));
    let out = folder.path("out.glb");
    done(&[
        "hemoglobin",
        "--into",
        &head_file,
        "-o",
        &out,
        "--neutral",
        &neutral,
        "--target",
        &joy,
        "--radius",
        "30",
    ]);
    let found = read(&out);
    let joy_map = found.maps.distributions.iter().find(|d| d.name == "joy").expect("joy");
    assert!(joy_map.bias.values.iter().all(|b| (b - 0.06).abs() < 2e-3), "the skin of the head is a mask");

    // Without a head: a drawn mask, and the alpha of an image.
    let mask =
        folder.image("mask.png", &map(100, 100, |u, v| f32::from(u8::from(inside(u, v)))), SampleKind::U8);
    let results = folder.path("results");
    done(&[
        "hemoglobin",
        "-o",
        &results,
        "--neutral",
        &neutral,
        "--target",
        &joy,
        "--mask",
        &mask,
        "--radius",
        "30",
    ]);
    let bias = load_image(&Path::new(&results).join("joy_bias.exr")).expect("a result").map;
    assert!(bias.values.iter().all(|b| (b - 0.06).abs() < 1e-6));
    let alpha = folder.path("alpha.png");
    let picture = image::RgbaImage::from_fn(100, 100, |x, y| {
        let skin = inside((x as f32 + 0.5) / 100.0, (y as f32 + 0.5) / 100.0);
        // Code 48 of 255 is 6 %.
        if skin { image::Rgba([48, 48, 48, 255]) } else { image::Rgba([255, 255, 255, 0]) }
    });
    picture.save(&alpha).expect("a temporary image");
    let alpha = format!("joy={alpha}");
    done(&[
        "hemoglobin",
        "-o",
        &results,
        "--neutral",
        &neutral,
        "--target",
        &alpha,
        "--mask",
        &mask,
        "--radius",
        "30",
    ]);
    let bias = load_image(&Path::new(&results).join("joy_bias.exr")).expect("a result").map;
    assert!(bias.values.iter().all(|b| (b - 48.0 / 255.0 * 0.32).abs() < 1e-6));
}

#[test]
fn hemoglobin_that_cannot_be_used_is_explained() {
    let folder = Folder::new();
    let head_file = folder.head("head.glb", &head());
    let good = folder.image("good.exr", &map(64, 64, |u, v| 0.04 + 0.01 * ripple(u, v)), SampleKind::F32);
    let image = |name: &str, map: &Map| folder.image(name, map, SampleKind::F32);
    let wide = image("wide.exr", &map(64, 40, |_, _| 0.05));
    let mut nan = map(64, 64, |_, _| 0.05);
    nan.values[64 * 32 + 20] = f32::NAN;
    let nan = image("nan.exr", &nan);
    let percent = image("percent.exr", &flat(64, 5.0));
    let colored = folder.image("colored.png", &Map::filled(64, 64, &[0.2, 0.1, 0.1]), SampleKind::U8);
    // Data only in a corner that the head's skin does not use.
    let elsewhere = image("elsewhere.exr", &map(64, 64, |u, v| if u < 0.1 && v < 0.5 { 0.05 } else { 0.0 }));
    let with = |target: &str, extra: &[&str], phrases: &[&str]| {
        let target = format!("joy={target}");
        let mut all = vec!["hemoglobin", "--into", &head_file, "--neutral", &good, "--target", &target];
        all.extend(extra);
        refused(&folder, &all, phrases);
    };
    with(&wide, &[], &["wide.exr", "64x40", "proportions", "64x64"]);
    with(&nan, &[], &["nan.exr", "texel (20, 32)", "NaN"]);
    with(&percent, &[], &["percent.exr", "100 % of the texels", "unit"]);
    with(&colored, &[], &["colored.png", "grey"]);
    with(&elsewhere, &[], &["elsewhere.exr", "0 % lie on the skin", "transfer"]);
    with(&good, &["--radius", "0"], &["radius", "0 texels"]);
    with(&good, &["--radius", "65"], &["radius", "65 texels", "1 to 64"]);
    with(&good, &["--unit", "litres"], &["litres", "volume-fraction", "percent"]);
    with(&good, &["--gain", "inf"], &["gain inf"]);
    with(&good, &["--size", "0"], &["size", "0"]);
    with("nothing.exr", &[], &["nothing.exr"]);
    with(&good, &["--target", "joy"], &["NAME=FILE"]);
    with(&good, &["--mask", &wide], &["wide.exr", "64x40", "64x64"]);
    refused(&folder, &["hemoglobin", "--neutral", &good], &["--into HEAD.glb"]);
    refused(&folder, &["hemoglobin", "--into", "gone.glb", "--neutral", &good], &["gone.glb"]);
    let folder_out =
        maps(&["hemoglobin", "--into", &head_file, "-o", &folder.path("results"), "--neutral", &good]);
    assert_eq!(folder_out.status.code(), Some(2));
    let unknown = folder.text("m.json", r#"{ "neutral": "good.exr", "calibration": { "unit": "pints" } }"#);
    refused(&folder, &["hemoglobin", "--manifest", &unknown], &["m.json"]);
    let message = maps(&["hemoglobin", "--manifest", &unknown, "-o", &folder.path("results")]);
    assert!(String::from_utf8_lossy(&message.stderr).contains("pints"));

    // A constant map is no error: its rule is stated, and reported.
    let constant = format!("joy={}", image("constant.exr", &flat(64, 0.05)));
    let out = folder.path("constant.glb");
    let report =
        done(&["hemoglobin", "--into", &head_file, "-o", &out, "--neutral", &good, "--target", &constant]);
    assert_eq!(report["constant_maps"], serde_json::json!(["joy"]));
    let found = read(&out);
    let joy = found.maps.distributions.iter().find(|d| d.name == "joy").expect("joy");
    assert!(joy.scale.values.iter().all(|s| (0.0..1e-3).contains(s)), "no contrast is left");
}

#[test]
fn an_albedo_texture_becomes_chromophores_of_a_head() {
    let folder = Folder::new();
    let mut plain = head();
    plain.maps = SkinMaps::default();
    let bare = folder.head("bare.glb", &plain);
    let with_blush = folder.head("head.glb", &head());
    let skin = SkinModel::new(&ChromophoreModel::default());
    let mut albedo = Map { channels: 3, ..map(96, 96, |_, _| 0.0) };
    albedo.values = (0..96 * 96)
        .flat_map(|i| {
            let inside = (9..87).contains(&(i % 96)) && (9..87).contains(&(i / 96));
            let blood = if i % 96 < 48 { 0.012 } else { 0.024 };
            if inside { skin.color(0.05, blood).map(|c| c as f32) } else { [0.0; 3] }
        })
        .collect();
    let linear = folder.image("albedo.exr", &albedo, SampleKind::F32);
    albedo.values.iter_mut().for_each(|v| *v = rubor_rig::color::srgb_encode(*v));
    let encoded = folder.image("albedo.png", &albedo, SampleKind::U16);
    for (file, into) in [(&linear, &bare), (&encoded, &with_blush)] {
        let out = folder.path("out.glb");
        let report = done(&["chromophores", file, "--into", into, "-o", &out]);
        assert_eq!(
            (&report["out_of_gamut_texels"], report["exposure"]["gain"].as_f64()),
            (&0.into(), Some(1.0))
        );
        let found = read(&out);
        let own = found.maps.albedo.as_ref().expect("the colour stays");
        let expected = skin.color(0.05, 0.012);
        assert!((0..3).all(|c| (f64::from(own.sample(0.3, 0.5, c as u32)) - expected[c]).abs() < 4e-3));
        let at = |m: &Option<Map>, u: f32| m.as_ref().expect("a map").sample(u, 0.5, 0);
        assert!((at(&found.maps.melanin, 0.3) - 0.05).abs() < 1e-3);
        let (left, right) = (at(&found.maps.hemoglobin, 0.3), at(&found.maps.hemoglobin, 0.7));
        assert!((left - 0.012).abs() < 4e-4 && (right - 0.024).abs() < 4e-4, "{left} {right}");
        // Black outside of the skin is not skin: the border holds what lies beside it.
        assert!((at(&found.maps.melanin, 0.02) - 0.05).abs() < 5e-3);
        assert_eq!(found.provenance.iter().filter(|p| p.of == "maps.melanin").count(), 1);
        if let Some(blush) = found.maps.distributions.first() {
            assert!((blush.bias.sample(0.3, 0.5, 0) - 0.018).abs() < 1e-3, "the blush follows the blood");
        }
    }
    let out = folder.path("colourless.glb");
    done(&["chromophores", &linear, "--into", &bare, "-o", &out, "--no-color", "--gain", "0.8"]);
    assert!(read(&out).maps.albedo.is_none());
    let elsewhere = Map {
        channels: 3,
        values: (0..96 * 96).flat_map(|i| [if i % 96 < 8 { 0.4 } else { 0.0 }; 3]).collect(),
        ..albedo.clone()
    };
    let elsewhere = folder.image("elsewhere.png", &elsewhere, SampleKind::U8);
    refused(&folder, &["chromophores", &elsewhere, "--into", &bare], &["elsewhere.png", "lie on the skin"]);
    refused(&folder, &["chromophores", &linear, "--into", &bare, "--gain", "0"], &["gain", "positive"]);
    refused(&folder, &["chromophores", "none.png", "--into", &bare], &["none.png"]);
}

#[test]
fn normal_maps_become_relief_and_wrinkles_of_a_head() {
    let folder = Folder::new();
    let head_file = folder.head("head.glb", &head());
    // Slopes of 0.5 and -0.25 as a normal map; green grows downwards in DirectX.
    let normal = Vec3::new(0.5, -0.25, 1.0).normalize();
    let codes = |n: Vec3| (0.5 * n + 0.5).to_array();
    let opengl = folder.image("gl.png", &Map::filled(32, 32, &codes(normal)), SampleKind::U16);
    let directx = folder.image(
        "dx.png",
        &Map::filled(32, 32, &codes(normal * Vec3::new(1.0, -1.0, 1.0))),
        SampleKind::U8,
    );
    let out = folder.path("out.glb");
    for (file, extra, tolerance) in [(&opengl, &[][..], 1e-3), (&directx, &["--directx"][..], 1e-2)] {
        done(&[&["normals", file, "--to", "slopes", "--into", &head_file, "-o", &out], extra].concat());
        let slopes = read(&out).maps.slopes.expect("slopes");
        assert!((slopes.values[0] - 0.5).abs() < tolerance && (slopes.values[1] + 0.25).abs() < tolerance);
    }
    // A second wrinkle map, less its base, with two zones from the channels of one image.
    let masks = folder.path("masks.png");
    image::RgbaImage::from_pixel(16, 16, image::Rgba([255, 0, 102, 51])).save(&masks).expect("an image");
    let base = folder.image(
        "base.png",
        &Map::filled(32, 32, &codes(Vec3::new(0.5, 0.0, 1.0).normalize())),
        SampleKind::U16,
    );
    let (brow, nose) = (format!("brow={masks}#b"), format!("nose={masks}#a"));
    let report = done(&[
        "normals",
        &opengl,
        "--to",
        "wrinkles",
        "--base",
        &base,
        "--into",
        &head_file,
        "-o",
        &out,
        "--wrinkle-map",
        "1",
        "--zone",
        &brow,
        "--zone",
        &nose,
    ]);
    assert_eq!(report["zones_without_expression"], serde_json::Value::Null, "the head has no rig of its own");
    let found = read(&out);
    let slopes = &found.maps.wrinkle_slopes[1];
    assert!(slopes.values[0].abs() < 1e-3 && (slopes.values[1] + 0.25).abs() < 1e-3);
    let zone = |name: &str| found.maps.zones.iter().find(|z| z.name == name).expect("a zone");
    assert!((zone("brow").mask.values[0] - 0.4).abs() < 1e-2 && zone("brow").wrinkle_map == 1);
    assert!((zone("nose").mask.values[0] - 0.2).abs() < 1e-2 && zone("chin").wrinkle_map == 0);

    let with = |extra: &[&str], phrases: &[&str]| {
        let all = [&["normals", &opengl, "--into", &head_file], extra].concat();
        refused(&folder, &all, phrases);
    };
    with(&["--to", "wrinkles", "--wrinkle-map", "2"], &["wrinkle map", "0 to 1"]);
    with(&["--to", "normals"], &["slopes or wrinkles"]);
    with(&["--to", "wrinkles", "--zone", "chin"], &["NAME=FILE"]);
    with(&["--to", "wrinkles", "--zone", &format!("chin={opengl}#a")], &["no alpha"]);
    let small = folder.image("small.png", &Map::filled(8, 8, &[0.5, 0.5, 1.0]), SampleKind::U8);
    with(&["--to", "wrinkles", "--base", &small], &["small.png", "8x8", "32x32"]);
    let mut broken = Map::filled(4, 4, &[0.5, 0.5, 1.0]);
    broken.values[5] = f32::INFINITY;
    let broken = folder.image("broken.exr", &broken, SampleKind::F32);
    refused(
        &folder,
        &["normals", &broken, "--to", "slopes", "--into", &head_file],
        &["broken.exr", "texel (1, 0)"],
    );
}

#[test]
fn the_changes_of_one_head_cross_to_another() {
    let folder = Folder::new();
    let mut giver = head();
    giver.maps.distributions[0].bias = map(32, 32, |u, _| 0.02 + 0.02 * u);
    let giver_file = folder.head("giver.glb", &giver);
    // Another layout (turned a quarter) of a head twice as large, with half of the blood.
    let mut receiver = head();
    for v in &mut receiver.mesh.vertices {
        v.uv = Vec2::new(1.0 - v.uv.y, v.uv.x);
    }
    receiver.mesh.points.iter_mut().for_each(|p| *p *= 2.0);
    receiver.landmarks.values_mut().for_each(|p| *p *= 2.0);
    receiver.maps.hemoglobin = Some(flat(64, 0.01));
    receiver.maps.hemoglobin_mean = None;
    receiver.maps.distributions.clear();
    let receiver_file = folder.head("receiver.glb", &receiver);
    let out = folder.path("out.glb");
    let report = done(&["transfer", "--from", &giver_file, "--into", &receiver_file, "-o", &out]);
    assert_eq!(report["through"], "landmarks");
    let found = read(&out);
    assert_eq!(found.maps.hemoglobin.expect("its own blood").values[7], 0.01);
    let bias = &found.maps.distributions[0].bias;
    for (u, v) in [(0.3, 0.3), (0.5, 0.7), (0.7, 0.4)] {
        // The giver's u is the receiver's v.
        let expected = 0.5 * (0.02 + 0.02 * v);
        assert!((bias.sample(u, v, 0) - expected).abs() < 2e-4, "{} {expected}", bias.sample(u, v, 0));
    }
    let pairs = r#"[{"receiver": [0.1, 0.1], "giver": [0.1, 0.9]}, {"receiver": [0.9, 0.1], "giver": [0.1, 0.1]},
        {"receiver": [0.1, 0.9], "giver": [0.9, 0.9]}, {"receiver": [0.9, 0.9], "giver": [0.9, 0.1]}]"#;
    let pairs = folder.text("pairs.json", pairs);
    let report = done(&[
        "transfer",
        "--from",
        &giver_file,
        "--into",
        &receiver_file,
        "-o",
        &out,
        "--correspondences",
        &pairs,
    ]);
    assert_eq!(report["through"], "correspondences");
    let again = &read(&out).maps.distributions[0].bias;
    assert!((again.sample(0.5, 0.7, 0) - 0.017).abs() < 2e-4);
    let same = done(&["transfer", "--from", &giver_file, "--into", &giver_file, "-o", &out]);
    assert_eq!(same["through"], "one layout");

    let mut unmarked = receiver.clone();
    unmarked.landmarks.clear();
    let unmarked = folder.head("unmarked.glb", &unmarked);
    refused(&folder, &["transfer", "--from", &giver_file, "--into", &unmarked], &["common landmarks", "0"]);
    refused(
        &folder,
        &["transfer", "--from", &receiver_file, "--into", &giver_file],
        &["without distributions"],
    );
    refused(
        &folder,
        &["transfer", "--from", &giver_file, "--into", &giver_file, "--only", "rage"],
        &["rage", "blush"],
    );
    let line = r#"[{"receiver": [0, 0], "giver": [0, 0]}, {"receiver": [0.5, 0.5], "giver": [1, 1]},
        {"receiver": [1, 1], "giver": [0.3, 0.2]}]"#;
    let line = folder.text("line.json", line);
    refused(
        &folder,
        &["transfer", "--from", &giver_file, "--into", &receiver_file, "--correspondences", &line],
        &["one line"],
    );
}

#[test]
fn a_head_without_expression_maps_gets_predicted_ones() {
    let folder = Folder::new();
    let file = folder.head("head.glb", &head());
    let rig = r#"{ "expressions": { "kiss": { "shapes": { "mouthPucker": 1.0 } } } }"#;
    let rig = folder.text("rig.json", rig);
    let out = folder.path("out.glb");
    let report = done(&["predict", &file, "--rig", &rig, "-o", &out]);
    assert_eq!(report["predicted_distributions"], serde_json::json!(["kiss"]));
    let imported = import::gltf::read(Path::new(&out)).expect("a head");
    let kiss = imported.head.maps.distributions.iter().find(|d| d.name == "kiss").expect("kiss");
    // The sheet shrinks by a fifth (less where it is bent), which takes about an eighth of 2 %.
    assert!(kiss.bias.values.iter().all(|b| (0.0174..0.0182).contains(b)), "{:?}", kiss.bias.values[99]);
    let kind = |of: &str| imported.head.provenance.iter().find(|p| p.of == of).map(|p| p.kind);
    assert_eq!(kind("maps.distributions"), Some(ProvenanceKind::Predicted));
    let rig = imported.rig.expect("a rig");
    assert_eq!(rig["expressions"]["kiss"]["hemoglobin"]["kiss"], 1.0);
    assert!(rig["expressions"]["kiss"]["wrinkles"]["chin"].as_f64().is_some_and(|w| w > 0.4));
    // Fitted to its own prediction, the model is what it was.
    let fitted = done(&["predict", &out, "--fit"]);
    let coefficient = fitted["model"]["bias_per_compression"].as_f64();
    assert!(coefficient.is_some_and(|c| (c - 0.6).abs() < 0.02), "{coefficient:?}");
    refused(&folder, &["predict", &file, "--fit"], &["--fit", "no distribution"]);
    // Without an output it only says how far prediction and maps agree.
    let report = done(&["predict", &out]);
    assert_eq!(report["expressions"][0]["name"], "kiss");
    let wrong = folder.text("model.json", r#"{ "bias": 1 }"#);
    refused(&folder, &["predict", &file, "--model", &wrong], &["model.json", "bias"]);
}

#[test]
fn the_maps_of_a_head_come_out_as_they_are() {
    let folder = Folder::new();
    let file = folder.head("head.glb", &head());
    let list = done(&["list", &file]);
    let names: Vec<_> = list["maps"].as_array().expect("a list").iter().map(|m| m["name"].clone()).collect();
    assert!(names.contains(&"blush_bias".into()) && names.contains(&"zone_chin".into()), "{names:?}");
    let textures = list["on_the_graphics_card"].as_array().expect("a list");
    assert!(
        textures
            .iter()
            .any(|t| t["texture"] == "wrinkles" && t["bytes"].as_u64() > t["block_bytes"].as_u64())
    );
    let images = folder.path("images");
    done(&["extract", &file, "-o", &images]);
    let blood = load_image(&Path::new(&images).join("hemoglobin.exr")).expect("an image").map;
    let head = read(&file);
    assert_eq!(Some(blood), head.maps.hemoglobin);
    // The folder is one that `transfer` and `hemoglobin` take.
    let out = folder.path("out.glb");
    let report = done(&["transfer", "--from", &images, "--into", &file, "-o", &out]);
    assert_eq!(report["distributions"], serde_json::json!(["blush"]));
}

#[test]
fn a_new_map_shows_in_the_picture() {
    let rubor = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
        command.args(arguments).output().expect("the command starts")
    };
    if !support::can_draw() {
        return;
    }
    let folder = Folder::new();
    let file = folder.head("head.glb", &head());
    // Joy floods the left half of the texture.
    let joy = map(64, 64, |u, v| if u < 0.5 { 0.12 } else { 0.02 } + 0.004 * ripple(u, v));
    let joy = format!("joy={}", folder.image("joy.exr", &joy, SampleKind::F32));
    let out = folder.path("out.glb");
    done(&["hemoglobin", "--into", &file, "-o", &out, "--target", &joy, "--radius", "4"]);
    let sequence = r#"{ "fps": 1, "duration": 1, "expressions": { "joy": 1 }, "environment": { "name": "studio" },
        "camera": { "position": [0, 0, 0.6], "target": [0, 0, 0] } }"#;
    let sequence = folder.text("s.json", sequence);
    let picture = |extra: &[&str]| {
        let frames = folder.path("frames");
        let common = ["render", "--head", &out, "--sequence", &sequence, "-o", &frames, "--size", "96x96"];
        let plain = ["--no-export", "--no-video", "--antialias", "none"];
        let output = rubor(&[&common[..], &plain, extra].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::open(Path::new(&frames).join("frame.0001.png")).expect("a frame").into_rgb8()
    };
    let (flushed, still) = (picture(&[]), picture(&["--color", "static"]));
    let redness = |p: &image::RgbImage, x: u32| {
        let c = p.get_pixel(x, 48).0.map(f32::from);
        c[0] / (c[1] + 1.0)
    };
    let [red, pale] = [redness(&flushed, 38), redness(&still, 38)];
    // Light that skin sends to skin makes pale skin redder too: 1.14 times is left here.
    assert!(red > 1.1 * pale, "the left half is red: {red} and {pale}");
    assert!((redness(&flushed, 58) / redness(&still, 58) - 1.0).abs() < 0.06, "the right half is not");
    // The inset: dark on the left where the blood is, in the lower left corner.
    let inset = picture(&["--inset", "hemoglobin"]);
    let differs = |x: u32, y: u32| inset.get_pixel(x, y) != flushed.get_pixel(x, y);
    assert!(differs(10, 85) && !differs(60, 20));
    let grey = |x: u32| inset.get_pixel(x, 80).0[0];
    assert!(grey(9) < 40 && grey(27) > 120, "{} {}", grey(9), grey(27));
    let wrinkles = picture(&["--inset", "wrinkles"]);
    assert_ne!(wrinkles, inset);
    let output = rubor(&["render", "--inset", "melanin", "-o", &folder.path("frames")]);
    assert_eq!(output.status.code(), Some(2));
}

/// Name of a channel and its value at column and row.
type NamedChannel<'a> = (&'a str, &'a dyn Fn(f32, f32) -> f32);

/// An EXR of one part with these channels, each with a value for column and row.
fn exr(folder: &Folder, name: &str, side: usize, channels: &[NamedChannel<'_>]) -> String {
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};
    let channels = channels.iter().map(|(name, value)| {
        let samples = (0..side * side).map(|i| value((i % side) as f32, (i / side) as f32)).collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    });
    let image = Image::from_channels((side, side), AnyChannels::sort(channels.collect()));
    image.write().to_file(folder.path(name)).expect("a temporary image");
    folder.path(name)
}

/// Slopes of a test relief at a texel, and its unit normal.
fn relief(x: f32, y: f32) -> ([f32; 2], [f32; 3]) {
    let s = [0.3 * (x / 6.0).sin(), 0.2 * (y / 5.0).cos()];
    let z = 1.0 / (s[0] * s[0] + s[1] * s[1] + 1.0).sqrt();
    (s, [s[0] * z, s[1] * z, z])
}

#[test]
fn normal_maps_of_every_writing_give_the_same_slopes() {
    let folder = Folder::new();
    let out = folder.path("s.exr");
    let code = |c: usize| move |x: f32, y: f32| 0.5 + 0.5 * relief(x, y).1[c];
    let signed = |c: usize| move |x: f32, y: f32| relief(x, y).1[c];
    let lilac = |x: f32, _: f32| 0.4 + 0.01 * x;
    let alpha = |x: f32, _: f32| if x < 4.0 { 0.0 } else { 1.0 };
    let or_nan =
        |c: usize| move |x: f32, y: f32| if x < 4.0 { f32::NAN } else { 0.5 + 0.5 * relief(x, y).1[c] };
    let files = [
        exr(&folder, "codes.exr", 32, &[("R", &code(0)), ("G", &code(1)), ("B", &code(2))]),
        exr(&folder, "words.exr", 32, &[("red", &code(0)), ("green", &code(1)), ("blue", &code(2))]),
        exr(&folder, "signed.exr", 32, &[("X", &signed(0)), ("Y", &signed(1)), ("Z", &signed(2))]),
        exr(
            &folder,
            "layers.exr",
            32,
            &[
                ("V.Combined.R", &lilac),
                ("V.Combined.G", &alpha),
                ("V.Combined.B", &lilac),
                ("V.Normal.X", &signed(0)),
                ("V.Normal.Y", &signed(1)),
                ("V.Normal.Z", &signed(2)),
            ],
        ),
        exr(
            &folder,
            "alpha.exr",
            32,
            &[("R", &or_nan(0)), ("G", &or_nan(1)), ("B", &or_nan(2)), ("A", &alpha)],
        ),
    ];
    for (file, note) in files.iter().zip([None, None, Some("-1 to 1"), Some("layer"), None]) {
        let report = done(&["normals", file, "--to", "slopes", "-o", &out]);
        let notes = report["notes"].to_string();
        assert_eq!(notes != "null", note.is_some(), "{file}: {notes}");
        assert!(note.is_none_or(|n| notes.contains(n)), "{file}: {notes}");
        let slopes = load_image(Path::new(&out)).expect("slopes").map;
        for (i, s) in slopes.values.chunks_exact(2).enumerate().filter(|(i, _)| i % 32 >= 4) {
            let expected = relief((i % 32) as f32, (i / 32) as f32).0;
            let error = (s[0] - expected[0]).abs().max((s[1] - expected[1]).abs());
            assert!(error < 1e-5, "{file}, texel {i}: {s:?}, expected {expected:?}");
        }
        assert!(slopes.values.iter().all(|v| v.is_finite()));
        // A map less itself is nothing, whatever its numbers mean.
        done(&["normals", file, "--to", "difference", "--base", &files[0], "-o", &out]);
        let difference = load_image(Path::new(&out)).expect("a difference").map;
        let largest = (difference.values.chunks_exact(3).enumerate().filter(|(i, _)| i % 32 >= 4))
            .flat_map(|(_, d)| d)
            .fold(0.0f32, |m, v| m.max(v.abs()));
        assert!(largest < 1e-5 && difference.values.iter().all(|v| v.is_finite()), "{file}: {largest}");
    }
    // The user's layer goes before the one whose name fits; other images have none.
    let layer = |name: &str, to: &str| maps(&["normals", &files[3], "--to", to, "--layer", name, "-o", &out]);
    assert!(layer("Normal", "slopes").status.success());
    let said = |output: Output| String::from_utf8_lossy(&output.stderr).into_owned();
    // Lilac is no normal map: most of its texels are steep.
    let combined = layer("combined", "slopes");
    let steep = String::from_utf8_lossy(&combined.stdout).into_owned();
    assert!(combined.status.success() && !steep.contains("texels_beyond_45_degrees: 0"), "{steep}");
    let unknown = layer("beauty", "slopes");
    assert_eq!(unknown.status.code(), Some(2));
    assert!(said(unknown).contains("a layer of the file: \"V.Combined\", \"V.Normal\""));
    let grey = folder.image("height.png", &map(16, 16, |u, v| u * v), SampleKind::U8);
    refused(
        &folder,
        &["normals", &grey, "--to", "slopes", "--into", &folder.head("h.glb", &head())],
        &["grey picture"],
    );
}

#[test]
fn layers_of_blood_are_chosen_and_told() {
    let folder = Folder::new();
    let blood = |level: f32| move |x: f32, y: f32| level + 0.004 * (x * 0.9).sin() * (y * 0.7).cos();
    let neutral = blood(0.02);
    let joy = blood(0.03);
    let both: [NamedChannel<'_>; 2] = [("neutral.Y", &neutral), ("joy.Y", &joy)];
    let file = exr(&folder, "blood.exr", 32, &both);
    let manifest = format!(
        r#"{{ "neutral": {file:?}, "layer": "neutral", "radius_px": 4, "distributions": [
            {{ "name": "joy", "file": {file:?}, "layer": "joy" }} ] }}"#
    );
    let manifest = folder.text("manifest.json", &manifest);
    let results = folder.path("results");
    let report = done(&["hemoglobin", "--manifest", &manifest, "-o", &results]);
    assert!(report["notes"].is_null(), "{report}");
    let bias = load_image(&Path::new(&results).join("joy_bias.exr")).expect("a result").map;
    assert!((bias.sample(0.5, 0.5, 0) - 0.03).abs() < 1e-3, "{}", bias.sample(0.5, 0.5, 0));
    // Without a name the reader chooses and says so.
    let target = format!("joy={file}");
    let report =
        done(&["hemoglobin", "--neutral", &file, "--target", &target, "--radius", "4", "-o", &results]);
    assert!(report["notes"].to_string().contains("the file also holds"), "{report}");
    let flag = ["hemoglobin", "--neutral", &file, "--target", &target, "--radius", "4", "--layer", "joy"];
    let report = done(&[&flag[..], &["-o", &results]].concat());
    assert!(report["notes"].is_null(), "{report}");
    let compared = done(&[
        "compare",
        "--neutral",
        &file,
        "--target",
        &file,
        "--radius",
        "4",
        "--size",
        "16",
        "--layer",
        "joy",
    ]);
    assert!(compared["notes"].is_null());
    let compared = maps(&["compare", "--neutral", &file, "--target", &file, "--radius", "4", "--size", "16"]);
    let said = String::from_utf8_lossy(&compared.stderr).into_owned();
    assert_eq!(said.matches("note: ").count(), 1, "{said}");
}

#[test]
fn names_of_a_head_write_nothing_outside_of_the_folder() {
    let folder = Folder::new();
    let victim = folder.path("victim");
    std::fs::create_dir(&victim).expect("a folder");
    let mut evil = head();
    let absolute = format!("{victim}/absolute");
    let distribution = evil.maps.distributions.remove(0);
    for name in ["../victim/evil", &absolute, "a/b", "a\\b"] {
        evil.maps.distributions.push(Distribution { name: name.into(), ..distribution.clone() });
    }
    evil.maps.zones[0].name = "../../victim/zone".into();
    let evil = folder.head("evil.glb", &evil);
    let mean = folder.image("mean.exr", &flat(32, 0.02), SampleKind::F32);
    let out = folder.path("out");
    let report = done(&["transfer", "--from", &evil, "--to-mean", &mean, "-o", &out]);
    assert!(report["notes"].to_string().contains(".._victim_evil"), "{report}");
    let all = folder.path("all");
    let report = done(&["extract", &evil, "-o", &all]);
    assert!(report["notes"].to_string().contains("zone"), "{report}");
    assert_eq!(std::fs::read_dir(&victim).expect("the folder").count(), 0);
    let written = std::fs::read_dir(&out).expect("results").count();
    assert_eq!(written, 9, "two files per distribution and the mean");
    for name in ["a_b_scale.exr", "a_b_1_bias.exr", ".._victim_evil_scale.exr"] {
        assert!(Path::new(&out).join(name).is_file() && Path::new(&all).join(name).is_file(), "{name}");
    }
    assert_eq!(std::fs::read_dir(folder.0.path()).expect("the folder").count(), 5);
    let name = format!("{absolute}=x.png");
    let arguments = ["hemoglobin", "--neutral", &mean, "--target", &name, "--into", &evil];
    refused(&folder, &arguments, &["a name of its own"]);
}
