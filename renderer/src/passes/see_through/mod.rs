//! Parts that are seen through: alpha that blends (hair cards, lashes, painted lines) and thin glass.
//!
//! ```text
//! for each layer, the nearest first:
//!   positions, depth, depth of the layer before --layer--> id, depth of the nearest see-through triangle behind that layer
//!   id, light, sum so far --shade_layer--> radiance of the layers so far, and the share of what lies behind that they pass
//! hdr, radiance, share --behind--> hdr
//! ```
//!
//! Theory: depth peeling (Everitt 2001, "Interactive order-independent transparency"): each layer is the nearest surface
//! behind the one before, whatever the order of triangles, so cards that cross are right in every pixel. Shares are of three
//! colours, as coloured glass needs.
//!
//! Differs from the source: nearest first, so the layers beyond the last are those that show least; where alpha is
//! [`OPAQUE_ALPHA`] or more, blended parts are opaque and go through the visibility buffer, so most hair needs few layers.
//!
//! Inputs and outputs: `hdr` is linear Rec. 709 radiance (rgba16float), a = coverage; depth is reversed and infinite.
//!
//! Does not: draw more than [`LAYERS`] layers (what lies behind them is seen as if the rest were not there); refract, or
//! blur what is seen through rough glass; tell the motion of layers to antialiasing over time, which gets that of what lies
//! behind; sort against hairs that rubor draws itself, which are behind. Heads without such parts cost nothing.

use std::sync::OnceLock;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{
    Attachments, Bind, Draw, Gpu, Image, ImageSpec, Kernel, Raster, RasterKernel, Recorder, color_attachment,
    depth_attachment,
};
use crate::passes::pixel_groups;
use crate::passes::shade::{Lighting, Shade};
use crate::scene::PosedHead;
use crate::scene::authored::OPAQUE_ALPHA;
use crate::scene::head::AUTHORED_SHIFT;
use crate::scene::view::Seen;

const LAYER_SHADER: Module = module!("see_through_layer", "layer.wesl");
const BEHIND_SHADER: Module = module!("see_through_behind", "behind.wesl");

/// Layers that a pixel can have.
pub(crate) const LAYERS: u32 = 6;

/// The shader that finds the next layer.
pub(crate) fn layer_program() -> Program {
    Program::new(LAYER_SHADER)
        .constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
        .constant("OPAQUE_ALPHA", OPAQUE_ALPHA)
}

/// The shader that puts layers over a picture.
pub(crate) fn behind_program() -> Program {
    Program::new(BEHIND_SHADER)
}

/// The layers of a frame so far.
pub(crate) struct Sum {
    /// Radiance towards the viewer.
    pub(crate) radiance: Image,
    /// Share of what lies behind that passes.
    pub(crate) share: Image,
}

impl Sum {
    pub(crate) fn new(r: &mut Recorder<'_>, size: [u32; 2]) -> Self {
        Self {
            radiance: r.image("layers", ImageSpec::light(size)),
            share: r.image("share behind layers", ImageSpec::light(size)),
        }
    }
}

struct Kernels {
    layer: RasterKernel,
    behind: Kernel,
}

/// The pipelines of the pass, made by the first frame that needs them.
#[derive(Default)]
pub(crate) struct SeeThrough {
    kernels: OnceLock<Kernels>,
}

impl SeeThrough {
    /// The picture with what is seen through over it; `hdr` itself where there is nothing.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        shade: &Shade,
        lighting: &Lighting<'_>,
        heads: &[PosedHead<'_>],
        hdr: Image,
    ) -> Image {
        if heads.iter().all(|h| h.head.see_through_triangles == 0) {
            return hdr;
        }
        let kernels = self.kernels.get_or_init(|| kernels(r.gpu));
        let seen = lighting.seen;
        let size = hdr.size();
        let mut sum: Option<Sum> = None;
        let mut before = seen.depth.clone();
        for layer in 0..LAYERS {
            let found = find(r, kernels, seen, &before, heads, layer);
            let lighting = Lighting { seen: &found, first: None, transmittance: None, ..*lighting };
            let next = shade.record_layer(r, &lighting, heads, sum.as_ref());
            before = found.depth;
            sum = Some(next);
        }
        let Some(sum) = sum else { return hdr };
        let spec = ImageSpec::light(size).also(wgpu::TextureUsages::RENDER_ATTACHMENT);
        let result = r.image("radiance", spec);
        let resources = [
            ("hdr", hdr.bound()),
            ("radiance", sum.radiance.bound()),
            ("share", sum.share.bound()),
            ("result", result.bound()),
        ];
        r.dispatch(&kernels.behind, &resources, pixel_groups(size));
        result
    }
}

/// Ids and depth of the nearest see-through triangles between what is opaque and the layer before.
fn find(
    r: &mut Recorder<'_>,
    kernels: &Kernels,
    seen: &Seen,
    before: &Image,
    heads: &[PosedHead<'_>],
    layer: u32,
) -> Seen {
    let size = seen.ids.size();
    let ids = r.image("layer ids", ImageSpec::attachment(size, wgpu::TextureFormat::R32Uint));
    let depth = r.image("layer depth", ImageSpec::attachment(size, wgpu::TextureFormat::Depth32Float));
    let drawn: Vec<_> = heads.iter().filter(|h| h.head.see_through_triangles > 0).collect();
    let first = |h: &PosedHead<'_>| h.head.opaque_triangles - h.head.see_through_triangles;
    let numbers: Vec<_> = drawn.iter().map(|h| r.uniform("layer", &[h.index, first(h), layer, 0])).collect();
    let each: Vec<_> = (drawn.iter().zip(&numbers))
        .filter_map(|(h, number)| {
            let mut resources = h.head.cut_resources()?;
            resources.extend([
                ("view", seen.view.bound()),
                ("positions", h.positions.bound()),
                ("head", number.bound()),
                ("opaque_depth", seen.depth.bound()),
                ("nearer_depth", before.bound()),
            ]);
            Some((resources, Draw::Corners(h.head.see_through_triangles * 3)))
        })
        .collect();
    let attachments = Attachments {
        colors: vec![color_attachment(ids.view(), wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT))],
        depth: depth_attachment(depth.view(), wgpu::LoadOp::Clear(0.0)),
    };
    r.draw_each(&kernels.layer, attachments, each);
    Seen {
        view: seen.view.clone(),
        pixels_per_mm: seen.pixels_per_mm,
        ids,
        depth,
        windows: seen.windows.clone(),
    }
}

fn kernels(gpu: &Gpu) -> Kernels {
    let layer = Raster {
        label: "see-through layer",
        program: layer_program(),
        vertex: "layer_vertex",
        fragment: Some("layer_fragment"),
        targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
        nearer: Some(wgpu::CompareFunction::Greater),
        writes_depth: true,
    };
    Kernels {
        layer: RasterKernel::new(gpu, &layer),
        behind: Kernel::new(gpu, "behind see-through", &behind_program(), "behind"),
    }
}

#[cfg(test)]
mod tests;
