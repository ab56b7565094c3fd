//! Passes that blend over the composed picture: hairs, lashes, brows and wet films; and the light of a hair.

pub(crate) mod cropped_hair;
pub(crate) mod fibre;
pub(crate) mod overlay;

use crate::device::kernel::Resource;
use crate::device::wgsl::Program;
use crate::device::{
    Attachments, Bind, Draw, Gpu, Image, Raster, RasterKernel, Recorder, color_attachment, depth_attachment,
};
use crate::passes::geometry::raster::Rasteriser;

/// Pipelines that draw premultiplied colours over half float images: colour only, and colour with motion.
struct Blended {
    kernels: [RasterKernel; 2],
    /// Whether the shader tests depth, as there is no depth texture.
    tests_depth: bool,
}

impl Blended {
    fn new(
        gpu: &Gpu,
        rasteriser: Rasteriser,
        label: &'static str,
        program: Program,
        [vertex, fragment]: [&str; 2],
    ) -> Self {
        let tests_depth = rasteriser.stores_depth();
        let program = program.flag("tests_depth", tests_depth).flag("stored_shadows", tests_depth);
        let target = Some(wgpu::ColorTargetState {
            format: wgpu::TextureFormat::Rgba16Float,
            blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            write_mask: wgpu::ColorWrites::COLOR,
        });
        let targets = [target.clone(), target];
        let kernel = |targets: &[Option<wgpu::ColorTargetState>]| {
            let raster = Raster {
                label,
                program: program.clone(),
                vertex,
                fragment: Some(fragment),
                targets,
                nearer: (!tests_depth).then_some(wgpu::CompareFunction::Greater),
                writes_depth: false,
            };
            RasterKernel::new(gpu, &raster)
        };
        Self { kernels: [kernel(&targets[..1]), kernel(&targets)], tests_depth }
    }

    /// Draws over a picture and, where there is one, its motion; depth is only tested. Each draw gets the depth as
    /// `scene_depth`.
    fn record<'r>(
        &self,
        r: &mut Recorder<'_>,
        [hdr, depth]: [&'r Image; 2],
        velocity: Option<&Image>,
        each: impl Iterator<Item = (Vec<Resource<'r>>, Draw<'r>)>,
    ) {
        let images = std::iter::once(hdr).chain(velocity);
        let attachments = Attachments {
            colors: images.map(|image| color_attachment(image.view(), wgpu::LoadOp::Load)).collect(),
            depth: if self.tests_depth { None } else { depth_attachment(depth.view(), wgpu::LoadOp::Load) },
        };
        let each = each.map(|(mut resources, draw)| {
            resources.push(("scene_depth", depth.bound()));
            (resources, draw)
        });
        r.draw_each(&self.kernels[usize::from(velocity.is_some())], attachments, each);
    }
}
