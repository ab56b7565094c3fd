//! glTF files of other programs, and the published schema of our extension.

use std::path::Path;

use glam::Vec3;
use rubor_assets::facial_appearance::{FacialAppearance, MapEntries};
use rubor_assets::import::gltf::{from_bytes, read};
use serde_json::{Value, json};

/// Two triangles that share an edge (the second with other texture coordinates), one named sparse target, a node that
/// scales by 2 and moves, data as base64.
fn document() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [2, 2, 2], "translation": [0, 1, 0]}],
        "meshes": [{
            "name": "face",
            "extras": {"targetNames": ["up"]},
            "primitives": [{
                "attributes": {"POSITION": 0},
                "targets": [{"POSITION": 1}],
            }],
        }],
        // 6 positions: (0,0,0) (1,0,0) (0,1,0) | (1,0,0) (1,1,0) (0,1,0); then index 2, 5 (u16), then 2 x (0,0,1)
        "buffers": [{"byteLength": 100, "uri": format!("data:application/octet-stream;base64,{}", base64(&data()))}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 72},
            {"buffer": 0, "byteOffset": 72, "byteLength": 4},
            {"buffer": 0, "byteOffset": 76, "byteLength": 24},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"componentType": 5126, "count": 6, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 1], "sparse": {
                "count": 2,
                "indices": {"bufferView": 1, "componentType": 5123},
                "values": {"bufferView": 2},
            }},
        ],
    })
}

fn data() -> Vec<u8> {
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let floats = |v: &[[f32; 3]]| v.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>();
    [floats(&corners), vec![2, 0, 5, 0], floats(&[[0., 0., 1.]; 2])].concat()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |c: &[u8]| -> String {
        let n = c.iter().fold(0_u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - c.len()));
        (0..=c.len()).map(|k| DIGITS[(n >> (18 - 6 * k) & 63) as usize] as char).collect()
    };
    bytes.chunks(3).map(group).collect()
}

fn import(document: &Value) -> Result<rubor_rig::head::Head, String> {
    from_bytes(document.to_string().as_bytes(), Path::new("folder/test.gltf"))
        .map(|i| i.head)
        .map_err(|e| e.to_string())
}

#[test]
fn transforms_sparse_targets_and_welding() {
    let head = import(&document()).unwrap();
    // The shared edge is welded: its corners agree in position and offset.
    assert_eq!((head.mesh.vertices.len(), head.mesh.points.len(), head.mesh.triangles.len()), (6, 4, 2));
    assert_eq!(head.mesh.points[1], Vec3::new(2.0, 1.0, 0.0));
    assert_eq!(head.shapes[0].name, "up");
    assert_eq!(head.shapes[0].offsets, [Vec3::new(0.0, 0.0, 2.0)]);
    assert_eq!(head.shapes[0].points, [2]);
}

