//! Colour and wrinkles of a frame: hemoglobin distributions and wrinkle zones summed by their weights.
//!
//! ```text
//! bias_i - mu_n, scale_i - 1, weights --+--appearance--> blood    (change of bias, change of scale, mu_n)
//! zone masks, weights ------------------+              > wrinkles (weight of each wrinkle map, 0 to 1; four per layer)
//! ```
//!
//! Theory: Jimenez 2012 eq. 7.6 and section 8.2. Eq. 7.6 is written as changes of the neutral,
//! `H = H_n + sum_i w_i (bias_i - mu_n) + (sum_i w_i (scale_i - 1)) (H_n - mu_n)`, which is the same for weights that
//! sum to one with the neutral and gives the neutral map exactly when all weights are zero.
//!
//! Differs from the thesis: the sums are taken once for each of the 256 x 256 low-resolution texels instead of once
//! per pixel, so a pixel costs two fetches for any number of distributions and zones.
//!
//! Does not: clamp hemoglobin to its physical range (that needs `H_n`: see `shade`).

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::scene::footprint::APPEARANCE_SIZE;
use crate::scene::head::MapsOnGpu;
use crate::scene::posed_head::wrinkle_layers;
use crate::scene::{MAX_DISTRIBUTIONS, MAX_ZONES, PosedHead};
use crate::settings::ColorMethod;

const SHADER: Module = module!("appearance", "appearance.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
        .constant("MAX_DISTRIBUTIONS", MAX_DISTRIBUTIONS as u32)
        .constant("MAX_ZONES", MAX_ZONES as u32)
}

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

/// The pipeline of the pass.
pub(crate) struct Appearance {
    kernel: Kernel,
    linear_clamp: wgpu::Sampler,
}

impl Appearance {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            kernel: Kernel::new(gpu, "appearance", &program(), "appearance"),
            linear_clamp: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("appearance"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
        }
    }

    /// Blends the maps of heads by the weights of their states.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, heads: &[PosedHead<'_>], color: ColorMethod) {
        let with_maps: Vec<_> = heads
            .iter()
            .filter_map(|h| h.head.maps.as_ref().map(|maps| (h, maps)))
            .map(|(h, maps)| (h, maps, r.uniform("appearance", &params(h, maps, color))))
            .collect();
        let each = with_maps.iter().map(|(h, maps, params)| {
            let resources = vec![
                ("params", params.bound()),
                ("distributions", maps.distributions.bound()),
                ("neutral_mean", maps.neutral_mean.bound()),
                ("masks", maps.masks.bound()),
                ("linear_clamp", self.linear_clamp.bound()),
                ("blood", h.blood.bound()),
                ("wrinkles", h.wrinkle_weights.bound()),
            ];
            (resources, [APPEARANCE_SIZE / 8, APPEARANCE_SIZE / 8, 1])
        });
        r.dispatch_each(&self.kernel, each);
    }
}

fn params(posed: &PosedHead<'_>, maps: &MapsOnGpu, color: ColorMethod) -> Params {
    let distributions: &[f32] = match color {
        ColorMethod::Static => &[],
        ColorMethod::Hemoglobin => &posed.state.distributions,
    };
    let zones = &posed.state.zones;
    let filled = |from: &[f32]| {
        let mut values = [0.0; 64];
        for (v, w) in values.iter_mut().zip(from) {
            *v = *w;
        }
        values
    };
    let mut zone_maps = [0; MAX_ZONES];
    zone_maps[..maps.zone_maps.len()].copy_from_slice(&maps.zone_maps);
    Params {
        distribution_count: maps.distribution_count.min(distributions.len() as u32),
        zone_count: (maps.zone_maps.len() as u32).min(zones.len() as u32),
        wrinkle_layers: wrinkle_layers(maps.wrinkle_maps),
        padding: 0,
        distribution_weights: filled(distributions),
        zone_weights: filled(zones),
        zone_maps,
    }
}

#[cfg(test)]
mod tests;
