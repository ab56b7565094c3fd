//! Scenes to heads and sequences.

mod curve;
mod geometry;
pub(crate) mod head;
mod looks;
mod motion;
mod weight;

use std::path::{Path, PathBuf};

use rubor_rig::expression::Inbetween;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;

use crate::ascii::parser;
use crate::error::ReadError;

/// Parts of a scene to read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Only meshes whose path contains this, such as `|head_grp|`; by default all visible ones that are no targets.
    pub mesh: Option<String>,
}

/// A scene as rubor sees it.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Meshes and targets, metres.
    pub head: Head,
    /// Keyed weights and the motion of the head; none without keys.
    pub sequence: Option<Sequence>,
    /// In-between targets: their shapes are in the head, and a rig needs these entries.
    pub inbetweens: Vec<Inbetween>,
    /// The rig file that a scene of ours carries.
    pub rig: Option<serde_json::Value>,
    /// Notes on everything that was left out, guessed or repaired, and why: one line per kind, with a count and the
    /// first names.
    pub notes: Vec<String>,
}

/// Reads a Maya ASCII scene. Texture files that it names beside itself are read too.
///
/// # Errors
/// Unreadable file, broken statements, no mesh that can be read, a head that breaks a rule.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ReadError> {
    let bytes =
        rubor_rig::limits::read(path).map_err(|source| ReadError::Read { path: path.to_owned(), source })?;
    from_bytes(&bytes, path, options)
}

/// Reads a scene from memory. `path` names it in messages and finds the textures beside it.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path, options: &Options) -> Result<Imported, ReadError> {
    let scene = parser::parse(bytes).map_err(|fault| fault.of(path))?;
    let mut notes = scene.notes.clone();
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let built = head::build(&scene, options, &name, &folder, &mut notes).map_err(|fault| fault.of(path))?;
    built.head.validate()?;
    let sequence = motion::sequence(&scene, &built, &mut notes);
    let notes = notes.lines();
    Ok(Imported { head: built.head, sequence, inbetweens: built.inbetweens, rig: built.rig, notes })
}
