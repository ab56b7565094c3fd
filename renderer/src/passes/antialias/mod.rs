//! Morphological antialiasing: MLAA and SMAA 1x, S2x, T2x, 4x in compute.
//!
//! ```text
//!   colour (encoded) [depth]          for each sample
//!        |
//!      edges -----> edge bits (rows and columns), list of tiles with edges, copy of the colour (1x)
//!        |
//!     weights ----> four weights a pixel with edges              <-- coverage (lookups)
//!        |
//!   1x:  blend ---> the pixels beside edges, over the copy
//!   S2x, T2x, 4x:
//!        resolve -> blended samples, their mean, the previous frame  <-- velocity, history
//! ```
//!
//! # Theory and source
//! Edges of an aliased image are stairs. Each line of edges is followed to both ends; what crosses it there tells
//! which straight contour it stands for, and the area between contour and edges is the share that pixels take of
//! their neighbours. J. Jimenez, *Practical real-time strategies for photorealistic skin rendering and
//! antialiasing*, 2012, chapter 9 (MLAA) and 10 (SMAA), equations 9.1, 9.2 and 10.1 to 10.7. Presets, searched
//! distances, subsample offsets and the treatment of ties follow the published SMAA.
//!
//! # What differs
//! - Edges are bits, 32 pixels a word, in rows and again in columns. A search reads two or three words and counts
//!   zeros, where the published one fetches and decodes a texture every second pixel. The result is the same
//!   (tests compare both), and no search texture is read.
//! - Coverage comes from a table for whole distances (see [`lookups`]): one read, no square root, no filtering.
//!   Weights are integers and agree bit for bit between processors.
//! - Only tiles of 32 x 32 pixels with edges get the two later kernels, through a list that workgroups share; in a
//!   tile the pixels concerned are gathered first. Nothing is cleared: weights are read only beside edges. The edge
//!   kernel copies the image on its way, so that 1x reads and writes every pixel once.
//! - Contrast is compared in whole 1/65535 steps of luma, so ties do not depend on rounding. Alpha is a channel of its
//!   own in edge detection, and straight alpha weighs blended colours.
//! - Diagonals are stairs that a straight line can have left, found in the same way at top and at left edges and
//!   mirrored ([`Patterns::Revised`], which lists the other differences). The published shader finds them at top
//!   edges, also where both ends turn the same way, as on circles; [`Patterns::Published`] does the same.
//! - Colour edges compare neighbours at a distance of one pixel throughout; the published shader compares with the
//!   pixel two to the left in one of its terms.
//! - Outside of the image lines run on and nothing crosses them; the published shader repeats the edges of the
//!   last column and row, crossing ones too.
//! - MLAA finds exact distances, where that of chapter 9 may be one pixel off.
//! - T2x and 4x keep speed apart from alpha and filter the speed itself, not its square root; a previous position
//!   outside of the image counts as unknown. A pixel moves as the fastest of it and its neighbours, as on outlines the
//!   two samples see different things, and speeds are compared in pixels, not in parts of the image.
//!
//! # Inputs and outputs
//! - Colours: any texture that loads as `f32`, one for each of [`Mode::subsamples`], encoded as
//!   [`Settings::encoding`] says (sRGB by default), with alpha as [`Settings::alpha`] says (straight by default). Not a number must not occur.
//! - Depth, where [`Settings::needs_depth`]: one for each sample, any monotonic scale.
//! - Velocity for T2x and 4x: motion since the previous frame in pixels, x right, y down, without jitter; `rg`.
//! - Output: a storage texture of the format given to [`Antialias::new`], encoded like the input.
//!
//! # What it does not do
//! It draws no samples and moves no camera: [`Mode::subsamples`] says where samples belong. It cannot restore what no
//! sample saw; thin wires break at 1x.
//!
//! # Cost
//! See `docs/antialiasing.md` for times and memory, with devices.

mod filter;
pub mod lookups;
pub mod reference;
mod settings;
mod tables;

pub use filter::Filter;
pub use settings::{
    Alpha, BlendSpace, EdgeSource, Encoding, Mode, Patterns, Predication, Preset, Settings, Subsample,
};
pub use tables::Tables;

