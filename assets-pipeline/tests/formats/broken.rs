//! Broken packed data: errors or notes, never a panic or memory for what a header claims.

use std::path::Path;

use rubor_assets::import::gltf::from_bytes;
use rubor_assets::import::{file, picture::Gallery};
use rubor_rig::random::SplitMix64;
use serde_json::{Value, json};

use super::data;

/// The JSON and the binary chunk of a GLB.
fn chunks(glb: &[u8]) -> (Value, Vec<u8>) {
    let file = gltf::binary::Glb::from_slice(glb).expect("a GLB");
    (serde_json::from_slice(&file.json).expect("JSON"), file.bin.expect("data").into_owned())
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let json = json.to_string().into_bytes().into();
    gltf::binary::Glb { header, json, bin: Some(bin.to_vec().into()) }.to_vec().expect("memory")
}

#[test]
fn claims_of_headers_are_refused_in_words() {
    let (json, bin) = chunks(&data("pack.glb"));
    let view = json["bufferViews"].as_array().expect("views").iter().position(|v| !v["extensions"].is_null());
    let view = view.expect("a compressed view");
    for (key, value, words) in [
        ("count", json!(1_u64 << 40), "at most"),
        ("count", json!(100_000_000), "at most"),
        ("count", json!(20_000), "fewer bytes"),
        ("byteStride", json!(7), "7 bytes"),
        ("byteLength", json!(5), "meshopt"),
        ("mode", json!("PAINT"), "PAINT"),
        ("filter", json!("BLUR"), "BLUR"),
        ("buffer", json!(77), "a place inside its buffer"),
    ] {
        let mut json = json.clone();
        json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value.clone();
        let error = from_bytes(&glb(&json, &bin), Path::new("a.glb")).expect_err(key).to_string();
        assert!(error.contains(words) && error.contains("bufferView"), "{key} {value}: {error}");
    }
    let (mut json, bin) = chunks(&data("draco.glb"));
    json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["NORMAL"] =
        json!(9);
    let error = from_bytes(&glb(&json, &bin), Path::new("a.glb")).expect_err("no attribute").to_string();
    assert!(error.contains("NORMAL") && error.contains("mesh 0, primitive 0"), "{error}");
}

#[test]
fn data_that_are_cut_off_or_changed_are_errors() {
    let mut random = SplitMix64::new(17);
    for name in ["meshopt.glb", "pack.glb", "packz.glb", "draco.glb"] {
        let (json, bin) = chunks(&data(name));
        let mut refused = 0;
        for turn in 0..150 {
            let mut bin = bin.clone();
            match turn % 3 {
                0 => {
                    let start = random.below(bin.len());
                    bin[start..].fill(0);
                }
                _ => (0..=random.below(4)).for_each(|_| {
                    let at = random.below(bin.len());
                    bin[at] = random.bits() as u8;
                }),
            }
            match from_bytes(&glb(&json, &bin), Path::new("a.glb")) {
                Ok(imported) => imported.head.validate().expect("a valid head"),
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 20, "{name}: {refused} of 150");
    }
}

#[test]
fn pictures_that_are_cut_off_or_changed_are_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = SplitMix64::new(23);
    for name in ["etc1s.ktx2", "uastc.ktx2", "uastc_stored.ktx2"] {
        let whole = data(name);
        let mut refused = 0;
        for turn in 0..400_usize {
            let mut bytes = whole.clone();
            if turn < whole.len() {
                bytes.truncate(turn);
            } else {
                (0..=random.below(3)).for_each(|_| {
                    let at = random.below(bytes.len());
                    bytes[at] = random.bits() as u8;
                });
            }
            std::fs::write(folder.path().join("a.ktx2"), &bytes).expect("a file");
            refused += usize::from(Gallery::default().file(folder.path(), "a.ktx2").is_err());
        }
        assert!(refused > 200, "{name}: {refused}");
    }
    let mut gallery = Gallery::default();
    assert!(gallery.file(folder.path(), "none.png").expect_err("missing").contains("none.png"));
    // A PNG that claims 60 000 x 60 000 texels.
    let mut png = data("gradient.png");
    png[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    let crc = flate2::Crc::new();
    let mut crc = crc;
    crc.update(&png[12..29]);
    png[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    std::fs::write(folder.path().join("huge.png"), &png).expect("a file");
    assert!(gallery.file(folder.path(), "huge.png").expect_err("huge").contains("60000"));
}

#[test]
fn usd_and_obj_text_that_is_broken_is_refused() {
    for (name, text) in [
        (
            "a.usda",
            "#usda 1.0\ndef Mesh \"a\" { int[] faceVertexCounts = [3] int[] faceVertexIndices = [0, 1, 9] point3f[] points = [(0,0,0),(1,0,0),(0,1,0)] }",
        ),
        (
            "a.usda",
            "#usda 1.0\ndef Mesh \"a\" { int[] faceVertexCounts = [1e18, 1e19] int[] faceVertexIndices = [0] point3f[] points = [(0,0,0)] }",
        ),
        ("a.usda", "#usda 1.0\n"),
        ("a.usdc", "PXR-USDC\0\0"),
        ("a.usdz", "PK\u{3}\u{4} and nothing"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        ("a.obj", "v 0 0 0\n"),
        ("a.vrm", "glTF"),
        ("a.vrm", "{\"asset\": {\"version\": \"2.0\"}}"),
    ] {
        let error = file::from_bytes(text.as_bytes(), Path::new(name)).expect_err(text).to_string();
        assert!(error.contains(name) && error.contains("expected"), "{error}");
    }
}
