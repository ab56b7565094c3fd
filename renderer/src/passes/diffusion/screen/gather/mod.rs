//! One pass that gathers neighbours in two dimensions: `screen-jitter`, `burley-disk:N`, `reference-screen`.

use super::{COMMON, FOLLOW_PER_MM};
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::diffusion::Diffusion;
use crate::passes::pixel_groups;
use crate::passes::shade::Lit;
use crate::scene::PosedHead;
use crate::scene::view::Seen;

const SHARED: Module = module!("gather", "gather.wesl");

/// A tap as gather.wesl reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Tap {
    pub(crate) place: [f32; 4],
    pub(crate) weight: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) tap_count: u32,
    pub(crate) follow_per_mm: f32,
    pub(crate) half_width_mm: f32,
    pub(crate) visible_mm: f32,
    pub(crate) method: [f32; 4],
}

/// A method of one such pass.
pub(crate) struct Gather {
    kernel: Kernel,
    params: wgpu::Buffer,
    taps: wgpu::Buffer,
}

/// The shader of a method, which has the entry point.
pub(crate) fn program(method: Module) -> Program {
    Program::new(method).with(&[SHARED, COMMON])
}

impl Gather {
    /// A pass of a shader with taps, the radius of the kernel, the length below half a pixel at which the kernel can be
    /// skipped, and numbers of the method.
    pub(crate) fn new(
        gpu: &Gpu,
        program: &Program,
        entry: &str,
        taps: &[Tap],
        half_width_mm: f32,
        numbers: [f32; 4],
    ) -> Self {
        let params = Params {
            tap_count: taps.len() as u32,
            follow_per_mm: FOLLOW_PER_MM,
            half_width_mm,
            visible_mm: half_width_mm,
            method: numbers,
        };
        Self {
            kernel: Kernel::new(gpu, "scatter", program, entry),
            params: gpu.uniform("scatter", &params),
            taps: gpu.storage("scatter taps", taps),
        }
    }
}

impl Diffusion for Gather {
    fn after_shading(&mut self, r: &mut Recorder<'_>, _: &[PosedHead<'_>], seen: &Seen, lit: &Lit) -> Image {
        let size = lit.irradiance.size();
        let scattered = r.image("scattered", ImageSpec::light(size));
        let resources = [
            ("view", seen.view.bound()),
            ("params", self.params.bound()),
            ("taps", self.taps.bound()),
            ("irradiance", lit.irradiance.bound()),
            ("albedo", lit.albedo.bound()),
            ("depth", seen.depth.bound()),
            ("scattered", scattered.bound()),
        ];
        r.dispatch(&self.kernel, &resources, pixel_groups(size));
        scattered
    }
}
