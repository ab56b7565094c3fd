//! glTF files of other programs, and the published schema of our extension.

use std::io::Write;
use std::path::Path;

use glam::Vec3;
use rubor_assets::export::gltf::{Options, to_bytes};
use rubor_assets::facial_appearance::{FacialAppearance, MapEntries};
use rubor_assets::import::gltf::{from_bytes, read};
use rubor_rig::timeline::{Ease, Sequence, Track};
use serde_json::{Value, json};

mod support;
use support::{Pieces, base64};

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

fn import(document: &Value) -> Result<rubor_rig::head::Head, String> {
    from_bytes(document.to_string().as_bytes(), Path::new("folder/test.gltf"))
        .map(|i| i.head)
        .map_err(|e| e.to_string())
}

#[test]
fn normals_that_the_author_made_stay_and_come_back() {
    let with = |normal: [f32; 3]| {
        let mut document = document();
        let bytes: Vec<u8> = [normal; 6].as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect();
        let uri = format!("data:application/octet-stream;base64,{}", base64(&bytes));
        document["buffers"].as_array_mut().unwrap().push(json!({"byteLength": 72, "uri": uri}));
        document["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 1, "byteLength": 72}));
        let accessor = json!({"bufferView": 3, "componentType": 5126, "count": 6, "type": "VEC3"});
        document["accessors"].as_array_mut().unwrap().push(accessor);
        document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
        import(&document).unwrap()
    };
    assert!(with([0.0, 0.0, 1.0]).authored.normals.is_empty(), "those of the geometry");
    let leaning = Vec3::new(0.6, 0.0, 0.8);
    let head = with(leaning.to_array());
    assert_eq!(head.authored.normals.len(), 6);
    let bytes = to_bytes(&head, &Options::default()).unwrap();
    let again = from_bytes(&bytes, Path::new("again.glb")).unwrap().head;
    for normals in [head.authored.normals, again.authored.normals] {
        assert!(normals.iter().all(|n| n.abs_diff_eq(leaning, 1e-4)), "{normals:?}");
    }
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

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

#[test]
fn quantised_and_strided_accessors_are_scaled_back() {
    let mut pieces = Pieces::default();
    // Shorts with a stride of 8 bytes, normalized: 32767 is 1.
    let shorts: Vec<u8> = [[0_i16, 0, 0, 9], [32767, 0, 0, 9], [0, -32768, 16384, 9]]
        .as_flattened()
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let view = pieces.view(&shorts, Some(8));
    let position = pieces
        .accessor(json!({"bufferView": view, "componentType": 5122, "normalized": true, "count": 3,
        "type": "VEC3", "min": [0, -1, 0], "max": [1, 0, 0.5]}));
    let bytes: Vec<u8> =
        [[0_i8, 0, 0, 0], [127, 0, 0, 0], [0, -127, 64, 0]].as_flattened().iter().map(|v| *v as u8).collect();
    let view = pieces.view(&bytes, Some(4));
    let target = pieces
        .accessor(json!({"bufferView": view, "componentType": 5120, "normalized": true, "count": 3,
        "type": "VEC3", "min": [0, -1, 0], "max": [1, 0, 0.6]}));
    let bytes = pieces.view(&[0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 0], Some(4));
    let uv = pieces.accessor(
        json!({"bufferView": bytes, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC2"}),
    );
    let document = pieces.finish(json!({
        "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": position, "TEXCOORD_0": uv},
            "targets": [{"POSITION": target}]}]}],
    }));
    let head = import(&document).unwrap();
    assert_eq!(head.mesh.points[1], Vec3::X);
    // -32768 is cut at -1, as the formula of the specification says.
    assert_eq!(head.mesh.points[2], Vec3::new(0.0, -1.0, 16384.0 / 32767.0));
    assert_eq!(head.shapes[0].offsets[1], Vec3::new(0.0, -1.0, 64.0 / 127.0));
    assert_eq!(head.mesh.vertices[2].uv, glam::Vec2::Y);
}

#[test]
fn morph_normals_tangents_and_colours_are_allowed_and_accessors_without_data_are_zeros() {
    let mut pieces = Pieces::default();
    let position = pieces.floats(&TRIANGLE, "VEC3");
    let up = pieces.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let turned = pieces.floats(&[0.1; 9], "VEC3");
    let colour = pieces.floats(&[0.5; 12], "VEC4");
    let zeros = pieces.accessor(json!({"componentType": 5126, "count": 3, "type": "VEC3"}));
    let document = pieces.finish(json!({
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"extras": {"targetNames": ["up", "none"]}, "primitives": [{
            "attributes": {"POSITION": position, "COLOR_0": colour},
            "targets": [{"POSITION": up, "NORMAL": turned, "TANGENT": turned, "COLOR_0": colour},
                        {"POSITION": zeros, "NORMAL": zeros}],
        }]}],
    }));
    let head = import(&document).unwrap();
    assert_eq!(
        head.shapes.iter().map(|s| (&s.name[..], s.points.len())).collect::<Vec<_>>(),
        [("up", 1), ("none", 0)]
    );
}

