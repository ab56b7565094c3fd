//! The manifest of a run: its files with their sizes and checksums, so that a copy of the folder can be checked.
//!
//! ```text
//! jq -r '.files[] | "\(.sha256)  \(.file)"' manifest.json | sha256sum --check
//! ```
//!
//! The checksum is SHA-256 (FIPS 180-4), which every system has a program for; [`crate::job::Fingerprint`] is for rubor alone.

use std::fs::File;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::{Failure, Outcome};
use crate::{output, writers};

/// Name of the manifest in the folder of a run.
pub const MANIFEST_FILE: &str = "manifest.json";

/// Files of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[schemars(title = "rubor manifest")]
pub struct Manifest {
    /// Version of rubor that wrote it.
    pub rubor: String,
    /// Every result in the folder by its name, but the manifest itself.
    pub files: Vec<Entry>,
}

/// A file of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Entry {
    /// Its name.
    pub file: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its bytes: 64 hexadecimal digits.
    pub sha256: String,
}

impl Manifest {
    /// JSON schema of the file.
    pub fn json_schema_value() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }

    /// Reads all files of a folder that `is_listed` names.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn of(folder: &Path, is_listed: impl Fn(&str) -> bool) -> Outcome<Self> {
        let entries = std::fs::read_dir(folder).map_err(|e| Failure::read(folder, e))?;
        let mut names: Vec<String> = entries
            .filter_map(|e| Some(e.ok()?.file_name().to_str()?.to_owned()))
            .filter(|name| name != MANIFEST_FILE && is_listed(name))
            .collect();
        names.sort();
        let mut files = Vec::with_capacity(names.len());
        writers::beside(&|name: String| entry(folder, name), &mut |entry| files.push(entry), |push| {
            names.into_iter().try_for_each(push)
        })?;
        files.sort_by(|a: &Entry, b| a.file.cmp(&b.file));
        Ok(Self { rubor: env!("CARGO_PKG_VERSION").to_owned(), files })
    }

    /// Writes it into the folder.
    ///
    /// # Errors
    /// The system reports an error.
    pub(crate) fn write(&self, folder: &Path) -> Outcome {
        output::write_json(&folder.join(MANIFEST_FILE), self)
    }
}

fn entry(folder: &Path, file: String) -> Outcome<Entry> {
    let path = folder.join(&file);
    let wrong = |e: std::io::Error| Failure::read(&path, e);
    let mut from = File::open(&path).map_err(wrong)?;
    let mut hash = Sha256::new();
    let bytes = std::io::copy(&mut from, &mut hash).map_err(wrong)?;
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(Entry { file, bytes, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manifest_lists_what_it_is_asked_for_but_itself() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("b.png", "abc"), ("a.png", ""), ("c.txt", "x"), (MANIFEST_FILE, "old")] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let manifest = Manifest::of(folder.path(), |name| name != "c.txt").unwrap();
        manifest.write(folder.path()).unwrap();
        let text = std::fs::read_to_string(folder.path().join(MANIFEST_FILE)).unwrap();
        assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest);
        let files: Vec<_> = manifest.files.iter().map(|f| (&f.file[..], f.bytes, &f.sha256[..])).collect();
        // NIST, "Descriptions of SHA-256": the empty text and abc.
        let [empty, abc] = [
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
        ];
        assert_eq!(files, [("a.png", 0, empty), ("b.png", 3, abc)]);
    }
}
