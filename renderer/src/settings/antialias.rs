//! How well antialiasing looks for edges.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Quality of SMAA as published: threshold, search steps of two pixels, diagonal steps, corner rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AntialiasPreset {
    /// 0.15, 4 steps, no diagonals, no corners.
    Low,
    /// 0.1, 8 steps, no diagonals, no corners.
    Medium,
    /// 0.1, 16 steps, 8 diagonal steps, corners rounded by a quarter (1x: see [`crate::antialias::Settings::new`]).
    #[default]
    High,
    /// 0.05, 32 steps, 16 diagonal steps, corners rounded by a quarter (1x: see [`crate::antialias::Settings::new`]).
    Ultra,
}

/// Which patterns of edges stand for which contours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AntialiasPatterns {
    /// The same for images however they are turned or mirrored, and closer to the contours:
    /// - a diagonal is a stair of at least five edges between two longer steps of the same direction, which is what a
    ///   straight line leaves; all other stairs go through the middles of their risers like any line;
    /// - areas are exact, and short steps that turn back are not blended more than their area;
    /// - lines run on where two contours of more than one pixel cross;
    /// - where both directions weigh the same, both are taken.
    #[default]
    Revised,
    /// As the published shader has them, for comparisons.
    Published,
}