#[test]
fn several_meshes_share_shapes_by_name_along_the_nodes() {
    let mut pieces = Pieces::default();
    let position = pieces.floats(&TRIANGLE, "VEC3");
    let up = pieces.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let mesh = |names: Value| {
        json!({"extras": {"targetNames": names}, "primitives": [
            {"attributes": {"POSITION": position}, "targets": [{"POSITION": up}, {"POSITION": up}]},
            {"attributes": {"POSITION": position}, "targets": [{"POSITION": up}, {"POSITION": up}], "material": 0},
        ]})
    };
    let document = pieces.finish(json!({
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [{"children": [1], "translation": [0, 0, 5]}, {"mesh": 0, "rotation": [0, 1, 0, 0]}, {"mesh": 1}],
        "materials": [{"name": "teeth"}],
        "meshes": [mesh(json!(["a", "b"])), mesh(json!(["b", "c"]))],
    }));
    let head = import(&document).unwrap();
    assert_eq!(head.mesh.parts.len(), 4);
    assert_eq!(head.mesh.parts[1].material, rubor_rig::head::Material::Teeth);
    let moved: Vec<(&str, usize)> = head.shapes.iter().map(|s| (&s.name[..], s.points.len())).collect();
    // The primitives of one mesh weld where they agree.
    assert_eq!(moved, [("a", 1), ("b", 2), ("c", 1)]);
    // Half a turn about y, then 5 m along z.
    assert!(head.mesh.points.iter().any(|p| p.abs_diff_eq(Vec3::new(-1.0, 0.0, 5.0), 1e-6)));
    assert!(head.shapes[0].offsets[0].abs_diff_eq(-Vec3::Z, 1e-6));
}

#[test]
fn skinned_meshes_stand_in_the_rest_pose_of_their_joints() {
    let mut pieces = Pieces::default();
    let position = pieces.floats(&TRIANGLE, "VEC3");
    let joints = pieces.view(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], None);
    let joints =
        pieces.accessor(json!({"bufferView": joints, "componentType": 5121, "count": 3, "type": "VEC4"}));
    let weights = pieces.floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0], "VEC4");
    let document = |root: f32| {
        let mut pieces = Pieces {
            bytes: pieces.bytes.clone(),
            views: pieces.views.clone(),
            accessors: pieces.accessors.clone(),
        };
        let identity = glam::Mat4::IDENTITY.to_cols_array();
        let back = glam::Mat4::from_translation(-Vec3::Z).to_cols_array();
        let inverse = pieces.floats(&[identity, back].concat(), "MAT4");
        pieces.finish(json!({
            "scenes": [{"nodes": [0]}],
            "nodes": [{"children": [1, 2], "translation": [root, 0, 0]}, {"translation": [0, 0, 1]},
                      {"mesh": 0, "skin": 0, "scale": [9, 9, 9]}],
            "skins": [{"joints": [0, 1], "inverseBindMatrices": inverse}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights}}]}],
        }))
    };
    let head = import(&document(0.0)).unwrap();
    assert_eq!(head.mesh.points, [Vec3::ZERO, Vec3::X, Vec3::Y], "the node's own transform does not count");
    let head = import(&document(2.0)).unwrap();
    assert_eq!(head.mesh.points[1], Vec3::new(3.0, 0.0, 0.0), "joints carry it");
}

#[test]
fn what_is_unknown_is_refused_in_words() {
    let mut d = document();
    d["extensionsUsed"] = json!(["ACME_blobs"]);
    d["extensionsRequired"] = json!(["ACME_blobs"]);
    let error = import(&d).unwrap_err();
    assert!(error.contains("ACME_blobs") && error.contains("extensionsRequired 0"), "{error}");
    let mut d = document();
    d["extensionsUsed"] = json!(["KHR_materials_clearcoat"]);
    d["extensionsRequired"] = json!(["KHR_materials_clearcoat"]);
    assert!(import(&d).is_ok(), "a material changes no geometry");
}

#[test]
fn trees_that_are_too_deep_are_refused() {
    let mut d = document();
    let nodes: Vec<Value> =
        (0..100_000).map(|i| json!({"children": [i + 1]})).chain([json!({"mesh": 0})]).collect();
    d["nodes"] = Value::Array(nodes);
    let error = import(&d).unwrap_err();
    assert!(error.contains("512 levels"), "{error}");
}

