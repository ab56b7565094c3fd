//! Settings of antialiasing: modes, presets and every single setting.

use serde::{Deserialize, Serialize};

use crate::settings::AntialiasMethod;
pub use crate::settings::{AntialiasPatterns as Patterns, AntialiasPreset as Preset};

/// Antialiasing methods of chapters 9 and 10, by the names that files and the command use. Supersampling
/// (`ssaa:N`) belongs to the frame, since it draws more pixels instead of filtering them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(from = "AntialiasMethod", into = "AntialiasMethod")]
pub enum Mode {
    /// The image is copied.
    None,
    /// Practical morphological antialiasing (chapter 9).
    Mlaa,
    /// One sample per pixel.
    #[default]
    Smaa1x,
    /// Two samples per pixel, each filtered for its own place in the pixel.
    SmaaS2x,
    /// One sample per pixel at alternating places and the reprojected previous frame.
    SmaaT2x,
    /// Two samples per pixel at alternating places and the reprojected previous frame.
    Smaa4x,
}

/// One image sample of a frame: its position in the pixel and the coverage blocks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subsample {
    /// Place relative to the pixel's centre in pixels, x to the right, y **down**. A camera samples it by moving
    /// the projected image by the negative of it.
    pub position_px: [f32; 2],
    /// Blocks of the area texture: for left edges, for top edges, for diagonals that rise to the right and for
    /// diagonals that fall to the right.
    pub blocks: [usize; 4],
}

const CENTER: Subsample = Subsample { position_px: [0.0, 0.0], blocks: [0, 0, 0, 0] };
/// Figure 10.11 left: two samples on the diagonal of the pixel.
const PAIR: [Subsample; 2] = [
    Subsample { position_px: [0.25, 0.25], blocks: [1, 1, 1, 0] },
    Subsample { position_px: [-0.25, -0.25], blocks: [2, 2, 2, 0] },
];
/// Figure 10.11 right: the pair, moved by an eighth along the other diagonal in each of two frames.
const QUAD: [[Subsample; 2]; 2] = [
    [
        Subsample { position_px: [0.375, 0.125], blocks: [5, 3, 1, 3] },
        Subsample { position_px: [-0.125, -0.375], blocks: [4, 6, 2, 3] },
    ],
    [
        Subsample { position_px: [0.125, 0.375], blocks: [3, 5, 1, 4] },
        Subsample { position_px: [-0.375, -0.125], blocks: [6, 4, 2, 4] },
    ],
];

impl Mode {
    /// Every mode, from nothing to the best.
    pub const ALL: [Self; 6] =
        [Self::None, Self::Mlaa, Self::Smaa1x, Self::SmaaT2x, Self::SmaaS2x, Self::Smaa4x];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        AntialiasMethod::from(self).name()
    }

    /// The samples that frame number `frame` has to be drawn with, in the order in which `record` wants them.
    pub fn subsamples(self, frame: u64) -> &'static [Subsample] {
        let turn = (frame % 2) as usize;
        match self {
            Self::None | Self::Mlaa | Self::Smaa1x => std::slice::from_ref(&CENTER),
            Self::SmaaS2x => &PAIR,
            Self::SmaaT2x => std::slice::from_ref(&PAIR[turn]),
            Self::Smaa4x => &QUAD[turn],
        }
    }

    /// Whether the mode needs velocities and the previous frame.
    pub fn is_temporal(self) -> bool {
        matches!(self, Self::SmaaT2x | Self::Smaa4x)
    }
}

impl From<Mode> for AntialiasMethod {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::None => Self::None,
            Mode::Mlaa => Self::Mlaa,
            Mode::Smaa1x => Self::Smaa1x,
            Mode::SmaaS2x => Self::SmaaS2x,
            Mode::SmaaT2x => Self::SmaaT2x,
            Mode::Smaa4x => Self::Smaa4x,
        }
    }
}

impl From<AntialiasMethod> for Mode {
    /// Supersampling leaves nothing to filter.
    fn from(method: AntialiasMethod) -> Self {
        match method {
            AntialiasMethod::None | AntialiasMethod::Ssaa(_) => Self::None,
            AntialiasMethod::Mlaa => Self::Mlaa,
            AntialiasMethod::Smaa1x => Self::Smaa1x,
            AntialiasMethod::SmaaS2x => Self::SmaaS2x,
            AntialiasMethod::SmaaT2x => Self::SmaaT2x,
            AntialiasMethod::Smaa4x => Self::Smaa4x,
        }
    }
}

/// Source of edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeSource {
    /// Luma of the encoded colour (equation 9.2): fast and mostly right.
    #[default]
    Luma,
    /// The channel that differs most: finds edges between colours of equal luma.
    Color,
    /// Depth: finds no edges in shading, and creases only where depth jumps.
    Depth,
}

/// Encoding of the image's colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// Values went through the sRGB transfer function. Edge detection reads them as they are.
    #[default]
    Srgb,
    /// Values are proportional to light and may exceed one. Edge detection encodes them first.
    Linear,
}

/// The space in which neighbours are mixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum BlendSpace {
    /// Proportional to light: coverage is a fraction of light, so this is right.
    #[default]
    Linear,
    /// The values as stored: for comparisons with programs that blend in this space.
    Stored,
}

/// Relation of the colours to alpha.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Alpha {
    /// Colours are not multiplied by alpha (PNG).
    #[default]
    Straight,
    /// Colours are already multiplied by alpha (EXR, renderers).
    Associated,
}

/// Makes colour edges count more where depth jumps too: the threshold is raised everywhere and lowered there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Predication {
    /// Difference of depths which counts as a jump, in units of the depth texture.
    pub depth_threshold: f32,
    /// Factor on the threshold.
    pub scale: f32,
    /// Part of the raised threshold which is taken off at a jump, 0 to 1.
    pub strength: f32,
}

