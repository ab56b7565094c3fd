//! Scenes as other people author them. Each row of the table in `docs/maya.md` is a scene here, and the column of
//! outcomes is what reading it gave: `RUBOR_BLESS=1` writes the table anew.

mod plate;

use std::path::Path;

use glam::Vec3;
use plate::{RISE, Scene, second_plate};
use rubor_maya::error::ReadError;
use rubor_maya::read::{self, Imported};
use rubor_rig::random::SplitMix64;

fn smile(imported: &Imported) -> Vec<(u32, f32)> {
    let shape = imported.head.shapes.iter().find(|s| s.name == "smile").unwrap();
    shape.points.iter().copied().zip(shape.offsets.iter().map(|o| o.y)).collect()
}

/// Weight of a shape at a time; none without a track.
fn weight(imported: &Imported, shape: &str, t: f64) -> Option<f32> {
    imported.sequence.as_ref()?.shapes.get(shape).map(|track| track.at(t))
}

fn names(imported: &Imported) -> Vec<&str> {
    imported.head.shapes.iter().map(|s| s.name.as_str()).collect()
}

/// Normals of the triangles as long as twice their area, cm^2.
fn normals(imported: &Imported) -> Vec<Vec3> {
    let mesh = &imported.head.mesh;
    let point = |v: u32| mesh.points[mesh.vertices[v as usize].point as usize];
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(point);
        (b - a).cross(c - a) * 1e4
    };
    mesh.triangles.iter().map(normal).collect()
}

#[track_caller]
fn near(found: f32, expected: f32) {
    assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} for {expected}");
}

#[track_caller]
fn lifts(imported: &Imported, expected: [f32; 3]) {
    let found = smile(imported);
    assert_eq!(found.iter().map(|(point, _)| *point).collect::<Vec<_>>(), [6, 7, 8]);
    found.iter().zip(expected).for_each(|((_, offset), expected)| near(*offset, expected));
}

#[track_caller]
fn faces_front(imported: &Imported) {
    assert!(normals(imported).iter().all(|n| n.z > 0.0), "{:?}", normals(imported));
}

/// Points that do not stand in the plane of the plate.
fn out_of_plane(imported: &Imported) -> Vec<(usize, f32)> {
    let points = imported.head.mesh.points.iter().map(|p| (p.z * 1e4).round() / 1e4);
    points.enumerate().filter(|(_, z)| *z != 0.0).collect()
}

#[track_caller]
fn plays(imported: &Imported, shape: &str, values: [f32; 3]) {
    for (t, expected) in [0.0, 0.5, 1.0].into_iter().zip(values) {
        near(weight(imported, shape, t).unwrap(), expected);
    }
}

enum Check {
    Read(fn(&Imported)),
    /// A phrase of the error.
    Refused(&'static str),
}

struct Case {
    /// First column of the table.
    what: &'static str,
    /// Last column.
    becomes: &'static str,
    bytes: Vec<u8>,
    /// Part of each note, in order.
    said: &'static [&'static str],
    check: Check,
}

fn read(
    what: &'static str,
    becomes: &'static str,
    scene: Scene,
    said: &'static [&'static str],
    check: fn(&Imported),
) -> Case {
    Case { what, becomes, bytes: scene.bytes(), said, check: Check::Read(check) }
}

fn refused(what: &'static str, becomes: &'static str, bytes: Vec<u8>, error: &'static str) -> Case {
    Case { what, becomes, bytes, said: &[], check: Check::Refused(error) }
}

const FOLDED: &str = "envelopes are in the weights of the sequence; shapes have their full offsets: bs";

