//! Files for the web, and files that came back from programs which do not know the extension.

mod support;

use std::path::Path;

use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{Filter, Mode, decode_buffer_view};
use rubor_assets::export::gltf::{MapEncodings, Options, to_bytes};
use rubor_assets::facial_appearance::NAME;
use rubor_assets::import::gltf::{from_bytes, lint};
use rubor_rig::timeline::Sequence;
use serde_json::{Value, json};

use support::bumpy::{document, head, rig};

fn binary(bytes: &[u8]) -> &[u8] {
    &bytes[28 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize..]
}

fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((28 + text.len() + binary.len()) as u32).to_le_bytes());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

/// The file with every coded view decoded, as a reader that knows EXT_meshopt_compression sees it.
fn decoded(bytes: &[u8]) -> Vec<u8> {
    const EXTENSION: &str = "EXT_meshopt_compression";
    let mut json = document(bytes);
    let mut data = binary(bytes).to_vec();
    for view in json["bufferViews"].as_array_mut().unwrap() {
        let Some(coded) = view["extensions"].get(EXTENSION).cloned() else { continue };
        let number = |key: &str| coded[key].as_u64().unwrap() as usize;
        let source = &binary(bytes)[number("byteOffset")..number("byteOffset") + number("byteLength")];
        let mode = match coded["mode"].as_str().unwrap() {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            _ => Mode::Indices,
        };
        let filter = Filter::parse(coded["filter"].as_str().unwrap_or("NONE")).unwrap();
        let (count, stride) = (number("count"), number("byteStride"));
        let plain =
            decode_buffer_view(mode, filter, count, stride, source, &mut Workspace::default()).unwrap();
        assert_eq!(view["byteLength"], plain.len());
        data.resize(data.len().next_multiple_of(4), 0);
        view["buffer"] = json!(0);
        view["byteOffset"] = json!(data.len());
        view.as_object_mut().unwrap().remove("extensions");
        data.extend(plain);
    }
    data.resize(data.len().next_multiple_of(4), 0);
    json["buffers"] = json!([{"byteLength": data.len()}]);
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    glb(&json, &data)
}

#[test]
fn a_compressed_file_is_the_head_within_what_it_says() {
    let head = head();
    let text = r#"{"fps": 24, "duration": 1, "expressions": {"joy": [{"t": 0, "v": 0}, {"t": 1, "v": 1}]}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let plain =
        Options { rig: Some(rig()), sequence: Some(&sequence), shape_colors: true, ..Options::default() };
    let compressed = to_bytes(&head, &Options { compress: true, ..plain.clone() }).unwrap();
    let json = document(&compressed);
    assert_eq!(json["extensionsRequired"], json!(["EXT_meshopt_compression", "KHR_mesh_quantization"]));
    assert_eq!(json["buffers"].as_array().unwrap().len(), 2);

    let read = from_bytes(&decoded(&compressed), Path::new("c.glb")).unwrap();
    assert_eq!(read.sequence, Some(serde_json::to_value(&sequence).unwrap()));
    let (a, b) = (&head, &read.head);
    let worst = |x: &[glam::Vec3], y: &[glam::Vec3]| {
        assert_eq!(x.len(), y.len());
        x.iter().zip(y).map(|(p, q)| (*p - *q).abs().max_element()).fold(0.0, f32::max)
    };
    assert!(worst(&a.mesh.points, &b.mesh.points) <= 0.5 / 262_144.0);
    assert_eq!(a.mesh.triangles.len(), b.mesh.triangles.len());
    for (x, y) in a.shapes.iter().zip(&b.shapes) {
        assert_eq!((&x.name, &x.points, &x.occlusion), (&y.name, &y.points, &y.occlusion));
        assert!(worst(&x.offsets, &y.offsets) <= 0.5 / 131_072.0);
    }
    for (x, y) in a.mesh.triangles.iter().zip(&b.mesh.triangles) {
        let points = |h: &rubor_rig::head::Head, t: &[u32; 3]| t.map(|v| h.mesh.vertices[v as usize].point);
        let (x, y) = (points(a, x), points(b, y));
        assert!([[y[0], y[1], y[2]], [y[1], y[2], y[0]], [y[2], y[0], y[1]]].contains(&x), "{x:?} {y:?}");
    }
    // The keys of the animation.
    let weights = |bytes: &[u8]| {
        let read = from_bytes(bytes, Path::new("c.glb")).unwrap().animation.unwrap();
        read.shapes["few"].at(0.37)
    };
    let (x, y) = (weights(&to_bytes(&head, &plain).unwrap()), weights(&decoded(&compressed)));
    assert!((x - y).abs() < 1e-5, "{x} {y}");
}

