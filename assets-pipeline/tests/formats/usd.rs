//! USD layers and packages, in and out.

use std::path::Path;

use glam::{Vec2, Vec3};
use rubor_assets::export::usd;
use rubor_assets::import::gltf::{ImportedHead, from_bytes as gltf};
use rubor_assets::import::usd::from_bytes;
use rubor_assets::usdz;
use rubor_rig::expression::{Inbetween, Rig};
use rubor_rig::head::Material;

use super::support::face_document;
use super::{data, says};

fn face() -> rubor_rig::head::Head {
    let document = face_document(|d, _, _| d["meshes"][0]["name"] = "skin".into());
    gltf(document.to_string().as_bytes(), Path::new("face.gltf")).unwrap().head
}

fn same(read: &ImportedHead, head: &rubor_rig::head::Head) {
    // Points in the order of their first use.
    let corners = |head: &rubor_rig::head::Head| -> Vec<(Vec3, Vec2)> {
        let corner = |v: &u32| {
            let vertex = head.mesh.vertices[*v as usize];
            (head.mesh.points[vertex.point as usize], vertex.uv)
        };
        head.mesh.triangles.as_flattened().iter().map(corner).collect()
    };
    let (found, expected) = (corners(&read.head), corners(head));
    assert_eq!(found.len(), expected.len());
    for ((p, uv), (q, st)) in found.iter().zip(&expected) {
        assert_eq!(p, q);
        assert!((*uv - *st).abs().max_element() < 1e-6);
    }
    assert_eq!(read.head.mesh.points.len(), head.mesh.points.len(), "seams stay closed");
    for (a, b) in read.head.shapes.iter().zip(&head.shapes) {
        assert_eq!(a.name, b.name);
        let sum = |s: &rubor_rig::head::BlendShape| s.offsets.iter().copied().sum::<Vec3>();
        assert_eq!(a.points.len(), b.points.len());
        assert!(sum(a).distance(sum(b)) < 1e-5);
    }
}

#[test]
fn what_is_written_is_read_as_a_layer_and_as_a_package() {
    let head = face();
    let mut rig = Rig::default_rig().unwrap();
    rig.description = "of this head".into();
    let options = usd::Options { rig: Some(&rig), ..usd::Options::default() };
    let layer = usd::to_layer(&head, &options, "face").unwrap();
    let read = from_bytes(layer.text.as_bytes(), Path::new("face.usda")).unwrap();
    same(&read, &head);
    assert_eq!(read.rig.expect("the rig")["description"], "of this head");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.usdz");
    let written = usd::write_package(&head, &options, &path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(written.package_size, Some(bytes.len()));
    let files = usdz::read(&bytes).unwrap();
    assert_eq!(files.len(), 1 + written.files.len());
    assert_eq!(files[0].name, "face.usda");
    same(&from_bytes(&bytes, &path).unwrap(), &head);
}

/// A quad and a triangle in centimetres, z up, with a subset, an in-between and a texture.
const LAYER: &str = r#"#usda 1.0
(
    defaultPrim = "Root"
    metersPerUnit = 0.01
    upAxis = "Z"
)

def Xform "Root" (
    prepend references = @other.usda@
)
{
    double3 xformOp:translate = (0, 0, 100)
    float3 xformOp:rotateXYZ = (0, 0, 90)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]

    def Mesh "Head"
    {
        int[] faceVertexCounts = [4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
        point3f[] points = [(0, 0, 0), (10, 0, 0), (10, 0, 10), (0, 0, 10), (20, 0, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.25)] (
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "catmullClark"
        uniform token[] skel:blendShapes = ["jawOpen"]
        rel skel:blendShapeTargets = [</Root/Head/Jaw>]
        rel material:binding = </Root/Looks/Paint>

        def BlendShape "Jaw"
        {
            uniform vector3f[] inbetweens:half = [(0, 0, -1)] (
                weight = 0.5
            )
            uniform vector3f[] offsets = [(0, 0, -3)]
            uniform int[] pointIndices = [4]
        }

        def GeomSubset "teeth"
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
        }
    }

    def Mesh "Guide"
    {
        uniform token purpose = "guide"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    }

    def Scope "Looks"
    {
        def Material "Paint"
        {
            token outputs:surface.connect = </Root/Looks/Paint/Surface.outputs:surface>

            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </Root/Looks/Paint/Color.outputs:rgb>
                float inputs:roughness = 0.25
                float inputs:opacity.connect = </Root/Looks/Paint/Color.outputs:a>
                float inputs:opacityThreshold = 0.5
                normal3f inputs:normal.connect = </Root/Looks/Paint/Gone.outputs:rgb>
            }

            def Shader "Color"
            {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./gradient.png@
                token inputs:wrapS = "mirror"
            }
        }
    }
}
"#;

