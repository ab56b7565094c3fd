//! One direction of a separable kernel: the pass that `separable` runs twice and `screen-gauss` twice a Gaussian.
//!
//! ```text
//! source (rgb, a = strength), depth --tile in workgroup memory--> target [, sum of Gaussians]
//! ```
//!
//! Theory: Jimenez et al. 2015; papers/004 ch. 6. The kernel is in millimetres on the surface and is projected with the
//! depth and field of view of each pixel; the surface is followed: a neighbour off the tangent plane of the centre
//! gives way to the centre.
//!
//! Differs from the source: it compares a neighbour with the tangent plane and not with the depth of the centre, so a
//! tilted cheek keeps its whole kernel, and shortens the kernel with the tilt (papers/004 eqs. 4.1 and 4.2, with the
//! cosine instead of tuned constants); taps between two texels weigh both, each with its own depth.
//!
//! A workgroup loads a tile of 64 x 8 pixels and as many around it as its widest kernel needs, once; tiles without
//! skin, or whose kernels are under half a pixel, only copy. Kernels that reach over more than 48 pixels read the images.
//! On software adapters, where barriers cost more than loads, every pixel reads the images.

use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use crate::passes::scatter::FOLLOW_PER_MM;

/// Pixels of a tile along the blur and across it.
const TILE: [u32; 2] = [64, 8];

/// Pairs of taps that a kernel can have.
pub(crate) const MAX_PAIRS: usize = 32;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) pair_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) half_width_mm: f32,
    pub(crate) visible_mm: f32,
    pub(crate) share: [f32; 4],
    pub(crate) pairs: [[f32; 4]; MAX_PAIRS],
}

impl Params {
    /// Taps on one side (R, G, B weight and offset in mm, ascending). A kernel that is invisible at `visible_mm` on
    /// half a pixel is skipped.
    pub(crate) fn new(side: &[([f64; 3], f64)], visible_mm: f64, share: [f64; 3]) -> Self {
        let mut pairs = [[0.0; 4]; MAX_PAIRS];
        for (slot, (w, offset_mm)) in pairs.iter_mut().zip(side) {
            *slot = [w[0] as f32, w[1] as f32, w[2] as f32, *offset_mm as f32];
        }
        Self {
            pair_count: side.len().min(MAX_PAIRS) as u32,
            follow_per_mm: FOLLOW_PER_MM,
            half_width_mm: side.last().map_or(0.0, |(_, x)| *x as f32),
            visible_mm: visible_mm as f32,
            share: [share[0] as f32, share[1] as f32, share[2] as f32, 0.0],
            pairs,
        }
    }
}

/// WGSL of one direction.
pub(crate) fn shader(vertical: bool, accumulate: bool) -> String {
    let source = concat!(
        include_str!("../../../shared/view.wgsl"),
        include_str!("../common.wgsl"),
        include_str!("line.wgsl")
    );
    let source = if accumulate { source.replace("//ACCUMULATE ", "") } else { source.to_owned() };
    format!("const VERTICAL = {vertical};\n{source}")
}

/// A pipeline for one direction.
pub(crate) struct Line {
    pipeline: wgpu::ComputePipeline,
    name: &'static str,
    /// Pixels of a workgroup, across and down.
    tile: [u32; 2],
}

impl Line {
    pub(crate) fn new(gpu: &Gpu, vertical: bool, accumulate: bool) -> Self {
        Self::with_tiles(gpu, vertical, accumulate, gpu.info.device_type != wgpu::DeviceType::Cpu)
    }

    /// Both ways to run the pass give the same picture.
    pub(crate) fn with_tiles(gpu: &Gpu, vertical: bool, accumulate: bool, tiled: bool) -> Self {
        let name = if vertical { "scatter vertical" } else { "scatter horizontal" };
        let entry = if tiled { "scatter" } else { "scatter_untiled" };
        let tile = match (tiled, vertical) {
            (false, _) => [8, 8],
            (true, false) => TILE,
            (true, true) => [TILE[1], TILE[0]],
        };
        let pipeline = gpu.compute_pipeline_without_clear(name, &shader(vertical, accumulate), entry);
        Self { pipeline, name, tile }
    }

    /// Blurs `source` into `target`; `sum` is (before, after) for a pipeline that accumulates.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        params: &wgpu::Buffer,
        depth: &wgpu::TextureView,
        [source, target]: [&wgpu::TextureView; 2],
        sum: Option<[&wgpu::TextureView; 2]>,
    ) {
        let texture = wgpu::BindingResource::TextureView;
        let mut resources = vec![
            view.as_entire_binding(),
            params.as_entire_binding(),
            texture(source),
            texture(depth),
            texture(target),
        ];
        resources.extend(sum.into_iter().flatten().map(texture));
        let group = gpu.bind(self.name, &self.pipeline, 0, &resources);
        let mut pass = timer.compute(encoder, self.name);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let size = target.texture().size();
        let [x, y] = self.tile;
        pass.dispatch_workgroups(size.width.div_ceil(x), size.height.div_ceil(y), 1);
    }
}
