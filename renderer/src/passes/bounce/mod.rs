//! Light that the head sends to itself: the neck lights the chin, one wall of a cavity the other.
//!
//! ```text
//! lamps, shadows, sky --emit--> radiance of each patch --send_on--> radiance with all bounces
//!        --gather--> light on each point --smooth--> bounced
//! ```
//!
//! Theory: radiosity (Goral et al. 1984) along the rays of each point ([`rubor_rig::exchange`]). Up to eight points of each patch are lit as `shade` lights
//! a pixel, without the highlight; the patch has their mean radiance. The light on a point is the mean over its rays of the patches that they meet.
//! A patch sends on `albedo b / (1 - albedo h)` of the light `b` that other patches send to it: that first bounce is traced, and further ones are taken as if
//! all that the patch sees sent as much as itself, where `h` is the part of the sky that is hidden. In a closed cavity of one radiance this is the whole
//! series.
//!
//! `shade` adds it to the light of the sky. That had a guess of light between the walls of a cavity (Jimenez et al. 2016), which
//! frames without this pass still have.
//!
//! The rays are those of the head at rest and, by the weight of `jawOpen`, those of the head with an open mouth: there the palate does not see the tongue
//! on which it lay. In any other pose each sum is scaled by how much more or less of the sky a point sees than where its rays were traced.
//!
//! Inputs: what `shade` binds; frames and visibility of the pose. Output: radiance of a white surface at each point, linear
//! Rec. 709, `vec4f`.
//!
//! Does not: carry highlights, light through thin parts, light between heads, or from parts that are seen through. Parts with the
//! material of their author count as a grey of 0.2. The light of eyes is that without lids.
//!
//! Cost: four dispatches, all heads in each; `docs/light.md` has the time. What takes long on a graphics card is not the work but one point after
//! the other and one lamp after the other: so four invocations share a point.

#[cfg(test)]
mod tests;

use rubor_rig::exchange::{Exchange, MOST_PATCHES, Pose, RAYS};

use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::passes::shade::{self, Lighting, Shade};
use crate::scene::PosedHead;
use crate::scene::head::Surface;

const EMIT: Module = module!("bounce_emit", "emit.wesl");
const BOUNCE: Module = module!("bounce", "bounce.wesl");
const SMOOTH: Module = module!("bounce_smooth", "smooth.wesl");

/// The shader that lights points; with `shares_lamps` four invocations share those of a point.
pub(crate) fn emit_program(shares_lamps: bool) -> Program {
    shade::importing(EMIT, Some("points")).flag("shared_lamps", shares_lamps).constant("EMITTERS", EMITTERS)
}

/// The shader that sends light from patches to points.
pub(crate) fn bounce_program() -> Program {
    Program::new(BOUNCE).constant("EMITTERS", EMITTERS)
}

/// The shader that smooths over neighbours.
pub(crate) fn smooth_program() -> Program {
    Program::new(SMOOTH)
}

/// Points that stand for a patch, at most: every point of it would cost more and look the same.
const EMITTERS: u32 = 8;
/// In place of a point where a patch has fewer.
const NO_POINT: u32 = u32::MAX;

/// What the points of a head see of it, on the device.
pub(crate) struct Ways {
    /// [`EMITTERS`] of each patch.
    emitters: wgpu::Buffer,
    /// At rest, then with an open mouth where the head can open it.
    ways: wgpu::Buffer,
    /// Ambient visibility of each point in the same poses.
    visibility: wgpu::Buffer,
    neighbour_starts: wgpu::Buffer,
    neighbours: wgpu::Buffer,
    patch_count: u32,
}

