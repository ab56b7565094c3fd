//! Morphological antialiasing: MLAA and SMAA 1x, S2x, T2x, 4x in compute.
//!
//! ```text
//!   colour (encoded) [depth]          for each sample
//!        |
//!      edges -----> edge bits (rows and columns), list of tiles with edges, copy of the colour (1x)
//!        |
//!     weights ----> four weights per pixel with edges            <-- coverage (lookups)
//!        |
//!   1x:  blend ---> the pixels beside edges, over the copy
//!   S2x, T2x, 4x:
//!        resolve -> blended samples, their mean, the previous frame  <-- velocity, history
//! ```
//!
//! # Theory and source
//! Edges of an aliased image are stairs. Each line of edges is followed to both ends; the crossing edges there tell
//! which straight contour it stands for; the area between contour and edges is the weight with which pixels take
//! the colour of their neighbours. J. Jimenez, *Practical real-time strategies for photorealistic skin rendering and
//! antialiasing*, 2012, chapter 9 (MLAA) and 10 (SMAA), equations 9.1, 9.2 and 10.1 to 10.7. Presets, searched
//! distances, subsample offsets and the treatment of ties follow the published SMAA.
//!
//! # What differs
//! - Edges are bits, 32 pixels per word, in rows and again in columns. A search reads two or three words and counts
//!   zeros, where the published one fetches and decodes a texture every second pixel. The result is the same
//!   (tests compare both), and no search texture is read.
//! - Coverage comes from a table for whole distances (see [`lookups`]): one read, no square root, no filtering.
//!   Weights are integers and agree bit for bit between processors.
//! - Only tiles of 32 x 32 pixels with edges get the two later kernels, through a list that workgroups share; in a
//!   tile the pixels concerned are gathered first. Nothing is cleared: weights are read only beside edges. The edge
//!   kernel copies the image on its way, so that 1x reads and writes every pixel once.
//! - Contrast is compared in whole 1/65535 steps of luma, so ties do not depend on rounding. Alpha is a channel of its
//!   own in edge detection, and straight alpha weighs blended colours.
//! - Diagonals are stairs that a straight line can have produced, found in the same way at top and at left edges and
//!   mirrored ([`Patterns::Revised`], which lists the other differences). The published shader finds them at top
//!   edges, also where both ends turn the same way, as on circles; [`Patterns::Published`] does the same.
//! - Colour edges compare neighbours at a distance of one pixel throughout; the published shader compares with the
//!   pixel two to the left in one of its terms.
//! - Outside of the image lines run on and nothing crosses them; the published shader repeats the edges of the
//!   last column and row, crossing ones too.
//! - MLAA finds exact distances, where that of chapter 9 may be one pixel off.
//! - T2x and 4x keep speed apart from alpha and filter the speed itself, not its square root; a previous position
//!   outside of the image counts as unknown. A pixel moves as the fastest of it and its neighbours, as on outlines the
//!   two samples see different surfaces, and speeds are compared in pixels, not in parts of the image.
//!
//! # Inputs and outputs
//! - Colours: any texture that loads as `f32`, one for each of [`Mode::subsamples`], encoded as
//!   [`Settings::encoding`] says (sRGB by default), with alpha as [`Settings::alpha`] says (straight by default). NaN
//!   must not occur.
//! - Depth, where [`Settings::needs_depth`]: one for each sample, any monotonic scale.
//! - Velocity for T2x and 4x: motion since the previous frame in pixels, x right, y down, without jitter; `rg`.
//! - Output: a storage texture of the format given to [`Antialias::new`], encoded like the input.
//!
//! # What it does not do
//! It draws no samples and moves no camera: [`Mode::subsamples`] gives the sample positions. It cannot restore detail
//! that no sample hit; thin wires break at 1x.
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

use wgpu::{TextureFormat, TextureUsages, TextureView};

use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, PassTimer};
pub use crate::error::AntialiasError;
use crate::passes::pixel_groups;

/// K of equation 10.6: how fast the previous frame fades with the difference of speeds.
pub const REPROJECTION_WEIGHT: f32 = 30.0;
/// Pixels per frame of a speed of 1 in equation 10.6: the width that its K was published for. A trail has the same
/// length in pixels in images of every size.
pub const SPEED_UNIT_PX: f32 = 1280.0;

/// Pixels per side of the tiles that are listed where they have edges; the width of a word of edge bits.
const TILE: u32 = 32;
/// Workgroups that share the listed tiles, at most: as many as a large GPU holds at once. They are dispatched directly,
/// since an indirect dispatch waits for its count and is validated by another dispatch.
const MOST_WORKGROUPS: u32 = 2048;
/// Relative rounding of the half floats that the history is stored in.
const HISTORY_PRECISION: f32 = 1.0 / 1024.0;

/// Parameters of every kernel; the layout is that of `Params` in `shared.wesl`.
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

