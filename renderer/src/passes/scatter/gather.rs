//! One pass that gathers neighbours in two dimensions: `screen-jitter`, `burley-disk:N`, `reference-screen`.

use super::{FOLLOW_PER_MM, Images, Recorder};
use crate::gpu::Gpu;

/// A tap as gather.wgsl reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Tap {
    pub(crate) place: [f32; 4],
    pub(crate) weight: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) tap_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) half_width_mm: f32,
    pub(crate) visible_mm: f32,
    pub(crate) method: [f32; 4],
}

/// A method that is one such pass.
pub(crate) struct Gather {
    pipeline: wgpu::ComputePipeline,
    params: wgpu::Buffer,
    taps: wgpu::Buffer,
}

/// WGSL of the pass of a method.
pub(crate) fn shader(method: &str) -> String {
    let shared = concat!(
        include_str!("../../shared/view.wgsl"),
        include_str!("common.wgsl"),
        include_str!("gather.wgsl")
    );
    [shared, method].concat()
}

impl Gather {
    pub(crate) fn new(
        gpu: &Gpu,
        method: &str,
        taps: &[Tap],
        half_width_mm: f32,
        visible_mm: f32,
        numbers: [f32; 4],
    ) -> Self {
        let params = Params {
            tap_count: taps.len() as u32,
            follow_per_mm: FOLLOW_PER_MM,
            half_width_mm,
            visible_mm,
            method: numbers,
        };
        Self {
            pipeline: gpu.compute_pipeline("scatter", &shader(method), "scatter"),
            params: gpu.uniform("scatter", &params),
            taps: gpu.storage("scatter taps", taps),
        }
    }

    pub(crate) fn record(&self, r: &mut Recorder<'_>, images: &Images<'_>) {
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            r.view.as_entire_binding(),
            self.params.as_entire_binding(),
            self.taps.as_entire_binding(),
            texture(images.irradiance),
            texture(images.albedo),
            texture(images.depth),
            texture(images.scattered),
        ];
        let group = r.gpu.bind("scatter", &self.pipeline, 0, &resources);
        let mut pass = r.timer.compute(r.encoder, "scatter");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        let size = images.scattered.texture().size();
        pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
    }
}
