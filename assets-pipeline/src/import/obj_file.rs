//! A head from one OBJ file with its materials. For shapes see [`super::obj_set`].

use std::path::Path;

use rubor_rig::head::Material;

use super::gltf::{Extent, ImportedHead};
use super::materials::recognise;
use super::mtl::Library;
use super::obj::{self, GroupBy};
use crate::error::ImportError;
use crate::notes::Notes;
use crate::poly::build_head;

/// Reads a file, its `.mtl` files and their pictures. Lengths are taken for metres.
///
/// # Errors
/// As [`obj::read`].
pub fn read(path: &Path) -> Result<ImportedHead, ImportError> {
    let bytes = rubor_rig::limits::read(path).map_err(ImportError::read(path))?;
    from_bytes(&bytes, path)
}

/// Names of the materials of an `.mtl` file in memory, after reading all of it; `folder` finds pictures.
///
/// # Errors
/// Nothing could be read.
pub fn materials_from_bytes(bytes: &[u8], folder: &Path) -> Result<Vec<String>, ImportError> {
    let mut notes = Notes::default();
    let names = Library::from_bytes(folder, bytes, &mut notes).names();
    match names.is_empty() {
        true => Err(ImportError::content(folder, "materials", "none", "newmtl NAME")),
        false => Ok(names),
    }
}

/// Reads from memory; `path` is for messages and finds the files of materials.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<ImportedHead, ImportError> {
    let file = obj::from_bytes(bytes, path, GroupBy::Material)?;
    if file.mesh.face_count() == 0 {
        let found = format!("{} positions and no faces", file.mesh.points.len());
        return Err(ImportError::content(path, "end of file", found, "a mesh"));
    }
    let mut notes = Notes::default();
    for note in file.notes {
        match note.places.is_empty() {
            true => notes.say(note.message),
            false => note.places.iter().for_each(|place| notes.add(&note.message, place)),
        }
    }
    let kinds: Vec<Option<Material>> = file.mesh.groups.iter().map(|g| recognise(g)).collect();
    let folder = path.parent().unwrap_or(Path::new(""));
    let library = Library::read(folder, &file.libraries, &mut notes);
    // A file without any look and names is a scan.
    let is_scan = kinds.iter().all(Option::is_none) && !library.has_looks();
    let rest = if is_scan { Material::Skin } else { Material::Other };
    let parts: Vec<(&str, &str, Material)> = (file.mesh.groups.iter().zip(&kinds))
        .map(|(group, kind)| (group.as_str(), group.as_str(), kind.unwrap_or(rest)))
        .collect();
    let (mut head, _) = build_head(&file.mesh, &[], &parts, 0.0);
    head.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for (name, _) in file.mesh.groups.iter().zip(&kinds).filter(|(_, kind)| kind.is_none()) {
        let message = match is_scan {
            true => "parts without a material, and with no name that tells what they are, are taken for skin",
            false => {
                "parts that no name tells keep the look of their author (`rubor import --parts NAME=skin` makes one skin)"
            }
        };
        notes.add(message, name.as_str());
    }
    library.give(&mut head, &mut notes);
    notes
        .say("one OBJ file has no shapes: give the folder of a neutral and its shapes for a face that moves");
    head.validate()?;
    let meshes = head.mesh.parts.iter().map(|p| p.name.clone()).collect();
    let extent = Extent { meshes, head_share: Vec::new() };
    Ok(ImportedHead { head, extent, notes: notes.into_vec(), ..ImportedHead::default() })
}
