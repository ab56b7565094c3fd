//! The visibility buffer: which triangle of which head each pixel sees.
//!
//! ```text
//! positions, camera --visibility--> id (r32uint: head << 27 | triangle + 1, 0 = nothing), depth (reversed, infinite)
//! ```
//!
//! Theory: Burns and Hunt 2013, "The visibility buffer". The only rasterised pass of the frame that covers the head;
//! its fragment shader stores one integer, everything else is compute (ARCHITECTURE.md has the measurement). Where
//! compute is faster at that too, `raster` takes its place.
//! Parts with an authored material that has holes (alpha mask, alpha that blends where it is nearly 1, one side) are drawn
//! after the others by a pipeline that reads their alpha; heads without such parts do not have it.
//! Reversed infinite depth keeps 24 bits at any distance (Lapidous and Jiao 1999).

use std::sync::OnceLock;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{
    Attachments, Bind, Draw, Gpu, Image, ImageSpec, Raster, RasterKernel, Recorder, color_attachment,
    depth_attachment,
};
use crate::passes::geometry::raster::{ComputeRaster, Rasteriser, Sight};
use crate::scene::PosedHead;
use crate::scene::head::AUTHORED_SHIFT;

const SHADER: Module = module!("visibility", "visibility.wesl");
const CUT_SHADER: Module = module!("visibility_cut", "cut.wesl");

/// The shader of the pass, for devices with and without a primitive index.
pub(crate) fn program(numbered: bool) -> Program {
    Program::new(SHADER).flag("numbered", numbered)
}

/// Its entry points.
pub(crate) fn entries(numbered: bool) -> [&'static str; 2] {
    match numbered {
        true => ["numbered_vertex", "numbered_fragment"],
        false => ["cornered_vertex", "cornered_fragment"],
    }
}

/// The shader of what has holes.
pub(crate) fn cut_program() -> Program {
    Program::new(CUT_SHADER).constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
}

/// The pass.
pub(crate) enum Visibility {
    /// With the raster units of the device.
    Hardware(Hardware),
    /// Without them.
    Compute(ComputeRaster),
}

impl Visibility {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        match rasteriser {
            Rasteriser::Hardware => Self::Hardware(Hardware::new(gpu)),
            Rasteriser::Compute { wide } => Self::Compute(ComputeRaster::new(gpu, Sight::Camera { wide })),
        }
    }

    /// Makes what frames of a size need.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, [width, height]: [u32; 2], heads: usize, has_holes: bool) {
        if let Self::Compute(raster) = self {
            raster.prepare(gpu, u64::from(width) * u64::from(height), heads, has_holes);
        }
    }

    /// Draws the opaque triangles of all heads: ids and depth.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        view: &wgpu::Buffer,
        heads: &[PosedHead<'_>],
        size: [u32; 2],
    ) -> [Image; 2] {
        match self {
            Self::Hardware(hardware) => hardware.record(r, view, heads, size),
            Self::Compute(raster) => raster.record_camera(r, view, heads, size),
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
    is_numbered: bool,
}

impl Hardware {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self::with_numbers(gpu, gpu.device.features().contains(wgpu::Features::PRIMITIVE_INDEX))
    }

    /// Both variants give the same image.
    pub(crate) fn with_numbers(gpu: &Gpu, is_numbered: bool) -> Self {
        let [vertex, fragment] = entries(is_numbered);
        let kernel = RasterKernel::new(
            gpu,
            &Raster {
                label: "visibility",
                program: program(is_numbered),
                vertex,
                fragment: Some(fragment),
                targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
                nearer: Some(wgpu::CompareFunction::Greater),
                writes_depth: true,
            },
        );
        Self { kernel, cut_kernel: OnceLock::new(), is_numbered }
    }

    fn record(
        &self,
        r: &mut Recorder<'_>,
        view: &wgpu::Buffer,
        heads: &[PosedHead<'_>],
        size: [u32; 2],
    ) -> [Image; 2] {
        let ids = r.image("ids", ImageSpec::attachment(size, wgpu::TextureFormat::R32Uint));
        let depth = r.image("depth", ImageSpec::attachment(size, wgpu::TextureFormat::Depth32Float));
        let first = |h: &PosedHead<'_>| h.head.opaque_triangles - h.head.cut_triangles;
        let numbers: Vec<_> = heads.iter().map(|h| r.uniform("head", &[h.index, first(h), 0, 0])).collect();
        let each = heads.iter().zip(&numbers).map(|(h, number)| {
            let resources = vec![
                ("view", view.bound()),
                ("positions", h.positions.bound()),
                ("head", number.bound()),
                ("points", h.head.opaque_points.bound()),
            ];
            let corners = (h.head.opaque_triangles - h.head.cut_triangles) * 3;
            let draw = match self.is_numbered {
                true => Draw::Indexed(&h.head.opaque_points, corners),
                false => Draw::Corners(corners),
            };
            (resources, draw)
        });
        let attachments = Attachments {
            colors: vec![color_attachment(ids.view(), wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT))],
            depth: depth_attachment(depth.view(), wgpu::LoadOp::Clear(0.0)),
        };
        r.draw_each(&self.kernel, attachments, each);
        let cut = heads.iter().zip(&numbers).filter_map(|(h, number)| {
            let mut resources = h.head.cut_resources()?;
            resources.extend([
                ("view", view.bound()),
                ("positions", h.positions.bound()),
                ("head", number.bound()),
            ]);
            Some((resources, Draw::Corners(h.head.cut_triangles * 3)))
        });
        let cut: Vec<_> = cut.collect();
        if !cut.is_empty() {
            let kernel = self.cut_kernel.get_or_init(|| cut_kernel(r.gpu));
            let attachments = Attachments {
                colors: vec![color_attachment(ids.view(), wgpu::LoadOp::Load)],
                depth: depth_attachment(depth.view(), wgpu::LoadOp::Load),
            };
            r.draw_each(kernel, attachments, cut);
        }
        [ids, depth]
    }
}

