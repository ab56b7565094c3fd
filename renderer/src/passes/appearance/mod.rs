//! Colour and wrinkles of the moment: hemoglobin distributions and wrinkle zones summed by their weights.
//!
//! ```text
//! bias_i - mu_n, scale_i - 1, weights --+--appearance--> blood    (change of bias, change of scale, mu_n)
//! zone masks, weights ------------------+              > wrinkles (weight of each wrinkle map, 0 to 1; four a layer)
//! ```
//!
//! Theory: papers/004 eq. 7.6 and section 8.2. Eq. 7.6 is written as changes of the neutral,
//! `H = H_n + sum_i w_i (bias_i - mu_n) + (sum_i w_i (scale_i - 1)) (H_n - mu_n)`, which is the same for weights that
//! sum to one with the neutral and gives the neutral map exactly when all weights are zero.
//!
//! Differs from the thesis: the sums are taken once for each of the 256 x 256 low-resolution texels instead of once
//! a pixel, so a pixel pays two fetches however many distributions and zones there are.
//!
//! Does not: clamp hemoglobin to its physical range (that needs `H_n`: see `shade`).

use crate::gpu::Gpu;
use crate::head::{APPEARANCE_SIZE, MAX_DISTRIBUTIONS, MAX_ZONES, MapsOnGpu};
use crate::pass_timer::PassTimer;

/// WGSL of the pass.
pub(crate) const SHADER: &str = include_str!("appearance.wgsl");

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) distribution_count: u32,
    pub(crate) zone_count: u32,
    pub(crate) wrinkle_layers: u32,
    pub(crate) padding: u32,
    pub(crate) distribution_weights: [f32; MAX_DISTRIBUTIONS],
    pub(crate) zone_weights: [f32; MAX_ZONES],
    pub(crate) zone_maps: [u32; MAX_ZONES],
}

/// The maps that the pass makes for one head.
pub(crate) struct Blended {
    pub(crate) blood: wgpu::TextureView,
    pub(crate) wrinkles: wgpu::TextureView,
}

impl Blended {
    /// For a head with `wrinkle_maps` of them.
    pub(crate) fn new(gpu: &Gpu, wrinkle_maps: u32) -> Self {
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
        let wrinkles = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("wrinkle weights"),
            size: wgpu::Extent3d {
                width: APPEARANCE_SIZE,
                height: APPEARANCE_SIZE,
                depth_or_array_layers: layers_of(wrinkle_maps),
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage,
            view_formats: &[],
        });
        Self {
            blood: gpu
                .target("blood", [APPEARANCE_SIZE; 2], wgpu::TextureFormat::Rgba16Float, usage)
                .create_view(&Default::default()),
            wrinkles: crate::texture::array_view_of(&wrinkles),
        }
    }

    /// Whether a head with `wrinkle_maps` of them can use it.
    pub(crate) fn fits(&self, wrinkle_maps: u32) -> bool {
        self.wrinkles.texture().depth_or_array_layers() == layers_of(wrinkle_maps)
    }
}

/// Four wrinkle maps have their weights in one layer.
fn layers_of(wrinkle_maps: u32) -> u32 {
    wrinkle_maps.div_ceil(4).max(1)
}

/// The pipeline of the pass.
pub(crate) struct Appearance {
    pipeline: wgpu::ComputePipeline,
    sampler: wgpu::Sampler,
}

impl Appearance {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("appearance"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self { pipeline: gpu.compute_pipeline("appearance", SHADER, "appearance"), sampler }
    }

    /// Blends for weights of a [`rubor_rig::face_state::FaceState`].
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        maps: &MapsOnGpu,
        distributions: &[f32],
        zones: &[f32],
        into: &Blended,
    ) {
        let filled = |from: &[f32]| {
            let mut values = [0.0; 64];
            for (v, w) in values.iter_mut().zip(from) {
                *v = *w;
            }
            values
        };
        let mut zone_maps = [0; MAX_ZONES];
        zone_maps[..maps.zone_maps.len()].copy_from_slice(&maps.zone_maps);
        let params = Params {
            distribution_count: maps.distribution_count.min(distributions.len() as u32),
            zone_count: (maps.zone_maps.len() as u32).min(zones.len() as u32),
            wrinkle_layers: layers_of(maps.wrinkle_maps),
            padding: 0,
            distribution_weights: filled(distributions),
            zone_weights: filled(zones),
            zone_maps,
        };
        let params = gpu.uniform("appearance", &params);
        let group = gpu.bind(
            "appearance",
            &self.pipeline,
            0,
            &[
                params.as_entire_binding(),
                wgpu::BindingResource::TextureView(&maps.distributions),
                wgpu::BindingResource::TextureView(&maps.neutral_mean),
                wgpu::BindingResource::TextureView(&maps.masks),
                wgpu::BindingResource::Sampler(&self.sampler),
                wgpu::BindingResource::TextureView(&into.blood),
                wgpu::BindingResource::TextureView(&into.wrinkles),
            ],
        );
        let mut pass = timer.compute(encoder, "appearance");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(APPEARANCE_SIZE / 8, APPEARANCE_SIZE / 8, 1);
    }
}

#[cfg(test)]
mod tests;
