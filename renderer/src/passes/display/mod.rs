//! From radiance to the picture that a person sees.
//!
//! ```text
//! hdr (samples x samples pixels each) --display--> image (rgba8unorm, sRGB transfer, opaque)
//! ```
//!
//! Theory: exposure, the filmic curve of Hable 2010 (papers/004 section 8.3 and ch. 11: "really crisp blacks"),
//! IEC 61966-2-1 transfer. With more than one sample a pixel (`ssaa`), each sample is tone mapped before the mean.

use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use crate::passes::BLOCK_GROUP;

/// WGSL of the pass.
pub(crate) const SHADER: &str =
    concat!(include_str!("../../shared/blocks.wgsl"), include_str!("display.wgsl"));

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) exposure: f32,
    pub(crate) samples: u32,
    pub(crate) padding: [u32; 2],
}

/// The pipeline of the pass.
pub(crate) struct Display {
    pipeline: wgpu::ComputePipeline,
}

impl Display {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("display", SHADER, "display") }
    }

    /// `exposure` multiplies radiance; `samples` is the number of frame pixels on a side of an image pixel.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        exposure: f32,
        samples: u32,
        hdr: &wgpu::TextureView,
        image: &wgpu::TextureView,
    ) {
        let params = gpu.uniform("display", &Params { exposure, samples, padding: [0; 2] });
        let group = gpu.bind(
            "display",
            &self.pipeline,
            0,
            &[
                params.as_entire_binding(),
                wgpu::BindingResource::TextureView(hdr),
                wgpu::BindingResource::TextureView(image),
            ],
        );
        let mut pass = timer.compute(encoder, "display");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let size = image.texture().size();
        pass.dispatch_workgroups(size.width.div_ceil(BLOCK_GROUP), size.height.div_ceil(BLOCK_GROUP), 1);
    }
}
