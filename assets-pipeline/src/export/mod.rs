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

use rubor_rig::head::Head;

use crate::error::ExportError;

pub use self::image_codec::TextureFormat;
pub use self::performance::{Performance, top_shapes};

/// Writes a file that appears only when it is complete (see [`crate::files::replace`]).
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    crate::files::replace(path, bytes).map_err(|source| ExportError::Write { path: path.to_owned(), source })
}

/// What a format without authored materials has to say about a head; `None` where it has none.
pub fn authored_lost(head: &Head, format: &str) -> Option<String> {
    let parts = head.mesh.parts.iter().enumerate().filter(|(i, _)| head.authored_material(*i).is_some());
    let names: Vec<&str> = parts.map(|(_, part)| part.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "materials of authors are written to {format} as one colour, without textures, alpha and emission; the .glb \
             keeps them: {}",
            names.join(", ")
        )
    })
}
