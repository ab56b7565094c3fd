//! The visibility buffer: which triangle of which head each pixel sees.
//!
//! ```text
//! positions, camera --visibility--> id (r32uint: head << 27 | triangle + 1, 0 = nothing), depth (reversed, infinite)
//! ```
//!
//! Theory: Burns and Hunt 2013, "The visibility buffer". The only rasterised pass of the frame that covers the head;
//! its fragment shader stores one integer, everything else is compute (see ARCHITECTURE.md for what that saves).
//! Reversed infinite depth keeps 24 bits at any distance (Lapidous and Jiao 1999).

use crate::gpu::{Gpu, Raster};
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;

/// WGSL of the pass, for a device that numbers triangles or for one that does not.
pub(crate) fn shader(numbered: bool) -> String {
    let enable = if numbered { "enable primitive_index;\n" } else { "" };
    let shared = concat!(
        include_str!("../../shared/view.wgsl"),
        include_str!("../../shared/surface.wgsl"),
        include_str!("visibility.wgsl")
    );
    let stages = if numbered { include_str!("numbered.wgsl") } else { include_str!("corners.wgsl") };
    [enable, shared, stages].concat()
}

/// The pipeline of the pass.
pub(crate) struct Visibility {
    pipeline: wgpu::RenderPipeline,
    is_numbered: bool,
}

impl Visibility {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self::with_numbers(gpu, gpu.device.features().contains(wgpu::Features::PRIMITIVE_INDEX))
    }

    /// Both ways give the same image.
    pub(crate) fn with_numbers(gpu: &Gpu, is_numbered: bool) -> Self {
        let pipeline = gpu.raster_pipeline(&Raster {
            label: "visibility",
            wgsl: &shader(is_numbered),
            vertex: "visibility_vertex",
            fragment: Some("visibility_fragment"),
            targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
            nearer: wgpu::CompareFunction::Greater,
            writes_depth: true,
        });
        Self { pipeline, is_numbered }
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
            let mut resources =
                vec![view.as_entire_binding(), positions.as_entire_binding(), number.as_entire_binding()];
            if !self.is_numbered {
                resources.push(head.opaque_points.as_entire_binding());
            }
            let layout = self.pipeline.get_bind_group_layout(0);
            let group = gpu.bind_layout("visibility", &layout, &resources);
            pass.set_bind_group(0, &group, &[]);
            let corners = head.opaque_triangles * 3;
            if self.is_numbered {
                pass.set_index_buffer(head.opaque_points.slice(..), wgpu::IndexFormat::Uint32);
                pass.draw_indexed(0..corners, 0, 0..1);
            } else {
                pass.draw(0..corners, 0..1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Vec3};

    use super::*;
    use crate::frame::View;
    use crate::testing::gpu;
    use crate::tests::{WHITE_TABLE, dome};

    #[test]
    fn triangles_are_the_same_whoever_numbers_them() {
        let Some(gpu) = gpu() else { return };
        if !gpu.device.features().contains(wgpu::Features::PRIMITIVE_INDEX) {
            eprintln!("SKIPPED: this device does not number triangles");
            return;
        }
        let head = dome();
        let on_gpu = HeadOnGpu::new(gpu, &head, &WHITE_TABLE).expect("the dome uploads");
        let points: Vec<[f32; 4]> = head.mesh.points.iter().map(|p| p.extend(1.0).to_array()).collect();
        let positions = gpu.storage("positions", &points);
        let mut view: View = bytemuck::Zeroable::zeroed();
        view.clip_from_world = Mat4::from_scale(Vec3::new(5.0, 5.0, 0.5));
        view.size = [64, 64];
        view.jitter = [0.25, -0.25];
        let view = gpu.uniform("view", &view);
        let draw = |numbered| {
            use wgpu::TextureUsages as Use;
            let target = |format, usage| {
                gpu.target("test", [64, 64], format, Use::RENDER_ATTACHMENT | usage)
                    .create_view(&Default::default())
            };
            let ids = target(wgpu::TextureFormat::R32Uint, Use::COPY_SRC);
            let depth = target(wgpu::TextureFormat::Depth32Float, Use::TEXTURE_BINDING);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let mut timer = PassTimer::new(gpu);
            let heads = [(&on_gpu, &positions), (&on_gpu, &positions)];
            let pass = Visibility::with_numbers(gpu, numbered);
            pass.record(gpu, &mut encoder, &mut timer, &view, &heads, &ids, &depth);
            gpu.queue.submit([encoder.finish()]);
            bytemuck::pod_collect_to_vec::<u8, u32>(&gpu.read_texture(ids.texture()).expect("it reads"))
        };
        let (numbered, by_corners) = (draw(true), draw(false));
        assert_eq!(numbered, by_corners);
        let mut seen: Vec<u32> = numbered.into_iter().filter(|id| *id != 0).collect();
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() > 10, "{} triangles are seen", seen.len());
    }
}
