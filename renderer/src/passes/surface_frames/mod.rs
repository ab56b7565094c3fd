//! Normals and tangents of the deformed surface.
//!
//! ```text
//! positions, triangles around each point --surface_frames--> normal, tangent, bitangent sign, occlusion
//! ```
//!
//! Theory: the normal of a point is the area-weighted mean of its triangles' normals; the tangent follows u, made
//! orthogonal to the normal (Lengyel 2001). Recomputed from the deformed triangles, so it is right for every weight;
//! blending the normals of shapes, the usual way, is not once two shapes meet.
//!
//! Truth: `rubor_rig::deform::{point_normals, vertex_tangents}`.
//!
//! Cost: every vertex reads its ring of about six triangles; the positions stay in cache.

use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("surface_frames.wgsl")
);

/// Bytes of a frame in the buffer that the pass fills: normal, occlusion, tangent, sign.
pub(crate) const FRAME_BYTES: u64 = 32;

/// The pipeline of the pass.
pub(crate) struct SurfaceFrames {
    pipeline: wgpu::ComputePipeline,
}

impl SurfaceFrames {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("surface frames", SHADER, "surface_frames") }
    }

    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        head: &HeadOnGpu,
        positions: &wgpu::Buffer,
        frames: &wgpu::Buffer,
    ) {
        let group = gpu.bind(
            "surface frames",
            &self.pipeline,
            0,
            &[
                positions.as_entire_binding(),
                head.vertices.as_entire_binding(),
                head.triangles.as_entire_binding(),
                head.ring_starts.as_entire_binding(),
                head.ring.as_entire_binding(),
                frames.as_entire_binding(),
            ],
        );
        let mut pass = timer.compute(encoder, "surface frames");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(head.vertex_count.div_ceil(64), 1, 1);
    }
}
