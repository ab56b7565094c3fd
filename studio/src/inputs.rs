//! Heads, rigs, sequences and lights: from files, or those built in.

use std::path::{Path, PathBuf};

use rubor_assets::convert::own_color;
use rubor_assets::{check, import, synthesize};
use rubor_renderer::MAX_HEADS;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::json;
use rubor_rig::lights::{LIGHT_RIGS, light_rig};
use rubor_rig::limits;
use rubor_rig::timeline::Sequence;

use crate::environment;
use crate::error::{Failure, Outcome};
use crate::job::{Fingerprint, InputFile, Lighting};
use crate::notes::Note;

/// The head that ships with rubor (see assets/README.md).
const DEFAULT_HEAD: &[u8] = include_bytes!("../../assets/head.glb");

/// A head with what its file carries.
#[derive(Clone, Debug)]
pub struct LoadedHead {
    /// The head.
    pub head: Head,
    /// Its rig.
    pub rig: Option<Rig>,
    /// The sequence that its animation was made from.
    pub sequence: Option<Sequence>,
    /// Contents of its animation.
    pub animation: Option<Sequence>,
    /// Source file and fingerprint.
    pub source: InputFile,
    /// Where its parts were in the file, and what belongs to the head of a whole figure.
    pub extent: import::gltf::Extent,
    /// What the reader left out, guessed or repaired.
    pub notes: Vec<Note>,
}

/// Refuses more heads than a frame has, before they take memory.
///
/// # Errors
/// More than [`MAX_HEADS`].
pub fn check_number_of_heads(count: usize) -> Outcome {
    if count > MAX_HEADS {
        return Err(Failure::input(format!("found {count} heads, expected at most {MAX_HEADS} in a frame")));
    }
    Ok(())
}

/// The head of a file (`.glb`, `.gltf`, `.vrm`, `.obj`, `.usda`, `.usdz`), or the built-in one. Textured skin of other
/// programs keeps its colour ([`keep_color`]).
///
/// # Errors
/// A file that is missing or that is no head.
pub fn head(path: Option<&Path>) -> Outcome<LoadedHead> {
    finished(plain_head(path)?, path.unwrap_or(Path::new(BUILT_IN)))
}

/// The head of a file in memory, as [`head`] would read it under this name.
///
/// # Errors
/// As [`head`].
pub fn head_of_bytes(bytes: &[u8], name: &Path) -> Outcome<LoadedHead> {
    finished(plain_head_of_bytes(bytes, name)?, name)
}

/// Bytes of the file of a head, or of the built-in one.
///
/// # Errors
/// The file is not there.
pub fn head_file_bytes(path: Option<&Path>) -> Outcome<u64> {
    match path {
        None => Ok(DEFAULT_HEAD.len() as u64),
        Some(path) => Ok(std::fs::metadata(path).map_err(|e| Failure::read(path, e))?.len()),
    }
}

/// Name of the built-in head in messages.
const BUILT_IN: &str = "built-in head";

fn finished(mut loaded: LoadedHead, name: &Path) -> Outcome<LoadedHead> {
    let about = name.display().to_string();
    loaded.notes.extend(keep_color(&mut loaded.head, &about, &own_color::Options::default())?);
    loaded.notes.extend(check::head::size(&loaded.head).map(|f| {
        let fix = f.fix.map(|fix| format!("; {fix}")).unwrap_or_default();
        Note::new(about.as_str(), f.message + &fix)
    }));
    Ok(loaded)
}

/// Textured skin of other programs becomes skin of its own colour, with notes about `name`.
///
/// # Errors
/// Options out of range.
pub fn keep_color(head: &mut Head, name: &str, options: &own_color::Options) -> Outcome<Vec<Note>> {
    let notes = own_color::adopt(head, options)?;
    Ok(notes.iter().map(|n| Note::new(name, n.to_string())).collect())
}

/// As [`head`], with the materials of other programs as they came, and without a word about its size.
///
/// # Errors
/// As [`head`].
pub fn plain_head(path: Option<&Path>) -> Outcome<LoadedHead> {
    let bytes = match path {
        None => std::borrow::Cow::Borrowed(DEFAULT_HEAD),
        Some(path) => {
            require_file(path, "a head (.glb, .gltf, .vrm, .obj, .usda or .usdz)")?;
            limits::read(path).map_err(|e| Failure::read(path, e))?.into()
        }
    };
    let loaded = plain_head_of_bytes(&bytes, path.unwrap_or(Path::new(BUILT_IN)))?;
    let file = path.map(absolute).transpose()?;
    Ok(LoadedHead { source: InputFile { file, ..loaded.source }, ..loaded })
}

