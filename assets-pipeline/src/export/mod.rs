//! Heads to files.

pub mod curves;
pub mod gltf;
mod image_codec;
mod performance;
mod pictures;
pub mod skin_color;
pub mod usd;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::ExportError;

pub use self::image_codec::TextureFormat;
pub use self::performance::{Performance, top_shapes};

/// Writes to a temporary name beside the file and renames, so that a killed run leaves no half file.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let part: PathBuf = path.with_file_name(name);
    let result = fs::File::create(&part)
        .and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all()))
        .and_then(|()| fs::rename(&part, path));
    result.map_err(|source| {
        let _ = fs::remove_file(&part);
        ExportError::Write { path: path.to_owned(), source }
    })
}
