//! A head from a file of any kind that is read.

use std::path::Path;

use super::gltf::{self, ImportedHead};
use super::{obj_file, usd};
use crate::error::ImportError;

/// Names of files that [`from_bytes`] reads end so.
pub const EXTENSIONS: [&str; 6] = ["glb", "gltf", "vrm", "obj", "usda", "usdz"];

/// Reads a head from memory: by its name where that ends in `.obj`, `.usda`, `.usd`, `.usdc` or `.usdz`, else as glTF.
/// `path` is for messages and finds the files beside it.
///
/// # Errors
/// As the reader of its kind.
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<ImportedHead, ImportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "obj" => obj_file::from_bytes(bytes, path),
        "usda" | "usd" | "usdc" | "usdz" => usd::from_bytes(bytes, path),
        _ => gltf::from_bytes(bytes, path),
    }
}
