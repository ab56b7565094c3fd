//! The backdrop, and the lower ends of heads that fade into it.
//!
//! ```text
//! hdr, depth, ids --backdrop--> hdr; backdrop (only for a lens with an aperture)
//! ```
//!
//! Theory: [`BackdropMethod::Gradient`] is a grey wall that faces the camera, as paper behind a sitter does, in the light of the
//! room and of a lamp at a height `w` over it, aimed at a point behind the shoulders: irradiance `w^3 / (w^2 + r^2)^(3/2)` of
//! that below the lamp (inverse square and cosine). Lengths are in heights of the head at its depth, so all heads get the same
//! picture. [`BackdropMethod::Environment`] is a coarse level of the surroundings, as a lens with a wide aperture sees them.
//!
//! A head ends at a cut through neck, shoulders or chest. With `fade` its light goes over into the backdrop towards the lower end,
//! by height in the head's own space (smoothstep), and its coverage with it. Up to twice that height it does so towards the sides
//! of its box too, where shoulders are cut off.
//!
//! Does not: light the head or take its shadow; fade hairs, films and blended parts.
//!
//! Costs: one read and write of the picture; nothing with a plain backdrop of the usual light and no fade.

#[cfg(test)]
mod tests;

use glam::{Mat4, Vec3, Vec4};

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::pixel_groups;
use crate::scene::view::Seen;
use crate::scene::{PosedHead, Scene};
use crate::settings::{BackdropMethod, Look};

const SHADER: Module = module!("backdrop", "backdrop.wesl");

/// Heads that a frame can show, rounded up.
const HEADS: usize = 32;
const PLAIN: u32 = 0;
const GRADIENT: u32 = 1;
const ENVIRONMENT: u32 = 2;
/// Place of the pool of light below the subject and its width, in heights of the subject; radiance of the pool over that of
/// the wall. Chosen on the default head, ICT and Lee Perry-Smith: outlines of dark hair and of dark and light skin stand out, and corners
/// stay calm.
const POOL_BELOW: f32 = 0.3;
const POOL_WIDTH: f32 = 1.1;
const POOL_LIGHT: f32 = 5.0;
/// Width of the environment's level over that of the finest: about a ninth of the whole horizon, so no detail is left.
const ENVIRONMENT_LEVEL: f32 = 2.5;

/// The shader of the pass.
pub(crate) fn program(keeps: bool) -> Program {
    Program::new(SHADER)
        .constant("ENVIRONMENT", ENVIRONMENT)
        .constant("GRADIENT", GRADIENT)
        .flag("kept", keeps)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) color: [f32; 4],
    pub(crate) pool: [f32; 4],
    pub(crate) pool_light: f32,
    pub(crate) kind: u32,
    pub(crate) level: f32,
    pub(crate) intensity: f32,
    pub(crate) fade: [Fade; HEADS],
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Fade {
    pub(crate) up: [f32; 4],
    pub(crate) side: [f32; 4],
    pub(crate) half_width: f32,
    pub(crate) padding: [u32; 3],
}

/// Whether a look needs the pass.
pub(crate) fn is_needed(look: &Look) -> bool {
    look.backdrop != BackdropMethod::Plain || look.backdrop_light != 1.0 || look.fade > 0.0
}

impl Fade {
    /// Nothing fades.
    const OFF: Self = Self { up: [0.0, 0.0, 0.0, 1.0], side: [0.0; 4], half_width: 1.0, padding: [0; 3] };

    /// Of a head with a box, over a height in metres.
    fn new(world_from_head: &Mat4, (low, high): (Vec3, Vec3), height: f32) -> Self {
        if height <= 0.0 {
            return Self::OFF;
        }
        let rows = world_from_head.inverse().transpose();
        let up = (rows * Vec4::Y - Vec4::W * low.y) / height;
        let side = (rows * Vec4::X - Vec4::W * (0.5 * (low.x + high.x))) / height;
        Self {
            up: up.to_array(),
            side: side.to_array(),
            half_width: 0.5 * (high.x - low.x) / height,
            padding: [0; 3],
        }
    }
}

impl Params {
    fn new(look: &Look, scene: &Scene<'_>, heads: &[PosedHead<'_>]) -> Self {
        let optics = &scene.optics;
        let view_from_world = scene.camera.view_from_world();
        let subject = view_from_world.transform_point3(optics.subject);
        let height = optics.subject_height;
        let mut fade = [Fade::OFF; HEADS];
        for (fade, head) in fade.iter_mut().zip(heads) {
            *fade = Fade::new(&head.world_from_head, head.head.bounds, 1e-3 * look.fade);
        }
        Self {
            color: (look.backdrop_light * scene.background_linear).extend(0.0).to_array(),
            // A subject behind the camera has no picture; any depth will do.
            pool: [subject.x, subject.y - POOL_BELOW * height, (-subject.z).max(0.01), POOL_WIDTH * height],
            pool_light: POOL_LIGHT,
            kind: match look.backdrop {
                BackdropMethod::Plain => PLAIN,
                BackdropMethod::Gradient => GRADIENT,
                BackdropMethod::Environment => ENVIRONMENT,
            },
            level: ENVIRONMENT_LEVEL,
            intensity: look.backdrop_light * scene.environment_intensity,
            fade,
        }
    }
}

/// The pipeline of the pass.
pub(crate) struct Backdrop {
    keeps: bool,
    kernel: Kernel,
    trilinear_repeat: wgpu::Sampler,
    black: wgpu::TextureView,
}

impl Backdrop {
    /// `keeps`: whether the backdrop itself is wanted.
    pub(crate) fn new(gpu: &Gpu, keeps: bool) -> Self {
        let sampler = wgpu::SamplerDescriptor {
            label: Some("trilinear repeat"),
            address_mode_u: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        };
        Self {
            keeps,
            kernel: Kernel::new(gpu, "backdrop", &program(keeps), "place_backdrop"),
            trilinear_repeat: gpu.device.create_sampler(&sampler),
            black: Image::new(gpu, "black", ImageSpec::light([1, 1])).view().clone(),
        }
    }

    /// Whether it is the one that is wanted.
    pub(crate) fn fits(&self, keeps: bool) -> bool {
        self.keeps == keeps
    }

    /// The picture with its backdrop, and the backdrop itself where it is wanted.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        look: &Look,
        scene: &Scene<'_>,
        seen: &Seen,
        heads: &[PosedHead<'_>],
        hdr: &Image,
    ) -> (Image, Option<Image>) {
        let size = hdr.size();
        let params = r.uniform("backdrop", &Params::new(look, scene, heads));
        let spec = ImageSpec::light(size);
        let result = r.image("radiance", spec.also(wgpu::TextureUsages::RENDER_ATTACHMENT));
        let kept = self.keeps.then(|| r.image("backdrop", spec));
        let resources = [
            ("view", seen.view.bound()),
            ("params", params.bound()),
            ("environment", scene.environment.map_or(&self.black, |e| &e.filtered).bound()),
            ("trilinear_repeat", self.trilinear_repeat.bound()),
            ("hdr", hdr.bound()),
            ("depth", seen.depth.bound()),
            ("visible", seen.ids.bound()),
            ("result", result.bound()),
            ("kept", kept.as_ref().unwrap_or(&result).bound()),
        ];
        r.dispatch(&self.kernel, &resources, pixel_groups(size));
        (result, kept)
    }
}

/// What is behind everything where the pass did not run.
pub(crate) fn plain(scene: &Scene<'_>) -> Vec3 {
    scene.background_linear
}
