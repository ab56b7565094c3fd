//! From radiance to the displayed picture.
//!
//! ```text
//! hdr --display--> image (rgba8unorm, sRGB transfer, opaque)
//! ```
//!
//! Theory: exposure, the filmic curve of Hable 2010 (Jimenez 2012 section 8.3 and ch. 11: "really crisp blacks") or none,
//! IEC 61966-2-1 transfer.

#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::block_groups;
use crate::passes::resolve::TONE;
use crate::settings::{Look, ToneMap};

const SHADER: Module = module!("display", "display.wesl");

/// The shader of the pass.
pub(crate) fn program(tone_map: ToneMap) -> Program {
    Program::new(SHADER).with(&[TONE]).constant("FILMIC", tone_map == ToneMap::Filmic)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) exposure: f32,
    pub(crate) padding: [u32; 3],
}

/// The pipeline of the pass.
pub(crate) struct Display {
    kernel: Kernel,
}

impl Display {
    pub(crate) fn new(gpu: &Gpu, tone_map: ToneMap) -> Self {
        Self { kernel: Kernel::new(gpu, "display", &program(tone_map), "display") }
    }

    /// Converts radiance to display values.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, look: &Look, hdr: &Image) -> Image {
        let image = r.image("displayed", ImageSpec::storage(hdr.size(), wgpu::TextureFormat::Rgba8Unorm));
        self.record_into(r, look, hdr, image.view());
        image
    }

    /// The same, into a given image of the same size.
    pub(crate) fn record_into(
        &self,
        r: &mut Recorder<'_>,
        look: &Look,
        hdr: &Image,
        image: &wgpu::TextureView,
    ) {
        let params = r.uniform("display", &Params { exposure: look.exposure, padding: [0; 3] });
        let resources = [("params", params.bound()), ("hdr", hdr.bound()), ("image", image.bound())];
        r.dispatch(&self.kernel, &resources, block_groups(hdr.size()));
    }
}
