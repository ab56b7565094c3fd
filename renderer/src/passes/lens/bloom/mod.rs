//! Bloom: the share of light that a lens and a film spread around bright places.
//!
//! ```text
//! hdr --down--> 1/2 --down--> 1/4 ... --down--> 1/2^K
//!               |            |                 |
//!               +<---up------+<------up--------+  weighted sums: spread light at half of the size, which `display` adds
//! ```
//!
//! Theory: the point spread function of an optical system, which Jimenez 2012 ch. 4 takes from d'Eon and Luebke 2007 and those from
//! Pharr and Humphreys 2004: density `15 / (pi R^2) (1 - r / R)^4` up to the radius R, so that it sums to one. The picture is
//! `(1 - w) light + w spread`, so no light is made or lost.
//!
//! Differs from the source: the spread is a pyramid of nearly Gaussian levels ([`fit`] has their shares) in place of a convolution with the
//! function itself. The share of light within a radius is off by at most 5 % of all light from 16 pixels on (2.6 % where
//! a level's width suits the radius), as a sum of Gaussians ends more slowly than a function that is zero from R on.
//!
//! Does not: bring light in from outside of the picture (the border is repeated, so a flat field stays flat and what a bright
//! place at the border would spread outwards stays in); make streaks of aperture blades.
//!
//! Costs: 4 bilinear taps for a texel down and one up, a third of the picture in all, and one tap in `display`.

mod fit;
#[cfg(test)]
mod tests;

use super::linear_clamp;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::pixel_groups;
use crate::settings::Look;

const SHADER: Module = module!("bloom", "bloom.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) weight: f32,
    pub(crate) more: f32,
    pub(crate) padding: [u32; 2],
}

/// Light that was spread: what `display` adds to the rest.
pub(crate) struct Spread {
    /// At half of the size of the picture, rounded up.
    pub(crate) light: Image,
    /// Share of the light of the picture that is in it.
    pub(crate) share: f32,
}

/// The pipelines of the pass, for one radius.
pub(crate) struct Bloom {
    down: Kernel,
    up: Kernel,
    linear_clamp: wgpu::Sampler,
    radius_px: f64,
    weights: Vec<f64>,
}

fn radius_px(look: &Look, height: u32) -> f64 {
    f64::from(look.bloom_radius) * f64::from(height)
}

impl Bloom {
    /// For pictures of a height in pixels.
    pub(crate) fn new(gpu: &Gpu, look: &Look, height: u32) -> Self {
        let radius_px = radius_px(look, height);
        Self {
            down: Kernel::new(gpu, "bloom down", &program(), "bloom_down"),
            up: Kernel::new(gpu, "bloom up", &program(), "bloom_up"),
            linear_clamp: linear_clamp(gpu),
            radius_px,
            weights: fit::weights(radius_px),
        }
    }

    /// Whether it is the one for these settings.
    pub(crate) fn fits(&self, look: &Look, height: u32) -> bool {
        self.radius_px == radius_px(look, height)
    }

    /// Spreads the light of a picture.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, look: &Look, hdr: &Image) -> Spread {
        let mut levels = Vec::new();
        for _ in 1..self.weights.len() {
            let source = levels.last().unwrap_or(hdr);
            let size = source.size().map(|n| n.div_ceil(2));
            let result = r.image("bloom", ImageSpec::light(size));
            let resources = [
                ("source", source.bound()),
                ("linear_clamp", self.linear_clamp.bound()),
                ("result", result.bound()),
            ];
            r.dispatch(&self.down, &resources, pixel_groups(size));
            levels.push(result);
        }
        let mut coarser: Option<Image> = None;
        for (level, weight) in levels.iter().zip(&self.weights[1..]).rev() {
            let params = Params {
                weight: look.bloom * *weight as f32,
                more: f32::from(u8::from(coarser.is_some())),
                padding: [0; 2],
            };
            let params = r.uniform("bloom", &params);
            let result = r.image("bloom", ImageSpec::light(level.size()));
            let resources = [
                ("params", params.bound()),
                ("source", level.bound()),
                ("coarser", coarser.as_ref().unwrap_or(level).bound()),
                ("linear_clamp", self.linear_clamp.bound()),
                ("result", result.bound()),
            ];
            r.dispatch(&self.up, &resources, pixel_groups(level.size()));
            coarser = Some(result);
        }
        let share = look.bloom * (1.0 - self.weights[0]) as f32;
        Spread { light: coarser.unwrap_or_else(|| hdr.clone()), share }
    }
}
