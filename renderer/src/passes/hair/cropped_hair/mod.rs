//! Cropped hair: short single hairs where the hair map marks the skin as covered, so that neither the hairline
//! nor the outline of the scalp looks like the edge of a painted cap.
//!
//! ```text
//! hair map, rest mesh --roots, once--> triangle, place, flow, length
//! roots, positions, frames, light --light_hairs--> ends, light, motion of each hair
//! hairs, depth (tested), hdr --cropped_hair--> hdr, velocity (premultiplied over)
//! ```
//!
//! A hair is one triangle of 0.14 mm at its root, drawn no thinner than a pixel and faded by its missing width. Its
//! light is that of `fibre`: its root is dimmed by the hairs around it, its tip is not. It moves with its
//! root.
//!
//! Where a hair is thinner than a third of a pixel on the nearest part of a head, the first of the hairs, which are in random order,
//! stand for all ([`DetailMethod::Auto`]; Cook et al. 2007): each covers what its share of hairs would let through,
//! so the number goes up by one hair at a time in a zoom.
//!
//! A head may keep fewer hairs than grow ([`SkinMaps::hair_count`](rubor_rig::head::SkinMaps::hair_count)): the first ones, which then stand
//! for all in the same way.
//!
//! Does not: sort (hairs of one colour), cast shadows.

#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Draw, Gpu, Image, Kernel, Recorder};
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::hair::Blended;
use crate::passes::hair::fibre::{self, Fibre};
use crate::scene::PosedHead;
use crate::scene::hair_roots::{WIDTH_METRES, drawn_hairs};
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use crate::settings::DetailMethod;
use glam::Vec3;

const SHADER: Module = module!("cropped_hair", "cropped_hair.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER).with(&fibre::MODULES).constant("WIDTH", WIDTH_METRES)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) color: [f32; 4],
    pub(crate) count: u32,
    pub(crate) share: f32,
    pub(crate) padding: [u32; 2],
}

/// The pipelines of the pass.
pub(crate) struct CroppedHair {
    light: Kernel,
    kernels: Blended,
}

impl CroppedHair {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let entries = ["cropped_hair_vertex", "cropped_hair_fragment"];
        let lighting = program().flag("stored_shadows", rasteriser.stores_depth());
        Self {
            light: Kernel::new(gpu, "light hairs", &lighting, "light_hairs"),
            kernels: Blended::new(gpu, rasteriser, "cropped hair", program(), entries),
        }
    }

    /// Draws the hairs of heads over a picture and, where there is one, over its motion.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        (fibre, light): (&Fibre, &Illumination<'_>),
        detail: DetailMethod,
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
        let numbers = |h: &&PosedHead<'_>| {
            let color = h.head.maps.as_ref().map_or([0.0; 3], |m| m.hair_color_linear);
            let [most, all] = h.head.hair_counts();
            let count = match detail {
                DetailMethod::Full => most,
                DetailMethod::Auto => drawn_hairs(all, seen.pixel_metres(h.index)).min(most),
            };
            Params {
                color: Vec3::from(color).extend(1.0).to_array(),
                count,
                share: all as f32 / count as f32,
                padding: [0; 2],
            }
        };
        let params: Vec<Params> = drawn.iter().map(numbers).collect();
        let buffers: Vec<_> = params.iter().map(|p| r.uniform("cropped hair", p)).collect();
        let each = drawn.iter().zip(params.iter().zip(&buffers)).map(|(h, (params, buffer))| {
            let mut resources = vec![
                ("view", seen.view.bound()),
                ("params", buffer.bound()),
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("frames", h.tangent_frames.bound()),
                ("roots", h.head.hair_roots.bound()),
                ("previous_positions", h.previous_positions.bound()),
                ("lit_out", h.hairs.bound()),
            ];
            resources.extend(fibre.resources(&hair_light, light));
            (resources, [params.count.div_ceil(64), 1, 1])
        });
        r.dispatch_each(&self.light, each);
        let each = drawn
            .iter()
            .zip(&params)
            .map(|(h, params)| (vec![("hairs", h.hairs.bound())], Draw::Corners(params.count * 3)));
        self.kernels.record(r, [hdr, &seen.depth], velocity, each);
    }
}