fn weights_and_switches() -> Vec<Case> {
    let plain = Scene::new;
    vec![
        read("a target without any of this", "a shape", plain(), &[], |i| {
            lifts(i, [0.01; 3]);
            assert!(i.sequence.is_none());
            faces_front(i);
        }),
        read(
            "painted weights of a target (`tw`)",
            "its offsets are scaled by point",
            plain().shape("setAttr -s 9 \".it[0].itg[0].tw[0:8]\"  1 0.5 0 1 0.5 0 1 0.5 0;"),
            &[],
            |i| lifts(i, [0.01, 0.005, 0.0]),
        ),
        read(
            "painted weights of a deformer (`bw`)",
            "the offsets of all its targets are scaled by point",
            plain().shape("setAttr \".inputTarget[0].baseWeights[7:8]\" 0.5 0;"),
            &[],
            |i| lifts(i, [0.01, 0.005, 0.0]),
        ),
        read(
            "both at once, in blocks",
            "the products",
            plain()
                .shape("setAttr \".it[0].bw[6]\" 0.5;")
                .shape("setAttr \".it[0].itg[0].tw[6:7]\" 0.5 2;")
                .shape("setAttr \".it[0].itg[0].tw[8]\" -1;"),
            &[],
            |i| lifts(i, [0.0025, 0.02, -0.01]),
        ),
        read(
            "an envelope",
            "the weights of the sequence times the envelope",
            plain().shape("setAttr \".en\" 0.5;").shape("setAttr \".w[0]\" 0.8;"),
            &[FOLDED],
            |i| {
                near(weight(i, "smile", 0.0).unwrap(), 0.4);
                lifts(i, [0.01; 3]);
            },
        ),
        read(
            "an envelope of 0",
            "weights of 0",
            plain().shape("setAttr \".envelope\" 0;").shape("setAttr \".w[0]\" 1;"),
            &[FOLDED],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.0),
        ),
        read(
            "a keyed envelope",
            "a track of the weight",
            plain()
                .shape("setAttr \".w[0]\" 0.5;")
                .more(RISE)
                .more("connectAttr \"rise.o\" \"bs.en\";\n"),
            &["shapes have their full offsets: bs (keyed)"],
            |i| plays(i, "smile", [0.0, 0.25, 0.5]),
        ),
        read(
            "a keyed envelope of a keyed weight",
            "the product, sampled at every frame",
            plain().more(RISE).more("connectAttr \"rise.o\" \"bs.en\";\nconnectAttr \"rise.o\" \"bs.w[0]\";\n"),
            &["shapes have their full offsets: bs (keyed)", "sampled at every frame"],
            |i| plays(i, "smile", [0.0, 0.25, 1.0]),
        ),
        read(
            "an envelope that something else drives",
            "the stored envelope",
            plain()
                .shape("setAttr \".en\" 0.5;")
                .shape("setAttr \".w[0]\" 1;")
                .more("createNode expression -n \"ex\";\nconnectAttr \"ex.out[0]\" \"bs.en\";\n"),
            &["driven envelopes are not followed, the stored ones count (bake them to keys in Maya): bs by ex (expression)", FOLDED],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.5),
        ),
        read(
            "node state HasNoEffect",
            "weights of 0",
            plain().shape("setAttr \".nds\" 1;").more(RISE).more("connectAttr \"rise.o\" \"bs.w[0]\";\n"),
            &["node states that switch a node off: bs (blendShape)"],
            |i| plays(i, "smile", [0.0; 3]),
        ),
        read(
            "node state Blocking",
            "weights of 0",
            plain().shape("setAttr -k on \".nodeState\" 2;").shape("setAttr \".w[0]\" 1;"),
            &["nodes that block are taken as switched off: bs (blendShape)"],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.0),
        ),
        read(
            "a target that the shape editor hides",
            "a weight of 0",
            plain().shape("setAttr \".tgvs[0]\" no;").shape("setAttr \".w[0]\" 1;"),
            &["targets that the shape editor hides have no weight: bs.smile"],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.0),
        ),
        read(
            "weights of target groups",
            "the weights of their targets times those of the groups",
            plain()
                .shape("setAttr \".pndr[0]\" 2;")
                .shape("setAttr \".tgdt[2].pnid\" 1;")
                .shape("setAttr \".tgdt[2].dwgh\" 0.5;")
                .shape("setAttr \".tgdt[1].dwgh\" 0.5;")
                .shape("setAttr \".w[0]\" 1;"),
            &["weights of target groups are in those of their targets (2)"],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.25),
        ),
        read(
            "an in-between that the shape editor hides",
            "left out",
            plain()
                .shape("setAttr \".it[0].itg[0].iti[5500].ipt\" -type \"pointArray\" 1 1 0 0 1;")
                .shape("setAttr \".it[0].itg[0].iti[5500].ict\" -type \"componentList\" 1 \"vtx[6]\";")
                .shape("setAttr \".ibig[0].ibi[5500].ibvs\" no;"),
            &["in-betweens that the shape editor hides were left out: bs.smile at 0.5"],
            |i| assert!(i.inbetweens.is_empty() && names(i) == ["smile"]),
        ),
        read(
            "a weight that comes through a control",
            "the curve behind it",
            plain().more(RISE).more(
                "createNode transform -n \"ctl\";\nconnectAttr \"rise.o\" \"ctl.smile\";\nconnectAttr \"ctl.smile\" \"bs.smile\";\n",
            ),
            &[],
            |i| plays(i, "smile", [0.0, 0.5, 1.0]),
        ),
        read(
            "weights that something else drives",
            "the stored weights",
            plain()
                .shape("setAttr \".w[0]\" 0.25;")
                .more("createNode multiplyDivide -n \"md\";\nconnectAttr \"md.ox\" \"bs.w[0]\";\n"),
            &["weights that multiplyDivide nodes drive are not followed; bake them to keys in Maya: smile by md"],
            |i| near(weight(i, "smile", 0.0).unwrap(), 0.25),
        ),
        read(
            "weights outside of 0..1",
            "stay in the sequence as keyed",
            plain().more(
                "createNode animCurveTU -n \"k\";\n\tsetAttr \".tan\" 2;\n\tsetAttr -s 3 \".ktv[0:2]\" 0 0 24 2 48 -0.5;\nconnectAttr \"k.o\" \"bs.w[0]\";\n",
            ),
            &["weights outside of 0..1 stay in the sequence as keyed; a rig may cut them: smile (-0.5 to 2)"],
            |i| {
                plays(i, "smile", [0.0, 1.0, 2.0]);
                near(weight(i, "smile", 2.0).unwrap(), -0.5);
            },
        ),
    ]
}

