//! Valid files to begin with, small and of every feature; made by code where code can.

use std::sync::OnceLock;

use rubor_assets::export::gltf::{Options, to_bytes};
use rubor_assets::export::{Performance, usd as usd_export};
use rubor_assets::facial_appearance::NAME;
use rubor_assets::import::gltf::from_bytes;
use rubor_rig::expression::Rig;
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, OcclusionChange, Part, Provenance, ProvenanceKind,
    SkinMaps, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;
use rubor_rig::timeline::Sequence;
use serde_json::Value;

const FORMATS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets-pipeline/tests/formats/data");
const SCENES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");
/// Files that were faults, and others that were collected.
const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/seeds");

/// A sheet of 16 points with shapes, zones and distributions.
pub fn small_head() -> &'static Head {
    static HEAD: OnceLock<Head> = OnceLock::new();
    HEAD.get_or_init(|| {
        let mut mesh = Mesh::default();
        for i in 0..16_u32 {
            let (x, y) = ((i % 4) as f32, (i / 4) as f32);
            mesh.points.push([0.05 * x, -0.05 * y, 0.01 * x * y].into());
            mesh.vertices.push(Vertex { point: i, uv: [x / 3.0, y / 3.0].into() });
        }
        for i in (0..12_u32).filter(|i| i % 4 != 3) {
            mesh.triangles.push([i, i + 4, i + 5]);
            mesh.triangles.push([i, i + 5, i + 1]);
        }
        let triangles = 0..mesh.triangles.len() as u32;
        mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles });
        let shape = |name: &str, k: u32| BlendShape {
            name: name.into(),
            points: vec![k, k + 1],
            offsets: vec![[0.0, 0.0, 0.01].into(); 2],
            ..BlendShape::default()
        };
        let names =
            ["jawOpen", "mouthSmileLeft", "mouthSmileRight", "eyeBlinkLeft", "eyeBlinkRight", "browInnerUp"];
        let map = |v: f32| Map::filled(4, 4, &[v]);
        let two = Some(Map::filled(4, 4, &[0.2, 0.3]));
        let maps = SkinMaps {
            albedo: Some(Map::filled(4, 4, &[0.6, 0.4, 0.3])),
            slopes: two.clone(),
            specular: two,
            scattering: Some(map(0.9)),
            hair: Some(map(0.1)),
            hair_count: Some(1000),
            melanin: Some(map(0.05)),
            hemoglobin: Some(map(0.04)),
            hemoglobin_mean: Some(map(0.04)),
            distributions: vec![Distribution { name: "joy".into(), scale: map(1.1), bias: map(0.01) }],
            wrinkle_slopes: vec![Map::filled(4, 4, &[0.1, 0.2])],
            zones: vec![WrinkleZone { name: "forehead".into(), wrinkle_map: 0, mask: map(0.5) }],
            ..SkinMaps::default()
        };
        mesh.occlusion = vec![0.5; 16];
        let mut shapes: Vec<BlendShape> = names.iter().zip(0..).map(|(name, k)| shape(name, k)).collect();
        shapes[0].occlusion = vec![OcclusionChange { point: 2, at_half: 0.25, at_full: -0.5 }];
        let provenance = vec![Provenance {
            of: "geometry".into(),
            kind: ProvenanceKind::Synthesised,
            source: "a sheet".into(),
            licence: "CC0-1.0".into(),
        }];
        let landmarks = [("pronasale".to_owned(), [0.1, 0.0, 0.0].into())].into();
        Head { name: "seed".into(), mesh, shapes, maps, landmarks, provenance, ..Head::default() }
    })
}

/// Files of a folder with one of these endings, at most 256 kB each.
fn files(folder: &str, endings: &[&str]) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut paths: Vec<_> =
        entries.filter(|p| endings.iter().any(|e| p.to_string_lossy().ends_with(e))).collect();
    paths.sort();
    paths.iter().filter_map(|p| std::fs::read(p).ok()).filter(|b| b.len() <= 1 << 18).collect()
}

