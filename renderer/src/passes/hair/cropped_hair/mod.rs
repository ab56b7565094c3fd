//! Cropped hair: short single hairs where the hair map marks the skin as covered, so that neither the hairline
//! nor the outline of the scalp looks like the edge of a painted cap.
//!
//! ```text
//! hair map, rest mesh --roots, once--> triangle, place, flow, length
//! roots, positions, frames, light --light_hairs--> ends, light, motion of each hair
//! hairs, depth (tested), hdr --cropped_hair--> hdr, velocity (premultiplied over)
//!
//! roots, ..., depth (tested) --cover_hairs--> sums of each pixel --compose--> hdr     where triangles are drawn by compute
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
//! Where triangles are drawn by compute ([`Rasteriser::Compute`]), one invocation lights a hair that is seen and sums it up in the pixels whose
//! centres its triangle holds: optical depth `tau = -ln(1 - opacity)` and radiance times `tau`. [`Compose`](crate::passes::compose) then puts the mean
//! radiance over the picture with the coverage `1 - exp(-sum of tau)`: what hairs in random order show on average, which needs no order (McGuire and Bavoil 2013,
//! with the weight `tau`). Sums are integers, so their order does not matter and frames repeat bit by bit. Opaque hairs would look like glass, so heads
//! so near that a hair may be as wide as the thinnest line, and frames with motion, are drawn by the raster units.
//!
//! Does not: sort (hairs of one colour), cast shadows.

#[cfg(test)]
mod tests;

use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Draw, Gpu, Kernel, Recorder};
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::hair::fibre::{self, Fibre};
use crate::passes::hair::{Blended, Onto};
use crate::scene::PosedHead;
use crate::scene::hair_roots::{WIDTH_METRES, drawn_hairs};
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use crate::settings::DetailMethod;
use glam::Vec3;

const SHADER: Module = module!("cropped_hair", "cropped_hair.wesl");

/// Steps of the sums of hairs for a unit of optical depth, or of radiance times it.
pub(crate) const HAIR_UNIT: f32 = 65536.0;
/// Width of a hair over what is drawn, on the nearest part of a head, up to which sums stand for its hairs.
const MOST_SUMMED_OPACITY: f32 = 1.0;
/// Width of a hair that is thinner, pixels, as in the shader.
const THINNEST_PIXELS: f32 = 1.1;
/// Most bytes for sums; larger frames use the raster units.
const MOST_SUMS: u64 = 1 << 28;

/// The shader of the pass.
pub(crate) fn program() -> Program {
    let constants = Program::new(SHADER).with(&fibre::MODULES).constant("WIDTH", WIDTH_METRES);
    constants.constant("HAIR_UNIT", HAIR_UNIT)
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
    /// Where triangles are drawn by compute.
    cover: Option<Kernel>,
    /// Sums of each pixel, zero between frames; empty where hairs are not summed.
    sums: wgpu::Buffer,
}

/// How the hairs of a head are drawn in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Summed,
    Blended,
}

