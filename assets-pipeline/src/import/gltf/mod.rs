//! Heads from glTF 2.0 files: those that rubor wrote, and foreign ones with morph targets.
//!
//! ```text
//! .glb or .gltf + buffers --document--> accessors --> primitives of every mesh node
//!   own file (RUBOR_facial_appearance): points, parts, maps as stored
//!   foreign file: node transforms applied, shapes united by name, points welded, materials guessed from names
//! ```
//!
//! Nothing in a file is trusted: every range is checked before it is read.

mod accessor;
mod document;
mod foreign;
mod lint;
mod motion;
mod own;
mod placement;

use std::fs;
use std::path::Path;

use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;

use self::document::Document;
pub use self::lint::lint;
use crate::error::ImportError;
use crate::facial_appearance::NAME;

/// A head and what its file holds beside it.
#[derive(Clone, Debug, Default)]
pub struct ImportedHead {
    /// The head, validated.
    pub head: Head,
    /// The rig file that the head carries.
    pub rig: Option<serde_json::Value>,
    /// The sequence file that its animation was made from.
    pub sequence: Option<serde_json::Value>,
    /// Its first animation as tracks: what other programs keyed.
    pub animation: Option<Sequence>,
}

/// Reads a `.glb` or `.gltf`. Buffers and images may be in the file, in data URIs, or in files of the same folder or
/// below; other places are refused.
///
/// # Errors
/// Unreadable or broken files, unsupported features that the file requires, no mesh, a head that breaks its rules.
pub fn read(path: &Path) -> Result<ImportedHead, ImportError> {
    let bytes = fs::read(path).map_err(ImportError::read(path))?;
    from_bytes(&bytes, path)
}

/// Reads from memory, such as a head embedded in a program. `path` is for messages and for the folder of external files.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<ImportedHead, ImportError> {
    let document = Document::load(bytes, path)?;
    let mut imported = match document.gltf.extension_value(NAME) {
        Some(extension) => own::read(&document, extension)?,
        None => ImportedHead { head: foreign::read(&document)?, ..ImportedHead::default() },
    };
    imported.head.validate()?;
    imported.animation = motion::read(&document)?;
    Ok(imported)
}