use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use wgpu::{BindingResource, TextureFormat, TextureUsages, TextureView};

/// K of equation 10.6: how fast the previous frame fades with the difference of speeds.
pub const REPROJECTION_WEIGHT: f32 = 30.0;
/// Pixels a frame that are a speed of 1 in equation 10.6: the width that its K was published for. A trail is as many
/// pixels long in an image of any size.
pub const SPEED_UNIT_PX: f32 = 1280.0;

/// Pixels a side of the tiles that are listed where they have edges; the width of a word of edge bits.
const TILE: u32 = 32;
/// Workgroups that share the listed tiles, at most: as many as a large GPU holds at once. They are dispatched directly,
/// since an indirect dispatch waits for its count and has it checked by another dispatch.
const MOST_WORKGROUPS: u32 = 2048;
/// Relative rounding of the half floats that the history is stored in.
const HISTORY_PRECISION: f32 = 1.0 / 1024.0;

/// What keeps the pass from running.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AntialiasError {
    /// A setting is out of range.
    #[error("antialias setting {name} is {found}, expected {expected}")]
    Setting {
        /// Name in files.
        name: &'static str,
        /// Its value.
        found: f32,
        /// Its range.
        expected: String,
    },
    /// The image is empty or larger than the device takes.
    #[error("an image of {width} x {height} pixels cannot be antialiased, expected 1 to {limit} a side")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Pixels.
        limit: u32,
    },
    /// Something the settings ask for was not handed over.
    #[error("{mode} with these settings takes {expected} {what}, found {found}")]
    Inputs {
        /// Name of the mode.
        mode: &'static str,
        /// What it takes.
        what: &'static str,
        /// How many.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// Files have one sample a pixel and no previous frame.
    #[error("{mode} needs more than an image, expected mlaa or smaa-1x")]
    NotAFilter {
        /// Name of the mode.
        mode: &'static str,
    },
    /// The output format cannot be written by a compute shader.
    #[error("antialiasing cannot write {found:?}, expected Rgba8Unorm, Rgba16Float or Rgba32Float")]
    Format {
        /// What was asked for.
        found: TextureFormat,
    },
    /// The device failed.
    #[error("the device failed: {0}")]
    Device(String),
}

/// Parameters of every kernel; the layout is that of `Params` in `shared.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Params {
    size: [u32; 2],
    words: [u32; 2],
    thresholds: [i32; 2],
    search_limits: [u32; 2],
    blocks: [u32; 4],
    first_column: u32,
    stride: u32,
    diagonal_base: u32,
    diagonal_steps: u32,
    depth_threshold: f32,
    corner_rounding: u32,
    history_valid: u32,
    falling_in_columns: u32,
}

/// How pixels are handed to the device in 1x and MLAA. The result is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dispatch {
    /// Tiles with edges, and in them the pixels with edges.
    #[default]
    Tiles,
    /// Every pixel, as full-screen passes do.
    Screen,
}

/// The images of one frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// One colour for each of [`Mode::subsamples`] of this frame.
    pub colors: &'a [&'a TextureView],
    /// One depth for each colour, or none.
    pub depths: &'a [&'a TextureView],
    /// Motion since the previous frame in pixels.
    pub velocity: Option<&'a TextureView>,
    /// Number of the frame, which decides the subsamples.
    pub frame: u64,
}

/// What T2x and 4x remember: the filtered light and speed of the previous frame.
pub struct History {
    size: [u32; 2],
    light: [TextureView; 2],
    speed: [TextureView; 2],
    newest: usize,
    valid: bool,
}

