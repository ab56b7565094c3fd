//! A head written as `.glb` and read again is the same head.

mod support;

use std::path::Path;

use rubor_assets::error::{ExportError, ImportError};
use rubor_assets::export::gltf::{MapEncoding, MapEncodings, Options, export, to_bytes};
use rubor_assets::export::{TextureFormat, top_shapes};
use rubor_assets::import::gltf::from_bytes;
use rubor_rig::head::{Head, Vertex};
use rubor_rig::map::Map;
use rubor_rig::timeline::Sequence;

use support::bumpy::{document, head, rig};

fn options() -> Options<'static> {
    Options { rig: Some(rig()), ..Options::default() }
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
    assert_eq!(read.rig, Some(serde_json::to_value(rig()).unwrap()));
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

fn sequence(text: &str) -> Sequence {
    Sequence::from_json("sequence.json", text).unwrap()
}

#[test]
fn a_performance_is_animated_as_it_is_written_and_carried_along() {
    let head = head();
    for (ease, interpolation) in [("step", "STEP"), ("linear", "LINEAR"), ("smooth", "CUBICSPLINE")] {
        let sequence = sequence(&format!(
            r#"{{"fps": 24, "duration": 1, "shapes": {{
                "few": [{{"t": 0, "v": 0, "ease": "{ease}"}}, {{"t": 0.5, "v": 1, "ease": "{ease}"}}, {{"t": 1, "v": 0.25}}]
            }}, "head": {{"translation": [{{"t": 0, "v": [0, 0, 0]}}, {{"t": 1, "v": [0, 0.01, 0]}}]}}}}"#
        ));
        let bytes = to_bytes(&head, &Options { sequence: Some(&sequence), ..options() }).unwrap();
        let json = document(&bytes);
        let animation = &json["animations"][0];
        let paths: Vec<&str> =
            (0..2).map(|i| animation["channels"][i]["target"]["path"].as_str().unwrap()).collect();
        assert_eq!(paths, ["translation", "weights"], "the head does not turn");
        assert_eq!(animation["samplers"][1]["interpolation"], interpolation);
        assert_eq!(
            json["accessors"][animation["samplers"][1]["input"].as_u64().unwrap() as usize]["count"],
            3
        );
        let read = from_bytes(&bytes, Path::new("animated.glb")).unwrap();
        assert_eq!(read.sequence, Some(serde_json::to_value(&sequence).unwrap()));
        assert_eq!(read.head.shapes, head.shapes);
    }
    let unknown = sequence(r#"{"fps": 24, "duration": 1, "expressions": {"fury": 1}}"#);
    let error = to_bytes(&head, &Options { sequence: Some(&unknown), ..options() }).unwrap_err();
    assert!(matches!(error, ExportError::Content { .. }) && error.to_string().contains("fury"), "{error}");
}

#[test]
fn shapes_carry_the_colour_of_their_expression() {
    let head = head();
    let bytes = to_bytes(&head, &Options { shape_colors: true, ..options() }).unwrap();
    let json = document(&bytes);
    let skin = &json["meshes"][0]["primitives"][0];
    assert!(skin["attributes"]["COLOR_0"].is_u64());
    assert!(skin["targets"].as_array().unwrap().iter().all(|t| t["COLOR_0"].is_u64()));
    assert!(json["meshes"][0]["primitives"][1]["attributes"]["COLOR_0"].is_null(), "only skin is coloured");
    // Shares of the expression are as its weights: 1 of "few" and 0.5 of "all" bring the whole colour back.
    let largest = |target: usize| -> f64 {
        let accessor = &json["accessors"][skin["targets"][target]["COLOR_0"].as_u64().unwrap() as usize];
        let numbers = |k: &str| {
            accessor[k].as_array().unwrap().iter().map(|v| v.as_f64().unwrap().abs()).fold(0.0, f64::max)
        };
        numbers("min").max(numbers("max"))
    };
    let (few, all, none) = (largest(0), largest(1), largest(2));
    // Steps of 1/32767, each rounded.
    assert!(few > 300.0 && (all - 0.5 * few).abs() <= 0.75 && none == 0.0, "{few} {all} {none}");
    assert_eq!(from_bytes(&bytes, Path::new("colored.glb")).unwrap().head.shapes, head.shapes);
}

