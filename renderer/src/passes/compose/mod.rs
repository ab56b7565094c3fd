//! Puts the picture together: scattered diffuse light times albedo, plus light that was not scattered, over the
//! background.
//!
//! ```text
//! scattered, albedo, direct, depth [, sums of hairs] --compose--> hdr (linear Rec. 709 radiance; a = coverage)
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
use crate::passes::hair::cropped_hair::HAIR_UNIT;

const SHADER: Module = module!("compose", "compose.wesl");

/// The shader of the pass, with or without sums of hairs.
pub(crate) fn program(hair: bool) -> Program {
    Program::new(SHADER).flag("hair", hair).constant("HAIR_UNIT", HAIR_UNIT)
}

/// The pipelines of the pass.
pub(crate) struct Compose {
    bare: Kernel,
    haired: Kernel,
}

impl Compose {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let [bare, haired] = [false, true].map(|hair| Kernel::new(gpu, "compose", &program(hair), "compose"));
        Self { bare, haired }
    }

    /// `inputs`: scattered, albedo, direct, depth; `hairs`: their sums, which are zero afterwards.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        background_linear: Vec3,
        inputs: [&Image; 4],
        hairs: Option<&wgpu::Buffer>,
    ) -> Image {
        let params = r.uniform("compose", &background_linear.extend(0.0));
        let [scattered, albedo, direct, depth] = inputs;
        let size = albedo.size();
        let hdr = r.image("radiance", ImageSpec::light(size).also(wgpu::TextureUsages::RENDER_ATTACHMENT));
        let mut resources = vec![
            ("params", params.bound()),
            ("scattered", scattered.bound()),
            ("albedo", albedo.bound()),
            ("direct", direct.bound()),
            ("depth", depth.bound()),
            ("hdr", hdr.bound()),
        ];
        resources.extend(hairs.map(|sums| ("sums", sums.bound())));
        let kernel = if hairs.is_some() { &self.haired } else { &self.bare };
        r.dispatch(kernel, &resources, block_groups(size));
        hdr
    }
}
