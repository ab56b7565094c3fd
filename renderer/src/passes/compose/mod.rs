//! Puts the picture together: scattered diffuse light times albedo, plus light that was not scattered, over the
//! background.
//!
//! ```text
//! scattered, albedo, direct, depth --compose--> hdr (linear Rec. 709 radiance; a = coverage)
//! ```
//!
//! Theory: post-scatter texturing (d'Eon and Luebke 2007; Jimenez 2012 section 7.6): measured albedo already holds the
//! blur of scattering, so it multiplies after the blur.

#[cfg(test)]
mod tests;

use glam::Vec3;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::block_groups;

const SHADER: Module = module!("compose", "compose.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

/// The pipeline of the pass.
pub(crate) struct Compose {
    kernel: Kernel,
}

impl Compose {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { kernel: Kernel::new(gpu, "compose", &program(), "compose") }
    }

    /// `inputs`: scattered, albedo, direct, depth.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, background_linear: Vec3, inputs: [&Image; 4]) -> Image {
        let params = r.uniform("compose", &background_linear.extend(0.0));
        let [scattered, albedo, direct, depth] = inputs;
        let size = albedo.size();
        let hdr = r.image("radiance", ImageSpec::light(size).also(wgpu::TextureUsages::RENDER_ATTACHMENT));
        let resources = [
            ("params", params.bound()),
            ("scattered", scattered.bound()),
            ("albedo", albedo.bound()),
            ("direct", direct.bound()),
            ("depth", depth.bound()),
            ("hdr", hdr.bound()),
        ];
        r.dispatch(&self.kernel, &resources, block_groups(size));
        hdr
    }
}
