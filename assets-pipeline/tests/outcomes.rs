//! Outcomes of reading files: each row is an input made here, its result is checked, and the table of
//! `docs/interchange.md` is compared with what came out. `RUBOR_BLESS=1` writes the table.

use std::fmt::Write;
use std::path::Path;

use glam::Vec3;
use rubor_assets::error::ImportError;
use rubor_assets::import::gltf::{ImportedHead, from_bytes, lint};
use rubor_assets::import::obj_set::{ImportedSet, Options, read};
use rubor_assets::notes::Note;
use rubor_rig::head::{Head, Material};
use serde_json::{Value, json};

mod support;
use support::{Face, FaceAccessors, Folder, Pieces, animate, face_document, face_obj, glb};

/// Rows of one format.
#[derive(Default)]
struct Table(String);

impl Table {
    fn row(&mut self, what: &str, notes: Result<&[Note], &ImportError>) {
        let (word, detail) = match notes {
            Ok([]) => ("read", String::new()),
            Ok(notes) => {
                ("read, with a note", notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
            }
            Err(ImportError::Content { at, found, expected, .. }) => {
                ("refused", format!("{at}: found {found}, expected {expected}"))
            }
            Err(e) => ("refused", e.to_string()),
        };
        let detail = detail.replace('|', "\\|");
        writeln!(self.0, "| {what} | {word} | {detail} |").expect("memory");
    }

    fn compare(self, name: &str) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/interchange.md");
        let text = std::fs::read_to_string(&path).expect("the page");
        let marks =
            [format!("<!-- {name}: made by tests/outcomes.rs -->\n"), format!("<!-- end of {name} -->")];
        let table = format!("| in the file | result | what is said |\n| --- | --- | --- |\n{}", self.0);
        let start = text.find(&marks[0]).expect("the mark of the table") + marks[0].len();
        let end = text.find(&marks[1]).expect("the mark of its end");
        if std::env::var_os("RUBOR_BLESS").is_some() {
            std::fs::write(&path, format!("{}{table}{}", &text[..start], &text[end..])).expect("the page");
            return;
        }
        for (there, here) in text[start..end].lines().zip(table.lines()) {
            assert_eq!(there, here, "docs/interchange.md, {name}; RUBOR_BLESS=1 writes it anew");
        }
        assert_eq!(text[start..end].lines().count(), table.lines().count(), "rows of {name}");
    }
}

/// Names of shapes with the number of points that they move.
fn shapes(head: &Head) -> Vec<(&str, usize)> {
    head.shapes.iter().map(|s| (&s.name[..], s.points.len())).collect()
}

fn names(head: &Head) -> Vec<&str> {
    head.shapes.iter().map(|s| &s.name[..]).collect()
}

/// Weights of shapes at the end.
fn ends(i: &ImportedHead) -> Vec<(&str, f32)> {
    let shapes = i.animation.iter().flat_map(|a| &a.shapes);
    shapes.map(|(name, track)| (&name[..], track.at(1e4))).collect()
}

struct Gltf(Table);

impl Gltf {
    fn bytes(&mut self, what: &str, bytes: &[u8], check: impl FnOnce(&ImportedHead)) {
        let read = from_bytes(bytes, Path::new("face.glb"));
        self.0.row(what, read.as_ref().map(|i| &i.notes[..]));
        // Check does not panic on the file either.
        let _ = lint(bytes, Path::new("face.glb"));
        if let Ok(imported) = &read {
            check(imported);
        }
    }

    fn row(
        &mut self,
        what: &str,
        change: impl FnOnce(&mut Value, &mut Pieces, &FaceAccessors),
        check: impl FnOnce(&ImportedHead),
    ) {
        self.bytes(what, &glb(face_document(change)), check);
    }

    fn refused(&mut self, what: &str, change: impl FnOnce(&mut Value, &mut Pieces, &FaceAccessors)) {
        self.row(what, change, |_| panic!("{what}: it was read"));
    }
}

type Change = fn(&mut Value);

const BOTH: [&str; 2] = ["jawOpen", "mouthSmileLeft"];

