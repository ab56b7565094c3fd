//! `texture-space:N`: Gaussians over a map of the light on all skin of a head.
//!
//! ```text
//! texture coordinates --rubor_rig::atlas, once per head--> texel -> triangle + barycentrics, also across seams
//! before_view:   places, positions, lamps --light--> light that enters, stretch (texels per mm)
//!                for each Gaussian --along_u--> scratch --across_u--> a blurred map, half as large where it is wide
//! after_shading: ids, maps --gather--> scattered (diffuse radiance of a white surface)
//! ```
//!
//! Theory: Borshukov and Lewis 2003 blur light in the texture; d'Eon and Luebke 2007 take a sum of Gaussians, each made
//! from the one before, with kernels as wide as the deformed surface asks for (stretch map); Lee, "Realistic Skin
//! Rendering", implements it. Six Gaussians are the profile's own, or fitted to it. A share of the colour may come
//! before scattering (`pre_scatter`; d'Eon and Luebke 2007, section 14.4). What the specular lobe takes does not enter (`entering` in
//! `shade`).
//!
//! Savings (Jimenez 2012 ch. 3): skin that faces away by more than 105 degrees is left out (culled), the map is halved
//! while a texel stays within a quarter of a pixel of the nearest part of the head (sized, eqs. 3.1 and 3.2 in powers of two), skin
//! outside of the picture is left out (clipped, with a border as wide as light scatters).
//!
//! Differs from the sources: the layout is not the author's (see `rubor_rig::atlas`: even texels, margins that continue
//! across seams, mirrored halves and several tiles); the second pass of a Gaussian runs at right angles to the first on
//! the surface, not in the texture, so sheared coordinates blur round; wide Gaussians run on smaller maps, and pixels
//! read each map instead of a sum; Gaussians narrower than a texel are the pixel's own light; stretch comes from
//! positions of texels, not of pixels.
//!
//! Inputs and outputs: light, scratch and maps rgba16float, linear radiance, a = 1 where it is known; stretch
//! rgba16float. For each head 8 bytes per texel of the layout as long as the method is on, and images of the frame.
//!
//! Does not: carry light between surfaces that are near in space and far in the texture (transmittance does that); keep
//! apart what is near in the texture and far in space, such as lips that the texture joins; scatter on skin without texture
//! coordinates.

pub(crate) mod plan;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;
pub(crate) mod through;

use std::sync::Arc;

use rubor_rig::atlas::{Atlas, AtlasError, MOST_OVERLAP, Skin};
use rubor_rig::head::{MM_PER_METRE, Material};
use rubor_rig::skin::fit::RgbGaussian;
use rubor_rig::skin::profile::Profile;

use super::screen::gauss;
use super::{Before, Diffusion, Needs};
use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::error::RenderError;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::pixel_groups;
use crate::passes::shade::{self, Lit};
use crate::scene::head::Surface;
use crate::scene::view::{Seen, nearest_pixel_metres};
use crate::scene::{HeadInstance, PosedHead};
use crate::settings::{MapSaving, ScatterMethod, Stage, TransmitMethod};
use plan::{Plan, plan};
use through::Through;

const COMMON: Module = module!("texture_common", "common.wesl");
const LIGHT: Module = module!("texture_light", "light.wesl");
const BLUR: Module = module!("texture_blur", "blur.wesl");
const GATHER: Module = module!("texture_gather", "gather.wesl");

/// Number of Gaussians (d'Eon and Luebke 2007).
const TERMS: usize = 6;
/// Names of the blurred maps in shaders.
const MAP_NAMES: [&str; TERMS] = ["map_1", "map_2", "map_3", "map_4", "map_5", "map_6"];
/// Deviations of the widest Gaussian that a map reaches over its seams and over the border of the picture.
const REACH: f64 = 3.0;
/// Halvings of a map for distant heads.
const MOST_LEVELS: u32 = 3;
/// Picture with its border relative to the picture, for shadow maps.
const PICTURE_MARGIN: f32 = 1.25;

/// The shader that lights maps.
pub(crate) fn light_program() -> Program {
    shade::importing(LIGHT, Some("over_surface")).with(&[COMMON])
}