fn geometry() -> Vec<Case> {
    let plain = Scene::new;
    let triangle = "	setAttr -s 3 \".vt[0:2]\" 0 0 0 1 0 0 0 1 0;
	setAttr -s 3 \".ed[0:2]\" 0 1 0 1 2 0 2 0 0;
	setAttr \".fc[0]\" -type \"polyFaces\" f 3 0 1 2;
";
    vec![
        read(
            "a tweak node (`vlist`)",
            "its points are moved",
            plain().tweak("\tsetAttr \".vl[0].vt[0]\" -type \"float3\" 0 0 3;\n\tsetAttr \".vl[0].vt[8].vz\" 2;"),
            &[],
            |i| {
                assert_eq!(out_of_plane(i), [(0, 0.03), (8, 0.02)]);
                lifts(i, [0.01; 3]);
            },
        ),
        read(
            "control points of a tweak node (`plist`)",
            "its points are moved",
            plain().tweak("\tsetAttr \".pl[0].cp[1].pz\" 3;\n\tsetAttr \".plist[0].controlPoints[2:3].zValue\" 1 2;"),
            &[],
            |i| assert_eq!(out_of_plane(i), [(1, 0.03), (2, 0.01), (3, 0.02)]),
        ),
        read(
            "a tweak node that is switched off",
            "its points stay",
            plain().tweak("\tsetAttr \".nds\" 1;\n\tsetAttr \".vl[0].vt[0]\" -type \"float3\" 0 0 3;"),
            &["node states that switch a node off: tw (tweak)"],
            |i| assert!(out_of_plane(i).is_empty()),
        ),
        read(
            "an envelope of a tweak node",
            "its moves are scaled",
            plain().tweak("\tsetAttr \".en\" 0.5;\n\tsetAttr \".vl[0].vt[0]\" -type \"float3\" 0 0 3;"),
            &["the envelope of a tweak scales its moves: tw (0.5)"],
            |i| assert_eq!(out_of_plane(i), [(0, 0.015)]),
        ),
        read(
            "keyed tweaks",
            "stored values",
            plain()
                .tweak("\tsetAttr \".vl[0].vt[0]\" -type \"float3\" 0 0 3;")
                .more(RISE)
                .more("connectAttr \"rise.o\" \"tw.vl[0].vt[0].vx\";\n"),
            &["driven tweaks are not followed, their stored values count: tw by rise (animCurveTU)"],
            |i| assert_eq!(out_of_plane(i), [(0, 0.03)]),
        ),
        read(
            "tweaks of the deformed mesh (`pt`)",
            "its points are moved",
            plain().mesh("setAttr \".pt[4]\" -type \"float3\" 0 0 3;").mesh("setAttr \".pt[5].pz\" 1;"),
            &[],
            |i| assert_eq!(out_of_plane(i), [(4, 0.03), (5, 0.01)]),
        ),
        read(
            "a negative scale",
            "triangles are turned, so that normals stay outside",
            plain().transform("setAttr \".s\" -type \"double3\" -1 1 1;"),
            &[],
            |i| {
                faces_front(i);
                near(i.head.mesh.points[2].x, -0.04);
            },
        ),
        read(
            "two negative axes",
            "triangles stay, which is a half turn",
            plain().transform("setAttr \".sx\" -1;").transform("setAttr \".sy\" -2;"),
            &[],
            faces_front,
        ),
        read(
            "opposite normals (a frozen negative scale)",
            "triangles are turned",
            plain().mesh("setAttr \".op\" yes;"),
            &[],
            |i| assert!(normals(i).iter().all(|n| n.z < 0.0)),
        ),
        read(
            "shear, `offsetParentMatrix`",
            "points in the world",
            plain()
                .transform("setAttr \".sh\" -type \"double3\" 0.5 0 0;")
                .transform("setAttr \".opm\" -type \"matrix\" 1 0 0 0 0 1 0 0 0 0 1 0 0 0 7 1;"),
            &[],
            |i| {
                // x + y / 2 for the last point, 7 cm in front.
                assert!((i.head.mesh.points[8] - Vec3::new(0.06, 0.04, 0.07)).length() < 1e-6);
            },
        ),
        Case {
            what: "a transform that does not inherit (`inheritsTransform`)",
            becomes: "points in the world, without what is above it",
            bytes: Scene::new()
                .text()
                .replace("createNode transform -n \"face\";", "createNode transform -n \"up\";\n\tsetAttr \".tx\" 5;\ncreateNode transform -n \"face\" -p \"up\";\n\tsetAttr \".it\" no;\n\tsetAttr \".ty\" 1;")
                .into_bytes(),
            said: &[],
            check: Check::Read(|i| assert!((i.head.mesh.points[0] - Vec3::new(0.0, 0.01, 0.0)).length() < 1e-6)),
        },
        Case {
            what: "concave polygons",
            becomes: "triangles that cover them; a quad is split along its shorter diagonal that lies inside",
            // A pentagon with a dent, and a dart whose shorter diagonal lies outside.
            bytes: b"createNode mesh -n \"m\";
	setAttr -s 9 \".vt[0:8]\" 0 0 0 4 0 0 4 4 0 2 1 0 0 4 0 10 0 0 11 1 0 10 9 0 9 1 0;
	setAttr -s 9 \".ed[0:8]\" 0 1 0 1 2 0 2 3 0 3 4 0 4 0 0 5 6 0 6 7 0 7 8 0 8 5 0;
	setAttr -s 2 \".fc[0:1]\" -type \"polyFaces\" f 5 0 1 2 3 4 f 4 5 6 7 8;
createNode mesh -n \"dart\";
	setAttr -s 4 \".vt[0:3]\" 0 0 1 4 3 1 0 6 1 1 3 1;
	setAttr -s 4 \".ed[0:3]\" 0 1 0 1 2 0 2 3 0 3 0 0;
	setAttr \".fc[0]\" -type \"polyFaces\" f 4 0 1 2 3;
"
            .to_vec(),
            said: &[],
            check: Check::Read(|i| {
                faces_front(i);
                let areas: Vec<f32> = normals(i).iter().map(|n| 0.5 * n.z).collect();
                near(areas[..3].iter().sum::<f32>(), 10.0);
                near(areas[3..5].iter().sum::<f32>(), 9.0);
                near(areas[5..].iter().sum::<f32>(), 9.0);
            }),
        },
        Case {
            what: "an instance (`parent -add`)",
            becomes: "the mesh in each of its places",
            bytes: format!(
                "createNode transform -n \"eyeLeft\";
	setAttr \".t\" -type \"double3\" 3 0 0;
createNode mesh -n \"eyeShape\" -p \"eyeLeft\";
{triangle}createNode transform -n \"eyeRight\";
	setAttr \".t\" -type \"double3\" -3 0 0;
	setAttr \".s\" -type \"double3\" -1 1 1;
parent -s -nc -r -add \"|eyeLeft|eyeShape\" \"eyeRight\" ;
"
            )
            .into_bytes(),
            said: &[],
            check: Check::Read(|i| {
                let x: Vec<f32> = i.head.mesh.points.iter().map(|p| (p.x * 100.0).round()).collect();
                assert_eq!(x, [3.0, 4.0, 3.0, -3.0, -4.0, -3.0]);
                assert_eq!(i.head.mesh.triangles.len(), 2);
                faces_front(i);
                let parts: Vec<&str> = i.head.mesh.parts.iter().map(|p| p.name.as_str()).collect();
                assert_eq!(parts, ["eyeLeft", "eyeRight"]);
            }),
        },
        Case {
            what: "an instance of a group",
            becomes: "all that is below it in each of its places",
            bytes: format!(
                "createNode transform -n \"left\";
createNode transform -n \"eye\" -p \"left\";
createNode mesh -n \"ball\" -p \"eye\";
{triangle}createNode transform -n \"right\";
	setAttr \".tx\" -5;
createNode transform -n \"far\";
	setAttr \".tx\" 9;
parent -s -nc -r -add \"|left|eye\" \"right\";
parent -s -nc -r -add \"|right|eye\" \"far\";
"
            )
            .into_bytes(),
            said: &[],
            check: Check::Read(|i| {
                let x: Vec<f32> = i.head.mesh.points.iter().map(|p| (p.x * 100.0).round()).collect();
                assert_eq!(x, [0.0, 1.0, 0.0, -5.0, -4.0, -5.0, 9.0, 10.0, 9.0]);
            }),
        },
        read(
            "an instance of a node that is not there",
            "left out",
            plain().more("parent -add \"face\" \"nowhere\";\n"),
            &["instances that were left out, as one of both nodes is not in the scene: line 15: face below nowhere"],
            |i| lifts(i, [0.01; 3]),
        ),
        Case {
            what: "an instance with targets",
            becomes: "one shape that moves each of its places",
            bytes: Scene::new()
                .more("createNode transform -n \"other\";\n\tsetAttr \".tx\" 10;\nparent -s -nc -r -add \"|face|faceShape\" \"other\";\n")
                .bytes(),
            said: &[],
            check: Check::Read(|i| {
                assert_eq!(names(i), ["smile"]);
                assert_eq!(i.head.shapes[0].points, [6, 7, 8, 15, 16, 17]);
            }),
        },
        refused(
            "a node that stands above itself",
            "error with the line",
            b"createNode transform -n \"a\";\ncreateNode transform -n \"b\" -p \"a\";\nparent -add \"a\" \"b\";".to_vec(),
            "scene.ma:3: found a as its own ancestor",
        ),
        refused(
            "instances without measure",
            "error: at most 10000 places of a mesh",
            plate::nested_instances(16),
            "at most 10000",
        ),
        refused(
            "points that only construction history makes",
            "error with the node",
            b"createNode mesh -n \"m\";\ncreateNode polySphere -n \"s\";\nconnectAttr \"s.out\" \"m.i\";".to_vec(),
            "found geometry that the construction node s (polySphere) makes",
        ),
        refused("a binary scene", "error: save as .ma", b"FOR8....".to_vec(), "found a Maya binary scene (.mb)"),
    ]
}

