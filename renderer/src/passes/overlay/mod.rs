//! Lashes, hair cards and wet films: the only blended triangles of a frame, drawn over the composed picture.
//!
//! ```text
//! positions, frames, light, depth (tested, not written), hdr --overlay--> hdr, velocity (premultiplied over)
//! ```
//!
//! Motion is mixed with that of what lies behind as colours are: where hair moves before a background that stands
//! still, history would otherwise be taken from beside the hair.
//!
//! A strand of hair is a fraction of a pixel wide: its coverage is computed from its width, so it fades instead of
//! flickering, and its light is that of `fibre` at each vertex. `uv` of [`rubor_rig::head::Material::Lash`] says where along the lid and along the strand.
//!
//! Does not: sort (hair is dark on dark, a film only adds light), cast shadows.

use glam::Vec3;

use crate::gpu::{Gpu, Raster};
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;
use crate::passes::fibre::{Fibre, fibre_wgsl};
use crate::passes::shade::Lighting;
use crate::passes::{blended, drawn_over};

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    fibre_wgsl!(),
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
    /// Colour only, and colour with motion.
    pipelines: [wgpu::RenderPipeline; 2],
}

/// What this pass and the one of cropped hair read of one head.
pub(crate) struct Overlaid<'a> {
    pub(crate) head: &'a HeadOnGpu,
    pub(crate) positions: &'a wgpu::Buffer,
    pub(crate) previous_positions: &'a wgpu::Buffer,
    pub(crate) frames: &'a wgpu::Buffer,
}

impl Overlay {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let target = Some(blended());
        let targets = [target.clone(), target];
        let pipeline = |targets: &[Option<wgpu::ColorTargetState>]| {
            gpu.raster_pipeline(&Raster {
                label: "overlay",
                wgsl: SHADER,
                vertex: "overlay_vertex",
                fragment: Some("overlay_fragment"),
                targets,
                nearer: wgpu::CompareFunction::Greater,
                writes_depth: false,
            })
        };
        Self { pipelines: [pipeline(&targets[..1]), pipeline(&targets)] }
    }

    /// `ambient` is the irradiance / pi that cards and films see on average.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        (fibre, lighting): (&Fibre, &Lighting<'_>),
        ambient: Vec3,
        heads: &[Overlaid<'_>],
        hdr: &wgpu::TextureView,
        velocity: Option<&wgpu::TextureView>,
    ) {
        let pipeline = &self.pipelines[usize::from(velocity.is_some())];
        let light = fibre.bind(gpu, pipeline, lighting);
        let (colors, depth) = drawn_over(hdr, velocity, lighting.depth);
        let mut pass = timer.render(encoder, "overlay", &colors, Some(depth));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &light, &[]);
        for Overlaid { head, positions, previous_positions, frames } in heads {
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
                &pipeline.get_bind_group_layout(0),
                &[
                    lighting.view.as_entire_binding(),
                    params.as_entire_binding(),
                    positions.as_entire_binding(),
                    head.vertices.as_entire_binding(),
                    head.triangles.as_entire_binding(),
                    frames.as_entire_binding(),
                    previous_positions.as_entire_binding(),
                ],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..head.overlay_triangles * 3, 0..1);
        }
    }
}
