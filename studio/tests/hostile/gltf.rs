//! glTF and GLB: claims without data, sums of shared data, cycles, animations of years, paths that leave.

use std::path::Path;

use serde_json::{Value, json};

use super::{Case, truncated, write};

const HEAD: &[u8] = include_bytes!("../../../assets/head.glb");

/// A GLB of a document and its binary chunk.
fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = binary.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + bin.len();
    out.extend([2_u32, total as u32, json.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(&bin);
    out
}

/// Numbers of a triangle: positions, indices, times, weights.
fn binary() -> Vec<u8> {
    let positions = [0.0_f32, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0];
    let mut out: Vec<u8> = positions.iter().flat_map(|v| v.to_le_bytes()).collect();
    out.extend([0_u32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    out.extend([0.0_f32, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
    out
}

/// A triangle with a morph target and an animation of its weight.
fn document() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "face" }],
        "meshes": [{ "name": "face", "extras": { "targetNames": ["jawOpen"] }, "primitives": [
            { "attributes": { "POSITION": 0 }, "indices": 1, "targets": [{ "POSITION": 2 }] }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0.1, 0.1, 0] },
            { "bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR" },
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0.1, 0.1, 0] },
            { "bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1] },
            { "bufferView": 3, "componentType": 5126, "count": 2, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 8 },
            { "buffer": 0, "byteOffset": 56, "byteLength": 24 },
        ],
        "buffers": [{ "byteLength": 80 }],
        "animations": [{ "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": 3, "output": 4 }] }],
    })
}

/// A case that changes the document.
fn changed(name: &str, change: impl FnOnce(&mut Value) + 'static) -> Case {
    Case::check(format!("gltf/{name}"), "a.glb", move || {
        let mut document = document();
        change(&mut document);
        glb(&document, &binary())
    })
}

/// A case whose numbers are other ones.
fn numbers(name: &str, at: usize, values: &'static [f32], change: impl FnOnce(&mut Value) + 'static) -> Case {
    Case::check(format!("gltf/{name}"), "a.glb", move || {
        let (mut document, mut binary) = (document(), binary());
        change(&mut document);
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        if binary.len() < at + bytes.len() {
            binary.resize(at + bytes.len(), 0);
            document["buffers"][0]["byteLength"] = binary.len().into();
        }
        binary[at..at + bytes.len()].copy_from_slice(&bytes);
        glb(&document, &binary)
    })
}

/// A `.gltf` whose buffer has this URI, in a folder that `more` fills.
fn uri(name: &str, uri: &'static str, more: impl FnOnce(&Path) + 'static) -> Case {
    Case::new(format!("gltf/uri-{name}"), &["check", "{}/a.gltf"], move |folder| {
        let mut document = document();
        document["buffers"][0]["uri"] = uri.into();
        write(folder, "a.gltf", document.to_string().as_bytes());
        more(folder);
    })
}

#[cfg(unix)]
fn link(target: &str, folder: &Path, name: &str) {
    std::os::unix::fs::symlink(target, folder.join(name)).expect("a link");
}

#[cfg(unix)]
pub(crate) fn fifo(folder: &Path, name: &str) {
    let status = std::process::Command::new("mkfifo").arg(folder.join(name)).status();
    assert!(status.is_ok_and(|s| s.success()), "mkfifo makes a pipe");
}