impl CroppedHair {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let entries = ["cropped_hair_vertex", "cropped_hair_fragment"];
        let lighting = program().flag("stored_shadows", rasteriser.stores_depth());
        Self {
            light: Kernel::new(gpu, "light hairs", &lighting, "light_hairs"),
            kernels: Blended::new(gpu, rasteriser, "cropped hair", program(), entries),
            cover: rasteriser
                .stores_depth()
                .then(|| Kernel::new(gpu, "cover hairs", &lighting.flag("tests_depth", true), "cover_hairs")),
            sums: gpu.storage_zeroed("sums of hairs", 0),
        }
    }

    /// Makes what frames of so many pixels need, with or without hairs.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, pixels: u64, has_hairs: bool) {
        let most = MOST_SUMS.min(gpu.device.limits().max_storage_buffer_binding_size);
        let wanted = if self.cover.is_some() && has_hairs && 16 * pixels <= most { 16 * pixels } else { 0 };
        if self.sums.size() != wanted.max(16) {
            self.sums = gpu.storage_zeroed("sums of hairs", wanted);
        }
    }

    /// Bytes that it keeps on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.sums.size()
    }

    /// How the hairs of a head are drawn.
    fn way(&self, seen: &Seen, head: &PosedHead<'_>) -> Way {
        let [width, height] = seen.ids.size().map(u64::from);
        let pixel = seen.pixel_metres(head.index);
        let is_thin = WIDTH_METRES <= MOST_SUMMED_OPACITY * THINNEST_PIXELS * pixel;
        match self.cover.is_some() && self.sums.size() >= 16 * width * height && is_thin {
            true => Way::Summed,
            false => Way::Blended,
        }
    }

    /// Sums up the hairs of heads that are drawn so; none if there are none.
    pub(crate) fn cover(
        &self,
        r: &mut Recorder<'_>,
        hair: (&Fibre, &Illumination<'_>),
        detail: DetailMethod,
        seen: &Seen,
        heads: &[PosedHead<'_>],
    ) -> Option<&wgpu::Buffer> {
        let kernel = self.cover.as_ref()?;
        let drawn = self.drawn(heads, |h| self.way(seen, h) == Way::Summed);
        if drawn.is_empty() {
            return None;
        }
        let params = numbers(detail, seen, &drawn);
        let ends = [("sums", self.sums.bound()), ("scene_depth", seen.depth.bound())];
        self.light(r, kernel, hair, seen, &drawn, &params, |_| ends.to_vec());
        Some(&self.sums)
    }

    /// Heads with hairs of a kind.
    fn drawn<'h, 'a>(
        &self,
        heads: &'h [PosedHead<'a>],
        is_drawn: impl Fn(&PosedHead<'a>) -> bool,
    ) -> Vec<&'h PosedHead<'a>> {
        let has_hairs = |h: &&PosedHead<'_>| h.head.hair_root_count > 0 && h.head.maps.is_some();
        heads.iter().filter(has_hairs).filter(|h| is_drawn(h)).collect()
    }

    /// Runs a kernel once for each hair of heads; `out` is what else it binds.
    fn light<'r>(
        &self,
        r: &mut Recorder<'_>,
        kernel: &Kernel,
        (fibre, light): (&Fibre, &'r Illumination<'_>),
        seen: &'r Seen,
        drawn: &[&'r PosedHead<'_>],
        params: &[Params],
        out: impl Fn(&'r PosedHead<'_>) -> Vec<Resource<'r>>,
    ) {
        let hair_light = fibre.params(r, light);
        let buffers: Vec<_> = params.iter().map(|p| r.uniform("cropped hair", p)).collect();
        let each: Vec<_> = drawn
            .iter()
            .zip(params.iter().zip(&buffers))
            .map(|(h, (params, buffer))| {
                let mut resources = vec![
                    ("view", seen.view.bound()),
                    ("params", buffer.bound()),
                    ("positions", h.positions.bound()),
                    ("vertices", h.head.vertices.bound()),
                    ("triangles", h.head.triangles.bound()),
                    ("frames", h.tangent_frames.bound()),
                    ("roots", h.head.hair_roots.bound()),
                ];
                resources.extend(out(h));
                resources.extend(fibre.resources(&hair_light, light));
                (resources, [params.count.div_ceil(64), 1, 1])
            })
            .collect();
        r.dispatch_each(kernel, each);
    }

    /// Draws the hairs of heads, or the `rest` that [`CroppedHair::cover`] left.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        hair: (&Fibre, &Illumination<'_>),
        detail: DetailMethod,
        seen: &Seen,
        heads: &[PosedHead<'_>],
        rest: bool,
        onto: Onto<'_>,
    ) {
        let drawn = self.drawn(heads, |h| !rest || self.way(seen, h) == Way::Blended);
        if drawn.is_empty() {
            return;
        }
        let params = numbers(detail, seen, &drawn);
        self.light(r, &self.light, hair, seen, &drawn, &params, |h| {
            vec![("previous_positions", h.previous_positions.bound()), ("lit_out", h.hairs.bound())]
        });
        let each = drawn
            .iter()
            .zip(&params)
            .map(|(h, params)| (vec![("hairs", h.hairs.bound())], Draw::Corners(params.count * 3)));
        self.kernels.record(r, onto, &seen.depth, each);
    }
}

/// Colours and numbers of hairs of heads.
fn numbers(detail: DetailMethod, seen: &Seen, drawn: &[&PosedHead<'_>]) -> Vec<Params> {
    let of = |h: &&PosedHead<'_>| {
        let color = h.head.maps.as_ref().map_or([0.0; 3], |m| m.hair_color_linear);
        let [most, all] = h.head.hair_counts();
        let count = match detail {
            DetailMethod::Full => most,
            DetailMethod::Auto => drawn_hairs(all, seen.pixel_metres(h.index)).min(most),
        };
        let share = all as f32 / count as f32;
        Params { color: Vec3::from(color).extend(1.0).to_array(), count, share, padding: [0; 2] }
    };
    drawn.iter().map(of).collect()
}
