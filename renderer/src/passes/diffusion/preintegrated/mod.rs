//! `pre-integrated:N`: light of skin looked up instead of gathered (Penner and Borshukov 2011, "Pre-integrated skin
//! shading").
//!
//! ```text
//! profile --CPU, once--> light over (N.L, curvature), over (shadow, penumbra), harmonic bands over curvature
//! slope and wrinkle maps --blur_across, blur_down, once a head--> slopes as red, green and blue light see them
//! positions --curvature_of_points, smooth_curvature--> curvature of each point, before every view
//!        all of it --shade--> irradiance, already scattered
//! ```
//!
//! Theory: `rubor_rig::skin::preintegrated` has the integrals. What varies over skin is taken apart, and each part is looked up
//! where it is lit: Lambert's law on a round surface by curvature, relief by normals that are blurred for each channel,
//! shadows by the distance to their edge, the sky by its spherical harmonics. Nothing reads a neighbour, so a pixel costs
//! the same in any picture, at any scale, and in front of anything.
//!
//! Differs from the source:
//! - Light is integrated over a sphere and not over a ring: see `rubor_rig::skin::preintegrated::Shape`.
//! - Curvature is a tensor of the deformed mesh, in place of one number from derivatives ([`CurvatureMethod::Screen`] is the
//!   paper's): a terminator gets the curvature across it, everything else the root mean square of both.
//! - Both slopes and their mean squares are blurred, by the profile and in millimetres, so that the normals of channels are as short as the
//!   mean of unit normals is. Wrinkles are blurred like relief and joined by their weights; with
//!   `difference` too, where blurred slopes add although sharp normals do not.
//! - A shadow has two filters on the skin, one for light that goes near and one for light that goes far: the inverse of a wide filter
//!   is too noisy for the narrow edge of blue. Both are disks on the tangent plane, so slant needs no second
//!   dimension; the width of the penumbra, which the paper makes smaller by choice, is that of the lamp.
//! - Beyond the terminator the ray to the lamp starts where it leaves the sphere of the curvature: a shadow map would
//!   otherwise take away the light that the table puts there.
//!
//! Fails where the surface is not a sphere as far as light goes (about 5 mm): nostrils, lips and rims of ears, where curvature
//! changes within a millimetre, and where light crosses a gap or a thin part (that is `transmit`); under patterns of shadow narrower
//! than the far filter, which look like one soft edge. `docs/scatter.md` has numbers.
//!
//! Cost: three look-ups and two filters a lamp in `shade`, two maps more for each map of relief; `docs/scatter.md`.
//!
//! N: 3 blurs maps for each channel; 1 blurs one, by red, and mixes it with the sharp one for green and blue, which halves the
//! maps' memory (the paper's approximation).

mod curvature;
#[cfg(test)]
mod reference;
mod relief;
mod tables;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use rubor_rig::skin::preintegrated::{reach_mm, wave_shares};
use rubor_rig::skin::profile::Profile;

use self::curvature::{Curvature, Curvatures};
use self::relief::{BlurredMaps, Relief};
use self::tables::Tables;
use super::{Before, Diffusion, Needs};
use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Kernel, Recorder};
use crate::error::RenderError;
use crate::passes::shade::{SkinLight, skin_light_program};
use crate::scene::PosedHead;
use crate::settings::CurvatureMethod;

const SKIN_LIGHT: Module = module!("skin_light", "skin_light.wesl");
const TENSOR: Module = module!("skin_tensor", "tensor.wesl");

/// Meshes of the nets of furrows in `micro.wesl`, mm: the share of the coarser one is used for both, as it is seen from farther.
const FURROWS_MM: f64 = 0.65;
/// A length of relief at which a mix of one blurred map with the sharp one is to be right, mm: that of pores and lines.
const RELIEF_MM: f64 = 1.5;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) reach_mm: [f32; 2],
    pub(crate) widest_mm: f32,
    pub(crate) middle_per_mm: f32,
    pub(crate) curvature_scale: f32,
    pub(crate) first_blurred: u32,
    pub(crate) relief_layer: u32,
    pub(crate) padding: u32,
    pub(crate) sharp: [f32; 4],
    pub(crate) micro: [f32; 4],
    pub(crate) blurred: [f32; 4],
}

/// The shader of `shade` with this rule.
pub(crate) fn program(by_channel: bool, on_screen: bool) -> Program {
    tables::constants(skin_light_program(&[SKIN_LIGHT, TENSOR]))
        .flag("by_channel", by_channel)
        .flag("screen_curvature", on_screen)
        .constant("BLURRED_LAYERS", relief::layers_of(by_channel))
}

/// The method, ready for one profile.
pub(crate) struct PreIntegrated {
    by_channel: bool,
    profile: Profile,
    reach_mm: f64,
    tables: Tables,
    params: Params,
    relief: Relief,
    curvature: Option<Curvature>,
    /// The kernel of `shade` of this frame.
    kernel: Option<Arc<Kernel>>,
    heads: Vec<Prepared>,
}

/// What one head of the scene needs.
struct Prepared {
    maps: Option<BlurredMaps>,
    curvatures: Option<Curvatures>,
    params: wgpu::Buffer,
}

