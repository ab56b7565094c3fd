//! Files as other programs pack them, next to the same things without packing.

#[path = "../support/mod.rs"]
mod support;

mod broken;
mod compressed;
mod obj_materials;
mod usd;
mod vrm;

use rubor_assets::import::gltf::ImportedHead;

/// A fixture; `data/make.mjs` says how all were made.
fn data(name: &str) -> Vec<u8> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats/data").join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Asserts that a note of these words names a place.
fn says(imported: &ImportedHead, message: &str, place: &str) {
    let found = (imported.notes.iter()).any(|n| {
        n.message.contains(message)
            && (place.is_empty() && n.places.is_empty() || n.places.iter().any(|p| p.contains(place)))
    });
    assert!(found, "{message:?} at {place:?} in {:#?}", imported.notes);
}

fn says_nothing(imported: &ImportedHead, message: &str) {
    assert!(imported.notes.iter().all(|n| !n.message.contains(message)), "{:#?}", imported.notes);
}