fn cut_kernel(gpu: &Gpu) -> RasterKernel {
    RasterKernel::new(
        gpu,
        &Raster {
            label: "visibility of holes",
            program: cut_program(),
            vertex: "cut_vertex",
            fragment: Some("cut_fragment"),
            targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
            nearer: Some(wgpu::CompareFunction::Greater),
            writes_depth: true,
        },
    )
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Vec3};
    use rubor_rig::face_state::FaceState;

    use super::*;
    use crate::scene::posed_head::{Instance, posed};
    use crate::scene::view::View;
    use crate::testing::{gpu, read_image, recorded};
    use crate::tests::{WHITE_TABLE, dome};
    use crate::{Camera, HeadInstance, HeadOnGpu, Scene};

    #[test]
    fn triangles_are_the_same_whoever_numbers_them() {
        let Some(gpu) = gpu() else { return };
        if !gpu.device.features().contains(wgpu::Features::PRIMITIVE_INDEX) {
            crate::testing::skipped("this device has no primitive index");
            return;
        }
        let head = dome();
        let on_gpu = HeadOnGpu::new(gpu, &head, &WHITE_TABLE).expect("the dome uploads");
        let state = FaceState::neutral(&head);
        let placed =
            [0, 1].map(|_| HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY });
        let scene = Scene {
            heads: &placed,
            camera: Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 },
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        let instances = [0, 1].map(|_| Instance::new(gpu, &on_gpu));
        let points: Vec<[f32; 4]> = head.mesh.points.iter().map(|p| p.extend(1.0).to_array()).collect();
        for instance in &instances {
            gpu.queue.write_buffer(&instance.positions, 0, bytemuck::cast_slice(&points));
        }
        let heads = posed(&scene, &instances, false);
        let mut view: View = bytemuck::Zeroable::zeroed();
        view.clip_from_world = Mat4::from_scale(Vec3::new(5.0, 5.0, 0.5));
        view.size = [64, 64];
        view.jitter = [0.25, -0.25];
        let view = gpu.uniform("view", &view);
        let draw = |numbered| {
            let pass = Hardware::with_numbers(gpu, numbered);
            let [ids, _] = recorded(gpu, |r| pass.record(r, &view, &heads, [64, 64]));
            read_image::<u32>(gpu, &ids)
        };
        let (numbered, by_corners) = (draw(true), draw(false));
        assert_eq!(numbered, by_corners);
        let mut seen: Vec<u32> = numbered.into_iter().filter(|id| *id != 0).collect();
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() > 10, "{} triangles are seen", seen.len());
    }
}
