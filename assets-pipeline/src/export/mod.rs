//! Heads to files.

pub mod curves;
mod eye_mouth;
pub mod gltf;
mod image_codec;
mod performance;
mod pictures;
pub mod skin_color;
pub mod usd;

use std::path::Path;

use crate::error::ExportError;

pub use self::image_codec::TextureFormat;
pub use self::performance::{Performance, top_shapes};

/// Writes a file that appears only when it is complete (see [`crate::files::replace`]).
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    crate::files::replace(path, bytes).map_err(|source| ExportError::Write { path: path.to_owned(), source })
}
