//! Triangles to pixels without the raster units: one compute invocation per triangle, atomics on the nearest depth.
//!
//! ```text
//! positions, corners --raster_each--> keys of pixels (small triangles), list of large ones
//! list               --raster_large-> keys of pixels, one workgroup per triangle; raster_rest where the list is too short
//! keys               --raster_resolve--> ids (r32uint), depth (r32float); keys are zero again
//! ```
//!
//! Theory: a key has the bits of the depth above the complement of the triangle's id, so the largest key is the nearest
//! triangle and, of equally near ones, the first, whatever the order of the invocations: frames repeat bit by bit.
//! Coverage is that of hardware: corners are rounded to 1/256 of a pixel, centres on an edge belong to the triangle whose
//! left or upper edge it is, and areas are integers (the products of large triangles in two words), so neighbours share
//! no pixel and leave none out. Only triangles that reach behind the viewer, or farther than 16 384 pixels from the
//! picture's middle, are clipped.
//!
//! With 64-bit atomics one pass finds depth and id; without them a second pass compares its depth with the nearest one
//! and keeps the least id. For a light there is no id, and 32 bits suffice.
//!
//! Differs from hardware: depth is interpolated in `f32` from the rounded corners (1e-6 of the depth at most in tests).
//!
//! Costs are in docs/raster.md; [`crate::settings::RasterMethod::Auto`] uses it only where it was measured to be faster.

#[cfg(test)]
mod tests;

use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::scene::head::AUTHORED_SHIFT;
use crate::scene::{MAX_HEADS, PosedHead};

const SHADER: Module = module!("raster", "raster.wesl");
const RESOLVE_SHADER: Module = module!("raster_resolve", "resolve.wesl");

/// Large triangles of a head that the list holds; with more, all triangles are looked at again (`raster_rest`).
/// Close-ups have most: every triangle before a lamp that is fitted to what the camera sees.
const LARGE_CAPACITY: u32 = 131_072;
/// Workgroups that share the large triangles of a head.
const LARGE_GROUPS: u32 = 8192;

/// Columns of pixels of a workgroup of `raster_resolve`.
const RESOLVED_COLUMNS: u32 = 32;

/// What draws triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Rasteriser {
    /// The raster units of the device.
    Hardware,
    /// This pass; `wide` with 64-bit atomics.
    Compute { wide: bool },
}

impl Rasteriser {
    /// Whether depth is in images of floats, which no comparison sampler reads and no raster unit tests.
    pub(crate) fn stores_depth(self) -> bool {
        self != Self::Hardware
    }

    /// This pass on a device.
    pub(crate) fn compute(gpu: &Gpu) -> Self {
        Self::Compute { wide: gpu.device.features().contains(wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX) }
    }
}

/// What the pixels of a raster are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// Ids and reversed depth, for a camera.
    Camera { wide: bool },
    /// Depth of each light.
    Lights,
}

impl Sight {
    /// Names of the steps in measurements.
    fn labels(self) -> [&'static str; 4] {
        match self {
            Self::Camera { .. } => {
                ["visibility", "visibility large", "visibility rest", "visibility resolve"]
            }
            Self::Lights => ["shadow", "shadow large", "shadow rest", "shadow resolve"],
        }
    }
}

/// Numbers of a draw.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct DrawParams {
    pub(crate) size: [u32; 2],
    pub(crate) first: u32,
    pub(crate) count: u32,
    pub(crate) head: u32,
    pub(crate) padding: [u32; 3],
}

/// Numbers of the last step.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct ResolveParams {
    pub(crate) size: [u32; 2],
    pub(crate) layers: u32,
    pub(crate) padding: u32,
}

/// The shader that draws triangles; `second` for the pass that finds ids where atomics are narrow.
pub(crate) fn program(sight: Sight, cut: bool, second: bool) -> Program {
    Program::new(SHADER)
        .flag("camera", sight != Sight::Lights)
        .flag("wide", sight == Sight::Camera { wide: true })
        .flag("cut", cut)
        .flag("second", second)
        .constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
        .constant("MAX_HEADS", MAX_HEADS as u32)
        .constant("LARGE_CAPACITY", LARGE_CAPACITY)
        .constant("LARGE_GROUPS", LARGE_GROUPS)
}

/// The shader that makes images.
pub(crate) fn resolve_program(sight: Sight) -> Program {
    Program::new(RESOLVE_SHADER)
        .flag("camera", sight != Sight::Lights)
        .flag("wide", sight == Sight::Camera { wide: true })
}

