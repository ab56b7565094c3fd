//! Heads, rigs and sequences: from the files that the arguments name, or those built in.

use std::path::Path;

use rubor_assets::import;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::lights::{LIGHT_RIGS, light_rig};
use rubor_rig::timeline::Sequence;

use crate::failure::{Failure, Outcome};

/// The head that ships with rubor (see assets/README.md).
const DEFAULT_HEAD: &[u8] = include_bytes!("../../assets/head.glb");

/// A head with the rig that its file carries.
pub(crate) struct LoadedHead {
    pub(crate) head: Head,
    pub(crate) rig: Option<Rig>,
    /// The sequence that its animation was made from.
    pub(crate) sequence: Option<Sequence>,
    /// What its animation holds.
    pub(crate) animation: Option<Sequence>,
    /// Changes with any byte of the file.
    pub(crate) fingerprint: u64,
}

/// The head of a file, or the built-in one.
pub(crate) fn head(path: Option<&Path>) -> Outcome<LoadedHead> {
    let name = path.unwrap_or(Path::new("built-in head"));
    let bytes = match path {
        None => std::borrow::Cow::Borrowed(DEFAULT_HEAD),
        Some(path) => {
            require_file(path, "a head (.glb or .gltf)")?;
            let read = std::fs::read(path);
            read.map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))?.into()
        }
    };
    let imported = import::gltf::from_bytes(&bytes, name)?;
    let rig = match imported.rig {
        None => None,
        Some(value) => {
            let at = format!("{} (rig)", name.display());
            Some(Rig::from_json(&at, &value.to_string())?)
        }
    };
    let sequence = match imported.sequence {
        None => None,
        Some(value) => {
            let at = format!("{} (sequence)", name.display());
            Some(Sequence::from_json(&at, &value.to_string())?)
        }
    };
    Ok(LoadedHead {
        head: imported.head,
        rig,
        sequence,
        animation: imported.animation,
        fingerprint: fingerprint(&bytes),
    })
}

/// FNV-1a: the same on every machine and in every version.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The rig of a file, else the head's own, else the default one for ARKit names.
pub(crate) fn rig(path: Option<&Path>, of_head: Option<Rig>) -> Outcome<Rig> {
    match (path, of_head) {
        (Some(path), _) => {
            require_file(path, "a rig (.json)")?;
            Ok(Rig::load(path)?)
        }
        (None, Some(rig)) => Ok(rig),
        (None, None) => Ok(Rig::default_rig()?),
    }
}

/// The sequence of a file, or the demo.
pub(crate) fn sequence(path: Option<&Path>) -> Outcome<Sequence> {
    match path {
        Some(path) => {
            require_file(path, "a sequence (.json)")?;
            let mut sequence = Sequence::load(path)?;
            let folder = path.parent().unwrap_or(Path::new(""));
            if let Some(report) = import::capture::load_into(&mut sequence, folder)? {
                for note in &report.notes {
                    eprintln!("note: {}: capture: {note}", path.display());
                }
                if !report.unmapped.is_empty() {
                    let names = report.unmapped.join(", ");
                    eprintln!("note: {}: capture: no shape is known for {names}", path.display());
                }
            }
            Ok(sequence)
        }
        None => Ok(Sequence::demo()?),
    }
}

/// A built-in light rig, or the sequence of a file for its lights.
pub(crate) fn lights(name: &str) -> Outcome<Sequence> {
    if let Some(rig) = light_rig(name) {
        return Ok(rig?);
    }
    let path = Path::new(name);
    if path.is_file() {
        return Ok(Sequence::load(path)?);
    }
    let names = LIGHT_RIGS.map(|r| r.0).join(", ");
    Err(Failure::input(format!("--lights: found {name:?}, expected {names}, or a sequence file")))
}

fn require_file(path: &Path, expected: &str) -> Outcome {
    if path.is_file() {
        return Ok(());
    }
    let found = if path.is_dir() { "a folder" } else { "no such file" };
    Err(Failure::input(format!("{}: found {found}, expected {expected}", path.display())))
}

/// `640x480`.
pub(crate) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("found {text:?}, expected WIDTHxHEIGHT in pixels, such as 640x640");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let size = [w.parse().map_err(|_| wrong())?, h.parse().map_err(|_| wrong())?];
    if size.contains(&0) {
        return Err(format!("found {text:?}, expected sides of at least 1 pixel"));
    }
    Ok(size)
}
