//! One folder a pass: `mod.rs` with its theory, parameters and recording, its kernels, its tests.

pub mod antialias;
pub(crate) mod appearance;
pub(crate) mod compose;
pub(crate) mod cropped_hair;
pub(crate) mod display;
pub(crate) mod fibre;
pub(crate) mod morph;
pub(crate) mod overlay;
pub(crate) mod scatter;
pub(crate) mod shade;
pub(crate) mod shadow;
pub(crate) mod surface_frames;
pub(crate) mod velocity;
pub(crate) mod visibility;

/// Pixels on a side of what a workgroup of blocks.wgsl does.
pub(crate) const BLOCK_GROUP: u32 = 16;

/// A half float image that premultiplied colours are drawn over.
pub(crate) fn blended() -> wgpu::ColorTargetState {
    wgpu::ColorTargetState {
        format: wgpu::TextureFormat::Rgba16Float,
        blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        write_mask: wgpu::ColorWrites::COLOR,
    }
}

/// What blended triangles are drawn to: a picture, its motion if it has one, and depth that is only tested.
pub(crate) fn drawn_over<'a>(
    hdr: &'a wgpu::TextureView,
    velocity: Option<&'a wgpu::TextureView>,
    depth: &'a wgpu::TextureView,
) -> (Vec<Option<wgpu::RenderPassColorAttachment<'a>>>, wgpu::RenderPassDepthStencilAttachment<'a>) {
    let color = |view| {
        Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
        })
    };
    let depth = wgpu::RenderPassDepthStencilAttachment {
        view: depth,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
        stencil_ops: None,
    };
    (std::iter::once(hdr).chain(velocity).map(color).collect(), depth)
}
