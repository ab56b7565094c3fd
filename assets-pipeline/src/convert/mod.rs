//! Conversions between what files hold and what heads hold.
//!
//! ```text
//! hemoglobin maps --hemoglobin----> neutral map, its mean, scale and bias of every expression
//! albedo texture  --chromophores--> melanin and hemoglobin maps, residual, out-of-gamut mask
//! authored skin   --own_color-----> albedo, chromophores, slopes and gloss of skin that keeps its look
//! normal map      --normals-------> slopes, difference maps, and back
//! displacement    --displacement--> slopes of what it raises, alone or finer than a normal map
//! another head    --transfer------> its distributions on this head's own blood
//! strain of shapes --prediction---> distributions of a head that has none
//! rest mesh       --occlusion-----> ambient visibility of each point
//! a whole figure  --crop----------> its head, chosen parts
//! lengths         --size----------> metres, with a guess of the unit
//! triangles       --levels--------> coarser surfaces for where the head is small in the picture
//! all of these    --into_head-----> the maps of a head, with their provenance
//! ```

pub mod chromophores;
pub mod crop;
pub mod displacement;
pub mod hemoglobin;
pub mod into_head;
pub mod levels;
mod nearest;
pub mod normals;
pub mod occlusion;
pub mod own_color;
pub mod prediction;
pub mod size;
pub mod skin_texels;
pub mod surface_warp;
pub mod transfer;

use rubor_rig::hemoglobin::HemoglobinError;

use crate::image_io::ImageError;

/// A conversion that its input does not allow.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A file.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A map that the hemoglobin model cannot use.
    #[error("{name}: {source}")]
    Hemoglobin {
        /// Name of the map: the neutral one or a distribution.
        name: String,
        /// The cause.
        source: HemoglobinError,
    },
    /// An argument or an entry of a manifest.
    #[error("{at}: found {found}, expected {expected}")]
    Argument {
        /// Place.
        at: String,
        /// The value there.
        found: String,
        /// The values that are allowed.
        expected: String,
    },
}

impl ConvertError {
    fn argument(at: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Argument { at: at.into(), found: found.into(), expected: expected.into() }
    }
}

#[cfg(test)]
mod tests;