fn names_and_notes() -> Vec<Case> {
    let plain = Scene::new;
    vec![
        read(
            "one name on several meshes, equal weights",
            "one shape",
            plain().more(&second_plate("")),
            &[],
            |i| {
                assert_eq!(names(i), ["smile"]);
                assert_eq!(i.head.shapes[0].points, [6, 7, 8, 15, 16, 17]);
            },
        ),
        read(
            "one name on several meshes, one weight that drives the other",
            "one shape",
            plain().more(RISE).more(&second_plate("")).more(
                "connectAttr \"rise.o\" \"bs.w[0]\";\nconnectAttr \"bs.smile\" \"bs2.w[0]\";\n",
            ),
            &[],
            |i| {
                assert_eq!(names(i), ["smile"]);
                plays(i, "smile", [0.0, 0.5, 1.0]);
            },
        ),
        read(
            "one name on several meshes, different weights",
            "a shape for each",
            plain().shape("setAttr \".w[0]\" 0.5;").more(&second_plate("\tsetAttr \".w[0]\" 1;\n")),
            &["targets of one name that move apart are shapes of their own: bs2_smile"],
            |i| {
                assert_eq!(names(i), ["smile", "bs2_smile"]);
                near(weight(i, "smile", 0.0).unwrap(), 0.5);
                near(weight(i, "bs2_smile", 0.0).unwrap(), 1.0);
            },
        ),
        read(
            "one name on several meshes, different curves",
            "a shape for each",
            plain().more(RISE).more(&second_plate("")).more("connectAttr \"rise.o\" \"bs2.w[0]\";\n"),
            &["targets of one name that move apart are shapes of their own: bs2_smile"],
            |i| {
                assert_eq!(names(i), ["smile", "bs2_smile"]);
                assert_eq!(weight(i, "smile", 0.5), None);
                plays(i, "bs2_smile", [0.0, 0.5, 1.0]);
            },
        ),
        read(
            "one name on several meshes, different envelopes",
            "a shape for each",
            plain()
                .shape("setAttr \".w[0]\" 1;")
                .more(&second_plate("\tsetAttr \".en\" 0.5;\n\tsetAttr \".w[0]\" 1;\n")),
            &["full offsets: bs2 (0.5)", "shapes of their own: bs2_smile"],
            |i| near(weight(i, "bs2_smile", 0.0).unwrap(), 0.5),
        ),
        Case {
            what: "names in the code page of the header (`Codeset: 932`, 1252, ...)",
            becomes: "decoded",
            bytes: [&b"//Codeset: 932\n"[..], &Scene::new().text().replace("smile", "@").into_bytes()]
                .concat()
                .into_iter()
                .flat_map(|b| if b == b'@' { vec![0x95, 0x5c] } else { vec![b] })
                .collect(),
            said: &[],
            check: Check::Read(|i| assert_eq!(names(i), ["表"])),
        },
        Case {
            what: "names that are not in the code page of the header",
            becomes: "read as UTF-8 or in code page 1252, so that different names stay different",
            bytes: Scene::new()
                .text()
                .replace("smile", "@")
                .into_bytes()
                .into_iter()
                .map(|b| if b == b'@' { 0xe4 } else { b })
                .collect(),
            said: &["the header names no codeset, and its names are no UTF-8: they are read in code page 1252"],
            check: Check::Read(|i| assert_eq!(names(i), ["ä"])),
        },
        read(
            "other deformers (skinCluster, ...)",
            "left out, their targets and points stay",
            plain().more(
                "createNode skinCluster -n \"skin\";\nconnectAttr \"bs.og[0]\" \"skin.ip[0].ig\";\nconnectAttr \"skin.og[0]\" \"faceShape.i\";\n",
            )
            .last("connectAttr \"skin.og[0]\" \"faceShape.i\";\n"),
            &["skinCluster nodes are not evaluated: skin of |face|faceShape (line "],
            |i| lifts(i, [0.01; 3]),
        ),
        read(
            "transforms that constraints or expressions drive",
            "stored values",
            plain().transform("setAttr \".tx\" 1;").more(
                "createNode parentConstraint -n \"pc\";\nconnectAttr \"pc.ctx\" \"face.tx\";\nconnectAttr \"pc.cty\" \"face.ty\";\n",
            ),
            &["transforms that parentConstraint nodes drive stand where they are stored; bake them to keys in Maya (2): face.tx by pc, face.ty by pc"],
            |i| near(i.head.mesh.points[0].x, 0.01),
        ),
        read(
            "meshes that a display layer, an override or a level of detail hides",
            "left out, as hidden ones are",
            plain()
                .more(&second_plate(""))
                .more("createNode displayLayer -n \"layer\";\n\tsetAttr \".v\" no;\nconnectAttr \"layer.di\" \"brow.do\";\n")
                .more("createNode transform -n \"a\";\n\tsetAttr \".ove\" yes;\n\tsetAttr \".ovv\" no;\nparent -add \"browShape\" \"a\";\n")
                .more("createNode transform -n \"b\";\n\tsetAttr \".lodv\" no;\nparent -add \"browShape\" \"b\";\n"),
            &[],
            |i| assert_eq!(i.head.mesh.points.len(), 9),
        ),
        read(
            "keyed visibility",
            "the stored one",
            plain().more(RISE).more("connectAttr \"rise.o\" \"face.v\";\n"),
            &["driven visibility is not followed, the stored one counts: face by rise (animCurveTU)"],
            |i| lifts(i, [0.01; 3]),
        ),
        read(
            "references, plugins",
            "named, not read",
            plain()
                .header("file -r -ns \"body\" \"C:/body.ma\";\n")
                .header("requires \"faceware\" \"1\";\nrequires \"facefx\" \"2\";\n"),
            &["references that are not followed", "(2): faceware 1, facefx 2"],
            |i| lifts(i, [0.01; 3]),
        ),
        read(
            "statements that change what was said before (`disconnectAttr`, `parent` without `-add`)",
            "named, not followed",
            plain().more("createNode transform -n \"t\";\nparent \"face\" \"t\";\ndisconnectAttr \"a.b\" \"c.d\";\n"),
            &["statements that are not followed (save the scene again in Maya) (2)"],
            |i| lifts(i, [0.01; 3]),
        ),
    ]
}

