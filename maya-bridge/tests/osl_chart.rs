//! The OSL shader against the renderer's model on a chart of skin patches, rendered by Blender's Cycles.
//!
//! Needs a Python with the package `bpy` (Blender as a module): `RUBOR_BPY_PYTHON=/path/to/python`.

use std::path::Path;
use std::process::Command;

use glam::{Vec2, Vec3};
use rubor_maya::write::{self, Performance};
use rubor_rig::color::srgb_encode;
use rubor_rig::expression::Rig;
use rubor_rig::head::{Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::hemoglobin::blend;
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use rubor_rig::timeline::Sequence;
use serde_json::{Value, json};

const SIDE: u32 = 32;

/// A map of values given by place, 0 to 1.
fn map(side: u32, value: impl Fn(f32, f32) -> f32) -> Map {
    let at = |i: u32| (i as f32 + 0.5) / side as f32;
    let values = (0..side * side).map(|i| value(at(i % side), at(i / side))).collect();
    Map { width: side, height: side, channels: 1, values }
}

fn slopes(side: u32, amount: f32) -> Map {
    let one = map(side, |x, y| amount * (9.0 * x).sin() * y);
    let two = map(side, |x, y| amount * (7.0 * y).cos() * x);
    let values = one.values.iter().zip(&two.values).flat_map(|(a, b)| [*a, *b]).collect();
    Map { channels: 2, values, ..one }
}

/// Every mix of melanin (across) and hemoglobin (down), with three distributions and two zones.
fn chart() -> Head {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let mesh = Mesh {
        points: vec![corner(0.0, 0.0), corner(0.1, 0.0), corner(0.0, 0.1)],
        vertices: (0..3).map(|point| Vertex { point, uv: Vec2::ZERO }).collect(),
        triangles: vec![[0, 1, 2]],
        parts: vec![Part { name: "face".into(), material: Material::Skin, triangles: 0..1 }],
        ..Mesh::default()
    };
    let distribution = |name: &str, k: f32| Distribution {
        name: name.into(),
        scale: map(8, |x, y| 0.6 + k * x + 0.3 * y),
        bias: map(8, |x, y| 0.01 + 0.05 * k * y + 0.02 * x),
    };
    let maps = SkinMaps {
        melanin: Some(map(SIDE, |x, _| 0.5 * x * x * x)),
        hemoglobin: Some(map(SIDE, |_, y| 0.32 * y * y * y)),
        hemoglobin_mean: Some(map(8, |x, y| 0.03 + 0.01 * x + 0.1 * y * y)),
        distributions: vec![distribution("joy", 0.4), distribution("anger", 1.1), distribution("fear", 0.1)],
        slopes: Some(slopes(SIDE, 0.2)),
        wrinkle_slopes: vec![slopes(SIDE, 0.7), slopes(SIDE, -0.4)],
        zones: vec![
            WrinkleZone { name: "forehead".into(), wrinkle_map: 0, mask: map(8, |x, _| x) },
            WrinkleZone { name: "nose".into(), wrinkle_map: 1, mask: map(8, |_, y| y) },
        ],
        ..SkinMaps::default()
    };
    Head { name: "chart".into(), mesh, maps, ..Head::default() }
}

/// Parameters of the shader as the scene has them.
fn parameters(scene: &str) -> serde_json::Map<String, Value> {
    let mut found = serde_json::Map::new();
    for line in scene.lines().filter_map(|l| l.trim().strip_prefix("setAttr \".param_")) {
        let (name, value) = line.split_once("\" ").unwrap();
        let value = value.trim_end_matches(';');
        let value = match value.strip_prefix("-type \"string\" ") {
            Some(text) => Value::from(text.trim_matches('"')),
            None if name.ends_with("count") || name.ends_with("size") || name.starts_with("zone_map") => {
                Value::from(value.parse::<i64>().unwrap())
            }
            None => Value::from(value.parse::<f64>().unwrap()),
        };
        found.insert(name.into(), value);
    }
    found
}

#[test]
fn the_shader_agrees_with_the_renderer_within_a_step_of_255() {
    let Some(python) = std::env::var_os("RUBOR_BPY_PYTHON") else {
        eprintln!("SKIPPED: RUBOR_BPY_PYTHON is not set, the OSL shader was neither compiled nor rendered");
        return;
    };
    let head = chart();
    let rig = Rig::default();
    let sequence = Sequence::still(24.0, 1.0);
    let scene = write::to_scene(
        &head,
        Some(Performance { rig: &rig, sequence: &sequence }),
        &write::Options::default(),
        "chart",
    )
    .unwrap();
    let folder = std::env::temp_dir().join(format!("rubor-osl-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (name, bytes) in &scene.files {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(128, 128);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/osl_chart.py");
    for (weights, zones, global) in [
        ([0.0, 0.0, 0.0], [0.0, 0.0], 1.0),
        ([0.5, 0.2, 0.1], [0.8, 0.6], 1.27),
        ([0.0, 1.0, 0.0], [1.0, 1.0], 0.81),
    ] {
        let mut parameters = parameters(&scene.text);
        assert!(parameters.len() > 30, "{}", parameters.len());
        for (i, w) in weights.iter().enumerate() {
            parameters.insert(format!("distribution_weight_{i}"), json!(w));
        }
        for (i, w) in zones.iter().enumerate() {
            parameters.insert(format!("zone_weight_{i}"), json!(w));
        }
        parameters.insert("hemoglobin_scale".into(), json!(global));
        let chart = json!({ "side": SIDE, "parameters": parameters });
        std::fs::write(folder.join("chart.json"), chart.to_string()).unwrap();
        let run = Command::new(&python).arg(&script).arg(&folder).output().unwrap();
        let said = String::from_utf8_lossy(&run.stdout).into_owned() + &String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{said}");
        let text = std::fs::read_to_string(folder.join("chart_out.json")).unwrap();
        let out: Value = serde_json::from_str(&text).unwrap();
        let rendered = |what: &str, i: usize| -> [f32; 3] {
            [0, 1, 2].map(|c| out[what][i][c].as_f64().unwrap() as f32)
        };

        let maps = &head.maps;
        let (melanin, neutral) = (maps.melanin.as_ref().unwrap(), maps.hemoglobin.as_ref().unwrap());
        let mean = maps.hemoglobin_mean.as_ref().unwrap();
        let blood = blend(neutral, mean, &maps.distributions, &weights, global);
        let (mut worst, mut worst_normal) = (0.0_f32, 0.0_f32);
        for i in 0..(SIDE * SIDE) as usize {
            let expected = lookup.sample(melanin.values[i], blood.values[i]);
            let found = rendered("outColor", i);
            for c in 0..3 {
                let difference = srgb_encode(found[c].max(0.0)) - srgb_encode(expected[c].max(0.0));
                worst = worst.max(difference.abs());
            }
            let (x, y) = ((i as u32 % SIDE) as f32 + 0.5, (i as u32 / SIDE) as f32 + 0.5);
            let (u, v) = (x / SIDE as f32, y / SIDE as f32);
            let mut slope = Vec2::from_slice(&maps.slopes.as_ref().unwrap().values[2 * i..2 * i + 2]);
            for (zone, weight) in maps.zones.iter().zip(zones) {
                let weight = (weight * zone.mask.sample(u, v, 0)).clamp(0.0, 1.0);
                let wrinkles = &maps.wrinkle_slopes[zone.wrinkle_map as usize];
                slope += weight * Vec2::from_slice(&wrinkles.values[2 * i..2 * i + 2]);
            }
            let normal = Vec3::new(slope.x, slope.y, 1.0).normalize();
            worst_normal =
                worst_normal.max((Vec3::from(rendered("outNormal", i)) - normal).abs().max_element());
        }
        eprintln!("weights {weights:?}: colour {:.4}/255, normal {worst_normal:.5}", 255.0 * worst);
        assert!(worst <= 1.0 / 255.0, "weights {weights:?}: {} of 255", 255.0 * worst);
        assert!(worst_normal < 2e-3, "weights {weights:?}: {worst_normal}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
