//! Passes that blend over the composed picture: hairs, lashes, brows and wet films; and the light of a hair.

pub(crate) mod cropped_hair;
pub(crate) mod fibre;
pub(crate) mod overlay;

use crate::device::{Attachments, Image, color_attachment, depth_attachment};

/// A half float image that premultiplied colours are drawn over.
fn blended() -> wgpu::ColorTargetState {
    wgpu::ColorTargetState {
        format: wgpu::TextureFormat::Rgba16Float,
        blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        write_mask: wgpu::ColorWrites::COLOR,
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
