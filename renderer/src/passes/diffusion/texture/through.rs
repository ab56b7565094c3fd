//! `translucent-shadow-map`: light through thin parts from the blurred maps of the light where it enters.
//!
//! ```text
//! positions, lamps --visibility--> head and triangle nearest to each lamp (this is z, u and v)
//!                  --thickness--> exp(-t / decay) for three lamps per map --along_u, across_u--> the same, blurred
//!                  --pass_through--> sum over lamps and Gaussians of w exp(-t^2 / 2 v) times the blurred map at (u, v)
//! ```
//!
//! Theory: Stamminger and Dachsbacher 2003; with u and v, and thickness blurred with the light, d'Eon and Luebke 2007 and
//! Lee, "Realistic Skin Rendering". A plane behind a slab of thickness t that is evenly lit gives
//! `sum w_k exp(-t^2 / 2 v_k)` of its light, the integral of the Gaussians of variance v_k over the plane.
//!
//! Differs from the sources: the map holds a triangle instead of u and v, so both are exact at any resolution; thickness
//! is that of the ray to the lamp; skin that faces the lamp counts as thick by a smooth step, and so does what
//! scattering over the surface carries already; a place that several lamps see counts once, as the maps hold all light.
//!
//! Runs on maps of half the size. Does not: see more than the nearest surface of a lamp, or pass light of the sky where no
//! lamp with a shadow map stands behind.

use rubor_rig::skin::fit::RgbGaussian;

use super::{Blur, COMMON, Map, TERMS, TextureSpace, blur_resources};
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::diffusion::Before;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::geometry::visibility::Visibility;
use crate::passes::pixel_groups;
use crate::passes::shade;
use crate::scene::MAX_LIGHTS;
use crate::scene::view::View;

const SHADER: Module = module!("texture_through", "through.wesl");

/// Lamps of one thickness map.
const LAMPS_A_MAP: usize = 3;
/// Number of thickness maps that the shader reads.
const THICKNESS_MAPS: usize = 3;
/// Which Gaussian blurs the thickness, from the narrowest.
const THICKNESS_BLUR: usize = 2;
/// Halvings from the map of light to the maps of this pass.
const LEVEL: u32 = 1;

/// The shader of the passes.
pub(crate) fn program() -> Program {
    shade::importing(SHADER, None).with(&[COMMON])
}

/// Numbers of the passes for one head.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) map: Map,
    pub(crate) decay_mm: f32,
    pub(crate) first_lamp: u32,
    pub(crate) terms: u32,
    pub(crate) narrow: u32,
    pub(crate) terms_of: [[f32; 4]; TERMS],
}

/// The pipelines.
pub(crate) struct Through {
    visibility: Visibility,
    thickness: Kernel,
    pass_through: Kernel,
}

impl Through {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let program = program().flag("stored_shadows", rasteriser.stores_depth());
        Self {
            // Of the raster units: the other way keeps keys for one size of picture.
            visibility: Visibility::new(gpu, Rasteriser::Hardware),
            thickness: Kernel::new(gpu, "scatter thickness", &program, "thickness"),
            pass_through: Kernel::new(gpu, "scatter through", &program, "pass_through"),
        }
    }

    /// The triangle nearest to each lamp, a layer for each shadow map.
    fn lamp_ids(&self, r: &mut Recorder<'_>, frame: &Before<'_>) -> Image {
        // Half of a shadow map: it has no edges that would show.
        let side = (frame.quality.shadow_size / 2).max(1);
        let shadowed: Vec<_> =
            frame.light.lights.iter().filter(|l| l.shape[1] >= 0.0 && l.shape[3] > 0.0).collect();
        let layers = frame.light.shadows.texture().depth_or_array_layers();
        let spec = ImageSpec::attachment([side; 2], wgpu::TextureFormat::R32Uint).layers(layers);
        let all = r.image("lamp ids", spec.also(wgpu::TextureUsages::COPY_DST));
        for light in shadowed {
            let mut view: View = bytemuck::Zeroable::zeroed();
            // The same view with reversed depth, as the pass expects.
            let mut rows = light.clip_from_world.transpose();
            rows.z_axis = rows.w_axis - rows.z_axis;
            view.clip_from_world = rows.transpose();
            view.size = [side; 2];
            let view = r.uniform("view of a lamp", &view);
            let [ids, _] = self.visibility.record(r, &view, frame.heads, [side; 2]);
            let mut to = all.texture().as_image_copy();
            to.origin.z = light.shape[1] as u32;
            let size = wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 };
            r.encoder.copy_texture_to_texture(ids.texture().as_image_copy(), to, size);
        }
        all
    }
}