fn plain_head_of_bytes(bytes: &[u8], name: &Path) -> Outcome<LoadedHead> {
    let imported = import::file::from_bytes(bytes, name)?;
    let about = name.display().to_string();
    let notes: Vec<Note> = imported.notes.iter().map(|n| Note::new(about.as_str(), n.to_string())).collect();
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
        extent: imported.extent,
        source: InputFile { file: None, fingerprint: Fingerprint::of(bytes) },
        notes,
    })
}

/// The rig of a file, else the head's own, else the default one for ARKit names.
///
/// # Errors
/// A file that is missing or that is no rig.
pub fn rig(path: Option<&Path>, of_head: Option<Rig>) -> Outcome<Rig> {
    match (path, of_head) {
        (Some(path), _) => {
            require_file(path, "a rig (.json)")?;
            Ok(Rig::load(path)?)
        }
        (None, Some(rig)) => Ok(rig),
        (None, None) => Ok(Rig::default_rig()?),
    }
}

/// The sequence of a file with the recording that it names, or the demo. The path of an environment is looked for in
/// the folder of the sequence and then in the working folder.
///
/// # Errors
/// A file that is missing or that is no sequence; a recording that does not load.
pub fn sequence(path: Option<&Path>) -> Outcome<(Sequence, Vec<Note>)> {
    let Some(path) = path else { return Ok((Sequence::demo()?, Vec::new())) };
    require_file(path, "a sequence (.json)")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    sequence_of_text(&path.display().to_string(), &json::read_text(path)?, folder)
}

/// As [`sequence`], of the text of a file in `folder`. `file` is the name that messages give it.
///
/// # Errors
/// As [`sequence`].
pub fn sequence_of_text(file: &str, text: &str, folder: &Path) -> Outcome<(Sequence, Vec<Note>)> {
    let mut sequence = Sequence::from_json(file, text)?;
    let mut notes = Vec::new();
    if let Some(report) = import::capture::load_into(&mut sequence, folder)? {
        notes.extend(report.notes.iter().map(|note| Note::new(file, format!("capture: {note}"))));
        if !report.unmapped.is_empty() {
            let names = report.unmapped.join(", ");
            notes.push(Note::new(file, format!("capture: no shape is known for {names}")));
        }
    }
    find_environment(&mut sequence, folder)?;
    Ok((sequence, notes))
}

/// A light rig by its name, or the lights of a sequence file.
///
/// # Errors
/// There is no light rig and no file of that name.
pub fn lights(name: &str) -> Outcome<Lighting> {
    let path = Path::new(name);
    let from = match light_rig(name) {
        Some(rig) => rig?,
        None if path.is_file() => {
            let mut sequence = Sequence::load(path)?;
            find_environment(&mut sequence, path.parent().unwrap_or(Path::new("")))?;
            sequence
        }
        None => {
            let names = LIGHT_RIGS.map(|r| r.0).join(", ");
            return Err(Failure::input(format!(
                "lights: found {name:?}, expected {names}, or a sequence file"
            )));
        }
    };
    Ok(Lighting { name: name.to_owned(), lights: from.lights, environment: from.environment })
}

/// A MakeHuman character with synthesised skin, with smaller maps than an imported one.
///
/// # Errors
/// Data that are missing or broken.
pub fn character(
    character: &import::makehuman::Character,
    data: &Path,
    step: &(impl Fn() + Sync),
) -> Outcome<LoadedHead> {
    let mut options = character.head();
    data.clone_into(&mut options.data);
    let mut head = import::makehuman::import(&options)?;
    let skin = synthesize::Options { resolution: CHARACTER_MAPS, ..character.skin() };
    synthesize::synthesize_into_with(&mut head, &skin, step).map_err(Failure::input)?;
    let source = InputFile { file: None, fingerprint: Fingerprint::of(character.name.as_bytes()) };
    let extent = import::gltf::Extent::default();
    Ok(LoadedHead { head, rig: None, sequence: None, animation: None, extent, source, notes: Vec::new() })
}

/// Side of the maps of a character, texels.
const CHARACTER_MAPS: u32 = 1024;

/// Makes the path of an environment absolute.
fn find_environment(sequence: &mut Sequence, folder: &Path) -> Outcome {
    let Some(environment) = &mut sequence.environment else { return Ok(()) };
    if environment::is_built_in(&environment.name) {
        return Ok(());
    }
    let beside = folder.join(&environment.name);
    let found = if beside.is_file() { &beside } else { Path::new(&environment.name) };
    if found.is_file() {
        environment.name = absolute(found)?.to_string_lossy().into_owned();
    }
    Ok(())
}

/// A path that means the same in any folder.
pub(crate) fn absolute(path: &Path) -> Outcome<PathBuf> {
    std::path::absolute(path).map_err(|e| Failure::read(path, e))
}

fn require_file(path: &Path, expected: &str) -> Outcome {
    if path.is_file() {
        return Ok(());
    }
    let found = if path.is_dir() { "a folder" } else { "no such file" };
    Err(Failure::input(format!("{}: found {found}, expected {expected}", path.display())))
}