fn cases() -> Vec<Case> {
    [weights_and_switches(), geometry(), names_and_notes()].into_iter().flatten().collect()
}

fn outcome(result: &Result<Imported, ReadError>) -> &'static str {
    match result {
        Ok(imported) if imported.notes.is_empty() => "read",
        Ok(_) => "read, said",
        Err(_) => "refused",
    }
}

#[test]
fn every_row_of_the_table_is_true() {
    let mut table = String::from("| of the scene | outcome | becomes |\n| --- | --- | --- |\n");
    for case in cases() {
        let Case { what, becomes, bytes, said, check } = case;
        let result = read::from_bytes(&bytes, Path::new("scene.ma"), &read::Options::default());
        table += &format!("| {what} | {} | {becomes} |\n", outcome(&result));
        match (result, check) {
            (Ok(imported), Check::Read(check)) => {
                imported.head.validate().unwrap();
                let notes = &imported.notes;
                assert_eq!(notes.len(), said.len(), "{what}: {notes:?}");
                for (note, said) in notes.iter().zip(said) {
                    assert!(note.contains(said), "{what}: {note:?} lacks {said:?}");
                }
                println!("{what}");
                check(&imported);
            }
            (Err(error), Check::Refused(expected)) => {
                let message = error.to_string();
                assert!(message.contains(expected), "{what}: {message:?} lacks {expected:?}");
            }
            (Ok(imported), Check::Refused(_)) => panic!("{what}: was read, {:?}", imported.notes),
            (Err(error), Check::Read(_)) => panic!("{what}: {error}"),
        }
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/maya.md");
    let docs = std::fs::read_to_string(&file).unwrap();
    let (start, end) = ("<!-- table of tests/authored.rs -->\n", "<!-- end -->");
    let from = docs.find(start).unwrap() + start.len();
    let to = from + docs[from..].find(end).unwrap();
    if std::env::var_os("RUBOR_BLESS").is_some() {
        std::fs::write(&file, format!("{}{table}{}", &docs[..from], &docs[to..])).unwrap();
    } else {
        assert_eq!(&docs[from..to], table, "RUBOR_BLESS=1 writes the table of docs/maya.md anew");
    }
}

#[test]
fn many_of_one_kind_cost_no_square() {
    let mut text = Scene::new().text();
    for i in 0..100_000 {
        text += &format!("requires \"plugin{i}\" \"1\";\n");
    }
    let started = std::time::Instant::now();
    let imported = read::from_bytes(text.as_bytes(), Path::new("m.ma"), &read::Options::default()).unwrap();
    assert_eq!(imported.notes.len(), 1);
    assert!(imported.notes[0].contains("(100000)") && imported.notes[0].ends_with("and 99995 more"));
    let mut targets = String::new();
    for i in 1..50_000 {
        targets += &format!(
            "\tsetAttr \".it[0].itg[{i}].iti[6000].ipt\" -type \"pointArray\" 1 0 1 0 1;\n\tsetAttr \".it[0].itg[{i}].iti[6000].ict\" -type \"componentList\" 1 \"vtx[0]\";\n"
        );
    }
    let text = Scene::new().shape(&targets).text();
    let imported = read::from_bytes(text.as_bytes(), Path::new("m.ma"), &read::Options::default()).unwrap();
    assert_eq!(imported.head.shapes.len(), 50_000);
    // Seconds where each looks at all others; a busy machine gets its time.
    assert!(started.elapsed().as_secs_f64() < 20.0, "{:?}", started.elapsed());
}

/// Takes out the line at a place, or doubles it.
fn lines(bytes: &mut Vec<u8>, at: usize, out: bool) {
    let start = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i + 1);
    let line = bytes[start..end].to_vec();
    let replaced = if out { start..end } else { start..start };
    bytes.splice(replaced, if out { Vec::new() } else { line }).for_each(drop);
}

