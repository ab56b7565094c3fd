//! A head written as `.glb` and read again is the same head.

use std::path::Path;

use glam::{Quat, Vec2, Vec3};
use rubor_assets::error::{ExportError, ImportError};
use rubor_assets::export::gltf::{Frame, MapEncoding, MapEncodings, Options, to_bytes};
use rubor_assets::import::gltf::from_bytes;
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, Part, Provenance, ProvenanceKind, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;

/// A bumpy grid of 21 x 21 points with a texture seam in the middle column, and a second part above it.
fn head() -> Head {
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
    let shapes = vec![
        BlendShape {
            name: "few".into(),
            points: vec![3, 17, 200],
            offsets: vec![Vec3::new(0.1, -0.2, 1e-7); 3],
        },
        BlendShape {
            name: "all".into(),
            offsets: all.iter().map(|i| Vec3::splat(1e-4 * (*i as f32 + 1.0))).collect(),
            points: all,
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

fn options() -> Options {
    Options { rig: Some(serde_json::json!({"expressions": {"joy": {}}})), ..Options::default() }
}

fn assert_maps_equal(a: &Map, b: &Map, levels: f32, what: &str) {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels), "{what}");
    for c in 0..a.channels as usize {
        let of =
            |m: &Map| m.values.iter().skip(c).step_by(m.channels as usize).copied().collect::<Vec<f32>>();
        let (x, y) = (of(a), of(b));
        let range = x.iter().fold(f32::MIN, |m, v| m.max(*v)) - x.iter().fold(f32::MAX, |m, v| m.min(*v));
        // Half a step, and the rounding of the arithmetic.
        let bound = 0.5001 * range / levels + 1e-6;
        let worst = x.iter().zip(&y).map(|(p, q)| (p - q).abs()).fold(0.0, f32::max);
        assert!(worst <= bound, "{what}, channel {c}: {worst} > {bound}");
    }
}

#[test]
fn geometry_is_exact_and_maps_are_within_half_a_step() {
    let head = head();
    let bytes = to_bytes(&head, &options()).unwrap();
    let read = from_bytes(&bytes, Path::new("test.glb")).unwrap();
    assert_eq!(read.rig, options().rig);
    let read = read.head;
    assert_eq!(read.name, head.name);
    assert_eq!(read.mesh.points, head.mesh.points);
    assert_eq!(read.mesh.parts, head.mesh.parts);
    assert_eq!(read.shapes, head.shapes);
    assert_eq!(read.landmarks, head.landmarks);
    assert_eq!(read.provenance, head.provenance);
    // Vertices are renumbered by first use; the corners of triangles stay.
    let corners = |h: &Head| -> Vec<Vertex> {
        h.mesh.triangles.as_flattened().iter().map(|v| h.mesh.vertices[*v as usize]).collect()
    };
    assert_eq!(corners(&read), corners(&head));
    for (a, b) in head.mesh.occlusion.iter().zip(&read.mesh.occlusion) {
        assert!((a - b).abs() <= 0.5001 / 65535.0);
    }
    let (m, r) = (&head.maps, &read.maps);
    let pairs = [(&m.melanin, &r.melanin), (&m.slopes, &r.slopes), (&m.specular, &r.specular)];
    for (a, b) in pairs {
        assert_maps_equal(a.as_ref().unwrap(), b.as_ref().unwrap(), 255.0, "8-bit map");
    }
    assert_maps_equal(m.hemoglobin.as_ref().unwrap(), r.hemoglobin.as_ref().unwrap(), 255.0, "constant map");
    assert_maps_equal(m.scattering.as_ref().unwrap(), r.scattering.as_ref().unwrap(), 255.0, "scattering");
    assert_maps_equal(&m.wrinkle_slopes[0], &r.wrinkle_slopes[0], 255.0, "wrinkles");
    assert_maps_equal(&m.distributions[0].scale, &r.distributions[0].scale, 65535.0, "scale");
    assert_maps_equal(&m.distributions[0].bias, &r.distributions[0].bias, 65535.0, "bias");
    assert_eq!(r.zones.len(), 5);
    for (a, b) in m.zones.iter().zip(&r.zones) {
        assert_eq!((&a.name, a.wrinkle_map), (&b.name, b.wrinkle_map));
        let worst = a.mask.values.iter().zip(&b.mask.values).map(|(p, q)| (p - q).abs()).fold(0.0, f32::max);
        assert!(worst <= 0.5001 / 255.0, "{}: {worst}", a.name);
    }
    // Written again, the file is the same: nothing drifts.
    assert_eq!(
        read.mesh,
        from_bytes(&to_bytes(&read, &options()).unwrap(), Path::new("again.glb")).unwrap().head.mesh
    );
}

#[test]
fn the_same_head_gives_the_same_bytes() {
    assert_eq!(to_bytes(&head(), &options()).unwrap(), to_bytes(&head(), &options()).unwrap());
}

#[test]
fn jpeg_maps_are_smaller_and_close() {
    let mut head = head();
    let smooth = |x: u32, y: u32| 0.2 + 0.1 * ((x as f32 * 0.05).sin() + (y as f32 * 0.04).cos());
    let values = (0..128 * 128).map(|i| smooth(i % 128, i / 128)).collect();
    head.maps.melanin = Some(Map { width: 128, height: 128, channels: 1, values });
    let maps = MapEncodings { melanin: MapEncoding::Jpeg(92), ..MapEncodings::default() };
    let small = to_bytes(&head, &Options { maps, ..options() }).unwrap();
    assert!(small.len() < to_bytes(&head, &options()).unwrap().len());
    let read = from_bytes(&small, Path::new("small.glb")).unwrap().head.maps.melanin.unwrap();
    let a = head.maps.melanin.unwrap();
    let worst = a.values.iter().zip(&read.values).map(|(p, q)| (p - q).abs()).fold(0.0, f32::max);
    assert!(worst < 0.02, "{worst}");
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_never_a_panic() {
    let bytes = to_bytes(&head(), &Options::default()).unwrap();
    for length in (0..64).chain((64..bytes.len()).step_by(997)) {
        assert!(from_bytes(&bytes[..length], Path::new("cut.glb")).is_err(), "cut at {length}");
    }
    let error = from_bytes(&bytes[..bytes.len() / 2], Path::new("cut.glb")).unwrap_err().to_string();
    assert!(error.contains("cut.glb") && error.contains(&format!("{} bytes", bytes.len())), "{error}");
}

#[test]
fn flipped_bytes_never_panic() {
    let bytes = to_bytes(&head(), &Options { normal_map_size: 0, ..Options::default() }).unwrap();
    let mut state = 7_u32;
    let mut errors = 0;
    for _ in 0..300 {
        let mut broken = bytes.clone();
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // The document and the start of the data, where most ranges stand.
        let at = (state >> 8) as usize % bytes.len().min(12_000);
        broken[at] = broken[at].wrapping_add((state >> 3) as u8 | 1);
        errors += u32::from(from_bytes(&broken, Path::new("broken.glb")).is_err());
    }
    assert!(errors > 50, "{errors} of 300 noticed");
}

#[test]
fn another_version_of_the_extension_is_refused() {
    let bytes = to_bytes(&head(), &options()).unwrap();
    let key = b"\"version\":1";
    let at = bytes.windows(key.len()).position(|w| w == key).expect("the version stands in the document");
    let at = at + key.len() - 1;
    let mut newer = bytes.clone();
    newer[at] = b'9';
    let error = from_bytes(&newer, Path::new("newer.glb")).unwrap_err();
    assert!(matches!(&error, ImportError::Content { found, .. } if found == "version 9"), "{error}");
}

#[test]
fn frames_must_fit_the_head() {
    let head = head();
    let frame = |time_s, count| Frame {
        time_s,
        weights: vec![0.0; count],
        rotation: Quat::IDENTITY,
        translation: Vec3::ZERO,
    };
    let with = |frames| to_bytes(&head, &Options { frames, ..Options::default() });
    let good = with(vec![frame(0.0, 3), frame(0.5, 3)]).unwrap();
    assert!(from_bytes(&good, Path::new("animated.glb")).is_ok());
    for bad in [vec![frame(0.0, 2)], vec![frame(0.5, 3), frame(0.5, 3)], vec![frame(f32::NAN, 3)]] {
        assert!(matches!(with(bad), Err(ExportError::Content { .. })));
    }
}
