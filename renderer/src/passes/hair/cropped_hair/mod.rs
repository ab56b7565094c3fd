//! Cropped hair: short single hairs where the hair map marks the skin as covered, so that neither the hairline
//! nor the outline of the scalp looks like the edge of a painted cap.
//!
//! ```text
//! hair map, rest mesh --roots, once--> triangle, place, flow, length
//! roots, positions, frames, depth (tested), light, hdr --cropped_hair--> hdr, velocity (premultiplied over)
//! ```
//!
//! A hair is one triangle of 0.14 mm at its root, drawn no thinner than a pixel and faded by its missing width. Its
//! light is that of `fibre`: its root is dimmed by the hairs around it, its tip is not. It moves with its
//! root.
//!
//! Does not: sort (hairs of one colour), cast shadows.

#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Draw, Gpu, Image, Recorder};
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::hair::Blended;
use crate::passes::hair::fibre::{self, Fibre};
use crate::scene::PosedHead;
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use glam::Vec3;

const SHADER: Module = module!("cropped_hair", "cropped_hair.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER).with(&fibre::MODULES)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) color: [f32; 4],
}

/// The pipelines of the pass.
pub(crate) struct CroppedHair {
    kernels: Blended,
}

impl CroppedHair {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let entries = ["cropped_hair_vertex", "cropped_hair_fragment"];
        Self { kernels: Blended::new(gpu, rasteriser, "cropped hair", program(), entries) }
    }

    /// Draws the hairs of heads over a picture and, where there is one, over its motion.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        (fibre, light): (&Fibre, &Illumination<'_>),
        seen: &Seen,
        heads: &[PosedHead<'_>],
        hdr: &Image,
        velocity: Option<&Image>,
    ) {
        let drawn: Vec<_> =
            heads.iter().filter(|h| h.head.hair_root_count > 0 && h.head.maps.is_some()).collect();
        if drawn.is_empty() {
            return;
        }
        let hair_light = fibre.params(r, light);
        let params = drawn.iter().map(|h| {
            let color = h.head.maps.as_ref().map_or([0.0; 3], |m| m.hair_color_linear);
            r.uniform("cropped hair", &Params { color: Vec3::from(color).extend(1.0).to_array() })
        });
        let params: Vec<_> = params.collect();
        let each = drawn.iter().zip(&params).map(|(h, params)| {
            let mut resources = vec![
                ("view", seen.view.bound()),
                ("params", params.bound()),
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("frames", h.tangent_frames.bound()),
                ("roots", h.head.hair_roots.bound()),
                ("previous_positions", h.previous_positions.bound()),
            ];
            resources.extend(fibre.resources(&hair_light, light));
            (resources, Draw::Corners(h.head.hair_root_count * 3))
        });
        self.kernels.record(r, [hdr, &seen.depth], velocity, each);
    }
}