/// The files of a target; one that ends in `.lines` has a seed in each line.
fn kept(target: &str) -> Vec<Vec<u8>> {
    let folder = format!("{KEPT}/{target}");
    let lines = files(&folder, &[".lines"]).concat();
    let mut all = files(&folder, &[""]);
    all.extend(lines.split(|b| *b == b'\n').map(<[u8]>::to_vec));
    all
}

fn with(target: &str, mut more: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    more.extend(kept(target));
    more
}

fn texts(list: &[&str]) -> Vec<Vec<u8>> {
    list.iter().map(|t| t.as_bytes().to_vec()).collect()
}

/// Files of other programs.
pub fn gltf() -> Vec<Vec<u8>> {
    static COMPRESSED: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    with("gltf", [files(FORMATS, &[".glb"]), COMPRESSED.get_or_init(compressed).clone(), own()].concat())
}

/// Files of ours with rig and sequence: plain, compressed, with materials and normals of other authors, and as programs
/// leave them that do not know the extension.
pub fn own() -> Vec<Vec<u8>> {
    static OWN: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let made = OWN.get_or_init(|| {
        let rig = Rig::from_json("rig", RIG).expect("the rig is valid");
        let sequence = Sequence::from_json("s", SEQUENCES[0]).expect("the sequence is valid");
        let plain = Options {
            color_map_size: 8,
            normal_map_size: 8,
            rig: Some(&rig),
            sequence: Some(&sequence),
            shape_colors: true,
            ..Options::default()
        };
        let written =
            |head: &Head, options: &Options<'_>| to_bytes(head, options).expect("a head is written");
        let whole = written(small_head(), &plain);
        let mut all = vec![
            written(small_head(), &Options { compress: true, ..plain.clone() }),
            written(small_head(), &Options { only_lines: true, pose: None, ..plain.clone() }),
        ];
        for file in ["materials.gltf", "quantised.gltf", "avatar_0.gltf"] {
            let path = format!("{KEPT}/gltf/{file}");
            let bytes = std::fs::read(&path).expect("a seed");
            // Its pictures lie elsewhere.
            let beside = crate::beside(file);
            let mut head = from_bytes(&bytes, &beside).expect("a seed is valid").head;
            head.authored.normals = vec![[0.6, 0.0, 0.8].into(); head.mesh.vertices.len()];
            all.push(written(&head, &Options { rig: None, sequence: None, ..plain.clone() }));
        }
        for lost in [
            "",
            "melanin",
            "hemoglobin mean",
            "joy scale",
            "wrinkle slopes 0",
            "rubor ambient visibility",
            "rubor points of part 0",
        ] {
            all.push(without_extension(&whole, lost));
        }
        // Other layouts and pictures of its maps, other counts.
        let other = |change: fn(&mut Value)| changed(&whole, |json| change(&mut json["extensions"][NAME]));
        all.push(other(|own| own["maps"]["slopes"]["layout"] = "interleaved".into()));
        all.push(other(|own| own["maps"]["melanin"]["image"] = own["maps"]["albedo"]["image"].clone()));
        all.push(other(|own| own["maps"]["melanin"]["layout"] = "color".into()));
        all.push(other(|own| own["maps"]["melanin"]["offset"] = Value::Array(Vec::new())));
        all.push(other(|own| own["shapeOcclusion"][0]["shape"] = "gone".into()));
        all.push(other(|own| own["shapeOcclusion"][0]["changes"] = own["occlusion"].clone()));
        all.push(other(|own| own["pointCount"] = 1000.into()));
        all.push(other(|own| own["authoredNormals"] = true.into()));
        all.push(other(|own| own["version"] = 9.into()));
        all.push(whole);
        all
    });
    with("own", made.clone())
}