#[test]
fn external_files_are_read_from_the_folder_only() {
    let folder = std::env::temp_dir().join(format!("rubor-gltf-{}", std::process::id()));
    let inner = folder.join("in");
    std::fs::create_dir_all(inner.join("bin")).unwrap();
    std::fs::write(folder.join("secret.bin"), data()).unwrap();
    std::fs::write(inner.join("bin/data file.bin"), data()).unwrap();
    let read_with = |uri: &str| {
        let mut d = document();
        d["buffers"][0]["uri"] = json!(uri);
        let path = inner.join("head.gltf");
        std::fs::write(&path, d.to_string()).unwrap();
        read(&path).map_err(|e| e.to_string())
    };
    assert_eq!(read_with("bin/data%20file.bin").unwrap().head.mesh.points.len(), 4);
    for uri in
        ["../secret.bin", "bin/../../secret.bin", "%2e%2e/secret.bin", "file:///etc/passwd", "//host/x"]
    {
        let error = read_with(uri).unwrap_err();
        assert!(error.contains("in the folder of the document"), "{uri}: {error}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.join("secret.bin"), inner.join("link.bin")).unwrap();
        assert!(read_with("link.bin").unwrap_err().contains("in the folder of the document"));
    }
    assert!(read_with("missing.bin").unwrap_err().contains("missing.bin"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn animations_of_others_become_tracks() {
    let animated = |interpolation: &str, weights: &[f32]| {
        let mut pieces = Pieces::default();
        let position = pieces.floats(&TRIANGLE, "VEC3");
        let up = pieces.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
        let times = pieces.floats(&[0.0, 0.5, 1.0], "SCALAR");
        let weights = pieces.floats(weights, "SCALAR");
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let turn = pieces.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half, 0.0, 0.0, 0.0, 1.0], "VEC4");
        let document = pieces.finish(json!({
            "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "translation": [0, 1, 0]}],
            "meshes": [{"extras": {"targetNames": ["jawOpen", "still"]},
                "primitives": [{"attributes": {"POSITION": position}, "targets": [{"POSITION": up}, {"POSITION": up}]}]}],
            "animations": [{"name": "take", "samplers": [
                {"input": times, "output": weights, "interpolation": interpolation},
                {"input": times, "output": turn}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}},
                             {"sampler": 1, "target": {"node": 0, "path": "rotation"}}]}],
        }));
        from_bytes(document.to_string().as_bytes(), Path::new("t.gltf"))
            .map(|i| (i.animation, i.notes))
            .unwrap()
    };
    let sequence = |interpolation: &str, weights: &[f32]| animated(interpolation, weights).0.unwrap();
    let keys = |s: &Sequence| match &s.shapes["jawOpen"] {
        Track::Keys(keys) => keys.iter().map(|k| (k.t, k.v, k.ease)).collect::<Vec<_>>(),
        Track::Constant(_) => panic!("a constant"),
    };
    let linear = sequence("LINEAR", &[0.0, 0.0, 1.0, 0.0, 0.5, 0.0]);
    assert_eq!(keys(&linear), [(0.0, 0.0, Ease::Linear), (0.5, 1.0, Ease::Linear), (1.0, 0.5, Ease::Linear)]);
    assert_eq!((linear.fps, linear.duration, &linear.description[..]), (24.0, 1.0, "take"));
    assert!(!linear.shapes.contains_key("still"));
    assert!((linear.head.yaw_degrees.at(0.5) - 90.0).abs() < 1e-3);
    let step = sequence("STEP", &[0.0, 0.0, 1.0, 0.0, 0.5, 0.0]);
    assert_eq!(step.shapes["jawOpen"].at(0.49), 0.0);
    // Slope in, value, slope out of both targets at each key: flat ends are a smooth easing.
    let flat = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0];
    let cubic = sequence("CUBICSPLINE", &flat);
    assert_eq!(keys(&cubic)[0].2, Ease::Smooth);
    assert_eq!(cubic.shapes["jawOpen"].at(0.25), 0.5);
    // A broken channel is left out and told; the other one moves the head all the same.
    let (animation, notes) = animated("LINEAR", &[0.0; 5]);
    let note = notes.iter().map(ToString::to_string).find(|n| n.contains("left out")).unwrap();
    assert!(note.contains("animation 0, channel 0") && note.contains("5 numbers"), "{note}");
    let animation = animation.unwrap();
    assert!(animation.shapes.is_empty() && animation.head.yaw_degrees.at(0.5) > 89.0);
}

