//! meshopt, Draco, quantisation and Basis Universal.

use std::path::Path;

use glam::{Vec2, Vec3};
use rubor_assets::import::gltf::{ImportedHead, from_bytes};
use rubor_rig::head::Head;
use serde_json::json;

use super::support::{Face, base64, face_document};
use super::{data, says, says_nothing};

/// Half a step of 14 bits over the 0.25 m of the sheet, in three directions, and as much for what f32 rounds.
const POSITION_METRES: f32 = 4e-5;
/// Half a step of 12 bits.
const UV: f32 = 1.3e-4;

fn read(name: &str) -> ImportedHead {
    from_bytes(&data(name), Path::new(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// Position, texture coordinate and offsets by each shape, of each vertex.
fn vertices(head: &Head) -> Vec<(Vec3, Vec2, Vec<Vec3>)> {
    let offset = |shape: usize, point: u32| {
        let shape = &head.shapes[shape];
        shape.points.binary_search(&point).map_or(Vec3::ZERO, |i| shape.offsets[i])
    };
    let of = |v: &rubor_rig::head::Vertex| {
        let offsets = (0..head.shapes.len()).map(|s| offset(s, v.point)).collect();
        (head.mesh.points[v.point as usize], v.uv, offsets)
    };
    head.mesh.vertices.iter().map(of).collect()
}

#[test]
fn compressed_heads_are_the_same_heads() {
    let plain = read("plain.glb");
    let expected = vertices(&plain.head);
    for name in ["meshopt.glb", "draco.glb", "pack.glb", "packz.glb"] {
        let imported = read(name);
        says_nothing(&imported, "not read");
        let head = &imported.head;
        assert_eq!(head.mesh.triangles.len(), plain.head.mesh.triangles.len(), "{name}");
        let names = |head: &Head| head.shapes.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(head), ["jawOpen", "browOuterUpLeft"], "{name}");
        let found = vertices(head);
        assert_eq!(found.len(), expected.len(), "{name}");
        for (position, uv, offsets) in &found {
            let nearest = expected
                .iter()
                .min_by(|a, b| a.0.distance_squared(*position).total_cmp(&b.0.distance_squared(*position)));
            let (place, coordinate, moved) = nearest.expect("a vertex");
            assert!(place.distance(*position) < POSITION_METRES, "{name}: {position} {place}");
            assert!((*coordinate - *uv).abs().max_element() < UV, "{name}: {uv} {coordinate}");
            for (a, b) in offsets.iter().zip(moved) {
                assert!(a.distance(*b) < POSITION_METRES, "{name}: {a} {b}");
            }
        }
        // The same triangles: the centre of each is that of one of the plain sheet.
        let centers = |head: &Head| -> Vec<Vec3> {
            let at = |v: &u32| head.mesh.points[head.mesh.vertices[*v as usize].point as usize];
            head.mesh.triangles.iter().map(|t| t.iter().map(at).sum::<Vec3>() / 3.0).collect()
        };
        let of_plain = centers(&plain.head);
        for center in centers(head) {
            let distance = of_plain.iter().map(|c| c.distance(center)).fold(f32::MAX, f32::min);
            assert!(distance < POSITION_METRES, "{name}: a triangle at {center}");
        }
        let material = &head.authored.materials[0];
        assert!((material.roughness - 0.6).abs() < 1e-6 && material.metallic == 0.0, "{name}");
        let texture = material.base_color_texture.expect("a texture");
        assert_eq!(texture.transform, Default::default(), "{name}: coordinates are those of the picture");
        assert_eq!(head.authored.images, plain.head.authored.images, "{name}");
    }
}

#[test]
fn pictures_of_basis_universal_are_those_of_their_source() {
    // Blocks of 4 x 4 texels, 7 grey levels of 255 in the mean where only two colours fit one (ETC1S).
    let source = image::load_from_memory(&data("gradient.png")).expect("a PNG").into_rgba8();
    for (file, most) in [("etc1s.ktx2", 14.0), ("uastc.ktx2", 2.5), ("uastc_stored.ktx2", 2.5)] {
        let uri = format!("data:image/ktx2;base64,{}", base64(&data(file)));
        let document = face_document(|d, _, _| {
            d["images"] = json!([{ "uri": uri, "mimeType": "image/ktx2" }]);
            d["textures"] = json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }]);
            d["materials"] =
                json!([{ "name": "Paint", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
            d["meshes"][0]["primitives"][0]["material"] = json!(0);
            d["extensionsUsed"] = json!(["KHR_texture_basisu"]);
            d["extensionsRequired"] = json!(["KHR_texture_basisu"]);
        });
        let imported = from_bytes(document.to_string().as_bytes(), Path::new("a.gltf")).unwrap();
        let picture =
            imported.head.authored.images.first().unwrap_or_else(|| panic!("{:#?}", imported.notes));
        assert_eq!((picture.width, picture.height), source.dimensions(), "{file}");
        let off = picture.rgba.iter().zip(source.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let mean = off.sum::<f64>() / picture.rgba.len() as f64;
        assert!(mean < most, "{file}: {mean}");
    }
}

#[test]
fn a_picture_that_cannot_be_decoded_has_a_plain_copy() {
    let mut broken = data("etc1s.ktx2");
    broken.truncate(broken.len() - 60);
    let document = face_document(|d, _, _| {
        let uri = |kind: &str, bytes: &[u8]| format!("data:image/{kind};base64,{}", base64(bytes));
        d["images"] = json!([{ "uri": uri("ktx2", &broken) }, { "uri": uri("png", &data("gradient.png")) }]);
        d["textures"] = json!([{ "source": 1, "extensions": { "KHR_texture_basisu": { "source": 0 } } }]);
        d["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
        d["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let imported = from_bytes(document.to_string().as_bytes(), Path::new("a.gltf")).unwrap();
    says(&imported, "plain copy", "material 0, base colour");
    assert_eq!(imported.head.authored.images[0].width, 12);
}

#[test]
fn draco_meshes_of_its_own_encoder_come_back() {
    use draco_core::{
        DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder,
        PointAttribute, PointIndex,
    };
    let face = Face::new();
    let mut mesh = Mesh::new();
    mesh.set_num_points(face.positions.len());
    mesh.set_num_faces(face.indices.len() / 3);
    for (f, t) in face.indices.chunks_exact(3).enumerate() {
        mesh.set_face(FaceIndex(f as u32), [PointIndex(t[0]), PointIndex(t[1]), PointIndex(t[2])]);
    }
    let mut positions = PointAttribute::new();
    positions.init(GeometryAttributeType::Position, 3, DataType::Float32, false, face.positions.len());
    positions.buffer_mut().update_f32s_le(0, face.positions.as_flattened());
    let position = mesh.add_attribute(positions);
    let mut options = EncoderOptions::new();
    // In order, so that morph targets fit.
    options.set_encoding_method(0);
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut out = EncoderBuffer::new();
    encoder.encode(&options, &mut out).expect("an encoded mesh");
    let document = face_document(|d, pieces, accessors| {
        let view = pieces.view(out.data(), None);
        let position_only = pieces.accessors[accessors.position].as_object_mut().expect("an accessor");
        position_only.remove("bufferView");
        let primitive = &mut d["meshes"][0]["primitives"][0];
        primitive["extensions"] = json!({ "KHR_draco_mesh_compression": { "bufferView": view,
            "attributes": { "POSITION": position } } });
        d["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
        d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    });
    let imported = from_bytes(document.to_string().as_bytes(), Path::new("a.gltf")).unwrap();
    let plain = from_bytes(face_document(|_, _, _| {}).to_string().as_bytes(), Path::new("a.gltf")).unwrap();
    assert_eq!(imported.head.mesh, plain.head.mesh, "floats without quantisation come back bit for bit");
    assert_eq!(imported.head.shapes, plain.head.shapes);
}