/// A GLB with another document.
fn changed(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (text, binary) = crate::mutate::glb_chunks(bytes).expect("a GLB");
    let mut json: Value = serde_json::from_slice(text).expect("JSON");
    change(&mut json);
    crate::mutate::to_glb(json.to_string().into_bytes(), binary.to_vec())
}

/// The elements of a list of a document.
fn list<'v>(json: &'v mut Value, name: &str) -> impl Iterator<Item = &'v mut Value> {
    json.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten()
}

/// A file of ours that another program wrote again: the extension is gone, and so is one name.
fn without_extension(bytes: &[u8], lost: &str) -> Vec<u8> {
    changed(bytes, |json| {
        if let Some(extensions) = json["extensions"].as_object_mut() {
            extensions.remove(NAME);
        }
        for of in ["images", "accessors"] {
            list(json, of).filter(|item| item["name"] == lost).for_each(|item| item["name"] = "gone".into());
        }
    })
}

/// Compressed files that say other types, filters and modes of their data.
fn compressed() -> Vec<Vec<u8>> {
    let read = |name: &str| std::fs::read(format!("{FORMATS}/{name}")).expect("a file of the tests");
    let mut all = Vec::new();
    for component in [5120, 5121, 5122, 5123, 5125, 7] {
        all.push(changed(&read("draco.glb"), |json| {
            list(json, "accessors").for_each(|accessor| accessor["componentType"] = component.into());
        }));
    }
    for (key, word) in [
        ("filter", "QUATERNION"),
        ("filter", "COLOR"),
        ("filter", "EXPONENTIAL"),
        ("filter", "NONE"),
        ("filter", "SHARP"),
        ("mode", "TRIANGLES"),
        ("mode", "INDICES"),
        ("mode", "ATTRIBUTES"),
        ("mode", "POINTS"),
    ] {
        for stride in [None, Some(4), Some(8)] {
            all.push(changed(&read("meshopt.glb"), |json| {
                for view in list(json, "bufferViews") {
                    let coded = view["extensions"].as_object_mut().into_iter().flat_map(|e| e.values_mut());
                    for coded in coded.filter(|c| stride.is_none_or(|s| c["byteStride"] == s)) {
                        coded[key] = word.into();
                    }
                }
            }));
        }
    }
    all
}

/// Corners of a face of more than are cut exactly, around a circle.
fn circle() -> impl Iterator<Item = [f32; 2]> {
    (0..520).map(|k| (k as f32 * std::f32::consts::TAU / 520.0).sin_cos().into())
}

pub fn obj() -> Vec<Vec<u8>> {
    let mut wide: String = circle().map(|[x, y]| format!("v {x} {y} 0\n")).collect();
    wide += "f";
    (1..=circle().count()).for_each(|corner| wide += &format!(" {corner}"));
    with(
        "obj",
        texts(&[
            &wide,
            "o face\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl skin\nf 1/1 2/2 3/3 4/4\n",
            "mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\ng a b\ns 1\nf 1//1 2//1 -1//1\nl 1 2\n# end\n",
            "v 0 0 0\nv 1 0 \\\n 0\nv 0 1 0\nv 0.2 0.2 0\nf 1 2 3 4\nf -4 -3 -2\n",
        ]),
    )
}

pub fn mtl() -> Vec<Vec<u8>> {
    with(
        "mtl",
        texts(&[
            "newmtl skin\nKa 1 1 1\nKd 0.8 0.6 0.5\nKs 0 0 0\nNs 10\nd 0.5\nillum 2\nmap_Kd -s 1 2 3 -o 0 0 0 -clamp on skin.png\n",
            "newmtl a\nPr 0.3\nPm 0.1\nKe 1 0 0\nnorm -bm 0.5 n.png\nTr 0.2\nmap_d a.png\nnewmtl b\nmap_Bump b.png\n",
        ]),
    )
}

