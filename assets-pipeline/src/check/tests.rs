//! Every reason by a head that has only this fault.

use glam::{Vec2, Vec3};
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::{BlendShape, Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::map::Map;
use rubor_rig::timeline::Sequence;

use super::visibility::{self, Scene};
use super::{Finding, Severity, capture, head, performance, usd};
use crate::export::usd::{Options, to_layer};
use crate::import::capture::{Retarget, live_link};

/// A square of skin, 0.25 m high, whose zone and distribution show.
fn good() -> Head {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mesh = Mesh {
        points: corners.map(|[x, y]| 0.25 * Vec3::new(x, y, 0.0)).to_vec(),
        occlusion: vec![1.0; 4],
        vertices: (0..4)
            .map(|i| Vertex { point: i, uv: Vec2::from_array(corners[i as usize]) * 0.4 })
            .collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..2 }],
    };
    let shape = BlendShape {
        name: "jawOpen".into(),
        points: vec![0],
        offsets: vec![Vec3::Y * 0.01],
        ..BlendShape::default()
    };
    let flat = |v: &[f32]| Map::filled(8, 8, v);
    let maps = SkinMaps {
        melanin: Some(flat(&[0.05])),
        hemoglobin: Some(flat(&[0.05])),
        hemoglobin_mean: Some(flat(&[0.05])),
        distributions: vec![Distribution { name: "joy".into(), scale: flat(&[1.0]), bias: flat(&[0.1]) }],
        wrinkle_slopes: vec![flat(&[0.5, 0.5])],
        zones: vec![WrinkleZone { name: "chin".into(), wrinkle_map: 0, mask: flat(&[1.0]) }],
        ..SkinMaps::default()
    };
    Head { name: "good".into(), mesh, shapes: vec![shape], maps, ..Head::default() }
}

const RIG: &str = r#"{"expressions": {
    "joy": {"shapes": {"jawOpen": 1}, "wrinkles": {"chin": 1}, "hemoglobin": {"joy": 1}},
    "calm": {"shapes": {"jawOpen": 0.1}, "wrinkles": {"chin": -1}}
}}"#;

fn visible(head: &Head, rig: &str, sequence: Option<&str>) -> Vec<String> {
    visible_for(1, head, rig, sequence)
}