impl TextureSpace {
    /// Light that comes through each head.
    pub(super) fn record_through(&mut self, r: &mut Recorder<'_>, frame: &Before<'_>) {
        let through = self.through.take().unwrap_or_else(|| Through::new(r.gpu, self.rasteriser));
        let ids = through.lamp_ids(r, frame);
        let seen = frame.without_picture(r);
        let lighting = frame.lighting(&seen, None);
        let lamps = frame
            .light
            .lights
            .iter()
            .rposition(|l| l.shape[1] >= 0.0 && l.shape[3] > 0.0)
            .map_or(0, |i| i + 1);
        let thickness_maps = lamps.min(MAX_LIGHTS).div_ceil(LAMPS_A_MAP).max(1);
        for (h, head) in frame.heads.iter().enumerate() {
            let Some(layout) =
                self.layouts.iter().find(|l| std::sync::Arc::ptr_eq(&l.surface, &head.head.surface))
            else {
                continue;
            };
            let maps = &self.maps[h];
            let size = [maps.map.side >> LEVEL; 2];
            let shade_params = r.uniform("shade through", &shade::params(&lighting, head));
            let decay_mm = decay_mm(&self.gaussians);
            let terms = maps.plan.steps.len();
            let params = |first_lamp: usize| Params {
                map: maps.map,
                decay_mm,
                first_lamp: first_lamp as u32,
                terms: terms as u32,
                narrow: (self.gaussians.len() - terms) as u32,
                terms_of: std::array::from_fn(|i| {
                    self.gaussians.get(i).map_or([0.0, 0.0, 0.0, 1.0], |g| {
                        let [r, g_, b] = g.weights.map(|w| w as f32);
                        [r, g_, b, g.variance_mm2 as f32]
                    })
                }),
            };
            let mut thickness: Vec<Image> = Vec::new();
            let all: Vec<_> =
                (0..thickness_maps).map(|m| r.uniform("through", &params(m * LAMPS_A_MAP))).collect();
            let common = || {
                let mut resources = frame.shade.resources(&lighting, head, &shade_params);
                resources.extend([
                    ("places", layout.places.bound()),
                    ("texel_from_uv", layout.texel_from_uv.bound()),
                    ("lamp_ids", ids.bound()),
                    ("map_linear", self.linear.bound()),
                ]);
                resources
            };
            let deviation_mm = self.gaussians.get(THICKNESS_BLUR).map_or(0.0, |g| g.variance_mm2.sqrt());
            for numbers in &all {
                let [sharp, scratch, smooth] = ["thickness", "thickness scratch", "thickness"]
                    .map(|label| r.image(label, ImageSpec::light(size)));
                let mut resources = common();
                resources.extend([("through", numbers.bound()), ("thickness_out", sharp.bound())]);
                r.dispatch(&through.thickness, &resources, pixel_groups(size));
                let blur = r.uniform(
                    "blur",
                    &Blur {
                        deviation_mm: deviation_mm as f32,
                        most_texels: (layout.margin >> maps.map.level).max(1) as f32,
                        source_scale: 1.0 / (1u32 << LEVEL) as f32,
                        level: LEVEL,
                    },
                );
                for (kernel, images) in
                    [(&self.along_u, [&sharp, &scratch]), (&self.across_u, [&scratch, &smooth])]
                {
                    let resources = blur_resources(&self.linear, &maps.stretch, &blur, images);
                    r.dispatch(kernel, &resources, pixel_groups(size));
                }
                thickness.push(smooth);
            }
            let out = r.image("through", ImageSpec::light(size));
            let mut resources = common();
            resources.extend([("through", all[0].bound()), ("through_out", out.bound())]);
            for (i, name) in
                ["thickness_0", "thickness_1", "thickness_2"].into_iter().enumerate().take(THICKNESS_MAPS)
            {
                resources.push((name, thickness[i.min(thickness.len() - 1)].bound()));
            }
            resources.push(("map_0", maps.light.bound()));
            for (i, name) in super::MAP_NAMES.into_iter().enumerate() {
                resources.push((name, maps.blurred.get(i).unwrap_or(&maps.light).bound()));
            }
            r.dispatch(&through.pass_through, &resources, pixel_groups(size));
            self.maps[h].through = Some(out);
        }
        self.through = Some(through);
    }
}

/// Length over which the stored thickness decays: the deviation of the widest Gaussian.
fn decay_mm(gaussians: &[RgbGaussian]) -> f32 {
    gaussians.iter().map(|g| g.variance_mm2.sqrt()).fold(0.1, f64::max) as f32
}