pub fn target() -> Vec<Vec<u8>> {
    let text = b"# target\n0 0.1 -0.2 0.3\n99 1e-3 0 0\n";
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, text).expect("it compresses");
    with("target", vec![text.to_vec(), encoder.finish().expect("it compresses")])
}

pub fn image() -> Vec<Vec<u8>> {
    static IMAGES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let made = IMAGES.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("rubor-fuzz-images-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        use rubor_assets::image_io::{SampleKind, save_image};
        let map = |channels: u32| Map {
            width: 6,
            height: 5,
            channels,
            values: (0..30 * channels).map(|i| i as f32 / 90.0).collect(),
        };
        let mut all = Vec::new();
        for (name, channels, kind) in [
            ("a.png", 1, SampleKind::U8),
            ("b.png", 3, SampleKind::U16),
            ("c.tif", 3, SampleKind::F32),
            ("d.tif", 1, SampleKind::U16),
            ("e.exr", 3, SampleKind::F32),
            ("f.exr", 1, SampleKind::F32),
        ] {
            let path = folder.join(name);
            save_image(&path, &map(channels), kind).expect("it is written");
            all.push(std::fs::read(&path).expect("an image"));
        }
        std::fs::remove_dir_all(&folder).expect("the folder goes");
        all.push(
            b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x10\x20\x30\x80\x10\x20\x30\x80"
                .to_vec(),
        );
        all
    });
    with("image", [made.clone(), files(FORMATS, &[".png"])].concat())
}

const RIG: &str = r#"{ "expressions": {
    "joy": { "shapes": { "mouthSmileLeft": 1, "mouthSmileRight": 0.9 }, "wrinkles": { "forehead": 0.5 },
        "hemoglobin": { "joy": 0.7 }, "hemoglobinScale": 1.2 } },
  "states": { "cold": { "hemoglobin": { "joy": 0.1 }, "fallback": { "hemoglobinScale": 0.8 } } },
  "combinations": [{ "shape": "jawOpen", "drivers": ["browInnerUp", "eyeBlinkLeft"], "mode": "min" }],
  "inbetweens": [{ "shape": "jawOpen", "target": "browInnerUp", "weight": 0.5 }] }"#;

pub fn rig() -> Vec<Vec<u8>> {
    with("rig", texts(&[RIG, rubor_rig::expression::DEFAULT_RIG_JSON]))
}

const SEQUENCES: [&str; 2] = [
    r#"{ "fps": 24, "duration": 2, "size": [64, 48],
      "expressions": { "joy": [{ "t": 0, "v": 0, "ease": "smooth" }, { "t": 1, "v": 1 }] },
      "shapes": { "jawOpen": 0.5 }, "head": { "yawDegrees": [{ "t": 0, "v": -10 }, { "t": 2, "v": 10 }] },
      "camera": { "orbitDegrees": 20, "fovDegrees": 30 }, "eyes": { "yawDegrees": 5 },
      "life": { "seed": 3, "blinks": 1, "saccades": 1, "breathing": 1, "sway": 1 },
      "lights": [{ "kind": "spot", "position": [0, 1, 1], "direction": [0, -1, -1], "color": [1, 1, 1], "intensity": 2 }],
      "environment": { "name": "studio", "intensity": 0.5, "rotationDegrees": 30 } }"#,
    rubor_rig::timeline::DEMO_SEQUENCE_JSON,
];

/// Keys alone, which a scene says one by one.
const MOVING: &str = r#"{ "fps": 24, "duration": 2, "shapes": { "jawOpen": [{ "t": 0, "v": 0, "ease": "easeIn" }, { "t": 1, "v": 1, "ease": "step" }, { "t": 1.5, "v": 0 }],
      "mouthSmileLeft": 0.4 }, "head": { "yawDegrees": [{ "t": 0, "v": -10, "ease": "smooth" }, { "t": 2, "v": 10 }], "pitchDegrees": 3,
      "translation": [{ "t": 0, "v": [0, 0, 0] }, { "t": 2, "v": [0, 0.1, 0] }] } }"#;

