//! Depth of the heads from each light.
//!
//! ```text
//! positions, light --shadow--> depth layer (0 near, 1 far)
//! ```
//!
//! Theory: shadow maps (Williams 1978). A map covers only the parts of the heads that the camera sees, so a close-up of
//! a nose has the resolution of the nose; everything between them and the light is included. Windows move in steps, so
//! that shadows do not crawl as the camera moves. All triangles are drawn, front and back: a mouth or a nostril must
//! block light from either side. The soft edge is in `shade` (percentage-closer soft shadows).

use crate::device::wgsl::{Module, Program, module};
use crate::device::{
    Attachments, Bind, Draw, Gpu, Image, ImageSpec, Raster, RasterKernel, Recorder, depth_attachment,
};
use crate::scene::PosedHead;
use crate::scene::lamp::LightView;

const SHADER: Module = module!("shadow", "shadow.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

/// The pipeline of the pass.
pub(crate) struct Shadow {
    kernel: RasterKernel,
}

impl Shadow {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let kernel = RasterKernel::new(
            gpu,
            &Raster {
                label: "shadow",
                program: program(),
                vertex: "shadow_vertex",
                fragment: None,
                targets: &[],
                nearer: wgpu::CompareFunction::Less,
                writes_depth: true,
            },
        );
        Self { kernel }
    }

    /// Draws the opaque triangles of all heads as lights see them, one layer per light; one empty layer without lights.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        lights: &[LightView],
        heads: &[PosedHead<'_>],
        side: u32,
    ) -> Image {
        let spec = ImageSpec::attachment([side; 2], wgpu::TextureFormat::Depth32Float);
        let maps = r.image("shadows", spec.layers(lights.len().max(1) as u32));
        for (layer, light) in lights.iter().enumerate() {
            let clip_from_world = r.uniform("shadow", &light.clip_from_world);
            let view = maps.layer(layer as u32);
            let depth = depth_attachment(&view, wgpu::LoadOp::Clear(1.0));
            let each = heads.iter().map(|h| {
                let resources =
                    vec![("clip_from_world", clip_from_world.bound()), ("positions", h.positions.bound())];
                (resources, Draw::Indexed(&h.head.opaque_points, h.head.opaque_triangles * 3))
            });
            r.draw_each(&self.kernel, Attachments { colors: Vec::new(), depth }, each);
        }
        maps
    }
}