impl Ways {
    /// Traces rays from the points of a surface, whose ambient visibility is known.
    pub(crate) fn new(gpu: &Gpu, surface: &Surface) -> Self {
        let point = |v: u32| surface.vertices[v as usize].point;
        let triangles: Vec<[u32; 3]> =
            surface.triangles.iter().map(|[a, b, c, _]| [point(*a), point(*b), point(*c)]).collect();
        let opened = surface.opened.as_ref();
        let mut poses = vec![Pose { points: &surface.points, visibility: &surface.visibility }];
        poses.extend(opened.map(|o| Pose { points: &o.points, visibility: &o.visibility }));
        let exchange = Exchange::new(&triangles, &poses);
        let mut corner_of_point = vec![u32::MAX; surface.points.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for (k, p) in corners.iter().enumerate() {
                corner_of_point[*p as usize] = 4 * t as u32 + k as u32;
            }
        }
        let words: Vec<u32> =
            exchange.seen.chunks_exact(2).map(|w| u32::from(w[0]) | u32::from(w[1]) << 16).collect();
        let known = |p: usize, pose: &Pose<'_>| pose.visibility.get(p).copied().unwrap_or(1.0);
        let visibility: Vec<f32> =
            poses.iter().flat_map(|pose| (0..pose.points.len()).map(|p| known(p, pose))).collect();
        const { assert!(RAYS == 32, "bounce.wesl has four invocations read eight each") };
        let mut emitters: Vec<[u32; 2]> = Vec::new();
        for range in exchange.patch_starts.windows(2) {
            let of_patch = &exchange.patch_points[range[0] as usize..range[1] as usize];
            let step = of_patch.len().div_ceil(EMITTERS as usize).max(1);
            let mut chosen = of_patch.iter().step_by(step).map(|p| [*p, corner_of_point[*p as usize]]);
            emitters.extend((0..EMITTERS).map(|_| chosen.next().unwrap_or([NO_POINT, 0])));
        }
        let (neighbour_starts, neighbours) = smoothing(surface.points.len(), &triangles);
        Self {
            emitters: gpu.storage("emitting points", &emitters),
            ways: gpu.storage("ways of light", &words),
            visibility: gpu.storage("visibility along them", &visibility),
            neighbour_starts: gpu.storage("neighbour starts", &neighbour_starts),
            neighbours: gpu.storage("neighbours", &neighbours),
            patch_count: exchange.patches() as u32,
        }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers =
            [&self.emitters, &self.ways, &self.visibility, &self.neighbour_starts, &self.neighbours];
        buffers.into_iter().map(|b| b.size()).sum()
    }
}

/// First neighbour of each point, and their number; points and the bits of their weights. Weights are those of two rounds in which a point takes the mean over the
/// corners of its triangles.
fn smoothing(points: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<[u32; 2]>) {
    let mut around: Vec<Vec<(u32, f32)>> = vec![Vec::new(); points];
    for t in triangles {
        for p in t {
            t.iter().for_each(|q| add(&mut around[*p as usize], *q, 1.0));
        }
    }
    for (p, row) in around.iter_mut().enumerate() {
        let sum: f32 = row.iter().map(|(_, w)| w).sum();
        row.iter_mut().for_each(|(_, w)| *w /= sum);
        if row.is_empty() {
            row.push((p as u32, 1.0));
        }
    }
    let (mut starts, mut neighbours) = (vec![0], Vec::new());
    for row in &around {
        let mut twice = Vec::new();
        for (q, weight) in row {
            around[*q as usize].iter().for_each(|(r, w)| add(&mut twice, *r, weight * w));
        }
        neighbours.extend(twice.into_iter().map(|(p, w)| [p, w.to_bits()]));
        starts.push(neighbours.len() as u32);
    }
    (starts, neighbours)
}

fn add(row: &mut Vec<(u32, f32)>, point: u32, weight: f32) {
    match row.iter_mut().find(|(p, _)| *p == point) {
        Some((_, sum)) => *sum += weight,
        None => row.push((point, weight)),
    }
}

/// The buffers between the steps of a head.
pub(crate) struct Bouncing {
    /// Of emitters, 8 bits each.
    albedos: wgpu::Buffer,
    /// Radiance of patches by lamps and sky, and with all bounces.
    sent: wgpu::Buffer,
    sent_in_all: wgpu::Buffer,
    /// Light on points before it is smoothed.
    arrived: wgpu::Buffer,
}

const MOST: u64 = MOST_PATCHES as u64;

impl Bouncing {
    /// For a head of so many points.
    pub(crate) fn new(gpu: &Gpu, points: u32) -> Self {
        Self {
            albedos: gpu.storage_zeroed("albedos of emitters", 4 * u64::from(EMITTERS) * MOST),
            sent: gpu.storage_zeroed("light of patches", 16 * MOST),
            sent_in_all: gpu.storage_zeroed("light of patches in all", 16 * MOST),
            arrived: gpu.storage_zeroed("light on points", 16 * u64::from(points)),
        }
    }

    /// Bytes that [`Bouncing::new`] takes.
    pub(crate) fn bytes_of(points: u32) -> u64 {
        (4 * u64::from(EMITTERS) + 32) * MOST + (16 * u64::from(points)).max(16)
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.albedos, &self.sent, &self.sent_in_all, &self.arrived].into_iter().map(|b| b.size()).sum()
    }
}

