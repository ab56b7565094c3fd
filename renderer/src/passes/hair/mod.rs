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

/// What hairs are drawn onto.
#[derive(Clone, Copy)]
pub(crate) enum Onto<'a> {
    /// A picture and, where there is one, its motion.
    Picture(&'a Image, Option<&'a Image>),
    /// An image of hairs alone, with their coverage.
    Layer(&'a Image),
}

/// Pipelines that draw premultiplied colours over half float images: colour only, colour with motion, and colour with
/// coverage.
struct Blended {
    kernels: [RasterKernel; 3],
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
        let target = |write_mask| {
            Some(wgpu::ColorTargetState {
                format: wgpu::TextureFormat::Rgba16Float,
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                write_mask,
            })
        };
        let targets = [wgpu::ColorWrites::COLOR; 2].map(target);
        let with_coverage = [target(wgpu::ColorWrites::ALL)];
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
        Self { kernels: [kernel(&targets[..1]), kernel(&targets), kernel(&with_coverage)], tests_depth }
    }

    /// Draws over what is there; depth is only tested. Each draw gets the depth as `scene_depth`.
    fn record<'r>(
        &self,
        r: &mut Recorder<'_>,
        onto: Onto<'_>,
        depth: &'r Image,
        each: impl Iterator<Item = (Vec<Resource<'r>>, Draw<'r>)>,
    ) {
        let (kernel, first, second) = match onto {
            Onto::Picture(hdr, None) => (&self.kernels[0], hdr, None),
            Onto::Picture(hdr, velocity) => (&self.kernels[1], hdr, velocity),
            Onto::Layer(layer) => (&self.kernels[2], layer, None),
        };
        let images = std::iter::once(first).chain(second);
        let attachments = Attachments {
            colors: images.map(|image| color_attachment(image.view(), wgpu::LoadOp::Load)).collect(),
            depth: if self.tests_depth { None } else { depth_attachment(depth.view(), wgpu::LoadOp::Load) },
        };
        let each = each.map(|(mut resources, draw)| {
            resources.push(("scene_depth", depth.bound()));
            (resources, draw)
        });
        r.draw_each(kernel, attachments, each);
    }
}