pub fn sequence() -> Vec<Vec<u8>> {
    with("sequence", [texts(&SEQUENCES), files(SCENES, &[".json"])].concat())
}

pub fn capture_csv() -> Vec<Vec<u8>> {
    with(
        "capture_csv",
        texts(&[
            "Timecode,BlendShapeCount,JawOpen,EyeBlinkLeft,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw\n00:00:01:00.000,3,0,0.1,0.2,0,0,0.1\n00:00:01:30.000,3,0.5,0.2,0.3,0,0,0\n00:00:02:00.500,3,1,0.1,0.1,0,0,0\n",
            "Timecode;JawOpen;EyeBlinkLeft\n0,1;0,5;0,25\n0,2;0,6;0,5\n",
            "Timecode\tJawOpen\n10.0\t0.1\n10.1\t0.2\n",
        ]),
    )
}

pub fn capture_json() -> Vec<Vec<u8>> {
    with(
        "capture_json",
        texts(&[
            r#"{ "frames": [{ "timestampMs": 0, "faceBlendshapes": [{ "categories": [{ "categoryName": "jawOpen", "score": 0.1 }] }],
            "facialTransformationMatrixes": [{ "data": [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1] }] },
          { "timestampMs": 33, "faceBlendshapes": [{ "categories": [{ "categoryName": "jawOpen", "score": 0.4 }] }] }] }"#,
            r#"{ "exportFps": 30, "facsNames": ["jawOpen", "mouthPucker"], "weightMat": [[0, 1], [0.5, 0.5], [1, 0]] }"#,
            r#"[{ "time": 0, "blendShapes": { "jawOpen": 0.2 } }, { "time": 0.1, "blendShapes": { "jawOpen": 0.3, "new": 1 } }]"#,
        ]),
    )
}

pub fn retarget() -> Vec<Vec<u8>> {
    with(
        "retarget",
        texts(&[
            r#"{ "neutral": { "from": 0, "to": 0.5 }, "smoothing": { "windowMs": 80, "amplitude": 0.1, "amplitudeDegrees": 5 }, "limit": 1.2,
            "tolerance": 0.001, "shapes": { "JawOpen": { "shape": "jawOpen", "gain": 1.5, "offset": 0.1 }, "EyeBlinkLeft": null,
            "x": ["a", { "shape": "b" }] }, "head": { "yaw": { "gain": -1, "offsetDegrees": 5 } } }"#,
        ]),
    )
}

pub fn maya() -> Vec<Vec<u8>> {
    static SCENES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let scenes = SCENES.get_or_init(|| {
        use rubor_maya::write::{Options, to_scene};
        let rig = Rig::from_json("rig", RIG).expect("the rig is valid");
        let options =
            Options { inbetweens: rig.inbetweens.clone(), rig: Some(rig.clone()), ..Options::default() };
        let written = |sequence: Option<&str>| {
            let sequence = sequence.map(|text| Sequence::from_json("s", text).expect("it is valid"));
            let performance = sequence.as_ref().map(|sequence| Performance { rig: &rig, sequence });
            let scene = to_scene(small_head(), performance, &options, "seed").expect("the head is written");
            // Its maps are the one that lies beside all files.
            let mut text = scene.text;
            for (name, _) in scene.files {
                text = text.replace(&name, "gray.png");
            }
            text.into_bytes()
        };
        vec![written(None), written(Some(SEQUENCES[0])), written(Some(MOVING))]
    });
    let plain = "//Maya ASCII 2024 scene\nrequires maya \"2024\";\ncurrentUnit -l centimeter -a degree -t film;\ncreateNode transform -n \"t\";\nsetAttr \".t\" -type \"double3\" 0 1 2;\ncreateNode mesh -n \"m\" -p \"t\";\nsetAttr -s 3 \".vt[0:2]\" 0 0 0 1 0 0 0 1 0;\nsetAttr -s 3 \".ed[0:2]\" 0 1 0 1 2 0 2 0 0;\nsetAttr -s 1 \".fc[0]\" -type \"polyFaces\" f 3 0 1 2;\ncreateNode animCurveTU -n \"c\";\nsetAttr -s 2 \".ktv[0:1]\" 1 0 24 1;\nconnectAttr \"c.o\" \"m.v\";\n";
    with("maya", [vec![plain.as_bytes().to_vec()], scenes.clone()].concat())
}

