//! Readers under mutated files: no panic, bounded time. `RUBOR_MUTATIONS=10000` runs more than the suite does.
//!
//! A mutation changes bytes, or the structure: numbers of the JSON, fields, words and lines. Seeded: a failure prints the
//! number of the mutation and comes again.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use rubor_assets::import::gltf::{from_bytes, lint};
use rubor_assets::import::obj::{self, GroupBy};
use rubor_assets::import::obj_set::{Options, read};
use rubor_rig::random::SplitMix64;
use serde_json::{Value, json};

mod support;
use support::{Face, Folder, animate, face_document, face_obj, glb};

/// Longest time of one file, with room for a machine that does other things.
const LONGEST: Duration = Duration::from_secs(10);

fn count() -> u64 {
    std::env::var("RUBOR_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(300)
}

fn pick<'a, T>(list: &'a [T], random: &mut SplitMix64) -> &'a T {
    &list[random.below(list.len())]
}

/// Flips, overwrites, repeats, removes and cuts bytes.
fn mutate_bytes(bytes: &mut Vec<u8>, random: &mut SplitMix64) {
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        let end = (at + 1 + random.below(16)).min(bytes.len());
        match random.below(6) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = *pick(&[0, 1, 0x7f, 0x80, 0xff, b'0', b'-', b'/', b'\\', b'\n', b'\r'], random),
            2 => bytes[at..end].fill(*pick(&[0, 0xff, b'9'], random)),
            3 => {
                let copy = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            4 => {
                bytes.drain(at..end);
            }
            _ if random.below(8) == 0 => bytes.truncate(at),
            _ => bytes[at] = random.bits() as u8,
        }
    }
}

/// Changes one value somewhere in a document.
fn mutate_json(value: &mut Value, random: &mut SplitMix64) {
    let inner = match value {
        Value::Object(map) => map.len(),
        Value::Array(list) => list.len(),
        _ => 0,
    };
    if inner > 0 && random.below(8) > 0 {
        let at = random.below(inner);
        match value {
            Value::Object(map) => {
                let key = map.keys().nth(at).cloned().unwrap_or_default();
                match random.below(24) {
                    0 => {
                        map.remove(&key);
                    }
                    1 => {
                        let taken = map.remove(&key).unwrap_or_default();
                        map.insert(
                            pick(&["node", "mesh", "path", "targets", "POSITION"], random).to_string(),
                            taken,
                        );
                    }
                    _ => mutate_json(&mut map[&key], random),
                }
            }
            Value::Array(list) => match random.below(24) {
                0 => {
                    list.remove(at);
                }
                1 => {
                    let copy = list[at].clone();
                    list.extend(vec![copy; 1 + random.below(3)]);
                }
                _ => mutate_json(&mut list[at], random),
            },
            _ => {}
        }
        return;
    }
    let others = [
        json!(0),
        json!(1),
        json!(-1),
        json!(2),
        json!(7),
        json!(255),
        json!(65_536),
        json!(16_777_216),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(1e39),
        json!(-1e300),
        json!(0.5),
        json!(""),
        json!("pointer"),
        json!("VEC3"),
        json!("SCALAR"),
        json!("CUBICSPLINE"),
        json!("data:;base64,AAAA"),
        json!(null),
        json!(true),
        json!([]),
        json!({}),
        json!([0, 0, 1]),
        json!(5121),
        json!(5126),
    ];
    *value = pick(&others, random).clone();
}

/// Runs a reader on mutations and collects those that panic or take too long.
fn run(name: &str, seed: u64, mut once: impl FnMut(&mut SplitMix64)) {
    let mut faults = Vec::new();
    let mut slowest = Duration::ZERO;
    // The messages of caught panics say where they come from.
    for i in 0..count() {
        let start = Instant::now();
        let mut random = SplitMix64(seed ^ i.wrapping_mul(0xd134_2543_de82_ef95));
        if catch_unwind(AssertUnwindSafe(|| once(&mut random))).is_err() {
            faults.push(format!("mutation {i} panics"));
        }
        let time = start.elapsed();
        slowest = slowest.max(time);
        if time > LONGEST {
            faults.push(format!("mutation {i} takes {time:?}"));
        }
    }
    println!("{name}: {} mutations, slowest {slowest:?}", count());
    assert!(faults.is_empty(), "{name}: {faults:?}");
}