impl History {
    /// An empty history for images of `size` pixels.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let usage = TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING;
        let make =
            |format| gpu.target("antialias history", size, format, usage).create_view(&Default::default());
        Self {
            size,
            light: [make(TextureFormat::Rgba16Float), make(TextureFormat::Rgba16Float)],
            speed: [make(TextureFormat::R32Float), make(TextureFormat::R32Float)],
            newest: 0,
            valid: false,
        }
    }

    /// Forgets the previous frame: call it at a cut. The next frame is not mixed with anything.
    pub fn invalidate(&mut self) {
        self.valid = false;
    }

    /// Bytes of device memory.
    pub fn memory_bytes(&self) -> u64 {
        2 * (8 + 4) * u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// What one sample needs between its kernels.
struct Sample {
    bits: wgpu::Buffer,
    tiles: wgpu::Buffer,
    weights_texture: wgpu::Texture,
    weights: TextureView,
}

/// The pass for images of one size.
pub struct Antialias {
    settings: Settings,
    dispatch: Dispatch,
    size: [u32; 2],
    samples: Vec<Sample>,
    /// For each of two frames, for each sample.
    params: [Vec<wgpu::Buffer>; 2],
    params_with_history: wgpu::Buffer,
    areas: wgpu::Buffer,
    edges: wgpu::ComputePipeline,
    weights: wgpu::ComputePipeline,
    last: wgpu::ComputePipeline,
    /// Stand-ins for bindings that a mode does not use.
    unused_output: TextureView,
    unused_light: TextureView,
    unused_speed: TextureView,
    unused_texture: TextureView,
}

impl Antialias {
    /// Makes the tables, pipelines and intermediate images of a mode.
    ///
    /// # Errors
    /// Settings out of range, a size or format that the device cannot take.
    pub fn new(
        gpu: &Gpu,
        settings: &Settings,
        size: [u32; 2],
        output: TextureFormat,
    ) -> Result<Self, AntialiasError> {
        Self::with_dispatch(gpu, settings, size, output, Dispatch::default())
    }

    /// [`Antialias::new`] with a choice of how 1x and MLAA are dispatched.
    ///
    /// # Errors
    /// Settings out of range, a size or format that the device cannot take.
    pub fn with_dispatch(
        gpu: &Gpu,
        settings: &Settings,
        size: [u32; 2],
        output: TextureFormat,
        dispatch: Dispatch,
    ) -> Result<Self, AntialiasError> {
        settings.validate()?;
        let [width, height] = size;
        let limits = gpu.device.limits();
        let words = [width.div_ceil(TILE), height.div_ceil(TILE)];
        let bits_bytes =
            8 * (u64::from(words[0]) * u64::from(height) + u64::from(words[1]) * u64::from(width));
        // Tile coordinates are stored in 16 bits each.
        let limit = limits.max_texture_dimension_2d.min(1 << 20);
        if width == 0
            || height == 0
            || width.max(height) > limit
            || bits_bytes > limits.max_storage_buffer_binding_size
        {
            return Err(AntialiasError::Size { width, height, limit });
        }
        let output_name = match output {
            TextureFormat::Rgba8Unorm => "rgba8unorm",
            TextureFormat::Rgba16Float => "rgba16float",
            TextureFormat::Rgba32Float => "rgba32float",
            found => return Err(AntialiasError::Format { found }),
        };

        let samples = settings.mode.subsamples(0).len();
        // Only these can do without a resolve over the whole image.
        let simple = samples == 1 && !settings.mode.is_temporal();
        let dispatch = if simple { dispatch } else { Dispatch::Tiles };
        let by_tiles = simple && dispatch == Dispatch::Tiles;
        let source = |kernel: Kernel| kernel.source(settings, dispatch, output_name);
        let tables = Tables::new(settings);
        let make_params = |frame: u64, sample: usize, history_valid: u32| {
            let plain = settings.predication.map_or(1.0, |p| p.scale);
            let relief = settings.predication.map_or(0.0, |p| p.strength);
            let thresholds = [plain, plain * (1.0 - relief)];
            let (back, ahead) = reference::search_limits(settings);
            let depth_threshold = match (settings.edges, settings.predication) {
                (EdgeSource::Depth, _) | (_, None) => settings.depth_threshold,
                (_, Some(predication)) => predication.depth_threshold,
            };
            let blocks = tables.positions(&settings.mode.subsamples(frame)[sample]).map(|b| b as u32);
            let params = Params {
                size,
                words,
                thresholds: thresholds.map(|factor| reference::threshold_steps(factor * settings.threshold)),
                search_limits: [back, ahead],
                blocks: [blocks[0], blocks[1], blocks[2], blocks[3]],
                first_column: words[0] * height,
                stride: tables.areas.stride,
                diagonal_base: tables.areas.diagonal_base,
                diagonal_steps: settings.diagonal_steps,
                depth_threshold,
                corner_rounding: settings.corner_rounding,
                history_valid,
                falling_in_columns: blocks[4],
            };
            gpu.uniform("antialias params", &params)
        };
        let sampled_and_stored = TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING;
        let texture = |label, size, format| {
            gpu.target(label, size, format, sampled_and_stored | TextureUsages::COPY_SRC)
        };
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let single = |format| view(&texture("antialias unused", [1, 1], format));
        Ok(Self {
            settings: *settings,
            dispatch,
            size,
            samples: (0..samples)
                .map(|_| {
                    let weights_texture = texture("antialias weights", size, TextureFormat::Rgba8Unorm);
                    Sample {
                        bits: gpu.storage_zeroed("antialias edge bits", bits_bytes),
                        tiles: gpu.storage_zeroed(
                            "antialias tiles",
                            8 + 4 * u64::from(words[0]) * u64::from(words[1]),
                        ),
                        weights: view(&weights_texture),
                        weights_texture,
                    }
                })
                .collect(),
            params: [0, 1].map(|frame| (0..samples).map(|sample| make_params(frame, sample, 0)).collect()),
            params_with_history: make_params(0, 0, 1),
            areas: gpu.storage("antialias coverage", &tables.areas.areas),
            edges: gpu.compute_pipeline("antialias edges", &source(Kernel::Edges), "edges"),
            weights: gpu.compute_pipeline("antialias weights", &source(Kernel::Weights), "weights"),
            last: if by_tiles {
                gpu.compute_pipeline("antialias blend", &source(Kernel::Blend), "blend")
            } else {
                gpu.compute_pipeline("antialias resolve", &source(Kernel::Resolve), "resolve")
            },
            unused_output: single(output),
            unused_light: single(TextureFormat::Rgba16Float),
            unused_speed: single(TextureFormat::R32Float),
            unused_texture: single(TextureFormat::Rgba8Unorm),
        })
    }

    /// The settings that the pass was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Bytes of device memory, without the history and the caller's images.
    pub fn memory_bytes(&self) -> u64 {
        let weights = 4 * u64::from(self.size[0]) * u64::from(self.size[1]);
        let samples = self.samples.iter().map(|sample| sample.bits.size() + sample.tiles.size() + weights);
        samples.sum::<u64>() + self.areas.size()
    }

    fn tile_workgroups(&self) -> u32 {
        (self.size[0].div_ceil(TILE) * self.size[1].div_ceil(TILE)).min(MOST_WORKGROUPS)
    }

    fn by_tiles(&self) -> bool {
        self.samples.len() == 1 && !self.settings.mode.is_temporal() && self.dispatch == Dispatch::Tiles
    }

    /// Records the kernels of one frame.
    ///
    /// A history of another size is made anew, so that after a change of size one frame is not mixed with anything.
    ///
    /// # Errors
    /// Inputs that the settings ask for are missing. Nothing was recorded then.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        inputs: &Inputs,
        output: &TextureView,
        history: Option<&mut History>,
    ) -> Result<(), AntialiasError> {
        let mode = self.settings.mode;
        let check = |what, expected: usize, found: usize| {
            if expected == found {
                Ok(())
            } else {
                Err(AntialiasError::Inputs { mode: mode.name(), what, expected, found })
            }
        };
        check("colours", self.samples.len(), inputs.colors.len())?;
        if self.settings.needs_depth() {
            check("depths", self.samples.len(), inputs.depths.len())?;
        }
        if mode.is_temporal() {
            check("velocities", 1, usize::from(inputs.velocity.is_some()))?;
            check("histories", 1, usize::from(history.is_some()))?;
        }

        let params = &self.params[(inputs.frame % 2) as usize];
        for (index, sample) in self.samples.iter().enumerate() {
            let color = inputs.colors[index];
            let depth = if self.settings.needs_depth() { inputs.depths[index] } else { &self.unused_texture };
            let copy = if self.by_tiles() { output } else { &self.unused_output };
            {
                let group = gpu.bind(
                    "antialias edges",
                    &self.edges,
                    0,
                    &[
                        params[index].as_entire_binding(),
                        BindingResource::TextureView(color),
                        BindingResource::TextureView(depth),
                        sample.bits.as_entire_binding(),
                        sample.tiles.as_entire_binding(),
                        BindingResource::TextureView(copy),
                    ],
                );
                let mut pass = timer.compute(encoder, "antialias edges");
                pass.set_pipeline(&self.edges);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(self.size[0].div_ceil(TILE), self.size[1].div_ceil(TILE), 1);
            }
            if mode == Mode::None {
                continue;
            }
            let mut resources = vec![
                params[index].as_entire_binding(),
                sample.bits.as_entire_binding(),
                self.areas.as_entire_binding(),
                BindingResource::TextureView(&sample.weights),
            ];
            if self.dispatch == Dispatch::Tiles {
                resources.push(sample.tiles.as_entire_binding());
            }
            let group = gpu.bind("antialias weights", &self.weights, 0, &resources);
            let mut pass = timer.compute(encoder, "antialias weights");
            pass.set_pipeline(&self.weights);
            pass.set_bind_group(0, &group, &[]);
            match self.dispatch {
                Dispatch::Tiles => pass.dispatch_workgroups(self.tile_workgroups(), 1, 1),
                Dispatch::Screen => {
                    pass.dispatch_workgroups(self.size[0].div_ceil(8), self.size[1].div_ceil(8), 1)
                }
            }
        }
        if self.by_tiles() {
            if mode != Mode::None {
                self.record_blend(gpu, encoder, timer, inputs, output);
            }
        } else {
            self.record_resolve(gpu, encoder, timer, inputs, output, history);
        }
        Ok(())
    }

    fn record_blend(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        inputs: &Inputs,
        output: &TextureView,
    ) {
        let sample = &self.samples[0];
        let group = gpu.bind(
            "antialias blend",
            &self.last,
            0,
            &[
                self.params[0][0].as_entire_binding(),
                sample.bits.as_entire_binding(),
                BindingResource::TextureView(inputs.colors[0]),
                BindingResource::TextureView(&sample.weights),
                sample.tiles.as_entire_binding(),
                BindingResource::TextureView(output),
            ],
        );
        let mut pass = timer.compute(encoder, "antialias blend");
        pass.set_pipeline(&self.last);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(self.tile_workgroups(), 1, 1);
    }

    fn record_resolve(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        inputs: &Inputs,
        output: &TextureView,
        history: Option<&mut History>,
    ) {
        let history = history.filter(|_| self.settings.mode.is_temporal());
        let valid = history.as_ref().is_some_and(|history| history.valid && history.size == self.size);
        let (light, speed, kept_light, kept_speed) = match history {
            Some(history) => {
                if history.size != self.size {
                    *history = History::new(gpu, self.size);
                }
                let (old, new) = (history.newest, 1 - history.newest);
                history.newest = new;
                history.valid = true;
                (&history.light[old], &history.speed[old], &history.light[new], &history.speed[new])
            }
            None => (&self.unused_texture, &self.unused_texture, &self.unused_light, &self.unused_speed),
        };
        let (first, second) = (0, self.samples.len() - 1);
        let params = if valid { &self.params_with_history } else { &self.params[0][0] };
        let texture = BindingResource::TextureView;
        let group = gpu.bind(
            "antialias resolve",
            &self.last,
            0,
            &[
                params.as_entire_binding(),
                texture(output),
                self.samples[first].bits.as_entire_binding(),
                texture(inputs.colors[first]),
                texture(&self.samples[first].weights),
                self.samples[second].bits.as_entire_binding(),
                texture(inputs.colors[second]),
                texture(&self.samples[second].weights),
                texture(inputs.velocity.unwrap_or(&self.unused_texture)),
                texture(light),
                texture(speed),
                texture(kept_light),
                texture(kept_speed),
            ],
        );
        let mut pass = timer.compute(encoder, "antialias resolve");
        pass.set_pipeline(&self.last);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(self.size[0].div_ceil(8), self.size[1].div_ceil(8), 1);
    }
}

