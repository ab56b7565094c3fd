//! Lashes, hair cards and wet films: the only blended triangles of a frame, drawn over the composed picture.
//!
//! ```text
//! positions, frames, light, depth (tested, not written), hdr --overlay--> hdr, velocity (premultiplied over)
//! ```
//!
//! Motion is blended with the motion behind, like colour: where hair moves in front of a background that stands
//! still, history would otherwise be taken from beside the hair.
//!
//! A strand of hair is a fraction of a pixel wide: its coverage is computed from its width, so it fades instead of
//! flickering, and its light is that of `fibre` at each vertex. In small heads the first strands stand for all, as hairs of the
//! scalp do (`cropped_hair`), from about 1.6 mm a pixel on. `uv` of [`rubor_rig::head::Material::Lash`] gives the
//! position along the lid and along the strand.
//!
//! Does not: sort (hair is dark on dark, a film only adds light), cast shadows.

use glam::Vec3;
use rubor_rig::head::Material;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Draw, Gpu, Recorder};
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::hair::fibre::{self, Fibre};
use crate::passes::hair::{Blended, Onto};
use crate::scene::PosedHead;
use crate::scene::hair_roots::drawn_hairs;
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use crate::settings::DetailMethod;

const SHADER: Module = module!("overlay", "overlay.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
        .with(&fibre::MODULES)
        .constant("LASH", Material::Lash.number())
        .constant("HAIR", Material::Hair.number())
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) ambient: [f32; 4],
    pub(crate) first: u32,
    pub(crate) share: f32,
    pub(crate) padding: [u32; 2],
    pub(crate) hair: [f32; 4],
}

/// The pipelines of the pass.
pub(crate) struct Overlay {
    kernels: Blended,
}

impl Overlay {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let entries = ["overlay_vertex", "overlay_fragment"];
        Self { kernels: Blended::new(gpu, rasteriser, "overlay", program(), entries) }
    }

    /// Draws the blended triangles of heads. `ambient` is the irradiance / pi that cards and films see on average.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        (fibre, light): (&Fibre, &Illumination<'_>),
        ambient: Vec3,
        detail: DetailMethod,
        seen: &Seen,
        heads: &[PosedHead<'_>],
        onto: Onto<'_>,
    ) {
        let drawn: Vec<_> = heads.iter().filter(|h| h.head.triangle_counts().1 > 0).collect();
        if drawn.is_empty() {
            return;
        }
        let hair_light = fibre.params(r, light);
        let counts: Vec<_> = drawn.iter().map(|h| strands(h, detail, seen)).collect();
        let params = drawn.iter().zip(&counts).map(|(h, [all, count])| {
            let hair = h.head.maps.as_ref().map_or([0.03; 3], |m| m.hair_color_linear);
            let params = Params {
                ambient: ambient.extend(0.0).to_array(),
                first: h.head.opaque_triangles,
                share: *all as f32 / (*count).max(1) as f32,
                padding: [0; 2],
                hair: Vec3::from(hair).extend(1.0).to_array(),
            };
            r.uniform("overlay", &params)
        });
        let params: Vec<_> = params.collect();
        let each = drawn.iter().zip(&params).zip(&counts).map(|((h, params), [_, count])| {
            let mut resources = vec![
                ("view", seen.view.bound()),
                ("params", params.bound()),
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("frames", h.tangent_frames.bound()),
                ("previous_positions", h.previous_positions.bound()),
            ];
            resources.extend(fibre.resources(&hair_light, light));
            (resources, Draw::Corners(h.head.strand_ends[*count as usize] * 3))
        });
        self.kernels.record(r, onto, &seen.depth, each);
    }
}

/// Times as many strands as hairs of the scalp are drawn at a distance: a brow has some hundreds, whose gaps would show.
const STRANDS_FOR_HAIRS: f32 = 4.0;

/// Strands of a head, and how many of them, the first, are drawn.
fn strands(posed: &PosedHead<'_>, detail: DetailMethod, seen: &Seen) -> [u32; 2] {
    let all = posed.head.strand_ends.len() as u32 - 1;
    match detail {
        DetailMethod::Full => [all, all],
        DetailMethod::Auto => [all, drawn_hairs(all, seen.pixel_metres(posed.index) / STRANDS_FOR_HAIRS)],
    }
}
