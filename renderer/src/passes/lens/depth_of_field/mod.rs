//! Depth of field: what a lens with an aperture does not focus on is seen as disks.
//!
//! ```text
//! depth --tile_of_radii--> largest and mean radius of each tile --reach--> what reaches a tile
//! hdr, depth, backdrop --levels--> difference from the backdrop and radius, four coarser levels
//! levels, what reaches a tile --gather--> hdr
//! ```
//!
//! Theory: a point at distance d is seen by a thin lens (focal length f, f-number N, focus at s) as a disk of diameter
//! `f^2 / (N (s - f)) |1 - s / d|` on the sensor, the circle of confusion (Potmesil and Chakravarty 1981). Its light is spread evenly
//! over the disk. A pixel gathers from the disks that cover it, each with one over its area (Jimenez 2014, "Next
//! generation post processing in Call of Duty: Advanced Warfare"), in tiles with the largest radius that reaches them.
//!
//! - **Edges.** What is before a pixel's surface covers it by the sum of its weights; what is behind is limited to the blur
//!   of the pixel itself, so a sharp surface gets no halo and lends nothing to the blur beside it. A surface in front of the focus
//!   turns transparent at its edge, and what is behind comes from beside it, as no image holds what it hides.
//! - **Backdrop.** The difference from the backdrop is blurred and put over it again. The backdrop is smooth or out of
//!   focus already, so this is exact for the outline of a head, with no dark rim and hairs of any coverage.
//! - **Hairs and films** have no depth of their own: over a surface they have its depth, over the backdrop that of the surfaces
//!   around them.
//!
//! Differs from the source: layers are told apart by the difference of their signed radii in place of two classes a tile,
//! taps lie on a spiral with levels by the area that each stands for, and all works at full size.
//!
//! Does not: blur within glass by what is behind it (blended parts have the depth of what is opaque behind them); show the
//! shape of an aperture; follow disks wider than 2 x [`MAX_RADIUS_PX`] pixels (they are that wide).
//!
//! Costs: a read of depth, a write and a third of the picture, then [`crate::settings::DepthOfFieldMethod`]'s taps for tiles that a
//! blur of more than half a pixel reaches; the others are copied.

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

use glam::Vec3;

use super::linear_clamp;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::pixel_groups;
use crate::scene::{Camera, NEAR_METRES, Optics};

const SHADER: Module = module!("depth_of_field", "depth_of_field.wesl");

/// Largest radius of a disk, pixels.
pub(crate) const MAX_RADIUS_PX: f32 = 96.0;
/// Pixels on a side of a tile.
const TILE: u32 = 16;
/// Levels below the picture.
const ATLAS_LEVELS: u32 = 4;
/// Added to the radius of what has no surface; above twice [`MAX_RADIUS_PX`], and a half float keeps a quarter of a pixel there.
const BEHIND_ALL: f32 = 256.0;
/// Exponent of the spiral: 1/2 would spread taps evenly; small disks near the middle need more of them.
const SPIRAL_POWER: f32 = 0.75;

/// The shader of the pass.
pub(crate) fn program(has_backdrop: bool) -> Program {
    Program::new(SHADER)
        .constant("ATLAS_LEVELS", ATLAS_LEVELS)
        .constant("BEHIND_ALL", BEHIND_ALL)
        .constant("MAX_RADIUS", MAX_RADIUS_PX)
        .constant("TILE", TILE)
        .flag("has_backdrop", has_backdrop)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) far_radius: f32,
    pub(crate) focus: f32,
    pub(crate) samples: u32,
    pub(crate) taps: u32,
    pub(crate) backdrop: [f32; 4],
}

/// What is behind everything.
pub(crate) enum Behind<'a> {
    /// One radiance.
    Plain(Vec3),
    /// An image of the size of the frame.
    Image(&'a Image),
}

/// The pipelines of the pass.
pub(crate) struct DepthOfField {
    taps: u32,
    has_backdrop: bool,
    tiles: Kernel,
    reach: Kernel,
    levels: Kernel,
    gather: Kernel,
    spiral: wgpu::Buffer,
    linear_clamp: wgpu::Sampler,
}

