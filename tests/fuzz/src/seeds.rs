//! Valid files to begin with, small and of every feature; made by code where code can.

use std::sync::OnceLock;

use rubor_assets::export::gltf::{Options, write};
use rubor_rig::expression::Rig;
use rubor_rig::head::{BlendShape, Distribution, Head, Material, Mesh, Part, SkinMaps, Vertex, WrinkleZone};
use rubor_rig::map::Map;
use rubor_rig::timeline::Sequence;

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
        let maps = SkinMaps {
            melanin: Some(map(0.05)),
            hemoglobin: Some(map(0.04)),
            hemoglobin_mean: Some(map(0.04)),
            distributions: vec![Distribution { name: "joy".into(), scale: map(1.1), bias: map(0.01) }],
            wrinkle_slopes: vec![Map::filled(4, 4, &[0.1, 0.2])],
            zones: vec![WrinkleZone { name: "forehead".into(), wrinkle_map: 0, mask: map(0.5) }],
            ..SkinMaps::default()
        };
        let shapes = names.iter().zip(0..).map(|(name, k)| shape(name, k)).collect();
        Head { name: "seed".into(), mesh, shapes, maps, ..Head::default() }
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

fn kept(target: &str) -> Vec<Vec<u8>> {
    files(&format!("{KEPT}/{target}"), &[""])
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
    with("gltf", [files(FORMATS, &[".glb"]), own()].concat())
}

/// A file of ours, with rig and sequence.
pub fn own() -> Vec<Vec<u8>> {
    static OWN: OnceLock<Vec<u8>> = OnceLock::new();
    let bytes = OWN.get_or_init(|| {
        let rig = Rig::from_json("rig", RIG).expect("the rig is valid");
        let sequence = Sequence::from_json("s", SEQUENCES[0]).expect("the sequence is valid");
        let options = Options { rig: Some(&rig), sequence: Some(&sequence), ..Options::default() };
        let path = std::env::temp_dir().join(format!("rubor-fuzz-{}.glb", std::process::id()));
        write(small_head(), &options, &path).expect("the head is written");
        let bytes = std::fs::read(&path).expect("the head");
        std::fs::remove_file(&path).expect("the head goes");
        bytes
    });
    with("own", vec![bytes.clone()])
}

pub fn obj() -> Vec<Vec<u8>> {
    with(
        "obj",
        texts(&[
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
    static SCENE: OnceLock<Vec<u8>> = OnceLock::new();
    let scene = SCENE.get_or_init(|| {
        let scene =
            rubor_maya::write::to_scene(small_head(), None, &rubor_maya::write::Options::default(), "seed");
        scene.expect("the head is written").text.into_bytes()
    });
    let plain = "//Maya ASCII 2024 scene\nrequires maya \"2024\";\ncurrentUnit -l centimeter -a degree -t film;\ncreateNode transform -n \"t\";\nsetAttr \".t\" -type \"double3\" 0 1 2;\ncreateNode mesh -n \"m\" -p \"t\";\nsetAttr -s 3 \".vt[0:2]\" 0 0 0 1 0 0 0 1 0;\nsetAttr -s 3 \".ed[0:2]\" 0 1 0 1 2 0 2 0 0;\nsetAttr -s 1 \".fc[0]\" -type \"polyFaces\" f 3 0 1 2;\ncreateNode animCurveTU -n \"c\";\nsetAttr -s 2 \".ktv[0:1]\" 1 0 24 1;\nconnectAttr \"c.o\" \"m.v\";\n";
    with("maya", vec![plain.as_bytes().to_vec(), scene.clone()])
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
    with("usd", vec![layer.as_bytes().to_vec(), package])
}
