//! What a lens and a film do to the light: blur out of focus, spread around bright places, grain.
//!
//! ```text
//! resolve --depth_of_field--> hdr --bloom--> spread light --display--> display values --antialias--grain--> 8 bits
//! ```
//!
//! Blur and bloom work on radiance, as light does in a lens; bloom comes second, because it spreads light that the lens has
//! already blurred. Grain is on the film behind the lens, after everything that looks for edges: antialiasing would smooth
//! it away, or take it for edges, and the history of `smaa-t2x` would average it. A stage that is off runs no pass and has no image.

pub(crate) mod bloom;
pub(crate) mod depth_of_field;
pub(crate) mod grain;

use crate::device::Gpu;

/// A sampler that filters and repeats the border.
pub(crate) fn linear_clamp(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("linear clamp"),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    })
}
