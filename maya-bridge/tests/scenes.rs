//! Scenes of Maya: our own back and forth, other people's, broken ones.

use std::path::Path;

use glam::{Vec2, Vec3};
use rubor_maya::read::{self, Imported};
use rubor_maya::write::{self, Performance};
use rubor_rig::expression::{Inbetween, Rig};
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, OcclusionChange, Part, Provenance, ProvenanceKind,
    SkinMaps, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;
use rubor_rig::random::SplitMix64;
use rubor_rig::timeline::{Ease, Key, Sequence, Track};

/// -1 to 1.
fn signed(noise: &mut SplitMix64) -> f32 {
    (2.0 * noise.uniform() - 1.0) as f32
}

/// A grid of two parts whose vertices split along a seam, with awkward numbers everywhere.
fn head() -> Head {
    const N: u32 = 12;
    let mut noise = SplitMix64(1);
    let mut mesh = Mesh::default();
    for y in 0..N {
        for x in 0..N {
            let scale = 0.2 / N as f32;
            mesh.points.push(Vec3::new(
                x as f32 * scale + 1e-4 * signed(&mut noise),
                y as f32 * scale + 1e-4 * signed(&mut noise),
                0.1 * signed(&mut noise) * 10.0_f32.powi(-((x % 7) as i32)),
            ));
        }
    }
    for part in 0..2 {
        let start = mesh.triangles.len() as u32;
        let first = mesh.vertices.len() as u32;
        let rows = if part == 0 { 0..N / 2 } else { N / 2..N };
        for y in rows.clone() {
            for x in 0..N {
                let uv = Vec2::new(x as f32 / 11.0 * 0.977, noise.uniform() as f32);
                mesh.vertices.push(Vertex { point: y * N + x, uv });
            }
        }
        for y in 0..rows.len() as u32 - 1 {
            for x in 0..N - 1 {
                let v = first + y * N + x;
                mesh.triangles.push([v, v + 1, v + N]);
                mesh.triangles.push([v + 1, v + N + 1, v + N]);
            }
        }
        let (name, material) = [("M_Face", Material::Skin), ("teeth upper.001", Material::Gums)][part];
        mesh.parts.push(Part { name: name.into(), material, triangles: start..mesh.triangles.len() as u32 });
    }
    mesh.occlusion = mesh.points.iter().map(|_| noise.uniform() as f32).collect();
    let mut shape = |name: &str, step: usize| BlendShape {
        name: name.into(),
        points: (0..N * N).step_by(step).collect(),
        offsets: (0..N * N)
            .step_by(step)
            .map(|_| 0.01 * Vec3::new(signed(&mut noise), signed(&mut noise), 1e-6 * signed(&mut noise)))
            .collect(),
        ..BlendShape::default()
    };
    let mut shapes = vec![
        shape("jawOpen", 1),
        shape("eyeBlink_L", 3),
        shape("mouth smile-left", 5),
        shape("jawOpen_half", 2),
        BlendShape { name: "empty".into(), ..BlendShape::default() },
    ];
    shapes[0].occlusion = vec![
        OcclusionChange { point: 2, at_half: 0.3, at_full: -0.5 },
        OcclusionChange { point: 7, at_half: -0.1, at_full: 1.0 },
    ];
    let mut map = |side: u32, channels: u32| Map {
        width: side,
        height: side,
        channels,
        values: (0..side * side * channels).map(|_| 0.3 * (noise.uniform() as f32)).collect(),
    };
    let maps = SkinMaps {
        melanin: Some(map(8, 1)),
        hemoglobin: Some(map(8, 1)),
        hemoglobin_mean: Some(map(4, 1)),
        distributions: vec![
            Distribution { name: "joy".into(), scale: map(4, 1), bias: map(4, 1) },
            Distribution { name: "anger".into(), scale: map(4, 1), bias: map(4, 1) },
        ],
        slopes: Some(map(8, 2)),
        wrinkle_slopes: vec![map(8, 2)],
        zones: vec![WrinkleZone { name: "forehead".into(), wrinkle_map: 0, mask: map(4, 1) }],
        specular: Some(map(8, 2)),
        hair_color_linear: [0.1, 0.05, 0.02],
        ..SkinMaps::default()
    };
    Head {
        name: "Test \"head\"".into(),
        mesh,
        shapes,
        maps,
        landmarks: [("pronasale".to_owned(), Vec3::new(0.0, 0.1, 0.123_456_7))].into(),
        provenance: vec![Provenance {
            of: "geometry".into(),
            kind: ProvenanceKind::Synthesised,
            source: "noise".into(),
            licence: "CC0-1.0".into(),
        }],
        ..Head::default()
    }
}