fn visible_for(seconds: u32, head: &Head, rig: &str, sequence: Option<&str>) -> Vec<String> {
    let rig = Rig::from_json("rig.json", rig).unwrap();
    let sequence = sequence.map(|s| {
        let text = format!(r#"{{"fps": 4, "duration": {seconds}, "expressions": {s}}}"#);
        Sequence::from_json("s.json", &text).unwrap()
    });
    let evaluator = sequence.map(|s| Evaluator::new(head, &rig, &s).unwrap().0);
    let scene = Scene { head, rig: &rig, evaluator: evaluator.as_ref() };
    visibility::check(&scene).iter().map(ToString::to_string).collect()
}

fn says(findings: &[String], words: &[&str]) {
    assert!(
        words.iter().all(|w| findings.iter().any(|f| f.contains(w))),
        "{findings:?} lacks one of {words:?}"
    );
}

#[test]
fn a_good_head_has_nothing_to_hide() {
    assert_eq!(visible(&good(), RIG, None), [""; 0]);
    assert_eq!(visible(&good(), RIG, Some(r#"{"joy": 1}"#)), [""; 0]);
    // An hour and a half.
    says(&visible_for(5400, &good(), RIG, Some(r#"{"joy": 1}"#)), &["sequence: of 2160", "was looked at"]);
    assert!(head::check(&good()).iter().all(|f| f.severity == Severity::Note));
}

#[test]
fn why_a_wrinkle_zone_does_not_show() {
    let with = |change: &dyn Fn(&mut Head)| {
        let mut head = good();
        change(&mut head);
        visible(&head, RIG, None)
    };
    says(&with(&|h| h.maps.wrinkle_slopes.clear()), &["zone \"chin\"", "wrinkle map 0 is missing"]);
    says(&with(&|h| h.maps.wrinkle_slopes[0] = Map::filled(8, 8, &[0.0; 2])), &["strength 0"]);
    says(&with(&|h| h.maps.zones[0].mask = Map::filled(8, 8, &[0.0])), &["mask is black"]);
    // The skin uses the upper left part of the texture only.
    let corner = |h: &mut Head| {
        h.maps.zones[0].mask.values.fill(0.0);
        h.maps.zones[0].mask.values[63] = 1.0;
    };
    says(&with(&corner), &["texels that no skin uses"]);
    says(&with(&|h| h.maps.melanin = None), &["no melanin map"]);
    says(&with(&|h| h.mesh.parts[0].material = Material::Other), &["no part is skin"]);
    says(&visible(&good(), &RIG.replace("\"chin\": 1", "\"chinn\": 1"), None), &["0 or negative"]);
    says(&visible(&good(), &RIG.replace("\"chin\"", "\"chinn\""), None), &["nothing in the rig names it"]);
    says(
        &visible(&good(), RIG, Some(r#"{"calm": 1}"#)),
        &["wrinkle zones: the sequence never reaches 1", "chin (joy)"],
    );
    says(&visible(&good(), RIG, Some(r#"{"joy": 1, "calm": 1}"#)), &["raised by joy and taken away by calm"]);
}

#[test]
fn why_a_distribution_does_not_show() {
    let mut head = good();
    head.maps.distributions[0].bias = Map::filled(8, 8, &[0.05]);
    says(&visible(&head, RIG, None), &["distribution \"joy\": it is the neutral one"]);
    let renamed = RIG.replace("\"hemoglobin\": {\"joy\": 1}", "\"hemoglobin\": {\"jooy\": 1}");
    says(&visible(&good(), &renamed, None), &["distribution \"joy\": nothing in the rig names it"]);
    says(
        &visible(&good(), RIG, Some(r#"{"calm": 1}"#)),
        &["distributions: the sequence never reaches 1", "joy (joy)"],
    );
}

fn texts(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(|f| format!("{f} [{}]", f.fix.clone().unwrap_or_default())).collect()
}

#[test]
fn heads_of_wrong_size_shape_and_name() {
    let mut wrong = good();
    wrong.mesh.points.iter_mut().for_each(|p| *p *= 100.0);
    says(&texts(&head::check(&wrong)), &["25.000 m high", "centimetres"]);
    let shape = |name: &str, length: f32| BlendShape {
        name: name.into(),
        points: vec![1],
        offsets: vec![Vec3::X * length],
        ..BlendShape::default()
    };
    let mut wrong = good();
    wrong.shapes.extend([
        BlendShape { name: "tongueOut".into(), ..BlendShape::default() },
        shape("jawopen", 0.01),
        shape("mouthSmilLeft", 0.01),
        shape("jawLeft", 1e-7),
        shape("jawRight", 3.0),
    ]);
    says(
        &texts(&head::check(&wrong)),
        &[
            "shape \"tongueOut\": it moves no points",
            "shape \"jawopen\": \"jawOpen\" is the same name",
            "if it is \"mouthSmileLeft\", rename it",
            "shape \"jawLeft\": it moves points by 0.0001 mm",
            "shape \"jawRight\": it moves a point by 3.000 m",
        ],
    );
}

#[test]
fn layouts_of_the_texture() {
    let messages = |head: &Head| head::layout(head).iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(messages(&good()), [""; 0]);
    // The second triangle on the texels of the first, mirrored about the edge that they share.
    let mut mirrored = good();
    mirrored.mesh.vertices[3].uv = mirrored.mesh.vertices[1].uv;
    let found = messages(&mirrored);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("100.0 % of the texels") && found[0].contains("1 of 2 islands are mirrored"),
        "{found:?}"
    );
    let mut bare = good();
    bare.mesh.vertices[3].uv = 0.5 * (bare.mesh.vertices[0].uv + bare.mesh.vertices[2].uv);
    let found = messages(&bare);
    assert!(found[0].contains("50 % of its skin have no texture coordinates"), "{found:?}");
}

#[test]
fn rigs_and_sequences_say_what_has_no_effect() {
    let head = good();
    let rig =
        Rig::from_json("rig.json", &RIG.replace("\"chin\": -1", "\"chn\": 1").replace("0.1}", "0}")).unwrap();
    says(
        &texts(&performance::check_rig(&head, &rig)),
        &["write \"chin\"", "expression \"calm\": it changes nothing"],
    );
    let rig = Rig::from_json("rig.json", RIG).unwrap();
    let text = r#"{"fps": 4, "duration": 1, "expressions": {"joy": 0},
        "shapes": {"jawOpen": [{"t": 0, "v": -0.5}, {"t": 2, "v": 1.5}]},
        "head": {"yawDegrees": [{"t": 0, "v": 0}, {"t": 9, "v": 200}], "translation": [0, 30, 0]}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let (findings, evaluator) = performance::check_sequence(&head, &rig, &sequence);
    assert!(evaluator.is_some());
    says(
        &texts(&findings),
        &[
            "2 keys leave 0 to 1",
            "\"jawOpen\" has keys after the end",
            "head.yawDegrees: there are keys after the end",
            "expression \"joy\": its weight is 0 throughout",
            "more than 90 degrees",
        ],
    );
    let unknown = Sequence::from_json("s.json", &text.replace("\"joy\"", "\"jou\"")).unwrap();
    let (findings, evaluator) = performance::check_sequence(&head, &rig, &unknown);
    assert!(evaluator.is_none());
    assert_eq!((findings[0].severity, findings[0].fix.as_deref()), (Severity::Error, Some("write \"joy\"")));
}

#[test]
fn columns_that_move_nothing() {
    let text = "Timecode,JawOpen,jawOpne,MouthClose\n0:0:0:0,0,0.5,0.25\n0:0:1:0,0.5,0.5,0.25\n0:0:2:0,1.5,0.5,0.25\n";
    let recording = live_link::from_bytes(text.as_bytes(), "take.csv".as_ref(), None).unwrap();
    let retarget = Retarget::from_json("r.json", r#"{"shapes": {"MouthClos": "mouthClose"}}"#).unwrap();
    says(
        &texts(&capture::check(&recording, &retarget, &good())),
        &[
            "column \"jawOpne\": no shape is known for this column",
            "write \"jawOpne\": \"jawOpen\"",
            "column \"MouthClos\": the retarget file names it",
            "\"good\" has no shape for mouthClose",
            "50 ARKit columns are missing",
            "these columns never change: jawOpne, MouthClose",
            "1 weights above the limit",
        ],
    );
}

#[test]
fn usd_layers_and_what_breaks_them() {
    let head = good();
    let rig = Rig::from_json("rig.json", RIG).unwrap();
    let text = r#"{"fps": 4, "duration": 1, "expressions": {"joy": [{"t": 0, "v": 0}, {"t": 0.5, "v": 1}]}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let options = Options {
        color_map_size: 0,
        normal_map_size: 0,
        rig: Some(&rig),
        sequence: Some(&sequence),
        ..Options::default()
    };
    let layer = to_layer(&head, &options, "t").unwrap().text;
    let check = |text: &str| texts(&usd::check(text.as_bytes(), "/nowhere".as_ref()));
    assert_eq!(check(&layer), [""; 0], "{layer}");
    let broken = |from: &str, to: &str, words: &str| {
        assert!(layer.contains(from), "{from} in {layer}");
        says(&check(&layer.replacen(from, to, 1)), &[words]);
    };
    broken("#usda 1.0", "#usda 2.0", "expected #usda 1.0");
    broken("metersPerUnit = 1", "", "there is no metersPerUnit");
    broken("blendShapes = [\"jawOpen\"]", "blendShapes = [\"jawOpne\"]", "write \"jawOpen\"");
    broken("[\"jawOpen\"]", "[]", "1 weights for 0 shapes");
    broken("pointIndices = [0]", "pointIndices = [9]", "1 point indices are not below the 4 points");
    broken("pointIndices = [0]", "pointIndices = [0, 1]", "offsets has 1 entries for 2 points");
    broken("/Face/jawOpen>", "/Face/jaw>", "/rubor_head/Face/jaw is not there");
    broken("/Surface.outputs", "/Surfaces.outputs", "Surfaces, which is not there");
    broken("float inputs:metallic = 0", "asset inputs:file = @../x.png@", "leaves the folder");
    broken("float inputs:metallic = 0", "asset inputs:file = @x.png@", "there is no file");
    broken("def Scope", "dif Scope", "expected a property");
    for cut in (0..layer.len()).step_by(37) {
        assert!(!check(&layer[..cut]).is_empty() || layer[cut..].trim().is_empty(), "cut at {cut}");
    }
    says(&texts(&usd::check(b"PXR-USDC\0", "".as_ref())), &["usdcat"]);
}

#[test]
fn findings_that_differ_in_their_place_are_one() {
    let shape = |i: usize| Finding::note(format!("shape {i}"), "it moves nothing");
    let mut findings: Vec<Finding> = (0..28).map(shape).collect();
    findings.push(Finding::warning("shape 0", "it moves nothing"));
    let found = super::summed(findings);
    assert_eq!(found.len(), 2);
    assert!(found[0].at.ends_with("shape 7 and 20 more"), "{}", found[0].at);
}
