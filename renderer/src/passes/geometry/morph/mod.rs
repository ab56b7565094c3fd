//! Blend shapes: rest points to deformed points in world space, and how much of the sky they see.
//!
//! ```text
//! rest, deltas sorted by point, shape weights --morph--> positions (world, metres; w = ambient visibility)
//! ```
//!
//! Theory: linear blend shapes, `p = world_from_head (rest + sum_i w_i offset_i)` (Lewis et al. 2014, "Practice and
//! theory of blendshape facial models"). The thesis streams shapes out pass by pass (Jimenez 2012 section 7.6); here
//! one dispatch gathers, point by point, only the shapes that move the point.
//!
//! Ambient visibility uses the same weights: the changes of a shape at 0.5 and 1 were traced at import
//! (`rubor_rig::head::OcclusionChange`; `docs/occlusion.md` has its error). The sum over shapes is clamped to 0..1.
//!
//! Reference: `rubor_rig::deform::{deform_points, blend_occlusion}`.
//!
//! Does not: normals (see `tangent_frames`), combination shapes (the rig resolves them to weights).
//!
//! Cost: reads 16 bytes per delta and each point once; bound by the dispatch on a large GPU.

use glam::Mat4;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::scene::PosedHead;

const SHADER: Module = module!("morph", "morph.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) world_from_head: Mat4,
    pub(crate) point_count: u32,
    pub(crate) padding: [u32; 3],
}

/// The pipeline of the pass.
pub(crate) struct Morph {
    kernel: Kernel,
}

impl Morph {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { kernel: Kernel::new(gpu, "morph", &program(), "morph") }
    }

    /// Fills the positions of heads from the weights of their states.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, heads: &[PosedHead<'_>]) {
        let inputs: Vec<_> = heads
            .iter()
            .map(|h| {
                let (world_from_head, point_count) = (h.world_from_head, h.head.point_count);
                let params = Params { world_from_head, point_count, padding: [0; 3] };
                (r.uniform("morph", &params), r.gpu.storage("shape weights", &h.state.shapes))
            })
            .collect();
        let each = heads.iter().zip(&inputs).map(|(h, (params, weights))| {
            let resources = vec![
                ("params", params.bound()),
                ("rest", h.head.rest.bound()),
                ("delta_starts", h.head.delta_starts.bound()),
                ("deltas", h.head.deltas.bound()),
                ("weights", weights.bound()),
                ("positions", h.positions.bound()),
            ];
            (resources, [h.head.point_count.div_ceil(64), 1, 1])
        });
        r.dispatch_each(&self.kernel, each);
    }
}