/// A GLB of ours with a map that many entries name.
fn shared_maps(count: usize, side: u32) -> Vec<u8> {
    let png = super::images::grey_png(side, side);
    let mut document = document();
    document["animations"] = json!([]);
    let start = 80;
    let mut binary = binary();
    binary.extend(&png);
    let views = document["bufferViews"].as_array_mut().expect("views");
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": png.len() }));
    document["buffers"][0]["byteLength"] = binary.len().into();
    document["images"] = json!([{ "bufferView": 4, "mimeType": "image/png" }]);
    document["accessors"][0]["name"] = "positions".into();
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 5.into();
    document["accessors"]
        .as_array_mut()
        .expect("accessors")
        .push(json!({ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2" }));
    let entry = json!({ "image": 0, "layout": "first", "offset": [0.0], "scale": [1.0] });
    let distributions: Vec<Value> =
        (0..count).map(|i| json!({ "name": format!("d{i}"), "scale": entry, "bias": entry })).collect();
    document["extensionsUsed"] = json!(["RUBOR_facial_appearance"]);
    document["extensions"] = json!({ "RUBOR_facial_appearance": {
        "version": 1, "name": "x", "mesh": 0, "pointCount": 3,
        "parts": [{ "name": "skin", "material": "skin", "points": 1 }],
        "maps": { "hemoglobin": entry, "hemoglobinMean": entry, "distributions": distributions },
    } });
    glb(&document, &binary)
}

/// A file of ours whose distributions have these names, for commands that write maps.
fn named_maps(names: &[&str]) -> Vec<u8> {
    let bytes = shared_maps(names.len(), 16);
    // The names have three bytes at least; other lengths would move the chunks.
    let json_length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[20..20 + json_length]).expect("JSON");
    let list = &mut document["extensions"]["RUBOR_facial_appearance"]["maps"]["distributions"];
    for (i, name) in names.iter().enumerate() {
        list[i]["name"] = (*name).into();
    }
    glb(&document, &bytes[20 + json_length + 8..])
}

pub(crate) fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    all.extend(truncated("glb", "a.glb", &["check", "{}/a.glb"], &glb(&document(), &binary())));
    all.extend(truncated("head", "a.glb", &["check", "{}/a.glb"], HEAD));
    all.push(changed("plain", |_| {}).small());

    let counts = [
        ("0", json!(0)),
        ("1e9", json!(1_000_000_000)),
        ("2e31", json!(1_u64 << 31)),
        ("2e32", json!(u32::MAX)),
        ("2e53", json!(1_u64 << 53)),
        ("2e64", json!(u64::MAX)),
        ("minus-1", json!(-1)),
        ("half", json!(1.5)),
        ("1e300", json!(1e300)),
        ("text", json!("3")),
    ];
    for (name, value) in counts {
        for (what, accessor) in [("position", 0), ("index", 1), ("time", 3)] {
            let value = value.clone();
            let case =
                changed(&format!("count-{what}-{name}"), move |d| d["accessors"][accessor]["count"] = value);
            all.push(if name == "1e9" { case.small() } else { case });
        }
        for field in ["byteOffset", "byteLength", "byteStride"] {
            let value = value.clone();
            all.push(changed(&format!("{field}-{name}"), move |d| d["bufferViews"][0][field] = value));
        }
    }
    // 16 M vertices with 64 targets, in a kilobyte.
    for (name, count) in [("16M", 16_000_000), ("4M", 4_000_000), ("1M", 1_000_000)] {
        let case = changed(&format!("no-data-{name}-64-targets"), move |d| {
            for accessor in [0, 2] {
                d["accessors"][accessor].as_object_mut().expect("an accessor").remove("bufferView");
                d["accessors"][accessor]["count"] = count.into();
            }
            d["meshes"][0]["primitives"][0]["targets"] = json!(vec![json!({ "POSITION": 2 }); 64]);
        });
        all.push(case);
    }
    all.push(changed("no-data-indices-16M", |d| {
        d["accessors"][1].as_object_mut().expect("an accessor").remove("bufferView");
        d["accessors"][1]["count"] = 16_000_000.into();
    }));
    for (name, count, at) in [("1e9", 1_000_000_000_u64, 0), ("outside", 1, 48), ("3", 3, 36)] {
        all.push(changed(&format!("sparse-{name}"), move |d| {
            d["accessors"][0]["sparse"] = json!({ "count": count,
                "indices": { "bufferView": 0, "componentType": 5125, "byteOffset": at },
                "values": { "bufferView": 0 } });
        }));
    }
    all.push(changed("views-overlap", |d| {
        for view in 0..4 {
            d["bufferViews"][view]["byteOffset"] = 0.into();
        }
    }));
    all.push(changed("mesh-instanced-100000", |d| {
        d["nodes"] = json!(vec![json!({ "mesh": 0 }); 100_000]);
        d["scenes"][0]["nodes"] = json!((0..100_000).collect::<Vec<u32>>());
    }));
    all.push(Case::check("gltf/large-mesh-instanced-2000", "a.glb", || {
        let mut document = document();
        document["nodes"] = json!(vec![json!({ "mesh": 0 }); 2000]);
        document["scenes"][0]["nodes"] = json!((0..2000).collect::<Vec<u32>>());
        for accessor in [0, 2] {
            document["accessors"][accessor].as_object_mut().expect("an accessor").remove("bufferView");
            document["accessors"][accessor]["count"] = 100_000.into();
        }
        glb(&document, &binary())
    }));
    for levels in [100, 10_000, 100_000] {
        all.push(changed(&format!("nodes-{levels}-levels"), move |d| {
            let child = |i: u32| if i < levels { json!({ "children": [i] }) } else { json!({ "mesh": 0 }) };
            d["nodes"] = json!((1..=levels).map(child).collect::<Vec<Value>>());
        }));
    }
    all.push(changed("node-cycle", |d| {
        d["nodes"] = json!([{ "children": [1] }, { "children": [0], "mesh": 0 }])
    }));
    all.push(changed("node-its-own-child", |d| d["nodes"] = json!([{ "children": [0], "mesh": 0 }])));
    all.push(changed("node-of-two-parents", |d| {
        d["nodes"] = json!([{ "children": [1, 2] }, { "children": [2] }, { "mesh": 0 }]);
    }));
    all.push(changed("skin-of-itself", |d| {
        d["nodes"] = json!([{ "mesh": 0, "skin": 0 }]);
        d["skins"] = json!([{ "joints": [0, 0, 0], "inverseBindMatrices": 0 }]);
    }));
    for (list, field) in [("meshes", "mesh"), ("skins", "skin"), ("cameras", "camera")] {
        all.push(changed(&format!("{list}-missing"), move |d| d["nodes"][0][field] = 7.into()));
    }
    all.push(changed("position-missing", |d| {
        d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 77.into()
    }));
    all.push(changed("target-missing", |d| {
        d["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = 77.into()
    }));
    all.push(changed("targets-100000", |d| {
        d["meshes"][0]["primitives"][0]["targets"] = json!(vec![json!({ "POSITION": 2 }); 100_000]);
        d["meshes"][0]["extras"]["targetNames"] = json!(vec!["same"; 100_000]);
    }));
    all.push(changed("target-names-1000000", |d| {
        d["meshes"][0]["extras"]["targetNames"] = json!(vec!["x"; 1_000_000])
    }));
    all.push(changed("meshes-100000", |d| {
        d["meshes"] = json!(vec![d["meshes"][0].clone(); 100_000]);
        d["nodes"] = json!((0..100_000).map(|i| json!({ "mesh": i })).collect::<Vec<Value>>());
        d["scenes"][0]["nodes"] = json!((0..100_000).collect::<Vec<u32>>());
    }));
    all.push(changed("materials-100000", |d| {
        d["materials"] = json!(vec![json!({ "name": "m", "extensions": { "X": {} } }); 100_000]);
        let one = d["meshes"][0]["primitives"][0].clone();
        let primitives = (0..100_000).map(|i| {
            let mut p = one.clone();
            p["material"] = i.into();
            p
        });
        d["meshes"][0]["primitives"] = json!(primitives.collect::<Vec<Value>>());
    }));
    all.push(changed("name-10MB", |d| d["meshes"][0]["name"] = "n".repeat(10_000_000).into()));
    all.push(
        changed("required-extension", |d| d["extensionsRequired"] = json!(["EVIL_extension"])).refused(),
    );

    // Animations.
    let channel = |name: &str, target: Value| {
        changed(&format!("channel-{name}"), move |d| d["animations"][0]["channels"][0]["target"] = target)
            .small()
    };
    all.push(channel("node-missing", json!({ "node": 99, "path": "weights" })));
    all.push(channel("path-missing", json!({ "node": 0, "path": "evil" })));
    all.push(channel("path-of-no-text", json!({ "node": 0, "path": 7 })));
    all.push(channel("without-target", json!(null)));
    all.push(changed("sampler-missing", |d| d["animations"][0]["channels"][0]["sampler"] = 9.into()));
    all.push(changed("sampler-accessor-missing", |d| {
        d["animations"][0]["samplers"][0]["output"] = 99.into()
    }));
    all.push(changed("channels-100000", |d| {
        d["nodes"] = json!((0..100_000).map(|_| json!({ "mesh": 0 })).collect::<Vec<Value>>());
        d["scenes"][0]["nodes"] = json!([0]);
        let channel = |n: u32| json!({ "sampler": 0, "target": { "node": n, "path": "weights" } });
        d["animations"][0]["channels"] = json!((0..100_000).map(channel).collect::<Vec<Value>>());
    }));
    all.push(changed("animations-100000", |d| {
        d["animations"] = json!(vec![json!({ "channels": [], "samplers": [] }); 100_000]);
    }));
    let cubic = |d: &mut Value| {
        d["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE".into();
        d["accessors"][4]["count"] = 6.into();
    };
    all.push(
        numbers("cubic-keys-1e9-s-apart", 48, &[0.0, 1e9, 0.0, 0.3, 5.0, -7.0, 1.0, 2.0], cubic).small(),
    );
    all.push(numbers("cubic-keys-a-day-apart", 48, &[0.0, 86_400.0, 0.0, 0.3, 5.0, -7.0, 1.0, 2.0], cubic));
    all.push(numbers("linear-keys-1e30-s-apart", 48, &[0.0, 1e30, 0.0, 1.0], |_| {}));
    all.push(numbers("keys-before-0", 48, &[-1e30, -1.0, 0.0, 1.0], |_| {}));
    all.push(numbers("keys-nan", 48, &[f32::NAN, f32::INFINITY, 0.0, 1.0], |_| {}));
    all.push(numbers("keys-backwards", 48, &[5.0, 1.0, 0.0, 1.0], |_| {}));
    all.push(numbers("weights-huge", 48, &[0.0, 1.0, f32::MAX, f32::MIN], |_| {}));
    all.push(numbers("rotation-1e7-s", 48, &[0.0, 1e7, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], |d| {
        d["animations"][0]["channels"][0]["target"]["path"] = "rotation".into();
        d["accessors"][4] = json!({ "bufferView": 3, "componentType": 5126, "count": 2, "type": "VEC4" });
        d["bufferViews"][3]["byteLength"] = 32.into();
    }));
    all.push(changed("keys-without-data-10M", |d| {
        for accessor in [3, 4] {
            d["accessors"][accessor].as_object_mut().expect("an accessor").remove("bufferView");
            d["accessors"][accessor]["count"] = 10_000_000.into();
        }
    }));

    // Numbers.
    all.push(numbers("position-nan", 0, &[f32::NAN], |_| {}).small());
    all.push(numbers("position-inf", 0, &[f32::INFINITY], |_| {}));
    all.push(numbers("position-1e38", 0, &[3e38, -3e38, 3e38], |_| {}));
    all.push(numbers("position-denormal", 0, &[1e-45, 1e-45, 0.0, 2e-45], |_| {}));
    all.push(numbers("positions-equal", 0, &[0.0; 9], |_| {}));
    all.push(Case::check("gltf/floats-of-other-endianness", "a.glb", || {
        let swapped: Vec<u8> = binary().chunks_exact(4).flat_map(|w| [w[3], w[2], w[1], w[0]]).collect();
        glb(&document(), &swapped)
    }));
    all.push(Case::check("gltf/header-of-other-endianness", "a.glb", || {
        let mut bytes = glb(&document(), &binary());
        for at in [4, 8, 12] {
            bytes[at..at + 4].reverse();
        }
        bytes
    }));
    all.push(changed("matrix-nan", |d| d["nodes"][0]["matrix"] = json!(vec![1e300; 16])));
    all.push(changed("scale-0", |d| d["nodes"][0]["scale"] = json!([0, 0, 0])));

    // JSON.
    let text = |name: &str, text: fn() -> Vec<u8>| Case::check(format!("gltf/json-{name}"), "a.gltf", text);
    all.push(text("100000-levels", || "[".repeat(100_000).into_bytes()).small());
    all.push(text("100000-objects-deep", || "{\"a\":".repeat(100_000).into_bytes()));
    all.push(text("30M-values", || format!("{{\"x\":[{}0]}}", "0,".repeat(30_000_000)).into_bytes()));
    all.push(text("5M-objects", || {
        format!("{{\"x\":[{}{{}}]}}", "{\"a\":0},".repeat(5_000_000)).into_bytes()
    }));
    all.push(text("utf-16", || "{\"asset\":{}}".encode_utf16().flat_map(u16::to_le_bytes).collect()));
    all.push(text("not-utf-8", || b"{\"asset\":{\"version\":\"\xff\xfe\"}}".to_vec()));
    all.push(text("empty", Vec::new));
    all.push(text("null", || b"null".to_vec()));
    all.push(text("zeros-100MB", || vec![0; 100_000_000]));

    // Paths and shared data.
    let none = |_: &Path| {};
    all.push(uri("above", "../secret.bin", none).refused().small());
    all.push(uri("above-escaped", "%2e%2e/secret.bin", none).refused());
    all.push(uri("absolute", "/etc/passwd", none).refused());
    all.push(uri("file", "file:///etc/passwd", none).refused());
    all.push(uri("backslash", "..\\secret.bin", none).refused());
    all.push(uri("nul", "a%00b", none).refused());
    all.push(uri("folder", ".", none).refused());
    all.push(uri("data-broken", "data:application/octet-stream;base64,@@@@", none).refused());
    all.push(uri("data-short", "data:application/octet-stream;base64,AAAA", none).refused());
    #[cfg(unix)]
    {
        all.push(uri("link-to-zero", "zero", |f| link("/dev/zero", f, "zero")).refused().small());
        all.push(uri("link-out", "out", |f| link("/etc/passwd", f, "out")).refused());
        all.push(uri("link-to-itself", "loop", |f| link("loop", f, "loop")).refused());
        all.push(uri("pipe", "pipe", |f| fifo(f, "pipe")).refused().small());
        all.push(
            uri("link-to-pipe", "link", |f| {
                fifo(f, "pipe");
                link("pipe", f, "link");
            })
            .refused(),
        );
        all.push(
            Case::new("gltf/file-is-zero", &["check", "{}/a.glb"], |f| link("/dev/zero", f, "a.glb"))
                .refused(),
        );
        all.push(
            Case::new("gltf/file-is-a-pipe", &["check", "{}/a.glb"], |f| fifo(f, "a.glb")).refused().small(),
        );
    }
    all.push(Case::new("gltf/buffer-2000-times", &["check", "{}/a.gltf"], |folder| {
        let mut document = document();
        document["buffers"] = json!(vec![json!({ "byteLength": 80, "uri": "b.bin" }); 2000]);
        write(folder, "a.gltf", document.to_string().as_bytes());
        write(folder, "b.bin", &vec![0; 10_000_000]);
    }));
    all.push(Case::check("gltf/image-400-times", "a.glb", || shared_maps(400, 2048)));
    all.push(Case::check("gltf/maps", "a.glb", || shared_maps(3, 64)));
    all.push(Case::new("gltf/image-file-400-times", &["check", "{}/a.gltf"], |folder| {
        let mut document = document();
        document["buffers"][0]["uri"] = "b.bin".into();
        document["images"] = json!(vec![json!({ "uri": "i.png" }); 400]);
        document["textures"] = json!((0..400).map(|i| json!({ "source": i })).collect::<Vec<Value>>());
        let material = |i: u32| json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": i } } });
        document["materials"] = json!((0..400).map(material).collect::<Vec<Value>>());
        let one = document["meshes"][0]["primitives"][0].clone();
        let primitive = |i: u32| {
            let mut p = one.clone();
            p["material"] = i.into();
            p
        };
        document["meshes"][0]["primitives"] = json!((0..400).map(primitive).collect::<Vec<Value>>());
        write(folder, "a.gltf", document.to_string().as_bytes());
        write(folder, "b.bin", &binary());
        write(folder, "i.png", &super::images::grey_png(4096, 4096));
    }));
    for (name, image) in
        [("png-60000", super::images::png_header(60_000, 60_000)), ("ktx2-60000", ktx2(60_000))]
    {
        all.push(Case::new(format!("gltf/texture-{name}"), &["check", "{}/a.gltf"], move |folder| {
            let mut document = document();
            document["buffers"][0]["uri"] = "b.bin".into();
            document["images"] = json!([{ "uri": "i.png" }]);
            document["textures"] = json!([{ "source": 0 }]);
            document["materials"] =
                json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
            document["meshes"][0]["primitives"][0]["material"] = 0.into();
            write(folder, "a.gltf", document.to_string().as_bytes());
            write(folder, "b.bin", &binary());
            write(folder, "i.png", &image);
        }));
    }
    for (name, mode) in [("attributes", "ATTRIBUTES"), ("triangles", "TRIANGLES"), ("indices", "INDICES")] {
        all.push(changed(&format!("meshopt-{name}-1e9"), move |d| {
            d["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] =
                json!({ "buffer": 0, "byteLength": 36, "byteStride": 4, "count": 1_000_000_000, "mode": mode });
        }));
    }
    all.push(changed("draco-of-garbage", |d| {
        d["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] =
            json!({ "bufferView": 0, "attributes": { "POSITION": 0 } });
    }));

    // Names that become paths.
    for (name, evil) in [
        ("above", "../victim"),
        ("absolute", "/tmp/rubor-victim"),
        ("drive", "C:\\victim"),
        ("nul", "a\u{0}b"),
        ("dots", ".."),
        ("long", "long-long-long-"),
    ] {
        let evil = if name == "long" { evil.repeat(100) } else { evil.to_owned() };
        let case = Case::new(
            format!("names/distribution-{name}"),
            &["maps", "extract", "{}/a.glb", "-o", "{}/maps"],
            move |f| write(f, "a.glb", &named_maps(&[&evil, "b"])),
        );
        all.push(if name == "above" { case.small() } else { case });
    }
    all
}

/// The header of a KTX2 picture of this side.
fn ktx2(side: u32) -> Vec<u8> {
    let mut header = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    header.resize(104, 0);
    header[20..24].copy_from_slice(&side.to_le_bytes());
    header[24..28].copy_from_slice(&side.to_le_bytes());
    header[36] = 1;
    header
}
