//! Curvature of the points of deformed heads.
//!
//! ```text
//! triangles around each point --list_spokes, once a head--> points and vertices around each point
//! positions, normals, spokes --curvature_of_points--> rough --smooth_curvature, twice--> curvature
//! ```
//!
//! Theory: differences of the smooth normals over the edges around a point, least squares for the symmetric matrix of the
//! tangent plane (the shape operator; Rusinkiewicz 2004 does the same for faces). It is kept as a tensor of world
//! space, so that it can be averaged and interpolated over triangles without regard to tangents. The mean over
//! neighbours, turned into one tangent plane, takes away what one ring of triangles gets wrong.
//!
//! Reference: `reference.rs`. Cost: three dispatches of one invocation per point.

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::scene::PosedHead;

const SHADER: Module = module!("skin_curvature", "curvature.wesl");

/// The shader of the passes.
pub(super) fn program() -> Program {
    Program::new(SHADER).with(&[super::TENSOR])
}

/// Bytes of a tensor.
const TENSOR_BYTES: u64 = 32;

/// Bytes of the points and vertices of two neighbours.
const SPOKE_BYTES: u64 = 16;

/// The pipelines.
pub(super) struct Curvature {
    list: Kernel,
    points: Kernel,
    smooth: Kernel,
}

/// The curvature of one head.
pub(super) struct Curvatures {
    /// The last pass writes the first.
    buffers: [wgpu::Buffer; 2],
    spokes: wgpu::Buffer,
    hubs: wgpu::Buffer,
    /// That of the head.
    ring: wgpu::Buffer,
}

impl Curvatures {
    /// Whether they are those of this head.
    pub(super) fn fit(&self, head: &PosedHead<'_>) -> bool {
        self.ring == head.head.ring
    }

    /// The result.
    pub(super) fn smooth(&self) -> &wgpu::Buffer {
        &self.buffers[0]
    }

    pub(super) fn bytes(&self) -> u64 {
        self.buffers.iter().chain([&self.spokes, &self.hubs]).map(wgpu::Buffer::size).sum()
    }
}

impl Curvature {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let kernel = |entry| Kernel::new(gpu, "scatter curvature", &program(), entry);
        Self {
            list: Kernel::new(gpu, "list spokes", &program(), "list_spokes"),
            points: kernel("curvature_of_points"),
            smooth: kernel("smooth_curvature"),
        }
    }

    /// What a head needs.
    pub(super) fn prepare(&self, r: &mut Recorder<'_>, head: &PosedHead<'_>) -> Curvatures {
        let points = u64::from(head.head.point_count);
        let spokes = SPOKE_BYTES * (head.head.ring.size() / 4);
        let made = Curvatures {
            buffers: ["curvature", "rough curvature"]
                .map(|label| r.gpu.storage_zeroed(label, TENSOR_BYTES * points)),
            spokes: r.gpu.storage_zeroed("spokes", spokes),
            hubs: r.gpu.storage_zeroed("hubs", 4 * points),
            ring: head.head.ring.clone(),
        };
        let resources = vec![
            ("vertices", head.head.vertices.bound()),
            ("triangles", head.head.triangles.bound()),
            ("ring_starts", head.head.ring_starts.bound()),
            ("ring", head.head.ring.bound()),
            ("spokes_out", made.spokes.bound()),
            ("hubs_out", made.hubs.bound()),
        ];
        r.dispatch_each(&self.list, [(resources, [head.head.point_count.div_ceil(64), 1, 1])]);
        made
    }

    /// Finds the curvature of heads.
    pub(super) fn record(&self, r: &mut Recorder<'_>, heads: &[(&PosedHead<'_>, &Curvatures)]) {
        for (kernel, from, to) in [(&self.points, 1, 0), (&self.smooth, 0, 1), (&self.smooth, 1, 0)] {
            let each = heads.iter().map(|(h, c)| {
                let resources = vec![
                    ("positions", h.positions.bound()),
                    ("frames", h.tangent_frames.bound()),
                    ("ring_starts", h.head.ring_starts.bound()),
                    ("spokes", c.spokes.bound()),
                    ("hubs", c.hubs.bound()),
                    ("rough", c.buffers[from].bound()),
                    ("curvatures", c.buffers[to].bound()),
                ];
                (resources, [h.head.point_count.div_ceil(64), 1, 1])
            });
            r.dispatch_each(kernel, each);
        }
    }
}