#[test]
fn a_pose_bakes_blood_wrinkles_and_weights() {
    let head = head();
    let pose = {
        let sequence = sequence(r#"{"fps": 24, "duration": 1, "expressions": {"joy": 1}}"#);
        rubor_rig::evaluate::Evaluator::new(&head, rig(), &sequence).unwrap().0.face_at(0.5)
    };
    let picture = |bytes: &[u8], name: &str| {
        let json = document(bytes);
        let image = json["images"].as_array().unwrap().iter().find(|i| i["name"] == name).unwrap();
        let view = &json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let start = 28
            + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize
            + view["byteOffset"].as_u64().unwrap() as usize;
        bytes[start..start + view["byteLength"].as_u64().unwrap() as usize].to_vec()
    };
    let still = Options { textures: TextureFormat::Png, ..options() };
    let posed = Options { pose: Some(pose), shape_colors: true, ..still.clone() };
    let (still, posed) = (to_bytes(&head, &still).unwrap(), to_bytes(&head, &posed).unwrap());
    for name in ["base colour", "normals"] {
        assert_ne!(picture(&still, name), picture(&posed, name), "{name}");
    }
    assert_eq!(document(&posed)["meshes"][0]["weights"], serde_json::json!([1.0, 0.5, 0.0]));
    assert!(document(&posed)["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"].is_null());
}

#[test]
fn pictures_are_stored_as_asked() {
    let head = head();
    for format in [TextureFormat::Png, TextureFormat::Jpeg, TextureFormat::Webp] {
        let bytes = to_bytes(&head, &Options { textures: format, ..options() }).unwrap();
        let json = document(&bytes);
        let base = json["images"].as_array().unwrap().iter().find(|i| i["name"] == "base colour").unwrap();
        let mime = ["image/png", "image/jpeg", "image/webp"][[
            TextureFormat::Png,
            TextureFormat::Jpeg,
            TextureFormat::Webp,
        ]
        .iter()
        .position(|f| *f == format)
        .unwrap()];
        assert_eq!(base["mimeType"], mime);
        assert_eq!(json["extensionsRequired"].is_array(), format == TextureFormat::Webp);
        let read = from_bytes(&bytes, Path::new("pictures.glb")).unwrap();
        assert_eq!(read.head.mesh.points, head.mesh.points);
    }
}

#[test]
fn the_strongest_shapes_are_kept() {
    let head = head();
    let kept = top_shapes(&head, None, 1).unwrap();
    assert_eq!(kept, [1], "the shape that moves all points furthest");
    let exported = export(&head, &Options { shapes: Some(kept), ..options() }).unwrap();
    let read = from_bytes(&exported.bytes, Path::new("top.glb")).unwrap().head;
    assert_eq!(read.shapes, [head.shapes[1].clone()]);
    assert!(export(&head, &Options { shapes: Some(vec![3]), ..options() }).is_err());
}

/// The file with the bytes of its image number `index` replaced.
fn with_image(glb: &[u8], index: usize, replace: impl FnOnce(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut json = document(glb);
    let json_length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    let mut binary = glb[20 + json_length + 8..].to_vec();
    let view = json["images"][index]["bufferView"].as_u64().expect("a view") as usize;
    let number = |name: &str| json["bufferViews"][view][name].as_u64().unwrap_or(0) as usize;
    let (offset, length) = (number("byteOffset"), number("byteLength"));
    let image = replace(&binary[offset..offset + length]);
    json["bufferViews"][view]["byteOffset"] = binary.len().into();
    json["bufferViews"][view]["byteLength"] = image.len().into();
    binary.extend(image);
    binary.resize(binary.len().next_multiple_of(4), 0);
    json["buffers"][0]["byteLength"] = binary.len().into();
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes()[..], kind, data].concat();
    let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &binary)].concat();
    [&b"glTF\x02\0\0\0"[..], &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat()
}

fn png_chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(kind);
    crc.update(data);
    [&(data.len() as u32).to_be_bytes()[..], kind, data, &crc.sum().to_be_bytes()].concat()
}

#[test]
fn maps_are_read_as_stored_and_their_headers_are_not_believed() {
    let glb = to_bytes(&head(), &options()).unwrap();
    let json = document(&glb);
    let melanin = json["extensions"]["RUBOR_facial_appearance"]["maps"]["melanin"]["image"].as_u64();
    let melanin = melanin.expect("a melanin map") as usize;
    let expected = from_bytes(&glb, Path::new("a.glb")).unwrap().head;
    // An Exif tag that says "lie on your side" (6) says nothing about texture coordinates.
    let exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let tagged =
        with_image(&glb, melanin, |png| [&png[..33], &png_chunk(b"eXIf", exif), &png[33..]].concat());
    assert_eq!(from_bytes(&tagged, Path::new("a.glb")).unwrap().head.maps, expected.maps);
    // 40000 x 40000 texels claimed by a few bytes.
    let bomb = with_image(&glb, melanin, |png| {
        let mut header = png[16..29].to_vec();
        header[..8].copy_from_slice(&[0, 0, 0x9c, 0x40, 0, 0, 0x9c, 0x40]);
        [&png[..8], &png_chunk(b"IHDR", &header), &png[33..]].concat()
    });
    let error = from_bytes(&bomb, Path::new("a.glb")).unwrap_err().to_string();
    assert!(error.contains("melanin") && error.contains("the limit on pixels"), "{error}");
}