/// The shader that blurs maps.
pub(crate) fn blur_program() -> Program {
    let (weights, _) = plan::taps();
    let names = ["TAP_0", "TAP_1", "TAP_2", "TAP_3", "TAP_4"];
    let program = Program::new(BLUR).constant("TAP_STEP", plan::TAP_STEP as f32);
    names.iter().zip(weights).fold(program, |p, (name, weight)| p.constant(name, weight as f32))
}

/// The shader that reads maps for pixels.
pub(crate) fn gather_program() -> Program {
    Program::new(GATHER).with(&[COMMON])
}

/// A map as common.wesl reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Map {
    pub(crate) layout_side: u32,
    pub(crate) side: u32,
    pub(crate) level: u32,
    pub(crate) savings: u32,
    pub(crate) mm_per_texel: f32,
    pub(crate) reach_mm: f32,
    pub(crate) pre_scatter: f32,
    pub(crate) is_translucent: u32,
}

/// Numbers of a line of a Gaussian.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Blur {
    pub(crate) deviation_mm: f32,
    pub(crate) most_texels: f32,
    pub(crate) source_scale: f32,
    pub(crate) level: u32,
}

/// Numbers of the pixels of a head.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Gather {
    pub(crate) map: Map,
    pub(crate) head: u32,
    pub(crate) terms: u32,
    pub(crate) padding: [u32; 2],
    pub(crate) weights: [[f32; 4]; TERMS + 2],
}

/// The layout of a head on the device.
struct Layout {
    surface: Arc<Surface>,
    places: wgpu::Buffer,
    texel_from_uv: wgpu::Buffer,
    mm_per_texel: f32,
    margin: u32,
}

/// The maps of a head in a frame.
struct Maps {
    map: Map,
    plan: Plan,
    light: Image,
    stretch: Image,
    blurred: Vec<Image>,
    /// Light that came through, if translucent shadow maps are on.
    through: Option<Image>,
}

/// The method, ready for one profile.
pub(crate) struct TextureSpace {
    rasteriser: Rasteriser,
    name: String,
    side: u32,
    gaussians: Vec<RgbGaussian>,
    reach_mm: f64,
    light: Kernel,
    along_u: Kernel,
    across_u: Kernel,
    gather: Kernel,
    linear: wgpu::Sampler,
    /// Made by the first frame with translucent shadow maps.
    through: Option<Through>,
    layouts: Vec<Layout>,
    /// Of the frame, in the order of its heads.
    maps: Vec<Maps>,
}

