//! What a scene needs of a head.

use std::path::PathBuf;

use rubor_renderer::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Adapter;
use crate::auto::Bound;

/// What sequences need of a head, and the head with no more than that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetReport {
    /// Device.
    pub adapter: Adapter,
    /// How frames were made. A sequence that says a size has it, unless a flag does.
    pub settings: Settings,
    /// Name of the head.
    pub head: String,
    /// Bytes of the file that it came from, in the coding of that file.
    pub input_bytes: u64,
    /// The sequences, and which of their frames were looked at.
    pub sequences: Vec<BudgetSequence>,
    /// What the error of each of these frames may be.
    pub bound: Bound,
    /// The whole head.
    pub whole: BudgetTotals,
    /// The reduced head, as it is written: its sizes, times and error are those of the file read back.
    pub reduced: BudgetTotals,
    /// Error of the reduced head, read back from its file.
    pub error: BudgetError,
    /// Frame with the largest error.
    pub worst: BudgetFrame,
    /// Error of a file with the whole head: what the coding of its maps costs.
    pub coding_error: BudgetError,
    /// How maps are coded in the file.
    pub coding: BudgetCoding,
    /// Everything that was tried: first what went, then what stayed, each with the largest first.
    pub items: Vec<BudgetItem>,
    /// The file; none if nothing could go or none was wished.
    pub written: Option<PathBuf>,
    /// Notes, one line per kind.
    pub notes: Vec<String>,
}

/// A sequence of a budget.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetSequence {
    /// File.
    pub file: PathBuf,
    /// Its frames. Whether something moves at all is known of each of them.
    pub frames: u32,
    /// Those that were looked at, from 1.
    pub looked_at: Vec<u32>,
}

/// A frame of a budget.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetFrame {
    /// File of the sequence.
    pub sequence: PathBuf,
    /// From 1.
    pub frame: u32,
}

/// A head in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetTotals {
    /// Bytes on the device, with what frames write of the head.
    pub device_bytes: u64,
    /// Bytes of a file of it in the coding of the reduced one.
    pub file_bytes: u64,
    /// Median time of a frame over the frames looked at, milliseconds; both heads take turns. None if nothing was timed.
    pub frame_ms: Option<f64>,
    /// Points of the mesh.
    pub points: usize,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Blend shapes.
    pub shapes: usize,
    /// Hemoglobin distributions.
    pub distributions: usize,
    /// Wrinkle zones.
    pub zones: usize,
    /// Wrinkle maps.
    pub wrinkle_maps: usize,
    /// Single hairs of the scalp.
    pub hairs: u32,
}

/// How maps are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BudgetCoding {
    /// JPEG, as `rubor export --small` has it.
    Jpeg,
    /// PNG of 8 bits, distributions of 16, as `rubor export` has it.
    Png,
    /// PNG of 16 bits.
    Png16,
}

/// Mean FLIP over the head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetError {
    /// Largest over the frames looked at.
    pub largest: f64,
    /// Mean over them.
    pub mean: f64,
    /// Looking stopped at a frame beyond the bound: the error is at least this.
    pub is_least: bool,
}

/// Something that a head may do without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BudgetItem {
    /// Kind.
    pub kind: BudgetKind,
    /// Name in the head.
    pub name: String,
    /// What became of it.
    pub fate: BudgetFate,
    /// Largest weight in all frames; only of what has one.
    pub most_weight: Option<f64>,
    /// How far it moves the surface in a frame looked at, at most, pixels; only of shapes.
    pub moves_pixels: Option<f64>,
    /// Bytes on the device that going saves, or the chosen size does. Of what shares a texture with others, its part of it.
    pub device_bytes: u64,
    /// Bytes of the file that this saves; those of a smaller map in proportion to its texels.
    pub file_bytes: u64,
    /// Error of the head without it alone: of a map of the chosen size, or of the first one that is too small; none if no frame can
    /// show it.
    pub error: Option<BudgetError>,
    /// Texels of a map on a side, or number of hairs: as they were.
    pub from: Option<[u32; 2]>,
    /// The same in the reduced head.
    pub to: Option<[u32; 2]>,
}

/// Kind of something that a head may do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BudgetKind {
    /// A blend shape.
    Shape,
    /// A hemoglobin distribution.
    Distribution,
    /// A wrinkle zone, with its wrinkle map if it is the last that has it.
    Zone,
    /// A part of the mesh.
    Part,
    /// The size of a map, or of all maps of a kind.
    Map,
    /// The number of single hairs of the scalp.
    Hairs,
}

/// What became of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BudgetFate {
    /// It went: its weight is 0 in all frames, or it is never drawn.
    Unused,
    /// It went: without it the error stays under the bound.
    Gone,
    /// It got smaller, or fewer.
    Smaller,
    /// It stays: without it the error would be over the bound, alone or together with what went.
    Needed,
    /// It stays although unused or unseen: a name of a sequence would mean something else without it, or the camera's place
    /// depends on it.
    Held,
}

impl BudgetFate {
    /// Whether the head lost something by it.
    pub fn is_loss(self) -> bool {
        matches!(self, Self::Unused | Self::Gone | Self::Smaller)
    }
}