/// The kernels of the pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kernel {
    Edges,
    Weights,
    Blend,
    Resolve,
}

impl Kernel {
    /// WGSL of the kernel for some settings. Choices are constants, so that the compiler drops what is not used.
    fn source(self, settings: &Settings, dispatch: Dispatch, output_format: &str) -> String {
        let mode = settings.mode;
        let by_tiles = dispatch == Dispatch::Tiles && mode.subsamples(0).len() == 1 && !mode.is_temporal();
        let sources = [EdgeSource::Luma, EdgeSource::Color, EdgeSource::Depth];
        let edge_source = sources.iter().position(|&source| source == settings.edges).unwrap_or(0);
        let constants = match self {
            Self::Edges => format!(
                "const SOURCE_COLOR = 1u;\nconst SOURCE_DEPTH = 2u;\nconst EDGE_SOURCE = {edge_source}u;\n\
                 const LINEAR_INPUT = {};\nconst PREDICATION = {};\nconst LOCAL_CONTRAST = {};\nconst COPY = {by_tiles};\n\
                 const LIST_TILES = {};\nconst STEPS = {:?}f;\nconst BRIGHTEST = {:?}f;\n",
                settings.encoding == Encoding::Linear,
                settings.predication.is_some(),
                mode != Mode::Mlaa,
                mode != Mode::None && dispatch == Dispatch::Tiles,
                reference::STEPS,
                reference::BRIGHTEST,
            ),
            Self::Weights => format!(
                "const STOP_AT_CROSSINGS = {};\nconst DIAGONALS = {};\nconst ROUND_CORNERS = {};\n\
                 const RUN_ON = {};\nconst DIAGONAL_SLOT = {}u;\n",
                mode != Mode::Mlaa,
                settings.diagonal_steps > 0,
                settings.corner_rounding < 100,
                settings.patterns == Patterns::Revised,
                lookups::DIAGONAL_SLOT,
            ),
            Self::Blend | Self::Resolve => format!(
                "const DECODE = {};\nconst AVERAGE_LINES = {};\nconst PAIR = {};\nconst TEMPORAL = {};\n\
                 const REPROJECTION_WEIGHT = {REPROJECTION_WEIGHT:?}f;\nconst SPEED_UNIT_PX = {SPEED_UNIT_PX:?}f;\n\
                 const HISTORY_PRECISION = {HISTORY_PRECISION:?}f;\n",
                settings.encoding == Encoding::Srgb && settings.blend_space == BlendSpace::Linear,
                mode == Mode::Mlaa,
                mode.subsamples(0).len() == 2,
                mode.is_temporal(),
            ),
        };
        // The last kernel that reads the list of tiles empties it.
        let empties_list = if by_tiles { self == Self::Blend } else { self == Self::Weights };
        let constants = format!(
            "{constants}const EMPTIES_LIST = {empties_list};\nconst STRAIGHT_ALPHA = {};\nconst PUBLISHED = {};\n",
            settings.alpha == Alpha::Straight,
            settings.patterns == Patterns::Published,
        );
        let parts: &[&str] = match self {
            Self::Edges => &[include_str!("edges.wgsl")],
            Self::Weights if dispatch == Dispatch::Tiles => &[
                include_str!("weights.wgsl"),
                include_str!("weights_tiles.wgsl"),
                include_str!("tiles.wgsl"),
            ],
            Self::Weights => &[include_str!("weights.wgsl"), include_str!("weights_screen.wgsl")],
            Self::Blend => {
                &[include_str!("mixing.wgsl"), include_str!("blend.wgsl"), include_str!("tiles.wgsl")]
            }
            Self::Resolve => &[include_str!("mixing.wgsl"), include_str!("resolve.wgsl")],
        };
        let shared = include_str!("shared.wgsl");
        let entry = if self == Self::Blend { "blend" } else { "weights" };
        let body = parts.concat().replace("OUTPUT_FORMAT", output_format).replace("EVERY_TILE", entry);
        format!("{constants}\n{shared}\n{body}")
    }
}

#[cfg(test)]
mod scenes;
#[cfg(test)]
mod tests;