/// How pixels are distributed to invocations in 1x and MLAA. The result is the same.
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

/// The history of T2x and 4x: the filtered light and speed of the previous frame.
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

    /// Clears the history, for a cut: the next frame is not mixed with a previous one.
    pub fn invalidate(&mut self) {
        self.valid = false;
    }

    /// Bytes of device memory.
    pub fn memory_bytes(&self) -> u64 {
        2 * (8 + 4) * u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// Intermediate images of one sample.
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
    /// Indexed by frame parity, then by sample.
    params: [Vec<wgpu::Buffer>; 2],
    params_with_history: wgpu::Buffer,
    areas: wgpu::Buffer,
    edges: Kernel,
    weights: Kernel,
    last: Kernel,
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
        let format_flag = match output {
            TextureFormat::Rgba8Unorm => "rgba8",
            TextureFormat::Rgba16Float => "rgba16",
            TextureFormat::Rgba32Float => "rgba32",
            found => return Err(AntialiasError::Format { found }),
        };

        let samples = settings.mode.subsamples(0).len();
        // Only these modes do not need a resolve over the whole image.
        let simple = samples == 1 && !settings.mode.is_temporal();
        let dispatch = if simple { dispatch } else { Dispatch::Tiles };
        let by_tiles = simple && dispatch == Dispatch::Tiles;
        let kernel = |step: Step| step.kernel(gpu, settings, dispatch, format_flag);
        let tables = Tables::new(settings);
        let make_params = |frame: u64, sample: usize, history_valid: u32| {
            let plain = settings.predication.map_or(1.0, |p| p.scale);
            let relief = settings.predication.map_or(0.0, |p| p.strength);
            let thresholds = [plain, plain * (1.0 - relief)];
            let (back, ahead) = settings::search_limits(settings);
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
            edges: kernel(Step::Edges),
            weights: kernel(Step::Weights),
            last: kernel(if by_tiles { Step::Blend } else { Step::Resolve }),
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

    /// Columns and rows of the images that it takes.
    pub fn size(&self) -> [u32; 2] {
        self.size
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
    /// A history of another size is replaced, so the first frame after a change of size is not mixed with a previous
    /// one.
    ///
    /// # Errors
    /// Inputs that the settings need are missing; nothing is recorded.
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
            let resources = [
                ("params", params[index].bound()),
                ("color", color.bound()),
                ("depth", depth.bound()),
                ("bits", sample.bits.bound()),
                ("tiles", sample.tiles.bound()),
                ("copy", copy.bound()),
            ];
            let groups = [self.size[0].div_ceil(TILE), self.size[1].div_ceil(TILE), 1];
            dispatch(gpu, encoder, timer, &self.edges, &resources, groups);
            if mode == Mode::None {
                continue;
            }
            let resources = [
                ("params", params[index].bound()),
                ("bits", sample.bits.bound()),
                ("areas", self.areas.bound()),
                ("weights_out", sample.weights.bound()),
                ("tiles", sample.tiles.bound()),
            ];
            let groups = match self.dispatch {
                Dispatch::Tiles => [self.tile_workgroups(), 1, 1],
                Dispatch::Screen => pixel_groups(self.size),
            };
            dispatch(gpu, encoder, timer, &self.weights, &resources, groups);
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
        let resources = [
            ("params", self.params[0][0].bound()),
            ("bits", sample.bits.bound()),
            ("color", inputs.colors[0].bound()),
            ("weights", sample.weights.bound()),
            ("tiles", sample.tiles.bound()),
            ("output", output.bound()),
        ];
        dispatch(gpu, encoder, timer, &self.last, &resources, [self.tile_workgroups(), 1, 1]);
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
        let resources = [
            ("params", params.bound()),
            ("output", output.bound()),
            ("bits_a", self.samples[first].bits.bound()),
            ("color_a", inputs.colors[first].bound()),
            ("weights_a", self.samples[first].weights.bound()),
            ("bits_b", self.samples[second].bits.bound()),
            ("color_b", inputs.colors[second].bound()),
            ("weights_b", self.samples[second].weights.bound()),
            ("velocity", inputs.velocity.unwrap_or(&self.unused_texture).bound()),
            ("previous_light", light.bound()),
            ("previous_speed", speed.bound()),
            ("kept_light", kept_light.bound()),
            ("kept_speed", kept_speed.bound()),
        ];
        dispatch(gpu, encoder, timer, &self.last, &resources, pixel_groups(self.size));
    }
}

/// A pass of one dispatch. The filter for images has no frame to record into, so this takes a device and an encoder.
fn dispatch(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    timer: &mut PassTimer,
    kernel: &Kernel,
    resources: &[Resource<'_>],
    [x, y, z]: [u32; 3],
) {
    let groups = kernel.bindings.bind(gpu, resources);
    let mut pass = timer.compute(gpu, encoder, kernel.label);
    pass.set_pipeline(&kernel.pipeline);
    for (index, group) in groups.iter().enumerate() {
        pass.set_bind_group(index as u32, group, &[]);
    }
    pass.dispatch_workgroups(x, y, z);
}

const SHARED: Module = module!("antialias_shared", "shared.wesl");
const MIXING: Module = module!("antialias_mixing", "mixing.wesl");
const EDGES: Module = module!("antialias_edges", "edges.wesl");
const WEIGHTS: Module = module!("antialias_weights", "weights.wesl");
const WEIGHTS_SCREEN: Module = module!("antialias_weights_screen", "weights_screen.wesl");
const WEIGHTS_TILES: Module = module!("antialias_weights_tiles", "weights_tiles.wesl");
const TILES: Module = module!("antialias_tiles", "tiles.wesl");
const BLEND: Module = module!("antialias_blend", "blend.wesl");
const RESOLVE: Module = module!("antialias_resolve", "resolve.wesl");

/// The kernels of the pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    Edges,
    Weights,
    Blend,
    Resolve,
}

impl Step {
    fn kernel(self, gpu: &Gpu, settings: &Settings, dispatch: Dispatch, format_flag: &'static str) -> Kernel {
        let label = match self {
            Self::Edges => "antialias edges",
            Self::Weights => "antialias weights",
            Self::Blend => "antialias blend",
            Self::Resolve => "antialias resolve",
        };
        let (program, entry) = self.program(settings, dispatch, format_flag);
        Kernel::new(gpu, label, &program, entry)
    }

    /// The shader of the kernel for some settings, and its entry point. Settings are constants, so that the compiler
    /// drops unused code.
    fn program(
        self,
        settings: &Settings,
        dispatch: Dispatch,
        format_flag: &'static str,
    ) -> (Program, &'static str) {
        let mode = settings.mode;
        let by_tiles = dispatch == Dispatch::Tiles && mode.subsamples(0).len() == 1 && !mode.is_temporal();
        let sources = [EdgeSource::Luma, EdgeSource::Color, EdgeSource::Depth];
        let edge_source = sources.iter().position(|&source| source == settings.edges).unwrap_or(0);
        let (program, entry) = match self {
            Self::Edges => (Program::new(EDGES), "edges"),
            Self::Weights if dispatch == Dispatch::Tiles => {
                (Program::new(TILES).with(&[WEIGHTS, WEIGHTS_TILES]), "every_tile")
            }
            Self::Weights => (Program::new(WEIGHTS_SCREEN).with(&[WEIGHTS]), "weights_of_pixel"),
            Self::Blend => (Program::new(TILES).with(&[BLEND, MIXING]).flag("blend", true), "every_tile"),
            Self::Resolve => (Program::new(RESOLVE).with(&[MIXING]), "resolve"),
        };
        let program = program
            .with(&[SHARED])
            .flag(format_flag, true)
            .constant("SOURCE_COLOR", 1u32)
            .constant("SOURCE_DEPTH", 2u32)
            .constant("EDGE_SOURCE", edge_source as u32)
            .constant("LINEAR_INPUT", settings.encoding == Encoding::Linear)
            .constant("PREDICATION", settings.predication.is_some())
            .constant("LOCAL_CONTRAST", mode != Mode::Mlaa)
            .constant("COPY", by_tiles)
            .constant("LIST_TILES", mode != Mode::None && dispatch == Dispatch::Tiles)
            .constant("STEPS", reference::STEPS)
            .constant("BRIGHTEST", reference::BRIGHTEST)
            .constant("STOP_AT_CROSSINGS", mode != Mode::Mlaa)
            .constant("DIAGONALS", settings.diagonal_steps > 0)
            .constant("ROUND_CORNERS", settings.corner_rounding < 100)
            .constant("RUN_ON", settings.patterns == Patterns::Revised)
            .constant("DIAGONAL_SLOT", lookups::DIAGONAL_SLOT as u32)
            .constant(
                "DECODE",
                settings.encoding == Encoding::Srgb && settings.blend_space == BlendSpace::Linear,
            )
            .constant("AVERAGE_LINES", mode == Mode::Mlaa)
            .constant("PAIR", mode.subsamples(0).len() == 2)
            .constant("TEMPORAL", mode.is_temporal())
            .constant("REPROJECTION_WEIGHT", REPROJECTION_WEIGHT)
            .constant("SPEED_UNIT_PX", SPEED_UNIT_PX)
            .constant("HISTORY_PRECISION", HISTORY_PRECISION)
            // The last kernel that reads the list of tiles empties it.
            .constant("EMPTIES_LIST", if by_tiles { self == Self::Blend } else { self == Self::Weights })
            .constant("STRAIGHT_ALPHA", settings.alpha == Alpha::Straight)
            .constant("PUBLISHED", settings.patterns == Patterns::Published);
        (program, entry)
    }
}

#[cfg(test)]
mod scenes;
#[cfg(test)]
mod tests;