impl TextureSpace {
    /// # Errors
    /// The profile cannot be fitted.
    pub(crate) fn new(
        gpu: &Gpu,
        rasteriser: Rasteriser,
        profile: &Profile,
        side: u32,
    ) -> Result<Self, RenderError> {
        let mut gaussians = gauss::gaussians(profile, TERMS)?;
        // All light that enters leaves: the albedo is the share that is absorbed.
        for c in 0..3 {
            let total: f64 = gaussians.iter().map(|g| g.weights[c]).sum();
            for g in &mut gaussians {
                g.weights[c] /= if total > 0.0 { total } else { 1.0 };
            }
        }
        let widest_mm2 = gaussians.iter().map(|g| g.variance_mm2).fold(0.0, f64::max);
        Ok(Self {
            name: ScatterMethod::TextureSpace(side).to_string(),
            side,
            gaussians,
            reach_mm: REACH * widest_mm2.sqrt(),
            rasteriser,
            light: Kernel::new(
                gpu,
                "scatter light",
                &light_program().flag("stored_shadows", rasteriser.stores_depth()),
                "light",
            ),
            along_u: Kernel::new(gpu, "scatter along u", &blur_program(), "along_u"),
            across_u: Kernel::new(gpu, "scatter across u", &blur_program(), "across_u"),
            gather: Kernel::new(gpu, "scatter gather", &gather_program(), "gather"),
            linear: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("linear clamp"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            through: None,
            layouts: Vec::new(),
            maps: Vec::new(),
        })
    }

    fn layout(&self, head: &PosedHead<'_>) -> Option<&Layout> {
        self.layouts.iter().find(|l| Arc::ptr_eq(&l.surface, &head.head.surface))
    }

    /// The map of a head in a frame.
    fn map(&self, frame: &Before<'_>, head: &PosedHead<'_>, layout: &Layout) -> Map {
        let has = |saving| frame.quality.map_savings.contains(&saving);
        let bit = |saving, bit: u32| if has(saving) { bit } else { 0 };
        let is_translucent = frame.quality.transmit == TransmitMethod::TranslucentShadowMap;
        // Light comes from places that face away.
        let culled = if is_translucent { 0 } else { bit(MapSaving::Culled, 1) };
        let pixel_mm = MM_PER_METRE
            * nearest_pixel_metres(frame.scene, frame.size, &frame.scene.heads[head.index as usize]);
        let level = if has(MapSaving::Sized) { sized_level(layout.mm_per_texel, pixel_mm) } else { 0 };
        Map {
            layout_side: self.side,
            side: self.side >> level,
            level,
            savings: culled | bit(MapSaving::Clipped, 2),
            mm_per_texel: layout.mm_per_texel * (1 << level) as f32,
            reach_mm: self.reach_mm as f32,
            pre_scatter: frame.quality.pre_scatter,
            is_translucent: u32::from(is_translucent),
        }
    }

    fn record_light(&mut self, r: &mut Recorder<'_>, frame: &Before<'_>) {
        let seen = frame.without_picture(r);
        let lighting = frame.lighting(&seen, frame.transmittance);
        let mut maps = Vec::new();
        let mut numbers = Vec::new();
        for head in frame.heads {
            let Some(layout) = self.layout(head) else { continue };
            let map = self.map(frame, head, layout);
            let [light, stretch] =
                ["light map", "stretch map"].map(|label| r.image(label, ImageSpec::light([map.side; 2])));
            numbers.push((r.uniform("map", &map), r.uniform("shade maps", &shade::params(&lighting, head))));
            let plan = plan(&self.gaussians, f64::from(map.mm_per_texel));
            maps.push(Maps { map, plan, light, stretch, blurred: Vec::new(), through: None });
        }
        let each =
            frame.heads.iter().zip(maps.iter().zip(&numbers)).filter_map(|(head, (maps, (map, params)))| {
                let layout = self.layout(head)?;
                let mut resources = frame.shade.resources(&lighting, head, params);
                resources.extend([
                    ("map", map.bound()),
                    ("places", layout.places.bound()),
                    ("texel_from_uv", layout.texel_from_uv.bound()),
                    ("light_out", maps.light.bound()),
                    ("stretch_out", maps.stretch.bound()),
                ]);
                Some((resources, pixel_groups([maps.map.side; 2])))
            });
        r.dispatch_each(&self.light, each.collect::<Vec<_>>());
        self.maps = maps;
    }

    /// Every Gaussian of every head; those of several heads run side by side.
    fn record_blurs(&mut self, r: &mut Recorder<'_>, margins: &[u32]) {
        let most = self.maps.iter().map(|m| m.plan.steps.len()).max().unwrap_or(0);
        for i in 0..most {
            let mut passes = Vec::new();
            for (h, maps) in self.maps.iter().enumerate().filter(|(_, m)| i < m.plan.steps.len()) {
                let step = &maps.plan.steps[i];
                let (source, from) = match i.checked_sub(1) {
                    Some(before) => (&maps.blurred[before], maps.plan.steps[before].level),
                    None => (&maps.light, 0),
                };
                let spec = ImageSpec::light([maps.map.side >> step.level; 2]);
                let [scratch, blurred] = ["map scratch", "blurred map"].map(|label| r.image(label, spec));
                let blur = |source: usize| Blur {
                    deviation_mm: step.deviation_mm as f32,
                    most_texels: (margins[h] >> maps.map.level).max(1) as f32,
                    source_scale: 1.0 / (1u32 << source) as f32,
                    level: step.level as u32,
                };
                let [along, across] = [from, step.level].map(|l| r.uniform("blur", &blur(l)));
                passes.push((h, source.clone(), scratch, blurred, along, across));
            }
            let each: Vec<_> = (passes.iter())
                .map(|(h, source, scratch, _, along, _)| {
                    (
                        blur_resources(&self.linear, &self.maps[*h].stretch, along, [source, scratch]),
                        pixel_groups(scratch.size()),
                    )
                })
                .collect();
            r.dispatch_each(&self.along_u, each);
            let each: Vec<_> = (passes.iter())
                .map(|(h, _, scratch, blurred, _, across)| {
                    (
                        blur_resources(&self.linear, &self.maps[*h].stretch, across, [scratch, blurred]),
                        pixel_groups(scratch.size()),
                    )
                })
                .collect();
            r.dispatch_each(&self.across_u, each);
            for (h, _, _, blurred, ..) in passes {
                self.maps[h].blurred.push(blurred);
            }
        }
    }
}

fn blur_resources<'a>(
    linear: &'a wgpu::Sampler,
    stretch: &'a Image,
    params: &'a wgpu::Buffer,
    [source, blurred]: [&'a Image; 2],
) -> Vec<Resource<'a>> {
    vec![
        ("params", params.bound()),
        ("source", source.bound()),
        ("linear", linear.bound()),
        ("stretch", stretch.bound()),
        ("blurred", blurred.bound()),
    ]
}

