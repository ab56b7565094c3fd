//! Curvature of the points of deformed heads.
//!
//! ```text
//! positions, normals, triangles around each point --curvature_of_points--> rough --smooth_curvature, twice--> curvature
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

/// The pipelines.
pub(super) struct Curvature {
    points: Kernel,
    smooth: Kernel,
}

/// The curvature of one head.
pub(super) struct Curvatures {
    /// The last pass writes the first.
    buffers: [wgpu::Buffer; 2],
}

impl Curvatures {
    pub(super) fn new(gpu: &Gpu, head: &PosedHead<'_>) -> Self {
        let bytes = TENSOR_BYTES * u64::from(head.head.point_count);
        Self { buffers: ["curvature", "rough curvature"].map(|label| gpu.storage_zeroed(label, bytes)) }
    }

    /// Whether there is one tensor for each point.
    pub(super) fn fit(&self, head: &PosedHead<'_>) -> bool {
        self.buffers[0].size() == TENSOR_BYTES * u64::from(head.head.point_count)
    }

    /// The result.
    pub(super) fn smooth(&self) -> &wgpu::Buffer {
        &self.buffers[0]
    }

    pub(super) fn bytes(&self) -> u64 {
        self.buffers.iter().map(wgpu::Buffer::size).sum()
    }
}

impl Curvature {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let kernel = |entry| Kernel::new(gpu, "scatter curvature", &program(), entry);
        Self { points: kernel("curvature_of_points"), smooth: kernel("smooth_curvature") }
    }

    /// Finds the curvature of heads.
    pub(super) fn record(&self, r: &mut Recorder<'_>, heads: &[(&PosedHead<'_>, &Curvatures)]) {
        for (kernel, from, to) in [(&self.points, 1, 0), (&self.smooth, 0, 1), (&self.smooth, 1, 0)] {
            let each = heads.iter().map(|(h, c)| {
                let resources = vec![
                    ("positions", h.positions.bound()),
                    ("vertices", h.head.vertices.bound()),
                    ("triangles", h.head.triangles.bound()),
                    ("frames", h.tangent_frames.bound()),
                    ("ring_starts", h.head.ring_starts.bound()),
                    ("ring", h.head.ring.bound()),
                    ("rough", c.buffers[from].bound()),
                    ("curvatures", c.buffers[to].bound()),
                ];
                (resources, [h.head.point_count.div_ceil(64), 1, 1])
            });
            r.dispatch_each(kernel, each);
        }
    }
}
