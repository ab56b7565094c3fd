//! One direction of a separable kernel: the pass that `separable` runs twice and `screen-gauss` twice a Gaussian.
//!
//! ```text
//! source (rgb, a = depth), strength, depth --sampled along a line--> target [, sum of Gaussians]
//! ```
//!
//! Theory: Jimenez et al. 2015; papers/004 ch. 6. The kernel is in millimetres on the surface and is projected with the
//! depth and field of view of each pixel; the surface is followed: a neighbour off the tangent plane of the centre
//! gives way to the centre.
//!
//! Differs from the source: it compares a neighbour with the tangent plane and not with the depth of the centre, so a
//! tilted cheek keeps its whole kernel, and shortens the kernel with the tilt (papers/004 eqs. 4.1 and 4.2, with the
//! cosine instead of tuned constants). A tap is one bilinear sample of light and depth together; only where that is
//! off the plane, and may be a mixture of two surfaces, it is two texels that go by their own depths.
//!
//! Limits: depth beside light is a half, exact to 0.06 mm at 100 mm from the nearest head's middle and to 0.5 mm at 1 m.
//!
//! Cost: docs/scatter.md says what bounds it on a GPU, and what else was tried (tiles in workgroup memory, one pixel an
//! invocation, rows of invocations along the kernel).

use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use crate::passes::scatter::{FOLLOW_PER_MM, Images};

/// Pixels of a workgroup, across and down.
const GROUP: [u32; 2] = [32, 8];

/// Pairs of taps that a kernel can have.
pub(crate) const MAX_PAIRS: usize = 32;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) pair_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) visible_mm: f32,
    pub(crate) level: u32,
    pub(crate) share: [f32; 4],
    pub(crate) share_coarser: [f32; 4],
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
            visible_mm: visible_mm as f32,
            level: 0,
            share: [share[0] as f32, share[1] as f32, share[2] as f32, 0.0],
            share_coarser: [0.0; 4],
            pairs,
        }
    }
}

/// What a pass does with its result besides writing it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sum {
    None,
    /// Blends it into a sum.
    Own,
    /// As `Own`, and adds the sum of the next level.
    WithCoarser,
}

/// WGSL of one direction; `levels` for images that may be smaller than the view.
pub(crate) fn shader(vertical: bool, levels: bool, sum: Sum) -> String {
    let mut source = concat!(
        include_str!("../../../shared/view.wgsl"),
        include_str!("../common.wgsl"),
        include_str!("line.wgsl")
    )
    .to_owned();
    for (of, mark) in [(Sum::Own, "//ACCUMULATE "), (Sum::WithCoarser, "//COARSER ")] {
        if sum >= of {
            source = source.replace(mark, "");
        }
    }
    format!("const VERTICAL = {vertical};\nconst LEVELS = {levels};\n{source}")
}

/// A pipeline for one direction.
pub(crate) struct Line {
    pipeline: wgpu::ComputePipeline,
    name: &'static str,
    linear: wgpu::Sampler,
}

impl Line {
    pub(crate) fn new(gpu: &Gpu, vertical: bool, levels: bool, sum: Sum) -> Self {
        let name = if vertical { "scatter vertical" } else { "scatter horizontal" };
        let linear = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some(name),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let pipeline = gpu.compute_pipeline(name, &shader(vertical, levels, sum), "scatter");
        Self { pipeline, name, linear }
    }

    /// Blurs `source` into `target`; `sums` are before and after for a pipeline that sums up, and what is coarser.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        params: &wgpu::Buffer,
        images: &Images<'_>,
        [source, target]: [&wgpu::TextureView; 2],
        sums: &[&wgpu::TextureView],
    ) {
        let texture = wgpu::BindingResource::TextureView;
        let mut resources = vec![
            view.as_entire_binding(),
            params.as_entire_binding(),
            texture(source),
            texture(images.albedo),
            texture(images.depth),
            wgpu::BindingResource::Sampler(&self.linear),
            texture(target),
        ];
        resources.extend(sums.iter().copied().map(texture));
        let group = gpu.bind(self.name, &self.pipeline, 0, &resources);
        let mut pass = timer.compute(encoder, self.name);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let size = target.texture().size();
        let [x, y] = GROUP;
        pass.dispatch_workgroups(size.width.div_ceil(x), size.height.div_ceil(y), 1);
    }
}
