//! Puts the picture together: scattered diffuse light times albedo, plus what was not scattered, over the background.
//!
//! ```text
//! scattered, albedo, direct, depth --compose--> hdr (linear Rec. 709 radiance; a = coverage)
//! ```
//!
//! Theory: post-scatter texturing (d'Eon and Luebke 2007; papers/004 section 7.6): measured albedo already holds the
//! blur of scattering, so it multiplies after the blur.

use glam::Vec3;

use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use crate::passes::BLOCK_GROUP;

/// WGSL of the pass.
pub(crate) const SHADER: &str =
    concat!(include_str!("../../shared/blocks.wgsl"), include_str!("compose.wgsl"));

/// The pipeline of the pass.
pub(crate) struct Compose {
    pipeline: wgpu::ComputePipeline,
}

impl Compose {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("compose", SHADER, "compose") }
    }

    /// `inputs`: scattered, albedo, direct, depth.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        background_linear: Vec3,
        inputs: [&wgpu::TextureView; 4],
        hdr: &wgpu::TextureView,
    ) {
        let params = gpu.uniform("compose", &background_linear.extend(0.0));
        let [scattered, albedo, direct, depth] = inputs.map(wgpu::BindingResource::TextureView);
        let output = wgpu::BindingResource::TextureView(hdr);
        let resources = [params.as_entire_binding(), scattered, albedo, direct, depth, output];
        let group = gpu.bind("compose", &self.pipeline, 0, &resources);
        let mut pass = timer.compute(encoder, "compose");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let size = hdr.texture().size();
        pass.dispatch_workgroups(size.width.div_ceil(BLOCK_GROUP), size.height.div_ceil(BLOCK_GROUP), 1);
    }
}