#[test]
fn glb_files() {
    let weights: Vec<f32> = (0..8).map(|i| i as f32 / 8.0).collect();
    let document = face_document(|d, p, a| {
        d["meshes"][0]["weights"] = json!([0.5, 0.0]);
        let normals = p.floats(Face::new().positions.as_flattened(), "VEC3");
        d["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
        let second =
            json!({"primitives": [a.primitive()], "extras": {"targetNames": ["jawOpen", "jawOpen"]}});
        d["meshes"].as_array_mut().expect("meshes").push(second);
        d["nodes"] = json!([{"mesh": 0, "name": "Head", "children": [1]}, {"mesh": 1, "weights": [0, 1]}]);
        animate(d, p, &[0.0, 0.5, 0.75, 1.0], &weights);
        let turn = p.floats(&[[0.0, 0.0, 0.0, 1.0]; 12].concat(), "VEC4");
        let animation = &mut d["animations"][0];
        let input = animation["samplers"][0]["input"].clone();
        animation["samplers"]
            .as_array_mut()
            .expect("samplers")
            .push(json!({"input": input, "output": turn, "interpolation": "CUBICSPLINE"}));
        animation["channels"].as_array_mut().expect("channels").extend([
            json!({"sampler": 1, "target": {"node": 0, "path": "rotation"}}),
            json!({"sampler": 0, "target": {"node": 1, "path": "weights"}}),
        ]);
    });
    // And a head of our own, whose extension is read too.
    let head =
        from_bytes(document.to_string().as_bytes(), Path::new("face.gltf")).expect("the seed is right").head;
    let own = rubor_assets::export::gltf::to_bytes(&head, &Default::default()).expect("a head");
    let split = gltf::binary::Glb::from_slice(&own).expect("our own");
    let own_json: Value = serde_json::from_slice(&split.json).expect("our own");
    let bin = split.bin.clone().unwrap_or_default().into_owned();
    let seed = glb(document.clone());
    let path = Path::new("mutated.glb");
    run("GLB", 11, |random| {
        let bytes = match random.below(6) {
            0 => {
                let mut bytes = seed.clone();
                mutate_bytes(&mut bytes, random);
                bytes
            }
            1 => {
                let mut bytes = own.clone();
                mutate_bytes(&mut bytes, random);
                bytes
            }
            2 | 3 => {
                let mut json = own_json.clone();
                (0..=random.below(3)).for_each(|_| mutate_json(&mut json, random));
                let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
                let json = json.to_string().into_bytes().into();
                let file = gltf::binary::Glb { header, json, bin: Some(bin.clone().into()) };
                file.to_vec().expect("memory")
            }
            _ => {
                let mut json = document.clone();
                (0..=random.below(3)).for_each(|_| mutate_json(&mut json, random));
                json.to_string().into_bytes()
            }
        };
        let _ = lint(&bytes, path);
        if let Ok(imported) = from_bytes(&bytes, path) {
            // Accepted input follows the rules of heads and sequences.
            imported.head.validate().expect("a valid head");
            if let Some(sequence) = imported.animation {
                sequence.check().expect("a valid sequence");
            }
        }
    });
}

#[test]
fn obj_files() {
    let seed = format!("{}g other\nf 1/1 2/2 3/3 40/4 41/5\n", face_obj(&[]));
    let seed = seed.into_bytes();
    run("OBJ", 12, |random| {
        let mut bytes = seed.clone();
        for _ in 0..=random.below(3) {
            if random.below(2) == 0 {
                mutate_bytes(&mut bytes, random);
                continue;
            }
            // A word of a line becomes another, or a line moves.
            let text = String::from_utf8_lossy(&bytes).into_owned();
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            if lines.is_empty() {
                continue;
            }
            let at = random.below(lines.len());
            match random.below(3) {
                0 => {
                    let line = lines.remove(at);
                    let to = random.below(lines.len() + 1);
                    lines.insert(to, line);
                }
                1 => lines[at].push_str(" \\"),
                _ => {
                    let mut words: Vec<String> = lines[at].split(' ').map(str::to_owned).collect();
                    let k = random.below(words.len());
                    let other = [
                        "0",
                        "-1",
                        "1e39",
                        "nan",
                        "9223372036854775807",
                        "1//",
                        "/",
                        "1/2/3/4",
                        "-0",
                        "f",
                        "v",
                        "#",
                        "l",
                    ];
                    words[k] = pick(&other, random).to_string();
                    lines[at] = words.join(" ");
                }
            }
            bytes = lines.join("\n").into_bytes();
        }
        let group_by = *pick(&[GroupBy::Group, GroupBy::Material], random);
        if let Ok(file) = obj::from_bytes(&bytes, Path::new("mutated.obj"), group_by) {
            let mesh = &file.mesh;
            assert!(
                mesh.corners
                    .iter()
                    .all(|c| (c.point as usize) < mesh.points.len() && (c.uv as usize) < mesh.uvs.len())
            );
        }
        if random.below(8) == 0 {
            let folder = Folder::new("mutated", &[("neutral.obj", &seed), ("jawOpen.obj", &bytes)]);
            let options = Options { folder: folder.0.clone(), occlusion_rays: 0, ..Options::default() };
            if let Ok(set) = read(&options) {
                set.head.validate().expect("a valid head");
            }
        }
    });
}
