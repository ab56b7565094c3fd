//! Light that the head sends to itself: the neck lights the chin, one wall of a cavity the other.
//!
//! ```text
//! lamps, shadows, sky --emit--> radiance, albedo of each point --average--> radiance of each patch
//!        --gather--> light of one bounce on each point --average, gather--> of all bounces --smooth, smooth--> bounced
//! ```
//!
//! Theory: radiosity (Goral et al. 1984) by what rays of each point meet at rest ([`rubor_rig::exchange`]). Eight points of each patch are lit as
//! `shade` lights a pixel, without the highlight; patches of some square centimetres have the mean radiance of these; the
//! light on a point is the mean over its rays of the patches that they meet. A second round lights patches by the first. Each further one
//! is about as much weaker as the second is than the first, so the sum of all is `b1 + b2 / (1 - b2 / b1)`.
//!
//! `shade` adds it to the light of the sky. That had a guess of light between the walls of a cavity (Jimenez et al. 2016), which
//! frames without this pass still have.
//!
//! The rays are those of the head at rest. In a pose the sum is scaled by what a point sees less of the sky: an open jaw shows the
//! palate more sky and less tongue.
//!
//! Inputs: what `shade` binds; frames and visibility of the pose. Output: radiance of a white surface at each point, linear
//! Rec. 709, `vec4f`.
//!
//! Does not: carry highlights, light through thin parts, light between heads, or from parts that are seen through. Parts with the
//! material of their author count as a grey of 0.2. The light of eyes is that without lids.
//!
//! Cost: seven dispatches over points; `docs/light.md` has the time.

#[cfg(test)]
mod tests;

use rubor_rig::exchange::{Exchange, RAYS};

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::passes::shade::{self, Lighting, Shade};
use crate::scene::PosedHead;
use crate::scene::head::Surface;

const EMIT: Module = module!("bounce_emit", "emit.wesl");
const BOUNCE: Module = module!("bounce", "bounce.wesl");
const SMOOTH: Module = module!("bounce_smooth", "smooth.wesl");

/// The shader that lights points.
pub(crate) fn emit_program() -> Program {
    shade::importing(EMIT, None)
}

/// The shader that sends light from patches to points; `again` for the second round.
pub(crate) fn bounce_program(again: bool) -> Program {
    Program::new(BOUNCE).flag("again", again)
}

/// The shader that smooths over neighbours.
pub(crate) fn smooth_program() -> Program {
    Program::new(SMOOTH)
}

/// What the points of a head see of it, on the device.
pub(crate) struct Ways {
    emitters: wgpu::Buffer,
    patch_starts: wgpu::Buffer,
    patch_points: wgpu::Buffer,
    ways: wgpu::Buffer,
    patches: wgpu::Buffer,
    emitted: wgpu::Buffer,
    /// Light on points, in turn.
    arrived: [wgpu::Buffer; 2],
    patch_count: u32,
    emitter_count: u32,
}

/// Points that stand for a patch, at most: every point of it would cost more and look the same.
const MOST_EMITTERS: usize = 8;

