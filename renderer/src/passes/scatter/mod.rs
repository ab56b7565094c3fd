//! Subsurface scattering in screen space: diffuse radiance of a white surface, blurred by the diffusion profile.
//!
//! ```text
//! irradiance (a = strength), depth --horizontal--> scratch --vertical--> scattered
//! ```
//!
//! `separable`: two passes of one 1D kernel (Jimenez et al. 2015; papers/004 ch. 6). The kernel is in millimetres on
//! the surface and is projected with the depth and field of view of each pixel; a neighbour at another depth, or one
//! that is not skin, counts as the centre (papers/004 section 4, "follow the surface").
//!
//! Does not: scatter across depth steps, or through thin parts (that is transmittance).

use rubor_rig::skin::kernel::SeparableKernel;

use crate::gpu::{Gpu, PassTimer};

/// WGSL of the pass.
pub(crate) const SEPARABLE: &str =
    concat!(include_str!("../../shared/view.wgsl"), include_str!("separable.wgsl"));

/// Samples that a kernel can have.
pub(crate) const MAX_SAMPLES: usize = 65;

/// Share of a neighbour that is given back to the centre for each millimetre of depth between the two. A step of 4 mm
/// (lip over teeth, wing of the nose over cheek) separates fully; the slope of a cheek does not.
const FOLLOW_PER_MM: f32 = 0.25;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) direction: [f32; 2],
    pub(crate) sample_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) samples: [[f32; 4]; MAX_SAMPLES],
}

/// The pipeline of the pass.
pub(crate) struct Scatter {
    pipeline: wgpu::ComputePipeline,
}

impl Scatter {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline("scatter", SEPARABLE, "scatter") }
    }

    /// Blurs `irradiance` into `scattered` by way of `scratch`.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        kernel: &SeparableKernel,
        depth: &wgpu::TextureView,
        [irradiance, scratch, scattered]: [&wgpu::TextureView; 3],
    ) {
        let steps = [
            ("scatter horizontal", [1.0, 0.0], irradiance, scratch),
            ("scatter vertical", [0.0, 1.0], scratch, scattered),
        ];
        for (name, direction, from, to) in steps {
            let params = gpu.uniform(name, &params(kernel, direction));
            let group = gpu.bind(
                name,
                &self.pipeline,
                0,
                &[
                    view.as_entire_binding(),
                    params.as_entire_binding(),
                    wgpu::BindingResource::TextureView(from),
                    wgpu::BindingResource::TextureView(depth),
                    wgpu::BindingResource::TextureView(to),
                ],
            );
            let mut pass = timer.compute(encoder, name);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            let size = to.texture().size();
            pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
        }
    }
}

/// The kernel as the shader reads it: the centre first.
fn params(kernel: &SeparableKernel, direction: [f32; 2]) -> Params {
    let n = kernel.offsets_mm.len().min(MAX_SAMPLES);
    let middle = n / 2;
    let order = std::iter::once(middle).chain((0..n).filter(|i| *i != middle));
    let mut samples = [[0.0; 4]; MAX_SAMPLES];
    for (slot, i) in samples.iter_mut().zip(order) {
        let [r, g, b] = kernel.weights[i].map(|w| w as f32);
        *slot = [r, g, b, kernel.offsets_mm[i] as f32];
    }
    Params { direction, sample_count: n as u32, follow_per_mm: FOLLOW_PER_MM, samples }
}
