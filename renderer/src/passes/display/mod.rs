//! From radiance to the displayed picture.
//!
//! ```text
//! hdr, spread light --display--> image (sRGB transfer, opaque: rgba8unorm, or rgba16float where grain or dither follow)
//! ```
//!
//! Theory, in this order:
//! - bloom: `(1 - w) hdr + spread light`, which [`super::lens::bloom`] makes;
//! - vignette: the irradiance of a sensor falls off with the fourth power of the cosine of the angle to the axis of the
//!   lens (`cos^4`), here to the power of the setting;
//! - white balance: [`white_balance`];
//! - exposure: a factor and stops;
//! - tone map: [`ToneMap`]; each is monotone for greys, and red, green and blue are given to it as they are;
//! - IEC 61966-2-1 transfer.
//!
//! Does not: change alpha, which is 1; tell what lies outside of the gamut of the display, which is cut off.
//!
//! Costs: bloom one bilinear tap and all else arithmetic of the same pass; what is off is not compiled.

#[cfg(test)]
mod tests;
pub(crate) mod white_balance;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::block_groups;
use crate::passes::lens::bloom::Spread;
use crate::passes::lens::linear_clamp;
use crate::passes::resolve::TONE;
use crate::scene::Camera;
use crate::settings::{Look, ToneMap};

const SHADER: Module = module!("display", "display.wesl");
const CURVES: Module = module!("curves", "curves.wesl");

/// What the shader is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flavour {
    pub(crate) tone_map: ToneMap,
    pub(crate) is_balanced: bool,
    pub(crate) has_vignette: bool,
    pub(crate) has_bloom: bool,
    /// Whether values stay unrounded, for noise that follows.
    pub(crate) halves: bool,
}

impl Flavour {
    pub(crate) fn of(look: &Look) -> Self {
        Self {
            tone_map: look.tone_map,
            is_balanced: look.is_balanced(),
            has_vignette: look.vignette > 0.0,
            has_bloom: look.bloom > 0.0,
            halves: look.has_noise(),
        }
    }
}

/// The shader of the pass.
pub(crate) fn program(flavour: Flavour) -> Program {
    let curve = match flavour.tone_map {
        ToneMap::Linear => 0u32,
        ToneMap::Filmic => 1,
        ToneMap::Aces => 2,
        ToneMap::Agx => 3,
        ToneMap::Neutral => 4,
    };
    Program::new(SHADER)
        .with(&[TONE, CURVES])
        .constant("FILMIC", flavour.tone_map == ToneMap::Filmic)
        .constant("CURVE", curve)
        .flag("balanced", flavour.is_balanced)
        .flag("vignetted", flavour.has_vignette)
        .flag("bloomed", flavour.has_bloom)
        .flag("halves", flavour.halves)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) exposure: f32,
    pub(crate) spread: f32,
    pub(crate) falloff: f32,
    pub(crate) padding: u32,
    pub(crate) tangents: [f32; 2],
    pub(crate) size: [f32; 2],
    pub(crate) balance_r: [f32; 4],
    pub(crate) balance_g: [f32; 4],
    pub(crate) balance_b: [f32; 4],
}

impl Params {
    fn new(look: &Look, camera: &Camera, size: [u32; 2], spread: f32) -> Self {
        let rows = white_balance::matrix(look.temperature, look.tint).transpose();
        let row = |i| rows.col(i).as_vec3().extend(0.0).to_array();
        let [width, height] = size.map(|n| n as f32);
        let tangent = (0.5 * camera.fov_degrees.to_radians()).tan();
        Self {
            exposure: look.gain(),
            spread,
            falloff: 4.0 * look.vignette,
            padding: 0,
            tangents: [tangent * width / height, tangent],
            size: [width, height],
            balance_r: row(0),
            balance_g: row(1),
            balance_b: row(2),
        }
    }
}

/// The pipeline of the pass.
pub(crate) struct Display {
    flavour: Flavour,
    kernel: Kernel,
    linear_clamp: wgpu::Sampler,
}

impl Display {
    pub(crate) fn new(gpu: &Gpu, flavour: Flavour) -> Self {
        let kernel = Kernel::new(gpu, "display", &program(flavour), "display");
        Self { flavour, kernel, linear_clamp: linear_clamp(gpu) }
    }

    pub(crate) fn flavour(&self) -> Flavour {
        self.flavour
    }

    /// Format of the picture.
    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        match self.flavour.halves {
            true => wgpu::TextureFormat::Rgba16Float,
            false => wgpu::TextureFormat::Rgba8Unorm,
        }
    }

    /// Converts radiance to display values. `spread` is the light of bloom, where the flavour has it.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        look: &Look,
        camera: &Camera,
        hdr: &Image,
        spread: Option<&Spread>,
    ) -> Image {
        let image = r.image("displayed", ImageSpec::storage(hdr.size(), self.format()));
        self.record_into(r, look, camera, hdr, spread, image.view());
        image
    }

    /// The same, into a given image of the same size and of the format of the pass.
    pub(crate) fn record_into(
        &self,
        r: &mut Recorder<'_>,
        look: &Look,
        camera: &Camera,
        hdr: &Image,
        spread: Option<&Spread>,
        image: &wgpu::TextureView,
    ) {
        let params = Params::new(look, camera, hdr.size(), spread.map_or(0.0, |s| s.share));
        let params = r.uniform("display", &params);
        let resources = [
            ("params", params.bound()),
            ("hdr", hdr.bound()),
            ("spread_light", spread.map_or(hdr, |s| &s.light).bound()),
            ("linear_clamp", self.linear_clamp.bound()),
            ("image", image.bound()),
        ];
        r.dispatch(&self.kernel, &resources, block_groups(hdr.size()));
    }
}