impl Ways {
    /// Traces rays from the points of a surface at rest, whose ambient visibility is known.
    pub(crate) fn new(gpu: &Gpu, surface: &Surface) -> Self {
        let point = |v: u32| surface.vertices[v as usize].point;
        let triangles: Vec<[u32; 3]> =
            surface.triangles.iter().map(|[a, b, c, _]| [point(*a), point(*b), point(*c)]).collect();
        let exchange = Exchange::new(&surface.points, &triangles, &surface.visibility);
        let mut corner_of_point = vec![u32::MAX; surface.points.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for (k, p) in corners.iter().enumerate() {
                corner_of_point[*p as usize] = 4 * t as u32 + k as u32;
            }
        }
        let words: Vec<u32> =
            exchange.seen.chunks_exact(2).map(|w| u32::from(w[0]) | u32::from(w[1]) << 16).collect();
        const { assert!(RAYS == 32, "bounce.wesl reads four vectors of eight") };
        let (mut patch_starts, mut patch_points) = (vec![0], Vec::new());
        for range in exchange.patch_starts.windows(2) {
            let of_patch = &exchange.patch_points[range[0] as usize..range[1] as usize];
            patch_points.extend(of_patch.iter().step_by(of_patch.len().div_ceil(MOST_EMITTERS)).copied());
            patch_starts.push(patch_points.len() as u32);
        }
        let emitters: Vec<[u32; 2]> =
            patch_points.iter().map(|p| [*p, corner_of_point[*p as usize]]).collect();
        let points = 16 * surface.points.len() as u64;
        Self {
            emitter_count: emitters.len() as u32,
            emitters: gpu.storage("emitting points", &emitters),
            patch_starts: gpu.storage("patch starts", &patch_starts),
            patch_points: gpu.storage("points of patches", &patch_points),
            ways: gpu.storage("ways of light", &words),
            patches: gpu.storage_zeroed("patches", 16 * exchange.patches() as u64),
            emitted: gpu.storage_zeroed("emitted light", points),
            arrived: ["light on points", "light on points, other"].map(|l| gpu.storage_zeroed(l, points)),
            patch_count: exchange.patches() as u32,
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let [a, b] = &self.arrived;
        let buffers = [
            &self.emitters,
            &self.patch_starts,
            &self.patch_points,
            &self.ways,
            &self.patches,
            &self.emitted,
            a,
            b,
        ];
        buffers.into_iter().map(|b| b.size()).sum()
    }
}

/// The pipelines of the pass.
pub(crate) struct Bounce {
    emit: Kernel,
    /// For each round.
    average: [Kernel; 2],
    gather: [Kernel; 2],
    smooth: Kernel,
}

impl Bounce {
    /// `stored_shadows` if shadow maps are floats and no depth textures.
    pub(crate) fn new(gpu: &Gpu, stored_shadows: bool) -> Self {
        let round = |entry: &'static str| {
            [false, true].map(|again| Kernel::new(gpu, "bounce", &bounce_program(again), entry))
        };
        Self {
            emit: Kernel::new(gpu, "bounce", &emit_program().flag("stored_shadows", stored_shadows), "emit"),
            average: round("average"),
            gather: round("gather"),
            smooth: Kernel::new(gpu, "bounce", &smooth_program(), "smooth_light"),
        }
    }

    /// Fills the bounced light of heads.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        shade: &Shade,
        lighting: &Lighting<'_>,
        heads: &[PosedHead<'_>],
    ) {
        for head in heads {
            let ways = head.head.ways(r.gpu);
            if ways.patch_count == 0 {
                continue;
            }
            // Cavities have no guess of the light that this finds.
            let mut params = shade::params(lighting, head);
            params.skin_flags |= shade::BOUNCES;
            let params = r.uniform("bounce", &params);
            let points = [head.head.point_count.div_ceil(64), 1, 1];
            let mut resources = shade.resources(lighting, head, &params);
            resources.extend([
                ("emitters", ways.emitters.bound()),
                ("emitted", ways.emitted.bound()),
                ("depth", lighting.seen.depth.bound()),
            ]);
            r.dispatch(&self.emit, &resources, [ways.emitter_count.div_ceil(64), 1, 1]);
            let [first, second] = &ways.arrived;
            for round in 0..2 {
                let (from, to) = if round == 0 { (second, first) } else { (first, second) };
                let all = [
                    ("arrived", from.bound()),
                    ("arrived_out", to.bound()),
                    ("emitted", ways.emitted.bound()),
                    ("patch_starts", ways.patch_starts.bound()),
                    ("patch_points", ways.patch_points.bound()),
                    ("ways", ways.ways.bound()),
                    ("rest", head.head.rest.bound()),
                    ("positions", head.positions.bound()),
                    ("patches", ways.patches.bound()),
                ];
                r.dispatch(&self.average[round], &all, [ways.patch_count, 1, 1]);
                r.dispatch(&self.gather[round], &all, points);
            }
            for (from, to) in [(second, first), (first, head.bounced)] {
                let all = vec![
                    ("arrived", from.bound()),
                    ("arrived_out", to.bound()),
                    ("vertices", head.head.vertices.bound()),
                    ("triangles", head.head.triangles.bound()),
                    ("ring_starts", head.head.ring_starts.bound()),
                    ("ring", head.head.ring.bound()),
                ];
                r.dispatch(&self.smooth, &all, points);
            }
        }
    }
}
