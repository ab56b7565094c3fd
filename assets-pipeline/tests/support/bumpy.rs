//! A head with everything that a file can hold, made of waves.

use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use rubor_rig::expression::Rig;
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, OcclusionChange, Part, Provenance, ProvenanceKind,
    Vertex, WrinkleZone,
};
use rubor_rig::map::Map;

/// A bumpy grid of 21 x 21 points with a texture seam in the middle column, and a second part above it.
pub fn head() -> Head {
    let n = 21_u32;
    let mut mesh = Mesh::default();
    for y in 0..n {
        for x in 0..n {
            let (u, v) = (x as f32 / 20.0, y as f32 / 20.0);
            mesh.points.push(Vec3::new(u * 0.1, v * 0.13, 0.01 * (u * 9.0).sin() * (v * 7.0).cos()));
        }
    }
    for half in 0..2 {
        let (from, to) = if half == 0 { (0, 10) } else { (10, 20) };
        for y in 0..20 {
            for x in from..to {
                let first = mesh.vertices.len() as u32;
                for (dx, dy) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                    let (x, y) = (x + dx, y + dy);
                    let uv = Vec2::new(x as f32 / 40.0 + 0.5 * half as f32, 1.0 - y as f32 / 20.0);
                    mesh.vertices.push(Vertex { point: y * n + x, uv });
                }
                mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
    }
    let skin = mesh.triangles.len() as u32;
    let first = mesh.points.len() as u32;
    mesh.points.extend([Vec3::new(0.0, 0.2, 0.0), Vec3::new(0.1, 0.2, 0.0), Vec3::new(0.0, 0.3, 0.0)]);
    let vertex = mesh.vertices.len() as u32;
    mesh.vertices.extend((first..first + 3).map(|point| Vertex { point, uv: Vec2::splat(0.5) }));
    mesh.triangles.push([vertex, vertex + 1, vertex + 2]);
    mesh.parts = vec![
        Part { name: "skin".into(), material: Material::Skin, triangles: 0..skin },
        Part { name: "shell".into(), material: Material::Wet, triangles: skin..skin + 1 },
    ];
    mesh.occlusion = (0..mesh.points.len()).map(|i| (i % 7) as f32 / 6.0).collect();
    let all: Vec<u32> = (0..first).collect();
    // Whole steps of the file.
    let change = |point, half: i8, full: i8| OcclusionChange {
        point,
        at_half: f32::from(half) / 127.0,
        at_full: f32::from(full) / 127.0,
    };
    let changes = vec![change(1, -30, -31), change(3, 0, 127), change(200, 4, -127)];
    let shapes = vec![
        BlendShape {
            name: "few".into(),
            points: vec![3, 17, 200],
            offsets: vec![Vec3::new(0.1, -0.2, 1e-7); 3],
            occlusion: changes,
        },
        BlendShape {
            name: "all".into(),
            offsets: all.iter().map(|i| Vec3::splat(1e-4 * (*i as f32 + 1.0))).collect(),
            points: all,
            occlusion: Vec::new(),
        },
        BlendShape { name: "none".into(), ..BlendShape::default() },
    ];
    let wave = |width: u32, height: u32, channels: u32, low: f32, high: f32| {
        let count = width * height * channels;
        let values = (0..count).map(|i| low + (high - low) * (0.5 + 0.5 * (i as f32 * 0.37).sin())).collect();
        Map { width, height, channels, values }
    };
    let mut head = Head { name: "test head".into(), mesh, shapes, ..Head::default() };
    head.maps.melanin = Some(wave(33, 17, 1, 0.01, 0.4));
    head.maps.hemoglobin = Some(Map::filled(4, 4, &[0.05]));
    head.maps.slopes = Some(wave(16, 9, 2, -0.8, 1.3));
    head.maps.wrinkle_slopes = vec![wave(8, 8, 2, -2.0, 2.0)];
    head.maps.hemoglobin_mean = Some(wave(8, 8, 1, 0.0, 0.1));
    head.maps.distributions = vec![Distribution {
        name: "joy".into(),
        scale: wave(8, 8, 1, 0.0, 3.0),
        bias: wave(8, 8, 1, 0.0, 0.3),
    }];
    head.maps.zones = (0..5)
        .map(|i| WrinkleZone {
            name: format!("zone-{i}"),
            wrinkle_map: 0,
            mask: wave(8, 6, 1, 0.0, 0.2 * i as f32),
        })
        .collect();
    head.maps.specular = Some(wave(8, 8, 2, 0.1, 0.9));
    head.maps.scattering = Some(wave(8, 8, 1, 0.0, 1.0));
    head.landmarks.insert("pronasale".into(), Vec3::new(0.1, 0.2, 0.3));
    head.provenance = vec![Provenance {
        of: "geometry".into(),
        kind: ProvenanceKind::Synthesised,
        source: "test".into(),
        licence: "CC0-1.0".into(),
    }];
    head
}

/// A rig whose one expression moves two shapes and colours the face.
pub fn rig() -> &'static Rig {
    static RIG: OnceLock<Rig> = OnceLock::new();
    RIG.get_or_init(|| {
        let text = r#"{"expressions": {"joy": {
            "shapes": {"few": 1, "all": 0.5}, "hemoglobin": {"joy": 1}, "wrinkles": {"zone-4": 1}
        }}}"#;
        Rig::from_json("rig.json", text).unwrap()
    })
}

/// The JSON chunk of a GLB.
pub fn document(bytes: &[u8]) -> serde_json::Value {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}