/// Pipelines of a kind of triangle.
struct Fill {
    each: Kernel,
    large: Kernel,
    rest: Kernel,
}

/// The pipelines of a sight, and the keys of its pixels, which are zero between frames.
pub(crate) struct ComputeRaster {
    sight: Sight,
    whole: Fill,
    /// For triangles with holes, made by the first frame that has such.
    cut: Option<Fill>,
    /// Where atomics are narrow: those that find ids.
    second: Option<[Option<Fill>; 2]>,
    resolve: Kernel,
    pixels: wgpu::Buffer,
    nearest: wgpu::Buffer,
    large: wgpu::Buffer,
}

impl Fill {
    fn new(gpu: &Gpu, sight: Sight, cut: bool, second: bool) -> Self {
        let program = program(sight, cut, second);
        let [each, large, rest, _] = sight.labels();
        Self {
            each: Kernel::new(gpu, each, &program, "raster_each"),
            large: Kernel::new(gpu, large, &program, "raster_large"),
            rest: Kernel::new(gpu, rest, &program, "raster_rest"),
        }
    }
}

impl ComputeRaster {
    /// The pipelines of a sight, for triangles without holes.
    pub(crate) fn new(gpu: &Gpu, sight: Sight) -> Self {
        let narrow = sight == Sight::Camera { wide: false };
        Self {
            sight,
            whole: Fill::new(gpu, sight, false, false),
            cut: None,
            second: narrow.then(|| [Some(Fill::new(gpu, sight, false, true)), None]),
            resolve: Kernel::new(gpu, sight.labels()[3], &resolve_program(sight), "raster_resolve"),
            pixels: gpu.storage_zeroed("keys of pixels", 0),
            nearest: gpu.storage_zeroed("ids of pixels", 0),
            large: gpu.storage_zeroed("large triangles", 0),
        }
    }

    /// Bytes for the keys of a pixel.
    pub(crate) fn bytes_per_pixel(&self) -> u64 {
        if self.sight == (Sight::Camera { wide: true }) { 8 } else { 4 }
    }

    /// Makes what frames of `pixels` pixels and so many heads need, with or without holes.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, pixels: u64, heads: usize, has_holes: bool) {
        let large = 4 * (MAX_HEADS as u64 + 2 * u64::from(LARGE_CAPACITY) * heads.max(1) as u64);
        if self.large.size() != large {
            self.large = gpu.storage_zeroed("large triangles", large);
        }
        let bytes = pixels * self.bytes_per_pixel();
        // Keys are kept between frames, so what is much too large is given back.
        let fits = |buffer: &wgpu::Buffer, bytes: u64| {
            buffer.size() >= bytes && buffer.size() <= 4 * bytes.max(1 << 20)
        };
        if !fits(&self.pixels, bytes) {
            self.pixels = gpu.storage_zeroed("keys of pixels", bytes);
        }
        if self.second.is_some() && !fits(&self.nearest, bytes) {
            self.nearest = gpu.storage_zeroed("ids of pixels", bytes);
        }
        if has_holes {
            let sight = self.sight;
            self.cut.get_or_insert_with(|| Fill::new(gpu, sight, true, false));
            if let Some([_, cut]) = &mut self.second {
                cut.get_or_insert_with(|| Fill::new(gpu, sight, true, true));
            }
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.pixels.size() + self.nearest.size() + self.large.size()
    }

    /// Draws the opaque triangles of heads into `layers` layers. `sight` is `view` of a camera or `clips` of lights.
    fn fill(
        &self,
        r: &mut Recorder<'_>,
        sight: &Resource<'_>,
        heads: &[PosedHead<'_>],
        size: [u32; 2],
        layers: u32,
    ) {
        let numbers = |r: &Recorder<'_>, cut: bool| -> Vec<wgpu::Buffer> {
            let each = heads.iter().map(|h| {
                let whole = h.head.opaque_triangles - h.head.cut_triangles;
                let (first, count) = if cut { (whole, h.head.cut_triangles) } else { (0, whole) };
                r.uniform("raster", &DrawParams { size, first, count, head: h.index, padding: [0; 3] })
            });
            each.collect()
        };
        let whole = numbers(r, false);
        let second = self.second.as_ref();
        self.draw(r, &self.whole, sight, heads, &whole, layers, false);
        let cut = heads.iter().any(|h| h.head.cut_triangles > 0).then(|| numbers(r, true));
        if let (Some(fill), Some(cut)) = (&self.cut, &cut) {
            self.draw(r, fill, sight, heads, cut, layers, true);
        }
        if let Some([Some(fill), _]) = second {
            self.draw(r, fill, sight, heads, &whole, layers, false);
        }
        if let (Some([_, Some(fill)]), Some(cut)) = (second, &cut) {
            self.draw(r, fill, sight, heads, cut, layers, true);
        }
    }

