//! The file of a head, and the head of that file.

use std::path::Path;

use rubor_assets::export::gltf::{self, MapEncoding, MapEncodings};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;

use super::trial::{Errors, Trials};
use crate::error::Outcome;
use crate::inputs;
use crate::report::BudgetCoding;

/// A head as a file in memory.
pub(super) struct Written {
    pub(super) bytes: Vec<u8>,
    /// The head as it is read back.
    pub(super) head: Head,
    pub(super) rig: Rig,
    pub(super) errors: Errors,
    pub(super) notes: Vec<String>,
}

/// Writes a head with its rig, reads it back and measures what was read.
pub(super) fn written(
    trials: &mut Trials<'_>,
    head: &Head,
    rig: &Rig,
    coding: BudgetCoding,
    name: &Path,
) -> Outcome<Written> {
    let options = gltf::Options {
        // Other viewers show it as a small export.
        color_map_size: 1024,
        morph_normals: false,
        maps: encodings(coding),
        rig: Some(rig),
        ..gltf::Options::default()
    };
    let exported = gltf::export(head, &options)?;
    let loaded = inputs::head_of_bytes(&exported.bytes, name)?;
    let rig = inputs::rig(None, loaded.rig)?;
    let errors = trials.error_of(&loaded.head, &rig)?;
    Ok(Written { bytes: exported.bytes, head: loaded.head, rig, errors, notes: exported.notes })
}

fn encodings(coding: BudgetCoding) -> MapEncodings {
    let deep = MapEncoding::Png16;
    match coding {
        BudgetCoding::Jpeg => MapEncodings::small(),
        BudgetCoding::Png => MapEncodings::default(),
        BudgetCoding::Png16 => MapEncodings {
            // Colours have 8 bits.
            albedo: MapEncoding::Png8,
            melanin: deep,
            hemoglobin: deep,
            distributions: deep,
            slopes: deep,
            wrinkle_slopes: deep,
            specular: deep,
            scattering: deep,
        },
    }
}