impl Layout {
    fn new(gpu: &Gpu, surface: &Arc<Surface>, side: u32, reach_mm: f64) -> Result<Self, String> {
        // Triangles of skin, and their numbers in the head's list.
        let skin = Material::Skin.number();
        let numbers: Vec<u32> = (0..surface.triangles.len() as u32)
            .filter(|t| surface.triangles[*t as usize][3] == skin)
            .collect();
        let triangles: Vec<[u32; 3]> = (numbers.iter())
            .map(|t| {
                let [a, b, c, _] = surface.triangles[*t as usize];
                [a, b, c]
            })
            .collect();
        let skin = Skin { points: &surface.points, vertices: &surface.vertices, triangles: &triangles };
        let atlas = match Atlas::new(&skin, side, reach_mm) {
            // Its maps stay empty.
            Err(AtlasError::NoSkin) => Atlas::empty(side),
            other => other.map_err(|e| e.to_string())?,
        };
        if atlas.overlap > MOST_OVERLAP {
            return Err(format!(
                "{:.1} % of its skin lies under other skin of the same island of the texture",
                100.0 * atlas.overlap
            ));
        }
        let half = |b: f32| (b * 65535.0).round() as u32;
        let places: Vec<[u32; 2]> = (atlas.places.iter())
            .map(|place| match place {
                Some(p) => {
                    [numbers[p.triangle as usize] + 1, half(p.barycentric[1]) | half(p.barycentric[2]) << 16]
                }
                None => [0, 0],
            })
            .collect();
        let mut texel_from_uv = vec![[0.0f32; 4]; surface.triangles.len()];
        for (number, scale) in numbers.iter().zip(&atlas.texel_from_uv) {
            texel_from_uv[*number as usize] = *scale;
        }
        Ok(Self {
            surface: surface.clone(),
            places: gpu.storage("places of texels", &places),
            texel_from_uv: gpu.storage("texels of texture coordinates", &texel_from_uv),
            mm_per_texel: atlas.mm_per_texel,
            margin: atlas.margin,
        })
    }
}

/// Halvings of a map while its texels stay as narrow as a quarter of a pixel (Jimenez 2012 eqs. 3.1 and 3.2, in powers of two).
fn sized_level(mm_per_texel: f32, pixel_mm: f32) -> u32 {
    let ratio = 0.25 * pixel_mm / mm_per_texel;
    if ratio >= 1.0 { (ratio.log2().floor() as u32).min(MOST_LEVELS) } else { 0 }
}

impl Diffusion for TextureSpace {
    fn needs(&self) -> Needs {
        Needs { backs: true, margin: PICTURE_MARGIN, transmittance: true, before_view: true }
    }

