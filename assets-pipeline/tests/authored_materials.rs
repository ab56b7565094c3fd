//! Materials of authors: what import keeps of them, what it says, and that rubor's own files hold them.

use std::path::Path;

use glam::Vec2;
use rubor_assets::convert::own_color;
use rubor_assets::export::gltf::{MapEncodings, Options, to_bytes};
use rubor_assets::import::gltf::{ImportedHead, from_bytes};
use rubor_rig::authored::{AlphaMode, Wrap};
use rubor_rig::color::srgb_encode;
use rubor_rig::head::Material;
use rubor_rig::map::Map;
use serde_json::{Value, json};

fn data_uri(kind: &str, bytes: &[u8]) -> String {
    use base64::Engine;
    format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// A picture of two texels: one red and half there, one of 10, 20, 30.
fn picture() -> String {
    let texels = [255, 0, 0, 128, 10, 20, 30, 255];
    let mut bytes = Vec::new();
    let image = image::RgbaImage::from_raw(2, 1, texels.to_vec()).unwrap();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    data_uri("image/png", &bytes)
}

/// Triangles of one material each, as nodes with names.
fn document(parts: &[(&str, Option<usize>)], materials: Value) -> Value {
    let floats: Vec<f32> = [
        // Positions, texture coordinates, second ones, colours.
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0][..],
        &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
        &[0.5, 0.0, 1.0, 0.5, 0.0, 0.25],
        &[1.0, 0.5, 0.25, 0.0, 1.0, 0.5, 1.0, 0.0, 1.0],
    ]
    .concat();
    let bytes: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    let view =
        |start: usize, count: usize| json!({"buffer": 0, "byteOffset": 4 * start, "byteLength": 4 * count});
    let accessor = |view: usize, kind: &str| json!({"bufferView": view, "componentType": 5126, "count": 3, "type": kind});
    let mesh = |material: &Option<usize>| {
        let attributes = json!({"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2, "COLOR_0": 3});
        let mut primitive = json!({"attributes": attributes});
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        json!({"primitives": [primitive]})
    };
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": (0..parts.len()).collect::<Vec<_>>()}],
        "nodes": parts.iter().enumerate().map(|(i, (name, _))| json!({"name": name, "mesh": i})).collect::<Vec<_>>(),
        "meshes": parts.iter().map(|(_, material)| mesh(material)).collect::<Vec<_>>(),
        "materials": materials,
        "buffers": [{"byteLength": bytes.len(), "uri": data_uri("application/octet-stream", &bytes)}],
        "bufferViews": [view(0, 9), view(9, 6), view(15, 6), view(21, 9)],
        "accessors": [accessor(0, "VEC3"), accessor(1, "VEC2"), accessor(2, "VEC2"), accessor(3, "VEC3")],
        "images": [{"name": "dots", "uri": picture()}, {"uri": "missing.png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "textures": [
            {"source": 0, "sampler": 0},
            {"source": 1},
            {"extensions": {"ACME_texture_paint": {"source": 0}}},
        ],
    })
}

fn import(document: &Value) -> ImportedHead {
    from_bytes(document.to_string().as_bytes(), Path::new("authored.gltf")).unwrap()
}

fn says(imported: &ImportedHead, message: &str, place: &str) {
    let found = imported
        .notes
        .iter()
        .any(|n| n.message.contains(message) && n.places.iter().any(|p| p.contains(place)));
    assert!(found, "{message:?} at {place:?} in {:#?}", imported.notes);
}

fn kinds(imported: &ImportedHead) -> Vec<Material> {
    imported.head.mesh.parts.iter().map(|p| p.material).collect()
}

/// Everything that a material can say.
fn rich() -> Value {
    let moved = json!({"offset": [0.25, 0.5], "rotation": 0.5, "scale": [2.0, -1.0], "texCoord": 1});
    json!({
        "name": "scarf",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1.0, 0.75],
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": moved}},
            "metallicFactor": 0.25, "roughnessFactor": 0.75,
            "metallicRoughnessTexture": {"index": 0, "texCoord": 1},
        },
        "normalTexture": {"index": 0, "scale": -0.5},
        "occlusionTexture": {"index": 0, "strength": 0.5},
        "emissiveFactor": [1.0, 0.5, 0.0],
        "emissiveTexture": {"index": 0},
        "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
        "extensions": {
            "KHR_materials_unlit": {}, "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
            "KHR_materials_ior": {"ior": 1.25},
            "KHR_materials_specular": {
                "specularFactor": 0.5, "specularTexture": {"index": 0},
                "specularColorFactor": [1.0, 2.0, 0.5], "specularColorTexture": {"index": 0},
            },
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.75, "clearcoatTexture": {"index": 0},
                "clearcoatRoughnessFactor": 0.25, "clearcoatRoughnessTexture": {"index": 0},
            },
            "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": {"index": 0}},
        },
    })
}

