//! Supersampling: averages samples x samples pixels of the frame into one pixel of the picture, as radiance.
//!
//! ```text
//! hdr (samples x samples pixels each) --resolve--> hdr (linear Rec. 709 radiance; a = coverage)
//! ```
//!
//! Theory: a bright highlight must not swallow the edge that it stands on, so the mean is taken of display values
//! (B. Karis 2013, "Tone mapping" of samples) and converted back by the inverse of the tone map. Lens and display then
//! work at the size of the picture, and the displayed value is the mean of the samples' displayed values but for the
//! rounding of a half float. The filmic curve stands for all tone maps but the linear one: it can be inverted, and only the weights of
//! samples depend on it.
//!
//! Costs nothing with one sample: the pass does not run.

#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::pixel_groups;
use crate::settings::{Look, ToneMap};

const SHADER: Module = module!("resolve", "resolve.wesl");
/// The tone map and its inverse.
pub(crate) const TONE: Module = module!("tone", "../../shared/tone.wesl");

/// The shader of the pass.
pub(crate) fn program(tone_map: ToneMap) -> Program {
    Program::new(SHADER).with(&[TONE]).constant("FILMIC", tone_map != ToneMap::Linear)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) exposure: f32,
    pub(crate) samples: u32,
    pub(crate) padding: [u32; 2],
}

/// The pipeline of the pass.
pub(crate) struct Resolve {
    kernel: Kernel,
}

impl Resolve {
    pub(crate) fn new(gpu: &Gpu, tone_map: ToneMap) -> Self {
        Self { kernel: Kernel::new(gpu, "resolve", &program(tone_map), "resolve_samples") }
    }

    /// One pixel for `samples` x `samples`; the image itself where `samples` is one.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, look: &Look, samples: u32, hdr: Image) -> Image {
        if samples == 1 {
            return hdr;
        }
        let size = hdr.size().map(|n| n / samples);
        let resolved = r.image("resolved", ImageSpec::light(size));
        let params = r.uniform("resolve", &Params { exposure: look.gain(), samples, padding: [0; 2] });
        let resources = [("params", params.bound()), ("hdr", hdr.bound()), ("resolved", resolved.bound())];
        r.dispatch(&self.kernel, &resources, pixel_groups(size));
        resolved
    }
}
