//! Cropped hair: short single hairs where the map of hair says that the skin is covered, so that neither the hairline
//! nor the outline of the scalp is the edge of a painted cap.
//!
//! ```text
//! hair map, rest mesh --roots, once--> triangle, place, flow, length
//! roots, positions, frames, depth (tested), irradiance, hdr --cropped_hair--> hdr (premultiplied over)
//! ```
//!
//! A hair is one triangle of 0.1 mm at its root, drawn no thinner than a pixel and faded by what it lacks. It takes its
//! light from the picture at its root, after shadows: what lies beside the picture takes the average of the scene.
//!
//! Does not: sort (hairs of one colour), cast shadows, show highlights along hairs.

mod roots;
#[cfg(test)]
mod tests;

use glam::Vec3;
#[cfg(test)]
pub(crate) use roots::Root;
pub(crate) use roots::roots;

use crate::gpu::{Gpu, Raster};
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;
use crate::passes::blended;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("cropped_hair.wgsl")
);

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) color: [f32; 4],
    pub(crate) ambient: [f32; 4],
}

/// The pipeline of the pass.
pub(crate) struct CroppedHair {
    pipeline: wgpu::RenderPipeline,
}

impl CroppedHair {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let pipeline = gpu.raster_pipeline(&Raster {
            label: "cropped hair",
            wgsl: SHADER,
            vertex: "cropped_hair_vertex",
            fragment: Some("cropped_hair_fragment"),
            targets: &[Some(blended())],
            nearer: wgpu::CompareFunction::Greater,
            writes_depth: false,
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
        [irradiance, depth, hdr]: [&wgpu::TextureView; 3],
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
        let mut pass = timer.render(encoder, "cropped hair", &[Some(color)], Some(depth));
        pass.set_pipeline(&self.pipeline);
        for (head, positions, frames) in heads {
            let Some(maps) = &head.maps else { continue };
            let params = Params {
                color: Vec3::from(maps.hair_color_linear).extend(1.0).to_array(),
                ambient: ambient.extend(0.0).to_array(),
            };
            let params = gpu.uniform("cropped hair", &params);
            let group = gpu.bind_layout(
                "cropped hair",
                &self.pipeline.get_bind_group_layout(0),
                &[
                    view.as_entire_binding(),
                    params.as_entire_binding(),
                    positions.as_entire_binding(),
                    head.vertices.as_entire_binding(),
                    head.triangles.as_entire_binding(),
                    frames.as_entire_binding(),
                    head.hair_roots.as_entire_binding(),
                    wgpu::BindingResource::TextureView(irradiance),
                ],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..head.hair_root_count * 3, 0..1);
        }
    }
}