/// The pipelines of the pass.
pub(crate) struct Bounce {
    emit: Kernel,
    send_on: Kernel,
    gather: Kernel,
    smooth: Kernel,
    emitters_of_group: u32,
}

/// Parts that the traced poses have in the one of a frame.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Poses {
    /// Rest, and an open mouth.
    weights: [f32; 2],
    point_count: u32,
    padding: u32,
}

impl Poses {
    fn of(head: &PosedHead<'_>) -> Self {
        let opened = head.head.surface.opened.as_ref();
        let open = opened.map_or(0.0, |o| head.state.shapes[o.shape].clamp(0.0, 1.0));
        Self { weights: [1.0 - open, open], point_count: head.head.point_count, padding: 0 }
    }
}

/// What a head binds while patches send light to points.
fn between<'a>(head: &PosedHead<'a>, ways: &'a Ways, poses: &'a wgpu::Buffer) -> Vec<Resource<'a>> {
    vec![
        ("poses", poses.bound()),
        ("ways", ways.ways.bound()),
        ("visibility", ways.visibility.bound()),
        ("positions", head.positions.bound()),
    ]
}

/// Invocations of a workgroup, and those that share a point.
const THREADS: u32 = 64;
const SHARES: u32 = 4;

impl Bounce {
    /// `stored_shadows` if shadow maps are floats and no depth textures.
    pub(crate) fn new(gpu: &Gpu, stored_shadows: bool) -> Self {
        let shares_lamps = !gpu.is_software();
        let emit = emit_program(shares_lamps).flag("stored_shadows", stored_shadows);
        Self {
            emit: Kernel::new(gpu, "bounce emit", &emit, "emit"),
            send_on: Kernel::new(gpu, "bounce send on", &bounce_program(), "send_on"),
            gather: Kernel::new(gpu, "bounce gather", &bounce_program(), "gather"),
            smooth: Kernel::new(gpu, "bounce smooth", &smooth_program(), "smooth_light"),
            emitters_of_group: if shares_lamps { THREADS / SHARES } else { THREADS },
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
        let heads: Vec<_> = heads
            .iter()
            .map(|h| (h, h.head.ways(r.gpu)))
            .filter(|(_, ways)| ways.patch_count > 0)
            .map(|(head, ways)| {
                // Cavities have no guess of the light that this finds.
                let mut params = shade::params(lighting, head);
                params.skin_flags |= shade::BOUNCES;
                (head, ways, r.uniform("bounce", &params), r.uniform("traced poses", &Poses::of(head)))
            })
            .collect();
        let groups = |n: u32, each: u32| [n.div_ceil(each), 1, 1];
        let lamps = heads.iter().map(|(head, ways, params, _)| {
            let mut resources = shade.resources(lighting, head, params);
            resources.extend([
                ("emitters", ways.emitters.bound()),
                ("albedos", head.bouncing.albedos.bound()),
                ("sent", head.bouncing.sent.bound()),
            ]);
            (resources, groups(EMITTERS * ways.patch_count, self.emitters_of_group))
        });
        r.dispatch_each(&self.emit, lamps);
        let on = heads.iter().map(|(head, ways, _, poses)| {
            let mut resources = between(head, ways, poses);
            resources.extend([
                ("emitters", ways.emitters.bound()),
                ("albedos", head.bouncing.albedos.bound()),
                ("sent", head.bouncing.sent.bound()),
                ("sent_out", head.bouncing.sent_in_all.bound()),
            ]);
            (resources, groups(SHARES * EMITTERS * ways.patch_count, THREADS))
        });
        r.dispatch_each(&self.send_on, on);
        let gathered = heads.iter().map(|(head, ways, _, poses)| {
            let mut resources = between(head, ways, poses);
            resources.extend([
                ("sent", head.bouncing.sent_in_all.bound()),
                ("arrived_out", head.bouncing.arrived.bound()),
            ]);
            (resources, groups(SHARES * head.head.point_count, THREADS))
        });
        r.dispatch_each(&self.gather, gathered);
        let smoothed = heads.iter().map(|(head, ways, ..)| {
            let resources = vec![
                ("neighbour_starts", ways.neighbour_starts.bound()),
                ("neighbours", ways.neighbours.bound()),
                ("arrived", head.bouncing.arrived.bound()),
                ("arrived_out", head.bounced.bound()),
            ];
            (resources, groups(SHARES * head.head.point_count, THREADS))
        });
        r.dispatch_each(&self.smooth, smoothed);
    }
}