/// Offsets of the taps in units of the radius, and the area of each in units of its square.
fn spiral(taps: u32) -> Vec<[f32; 4]> {
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    (0..taps)
        .map(|i| {
            let share = (i as f32 + 0.5) / taps as f32;
            let distance = share.powf(SPIRAL_POWER);
            let (sine, cosine) = (golden * i as f32).sin_cos();
            // 2 pi d times the step of d.
            let area = 2.0 * std::f32::consts::PI * SPIRAL_POWER * share.powf(2.0 * SPIRAL_POWER - 1.0)
                / taps as f32;
            [distance * cosine, distance * sine, area, 0.0]
        })
        .collect()
}

/// Size of the image of the coarser levels.
fn atlas_size(size: [u32; 2]) -> [u32; 2] {
    let of = |level: u32| size.map(|n| n.div_ceil(1 << level));
    let below: u32 = (2..=ATLAS_LEVELS).map(|k| of(k)[0]).sum();
    [of(1)[0].max(below), of(1)[1] + of(2)[1]]
}

impl DepthOfField {
    pub(crate) fn new(gpu: &Gpu, taps: u32, has_backdrop: bool) -> Self {
        let kernel = |label, entry| Kernel::new(gpu, label, &program(has_backdrop), entry);
        Self {
            taps,
            has_backdrop,
            tiles: kernel("depth of field tiles", "tile_of_radii"),
            reach: kernel("depth of field reach", "reach"),
            levels: kernel("depth of field levels", "levels"),
            gather: kernel("depth of field gather", "gather"),
            spiral: gpu.storage("depth of field spiral", &spiral(taps)),
            linear_clamp: linear_clamp(gpu),
        }
    }

    /// Whether it is the one for these settings.
    pub(crate) fn fits(&self, taps: u32, has_backdrop: bool) -> bool {
        self.taps == taps && self.has_backdrop == has_backdrop
    }

    /// The picture through the lens; the picture itself where nothing is blurred. `depth` has `samples` x `samples` pixels for
    /// one of the picture.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        (camera, optics): (&Camera, &Optics),
        samples: u32,
        hdr: Image,
        depth: &Image,
        behind: &Behind<'_>,
    ) -> Image {
        let size = hdr.size();
        let far_radius = optics.far_radius_px(camera, size[1]);
        let (color, image) = match behind {
            Behind::Plain(color) => (*color, &hdr),
            Behind::Image(image) => (Vec3::ZERO, *image),
        };
        let params = Params {
            far_radius,
            focus: optics.focus_metres / NEAR_METRES,
            samples,
            taps: self.taps,
            backdrop: color.extend(0.0).to_array(),
        };
        let params = r.uniform("depth of field", &params);
        let tiles = size.map(|n| n.div_ceil(TILE));
        let light = |r: &mut Recorder<'_>, label, size| r.image(label, ImageSpec::light(size));
        let tile_radii = light(r, "tile radii", tiles);
        let reaching = light(r, "reaching radii", tiles);
        let level_0 = light(r, "depth of field level", size);
        let atlas = light(r, "depth of field levels", atlas_size(size));
        let result = light(r, "focused", size);
        let resources = [
            ("params", params.bound()),
            ("hdr", hdr.bound()),
            ("depth", depth.bound()),
            ("backdrop", image.bound()),
            ("tile_radii", tile_radii.bound()),
            ("tile_radii_out", tile_radii.bound()),
            ("reaching", reaching.bound()),
            ("reaching_out", reaching.bound()),
            ("level_0", level_0.bound()),
            ("level_0_out", level_0.bound()),
            ("atlas", atlas.bound()),
            ("atlas_out", atlas.bound()),
            ("linear_clamp", self.linear_clamp.bound()),
            ("spiral", self.spiral.bound()),
            ("result", result.bound()),
        ];
        r.dispatch(&self.tiles, &resources, [tiles[0], tiles[1], 1]);
        r.dispatch(&self.reach, &resources, pixel_groups(tiles));
        r.dispatch(&self.levels, &resources, [tiles[0], tiles[1], 1]);
        r.dispatch(&self.gather, &resources, pixel_groups(size));
        result
    }
}