/// Puts another digit in the place of the next one.
fn digit(bytes: &mut [u8], at: usize, digit: u8) {
    if let Some(found) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
        *found = b'0' + digit;
    }
}

/// `RUBOR_MUTATIONS` sets the number of files.
#[test]
fn mutated_scenes_end_in_a_head_or_an_error_in_bounded_time() {
    let rounds = std::env::var("RUBOR_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(400);
    let hostile = [
        "50000000",
        "-1",
        "1e300",
        "nan",
        "1e-320",
        ";",
        "\"",
        "yes",
        "[0:49999999]",
        "[49999999]",
        "\"vtx[0:49999999]\"",
        "parent -add \"face\" \"brow\";",
        "connectAttr \"bs.og[0]\" \"bs.ip[0].ig\";",
        "2147483648",
    ];
    let seeds: Vec<Vec<u8>> = cases().into_iter().map(|c| c.bytes).filter(|b| b.len() < 100_000).collect();
    let mut random = SplitMix64(14);
    let mut next = |end: usize| random.below(end);
    let (mut read, mut refused, mut slowest) = (0, 0, 0.0_f64);
    for round in 0..rounds {
        let mut bytes = seeds[round % seeds.len()].clone();
        for _ in 0..1 + next(3) {
            let at = next(bytes.len());
            let to = (at + next(200)).min(bytes.len());
            match next(12) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes.truncate(at.max(1)),
                2 | 3 => {
                    let token = hostile[next(hostile.len())].bytes();
                    bytes.splice(at..(at + next(9)).min(bytes.len()), token).for_each(drop);
                }
                4 => bytes.drain(at..to).for_each(drop),
                5 => {
                    let copy = bytes[at..to].to_vec();
                    bytes.splice(at..at, copy).for_each(drop);
                }
                // What keeps the form: another digit, a line less, a line twice.
                6 | 7 => lines(&mut bytes, at, next(2) == 0),
                _ => digit(&mut bytes, at, next(10) as u8),
            }
            if bytes.is_empty() {
                bytes.push(b' ');
            }
        }
        let started = std::time::Instant::now();
        match read::from_bytes(&bytes, Path::new("mutated.ma"), &read::Options::default()) {
            Ok(imported) => {
                imported.head.validate().unwrap();
                if let Some(sequence) = imported.sequence {
                    sequence.check().unwrap();
                }
                read += 1;
            }
            Err(_) => refused += 1,
        }
        slowest = slowest.max(started.elapsed().as_secs_f64());
        // A shared machine gets its time; most files take a millisecond.
        assert!(slowest < 10.0, "round {round}: {slowest} s");
    }
    eprintln!("{rounds} mutated scenes: {read} read, {refused} refused, the slowest in {slowest:.3} s");
    assert!(read > rounds / 20 && refused > rounds / 20, "{read} read, {refused} refused");
}

