//! Passes that blend over the composed picture: hairs, lashes, brows and wet films; and the light of a hair.

pub(crate) mod cropped_hair;
pub(crate) mod fibre;
pub(crate) mod overlay;

use crate::device::wgsl::Program;
use crate::device::{Attachments, Gpu, Image, Raster, RasterKernel, color_attachment, depth_attachment};

/// Pipelines that draw premultiplied colours over half float images: colour only, and colour with motion.
struct Blended([RasterKernel; 2]);

impl Blended {
    fn new(gpu: &Gpu, label: &'static str, program: &Program, [vertex, fragment]: [&str; 2]) -> Self {
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
                nearer: wgpu::CompareFunction::Greater,
                writes_depth: false,
            };
            RasterKernel::new(gpu, &raster)
        };
        Self([kernel(&targets[..1]), kernel(&targets)])
    }

    /// The one for a picture with or without motion.
    fn kernel(&self, velocity: Option<&Image>) -> &RasterKernel {
        &self.0[usize::from(velocity.is_some())]
    }
}

/// Targets of blended triangles: a picture, its motion if it has one, and depth that is only tested.
fn drawn_over<'a>(hdr: &'a Image, velocity: Option<&'a Image>, depth: &'a Image) -> Attachments<'a> {
    let images = std::iter::once(hdr).chain(velocity);
    Attachments {
        colors: images.map(|image| color_attachment(image.view(), wgpu::LoadOp::Load)).collect(),
        depth: depth_attachment(depth.view(), wgpu::LoadOp::Load),
    }
}