fn keys(list: &[(f64, f32, Ease)]) -> Track<f32> {
    Track::Keys(list.iter().map(|(t, v, ease)| Key { t: *t, v: *v, ease: *ease }).collect())
}

fn sequence() -> Sequence {
    let mut sequence = Sequence::still(24.0, 3.0);
    let third = 1.0 / 3.0;
    sequence.shapes = [
        (
            "jawOpen".to_owned(),
            keys(&[
                (0.0, 0.1, Ease::Linear),
                (third, 0.7, Ease::Step),
                (1.0, 0.3, Ease::Smooth),
                (2.04, 1.25, Ease::Linear),
            ]),
        ),
        (
            "eyeBlink_L".to_owned(),
            keys(&[(0.25, 0.0, Ease::EaseIn), (0.3, 1.0, Ease::EaseOut), (0.45, 0.123_456_79, Ease::Linear)]),
        ),
        ("mouth smile-left".to_owned(), Track::Constant(0.37)),
    ]
    .into();
    sequence.head.yaw_degrees = keys(&[(0.0, -10.1, Ease::Smooth), (1.7, 33.3, Ease::Linear)]);
    sequence.head.pitch_degrees = Track::Constant(4.7);
    sequence.head.roll_degrees = keys(&[(0.5, 1.1, Ease::EaseIn), (2.5, -7.3, Ease::Linear)]);
    let at = |t: f64, v: [f32; 3]| Key { t, v, ease: Ease::Smooth };
    sequence.head.translation = Track::Keys(vec![
        at(0.0, [0.01, 0.02, 0.03]),
        Key { ease: Ease::Linear, ..at(2.9, [0.013, -0.021, 0.0377]) },
    ]);
    sequence
}

fn import(text: &str) -> Imported {
    read::from_bytes(text.as_bytes(), Path::new("scene.ma"), &read::Options::default()).unwrap()
}

