//! Normals and tangents of the deformed surface.
//!
//! ```text
//! positions, triangles around each point --tangent_frames--> normal, tangent, bitangent sign, occlusion
//! ```
//!
//! Theory: the normal of a point is the area-weighted mean of its triangles' normals; the tangent follows u, made
//! orthogonal to the normal (Lengyel 2001). Both are recomputed from the deformed triangles, so they are right for
//! every weight; the usual blending of the shapes' normals is wrong where two shapes overlap.
//!
//! Normals that the author of a head made lean from the computed ones as they do at rest: slopes in the frame of each vertex.
//!
//! Reference: `rubor_rig::deform::{point_normals, vertex_tangents, normal_bends, bent}`.
//!
//! Cost: every vertex reads its ring of about six triangles; the positions stay in cache.

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::scene::PosedHead;

const SHADER: Module = module!("tangent_frames", "tangent_frames.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

/// The pipeline of the pass.
pub(crate) struct TangentFrames {
    kernel: Kernel,
}

impl TangentFrames {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { kernel: Kernel::new(gpu, "tangent frames", &program(), "tangent_frames") }
    }

    /// Fills the tangent frames of heads from their positions.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, heads: &[PosedHead<'_>]) {
        let each = heads.iter().map(|h| {
            let resources = vec![
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("ring_starts", h.head.ring_starts.bound()),
                ("ring", h.head.ring.bound()),
                ("frames", h.tangent_frames.bound()),
            ];
            (resources, [h.head.vertex_count.div_ceil(64), 1, 1])
        });
        r.dispatch_each(&self.kernel, each);
    }
}
