//! Cropped hair: short single hairs where the map of hair says that the skin is covered, so that neither the hairline
//! nor the outline of the scalp is the edge of a painted cap.
//!
//! ```text
//! hair map, rest mesh --roots, once--> triangle, place, flow, length
//! roots, positions, frames, depth (tested), light, hdr --cropped_hair--> hdr, velocity (premultiplied over)
//! ```
//!
//! A hair is one triangle of 0.14 mm at its root, drawn no thinner than a pixel and faded by what it lacks. Its light is
//! that of `fibre`, at its root under the depth of the hairs around it and at its tip in the open. It moves with its
//! root.
//!
//! Does not: sort (hairs of one colour), cast shadows.

mod roots;
#[cfg(test)]
mod tests;

use glam::Vec3;
#[cfg(test)]
pub(crate) use roots::Root;
pub(crate) use roots::roots;

use crate::gpu::{Gpu, Raster};
use crate::pass_timer::PassTimer;
use crate::passes::fibre::{Fibre, fibre_wgsl};
use crate::passes::overlay::Overlaid;
use crate::passes::shade::Lighting;
use crate::passes::{blended, drawn_over};

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    fibre_wgsl!(),
    include_str!("cropped_hair.wgsl")
);

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) color: [f32; 4],
}

/// The pipelines of the pass.
pub(crate) struct CroppedHair {
    /// Colour only, and colour with motion.
    pipelines: [wgpu::RenderPipeline; 2],
}

impl CroppedHair {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let targets = [Some(blended()), Some(blended())];
        let pipeline = |targets: &[Option<wgpu::ColorTargetState>]| {
            gpu.raster_pipeline(&Raster {
                label: "cropped hair",
                wgsl: SHADER,
                vertex: "cropped_hair_vertex",
                fragment: Some("cropped_hair_fragment"),
                targets,
                nearer: wgpu::CompareFunction::Greater,
                writes_depth: false,
            })
        };
        Self { pipelines: [pipeline(&targets[..1]), pipeline(&targets)] }
    }

    /// Draws the hairs of heads over a picture and, where there is one, over its motion.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        (fibre, lighting): (&Fibre, &Lighting<'_>),
        heads: &[Overlaid<'_>],
        hdr: &wgpu::TextureView,
        velocity: Option<&wgpu::TextureView>,
    ) {
        let pipeline = &self.pipelines[usize::from(velocity.is_some())];
        let light = fibre.bind(gpu, pipeline, lighting);
        let (colors, depth) = drawn_over(hdr, velocity, lighting.depth);
        let mut pass = timer.render(encoder, "cropped hair", &colors, Some(depth));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &light, &[]);
        for Overlaid { head, positions, previous_positions, frames } in heads {
            let Some(maps) = &head.maps else { continue };
            let params = Params { color: Vec3::from(maps.hair_color_linear).extend(1.0).to_array() };
            let params = gpu.uniform("cropped hair", &params);
            let group = gpu.bind_layout(
                "cropped hair",
                &pipeline.get_bind_group_layout(0),
                &[
                    lighting.view.as_entire_binding(),
                    params.as_entire_binding(),
                    positions.as_entire_binding(),
                    head.vertices.as_entire_binding(),
                    head.triangles.as_entire_binding(),
                    frames.as_entire_binding(),
                    head.hair_roots.as_entire_binding(),
                    previous_positions.as_entire_binding(),
                ],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..head.hair_root_count * 3, 0..1);
        }
    }
}