#[test]
fn a_head_and_its_performance_come_back_exactly() {
    let head = head();
    let rig = Rig::default();
    let sequence = sequence();
    let folder = std::env::temp_dir().join(format!("rubor-maya-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("test head.ma");
    let options = write::Options {
        inbetweens: vec![Inbetween { shape: "jawOpen".into(), target: "jawOpen_half".into(), weight: 0.5 }],
        ..write::Options::default()
    };
    let performance = Performance { rig: &rig, sequence: &sequence };
    let notes = write::write(&head, Some(performance), &options, &path).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    let imported = read::read(&path, &read::Options::default()).unwrap();
    // The performance has a weight of 1.25.
    assert_eq!(imported.notes.len(), 1, "{:?}", imported.notes);
    assert!(imported.notes[0].contains("jawOpen (0.1 to 1.25)"), "{:?}", imported.notes);
    assert_eq!(imported.inbetweens, options.inbetweens);
    let back = &imported.head;
    assert_eq!(back.mesh.points, head.mesh.points);
    assert_eq!(back.mesh.vertices, head.mesh.vertices);
    assert_eq!(back.mesh.triangles, head.mesh.triangles);
    assert_eq!(back.mesh.parts, head.mesh.parts);
    assert_eq!(back.mesh.occlusion, head.mesh.occlusion);
    assert_eq!(
        (&back.name, &back.landmarks, &back.provenance),
        (&head.name, &head.landmarks, &head.provenance)
    );
    for shape in &head.shapes {
        let found =
            back.shapes.iter().find(|s| s.name == shape.name).unwrap_or_else(|| panic!("{}", shape.name));
        assert_eq!(found, shape);
    }
    assert_eq!(back.shapes.len(), head.shapes.len());

    let played = imported.sequence.unwrap();
    assert_eq!(played.shapes, sequence.shapes);
    assert_eq!(played.head, sequence.head);
    assert_eq!((played.fps, played.frame_count()), (sequence.fps, sequence.frame_count()));

    // Maps: at most half a step of their own range.
    let close = |a: &Map, b: &Map| {
        assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
        for (x, y) in a.values.iter().zip(&b.values) {
            assert!((x - y).abs() <= 0.3 / 131_070.0 + 1e-7, "{x} for {y}");
        }
    };
    let (m, n) = (&back.maps, &head.maps);
    close(m.melanin.as_ref().unwrap(), n.melanin.as_ref().unwrap());
    close(m.slopes.as_ref().unwrap(), n.slopes.as_ref().unwrap());
    close(m.specular.as_ref().unwrap(), n.specular.as_ref().unwrap());
    close(&m.distributions[1].bias, &n.distributions[1].bias);
    close(&m.zones[0].mask, &n.zones[0].mask);
    assert_eq!(m.distributions[1].name, "anger");
    assert_eq!(m.hair_color_linear, n.hair_color_linear);
    assert!(m.hair.is_none());

    // A second round changes nothing.
    let again = folder.join("again.ma");
    let performance = Performance { rig: &rig, sequence: &played };
    let options = write::Options { inbetweens: imported.inbetweens, ..write::Options::default() };
    write::write(back, Some(performance), &options, &again).unwrap();
    let twice = read::read(&again, &read::Options::default()).unwrap();
    assert_eq!((&twice.head.mesh, &twice.head.shapes), (&back.mesh, &back.shapes));
    assert_eq!(twice.head.maps.melanin, back.maps.melanin);
    assert_eq!(twice.sequence.unwrap().shapes, played.shapes);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn rigs_and_inbetweens_survive_a_baked_performance() {
    let head = head();
    let text = r#"{"expressions": {"open": {"shapes": {"jawOpen": 1}}},
        "combinations": [{"shape": "eyeBlink_L", "drivers": ["jawOpen"]}],
        "inbetweens": [{"shape": "jawOpen", "target": "jawOpen_half", "weight": 0.5}]}"#;
    let rig = Rig::from_json("rig.json", text).unwrap();
    let options = write::Options {
        inbetweens: rig.inbetweens.clone(),
        rig: Some(rig.clone()),
        ..write::Options::default()
    };
    let written = |extra: &str| {
        let text = format!(
            r#"{{"fps": 24, "duration": 1, "expressions": {{"open": [{{"t": 0, "v": 0}}, {{"t": 1, "v": 1}}]}} {extra}}}"#
        );
        let sequence = Sequence::from_json("s.json", &text).unwrap();
        let performance = Performance { rig: &rig, sequence: &sequence };
        let scene = write::to_scene(&head, Some(performance), &options, "t").unwrap();
        let read =
            read::from_bytes(scene.text.as_bytes(), Path::new("/nowhere/t.ma"), &read::Options::default());
        (scene.notes, read.unwrap())
    };
    // Maya shares the weight out itself: jawOpen is keyed as the expression has it.
    let (_, back) = written("");
    assert_eq!(back.inbetweens, rig.inbetweens);
    let played = back.sequence.unwrap();
    assert!((played.shapes["jawOpen"].at(0.25) - 0.25).abs() < 1e-6);
    assert!((played.shapes["eyeBlink_L"].at(0.25) - 0.25).abs() < 1e-6, "the combination is in the weights");
    let carried = Rig::from_json("rig", &back.rig.unwrap().to_string()).unwrap();
    assert_eq!(carried, rig);
    // An in-between that moves by itself cannot be one.
    let (notes, back) = written(r#", "shapes": {"jawOpen_half": 0.25}"#);
    assert!(notes.iter().any(|n| n.contains("moves by itself")), "{notes:?}");
    assert!(back.inbetweens.is_empty());
    assert!((back.sequence.unwrap().shapes["jawOpen_half"].at(0.25) - 0.75).abs() < 1e-6);
}

#[test]
fn what_the_living_do_is_keyed_at_frames() {
    let head = head();
    let rig = Rig::default();
    let text = r#"{"fps": 24, "duration": 1, "life": {"seed": 3, "sway": 1, "breathing": 1},
        "head": {"yawDegrees": [{"t": 0, "v": 0, "ease": "smooth"}, {"t": 1, "v": 9}]}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let performance = Performance { rig: &rig, sequence: &sequence };
    let scene = write::to_scene(&head, Some(performance), &write::Options::default(), "t").unwrap();
    let read = read::from_bytes(scene.text.as_bytes(), Path::new("/nowhere/t.ma"), &read::Options::default());
    let back = read.unwrap().sequence.unwrap();
    let alive = sequence.life.as_ref().unwrap();
    assert!(alive.at(0.5).head_degrees[1] != 0.0 && alive.at(0.5).translation != [0.0; 3]);
    for frame in 0..24 {
        let t = f64::from(frame) / 24.0;
        let yaw = sequence.head.yaw_degrees.at(t) + alive.at(t).head_degrees[0];
        assert!((back.head.yaw_degrees.at(t) - yaw).abs() < 1e-4, "{t}");
        assert!((back.head.translation.at(t)[1] - alive.at(t).translation[1]).abs() < 1e-7, "{t}");
    }
}

#[test]
fn expressions_are_baked_with_the_colour_of_the_skin() {
    let head = head();
    let rig = Rig::from_json(
        "rig.json",
        r#"{ "expressions": { "joy": { "shapes": {"jawOpen": 0.8}, "wrinkles": {"forehead": 0.5}, "hemoglobin": {"joy": 0.6} } } }"#,
    )
    .unwrap();
    let sequence = Sequence::from_json(
        "s.json",
        r#"{ "fps": 25, "duration": 1, "expressions": {"joy": [{"t": 0, "v": 0, "ease": "smoother"}, {"t": 0.96, "v": 1}]} }"#,
    )
    .unwrap();
    let scene = write::to_scene(
        &head,
        Some(Performance { rig: &rig, sequence: &sequence }),
        &write::Options::default(),
        "t",
    )
    .unwrap();
    let imported = import(&scene.text);
    let played = imported.sequence.unwrap();
    for frame in 0..25 {
        let t = f64::from(frame) / 25.0;
        let expected = 0.8 * sequence.expressions["joy"].at(t);
        assert!((played.shapes["jawOpen"].at(t) - expected).abs() < 1e-6);
    }
    for name in ["distribution_weight_0", "zone_weight_0"] {
        assert!(
            scene
                .text
                .contains(&format!("connectAttr \"rubor_skin_{name}.o\" \"rubor_skin_color.param_{name}\""))
        );
    }
    assert!(scene.files.iter().any(|(name, _)| name == "rubor_skin.osl"));
    // Every name that a connection speaks of exists.
    for line in scene.text.lines().filter(|l| l.starts_with("connectAttr")) {
        for plug in line.split('"').filter(|s| s.contains('.')) {
            let node = plug.split('.').next().unwrap();
            let exists = node.starts_with(':') || scene.text.contains(&format!("-n \"{node}\""));
            assert!(exists, "{line}");
        }
    }
}

const QUAD: &str = r#"createNode transform -n "root";
	setAttr ".t" -type "double3" 1 2 3 ;
	setAttr ".s" -type "double3" 2 2 2 ;
createNode transform -n "face" -p "root";
createNode mesh -n "faceShape" -p "face";
	setAttr ".uvst[0].uvsn" -type "string" "map1";
	setAttr -s 4 ".uvst[0].uvsp[0:3]" -type "float2" 0 0 1 0 0 1 1 1;
	setAttr -s 4 ".vt[0:3]"  0 0 0 1 0 0 0 1 0 1 1 0;
	setAttr ".pt[3]" -type "float3" 0 0 0.5 ;
	setAttr -s 4 ".ed[0:3]"  0 1 0 2 3 0 0 2 0 1 3 0;
	setAttr -ch 4 ".fc[0]" -type "polyFaces"
		f 4 0 3 -2 -3
		mu 0 4 0 1 3 2;
"#;

#[test]
fn units_transforms_tweaks_and_quads() {
    for (unit, metres) in [("centimeter", 0.01_f32), ("meter", 1.0), ("in", 0.0254)] {
        let imported = import(&format!("currentUnit -l {unit} -a degree -t pal;\n{QUAD}"));
        let p = |x: f32, y: f32, z: f32| Vec3::new(1.0 + 2.0 * x, 2.0 + 2.0 * y, 3.0 + 2.0 * z) * metres;
        let expected = [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0), p(1.0, 1.0, 0.5)];
        for (found, expected) in imported.head.mesh.points.iter().zip(expected) {
            assert!((*found - expected).length() < 1e-6 * metres * 10.0, "{unit}: {found} for {expected}");
        }
        // The tweak makes the other diagonal the shorter one.
        assert_eq!(imported.head.mesh.triangles.len(), 2);
        let corner = imported.head.mesh.vertices.iter().find(|v| v.point == 3).unwrap();
        assert_eq!(corner.uv, Vec2::new(1.0, 0.0));
        assert!(imported.sequence.is_none());
    }
}

#[test]
fn a_turning_parent_becomes_the_motion_of_the_head() {
    let scene = format!(
        "currentUnit -l centimeter -a degree -t pal;\n{QUAD}
createNode animCurveTA -n \"turn\";
	setAttr \".tan\" 2;
	setAttr -s 2 \".ktv[0:1]\"  1 0 26 90;
createNode script -n \"sceneConfigurationScriptNode\";
	setAttr \".b\" -type \"string\" \"playbackOptions -min 1 -max 26 -ast 1 -aet 50 \";
connectAttr \"turn.o\" \"root.ry\";"
    );
    let imported = import(&scene);
    let sequence = imported.sequence.unwrap();
    assert_eq!((sequence.fps, sequence.frame_count()), (25.0, 26));
    assert!((sequence.head.yaw_degrees.at(1.0) - 90.0).abs() < 1e-4);
    assert!((sequence.head.yaw_degrees.at(0.4) - 36.0).abs() < 1e-4);
    // The pivot of the parent is not that of the head: the translation makes up for it.
    let point = imported.head.mesh.points[1];
    let turned = glam::Quat::from_rotation_y(std::f32::consts::FRAC_PI_2) * point
        + Vec3::from(sequence.head.translation.at(1.0));
    assert!((turned - Vec3::new(0.01, 0.02, 0.01)).length() < 1e-6, "{turned}");
}

fn shared(file: &str) -> Option<Vec<u8>> {
    let Some(shared) = std::env::var_os("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, {file} was not read");
        return None;
    };
    Some(std::fs::read(Path::new(&shared).join("maya").join(file)).unwrap())
}

fn import_part(bytes: &[u8], mesh: &str) -> Imported {
    let options = read::Options { mesh: Some(mesh.into()) };
    read::from_bytes(bytes, Path::new("scene.ma"), &options).unwrap_or_else(|e| panic!("{mesh}: {e}"))
}

#[test]
fn a_cube_that_becomes_a_sphere() {
    let Some(bytes) = shared("CubeToSphereAnim.ma") else { return };
    let imported =
        read::from_bytes(&bytes, Path::new("CubeToSphereAnim.ma"), &read::Options::default()).unwrap();
    let head = &imported.head;
    assert_eq!((head.mesh.points.len(), head.mesh.triangles.len()), (98, 192));
    assert_eq!(head.shapes.len(), 1);
    let shape = &head.shapes[0];
    assert_eq!((shape.name.as_str(), shape.points.len()), ("pCube2", 98));
    // The target is a sphere: all points at one distance from the centre.
    let radii: Vec<f32> = (shape.points.iter().zip(&shape.offsets))
        .map(|(p, o)| (head.mesh.points[*p as usize] + *o).length())
        .collect();
    let (low, high) = radii.iter().fold((f32::MAX, 0.0_f32), |(l, h), r| (l.min(*r), h.max(*r)));
    assert!(high / low < 1.12 && low > 0.003, "{low} to {high}");
    let sequence = imported.sequence.unwrap();
    let track = &sequence.shapes["pCube2"];
    assert_eq!((sequence.fps, track.at(0.0)), (24.0, 0.0));
    assert_eq!(track.at(19.0 / 24.0), 1.0);
    assert_eq!(track.at(39.0 / 24.0), 0.0);
    // Auto tangents are flat at extrema, so both halves are smooth.
    assert!((track.at(9.5 / 24.0) - 0.5).abs() < 1e-6);
}

#[test]
fn the_blend_shape_scene_of_maya_usd() {
    let Some(bytes) = shared("blendShapesExport.ma") else { return };
    // Live in-between targets: three meshes whose one point goes different ways.
    let imported = import_part(&bytes, "|basic_cube_4_blendshape_inbetween_anim|base");
    let names: Vec<&str> = imported.head.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(imported.inbetweens.len(), 2, "{names:?}");
    assert_eq!(imported.inbetweens[0].shape, "tgt");
    assert!((imported.inbetweens[0].weight - 0.333).abs() < 1e-6);
    let sequence = imported.sequence.unwrap();
    assert_eq!(sequence.shapes["tgt"].at(0.0), 0.0);
    assert_eq!(sequence.shapes["tgt"].at(13.0 / 24.0), 1.0);

    // Stored targets with component lists of single points and ranges.
    let imported = import_part(&bytes, "|basic_cube_4_blendshape_baked_targets|base");
    let of = |name: &str| imported.head.shapes.iter().find(|s| s.name == name).unwrap();
    assert_eq!(of("tgt3").points, [0, 6, 7]);
    assert!((of("tgt3").offsets[0].x + 0.007_817_225).abs() < 1e-8);
    assert_eq!(of("tgt2").points, [1, 7]);
    assert_eq!(of("tgt").points, [2, 3]);
    assert!((of("tgt").offsets[1].z - 0.004_729_213_7).abs() < 1e-8);

    // Other deformers in the stack are named, the blend shape is read.
    let imported = import_part(&bytes, "|cube_extra_deformer_in_stack|group9|base");
    assert!(!imported.head.shapes.is_empty());
    assert!(
        imported.notes.iter().any(|n| n.contains("squash") || n.contains("nonLinear")),
        "{:?}",
        imported.notes
    );

    // Empty targets stay as shapes that do nothing.
    let imported = import_part(&bytes, "|cube_empty_blendshape_targets|base");
    assert_eq!(imported.head.shapes.len(), 2);
    assert!(imported.head.shapes.iter().all(|s| s.points.is_empty()));

    // The whole scene at once is a valid head too.
    read::from_bytes(&bytes, Path::new("scene.ma"), &read::Options::default()).unwrap();
    let error =
        read::from_bytes(&bytes, Path::new("scene.ma"), &read::Options { mesh: Some("nobody".into()) });
    let message = error.unwrap_err().to_string();
    assert!(
        message.contains("no mesh whose path contains \"nobody\"") && message.contains("baseShape"),
        "{message}"
    );
}

#[test]
fn what_cannot_be_read_is_said_with_its_line() {
    let with = |more: &str| format!("currentUnit -l centimeter -a degree -t pal;\n{QUAD}{more}");
    let text = r#"createNode blendShape -n "b";
	setAttr ".it[0].itg[0].iti[6000].ipt" -type "pointArray" 1 0 0 1 1;
	setAttr ".it[0].itg[0].iti[6000].ict" -type "componentList" 1 "vtx[9]";
connectAttr "b.og[0]" "faceShape.i";
connectAttr "origShape.w" "b.ip[0].ig";
createNode mesh -n "origShape" -p "face";
	setAttr ".io" yes;
	setAttr -s 3 ".vt[0:2]" 0 0 0 1 0 0 0 1 0;
	setAttr -s 3 ".ed[0:2]" 0 1 0 1 2 0 2 0 0;
	setAttr ".fc[0]" -type "polyFaces" f 3 0 1 2;
"#;
    let cases = [
        ("createNode mesh -n \"m\";".to_owned(), "without points"),
        (with(text), "an offset of point 9"),
        (QUAD.replace("0 3 -2 -3", "0 3 -2 -9"), "edge 8"),
        (QUAD.replace("mu 0 4 0 1 3 2", "mu 0 4 0 1 3 7"), "texture coordinate 7"),
        (QUAD.replace("1 3 0;\n\tsetAttr -ch", "1 30 0;\n\tsetAttr -ch"), "point 30"),
        ("createNode transform -n \"a\";".into(), "no visible mesh"),
        ("createNode mesh -n \"m\"; createNode polySphere -n \"s\"; connectAttr \"s.out\" \"m.i\";".into(), "polySphere"),
        (
            "createNode mesh -n \"m\"; createNode tweak -n \"t\"; connectAttr \"t.og[0]\" \"m.i\"; connectAttr \"t.og[0]\" \"t.ip[0].ig\";".into(),
            "circle",
        ),
    ];
    for (text, expected) in cases {
        let error =
            read::from_bytes(text.as_bytes(), Path::new("wrong.ma"), &read::Options::default()).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(expected) && message.starts_with("wrong.ma:"),
            "{message:?} lacks {expected:?}"
        );
    }
}

