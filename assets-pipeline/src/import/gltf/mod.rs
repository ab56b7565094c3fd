//! Heads from glTF 2.0 files: those that rubor wrote, and foreign ones with morph targets.
//!
//! ```text
//! .glb, .gltf, .vrm + buffers --document, decompressed--> accessors --> primitives of every mesh node
//!   own file (RUBOR_facial_appearance): points, parts, maps as stored
//!   foreign file: node transforms applied, shapes united where names and weights agree, points welded by distance and
//!                 angle, parts recognised by names; all others keep the material of their author
//! first animation --channels--> tracks by node; default weights where nothing is keyed
//! ```
//!
//! File contents are not trusted: every range is checked before it is read.

mod accessor;
mod channels;
mod compressed;
mod document;
mod foreign;
mod head_joints;
mod lint;
mod materials;
mod motion;
mod names;
mod own;
mod placement;
mod recovered;
mod shapes;
mod vrm;
mod weld;

use std::path::Path;

use rubor_rig::head::Head;
use rubor_rig::limits;
use rubor_rig::timeline::Sequence;

use self::document::Document;
pub use self::lint::lint;
use self::motion::Motion;
use crate::error::ImportError;
use crate::facial_appearance::NAME;
use crate::notes::{Note, Notes};

/// A head and the other contents of its file.
#[derive(Clone, Debug, Default)]
pub struct ImportedHead {
    /// The head, validated.
    pub head: Head,
    /// The rig file that the head carries.
    pub rig: Option<serde_json::Value>,
    /// The sequence file that its animation was made from.
    pub sequence: Option<serde_json::Value>,
    /// Its first animation that moves the head, as tracks that other programs keyed. Default weights of meshes and
    /// nodes are constant tracks, also without an animation.
    pub animation: Option<Sequence>,
    /// Where in the file its parts were, and what belongs to a head of a whole figure.
    pub extent: Extent,
    /// Notes on everything that was left out, guessed or repaired.
    pub notes: Vec<Note>,
}

/// What a file says about parts and vertices of a head, to choose from them. Empty for heads that rubor wrote.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extent {
    /// Names of node and mesh of each part, `node|mesh`.
    pub meshes: Vec<String>,
    /// How much each vertex follows the joints of head and neck, 0 to 1; empty where the file has no such joints.
    pub head_share: Vec<f32>,
}

/// Reads a `.glb`, `.gltf` or `.vrm`. Buffers and images may be in the file, in data URIs, or in files of the same folder or
/// below; other places are refused.
///
/// # Errors
/// Unreadable or broken files, unsupported features that the file requires, no mesh, a head that breaks its rules.
pub fn read(path: &Path) -> Result<ImportedHead, ImportError> {
    let bytes = limits::read(path).map_err(ImportError::read(path))?;
    from_bytes(&bytes, path)
}

/// Reads from memory, such as a head embedded in a program. `path` is for messages and for the folder of external files.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<ImportedHead, ImportError> {
    let mut notes = Notes::default();
    let document = Document::load(bytes, path, &mut notes)?;
    let motion = Motion::read(&document, &mut notes);
    let extension = document.gltf.extension_value(NAME).cloned();
    let extension = extension.or_else(|| recovered::extension(&document, &mut notes));
    let (mut imported, shapes) = match &extension {
        Some(extension) => own::read(&document, extension, &motion, &mut notes)?,
        None => {
            let read = foreign::read(&document, &motion, &mut notes)?;
            let mut head = read.head;
            let rig = vrm::rig(&document, &read.instances, &head, &mut notes);
            vrm::turn(&document, &mut head, &mut notes);
            let rig = rig.and_then(|rig| serde_json::to_value(rig).ok());
            (ImportedHead { head, rig, extent: read.extent, ..ImportedHead::default() }, read.shapes)
        }
    };
    imported.head.validate()?;
    imported.animation = motion.sequence(&document, shapes, &mut notes);
    imported.notes = notes.into_vec();
    Ok(imported)
}