/// Adds a second mesh with one shape and its node.
fn tongue(d: &mut Value, a: &FaceAccessors, name: Option<&str>) {
    let mut mesh = json!({"name": "Tongue", "primitives": [{
        "attributes": {"POSITION": a.position, "TEXCOORD_0": a.uv}, "indices": a.indices,
        "targets": [{"POSITION": a.smile}]}]});
    if let Some(name) = name {
        mesh["extras"] = json!({"targetNames": [name]});
    }
    d["meshes"].as_array_mut().expect("meshes").push(mesh);
    d["nodes"] =
        json!([{"mesh": 0, "name": "Head"}, {"mesh": 1, "name": "Tongue", "translation": [0, -1, 0]}]);
    d["scenes"][0]["nodes"] = json!([0, 1]);
}

fn also_animate_tongue(d: &mut Value, p: &mut Pieces, times: &[f32], weights: &[f32]) {
    let (input, output) = (p.floats(times, "SCALAR"), p.floats(weights, "SCALAR"));
    let animation = &mut d["animations"][0];
    animation["samplers"].as_array_mut().expect("samplers").push(json!({"input": input, "output": output}));
    let channel = json!({"sampler": 1, "target": {"node": 1, "path": "weights"}});
    animation["channels"].as_array_mut().expect("channels").push(channel);
}

