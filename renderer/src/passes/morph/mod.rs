//! Blend shapes: rest points to deformed points in world space, and how much of the sky they see.
//!
//! ```text
//! rest, deltas sorted by point, shape weights --morph--> positions (world, metres; w = ambient visibility)
//! ```
//!
//! Theory: linear blend shapes, `p = world_from_head (rest + sum_i w_i offset_i)` (Lewis et al. 2014, "Practice and
//! theory of blendshape facial models"). The thesis streams shapes out pass by pass (papers/004 section 7.6); here
//! one dispatch gathers, point by point, only the shapes that move the point.
//!
//! Ambient visibility follows by the same weights: what a shape changes at 0.5 and 1 was traced at import
//! (`rubor_rig::head::OcclusionChange`; `docs/occlusion.md` has its error). The sum over shapes is clamped to 0..1.
//!
//! Truth: `rubor_rig::deform::{deform_points, blend_occlusion}`.
//!
//! Does not: normals (see `surface_frames`), combination shapes (the rig resolves them to weights).
//!
//! Cost: reads 16 bytes a delta and a point once; bound by the launch on a large GPU.

use glam::Mat4;

use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;

/// WGSL of the pass.
pub(crate) const SHADER: &str = include_str!("morph.wgsl");

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) world_from_head: Mat4,
    pub(crate) point_count: u32,
    pub(crate) padding: [u32; 3],
}

/// The pipeline of the pass.
pub(crate) struct Morph {
    pipeline: wgpu::ComputePipeline,
}

impl Morph {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("morph", SHADER, "morph") }
    }

    /// Fills `positions` for a head whose weights are in `weights`.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        head: &HeadOnGpu,
        world_from_head: Mat4,
        weights: &wgpu::Buffer,
        positions: &wgpu::Buffer,
    ) {
        let params =
            gpu.uniform("morph", &Params { world_from_head, point_count: head.point_count, padding: [0; 3] });
        let group = gpu.bind(
            "morph",
            &self.pipeline,
            0,
            &[
                params.as_entire_binding(),
                head.rest.as_entire_binding(),
                head.delta_starts.as_entire_binding(),
                head.deltas.as_entire_binding(),
                weights.as_entire_binding(),
                positions.as_entire_binding(),
            ],
        );
        let mut pass = timer.compute(encoder, "morph");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(head.point_count.div_ceil(64), 1, 1);
    }
}