pub fn usd() -> Vec<Vec<u8>> {
    let layer = r#"#usda 1.0
(
    defaultPrim = "a"
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "a" (kind = "component")
{
    double3 xformOp:translate = (0, 1, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "face" (prepend apiSchemas = ["SkelBindingAPI"])
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        uniform token[] skel:blendShapes = ["jawOpen"]
        rel skel:blendShapeTargets = [</a/face/jawOpen>]
        rel material:binding = </a/m>
        def BlendShape "jawOpen" { uniform vector3f[] offsets = [(0, 0, 1)]
 uniform int[] pointIndices = [0] }
        def GeomSubset "s" { int[] indices = [0] }
    }
    def Material "m"
    {
        token outputs:surface.connect = </a/m/p.outputs:surface>
        def Shader "p" { uniform token info:id = "UsdPreviewSurface"
 color3f inputs:diffuseColor = (1, 0, 0) }
    }
    float x.timeSamples = { 0: 1, 1: 2, }
}
"#;
    let package = rubor_assets::usdz::write(&[("a.usda", layer.as_bytes())]).expect("a package");
    static OWN: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let own = OWN.get_or_init(|| {
        let rig = Rig::from_json("rig", RIG).expect("the rig is valid");
        let sequence = Sequence::from_json("s", SEQUENCES[0]).expect("the sequence is valid");
        let options = usd_export::Options {
            color_map_size: 8,
            normal_map_size: 8,
            rig: Some(&rig),
            sequence: Some(&sequence),
            ..usd_export::Options::default()
        };
        let layer = usd_export::to_layer(small_head(), &options, "own").expect("the head is written");
        let pictures = layer.files.iter().map(|(name, bytes)| (name.as_str(), &bytes[..]));
        let files: Vec<(&str, &[u8])> =
            std::iter::once(("own.usda", layer.text.as_bytes())).chain(pictures).collect();
        vec![layer.text.clone().into_bytes(), rubor_assets::usdz::write(&files).expect("a package")]
    });
    let mut squeezed = package.clone();
    let central = squeezed.windows(4).position(|w| w == b"PK\x01\x02").expect("a directory");
    squeezed[central + 10] = 8;
    let empty = rubor_assets::usdz::write(&[]).expect("a package");
    let deep = format!("#usda 1.0\n{}", "def \"a\" { ".repeat(100));
    let brackets = format!("#usda 1.0\n( a = {})", "[".repeat(100));
    let points: Vec<String> = circle().map(|[x, y]| format!("({x}, {y}, 0)")).collect();
    let indices: Vec<String> = (0..points.len()).map(|i| i.to_string()).collect();
    let wide = format!(
        "#usda 1.0\ndef Mesh \"wide\"\n{{\n    int[] faceVertexCounts = [{}]\n    int[] faceVertexIndices = [{}]\n    point3f[] points = [{}]\n}}\n",
        points.len(),
        indices.join(", "),
        points.join(", ")
    );
    let faults = vec![
        wide.into_bytes(),
        squeezed,
        empty,
        deep.into_bytes(),
        brackets.into_bytes(),
        b"PXR-USDC".to_vec(),
    ];
    with("usd", [vec![layer.as_bytes().to_vec(), package], own.clone(), faults].concat())
}