impl Default for Predication {
    fn default() -> Self {
        Self { depth_threshold: 0.01, scale: 2.0, strength: 0.4 }
    }
}

/// All settings of the pass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Settings {
    /// The method.
    pub mode: Mode,
    /// Source of edges.
    pub edges: EdgeSource,
    /// Smallest difference that is an edge, in encoded colour, over 0 up to 0.5. Lower finds more edges.
    pub threshold: f32,
    /// Smallest difference of depths that is an edge for [`EdgeSource::Depth`], in units of the depth texture.
    pub depth_threshold: f32,
    /// Half the distance in pixels to which ends of lines are searched, 1 to 112. (One step is two pixels.)
    pub search_steps: u32,
    /// Largest number of steps searched along diagonals, 0 (no diagonals) to 19.
    pub diagonal_steps: u32,
    /// How patterns of edges are turned into contours.
    pub patterns: Patterns,
    /// How much corners are rounded in percent, 0 (kept sharp) to 100 (like any line).
    pub corner_rounding: u32,
    /// Depth lowers the threshold of colour edges.
    pub predication: Option<Predication>,
    /// Encoding of the colours.
    pub encoding: Encoding,
    /// Relation of the colours to alpha.
    pub alpha: Alpha,
    /// Space in which neighbours are mixed.
    pub blend_space: BlendSpace,
}

impl crate::settings::Settings {
    /// What the pass is given.
    pub fn antialias(&self) -> Settings {
        let mode = self.quality.antialias.into();
        let preset = self.quality.antialias_preset;
        match self.quality.antialias_patterns {
            Patterns::Revised => Settings::new(mode, preset),
            Patterns::Published => Settings::published(mode, preset),
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::new(Mode::Smaa1x, Preset::High)
    }
}

impl Settings {
    /// The settings of a preset. For MLAA the preset sets only the threshold; MLAA searches 8 pixels, the range of
    /// its table.
    ///
    /// Presets are the published ones, except for corners at 1x: keeping them sharp needs their positions, which one
    /// sample does not give. On letters in all directions the error at 1x is 0.162 with corners rounded by a quarter
    /// and
    /// 0.142 with corners like any line; with two samples it is 0.116 and 0.129 (`docs/antialiasing.md`).
    pub fn new(mode: Mode, preset: Preset) -> Self {
        let (threshold, search_steps, diagonal_steps, corner_rounding) = match preset {
            Preset::Low => (0.15, 4, 0, 100),
            Preset::Medium => (0.1, 8, 0, 100),
            Preset::High => (0.1, 16, 8, 25),
            Preset::Ultra => (0.05, 32, 16, 25),
        };
        let (search_steps, diagonal_steps, corner_rounding) = match mode {
            Mode::Mlaa => (4, 0, 100),
            Mode::Smaa1x => (search_steps, diagonal_steps, 100),
            _ => (search_steps, diagonal_steps, corner_rounding),
        };
        Self {
            mode,
            edges: EdgeSource::Luma,
            threshold,
            depth_threshold: threshold * 0.1,
            search_steps,
            diagonal_steps,
            patterns: Patterns::Revised,
            corner_rounding,
            predication: None,
            encoding: Encoding::Srgb,
            alpha: Alpha::Straight,
            blend_space: BlendSpace::Linear,
        }
    }

    /// A preset with the corners and patterns of the published SMAA, for comparisons.
    pub fn published(mode: Mode, preset: Preset) -> Self {
        let sharp = !matches!((mode, preset), (Mode::Mlaa, _) | (_, Preset::Low | Preset::Medium));
        Self {
            patterns: Patterns::Published,
            corner_rounding: if sharp { 25 } else { 100 },
            ..Self::new(mode, preset)
        }
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// The first setting out of range, with its value and its range.
    pub fn validate(&self) -> Result<(), super::AntialiasError> {
        let check = |name: &'static str, found: f32, range: std::ops::RangeInclusive<f32>| {
            if range.contains(&found) {
                Ok(())
            } else {
                let expected = format!("{} to {}", range.start(), range.end());
                Err(super::AntialiasError::Setting { name, found, expected })
            }
        };
        check("threshold", self.threshold, 1e-4..=0.5)?;
        check("depth-threshold", self.depth_threshold, f32::MIN_POSITIVE..=f32::MAX)?;
        let longest = if self.mode == Mode::Mlaa { 4.0 } else { 112.0 };
        check("search-steps", self.search_steps as f32, 1.0..=longest)?;
        check("diagonal-steps", self.diagonal_steps as f32, 0.0..=19.0)?;
        check("corner-rounding", self.corner_rounding as f32, 0.0..=100.0)?;
        if let Some(predication) = self.predication {
            check("predication.depth_threshold", predication.depth_threshold, f32::MIN_POSITIVE..=f32::MAX)?;
            check("predication.scale", predication.scale, 1.0..=5.0)?;
            check("predication.strength", predication.strength, 0.0..=1.0)?;
        }
        Ok(())
    }

    /// Whether the pass reads depth.
    pub fn needs_depth(&self) -> bool {
        self.edges == EdgeSource::Depth || self.predication.is_some()
    }
}

/// Longest distances searched, backwards and forwards: the published searches fetch pairs of pixels, so to the left
/// (and up) the last step ends one pixel short.
pub(super) fn search_limits(settings: &Settings) -> (u32, u32) {
    let limit = 2 * settings.search_steps;
    if settings.mode == Mode::Mlaa || settings.patterns == Patterns::Revised {
        (limit, limit)
    } else {
        (limit - 1, limit)
    }
}
