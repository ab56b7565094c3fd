//! Film grain and dither: the last step, on the antialiased picture, before 8 bits.
//!
//! ```text
//! displayed, antialiased (rgba16float) --grain--> image (rgba8unorm)
//! ```
//!
//! Theory: the density of a developed film varies from place to place; its standard deviation in a circle of 48
//! micrometres, times 1000, is the RMS granularity that makers of film state, and it falls with the square root of the area
//! (Selwyn 1935). A pixel is an area of the sensor, so pictures of more pixels have more grain in each. Areas smaller than a
//! grain vary no more than a grain. On paper or screen a film is seen through an S-shaped curve; for the
//! logistic one, `v = 1 / (1 + e^-x)` of the logarithm x of exposure, the derivative is `v (1 - v)`:
//!
//! ```text
//! v' = v + v (1 - v) s n,   s = ln 10 G / 1000 sqrt(A_48 / (A_pixel + A_grain)),   n: mean 0, variance 1
//! ```
//!
//! So mid-tones have most of it and black and white none, its mean is zero, no value leaves 0 to 1, and while `|s n| <= 1`
//! (limited to that) brighter stays brighter. Part of the noise is common to the three channels, the rest their own, as the
//! dyes of a colour film lie in layers.
//!
//! Noise is a hash of pixel, channel and frame number: the same in any order of frames, still in a still frame. Dither is
//! triangular noise of one step either way, which makes mean and variance of the error of rounding independent of the value (Lipshitz,
//! Wannamaker and Vanderkooy 1992); within half a step of black and white the triangle narrows to a rectangle, which keeps the mean.
//!
//! Does not: follow the motion of the picture (grain is on the film, not on the face); run before antialiasing, which would
//! take it for edges, nor before the history of `smaa-t2x`, which would average it.
//!
//! Costs: a hash and a load for each pixel, nine hashes where grains are larger than a pixel; the picture before it has half
//! floats in place of bytes.

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::passes::block_groups;
use crate::scene::Optics;
use crate::settings::{DitherMethod, Look};

const SHADER: Module = module!("grain", "grain.wesl");

/// Factors of the noise of all channels and of that of one; with the correlation of the two the variance is 1.
pub(crate) const COMMON: f32 = 0.756_4;
pub(crate) const OWN: f32 = 0.35;
/// Area in which granularity is measured, square micrometres.
const MEASURED_AREA_UM2: f32 = std::f32::consts::PI * 24.0 * 24.0;

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER).constant("COMMON", COMMON).constant("OWN", OWN)
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) strength: f32,
    pub(crate) spacing: f32,
    pub(crate) frame: u32,
    pub(crate) dither: u32,
}

impl Params {
    /// For a picture of a height in pixels.
    fn new(look: &Look, optics: &Optics, height: u32) -> Self {
        let pixel_um = 1000.0 * optics.sensor_height_mm / height as f32;
        let grain_area = 0.25 * std::f32::consts::PI * look.grain_size * look.grain_size;
        let density = look.grain / 1000.0 * (MEASURED_AREA_UM2 / (pixel_um * pixel_um + grain_area)).sqrt();
        Self {
            strength: density * std::f32::consts::LN_10,
            spacing: (look.grain_size / pixel_um).max(1.0),
            frame: optics.frame,
            dither: u32::from(look.dither == DitherMethod::Triangular),
        }
    }
}

/// The pipeline of the pass.
pub(crate) struct Grain {
    kernel: Kernel,
}

impl Grain {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { kernel: Kernel::new(gpu, "grain", &program(), "grain") }
    }

    /// From display values to the 8 bits of a picture of the same size.
    pub(crate) fn record_into(
        &self,
        r: &mut Recorder<'_>,
        look: &Look,
        optics: &Optics,
        displayed: &wgpu::TextureView,
        image: &wgpu::TextureView,
        size: [u32; 2],
    ) {
        let params = r.uniform("grain", &Params::new(look, optics, size[1]));
        let resources =
            [("params", params.bound()), ("displayed", displayed.bound()), ("image", image.bound())];
        r.dispatch(&self.kernel, &resources, block_groups(size));
    }
}