#[test]
fn all_that_a_material_says_comes_along_and_stays_in_own_files() {
    let parts = [("Head", Some(1)), ("Torus", Some(0))];
    let foreign = import(&document(&parts, json!([rich(), {"name": "skin"}])));
    assert_eq!(kinds(&foreign), [Material::Skin, Material::Other]);
    says(&foreign, "NEAREST", "material 0, base colour");
    let bytes = to_bytes(&foreign.head, &Options::default()).unwrap();
    let own = from_bytes(&bytes, Path::new("own.glb")).unwrap();
    assert!(own.notes.is_empty(), "{:#?}", own.notes);
    for head in [&foreign.head, &own.head] {
        assert_eq!([0, 1].map(|p| head.authored_material(p).is_some()), [false, true]);
        let authored = &head.authored;
        let material = &authored.materials[head.authored_material(1).unwrap() as usize];
        assert_eq!(material.name, "scarf");
        assert_eq!(material.base_color, [0.5, 0.25, 1.0, 0.75]);
        assert_eq!((material.metallic, material.roughness), (0.25, 0.75));
        assert_eq!((material.normal_scale, material.occlusion_strength), (-0.5, 0.5));
        assert_eq!(material.emission_linear, [4.0, 2.0, 0.0]);
        assert_eq!(material.alpha, AlphaMode::Mask { cutoff: 0.25 });
        assert_eq!((material.ior, material.specular), (1.25, 0.5));
        assert_eq!(material.specular_color, [1.0, 2.0, 0.5]);
        assert_eq!((material.clearcoat, material.clearcoat_roughness), (0.75, 0.25));
        assert_eq!(material.transmission, 0.5);
        assert!(material.is_double_sided && material.is_unlit);
        assert!(material.textures().iter().all(|(_, t)| t.is_some()));
        let base = material.base_color_texture.unwrap();
        assert_eq!((base.uv_set, base.wrap), (1, [Wrap::Clamp, Wrap::Mirror]));
        let moved = base.transform;
        assert_eq!((moved.offset, moved.scale), (Vec2::new(0.25, 0.5), Vec2::new(2.0, -1.0)));
        assert_eq!(moved.rotation_radians, 0.5);
        assert_eq!(material.metallic_roughness_texture.unwrap().uv_set, 1);
        let image = &authored.images[base.image as usize];
        assert_eq!((image.name.as_str(), image.width, image.height), ("dots", 2, 1));
        assert_eq!(image.rgba, [255, 0, 0, 128, 10, 20, 30, 255]);
        let first = head.mesh.triangles[head.mesh.parts[1].triangles.start as usize][0];
        assert_eq!(authored.second_uv(first), Vec2::new(0.5, 0.0));
        assert_eq!(authored.color_linear(first), [1.0, 0.5, 0.25, 1.0]);
    }
    // Once more: nothing wears off.
    assert_eq!(to_bytes(&own.head, &Options::default()).unwrap(), bytes);
}

