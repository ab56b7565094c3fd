//! The visibility buffer: which triangle of which head each pixel sees.
//!
//! ```text
//! positions, camera --visibility--> id (r32uint: head << 27 | triangle + 1, 0 = nothing), depth (reversed, infinite)
//! ```
//!
//! Theory: Burns and Hunt 2013, "The visibility buffer". The only rasterised pass of the frame that covers the head;
//! its fragment shader stores one integer, everything else is compute (see ARCHITECTURE.md for what that saves).
//! Reversed infinite depth keeps 24 bits at any distance (Lapidous and Jiao 1999).

use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("visibility.wgsl")
);

/// The pipeline of the pass.
pub(crate) struct Visibility {
    pipeline: wgpu::RenderPipeline,
}

impl Visibility {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let module = gpu.shader("visibility", SHADER);
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("visibility"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("visibility_vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("visibility_fragment"),
                compilation_options: Default::default(),
                targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline }
    }

    /// Draws the opaque triangles of all heads, which are (head, positions) in the order of their ids.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        view: &wgpu::Buffer,
        heads: &[(&HeadOnGpu, &wgpu::Buffer)],
        ids: &wgpu::TextureView,
        depth: &wgpu::TextureView,
    ) {
        let color = wgpu::RenderPassColorAttachment {
            view: ids,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        };
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        };
        let mut pass = timer.render(encoder, "visibility", &[Some(color)], Some(depth));
        pass.set_pipeline(&self.pipeline);
        for (index, (head, positions)) in heads.iter().enumerate() {
            let number = gpu.uniform("head", &[index as u32, 0, 0, 0]);
            let group = gpu.bind_layout(
                "visibility",
                &self.pipeline.get_bind_group_layout(0),
                &[
                    view.as_entire_binding(),
                    positions.as_entire_binding(),
                    head.vertices.as_entire_binding(),
                    head.triangles.as_entire_binding(),
                    number.as_entire_binding(),
                ],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..head.opaque_triangles * 3, 0..1);
        }
    }
}
