//! Expression tables of avatars.

use std::path::Path;

use glam::Vec3;
use rubor_assets::import::gltf::{ImportedHead, from_bytes};
use rubor_rig::expression::Rig;
use serde_json::{Value, json};

use super::says;
use super::support::{Face, face_document};

fn read(vrm: impl FnOnce(&mut Value)) -> ImportedHead {
    let document = face_document(|d, _, _| vrm(d));
    from_bytes(document.to_string().as_bytes(), Path::new("avatar.vrm")).unwrap()
}

fn rig(imported: &ImportedHead) -> Rig {
    let rig = imported.rig.as_ref().expect("a rig");
    Rig::from_json("rig", &rig.to_string()).expect("a valid rig")
}

#[test]
fn expressions_of_version_1_are_in_the_rig() {
    let imported = read(|d| {
        d["extensions"] = json!({ "VRMC_vrm": { "specVersion": "1.0", "expressions": {
            "preset": {
                "happy": { "morphTargetBinds": [
                    { "node": 0, "index": 1, "weight": 0.75 }, { "node": 0, "index": 0, "weight": 0.25 },
                    { "node": 3, "index": 0, "weight": 1.0 }, { "node": 0, "index": 9, "weight": 1.0 },
                ], "isBinary": true, "overrideBlink": "block" },
                "aa": { "morphTargetBinds": [{ "node": 0, "index": 0 }] },
                "relaxed": { "materialColorBinds": [{ "material": 0, "type": "color", "targetValue": [1, 0, 0, 1] }] },
            },
            "custom": { "wink": { "morphTargetBinds": [{ "node": 0, "index": 1, "weight": 3.0 }] } },
        }}});
    });
    let rig = rig(&imported);
    let happy = &rig.expressions["happy"];
    assert_eq!(happy.shapes.len(), 2);
    assert_eq!((happy.shapes["mouthSmileLeft"], happy.shapes["jawOpen"]), (0.75, 0.25));
    // The mood has the blood and wrinkles of joy, and joy the shapes of the avatar.
    let joy = &rig.expressions["joy"];
    assert_eq!(joy, happy);
    assert!(!joy.hemoglobin.is_empty() && !joy.wrinkles.is_empty());
    assert_eq!(rig.expressions["aa"].shapes["jawOpen"], 1.0);
    assert_eq!(rig.expressions["wink"].shapes["mouthSmileLeft"], 1.0, "clamped");
    assert!(!rig.expressions.contains_key("relaxed"), "it moves nothing");
    assert!(rig.expressions.contains_key("fear"), "the others stay");
    says(&imported, "do not exist", "\"happy\", bind 2 (node 3, target 0)");
    says(&imported, "do not exist", "\"happy\", bind 3 (node 0, target 9)");
    says(&imported, "on or off", "happy");
    says(&imported, "hold back", "happy");
    says(&imported, "stay as they are", "relaxed");
    says(&imported, "clamped", "\"wink\", bind 0 (3)");
    assert_eq!(imported.head.mesh.points[0], Vec3::from(Face::new().positions[0]), "it looks along +z");
}

#[test]
fn expressions_of_version_0_are_in_the_rig_and_the_avatar_turns_around() {
    let imported = read(|d| {
        d["materials"] = json!([{ "name": "Face" }]);
        d["extensions"] = json!({ "VRM": {
            "blendShapeMaster": { "blendShapeGroups": [
                { "name": "Joy", "presetName": "joy", "binds": [{ "mesh": 0, "index": 1, "weight": 80 }] },
                { "name": "A", "presetName": "a", "binds": [{ "mesh": 0, "index": 0, "weight": 100 }] },
                { "name": "Shock", "presetName": "unknown", "binds": [{ "mesh": 0, "index": 0, "weight": 50 }],
                    "materialValues": [{ "materialName": "Face", "propertyName": "_Color", "targetValue": [1, 0, 0, 1] }] },
                { "name": "Shock", "presetName": "unknown", "binds": [{ "mesh": 0, "index": 1, "weight": 50 }] },
                { "name": "Broken", "presetName": "blink", "binds": [{ "mesh": 9, "index": 0, "weight": 100 }, {}] },
            ]},
            "materialProperties": [{ "name": "Face", "shader": "VRM/MToon" }],
        }});
    });
    let rig = rig(&imported);
    assert!((rig.expressions["happy"].shapes["mouthSmileLeft"] - 0.8).abs() < 1e-6);
    assert_eq!(rig.expressions["aa"].shapes["jawOpen"], 1.0);
    assert_eq!(rig.expressions["Shock"].shapes["jawOpen"], 0.5);
    assert!(!rig.expressions.contains_key("blink"));
    says(&imported, "do not exist", "\"blink\", bind 0 (mesh 9, target 0)");
    says(&imported, "one name", "Shock");
    says(&imported, "stay as they are", "Shock");
    says(&imported, "MToon", "Face");
    says(&imported, "turned around", "");
    let front = |p: &&Vec3| p.z;
    let (first, low) = (Face::new().positions[20], &imported.head);
    let turned = Vec3::new(-first[0], first[1], -first[2]);
    assert!(low.mesh.points.iter().any(|p| p.distance(turned) < 1e-6));
    assert!(low.mesh.points.iter().map(|p| front(&p)).fold(f32::MIN, f32::max) > 0.09);
    // Offsets turn with it: outwards along +x is along -x now.
    let smile = low.shapes.iter().find(|s| s.name == "mouthSmileLeft").expect("the shape");
    assert!(smile.offsets.iter().all(|o| o.x < 0.0 && o.y > 0.0));
}

#[test]
fn an_avatar_without_expressions_has_no_rig_and_says_so() {
    let imported = read(|d| d["extensions"] = json!({ "VRMC_vrm": { "specVersion": "1.0" } }));
    assert!(imported.rig.is_none());
    says(&imported, "no expressions", "");
}

#[test]
fn joints_say_what_belongs_to_the_head() {
    let document = face_document(|d, pieces, _| {
        let count = Face::new().positions.len();
        let joints: Vec<u8> = (0..count).flat_map(|v| [u8::from(v % 2 == 0), 0, 0, 0]).collect();
        let view = pieces.view(&joints, None);
        let joints = pieces
            .accessor(json!({ "bufferView": view, "componentType": 5121, "count": count, "type": "VEC4" }));
        let weights = pieces.floats(&[1.0, 0.0, 0.0, 0.0].repeat(count), "VEC4");
        let attributes = &mut d["meshes"][0]["primitives"][0]["attributes"];
        attributes["JOINTS_0"] = json!(joints);
        attributes["WEIGHTS_0"] = json!(weights);
        d["nodes"] = json!([
            { "mesh": 0, "skin": 0, "name": "Body" },
            { "name": "Spine", "children": [2] },
            { "name": "mixamorig:Head", "children": [3] },
            { "name": "HatEnd" },
        ]);
        d["scenes"][0]["nodes"] = json!([0, 1]);
        d["skins"] = json!([{ "joints": [1, 3] }]);
    });
    let imported = from_bytes(document.to_string().as_bytes(), Path::new("a.gltf")).unwrap();
    let share = &imported.extent.head_share;
    assert_eq!(share.len(), imported.head.mesh.vertices.len());
    assert!(share.iter().enumerate().all(|(v, s)| *s == f32::from(u8::from(v % 2 == 0))));
    assert_eq!(imported.extent.meshes, ["Body|Head"]);
}