#[test]
fn names_of_materials_meshes_and_nodes_tell_what_a_part_is() {
    let plain = json!([{"name": "lambert1"}, {"name": "skin"}]);
    let parts =
        [("eyeLeft", Some(0)), ("teeth", Some(0)), ("Cube", Some(1)), ("Torus", Some(0)), ("hairband", None)];
    let imported = import(&document(&parts, plain));
    let expected = [Material::Eye, Material::Teeth, Material::Skin, Material::Other, Material::Other];
    assert_eq!(kinds(&imported), expected);
    says(&imported, "keep the look of their author", "lambert1");
}

#[test]
fn textured_parts_keep_their_look() {
    let textured =
        |name: &str| json!({"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let materials = json!([textured("eye"), textured("teeth"), textured("skin"), textured("eyeshadow")]);
    let parts = [("a", Some(0)), ("b", Some(1)), ("c", Some(2)), ("d", Some(3))];
    let imported = import(&document(&parts, materials));
    // Skin keeps its colour in a way of its own.
    assert_eq!(kinds(&imported), [Material::Other, Material::Other, Material::Skin, Material::Hidden]);
    says(&imported, "keep the look of their author", "teeth");
}

#[test]
fn clear_shells_before_eyes_are_not_eyes() {
    let plain = |alpha: f32, mode: &str| {
        let color = [1.0, 1.0, 1.0, alpha];
        json!({"name": "lambert1", "alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": color}})
    };
    let materials = json!([plain(1.0, "OPAQUE"), plain(0.1, "BLEND"), plain(0.9, "BLEND")]);
    let parts = [("eyeLeft", Some(0)), ("eyeLeftOuter", Some(1)), ("eyeRight", Some(2))];
    let imported = import(&document(&parts, materials));
    assert_eq!(kinds(&imported), [Material::Eye, Material::Other, Material::Eye]);
    says(&imported, "clear shells of eyes", "lambert1");
}

#[test]
fn textured_skin_keeps_its_colour_in_own_files() {
    let textured = json!([{
        "name": "Wolf3D_Skin", "alphaMode": "MASK",
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": 0}},
    }]);
    let mut foreign = import(&document(&[("Wolf3D_Head", Some(0))], textured));
    foreign.head.authored.colors_linear.clear();
    // The texture has two texels, and the triangle shows both.
    let notes = own_color::adopt(&mut foreign.head, &own_color::Options::default()).unwrap();
    assert!(notes.iter().any(|n| n.to_string().contains("own colour")), "{notes:?}");
    let bytes = to_bytes(&foreign.head, &Options::default()).unwrap();
    let own = from_bytes(&bytes, Path::new("own.glb")).unwrap();
    for head in [&foreign.head, &own.head] {
        assert_eq!(head.mesh.parts[0].material, Material::Skin);
        let albedo = head.maps.albedo.as_ref().unwrap();
        let codes: Vec<u8> = albedo.values.iter().map(|v| (srgb_encode(*v) * 255.0).round() as u8).collect();
        assert_eq!(codes, [255, 0, 0, 10, 20, 30]);
        // Its alpha of 128 is above the cutoff: there are no holes.
        assert_eq!(head.hole_material(0), None);
    }
    assert_eq!(own.head.maps.albedo, foreign.head.maps.albedo);
    // Other viewers show that very picture: the document holds it once.
    let document = gltf::Gltf::from_slice(&bytes).unwrap();
    let material = document.materials().next().unwrap();
    let shown =
        material.pbr_metallic_roughness().base_color_texture().unwrap().texture().source().unwrap().index();
    let extension = document.document.into_json().extensions.unwrap();
    let text = serde_json::to_value(extension).unwrap();
    assert_eq!(text["RUBOR_facial_appearance"]["maps"]["albedo"]["image"], json!(shown));
    assert_eq!(to_bytes(&own.head, &Options::default()).unwrap(), bytes);
}

#[test]
fn level_skin_stays_level_beside_steep_relief() {
    let textured = json!([{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let mut head = import(&document(&[("head", Some(0))], textured)).head;
    own_color::adopt(&mut head, &own_color::Options::default()).unwrap();
    let slopes = vec![-18.3, 0.0, 0.0, 0.0, 3.6, 19.9, 0.0, -16.6];
    head.maps.slopes = Some(Map { width: 4, height: 1, channels: 2, values: slopes.clone() });
    for maps in [MapEncodings::default(), MapEncodings::small()] {
        let bytes = to_bytes(&head, &Options { maps, ..Options::default() }).unwrap();
        let read = from_bytes(&bytes, Path::new("own.glb")).unwrap().head.maps.slopes.unwrap();
        let off =
            read.values.iter().zip(&slopes).map(|(a, b): (&f32, &f32)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 5e-4, "{off}: {:?}", read.values);
    }
}

#[test]
fn holes_of_skin_stay_in_own_files() {
    let textured = json!([{
        "name": "skin", "alphaMode": "MASK", "alphaCutoff": 0.75,
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": 0}},
    }]);
    let mut foreign = import(&document(&[("head", Some(0))], textured));
    own_color::adopt(&mut foreign.head, &own_color::Options::default()).unwrap();
    let bytes = to_bytes(&foreign.head, &Options::default()).unwrap();
    let own = from_bytes(&bytes, Path::new("own.glb")).unwrap();
    for head in [&foreign.head, &own.head] {
        assert_eq!((head.mesh.parts[0].material, head.authored_material(0)), (Material::Skin, None));
        let material = &head.authored.materials[head.hole_material(0).unwrap() as usize];
        assert_eq!(material.alpha, AlphaMode::Mask { cutoff: 0.75 });
        assert!(material.base_color_texture.is_some());
    }
    assert_eq!(to_bytes(&own.head, &Options::default()).unwrap(), bytes);
}

#[test]
fn a_head_that_no_name_tells_is_not_made_skin() {
    let imported = import(&document(&[("Object_7", Some(0))], json!([{"name": "Material.001"}])));
    assert_eq!(kinds(&imported), [Material::Other]);
    assert_eq!(imported.head.authored_material(0), Some(0));
    assert!(imported.notes.iter().any(|n| n.message.contains("--parts NAME=skin")), "{:?}", imported.notes);
    // A mesh without any material has no look to keep.
    let bare = import(&document(&[("Object_7", None)], json!([])));
    assert_eq!(kinds(&bare), [Material::Skin]);
    says(&bare, "are taken for skin", "Object_7");
}

#[test]
fn what_cannot_be_read_is_said() {
    let material = json!({
        "name": "odd", "alphaMode": "BLEND",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 1}, "metallicRoughnessTexture": {"index": 2}, "roughnessFactor": 7.0,
        },
        "normalTexture": {"index": 99}, "occlusionTexture": {"index": 0, "texCoord": 2},
        "extensions": {
            "KHR_materials_sheen": {"sheenRoughnessFactor": 1.0}, "KHR_materials_ior": {"ior": 0.5},
            "KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatNormalTexture": {"index": 0}},
        },
    });
    let imported = import(&document(&[("Torus", Some(0))], json!([material])));
    says(&imported, "picture cannot be read", "material 0, base colour (image 1: ");
    says(&imported, "ACME_texture_paint", "material 0, metallic-roughness");
    says(&imported, "textures that do not exist", "material 0, normal");
    says(&imported, "third set", "material 0, occlusion");
    says(&imported, "are clamped", "material 0 (7.0)");
    says(&imported, "KHR_materials_sheen is not drawn", "material 0");
    says(&imported, "normal maps of clear coats", "material 0");
    says(&imported, "are clamped", "material 0 (0.5)");
    let material = &imported.head.authored.materials[0];
    assert!(material.textures().iter().all(|(_, t)| t.is_none()));
    assert_eq!((material.ior, material.clearcoat), (1.0, 1.0));
    assert_eq!((material.roughness, material.alpha), (1.0, AlphaMode::Blend));
}