#[test]
fn gltf_files() {
    let mut t = Gltf(Table::default());
    let full = [("jawOpen", 1.0), ("mouthSmileLeft", 0.5)];
    let keyed = |d: &mut Value, p: &mut Pieces| animate(d, p, &[0.0, 1.0], &[0.0, 0.0, 1.0, 0.5]);
    t.row(
        "names in `mesh.extras.targetNames`",
        |_, _, _| {},
        |i| {
            assert_eq!(i.head.mesh.points.len(), Face::POINTS);
            assert_eq!(names(&i.head), BOTH);
            assert!(i.animation.is_none());
        },
    );
    t.row(
        "names in the extras of the primitive",
        |d, _, _| {
            d["meshes"][0]["primitives"][0]["extras"] = d["meshes"][0]["extras"].take();
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "names in the extras of each target",
        |d, _, _| {
            d["meshes"][0]["extras"] = json!({});
            for (k, name) in BOTH.iter().enumerate() {
                d["meshes"][0]["primitives"][0]["targets"][k][["extras", "extra"][k]] = json!({"name": name});
            }
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "names of accessors",
        |d, p, a| {
            d["meshes"][0]["extras"] = json!({});
            p.accessors[a.jaw]["name"] = json!("jawOpen");
            p.accessors[a.smile]["name"] = json!("mouthSmileLeft");
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "accessors named by number alone",
        |d, p, a| {
            d["meshes"][0]["extras"] = json!({});
            p.accessors[a.jaw]["name"] = json!("accessor_3");
            p.accessors[a.smile]["name"] = json!("accessor_4");
        },
        |i| assert_eq!(names(&i.head), ["target 0", "target 1"]),
    );
    t.row(
        "fewer names than targets",
        |d, _, _| d["meshes"][0]["extras"]["targetNames"] = json!(["jawOpen"]),
        |i| assert_eq!(names(&i.head), ["jawOpen", "target 1"]),
    );
    t.row(
        "more names than targets",
        |d, _, _| d["meshes"][0]["extras"]["targetNames"] = json!(["jawOpen", "mouthSmileLeft", "third"]),
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "one mesh on two nodes with other default weights",
        |d, _, _| {
            d["nodes"] = json!([{"mesh": 0, "weights": [1, 0]}, {"mesh": 0, "weights": [0.5, 0], "translation": [1, 0, 0]}]);
            d["scenes"][0]["nodes"] = json!([0, 1]);
        },
        |i| assert_eq!(ends(i), [("jawOpen", 1.0), ("jawOpen_1", 0.5)]),
    );
    t.row(
        "an extension that is used, not required, and not known",
        |d, _, _| d["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]),
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "one name twice in a mesh",
        |d, p, _| {
            d["meshes"][0]["extras"]["targetNames"] = json!(["shape", "shape"]);
            keyed(d, p);
        },
        |i| {
            assert_eq!(names(&i.head), ["shape", "shape_1"]);
            assert_ne!(i.head.shapes[0].points, i.head.shapes[1].points);
            assert_eq!(ends(i), [("shape", 1.0), ("shape_1", 0.5)]);
        },
    );
    t.row(
        "one name twice, and a shape that has the number already",
        |d, _, a| {
            d["meshes"][0]["extras"]["targetNames"] = json!(["shape", "shape_1", "shape"]);
            let targets = json!([{"POSITION": a.jaw}, {"POSITION": a.smile}, {"POSITION": a.smile}]);
            d["meshes"][0]["primitives"][0]["targets"] = targets;
        },
        |i| assert_eq!(names(&i.head), ["shape", "shape_1", "shape_2"]),
    );
    t.row(
        "two meshes without names",
        |d, p, a| {
            tongue(d, a, None);
            d["meshes"][0]["extras"] = json!({});
            keyed(d, p);
            also_animate_tongue(d, p, &[0.0, 1.0], &[0.0, 0.25]);
        },
        |i| {
            assert_eq!(names(&i.head), ["target 0", "target 1", "Tongue target 0"]);
            assert_eq!(ends(i), [("Tongue target 0", 0.25), ("target 0", 1.0), ("target 1", 0.5)]);
        },
    );
    t.row(
        "two meshes, one name, the same keys",
        |d, p, a| {
            tongue(d, a, Some("jawOpen"));
            keyed(d, p);
            // One key more on the same line.
            also_animate_tongue(d, p, &[0.0, 0.5, 1.0], &[0.0, 0.5, 1.0]);
        },
        |i| {
            assert_eq!(names(&i.head), BOTH);
            assert_eq!(ends(i), full);
        },
    );
    t.row(
        "two meshes, one name, keys of one",
        |d, p, a| {
            tongue(d, a, Some("jawOpen"));
            keyed(d, p);
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "two meshes, one name, other keys",
        |d, p, a| {
            tongue(d, a, Some("jawOpen"));
            keyed(d, p);
            also_animate_tongue(d, p, &[0.0, 1.0], &[0.0, 0.25]);
        },
        |i| {
            assert_eq!(names(&i.head), ["jawOpen", "mouthSmileLeft", "jawOpen_1"]);
            assert_eq!(ends(i), [("jawOpen", 1.0), ("jawOpen_1", 0.25), ("mouthSmileLeft", 0.5)]);
        },
    );
    t.row(
        "default weights of the mesh",
        |d, _, _| d["meshes"][0]["weights"] = json!([1, 0]),
        |i| {
            assert_eq!(ends(i), [("jawOpen", 1.0)]);
        },
    );
    t.row(
        "default weights of the node, which win",
        |d, _, _| {
            d["meshes"][0]["weights"] = json!([0, 0]);
            d["nodes"][0]["weights"] = json!([1, 0.25]);
        },
        |i| assert_eq!(ends(i), [("jawOpen", 1.0), ("mouthSmileLeft", 0.25)]),
    );
    t.row(
        "default weights and keys, which win",
        |d, p, _| {
            d["meshes"][0]["weights"] = json!([0.3, 0.3]);
            keyed(d, p);
        },
        |i| assert_eq!(ends(i), full),
    );
    t.row(
        "more default weights than targets",
        |d, _, _| d["meshes"][0]["weights"] = json!([1, 0, 1]),
        |i| {
            assert_eq!(ends(i), [("jawOpen", 1.0)]);
        },
    );
    t.row(
        "weights below 0 and above 1",
        |d, p, _| animate(d, p, &[0.0, 1.0], &[0.0, 0.0, 1.5, -0.5]),
        |i| {
            assert_eq!(ends(i), [("jawOpen", 1.5), ("mouthSmileLeft", -0.5)]);
        },
    );
    let channel = |change: Change| {
        move |d: &mut Value, p: &mut Pieces, _: &FaceAccessors| {
            animate(d, p, &[0.0, 1.0], &[0.0, 0.0, 1.0, 0.5]);
            let animation = &mut d["animations"][0];
            let mut other = animation["channels"][0].clone();
            change(&mut other);
            animation["channels"].as_array_mut().expect("channels").push(other);
            let sampler = animation["samplers"][0].clone();
            let samplers = animation["samplers"].as_array_mut().expect("samplers");
            samplers.push(
                json!({"input": sampler["input"], "output": sampler["output"], "interpolation": "BEZIER"}),
            );
        }
    };
    let channels: [(&str, Change); 8] = [
        ("a channel without a node", |c| c["target"] = json!({"path": "translation"})),
        ("an animation pointer", |c| {
            c["target"] = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}});
        }),
        ("a channel of a node that does not exist", |c| c["target"] = json!({"node": 7, "path": "rotation"})),
        ("a channel with an unknown path", |c| c["target"]["path"] = json!("colour")),
        ("a channel without a path", |c| c["target"] = json!({"node": 0})),
        ("a channel whose sampler does not exist", |c| {
            *c = json!({"sampler": 9, "target": {"node": 0, "path": "rotation"}});
        }),
        ("an unknown interpolation", |c| {
            *c = json!({"sampler": 1, "target": {"node": 0, "path": "translation"}});
        }),
        ("two channels of one target", |_| {}),
    ];
    for (what, change) in channels {
        t.row(what, channel(change), |i| assert_eq!(ends(i), full, "{what}"));
    }
    t.row(
        "more numbers than keys have weights",
        |d, p, _| animate(d, p, &[0.0, 1.0], &[0.0, 0.0, 1.0]),
        |i| assert!(i.animation.is_none()),
    );
    t.row(
        "an accessor of keys that does not exist",
        |d, p, _| {
            keyed(d, p);
            d["animations"][0]["samplers"][0]["input"] = json!(99);
        },
        |i| assert!(i.animation.is_none()),
    );
    t.row(
        "two keys at one time",
        |d, p, _| animate(d, p, &[0.0, 0.5, 0.5, 1.0], &[0.0, 0.0, 0.2, 0.0, 1.0, 0.0, 1.0, 0.0]),
        |i| {
            let track = &i.animation.as_ref().expect("an animation").shapes["jawOpen"];
            assert!((track.at(0.25) - 0.1).abs() < 1e-6 && (track.at(0.499) - 0.2).abs() < 1e-2);
            assert_eq!((track.at(0.5), track.at(0.75)), (1.0, 1.0));
        },
    );
    t.row(
        "keys before 0",
        |d, p, _| animate(d, p, &[-0.5, 0.5, 1.0], &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        |i| {
            let track = &i.animation.as_ref().expect("an animation").shapes["jawOpen"];
            assert_eq!((track.at(0.0), track.at(0.25), track.at(0.5)), (0.5, 0.75, 1.0));
        },
    );
    t.row(
        "keys in another order",
        |d, p, _| animate(d, p, &[0.0, 1.0, 0.5], &[0.0, 0.0, 1.0, 0.0, 0.25, 0.0]),
        |i| {
            let track = &i.animation.as_ref().expect("an animation").shapes["jawOpen"];
            assert_eq!((track.at(0.5), track.at(1.0)), (0.25, 1.0));
        },
    );
    t.row(
        "a key after a year",
        |d, p, _| animate(d, p, &[0.0, 1.0, 3e7], &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        |i| assert_eq!(i.animation.as_ref().expect("an animation").duration, 1.0),
    );
    t.row(
        "a key whose time is not a number",
        |d, p, _| animate(d, p, &[0.0, f32::NAN], &[0.0, 0.0, 1.0, 0.5]),
        |i| assert!(i.animation.is_none()),
    );
    t.row(
        "several animations, the first moves something else",
        |d, p, _| {
            keyed(d, p);
            let take = d["animations"][0].clone();
            let mut other = take.clone();
            other["channels"][0]["target"] = json!({"node": 0, "path": "scale"});
            d["animations"] = json!([other, take]);
        },
        |i| assert_eq!(ends(i), full),
    );
    t.row(
        "a seam whose positions differ in the last place",
        |_, p, a| {
            let view = p.accessors[a.position]["bufferView"].as_u64().expect("a view") as usize;
            let start = p.views[view]["byteOffset"].as_u64().expect("an offset") as usize;
            for z in (start + 8..start + 12 * 17 * 13).step_by(12 * 17) {
                let value = f32::from_le_bytes(p.bytes[z..z + 4].try_into().expect("4 bytes"));
                p.bytes[z..z + 4].copy_from_slice(&value.next_up().to_le_bytes());
            }
        },
        |i| assert_eq!(i.head.mesh.points.len(), Face::POINTS),
    );
    t.row(
        "normals that differ by 30 degrees at one place: a sharp edge",
        |d, p, a| {
            let normal = |k: usize| if k.is_multiple_of(17) { [0.5, 0.0, 0.866] } else { [0.0, 0.0, 1.0] };
            let normals: Vec<[f32; 3]> = (0..17 * 13).map(normal).collect();
            let normals = p.floats(normals.as_flattened(), "VEC3");
            d["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
            let _ = a;
        },
        |i| assert_eq!(i.head.mesh.points.len(), Face::POINTS + 11 + 2),
    );
    t.row(
        "an attribute that glTF 2.0 does not know",
        |d, _, a| d["meshes"][0]["primitives"][0]["attributes"]["BLEND"] = json!(a.uv),
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "no bounds of positions",
        |_, p, a| {
            p.accessors[a.position].as_object_mut().expect("an accessor").remove("min");
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    t.row(
        "a camera and a material that are wrong",
        |d, _, _| {
            d["cameras"] = json!([{"type": "fisheye"}]);
            d["nodes"][0]["camera"] = json!(4);
            d["materials"] = json!([{"name": "skin", "alphaMode": "FOG"}]);
            d["meshes"][0]["primitives"][0]["material"] = json!(0);
        },
        |i| assert_eq!(i.head.mesh.parts[0].name, "skin"),
    );
    t.row(
        "no texture coordinates",
        |d, _, a| d["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": a.position}),
        |i| assert_eq!(i.head.mesh.vertices[3].uv, glam::Vec2::ZERO),
    );
    t.row(
        "lines beside the face",
        |d, _, a| {
            let lines = json!({"attributes": {"POSITION": a.position}, "mode": 1});
            d["meshes"][0]["primitives"].as_array_mut().expect("primitives").push(lines);
        },
        |i| assert_eq!(i.head.mesh.parts.len(), 1),
    );
    t.row(
        "a mesh outside the scene",
        |d, _, a| {
            tongue(d, a, Some("tongueOut"));
            d["scenes"][0]["nodes"] = json!([0]);
        },
        |i| assert_eq!(names(&i.head), BOTH),
    );
    let mut cut = glb(face_document(|_, _, _| {}));
    let mut old = cut.clone();
    old[4] = 1;
    cut.truncate(cut.len() - 1);
    t.bytes("a GLB that was cut off", &cut, |_| panic!("it was read"));
    t.bytes("a GLB of version 1", &old, |_| panic!("it was read"));
    t.refused("a Draco mesh without data", |d, p, a| {
        d["meshes"][0]["primitives"][0]["extensions"] =
            json!({"KHR_draco_mesh_compression": {"bufferView": 99, "attributes": {"POSITION": 0}}});
        p.accessors[a.position].as_object_mut().expect("an accessor").remove("bufferView");
    });
    t.refused("an unknown extension that the file requires", |d, _, _| {
        d["extensionsRequired"] = json!(["ACME_blobs"])
    });
    t.refused("a ring of nodes", |d, _, _| d["nodes"][0]["children"] = json!([0]));
    t.refused("indices of vertices that do not exist", |d, p, _| {
        let view = p.view(&[0, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0, 0], None);
        let far =
            p.accessor(json!({"bufferView": view, "componentType": 5125, "count": 3, "type": "SCALAR"}));
        d["meshes"][0]["primitives"][0]["indices"] = json!(far);
    });
    t.refused("an accessor that does not exist", |d, _, _| {
        d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99);
    });
    t.refused("targets of another size", |d, p, _| {
        let short = p.floats(&[0.0; 9], "VEC3");
        d["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(short);
    });
    t.refused("points alone", |d, _, _| d["meshes"][0]["primitives"][0]["mode"] = json!(0));
    t.refused("a position that is not finite", |_, p, a| {
        let view = p.accessors[a.position]["bufferView"].as_u64().expect("a view") as usize;
        let start = p.views[view]["byteOffset"].as_u64().expect("an offset") as usize;
        p.bytes[start..start + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    });
    t.refused("accessors that claim more than a head has", |d, p, _| {
        let zeros = p.accessor(json!({"componentType": 5126, "count": 16_000_000, "type": "VEC3"}));
        let primitive = json!({"attributes": {"POSITION": zeros}});
        d["meshes"][0]["primitives"] = Value::Array(vec![primitive; 64]);
    });
    t.0.compare("glTF");
}

struct Obj(Table);

impl Obj {
    fn row(&mut self, what: &str, files: &[(&str, &[u8])], check: impl FnOnce(&ImportedSet)) {
        let folder =
            Folder::new(&format!("outcome-{}", what.replace(|c: char| !c.is_alphanumeric(), "-")), files);
        let read = read(&Options { folder: folder.0.clone(), occlusion_rays: 0, ..Options::default() });
        let read = read.map_err(|e| match e {
            // The folder has another name each time.
            ImportError::Content { path, at, found, expected } => {
                let shown = format!("{}/", folder.0.display());
                let [at, found, expected] = [at, found, expected].map(|s| s.replace(&shown, ""));
                ImportError::Content { path, at, found, expected }
            }
            other => other,
        });
        self.0.row(what, read.as_ref().map(|i| &i.notes[..]));
        if let Ok(set) = &read {
            check(set);
        }
    }

    fn refused(&mut self, what: &str, files: &[(&str, &[u8])]) {
        self.row(what, files, |_| panic!("{what}: it was read"));
    }
}

fn parts(set: &ImportedSet) -> Vec<(&str, Material)> {
    set.head.mesh.parts.iter().map(|p| (&p.name[..], p.material)).collect()
}

const SQUARE: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
const FACE: &str = "f 1/1 2/2 3/3 4/4\n";

#[test]
fn obj_files() {
    let mut t = Obj(Table::default());
    let neutral = face_obj(&[]);
    let moved = face_obj(&Face::new().jaw);
    let moves_jaw = |set: &ImportedSet| {
        assert_eq!(set.head.mesh.points.len(), Face::POINTS);
        let [(name, count)] = shapes(&set.head)[..] else { panic!("{:?}", shapes(&set.head)) };
        assert_eq!((name, count), ("jawOpen", 4 * 16 + 1));
        assert!(set.head.shapes[0].offsets.iter().all(|o| o.abs_diff_eq(Vec3::new(0.0, -0.02, 0.0), 1e-6)));
    };
    let set = |shape: &[u8], check: &dyn Fn(&ImportedSet), what: &str, t: &mut Obj| {
        t.row(what, &[("neutral.obj", neutral.as_bytes()), ("jawOpen.obj", shape)], check);
    };
    set(moved.as_bytes(), &moves_jaw, "a neutral mesh and a shape", &mut t);
    let faces_last: Vec<&str> = moved.lines().filter(|l| l.starts_with("f ")).collect();
    let rest: Vec<&str> = moved.lines().filter(|l| !l.starts_with("f ")).collect();
    let reversed: Vec<&str> = faces_last.iter().rev().copied().collect();
    let text = [rest.join("\n"), reversed.join("\n")].join("\n");
    set(text.as_bytes(), &moves_jaw, "faces of a shape in another order", &mut t);
    // Points backwards, faces renumbered.
    let points: Vec<&str> = moved.lines().filter(|l| l.starts_with("v ")).rev().collect();
    let others = moved.lines().filter(|l| !l.starts_with("v "));
    let renumbered = |line: &str| match line.strip_prefix("f ") {
        Some(corners) => {
            let corner = |c: &str| {
                let (p, uv) = c.split_once('/').expect("both");
                format!("{}/{uv}", Face::POINTS + 1 - p.parse::<usize>().expect("a number"))
            };
            format!("f {}", corners.split(' ').map(corner).collect::<Vec<_>>().join(" "))
        }
        None => line.to_owned(),
    };
    let others: Vec<String> = others.map(renumbered).collect();
    let text = format!("{}\n{}", points.join("\n"), others.join("\n"));
    set(text.as_bytes(), &moves_jaw, "points of a shape in another order", &mut t);
    let alone: String = moved.lines().filter(|l| l.starts_with("v ")).map(|l| format!("{l}\n")).collect();
    set(alone.as_bytes(), &moves_jaw, "a shape that is points alone", &mut t);
    let (mut faces, mut uvs): (Vec<String>, Vec<String>) =
        others.into_iter().partition(|l| l.starts_with("f "));
    faces.reverse();
    let text = [points.join("\n"), uvs.join("\n"), faces.join("\n")].join("\n");
    set(text.as_bytes(), &moves_jaw, "points and faces of a shape in other orders", &mut t);
    let no = |_: &ImportedSet| panic!("it was read");
    uvs.retain(|l| !l.starts_with("vt "));
    let bare = |corner: &str| corner.split('/').next().unwrap_or_default().to_owned();
    let words = |l: &String| l.split(' ').map(bare).collect::<Vec<_>>().join(" ");
    let mut bare: Vec<String> = faces.iter().map(words).collect();
    bare.swap(0, 1);
    let mut other: Vec<&str> = points.clone();
    other.swap(3, 40);
    let text = [other.join("\n"), uvs.join("\n"), bare.join("\n").replace("f 5 ", "f 41 ")].join("\n");
    set(text.as_bytes(), &no, "a shape with other faces", &mut t);
    set(&moved.as_bytes()[moved.find("v ").expect("points") + 1..], &no, "a shape with a point less", &mut t);

    let square = |more: &str| format!("{SQUARE}{more}");
    let one = |text: &[u8], check: &dyn Fn(&ImportedSet), what: &str, t: &mut Obj| {
        t.row(what, &[("neutral.obj", text)], check);
    };
    let same_square = |set: &ImportedSet| {
        assert_eq!((set.head.mesh.points.len(), set.head.mesh.triangles.len()), (4, 2));
        assert_eq!(set.head.mesh.vertices[2].uv, glam::Vec2::new(1.0, 0.0));
        assert!(set.head.mesh.points[2].abs_diff_eq(Vec3::new(0.1, 0.1, 0.0), 1e-6));
    };
    let text = square(&format!("usemtl Head skin\n{FACE}usemtl Head teeth\n{FACE}"));
    let two = [("Head skin", Material::Skin), ("Head teeth", Material::Teeth)];
    one(text.as_bytes(), &|s| assert_eq!(parts(s), two), "names of materials with spaces", &mut t);
    let latin = [square("usemtl Z").as_bytes(), b"\xe4hne teeth\n", FACE.as_bytes()].concat();
    one(&latin, &|s| assert_eq!(parts(s), [("Zähne teeth", Material::Teeth)]), "names in Latin-1", &mut t);
    let text = square(&format!("g face\n{FACE}g teeth\n{FACE}"));
    let two = [("face", Material::Skin), ("teeth", Material::Teeth)];
    one(text.as_bytes(), &|s| assert_eq!(parts(s), two), "groups without materials", &mut t);
    let text = square(&format!("o face\n{FACE}o teeth\n{FACE}"));
    one(text.as_bytes(), &|s| assert_eq!(parts(s), two), "objects without materials", &mut t);
    let text = square(&format!("o teeth\n{FACE}o head\nusemtl skin\n{FACE}"));
    let mixed = [("teeth", Material::Teeth), ("skin", Material::Skin)];
    one(
        text.as_bytes(),
        &|s| assert_eq!(parts(s), mixed),
        "an object without material beside one with",
        &mut t,
    );
    let text = square(&format!("usemtl initialShadingGroup\ng face\n{FACE}g teeth\n{FACE}"));
    one(
        text.as_bytes(),
        &|s| assert_eq!(parts(s), two),
        "groups that all have a program's default material",
        &mut t,
    );
    one(square(FACE).as_bytes(), &same_square, "no groups and no materials", &mut t);
    let text = format!(
        "o a\nv 0 0 5\nv 1 0 5\nv 1 1 5\nf 1 2 3\no b\n{}",
        "v 0 0 0\nv 10 0 0\nv 10 10 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 4/1 5/2 6/3\n"
    );
    let exact = |s: &ImportedSet| {
        let uvs: Vec<[f32; 2]> = s.head.mesh.vertices.iter().map(|v| v.uv.to_array()).collect();
        assert_eq!(uvs, [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    };
    one(text.as_bytes(), &exact, "an object without texture coordinates before one with", &mut t);
    let text = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nusemtl face\nf 1 2 3 4 5\n";
    let covered = |s: &ImportedSet| {
        let mesh = &s.head.mesh;
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.points[mesh.vertices[v as usize].point as usize]);
            1e4 * (b - a).cross(c - a).z / 2.0
        };
        let areas: Vec<f32> = mesh.triangles.iter().map(area).collect();
        assert!(
            (areas.iter().sum::<f32>() - 10.0).abs() < 1e-3 && areas.iter().all(|a| *a > 0.0),
            "{areas:?}"
        );
    };
    one(text.as_bytes(), &covered, "a concave polygon", &mut t);
    let text = square("f 1/1 2/2 \\\n 3/3 4/4\n").replacen("v 10 0 0", "v 10 \\\n0 0", 1);
    one(text.as_bytes(), &same_square, "lines that go on after `\\`", &mut t);
    let text = square(&format!("# C:\\models\\\n{FACE}")).replacen("vt 0 0", "mtllib C:\\m\\\nvt 0 0", 1);
    one(text.as_bytes(), &same_square, "paths and comments that end in `\\`", &mut t);
    let text = [b"\xef\xbb\xbf".as_slice(), square(FACE).as_bytes()].concat();
    one(&text, &same_square, "a byte order mark", &mut t);
    let utf16: Vec<u8> =
        [0xfeff].into_iter().chain(square(FACE).encode_utf16()).flat_map(u16::to_le_bytes).collect();
    one(&utf16, &no, "UTF-16", &mut t);
    one(square(FACE).replace('\n', "\r").as_bytes(), &same_square, "lines that end in CR", &mut t);
    one(square(FACE).replace('\n', "\r\n").as_bytes(), &same_square, "lines that end in CR LF", &mut t);
    let text = square("f 1/1 2/2 3/3 4/4 # chin\n").replacen("vt 0 0", "vt 0 0 #corner", 1);
    one(text.as_bytes(), &same_square, "comments after a statement", &mut t);
    let text = square("f -4/-4 -3/-3 -2/-2 -1/-1\nv 7 7 7\nvt 0.5 0.5\n");
    one(text.as_bytes(), &same_square, "relative indices", &mut t);
    let text = format!("f 1/1/1 2/2/1 3/3/1 4/4/1\n{}vn 0 0 1\n", square(""));
    one(text.as_bytes(), &same_square, "faces before their points, normals", &mut t);
    let text = square(FACE).replacen("v 10 0 0", "v 10 0 0 0.5 0.5 0.5", 1);
    one(text.as_bytes(), &same_square, "colours of some points", &mut t);
    let text = square(FACE).replacen("v 10 0 0", "v 10 0 0 0", 1);
    one(text.as_bytes(), &same_square, "a fourth number of a point", &mut t);
    let text = square(&format!("l 1 2 3\np 1\nf 1/1 2/2\ncstype bezier\n{FACE}"));
    one(text.as_bytes(), &same_square, "lines, points, faces of two corners, curves", &mut t);
    for (what, from, to) in [
        ("a number that is none", "v 10 0 0", "v 10 nan 0"),
        ("a decimal comma", "v 10 0 0", "v 10 0,5 0"),
        ("a point of two numbers", "v 10 0 0", "v 10 0"),
        ("a position that does not exist", "f 1/1", "f 9/1"),
        ("index 0", "f 1/1", "f 0/1"),
        ("a texture coordinate that does not exist", "f 1/1", "f 1/9"),
        ("an index beyond any file", "f 1/1", "f 1/9223372036854775807"),
        ("a relative index before the first", "f 1/1", "f -9/1"),
        ("no faces", FACE, ""),
    ] {
        t.refused(what, &[("neutral.obj", square(FACE).replacen(from, to, 1).as_bytes())]);
    }
    t.0.compare("OBJ");
}
