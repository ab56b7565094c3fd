//! One direction of a separable kernel: the pass that `separable` runs twice and `screen-gauss` twice per Gaussian.
//!
//! ```text
//! source (rgb, a = depth), strength, depth --sampled along a line--> target [, sum of Gaussians]
//! ```
//!
//! Theory: Jimenez et al. 2015; Jimenez 2012 ch. 6. The kernel is in millimetres on the surface and is projected with the
//! depth and field of view of each pixel; the kernel follows the surface: the light of a neighbour off the tangent
//! plane of the centre is replaced by that of the centre.
//!
//! Differs from the source: it compares a neighbour with the tangent plane and not with the depth of the centre, so a
//! tilted cheek keeps its whole kernel, and shortens the kernel with the tilt (Jimenez 2012 eqs. 4.1 and 4.2, with the
//! cosine instead of tuned constants). A tap is one bilinear sample of light and depth together; only where it is
//! off the plane, and may be a mixture of two surfaces, two texels are read and weighted by their own depths.
//!
//! Limits: depth beside light is a half, exact to 0.06 mm at 100 mm from the nearest head's middle and to 0.5 mm at 1 m.
//!
//! Cost: docs/scatter.md explains its bottleneck on a GPU and the alternatives that were tried (tiles in workgroup
//! memory, one pixel per invocation, rows of invocations along the kernel).

use super::{COMMON, FOLLOW_PER_MM};
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, Kernel, Recorder};
use crate::passes::shade::Lit;
use crate::scene::view::Seen;

const SHADER: Module = module!("line", "line.wesl");

/// Pixels of a workgroup, across and down.
const GROUP: [u32; 2] = [32, 8];

/// Pairs of taps that a kernel can have.
pub(crate) const MAX_PAIRS: usize = 32;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) pair_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) visible_mm: f32,
    pub(crate) level: u32,
    pub(crate) share: [f32; 4],
    pub(crate) share_coarser: [f32; 4],
    pub(crate) pairs: [[f32; 4]; MAX_PAIRS],
}

impl Params {
    /// Taps on one side (R, G, B weight and offset in mm, ascending). A kernel that is invisible at `visible_mm` on
    /// half a pixel is skipped.
    pub(crate) fn new(side: &[([f64; 3], f64)], visible_mm: f64, share: [f64; 3]) -> Self {
        let mut pairs = [[0.0; 4]; MAX_PAIRS];
        for (slot, (w, offset_mm)) in pairs.iter_mut().zip(side) {
            *slot = [w[0] as f32, w[1] as f32, w[2] as f32, *offset_mm as f32];
        }
        Self {
            pair_count: side.len().min(MAX_PAIRS) as u32,
            follow_per_mm: FOLLOW_PER_MM,
            visible_mm: visible_mm as f32,
            level: 0,
            share: [share[0] as f32, share[1] as f32, share[2] as f32, 0.0],
            share_coarser: [0.0; 4],
            pairs,
        }
    }
}

/// What a pass does with its result in addition to writing it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sum {
    None,
    /// Blends it into a sum.
    Own,
    /// As `Own`, and adds the sum of the next level.
    WithCoarser,
}

/// The shader of one direction; `levels` for images that may be smaller than the view.
pub(crate) fn program(vertical: bool, levels: bool, sum: Sum) -> Program {
    Program::new(SHADER)
        .with(&[COMMON])
        .flag("accumulate", sum >= Sum::Own)
        .flag("coarser", sum >= Sum::WithCoarser)
        .constant("VERTICAL", vertical)
        .constant("LEVELS", levels)
}

/// A pipeline for one direction.
pub(crate) struct Line {
    kernel: Kernel,
    linear: wgpu::Sampler,
}

/// The images of a pass that accumulates.
#[derive(Clone, Copy, Default)]
pub(crate) struct Sums<'a> {
    /// The sum before it and after it.
    pub(crate) own: Option<[&'a Image; 2]>,
    /// The sum of the next level.
    pub(crate) coarser: Option<&'a Image>,
}

impl Line {
    pub(crate) fn new(gpu: &Gpu, vertical: bool, levels: bool, sum: Sum) -> Self {
        let name = if vertical { "scatter vertical" } else { "scatter horizontal" };
        let linear = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some(name),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Self { kernel: Kernel::new(gpu, name, &program(vertical, levels, sum), "scatter"), linear }
    }

    /// Blurs `source` into `target`.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        params: &wgpu::Buffer,
        seen: &Seen,
        lit: &Lit,
        [source, target]: [&Image; 2],
        sums: Sums<'_>,
    ) {
        let mut resources = vec![
            ("view", seen.view.bound()),
            ("params", params.bound()),
            ("source", source.bound()),
            ("albedo", lit.albedo.bound()),
            ("depth", seen.depth.bound()),
            ("linear", self.linear.bound()),
            ("target_image", target.bound()),
        ];
        if let Some([before, after]) = sums.own {
            resources.extend([("sum_before", before.bound()), ("sum_after", after.bound())]);
        }
        if let Some(coarser) = sums.coarser {
            resources.push(("coarser", coarser.bound()));
        }
        let [x, y] = GROUP;
        let size = target.size();
        r.dispatch(&self.kernel, &resources, [size[0].div_ceil(x), size[1].div_ceil(y), 1]);
    }
}