#[test]
fn compressed_geometry_is_a_third_and_maps_are_what_was_asked_for() {
    let head = head();
    let size = |compress, maps| {
        let options = Options { compress, maps, rig: Some(rig()), ..Options::default() };
        let bytes = to_bytes(&head, &options).unwrap();
        let json = document(&bytes);
        let images: u64 = (json["images"].as_array().unwrap().iter())
            .map(|i| {
                json["bufferViews"][i["bufferView"].as_u64().unwrap() as usize]["byteLength"]
                    .as_u64()
                    .unwrap()
            })
            .sum();
        (binary(&bytes).len() as u64 - images, images)
    };
    let (plain, pictures) = size(false, MapEncodings::default());
    let (coded, same) = size(true, MapEncodings::default());
    assert_eq!(pictures, same);
    assert!(3 * coded < plain, "{coded} of {plain}");
}

/// The file as a program leaves it that knows neither the extension nor the order of what it reads.
fn through_another_program(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut json = document(bytes);
    json.as_object_mut().unwrap().remove("extensions");
    json["extensionsUsed"].as_array_mut().unwrap().retain(|name| name != NAME);
    let (images, accessors) =
        (json["images"].as_array().unwrap().len() as u64, json["accessors"].as_array().unwrap().len() as u64);
    json["images"].as_array_mut().unwrap().reverse();
    json["accessors"].as_array_mut().unwrap().reverse();
    for texture in json["textures"].as_array_mut().unwrap() {
        texture["source"] = json!(images - 1 - texture["source"].as_u64().unwrap());
    }
    let turn = |index: &mut Value| *index = json!(accessors - 1 - index.as_u64().unwrap());
    for primitive in json["meshes"][0]["primitives"].as_array_mut().unwrap() {
        turn(&mut primitive["indices"]);
        primitive["attributes"].as_object_mut().unwrap().values_mut().for_each(turn);
        let targets = primitive["targets"].as_array_mut().unwrap();
        targets.iter_mut().flat_map(|t| t.as_object_mut().unwrap().values_mut()).for_each(turn);
    }
    change(&mut json);
    glb(&json, binary(bytes))
}

fn remove_name(json: &mut Value, list: &str, name: &str) {
    let items = json[list].as_array_mut().unwrap();
    items.iter_mut().find(|i| i["name"] == name).unwrap()["name"] = json!("gone");
}

#[test]
fn a_head_survives_a_program_that_does_not_know_it() {
    let options = Options { rig: Some(rig()), ..Options::default() };
    let bytes = to_bytes(&head(), &options).unwrap();
    let expected = from_bytes(&bytes, Path::new("a.glb")).unwrap();
    let back = from_bytes(&through_another_program(&bytes, |_| {}), Path::new("b.glb")).unwrap();
    assert!(format!("{:?}", back.head) == format!("{:?}", expected.head), "the heads are equal");
    assert_eq!(back.rig, expected.rig);
    let notes: Vec<String> = back.notes.iter().map(|n| n.to_string()).collect();
    assert!(notes.iter().any(|n| n.contains("dropped by another program")), "{notes:?}");
    assert_eq!(notes.len(), 1, "{notes:?}");
    // What checks a file says the same of it.
    let said = |bytes: &[u8]| -> Vec<String> {
        lint(bytes, Path::new("b.glb")).unwrap().iter().map(|f| f.to_string()).collect()
    };
    let copied = said(&through_another_program(&bytes, |_| {}));
    assert!(!copied.iter().any(|f| f.contains("there is no")), "{copied:?}");
    assert!(copied.iter().any(|f| f.contains("dropped by another program")), "{copied:?}");
    let without = through_another_program(&bytes, |json| {
        json["meshes"][0]["extras"].as_object_mut().unwrap().remove(NAME);
    });
    assert!(said(&without).iter().any(|f| f.contains("there is no")));
}

#[test]
fn what_other_programs_lose_is_said() {
    let options = Options { rig: Some(rig()), ..Options::default() };
    let bytes = to_bytes(&head(), &options).unwrap();
    let read = |list: &'static str, name: &'static str| {
        let bytes = through_another_program(&bytes, |json| remove_name(json, list, name));
        let read = from_bytes(&bytes, Path::new("b.glb")).unwrap();
        let notes: Vec<String> = read.notes.iter().map(|n| n.to_string()).collect();
        (read.head, notes.join("\n"))
    };
    let (head, notes) = read("images", "melanin");
    assert!(
        head.maps.melanin.is_none() && head.maps.hemoglobin.is_some() && notes.contains("melanin"),
        "{notes}"
    );
    let (head, notes) = read("images", "joy scale");
    assert!(head.maps.distributions.is_empty() && notes.contains("distribution joy"), "{notes}");
    let (head, notes) = read("images", "wrinkle slopes 0");
    assert!(head.maps.zones.is_empty() && head.maps.wrinkle_slopes.is_empty(), "{notes}");
    assert!(notes.contains("wrinkleSlopes") && notes.contains("zones"), "{notes}");
    let (head, notes) = read("accessors", "rubor ambient visibility");
    assert!(head.mesh.occlusion.is_empty() && notes.contains("ambient visibility is lost"), "{notes}");
    // Without its points the head is that of another program.
    let (head, notes) = read("accessors", "rubor points of part 0");
    assert!(head.maps.melanin.is_none() && notes.contains("cannot be used"), "{notes}");
    assert_eq!(head.shapes.len(), 3);
}
