//! `rubor import` of a scan and the maps beside it.

use std::path::Path;
use std::process::{Command, Output};

use glam::{Vec2, Vec3};
use rubor_assets::image_io::{SampleKind, save_image};
use rubor_assets::import;
use rubor_rig::head::Head;
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

struct Scan(tempfile::TempDir);

impl Scan {
    /// A bowl of 0.2 m without a material, as scans come.
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let n = 9;
        let mut text = String::new();
        let mut uvs = String::new();
        for y in 0..n {
            for x in 0..n {
                let uv = Vec2::new(x as f32, y as f32) / (n - 1) as f32;
                let p = Vec3::new(0.2 * uv.x - 0.1, 0.2 * uv.y, -0.3 * (uv - 0.5).length_squared());
                text += &format!("v {} {} {}\n", p.x, p.y, p.z);
                uvs += &format!("vt {} {}\n", uv.x, uv.y);
            }
        }
        text += &uvs;
        for y in 1..n {
            for x in 1..n {
                let at = |dx: usize, dy: usize| (y - 1 + dy) * n + x + dx;
                let corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)].map(|i| format!("{i}/{i}"));
                text += &format!("f {}\n", corners.join(" "));
            }
        }
        std::fs::write(folder.path().join("scan.obj"), text).expect("a temporary mesh");
        Self(folder)
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    fn image(&self, name: &str, map: &Map) -> String {
        save_image(&self.0.path().join(name), map, SampleKind::U8).expect("a temporary image");
        self.path(name)
    }

    fn import(&self, arguments: &[&str]) -> Output {
        let (scan, out) = (self.path("scan.obj"), self.path("head.glb"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
        command.args(["import", &scan, "--units", "m", "--maps", "256", "-o", &out]).args(arguments);
        command.output().expect("the command starts")
    }

    /// The head, and what was said.
    fn head(&self, arguments: &[&str]) -> (Head, String) {
        let output = self.import(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?} said {said}");
        (import::gltf::read(Path::new(&self.path("head.glb"))).expect("a head").head, said)
    }
}

fn map(side: u32, channels: u32, value: impl Fn(f32, f32, u32) -> f32) -> Map {
    let texel = |i: u32| (((i % side) as f32 + 0.5) / side as f32, ((i / side) as f32 + 0.5) / side as f32);
    let values = (0..side * side).flat_map(|i| (0..channels).map(move |c| (i, c)));
    Map {
        width: side,
        height: side,
        channels,
        values: values.map(|(i, c)| value(texel(i).0, texel(i).1, c)).collect(),
    }
}

#[test]
fn one_command_makes_a_head_of_a_scan_and_its_maps() {
    let scan = Scan::new();
    let skin = SkinModel::new(&ChromophoreModel::default()).bake(32, 32).sample(0.05, 0.03);
    let albedo =
        scan.image("color.png", &map(64, 3, |_, _, c| rubor_rig::color::srgb_encode(skin[c as usize])));
    // Leans to +x by a slope of 0.25 everywhere.
    let normal = Vec3::new(0.25, 0.0, 1.0).normalize().to_array();
    let normals = scan.image("normals.png", &map(32, 3, |_, _, c| 0.5 + 0.5 * normal[c as usize]));
    let wave = |u: f32, _: f32, _: u32| 0.5 + 0.5 * (std::f32::consts::TAU * 32.0 * u).sin();
    let heights = scan.image("heights.png", &map(256, 1, wave));
    let gloss = scan.image("gloss.png", &map(16, 1, |u, _, _| u));
    let flags = ["--albedo", &albedo, "--normal", &normals, "--displacement", &heights];
    let more = ["--displacement-mm", "0.5", "--specular", &gloss, "--specular-gain", "0.5"];
    let (head, said) = scan.head(&[&flags[..], &more[..]].concat());
    assert!(said.contains("taken for skin") && said.contains("the outline stays"), "{said}");

    let mean = |m: &Map, c: usize| {
        let values = m.values.iter().skip(c).step_by(m.channels as usize);
        values.sum::<f32>() / (m.width * m.height) as f32
    };
    let maps = &head.maps;
    let (melanin, hemoglobin) = (maps.melanin.as_ref().unwrap(), maps.hemoglobin.as_ref().unwrap());
    assert!((mean(melanin, 0) - 0.05).abs() < 0.01, "{}", mean(melanin, 0));
    assert!((mean(hemoglobin, 0) - 0.03).abs() < 0.006, "{}", mean(hemoglobin, 0));
    // The normal map's slope in the mean; the displacement's on top: 32 waves of 0.25 mm over about 200 mm.
    let slopes = maps.slopes.as_ref().unwrap();
    assert_eq!((slopes.width, slopes.channels), (256, 2));
    assert!((mean(slopes, 0) - 0.25).abs() < 0.02 && mean(slopes, 1).abs() < 0.02, "{}", mean(slopes, 0));
    let steepest = slopes.values.iter().step_by(2).map(|s| (s - 0.25).abs()).fold(0.0, f32::max);
    let expected = std::f32::consts::TAU * 32.0 * 0.25 / 200.0;
    assert!((0.6..1.1).contains(&(steepest / expected)), "{steepest} for {expected}");
    let specular = maps.specular.as_ref().unwrap();
    assert!((mean(specular, 0) - 0.25).abs() < 0.01 && (mean(specular, 1) - 0.32).abs() < 0.01);
}

#[test]
fn relief_alone_replaces_what_is_synthesised() {
    let scan = Scan::new();
    let normal = Vec3::new(0.0, 0.5, 1.0).normalize().to_array();
    let normals = scan.image("normals.png", &map(16, 3, |_, _, c| 0.5 + 0.5 * normal[c as usize]));
    let (head, _) = scan.head(&["--normal", &normals]);
    let slopes = head.maps.slopes.as_ref().unwrap();
    assert_eq!(slopes.width, 16);
    assert!(slopes.values.iter().skip(1).step_by(2).all(|s| (s - 0.5).abs() < 0.02));
    assert!(head.maps.melanin.is_some(), "the rest is synthesised");
    let (head, _) = scan.head(&["--normal", &normals, "--directx"]);
    assert!(head.maps.slopes.as_ref().unwrap().values[1] < -0.4, "green downwards");
}

#[test]
fn what_does_not_fit_is_said() {
    let scan = Scan::new();
    let grey = scan.image("grey.png", &map(8, 1, |_, _, _| 0.5));
    let color = scan.image("color.png", &map(8, 3, |_, _, c| 0.2 + 0.2 * c as f32));
    for (arguments, phrase) in [
        (vec!["--displacement", &grey[..]], "--displacement-mm"),
        (vec!["--displacement", &grey, "--displacement-mm", "0"], "millimetres from black to white"),
        (vec!["--displacement", &color, "--displacement-mm", "1"], "grey"),
        (vec!["--normal", &grey], "a grey picture"),
        (vec!["--specular", &grey, "--specular-gain", "0"], "positive"),
        (vec!["--albedo", "nowhere.png"], "nowhere.png"),
    ] {
        let output = scan.import(&arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?} said {said}");
        assert!(said.contains(phrase), "{arguments:?} said {said:?}, expected {phrase:?}");
        assert!(!Path::new(&scan.path("head.glb")).exists(), "{arguments:?} left a head");
    }
}
