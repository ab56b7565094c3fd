//! Lashes, hair cards and wet films: the only blended triangles of a frame, drawn over the composed picture.
//!
//! ```text
//! positions, frames, depth (tested, not written), hdr --overlay--> hdr (premultiplied over)
//! ```
//!
//! A strand of hair is a fraction of a pixel wide: its coverage is computed from its width, so it fades instead of
//! flickering. `uv` of [`rubor_rig::head::Material::Lash`] says where along the lid and along the strand.
//!
//! Does not: sort (hair is dark on dark, a film only adds light), cast shadows.

use glam::Vec3;

use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/math.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("overlay.wgsl")
);

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) ambient: [f32; 4],
    pub(crate) first: u32,
    pub(crate) padding: [u32; 3],
    pub(crate) hair: [f32; 4],
}

/// The pipeline of the pass.
pub(crate) struct Overlay {
    pipeline: wgpu::RenderPipeline,
}

impl Overlay {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let module = gpu.shader("overlay", SHADER);
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("overlay"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("overlay_vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(false),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("overlay_fragment"),
                compilation_options: Default::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    format: wgpu::TextureFormat::Rgba16Float,
                    blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                    write_mask: wgpu::ColorWrites::COLOR,
                })],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline }
    }

    /// `heads` are (head, positions, frames); `ambient` is the irradiance / pi that hair sees on average.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        ambient: Vec3,
        heads: &[(&HeadOnGpu, &wgpu::Buffer, &wgpu::Buffer)],
        [depth, hdr]: [&wgpu::TextureView; 2],
    ) {
        let color = wgpu::RenderPassColorAttachment {
            view: hdr,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
        };
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        };
        let mut pass = timer.render(encoder, "overlay", &[Some(color)], Some(depth));
        pass.set_pipeline(&self.pipeline);
        for (head, positions, frames) in heads {
            let params = Params {
                ambient: ambient.extend(0.0).to_array(),
                first: head.opaque_triangles,
                padding: [0; 3],
                hair: Vec3::from(head.maps.as_ref().map_or([0.03; 3], |m| m.hair_color_linear))
                    .extend(1.0)
                    .to_array(),
            };
            let params = gpu.uniform("overlay", &params);
            let group = gpu.bind_layout(
                "overlay",
                &self.pipeline.get_bind_group_layout(0),
                &[
                    view.as_entire_binding(),
                    params.as_entire_binding(),
                    positions.as_entire_binding(),
                    head.vertices.as_entire_binding(),
                    head.triangles.as_entire_binding(),
                    frames.as_entire_binding(),
                ],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..head.overlay_triangles * 3, 0..1);
        }
    }
}
