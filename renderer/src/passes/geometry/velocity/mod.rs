//! Motion since the previous frame, for antialiasing over time.
//!
//! ```text
//! id, positions and camera of this frame and the previous one --velocity--> pixels, x right, y down, without jitter
//! ```
//!
//! Theory: the point that a pixel sees keeps its barycentric coordinates, so its previous place is known exactly:
//! morphs, head motion and camera are all contained in the two sets of positions and matrices (Jimenez 2012 section
//! 10.3.3).
//!
//! Hair and lashes mix their own motion in afterwards (see `cropped_hair` and `overlay`).
//!
//! Does not: follow motion on the surface (blood, wrinkles).

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::block_groups;
use crate::scene::PosedHead;
use crate::scene::view::Seen;

const SHADER: Module = module!("velocity", "velocity.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

/// The pipeline of the pass.
pub(crate) struct Velocity {
    kernel: Kernel,
}

impl Velocity {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { kernel: Kernel::new(gpu, "velocity", &program(), "screen_velocity") }
    }

    /// Motion of the visible parts of heads, in the order of their ids.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, seen: &Seen, heads: &[PosedHead<'_>]) -> Image {
        let size = seen.ids.size();
        let spec = ImageSpec::light(size).also(wgpu::TextureUsages::RENDER_ATTACHMENT);
        // Without heads nothing is written; a new image is zero.
        let velocity = match heads.is_empty() {
            true => Image::new(r.gpu, "velocity", spec),
            false => r.image("velocity", spec),
        };
        let numbers: Vec<_> = heads.iter().map(|h| r.uniform("head", &[h.index, 0, 0, 0])).collect();
        let each = heads.iter().zip(&numbers).map(|(h, number)| {
            let resources = vec![
                ("view", seen.view.bound()),
                ("head", number.bound()),
                ("visible", seen.ids.bound()),
                ("positions", h.positions.bound()),
                ("previous_positions", h.previous_positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("velocity", velocity.bound()),
            ];
            (resources, block_groups(size))
        });
        r.dispatch_each(&self.kernel, each);
        velocity
    }
}
