//! `separable:N`: two passes of one kernel of N taps (Jimenez et al. 2015; Jimenez 2012 ch. 6).
//!
//! ```text
//! irradiance --line, horizontal--> scratch --line, vertical--> scattered
//! ```
//!
//! The kernel is the line spread function of the profile: exact for light that varies along one axis.
//! Fails where two directions of light or surface meet: a spot of light gets a squarish halo.

use rubor_rig::skin::kernel::SeparableKernel;
use rubor_rig::skin::profile::Profile;

use super::line::{Line, Params, Sum, Sums};
use crate::device::{Gpu, Image, ImageSpec, Recorder};
use crate::error::RenderError;
use crate::passes::diffusion::Diffusion;
use crate::passes::shade::Lit;
use crate::scene::PosedHead;
use crate::scene::view::Seen;

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
}

impl Diffusion for Separable {
    fn after_shading(&mut self, r: &mut Recorder<'_>, _: &[PosedHead<'_>], seen: &Seen, lit: &Lit) -> Image {
        let spec = ImageSpec::light(lit.irradiance.size());
        let [scratch, scattered] = ["scatter scratch", "scattered"].map(|label| r.image(label, spec));
        let [horizontal, vertical] = &self.lines;
        horizontal.record(r, &self.params, seen, lit, [&lit.irradiance, &scratch], Sums::default());
        vertical.record(r, &self.params, seen, lit, [&scratch, &scattered], Sums::default());
        scattered
    }
}
