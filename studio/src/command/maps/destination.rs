//! Destination of converted maps: files, or a head.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rubor_assets::convert::into_head::Origin;
use rubor_assets::export::gltf::{MapEncoding, MapEncodings, Options};
use rubor_rig::expression::Rig;
use rubor_rig::head::ProvenanceKind;

use rubor::inputs::{self, LoadedHead};
use rubor::notes::Note;
use rubor::{Failure, Outcome};

/// Arguments that all conversions have.
#[derive(Debug, Args)]
pub(crate) struct Destination {
    /// Head that receives the maps (.glb, .gltf); --output is then the new head (.glb)
    #[arg(long, value_name = "HEAD")]
    pub(crate) into: Option<PathBuf>,
    /// Folder (normals: file) for the results; with --into the head to write (.glb)
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// How the maps were made: goes into the provenance of the head
    #[arg(long, value_enum, default_value = "measured")]
    kind: KindArg,
    /// Licence of the maps as an SPDX expression: goes into the provenance of the head
    #[arg(long, default_value = "NOASSERTION")]
    licence: String,
    /// Smaller head file: maps as JPEG, no normals of shapes for other viewers
    #[arg(long)]
    small: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum KindArg {
    /// From a person or a scan
    Measured,
    /// By an artist
    Painted,
    /// By a program from rules
    Synthesised,
    /// Computed from other data
    Predicted,
}

fn is_head_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"))
}

impl Destination {
    /// The head that receives, or none where files are to be written; `notes` get what its reader says.
    ///
    /// # Errors
    /// A head that cannot be read; an output that does not go with it.
    pub(crate) fn head(&self, notes: &mut Vec<Note>) -> Outcome<Option<LoadedHead>> {
        let output = self.output.display();
        match &self.into {
            None if is_head_file(&self.output) => {
                Err(Failure::input(format!("--output {output}: found a head, expected a folder or an image"))
                    .hint("--into HEAD.glb names the head that receives the maps"))
            }
            None => Ok(None),
            Some(_) if !is_head_file(&self.output) => Err(Failure::input(format!(
                "--output {output}: with --into expected a name that ends in .glb"
            ))),
            Some(path) => {
                let loaded = inputs::head(Some(path))?;
                notes.extend(loaded.notes.iter().cloned());
                Ok(Some(loaded))
            }
        }
    }

    /// Where the maps come from.
    pub(crate) fn origin(&self, source: impl Into<String>) -> Origin {
        let kind = match self.kind {
            KindArg::Measured => ProvenanceKind::Measured,
            KindArg::Painted => ProvenanceKind::Painted,
            KindArg::Synthesised => ProvenanceKind::Synthesised,
            KindArg::Predicted => ProvenanceKind::Predicted,
        };
        Origin { kind, source: source.into(), licence: self.licence.clone() }
    }

    /// Writes the head with its rig.
    ///
    /// # Errors
    /// Maps that break the rules of a head, a file that cannot be written.
    pub(crate) fn write(&self, loaded: &LoadedHead) -> Outcome {
        write_head(loaded, &self.output, self.small)
    }
}

/// Writes a head with its rig, or the default one; small or exact.
///
/// # Errors
/// Maps that break the rules of a head, a file that cannot be written.
pub(crate) fn write_head(loaded: &LoadedHead, output: &Path, small: bool) -> Outcome {
    let rig = match &loaded.rig {
        Some(rig) => rig.clone(),
        None => Rig::default_rig()?,
    };
    let options = Options {
        color_map_size: if small { 1024 } else { 2048 },
        rig: Some(&rig),
        morph_normals: !small,
        maps: if small { MapEncodings::small() } else { exact() },
        ..Options::default()
    };
    rubor_assets::export::gltf::write(&loaded.head, &options, output)?;
    Ok(())
}

/// Measured blood and pigment keep 16 bits: 8 over the range of a map with a mole in it leave too few for the skin.
fn exact() -> MapEncodings {
    MapEncodings { melanin: MapEncoding::Png16, hemoglobin: MapEncoding::Png16, ..MapEncodings::default() }
}

/// File names for a provenance: without the folders of this machine.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
