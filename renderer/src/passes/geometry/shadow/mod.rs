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

use std::sync::OnceLock;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{
    Attachments, Bind, Draw, Gpu, Image, ImageSpec, Raster, RasterKernel, Recorder, depth_attachment,
};
use crate::passes::geometry::raster::{ComputeRaster, Rasteriser, Sight};
use crate::scene::PosedHead;
use crate::scene::head::AUTHORED_SHIFT;
use crate::scene::lamp::LightView;

const SHADER: Module = module!("shadow", "shadow.wesl");
const CUT_SHADER: Module = module!("shadow_cut", "cut.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
}

/// The shader of what has holes.
pub(crate) fn cut_program() -> Program {
    Program::new(CUT_SHADER).constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
}

/// The pass.
pub(crate) enum Shadow {
    /// With the raster units of the device: depth textures.
    Hardware(Hardware),
    /// Without them, all lights at once: floats.
    Compute(ComputeRaster),
}

impl Shadow {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        match rasteriser {
            Rasteriser::Hardware => Self::Hardware(Hardware::new(gpu)),
            Rasteriser::Compute { .. } => Self::Compute(ComputeRaster::new(gpu, Sight::Lights)),
        }
    }

    /// Makes what frames with a number of lights need.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, lights: usize, side: u32, heads: usize, has_holes: bool) {
        if let Self::Compute(raster) = self {
            raster.prepare(gpu, lights.max(1) as u64 * u64::from(side) * u64::from(side), heads, has_holes);
        }
    }

    /// Draws the opaque triangles of all heads as lights see them, one layer per light; one empty layer without lights.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        lights: &[LightView],
        heads: &[PosedHead<'_>],
        side: u32,
    ) -> Image {
        match self {
            Self::Hardware(hardware) => hardware.record(r, lights, heads, side),
            Self::Compute(raster) => {
                let clips: Vec<_> = lights.iter().map(|l| l.clip_from_world).collect();
                raster.record_lights(r, &clips, heads, side)
            }
        }
    }

    /// Bytes that it keeps on the device.
    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::Hardware(_) => 0,
            Self::Compute(raster) => raster.bytes(),
        }
    }
}

/// The pipelines that use raster units.
pub(crate) struct Hardware {
    kernel: RasterKernel,
    /// For triangles with holes, made by the first frame that has such.
    cut_kernel: OnceLock<RasterKernel>,
}

impl Hardware {
    fn new(gpu: &Gpu) -> Self {
        let kernel = RasterKernel::new(
            gpu,
            &Raster {
                label: "shadow",
                program: program(),
                vertex: "shadow_vertex",
                fragment: None,
                targets: &[],
                nearer: Some(wgpu::CompareFunction::Less),
                writes_depth: true,
            },
        );
        Self { kernel, cut_kernel: OnceLock::new() }
    }

    fn record(
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
                let whole = h.head.opaque_triangles - h.head.cut_triangles;
                (resources, Draw::Indexed(&h.head.opaque_points, whole * 3))
            });
            r.draw_each(&self.kernel, Attachments { colors: Vec::new(), depth }, each);
            let with_holes: Vec<_> = heads.iter().filter(|h| h.head.cut_triangles > 0).collect();
            if with_holes.is_empty() {
                continue;
            }
            let first = |h: &PosedHead<'_>| h.head.opaque_triangles - h.head.cut_triangles;
            let numbers: Vec<_> =
                with_holes.iter().map(|h| r.uniform("head", &[h.index, first(h), 0, 0])).collect();
            let each = with_holes.iter().zip(&numbers).filter_map(|(h, number)| {
                let mut resources = h.head.cut_resources()?;
                resources.extend([
                    ("clip_from_world", clip_from_world.bound()),
                    ("positions", h.positions.bound()),
                    ("head", number.bound()),
                ]);
                Some((resources, Draw::Corners(h.head.cut_triangles * 3)))
            });
            let kernel = self.cut_kernel.get_or_init(|| cut_kernel(r.gpu));
            let depth = depth_attachment(&view, wgpu::LoadOp::Load);
            r.draw_each(kernel, Attachments { colors: Vec::new(), depth }, each);
        }
        maps
    }
}

fn cut_kernel(gpu: &Gpu) -> RasterKernel {
    RasterKernel::new(
        gpu,
        &Raster {
            label: "shadow of holes",
            program: cut_program(),
            vertex: "cut_vertex",
            fragment: Some("cut_fragment"),
            targets: &[],
            nearer: Some(wgpu::CompareFunction::Less),
            writes_depth: true,
        },
    )
}