#[test]
fn a_layer_of_another_program_is_read() {
    let package =
        usdz::write(&[("a.usda", LAYER.as_bytes()), ("gradient.png", &data("gradient.png"))]).unwrap();
    let read = from_bytes(&package, Path::new("a.usdz")).unwrap();
    let head = &read.head;
    assert_eq!(head.mesh.triangles.len(), 3);
    // (10, 0, 10) cm turns to (0, 10, 10), rises by 100, and z up becomes y up: (0, 110, -10).
    let corner = Vec3::new(0.0, 1.1, -0.1);
    assert!(head.mesh.points.iter().any(|p| p.distance(corner) < 1e-5), "{:?}", head.mesh.points);
    let names: Vec<&str> = head.mesh.parts.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["teeth", "Head"]);
    let kinds: Vec<Material> = head.mesh.parts.iter().map(|p| p.material).collect();
    assert_eq!(
        kinds,
        [Material::Other, Material::Skin],
        "textured parts keep their look, skin as skin; subsets inherit it"
    );
    assert_eq!(head.authored.of_parts, [Some(0), Some(0)]);
    says(&read, "keep the look of their author", "teeth");
    let vertex = head.mesh.vertices.iter().find(|v| (v.uv - Vec2::new(0.5, 0.75)).length() < 1e-6);
    assert!(vertex.is_some(), "v grows downwards");
    let shapes: Vec<(&str, Vec3)> = head.shapes.iter().map(|s| (s.name.as_str(), s.offsets[0])).collect();
    assert_eq!(shapes.len(), 2);
    assert!(
        shapes[0].0 == "jawOpen" && shapes[0].1.distance(Vec3::new(0.0, -0.03, 0.0)) < 1e-6,
        "{shapes:?}"
    );
    assert!(shapes[1].0 == "half" && shapes[1].1.distance(Vec3::new(0.0, -0.01, 0.0)) < 1e-6, "{shapes:?}");
    let rig = Rig::from_json("rig", &read.rig.as_ref().expect("a rig").to_string()).unwrap();
    let entry = Inbetween { shape: "jawOpen".into(), target: "half".into(), weight: 0.5 };
    assert!(rig.inbetweens.contains(&entry));
    let material = &head.authored.materials[0];
    assert_eq!(material.roughness, 0.25);
    assert_eq!(material.alpha, rubor_rig::authored::AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(head.authored.images[0].width, 12);
    assert!(material.normal_texture.is_none());
    says(&read, "references are not followed", "/Root");
    says(&read, "guides", "/Root/Guide");
    says(&read, "cage", "/Root/Head");
    says(&read, "other shaders", "/Root/Looks/Paint/Surface, inputs:normal");
    // Beside no picture.
    let read = from_bytes(LAYER.as_bytes(), Path::new("/none/a.usda")).unwrap();
    says(&read, "picture cannot be read", "gradient.png");
}

#[test]
fn arcs_with_prims_and_offsets_are_passed_over() {
    let layer = |arcs: &str| {
        format!(
            "#usda 1.0\n(\n    subLayers = [@a.usda@ (offset = 1; scale = 2), @b.usda@]\n)\n\
             def Mesh \"m\" (\n    {arcs}\n    kind = \"component\"\n)\n{{\n    int[] faceVertexCounts = [3]\n    \
             int[] faceVertexIndices = [0, 1, 2]\n    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n}}\n"
        )
    };
    let read = |arcs: &str| from_bytes(layer(arcs).as_bytes(), Path::new("a.usda"));
    for arcs in [
        "prepend references = [@a.usda@</A>, @b.usda@</B> (offset = 1), </C> (scale = 2)]",
        "references = @a.usda@</A> (\n        offset = 1\n        customData = { string by = \"me\" }\n    )",
        "references = </A> (offset = 1)",
    ] {
        let imported = read(arcs).unwrap();
        says(&imported, "references are not followed", "/m");
        says(&imported, "sublayers are not read", "");
    }
    let deep = format!("references = {}", "[@a@ (b = ".repeat(100_000));
    let error = read(&deep).expect_err("no end of levels").to_string();
    assert!(error.contains("fewer levels of brackets"), "{error}");
}