impl PreIntegrated {
    /// Tables for a profile; `maps` blurred maps of slopes, 1 or 3.
    ///
    /// # Errors
    /// The profile has no finite width.
    pub(crate) fn new(gpu: &Gpu, profile: &Profile, maps: u32) -> Result<Self, RenderError> {
        let by_channel = maps == 3;
        let tables = Tables::new(gpu, profile)?;
        let rgb = |v: [f64; 3]| [v[0] as f32, v[1] as f32, v[2] as f32, 0.0];
        let waves = wave_shares(profile, RELIEF_MM);
        // How much of the map that is blurred by red makes the wave of another channel.
        let blurred = waves.map(|w| ((1.0 - w) / (1.0 - waves[0]).max(1e-6)).clamp(0.0, 1.0));
        let params = Params {
            reach_mm: tables.reach_mm.map(|r| r as f32),
            widest_mm: tables.widest_mm as f32,
            middle_per_mm: tables.axis.middle_per_mm as f32,
            curvature_scale: tables.axis.scale() as f32,
            first_blurred: 0,
            relief_layer: 0,
            padding: 0,
            sharp: [0.0; 4],
            micro: rgb(wave_shares(profile, FURROWS_MM)),
            blurred: rgb(blurred),
        };
        Ok(Self {
            by_channel,
            profile: profile.clone(),
            reach_mm: reach_mm(profile)?,
            tables,
            params,
            relief: Relief::new(gpu, by_channel),
            curvature: None,
            kernel: None,
            heads: Vec::new(),
        })
    }
}

impl Diffusion for PreIntegrated {
    fn needs(&self) -> Needs {
        Needs { before_view: true, ..Needs::default() }
    }

    fn before_view(&mut self, r: &mut Recorder<'_>, frame: &Before<'_>) {
        let method = frame.quality.curvature;
        let on_screen = method == CurvatureMethod::Screen;
        let name = match (self.by_channel, on_screen) {
            (true, false) => "pre-integrated",
            (true, true) => "pre-integrated, screen",
            (false, false) => "pre-integrated:1",
            (false, true) => "pre-integrated:1, screen",
        };
        let program = || program(self.by_channel, on_screen);
        self.kernel = Some(frame.shade.skin_light_kernel(r.gpu, name, program));
        self.heads.truncate(frame.heads.len());
        if !on_screen {
            self.curvature.get_or_insert_with(|| Curvature::new(r.gpu));
        }
        for (i, head) in frame.heads.iter().enumerate() {
            let fits = |p: &Prepared| p.maps.as_ref().map(BlurredMaps::source) == relief::source_of(head);
            if !self.heads.get(i).is_some_and(fits) {
                self.heads.truncate(i);
                let maps = self.relief.blurred(r, head, &self.profile, self.reach_mm);
                let params = Params {
                    first_blurred: maps.as_ref().map_or(0, |m| m.first_blurred),
                    relief_layer: maps.as_ref().map_or(0, |m| m.relief_layer),
                    sharp: maps.as_ref().map_or([1.0; 4], |m| m.sharp),
                    ..self.params
                };
                let params = r.gpu.uniform("pre-integrated", &params);
                self.heads.push(Prepared { maps, curvatures: None, params });
            }
            let prepared = &mut self.heads[i];
            prepared.curvatures = match &self.curvature {
                Some(passes) if !on_screen => {
                    let kept = prepared.curvatures.take().filter(|c| c.fit(head));
                    Some(kept.unwrap_or_else(|| passes.prepare(r, head)))
                }
                _ => None,
            };
        }
        if let (Some(passes), false) = (&self.curvature, on_screen) {
            let each: Vec<_> = (frame.heads.iter().zip(&self.heads))
                .filter_map(|(head, prepared)| Some((head, prepared.curvatures.as_ref()?)))
                .collect();
            passes.record(r, &each);
        }
    }

    fn skin_light(&self) -> Option<&dyn SkinLight> {
        self.kernel.as_ref().map(|_| self as &dyn SkinLight)
    }

    fn memory_bytes(&self) -> u64 {
        let of_head = |p: &Prepared| {
            p.maps.as_ref().map_or(0, BlurredMaps::bytes)
                + p.curvatures.as_ref().map_or(0, Curvatures::bytes)
                + p.params.size()
        };
        self.tables.bytes() + self.heads.iter().map(of_head).sum::<u64>()
    }
}

impl SkinLight for PreIntegrated {
    fn kernel(&self) -> &Kernel {
        // The frame asks after `before_view`, which makes it.
        self.kernel.as_ref().expect("before_view comes first")
    }

    fn resources<'a>(&'a self, head: &PosedHead<'a>) -> Vec<Resource<'a>> {
        let mut resources = vec![("skin_tables", self.tables.texture.bound())];
        let Some(prepared) = self.heads.get(head.index as usize) else { return resources };
        resources.push(("skin_light", prepared.params.bound()));
        resources.extend(prepared.curvatures.as_ref().map(|c| ("curvatures", c.smooth().bound())));
        resources.extend(prepared.maps.as_ref().map(|m| ("wrinkle_maps", m.texture.bound())));
        resources
    }
}