#[test]
fn corrupted_scenes_never_panic() {
    let head = head();
    let rig = Rig::default();
    let sequence = sequence();
    let performance = Performance { rig: &rig, sequence: &sequence };
    let mut scene =
        write::to_scene(&head, Some(performance), &write::Options::default(), "t").unwrap().text.into_bytes();
    // Without the shader's text, so that corruption hits what matters.
    let shader = scene.windows(6).position(|w| w == b".code\"").unwrap();
    let end = shader + scene[shader..].windows(3).position(|w| w == b"\";\n").unwrap();
    scene.drain(shader - 9..end + 3);
    let foreign = format!("currentUnit -l centimeter -a degree -t pal;\n{QUAD}").into_bytes();
    let mut noise = SplitMix64(99);
    let (mut read_well, mut refused) = (0, 0);
    for round in 0..600 {
        let mut bytes = if round % 3 == 0 { scene.clone() } else { foreign.clone() };
        for _ in 0..1 + noise.bits() % 3 {
            let at = (noise.bits() % bytes.len() as u64) as usize;
            match noise.bits() % 5 {
                0 => bytes[at] = noise.bits() as u8,
                1 => bytes.truncate(at.max(1)),
                2 => bytes[at] = b"0123456789.-e;\"[]:{} \n"[(noise.bits() % 22) as usize],
                3 => {
                    let to = (at + (noise.bits() % 200) as usize).min(bytes.len());
                    bytes.drain(at..to);
                    bytes.push(b';');
                }
                _ => {
                    let to = (at + (noise.bits() % 400) as usize).min(bytes.len());
                    let copy = bytes[at..to].to_vec();
                    bytes.splice(at..at, copy);
                }
            }
        }
        match read::from_bytes(&bytes, Path::new("corrupt.ma"), &read::Options::default()) {
            Ok(imported) => {
                imported.head.validate().unwrap();
                if let Some(sequence) = imported.sequence {
                    sequence.check().unwrap();
                }
                read_well += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(read_well > 30 && refused > 100, "{read_well} read, {refused} refused");
}
