//! Motion since the previous frame, for antialiasing over time.
//!
//! ```text
//! id, positions and camera of this frame and the previous one --velocity--> pixels, x right, y down, without jitter
//! ```
//!
//! Theory: the point that a pixel sees keeps its barycentric coordinates, so its previous place is known exactly:
//! morphs, head motion and camera are all in the two sets of positions and matrices (papers/004 section 10.3.3).
//!
//! Hair and lashes mix their own motion in afterwards (see `cropped_hair` and `overlay`).
//!
//! Does not: follow what moves on the surface (blood, wrinkles).

use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;
use crate::passes::BLOCK_GROUP;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("../../shared/blocks.wgsl"),
    include_str!("velocity.wgsl")
);

/// What the pass reads of one head.
pub(crate) struct Moving<'a> {
    pub(crate) head: &'a HeadOnGpu,
    pub(crate) positions: &'a wgpu::Buffer,
    pub(crate) previous_positions: &'a wgpu::Buffer,
}

/// The pipeline of the pass.
pub(crate) struct Velocity {
    pipeline: wgpu::ComputePipeline,
}

impl Velocity {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("velocity", SHADER, "velocity_main") }
    }

    /// Heads in the order of their ids.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        heads: &[Moving<'_>],
        ids: &wgpu::TextureView,
        velocity: &wgpu::TextureView,
    ) {
        for (index, moving) in heads.iter().enumerate() {
            let number = gpu.uniform("head", &[index as u32, 0, 0, 0]);
            let group = gpu.bind(
                "velocity",
                &self.pipeline,
                0,
                &[
                    view.as_entire_binding(),
                    number.as_entire_binding(),
                    wgpu::BindingResource::TextureView(ids),
                    moving.positions.as_entire_binding(),
                    moving.previous_positions.as_entire_binding(),
                    moving.head.vertices.as_entire_binding(),
                    moving.head.triangles.as_entire_binding(),
                    wgpu::BindingResource::TextureView(velocity),
                ],
            );
            let mut pass = timer.compute(encoder, "velocity");
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            let size = velocity.texture().size();
            pass.dispatch_workgroups(size.width.div_ceil(BLOCK_GROUP), size.height.div_ceil(BLOCK_GROUP), 1);
        }
    }
}
