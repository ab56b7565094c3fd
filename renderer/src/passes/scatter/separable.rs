//! `separable:N`: two passes of one kernel of N taps (Jimenez et al. 2015; papers/004 ch. 6).
//!
//! ```text
//! irradiance --line, horizontal--> scratch --line, vertical--> scattered
//! ```
//!
//! The kernel is the line spread function of the profile: exact for light that varies along one axis.
//! Fails where two directions of light or surface meet: a spot of light gets a squarish halo.

use rubor_rig::skin::kernel::SeparableKernel;
use rubor_rig::skin::profile::Profile;

use super::line::{Line, Params, Sum};
use super::{Images, Recorder};
use crate::error::RenderError;
use crate::gpu::Gpu;

/// The method, ready for one profile.
pub(crate) struct Separable {
    lines: [Line; 2],
    params: wgpu::Buffer,
}

/// The taps on one side of a kernel.
pub(crate) fn side(kernel: &SeparableKernel) -> Vec<([f64; 3], f64)> {
    let middle = kernel.offsets_mm.len() / 2;
    kernel.weights.iter().copied().zip(kernel.offsets_mm.iter().copied()).skip(middle + 1).collect()
}

impl Separable {
    pub(crate) fn new(gpu: &Gpu, profile: &Profile, samples: usize) -> Result<Self, RenderError> {
        let kernel = SeparableKernel::of(profile, samples)?;
        let params = Params::new(&side(&kernel), kernel.half_width_mm(), [0.0; 3]);
        Ok(Self {
            lines: [false, true].map(|vertical| Line::new(gpu, vertical, false, Sum::None)),
            params: gpu.uniform("separable", &params),
        })
    }

    pub(crate) fn record(&self, r: &mut Recorder<'_>, images: &Images<'_>) {
        let steps = [[images.irradiance, images.scratch], [images.scratch, images.scattered]];
        for (line, step) in self.lines.iter().zip(steps) {
            line.record(r.gpu, r.encoder, r.timer, r.view, &self.params, images, step, &[]);
        }
    }
}