#[test]
fn a_mirroring_node_keeps_triangles_outwards() {
    let mut mirrored = document();
    mirrored["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let head = import(&mirrored).unwrap();
    let [a, b, c] =
        head.mesh.triangles[0].map(|v| head.mesh.points[head.mesh.vertices[v as usize].point as usize]);
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn broken_documents_are_errors_with_a_place() {
    let broken = |change: &dyn Fn(&mut Value), word: &str| {
        let mut d = document();
        change(&mut d);
        let error = import(&d).expect_err(word);
        assert!(error.contains(word), "{word}: {error}");
    };
    broken(&|d| d["buffers"][0]["byteLength"] = json!(900), "buffer 0");
    broken(&|d| d["bufferViews"][2]["byteLength"] = json!(12), "target 0");
    broken(&|d| d["accessors"][0]["count"] = json!(1e9 as u64), "POSITION");
    broken(&|d| d["buffers"][0]["uri"] = json!("../../etc/passwd"), "in the folder");
    broken(&|d| d["buffers"][0]["uri"] = json!("/etc/passwd"), "in the folder");
    broken(&|d| d["buffers"][0]["uri"] = json!("https://example.org/x.bin"), "in the folder");
    broken(&|d| d["buffers"][0]["uri"] = json!("data:;base64,****"), "base64");
    broken(&|d| d["nodes"][0]["children"] = json!([0]), "node 0");
    broken(&|d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7), "accessor 7");
    broken(&|d| d["meshes"][0]["primitives"][0]["mode"] = json!(0), "no triangles");
    assert!(from_bytes(b"", Path::new("empty.glb")).is_err());
    assert!(read(Path::new("/nowhere.glb")).is_err());
}

#[test]
fn published_samples_are_read() {
    let Ok(shared) = std::env::var("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, the sample files were not read");
        return;
    };
    let mut found = 0;
    let mut folders = vec![Path::new(&shared).join("gltf"), Path::new(&shared).join("heads/lee-perry-smith")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
                let head = read(&path).unwrap().head;
                assert!(!head.mesh.triangles.is_empty(), "{}", path.display());
                let morphs = path.to_string_lossy().contains("Morph");
                assert_eq!(morphs, head.shapes.iter().any(|s| !s.points.is_empty()), "{}", path.display());
                found += 1;
            }
        }
    }
    assert!(found >= 3, "{found} files");
}

/// Every property that the program writes stands in the published schema, and the other way round.
#[test]
fn the_published_schema_names_the_properties() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/RUBOR_facial_appearance.schema.json");
    let schema: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let keys =
        |v: &Value| v.as_object().unwrap().keys().cloned().collect::<std::collections::BTreeSet<String>>();
    let map = json!({"image": 0, "layout": "first", "offset": [0.0], "scale": [1.0]});
    let zone = json!({"name": "z", "wrinkleMap": 0, "channel": 0, "mask": map});
    let distribution = json!({"name": "joy", "scale": map, "bias": map});
    let maps = json!({
        "melanin": map, "hemoglobin": map, "hemoglobinMean": map, "hair": map,
        "hairColorLinear": [0.1, 0.1, 0.1], "slopes": map, "specular": map, "scattering": map,
        "wrinkleSlopes": [map], "zones": [zone], "distributions": [distribution],
    });
    let part = json!({"name": "p", "material": "skin", "points": 1});
    let provenance = json!({"of": "geometry", "kind": "measured", "source": "s", "licence": "MIT"});
    let whole = json!({
        "version": 1, "name": "n", "mesh": 0, "pointCount": 3, "parts": [part], "occlusion": 2,
        "landmarks": {"a": [0.0, 0.0, 0.0]}, "maps": maps, "provenance": [provenance], "rig": {},
    });
    let written = |v: Value| -> Value {
        let parsed: FacialAppearance = serde_json::from_value(v).unwrap();
        serde_json::to_value(parsed).unwrap()
    };
    let back = written(whole);
    let at = |pointer: &str| schema.pointer(pointer).unwrap_or_else(|| panic!("{pointer}"));
    assert_eq!(keys(&back), keys(at("/properties")));
    assert_eq!(keys(&back["maps"]), keys(at("/properties/maps/properties")));
    assert_eq!(keys(&back["parts"][0]), keys(at("/properties/parts/items/properties")));
    assert_eq!(
        keys(&back["maps"]["zones"][0]),
        keys(at("/properties/maps/properties/zones/items/properties"))
    );
    assert_eq!(keys(&back["maps"]["melanin"]), keys(at("/$defs/map/properties")));
    assert_eq!(keys(&back["provenance"][0]), keys(at("/properties/provenance/items/properties")));
    let materials: Vec<Value> =
        rubor_rig::head::Material::ALL.iter().map(|m| serde_json::to_value(m).unwrap()).collect();
    assert_eq!(&Value::Array(materials), at("/properties/parts/items/properties/material/enum"));
}

#[test]
fn empty_map_lists_are_left_out() {
    let text = serde_json::to_value(MapEntries::default()).unwrap();
    assert_eq!(text, json!({}));
}