/// Right values of the cases in the shared folder, which are not ours to keep here.
#[test]
fn cases_of_the_shared_folder() {
    let Some(shared) = std::env::var_os("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, the cases of Maya were not read");
        return;
    };
    let folder = Path::new(&shared).join("cases/maya");
    let case = |name: &str| read::read(&folder.join(name), &read::Options::default()).unwrap();
    lifts(&case("plain.ma"), [0.01; 3]);
    for name in ["painted-weights.ma", "base-weights.ma"] {
        lifts(&case(name), [0.01, 0.005, 0.0]);
    }
    for (name, value) in [("envelope-0.ma", 0.0), ("envelope-half.ma", 0.5), ("node-state.ma", 0.0)] {
        near(weight(&case(name), "smile", 0.0).unwrap(), value);
    }
    plays(&case("envelope-keyed.ma"), "smile", [0.0, 0.5, 1.0]);
    assert_eq!(out_of_plane(&case("tweak-node.ma")), [(0, 0.03), (8, 0.03)]);
    near(case("tweak-node-cp.ma").head.mesh.points[0].x, 0.03);
    faces_front(&case("mirrored.ma"));
    let x: Vec<f32> = case("instance.ma").head.mesh.points.iter().map(|p| (100.0 * p.x).round()).collect();
    assert_eq!(x, [3.0, 4.0, 3.0, -3.0, -2.0, -3.0]);
    for name in ["two-meshes-static.ma", "two-meshes-keyed.ma"] {
        assert_eq!(names(&case(name)), ["smile", "bs1_smile"]);
    }
    for (name, expected) in [
        ("codeset-1252.ma", ["Zähne", "Zühne"]),
        ("codeset-932.ma", ["左目", "上目"]),
        ("codeset-utf8.ma", ["左目", "上目"]),
    ] {
        let imported = case(name);
        let parts: Vec<&str> = imported.head.mesh.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(parts, expected, "{name}: {:?}", imported.notes);
        assert_eq!((imported.head.mesh.points.len(), imported.notes.len()), (18, 0), "{name}");
    }
    let keyed = case("keyed-out-of-range.ma");
    plays(&keyed, "smile", [0.0, 1.0, 2.0]);
    near(weight(&keyed, "smile", 2.0).unwrap(), -0.5);
    let areas = normals(&case("concave.ma"));
    assert!(areas.iter().all(|n| n.z > 0.0));
    near(areas.iter().map(|n| 0.5 * n.z).sum(), 10.0);
}