    /// Draws the triangles of a kind: small ones, then the large ones that they leave.
    fn draw(
        &self,
        r: &mut Recorder<'_>,
        fill: &Fill,
        sight: &Resource<'_>,
        heads: &[PosedHead<'_>],
        numbers: &[wgpu::Buffer],
        layers: u32,
        cut: bool,
    ) {
        r.encoder.clear_buffer(&self.large, 0, Some(4 * MAX_HEADS as u64));
        let drawn: Vec<_> = heads
            .iter()
            .zip(numbers)
            .filter_map(|(h, number)| {
                let count =
                    if cut { h.head.cut_triangles } else { h.head.opaque_triangles - h.head.cut_triangles };
                let mut resources = match (count, cut) {
                    (0, _) => return None,
                    (_, true) => h.head.cut_resources()?,
                    (_, false) => vec![("points", h.head.opaque_points.bound())],
                };
                resources.extend([
                    sight.clone(),
                    ("draw", number.bound()),
                    ("positions", h.positions.bound()),
                    ("pixels", self.pixels.bound()),
                    ("nearest", self.nearest.bound()),
                    ("large", self.large.bound()),
                ]);
                Some((resources, count))
            })
            .collect();
        let each =
            drawn.iter().map(|(resources, count)| (resources.clone(), [count.div_ceil(64), layers, 1]));
        r.dispatch_each(&fill.each, each);
        let large = drawn.iter().map(|(resources, _)| (resources.clone(), [LARGE_GROUPS, 1, 1]));
        r.dispatch_each(&fill.large, large);
        // A list with room for every triangle is never too short.
        let rest = drawn
            .into_iter()
            .filter(|(_, count)| count * layers > LARGE_CAPACITY)
            .map(|(resources, count)| (resources, [count.div_ceil(64), layers, 1]));
        r.dispatch_each(&fill.rest, rest);
    }

    /// Ids (0 = nothing) and reversed depth of what a camera sees.
    pub(crate) fn record_camera(
        &self,
        r: &mut Recorder<'_>,
        view: &wgpu::Buffer,
        heads: &[PosedHead<'_>],
        size: [u32; 2],
    ) -> [Image; 2] {
        self.fill(r, &("view", view.bound()), heads, size, 1);
        let ids = r.image("ids", ImageSpec::storage(size, wgpu::TextureFormat::R32Uint));
        let depth = r.image("depth", ImageSpec::storage(size, wgpu::TextureFormat::R32Float));
        self.record_resolve(r, size, 1, &[("ids_out", ids.bound()), ("depth_out", depth.bound())]);
        [ids, depth]
    }

    /// Depth of what lights see, one layer each.
    pub(crate) fn record_lights(
        &self,
        r: &mut Recorder<'_>,
        clip_from_world: &[glam::Mat4],
        heads: &[PosedHead<'_>],
        side: u32,
    ) -> Image {
        let layers = clip_from_world.len().max(1) as u32;
        let size = [side; 2];
        let spec = ImageSpec::storage(size, wgpu::TextureFormat::R32Float).layers(layers);
        let depths = r.image("shadows", spec);
        if !clip_from_world.is_empty() {
            let clips = r.gpu.storage("shadow", clip_from_world);
            self.fill(r, &("clips", clips.bound()), heads, size, layers);
        }
        self.record_resolve(r, size, layers, &[("depths_out", depths.bound())]);
        depths
    }

    fn record_resolve(&self, r: &mut Recorder<'_>, size: [u32; 2], layers: u32, out: &[Resource<'_>]) {
        let params = r.uniform("raster", &ResolveParams { size, layers, padding: 0 });
        let mut resources = vec![
            ("resolve", params.bound()),
            ("pixels", self.pixels.bound()),
            ("nearest", self.nearest.bound()),
        ];
        resources.extend(out.iter().cloned());
        r.dispatch(
            &self.resolve,
            &resources,
            [size[0].div_ceil(RESOLVED_COLUMNS), size[1].div_ceil(8), layers],
        );
    }
}