/// Our own animation read as somebody else's: weights at any time, whatever the easings were.
#[test]
fn an_exported_animation_is_the_performance() {
    let text = r#"{"fps": 24, "duration": 2, "shapes": {
        "up": [{"t": 0, "v": 0, "ease": "smooth"}, {"t": 0.5, "v": 1, "ease": "easeIn"}, {"t": 1, "v": 0.25, "ease": "step"}, {"t": 1.5, "v": 0.75}],
        "side": [{"t": 0.25, "v": 0.1, "ease": "smoother"}, {"t": 1.75, "v": 0.9, "ease": "easeInOut"}, {"t": 2, "v": 0}]},
        "head": {"yawDegrees": [{"t": 0, "v": 0, "ease": "smooth"}, {"t": 2, "v": 40}], "translation": [0.01, 0, 0]}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let mut head = import(&document()).unwrap();
    let up = head.shapes[0].clone();
    head.shapes.push(rubor_rig::head::BlendShape { name: "side".into(), ..up });
    let rig = rubor_rig::expression::Rig::default();
    let options = rubor_assets::export::gltf::Options {
        rig: Some(&rig),
        sequence: Some(&sequence),
        ..rubor_assets::export::gltf::Options::default()
    };
    let bytes = rubor_assets::export::gltf::to_bytes(&head, &options).unwrap();
    let read = from_bytes(&bytes, Path::new("t.glb")).unwrap().animation.unwrap();
    for frame in 0..read.frame_count() {
        let t = read.frame_time_s(frame);
        for name in ["up", "side"] {
            let (a, b) = (sequence.shapes[name].at(t), read.shapes[name].at(t));
            assert!((a - b).abs() < 2e-5, "{name} at {t}: {a} and {b}");
        }
        let (a, b) = (sequence.head.yaw_degrees.at(t), read.head.yaw_degrees.at(t));
        assert!((a - b).abs() < 2e-3, "yaw at {t}: {a} and {b}");
    }
    assert!((read.head.translation.at(1.0)[0] - 0.01).abs() < 1e-6);
}

#[test]
fn published_samples_are_read() {
    let Ok(shared) = std::env::var("RUBOR_SHARED") else {
        writeln!(std::io::stderr(), "SKIPPED: RUBOR_SHARED is not set, the sample files were not read")
            .expect("stderr is open");
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
        "albedo": map, "melanin": map, "hemoglobin": map, "hemoglobinMean": map, "hair": map,
        "hairColorLinear": [0.1, 0.1, 0.1], "hairCount": 100, "slopes": map, "specular": map, "scattering": map,
        "wrinkleSlopes": [map], "zones": [zone], "distributions": [distribution],
    });
    let part = json!({"name": "p", "material": "other", "authored": true, "points": 1});
    let provenance = json!({"of": "geometry", "kind": "measured", "source": "s", "licence": "MIT"});
    let whole = json!({
        "version": 1, "name": "n", "mesh": 0, "authoredNormals": true, "pointCount": 3, "parts": [part], "occlusion": 2,
        "shapeOcclusion": [{"shape": "jawOpen", "points": 3, "changes": 4}],
        "landmarks": {"a": [0.0, 0.0, 0.0]}, "maps": maps, "provenance": [provenance], "rig": {}, "sequence": {},
        "skinLookUp": {"image": 0, "mostMelanin": 0.5, "mostHemoglobin": 0.32},
        "skinAnimation": {
            "times": 5, "expressions": ["joy"], "expressionWeights": 6, "states": ["blush"], "stateWeights": 7,
            "zoneWeights": 8, "distributionWeights": 9, "hemoglobinScales": 10, "pupilsMm": 11,
        },
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
    assert_eq!(keys(&back["shapeOcclusion"][0]), keys(at("/properties/shapeOcclusion/items/properties")));
    assert_eq!(
        keys(&back["maps"]["zones"][0]),
        keys(at("/properties/maps/properties/zones/items/properties"))
    );
    assert_eq!(keys(&back["maps"]["melanin"]), keys(at("/$defs/map/properties")));
    assert_eq!(keys(&back["provenance"][0]), keys(at("/properties/provenance/items/properties")));
    assert_eq!(keys(&back["skinLookUp"]), keys(at("/properties/skinLookUp/properties")));
    assert_eq!(keys(&back["skinAnimation"]), keys(at("/properties/skinAnimation/properties")));
    let materials: Vec<Value> =
        rubor_rig::head::Material::ALL.iter().map(|m| serde_json::to_value(m).unwrap()).collect();
    assert_eq!(&Value::Array(materials), at("/properties/parts/items/properties/material/enum"));
}

#[test]
fn empty_map_lists_are_left_out() {
    let text = serde_json::to_value(MapEntries::default()).unwrap();
    assert_eq!(text, json!({}));
}
