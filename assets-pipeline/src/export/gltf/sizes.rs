//! What the contents of a written `.glb` take.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

/// Bytes of the contents of a file of [`super::export()`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Of each shape by its name: offsets, normals and colours of all parts, and changes of ambient visibility.
    pub shapes: BTreeMap<String, u64>,
    /// Of each image by its name.
    pub images: BTreeMap<String, u64>,
    /// Of each part, in order: vertices, triangles and its share of shapes.
    pub parts: Vec<u64>,
}

/// Reads the sizes of a `.glb` that [`super::export()`] wrote; none of what it does not find.
pub fn sizes(glb: &[u8]) -> Sizes {
    document(glb).map(|document| of_document(&document)).unwrap_or_default()
}

/// The JSON of a `.glb`: after 12 bytes of header, 8 bytes of length and kind.
fn document(glb: &[u8]) -> Option<Value> {
    let length = u32::from_le_bytes(glb.get(12..16)?.try_into().ok()?) as usize;
    serde_json::from_slice(glb.get(20..20 + length)?).ok()
}

fn of_document(document: &Value) -> Sizes {
    let view = |index: &Value| -> u64 {
        let view = index.as_u64().map(|i| &document["bufferViews"][i as usize]);
        view.and_then(|v| v["byteLength"].as_u64()).unwrap_or(0)
    };
    let accessor = |index: &u64| -> u64 {
        let accessor = &document["accessors"][*index as usize];
        let sparse = &accessor["sparse"];
        view(&accessor["bufferView"])
            + view(&sparse["indices"]["bufferView"])
            + view(&sparse["values"]["bufferView"])
    };
    let of = |accessors: &BTreeSet<u64>| accessors.iter().map(accessor).sum::<u64>();
    let numbers = |object: &Value| -> Vec<u64> {
        object.as_object().into_iter().flatten().filter_map(|(_, i)| i.as_u64()).collect()
    };
    let mesh = &document["meshes"][0];
    let names: Vec<&str> =
        mesh["extras"]["targetNames"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    // Accessors may be shared.
    let mut of_shapes: BTreeMap<&str, BTreeSet<u64>> = BTreeMap::new();
    let mut parts = Vec::new();
    for primitive in mesh["primitives"].as_array().into_iter().flatten() {
        let mut of_part: BTreeSet<u64> = numbers(&primitive["attributes"]).into_iter().collect();
        of_part.extend(primitive["indices"].as_u64());
        for (target, name) in primitive["targets"].as_array().into_iter().flatten().zip(&names) {
            let accessors = numbers(target);
            of_part.extend(&accessors);
            of_shapes.entry(name).or_default().extend(accessors);
        }
        parts.push(of(&of_part));
    }
    let occlusion = &document["extensions"][crate::facial_appearance::NAME]["shapeOcclusion"];
    for entry in occlusion.as_array().into_iter().flatten() {
        if let Some(name) = entry["shape"].as_str() {
            let accessors = ["points", "changes"].iter().filter_map(|key| entry[key].as_u64());
            of_shapes.entry(name).or_default().extend(accessors);
        }
    }
    let image = |image: &Value| Some((image["name"].as_str()?.to_owned(), view(&image["bufferView"])));
    Sizes {
        shapes: of_shapes.iter().map(|(name, all)| ((*name).to_owned(), of(all))).collect(),
        images: document["images"].as_array().into_iter().flatten().filter_map(image).collect(),
        parts,
    }
}