    fn take_heads(&mut self, gpu: &Gpu, heads: &[HeadInstance<'_>]) -> Result<(), RenderError> {
        self.layouts.retain(|l| heads.iter().any(|h| Arc::ptr_eq(&h.head.surface, &l.surface)));
        for (i, placed) in heads.iter().enumerate() {
            let surface = &placed.head.surface;
            if self.layouts.iter().any(|l| Arc::ptr_eq(&l.surface, surface)) {
                continue;
            }
            let layout = Layout::new(gpu, surface, self.side, self.reach_mm);
            self.layouts.push(layout.map_err(|reason| RenderError::Unsuited {
                method: self.name.clone(),
                head: i + 1,
                reason,
                others: other_methods(),
            })?);
        }
        Ok(())
    }

    fn memory_bytes(&self) -> u64 {
        self.layouts.iter().map(|l| l.places.size() + l.texel_from_uv.size()).sum()
    }

    fn before_view(&mut self, r: &mut Recorder<'_>, frame: &Before<'_>) {
        // Images of the frame before may be used again.
        self.maps.clear();
        self.record_light(r, frame);
        let margins: Vec<u32> = frame.heads.iter().filter_map(|h| Some(self.layout(h)?.margin)).collect();
        self.record_blurs(r, &margins);
        if frame.quality.transmit == TransmitMethod::TranslucentShadowMap {
            self.record_through(r, frame);
        } else {
            self.through = None;
        }
    }

    fn after_shading(
        &mut self,
        r: &mut Recorder<'_>,
        heads: &[PosedHead<'_>],
        seen: &Seen,
        lit: &Lit,
    ) -> Image {
        if heads.is_empty() || self.maps.len() != heads.len() {
            return lit.irradiance.clone();
        }
        let size = lit.irradiance.size();
        let scattered = r.image("scattered", ImageSpec::light(size));
        let params: Vec<_> = (heads.iter().zip(&self.maps))
            .map(|(head, maps)| r.uniform("gather", &maps.numbers(head.index)))
            .collect();
        let each: Vec<_> = (heads.iter().zip(&self.maps).zip(&params))
            .filter_map(|((head, maps), params)| {
                let layout = self.layout(head)?;
                let mut resources = vec![
                    ("view", seen.view.bound()),
                    ("params", params.bound()),
                    ("visible", seen.ids.bound()),
                    ("irradiance", lit.irradiance.bound()),
                    ("albedo", lit.albedo.bound()),
                    ("linear", self.linear.bound()),
                    ("positions", head.positions.bound()),
                    ("vertices", head.head.vertices.bound()),
                    ("triangles", head.head.triangles.bound()),
                    ("texel_from_uv", layout.texel_from_uv.bound()),
                    ("map_0", maps.light.bound()),
                    ("through_map", maps.through.as_ref().unwrap_or(&maps.light).bound()),
                    ("scattered", scattered.bound()),
                ];
                for (i, name) in MAP_NAMES.into_iter().enumerate() {
                    resources.push((name, maps.blurred.get(i).unwrap_or(&maps.light).bound()));
                }
                Some((resources, seen.groups(head.index)))
            })
            .collect();
        r.dispatch_each(&self.gather, each);
        scattered
    }
}

impl Maps {
    fn numbers(&self, head: u32) -> Gather {
        let mut weights = [[0.0; 4]; TERMS + 2];
        let all =
            [self.plan.own, self.plan.unblurred].into_iter().chain(self.plan.steps.iter().map(|s| s.weights));
        for (slot, w) in weights.iter_mut().zip(all) {
            *slot = [w[0] as f32, w[1] as f32, w[2] as f32, 0.0];
        }
        Gather { map: self.map, head, terms: self.plan.steps.len() as u32, padding: [0; 2], weights }
    }
}

/// Names of the methods that need no texture coordinates.
fn other_methods() -> String {
    let all = ScatterMethod::GROUP.methods.iter();
    let others = all.filter(|m| m.name != ScatterMethod::TextureSpace(0).name() && m.stage != Stage::Nowhere);
    others.map(|m| m.example()).collect::<Vec<_>>().join(", ")
}
