//! Light on the visible surfaces: one compute dispatch per head over the visibility buffer.
//!
//! ```text
//! id, positions, frames, maps, blood, wrinkles, shadows, environment, lights
//!     --shade--> irradiance (diffuse radiance of a white surface; a = scattering strength)
//!              > albedo     (linear Rec. 709)
//!              > direct     (specular, and all light of materials that do not scatter)
//! ```
//!
//! Theory: barycentrics and their screen derivatives from ray-plane volumes (exact under perspective); wrinkles as
//! partial-derivative normals or as differences of normals (Jimenez 2012 sections 8.2 and 8.2.1); hemoglobin and skin colour (section 7.6); Kelemen and
//! Szirmay-Kalos specular with the Beckmann distribution (Lee, "Realistic Skin Rendering", Jimenez 2012); percentage-closer soft shadows;
//! order-2 spherical harmonics and a prefiltered map for the environment; multiple-bounce ambient occlusion.
//!
//! The diffuse light of a lamp enters after the specular lobe has taken its share, and leaves towards the viewer in the
//! same way (Kelemen and Szirmay-Kalos 2001, eq. 10 and 11; d'Eon and Luebke 2007, rho_dt). The albedo of skin is the
//! reflectance under a uniform sky seen from the front, without the surface's own reflection (`docs/color.md`), so
//!
//! ```text
//! f = albedo / pi (1 - rho(L)) (1 - rho(V)) / ((1 - mean rho) (1 - rho(normal)))
//! ```
//!
//! with rho of `directional_albedo`; the factor of V goes with the albedo, as scattering comes before it. Under a
//! uniform sky diffuse and specular light add up to rho(V) + albedo (1 - rho(V)) / (1 - rho(normal)), which is no more
//! than 1 where the albedo is at most 1 - rho(normal).
//!
//! Specular occlusion: the share of the lobe inside the cone of ambient visibility, which leans towards the viewer
//! (`specular_visibility`; `docs/occlusion.md`); for the environment and for lamps without a shadow map, which light base
//! colours as glTF says.
//!
//! Highlights of skin may have two lobes ([`SpecularMethod`]): D is their weighted mean, so the table is the same mean.
//!
//! Skin that has a colour by itself ([`rubor_rig::head::SkinMaps::albedo`]) shows that colour, times the ratio of the look-up's
//! colours with the blood of the frame and with that at rest ([`rubor_rig::skin::chromophores::SkinLookup::with_blood`]); it
//! gets no microscopic relief. Its maps come from a material of glTF, so lamps and sky light it by the equations of that (2.0,
//! appendix B), as they do parts with the material of their author:
//!
//! ```text
//! f = albedo / pi (1 - F(L, V))  +  F D G / (4 cos(L) cos(V))      D of GGX, one lobe whatever the specular method
//! ```
//!
//! and of an even sky it sends back rho(V) + albedo (1 - rho(V)). Methods that light skin before the view is known take the normal
//! for V.
//!
//! Relief that was measured or painted has the slopes of its map; that which rubor made is steepened (`RELIEF_SCALE`).
//!
//! Differs from the sources: slope variance lost by minification widens the Beckmann lobe (Toksvig 2005), and so
//! does the size of a lamp; the iris is lit as a bowl behind a refracting cornea.
//!
//! Transmittance (Jimenez 2012 ch. 5): light through thin parts from shadow maps and T(s), added to the diffuse light that
//! is scattered next. Differs from the source: it sums the profile over the lit surface around the light's ray, the
//! integral of eq. 5.8 with the surface in the shadow map, so tilt, thickness and the edges of thin parts need
//! no guess (no reversed normal, no 0.3 wrap, no shrinking); light on the visible surface is left to `diffusion`. Lamps
//! without shadows transmit nothing. For the environment, which has no shadow map, a lamp behind the surface gives the
//! thickness; where none shines from behind the head, `scene::lamp::lamps` places a dark one there.
//!
//! Eyes, teeth and the lining of the mouth scatter light too, but not in `diffusion`, whose profile is that of skin:
//! their shadows are means over a disc as wide as light spreads in them (`spread_shadow`; the spread is about one over
//! the reduced scattering coefficient: Bashkatov et al. 2010 for sclera, Fried et al. 1995 for enamel and dentine),
//! which is the visible effect in a slab a few millimetres thick. The distance to lids and lips is measured in the
//! picture, so what lies outside its border does not darken.
//!
//! Tears along the lower lid are a strip whose normal turns from the ball to the lid, so a line in it mirrors each lamp.
//! The iris is lit as the bowl on which the cornea gathers light, brightest opposite to a lamp's reflection; pigment,
//! vessels, caruncle, papillae and patches of the lining are noise of texture coordinates, made for the default head.
//!
//! A diffusion method may light skin by a rule of its own ([`SkinLight`]): a variant of the kernel with the module
//! `package::skin_light` that the method brings. Without one nothing of it is compiled.
//!
//! Parts that keep the material of their author (`authored.wesl`) have a dispatch of their own, which heads without such
//! parts do not have: metallic-roughness of glTF 2.0, appendix B (GGX, Smith, Schlick, Lambert), lamps and shadows as for
//! skin, the environment by a table (`ggx_albedo`), and of the extensions of glTF ior, specular, clearcoat and transmission
//! through thin walls. What is seen through is lit layer by layer (`see_through`) with the same code.
//!
//! A software device runs every invocation through the whole shader, whatever it branches around: Mesa 22.3's turns branches
//! into masks. There `tiles.wesl` lists the tiles of 8 x 8 pixels in which there is something to shade, those of skin alone
//! apart, for which all else is left out of the kernel ([`Tiles`]). The light is the same to the bit.
//!
//! Does not: reflect one part of the head in another; carry light between parts of an eye or the mouth.

#[cfg(test)]
mod authored_tests;
pub(crate) mod directional_albedo;
mod ggx_albedo;
#[cfg(test)]
pub(crate) mod reference;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::{Vec3, Vec4};
use rubor_rig::error::SkinError;
use rubor_rig::head::{BASE_COLOR_F0, EYE_RADIUS_MM, LIMBUS_UV, Material, SKIN_F0};
use rubor_rig::skin::chromophores::{CHANGE_FLOOR, MOST_CHANGE};
use rubor_rig::skin::profile::{Profile, RadialProfile};
use rubor_rig::skin::slab::SlabTable;

use crate::device::kernel::Resource;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder, texture};
use crate::error::RenderError;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::see_through::Sum;
use crate::scene::head::AUTHORED_SHIFT;
use crate::scene::lamp::{GpuLight, Illumination};
use crate::scene::view::Seen;
use crate::scene::{MAX_HEMOGLOBIN, MAX_LIGHTS, PosedHead};
use crate::settings::{ColorMethod, Quality, SpecularMethod, WrinkleMethod};

const SHADER: Module = module!("shade", "shade.wesl");
const SAMPLES_SHADER: Module = module!("shade_light_samples", "light_samples.wesl");
const TILES_SHADER: Module = module!("shade_tiles", "tiles.wesl");
const AUTHORED_SHADER: Module = module!("shade_authored", "authored.wesl");
const THROUGH_SHADER: Module = module!("shade_through", "through.wesl");
const PARTS: [Module; 4] = [
    module!("shade_eye", "eye.wesl"),
    module!("shade_micro", "micro.wesl"),
    module!("shade_mouth", "mouth.wesl"),
    module!("shade_transmit", "transmit.wesl"),
];

/// Share of a neighbour's light that scattering returns to the centre per millimetre of distance from the centre's
/// tangent plane. A step of 4 mm (lip over teeth, wing of the nose over cheek) separates fully; the curve of a cheek
/// does not. Transmittance leaves the rest to scattering.
pub(crate) const FOLLOW_PER_MM: f32 = 0.25;

/// Bit of [`Params::skin_flags`]: points have light from other places of the head.
pub(crate) const BOUNCES: u32 = 4;

/// The shader of the pass.
pub(crate) fn program() -> Program {
    with_constants(Program::new(SHADER))
}

/// The shader of the pass that lights points of the surface.
pub(crate) fn samples_program(with_normals: bool) -> Program {
    with_constants(Program::new(SAMPLES_SHADER).with(&[SHADER]).flag("normals", with_normals))
}

/// The shader that lists tiles.
pub(crate) fn tiles_program() -> Program {
    importing(TILES_SHADER, None)
}

/// The shader of the pass for listed tiles: of skin alone, or of anything.
pub(crate) fn listed_program(only_skin: bool) -> Program {
    program().flag("listed", true).flag("only_skin", only_skin)
}

/// The shader of the pass that lights what keeps the material of its author.
pub(crate) fn authored_program() -> Program {
    with_constants(Program::new(AUTHORED_SHADER).with(&[SHADER]))
}

/// The shader of the pass for the light that came through thin parts.
pub(crate) fn through_program() -> Program {
    importing(THROUGH_SHADER, None)
}

/// The shader of the pass with a rule for skin: `modules` hold `package::skin_light`.
pub(crate) fn skin_light_program(modules: &[Module]) -> Program {
    program().with(modules).flag("skin_light", true)
}

/// A rule by which lamps and sky light skin, in place of Lambert's law.
pub(crate) trait SkinLight {
    /// Entry point `shade` of a [`skin_light_program`].
    fn kernel(&self) -> &Kernel;

    /// What its module binds for a head, and what replaces resources of the pass by their names.
    fn resources<'a>(&'a self, head: &PosedHead<'a>) -> Vec<Resource<'a>>;
}

/// A shader that imports from this pass; `flag` turns on variants of it.
pub(crate) fn importing(root: Module, flag: Option<&'static str>) -> Program {
    let program = Program::new(root).with(&[SHADER]);
    with_constants(flag.into_iter().fold(program, |p, f| p.flag(f, true)))
}

fn with_constants(program: Program) -> Program {
    program
        .with(&PARTS)
        .constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
        .constant("BOUNCES", BOUNCES)
        .constant("FOLLOW_PER_MM", FOLLOW_PER_MM)
        .constant("MAX_HEMOGLOBIN", MAX_HEMOGLOBIN)
        .constant("TRANSMIT_RINGS", RINGS as u32)
        .constant("TABLE_COSINES", directional_albedo::COSINES)
        .constant("LEAST_HALF_SQUARE", directional_albedo::LEAST_SQUARE)
        .constant("SKIN_F0", SKIN_F0)
        .constant("BASE_COLOR_F0", BASE_COLOR_F0)
        .constant("SKIN", Material::Skin.number())
        .constant("CHANGE_FLOOR", CHANGE_FLOOR)
        .constant("MOST_CHANGE", MOST_CHANGE)
        .constant("MUCOSA", Material::Mucosa.number())
        .constant("OTHER", Material::Other.number())
        .constant("EYE", Material::Eye.number())
        .constant("EYE_RADIUS_MM", EYE_RADIUS_MM)
        .constant("IRIS_ANGLE", LIMBUS_UV * std::f32::consts::TAU)
        .constant("TEETH", Material::Teeth.number())
        .constant("GUMS", Material::Gums.number())
}

/// Factor of the slopes of relief that rubor made: its maps hold true depths, and light between pores, which makes them look
/// deeper, is not drawn. Chosen by eye on the default head.
const RELIEF_SCALE: f32 = 1.35;

/// Rings of the plane across a light.
const RINGS: usize = 4;

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) slope_scale: f32,
    pub(crate) wrinkle_strength: f32,
    pub(crate) hemoglobin_scale: f32,
    pub(crate) head: u32,
    pub(crate) environment_intensity: f32,
    pub(crate) environment_levels: f32,
    pub(crate) has_maps: u32,
    pub(crate) wrinkle_map_count: u32,
    pub(crate) hair_color: [f32; 4],
    pub(crate) is_second_sample: u32,
    pub(crate) transmit_per_mm: f32,
    pub(crate) skin_flags: u32,
    pub(crate) pupil_mm: f32,
    pub(crate) lobes: [f32; 3],
    pub(crate) mm_per_texture: f32,
    pub(crate) ring_taps_mm: [f32; RINGS],
    pub(crate) ring_ends_mm: [f32; RINGS],
    pub(crate) slab: [f32; 4],
    pub(crate) middle: [f32; 4],
    pub(crate) harmonics: [[f32; 4]; 9],
    pub(crate) lights: [GpuLight; MAX_LIGHTS],
}

/// Light through slabs of skin, as a texture and with the lengths of a profile.
pub(crate) struct Transmittance {
    pub(crate) slabs: wgpu::TextureView,
    thickness_max_mm: f32,
    ring_taps_mm: [f32; RINGS],
    ring_ends_mm: [f32; RINGS],
    pub(crate) slab: [f32; 4],
}

/// Albedo of a medium by which rings and the farthest thickness are laid out: that of red in light skin.
const TYPICAL_ALBEDO: f64 = 0.6;

impl Transmittance {
    /// Takes lengths from a profile.
    ///
    /// # Errors
    /// The profile has no finite width.
    pub(crate) fn new(gpu: &Gpu, profile: &Profile) -> Result<Self, RenderError> {
        let table = SlabTable::kept();
        let radii_mm = profile.channels.each_ref().map(RadialProfile::mean_radius_mm);
        if let Some(radius) = radii_mm.iter().find(|r| !(**r > 0.0 && r.is_finite())) {
            return Err(SkinError::new("profile", radius, "a mean radius above 0 and finite").into());
        }
        let row = |row: &Vec<f64>| {
            let (last, others) = row.split_last().expect("a test reads the kept table");
            // What is thicker than the table passes nothing.
            others.iter().chain([&(0.0 * last)]).map(|t| [*t as f32, 0.0, 0.0, 1.0]).collect::<Vec<_>>()
        };
        let size = [table.rows[0].len() as u32, table.rows.len() as u32];
        let texels = table.rows.iter().flat_map(row).collect();
        let (ring_taps_mm, ring_ends_mm) = rings(&radii_mm);
        let [r, g, b] = radii_mm.map(|radius| (1.0 / (table.thickness_max * radius)) as f32);
        let widest_mm = radii_mm.into_iter().fold(0.0, f64::max);
        Ok(Self {
            ring_taps_mm,
            ring_ends_mm,
            slabs: texture::upload_half(gpu, "slabs", size, &[vec![texels]]),
            thickness_max_mm: (table.thickness_max * widest_mm) as f32,
            slab: [r, g, b, (1.0 / table.albedo_max) as f32],
        })
    }
}

/// Radii of taps and outer edges of rings with equal shares of the light that reaches a point from a plane behind
/// it, at a depth that a quarter of the farthest-reaching channel passes; the last ring is unbounded.
fn rings(radii_mm: &[f64; 3]) -> ([f32; RINGS], [f32; RINGS]) {
    let table = SlabTable::kept();
    let widest_mm = radii_mm.iter().copied().fold(0.0, f64::max);
    // The table decreases, so bisection finds the thickness that passes a share.
    let thickness_at = |share: f64| {
        let (mut low, mut high) = (0.0, table.thickness_max * widest_mm);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if table.sample(TYPICAL_ALBEDO, middle / widest_mm) > share {
                low = middle
            } else {
                high = middle
            }
        }
        low
    };
    let depth_mm = thickness_at(0.25);
    let radius =
        |outside: f64| (thickness_at(0.25 * outside).powi(2) - depth_mm.powi(2)).max(0.0).sqrt() as f32;
    let taps = std::array::from_fn(|i| radius(1.0 - (i as f64 + 0.5) / RINGS as f64));
    let ends =
        std::array::from_fn(
            |i| {
                if i + 1 < RINGS { radius(1.0 - (i + 1) as f64 / RINGS as f64) } else { 1e6 }
            },
        );
    (taps, ends)
}

impl SpecularMethod {
    /// Factors of the map's roughness of a first and a second lobe, and the share of the second. Skin has slopes at
    /// scales from cells to furrows, and measured patches fit two lobes better than one (Graham et al. 2013,
    /// "Measurement-based synthesis of facial microgeometry"); the factors were chosen by eye on cheek and forehead and
    /// keep the mean square slope.
    pub(crate) fn lobes(self) -> [f32; 3] {
        match self {
            Self::OneLobe => [1.0, 1.0, 0.0],
            // 0.72^2 (1 - 0.278) + 1.5^2 0.278 = 1.
            Self::TwoLobes => [0.72, 1.5, 0.278],
        }
    }
}

/// Inputs of the light that all heads of a frame share.
pub(crate) struct Lighting<'a> {
    pub(crate) light: &'a Illumination<'a>,
    pub(crate) seen: &'a Seen,
    /// The image of the pixel's first sample, for later samples: surfaces that look the same are not shaded again.
    pub(crate) first: Option<&'a Seen>,
    pub(crate) transmittance: Option<&'a Transmittance>,
    pub(crate) quality: &'a Quality,
    /// The rule that lights skin on visible surfaces; `None` for Lambert's law.
    pub(crate) skin_light: Option<&'a dyn SkinLight>,
}

/// Light of the visible surfaces.
#[derive(Clone)]
pub(crate) struct Lit {
    /// Diffuse radiance of a white surface; a = depth in mm relative to `View::depth_origin_mm`: a tap of scattering
    /// needs only this texel, and can interpolate it.
    pub(crate) irradiance: Image,
    /// Linear Rec. 709; a = strength of scattering.
    pub(crate) albedo: Image,
    /// Specular, and all light of materials that do not scatter.
    pub(crate) direct: Image,
}

/// Pipelines and table of materials of authors.
struct AuthoredKernels {
    opaque: Kernel,
    layer: Kernel,
    ggx_albedo: wgpu::TextureView,
    /// Of no layer all of what lies behind passes.
    white: wgpu::TextureView,
}

/// Workgroups that share the tiles of a list; each runs once more than it has tiles.
const TILE_GROUPS: u32 = 32;

/// Pipelines for tiles that have something to shade.
struct Tiles {
    list: Kernel,
    skin: Kernel,
    other: Kernel,
}

impl Tiles {
    fn new(gpu: &Gpu, stored_shadows: bool) -> Self {
        let of = |only_skin: bool| {
            let program = listed_program(only_skin).flag("stored_shadows", stored_shadows);
            Kernel::new(gpu, "shade", &program, "shade")
        };
        Self {
            list: Kernel::new(gpu, "shade tiles", &tiles_program(), "list_tiles"),
            skin: of(true),
            other: of(false),
        }
    }

    /// Shades the windows of heads: `each` has the resources of a head and the tiles of its window across and down.
    fn record(&self, r: &mut Recorder<'_>, each: Vec<(Vec<Resource<'_>>, [u32; 3])>) {
        let each: Vec<_> = each.into_iter().filter(|(_, [x, y, _])| x * y > 0).collect();
        let lists: Vec<[wgpu::Buffer; 2]> = each
            .iter()
            .map(|(_, [x, y, _])| {
                let bytes = 4 * (1 + u64::from(x * y));
                ["tiles of skin", "other tiles"].map(|label| r.gpu.storage_zeroed(label, bytes))
            })
            .collect();
        let listing = each.iter().zip(&lists).map(|((resources, [x, y, _]), [skin, other])| {
            let lists = [("skin_tiles", skin.bound()), ("other_tiles", other.bound())];
            ([resources.as_slice(), &lists].concat(), [(x * y).div_ceil(64), 1, 1])
        });
        r.dispatch_each(&self.list, listing.collect::<Vec<_>>());
        for (kernel, list) in [(&self.skin, 0), (&self.other, 1)] {
            let of = each.iter().zip(&lists).map(|((resources, _), lists)| {
                let tiles = [("tiles", lists[list].bound())];
                ([resources.as_slice(), &tiles].concat(), [TILE_GROUPS, 1, 1])
            });
            r.dispatch_each(kernel, of.collect::<Vec<_>>());
        }
    }
}

/// The pipelines of the pass.
pub(crate) struct Shade {
    kernel: Kernel,
    /// On software devices.
    tiles: Option<Tiles>,
    /// Made by the first frame that lights points of the surface.
    samples_kernel: Option<(bool, Kernel)>,
    /// Variants of the kernel for the rules of diffusion methods, by their names, each made by the first frame with it.
    skin_light_kernels: Mutex<Vec<(&'static str, Arc<Kernel>)>>,
    /// Made by the first frame that shows a material of an author.
    authored_kernel: OnceLock<AuthoredKernels>,
    /// Made by the first frame that keeps the light that came through thin parts.
    through_kernel: OnceLock<Kernel>,
    /// Whether shadow maps are floats and no depth textures.
    stored_shadows: bool,
    trilinear_repeat: wgpu::Sampler,
    linear_clamp: wgpu::Sampler,
    compare: wgpu::Sampler,
    black: wgpu::TextureView,
    black_array: wgpu::TextureView,
    /// Share of an even sky that the specular lobes of a method reflect.
    directional_albedo: (SpecularMethod, wgpu::TextureView),
    /// The same with GGX for skin; made by the first frame with skin that has a colour by itself.
    own_albedo: Option<wgpu::TextureView>,
}

impl Shade {
    pub(crate) fn new(gpu: &Gpu, rasteriser: Rasteriser) -> Self {
        let stored_shadows = rasteriser.stores_depth();
        let program = program().flag("stored_shadows", stored_shadows);
        let linear = wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        };
        let sampler = |d: &wgpu::SamplerDescriptor<'_>| gpu.device.create_sampler(d);
        let black = texture::upload_half(gpu, "black", [1, 1], &[vec![vec![[0.0; 4]]]]);
        let specular = SpecularMethod::OneLobe;
        Self {
            directional_albedo: (specular, upload_directional_albedo(gpu, specular)),
            own_albedo: None,
            kernel: Kernel::new(gpu, "shade", &program, "shade"),
            tiles: gpu.is_software().then(|| Tiles::new(gpu, stored_shadows)),
            samples_kernel: None,
            stored_shadows,
            skin_light_kernels: Mutex::default(),
            authored_kernel: OnceLock::new(),
            through_kernel: OnceLock::new(),
            trilinear_repeat: sampler(&wgpu::SamplerDescriptor {
                label: Some("trilinear repeat"),
                address_mode_u: wgpu::AddressMode::Repeat,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..linear.clone()
            }),
            linear_clamp: sampler(&wgpu::SamplerDescriptor { label: Some("linear clamp"), ..linear.clone() }),
            compare: sampler(&wgpu::SamplerDescriptor {
                label: Some("shadow"),
                compare: Some(wgpu::CompareFunction::LessEqual),
                ..linear
            }),
            black_array: texture::array_view(&black),
            black,
        }
    }

    /// Shades whole windows, as on other devices.
    #[cfg(test)]
    pub(crate) fn forget_tiles(&mut self) {
        self.tiles = None;
    }

    /// Makes the resources of the specular method, and of skin with a colour by itself if there is any.
    pub(crate) fn prepare_specular(&mut self, gpu: &Gpu, method: SpecularMethod, has_own_color: bool) {
        if self.directional_albedo.0 != method {
            self.directional_albedo = (method, upload_directional_albedo(gpu, method));
        }
        if has_own_color && self.own_albedo.is_none() {
            let table = vec![vec![directional_albedo::table_of_base_colors()]];
            self.own_albedo = Some(texture::upload_half(
                gpu,
                "directional albedo of GGX",
                directional_albedo::SIZE,
                &table,
            ));
        }
    }

    /// The variant of the kernel with the rule of a name, made from `program` unless it exists.
    pub(crate) fn skin_light_kernel(
        &self,
        gpu: &Gpu,
        name: &'static str,
        program: impl FnOnce() -> Program,
    ) -> Arc<Kernel> {
        let mut kernels = self.skin_light_kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, kernel)) = kernels.iter().find(|(of, _)| *of == name) {
            return kernel.clone();
        }
        let program = program().flag("stored_shadows", self.stored_shadows);
        let kernel = Arc::new(Kernel::new(gpu, "shade", &program, "shade"));
        kernels.push((name, kernel.clone()));
        kernel
    }

    /// Shades the visible parts of heads. `into` takes the light of a first sample that this one may share.
    pub(crate) fn record(
        &self,
        r: &mut Recorder<'_>,
        lighting: &Lighting<'_>,
        heads: &[PosedHead<'_>],
        into: Option<&Lit>,
    ) -> Lit {
        let size = lighting.seen.ids.size();
        let lit = into.cloned().unwrap_or_else(|| Lit {
            irradiance: r.image("irradiance", ImageSpec::light(size)),
            albedo: r.image("albedo", ImageSpec::light(size)),
            direct: r.image("direct", ImageSpec::light(size)),
        });
        let params: Vec<_> = heads.iter().map(|h| r.uniform("shade", &params(lighting, h))).collect();
        let first = lighting.first.unwrap_or(lighting.seen);
        let resources = |h, params| {
            let mut resources = lighting.skin_light.map_or_else(Vec::new, |rule| rule.resources(h));
            resources.extend(self.resources(lighting, h, params));
            resources.extend([
                ("first_visible", first.ids.bound()),
                ("first_depth", first.depth.bound()),
                ("diffuse_out", lit.irradiance.bound()),
                ("albedo_out", lit.albedo.bound()),
                ("direct_out", lit.direct.bound()),
            ]);
            resources
        };
        let each = heads
            .iter()
            .zip(&params)
            .map(|(h, params)| (resources(h, params), lighting.seen.groups(h.index)));
        match (&self.tiles, lighting.skin_light) {
            (Some(tiles), None) => tiles.record(r, each.collect()),
            (_, rule) => r.dispatch_each(rule.map_or(&self.kernel, SkinLight::kernel), each),
        }
        if heads.iter().all(|h| h.head.authored.is_none()) {
            return lit;
        }
        let kernels = self.authored_kernels(r.gpu);
        let authored = heads.iter().zip(&params).filter_map(|(h, params)| {
            let authored = h.head.authored.as_ref()?;
            let mut resources = resources(h, params);
            resources.extend(authored.resources());
            resources.push(("authored_data", authored.data.bound()));
            resources.push(("ggx_albedo", kernels.ggx_albedo.bound()));
            Some((resources, lighting.seen.groups(h.index)))
        });
        r.dispatch_each(&kernels.opaque, authored);
        lit
    }

    fn authored_kernels(&self, gpu: &Gpu) -> &AuthoredKernels {
        self.authored_kernel.get_or_init(|| AuthoredKernels::new(gpu, self.stored_shadows))
    }

    /// The part of [`Lit::irradiance`] that came through thin parts, by itself; zero where `lighting` has no transmittance.
    pub(crate) fn record_through(
        &self,
        r: &mut Recorder<'_>,
        lighting: &Lighting<'_>,
        heads: &[PosedHead<'_>],
    ) -> Image {
        let kernel = self.through_kernel.get_or_init(|| {
            let program = through_program().flag("stored_shadows", self.stored_shadows);
            Kernel::new(r.gpu, "light through", &program, "through")
        });
        // A new image is zero, and nothing is written where there is no skin.
        let through = Image::new(r.gpu, "light through", ImageSpec::light(lighting.seen.ids.size()));
        if lighting.transmittance.is_none() {
            return through;
        }
        let params: Vec<_> = heads.iter().map(|h| r.uniform("light through", &params(lighting, h))).collect();
        let each = heads.iter().zip(&params).map(|(h, params)| {
            let mut resources = self.resources(lighting, h, params);
            resources.push(("through_out", through.bound()));
            (resources, lighting.seen.groups(h.index))
        });
        r.dispatch_each(kernel, each);
        through
    }

    /// Adds the light of a layer that is seen through, whose ids are those of `lighting`, to that of the layers before.
    pub(crate) fn record_layer(
        &self,
        r: &mut Recorder<'_>,
        lighting: &Lighting<'_>,
        heads: &[PosedHead<'_>],
        before: Option<&Sum>,
    ) -> Sum {
        let size = lighting.seen.ids.size();
        let sum = Sum::new(r, size);
        let kernels = self.authored_kernels(r.gpu);
        let params: Vec<_> = heads.iter().map(|h| r.uniform("shade layer", &params(lighting, h))).collect();
        // The first head also carries the sum on where there is no layer, whatever its materials.
        let any = heads.iter().find_map(|h| h.head.authored.as_ref());
        let each = heads.iter().zip(&params).filter_map(|(h, params)| {
            let is_first = h.index == 0;
            let authored = h.head.authored.as_ref().or(any.filter(|_| is_first))?;
            let mut resources = self.resources(lighting, h, params);
            resources.extend(authored.resources());
            resources.extend([
                ("authored_data", authored.data.bound()),
                ("ggx_albedo", kernels.ggx_albedo.bound()),
                ("sum_radiance", before.map_or(self.black.bound(), |b| b.radiance.bound())),
                ("sum_share", before.map_or(kernels.white.bound(), |b| b.share.bound())),
                ("sum_radiance_out", sum.radiance.bound()),
                ("sum_share_out", sum.share.bound()),
            ]);
            Some((resources, lighting.seen.groups(h.index)))
        });
        r.dispatch_each(&kernels.layer, each);
        sum
    }

    /// Makes the resources of [`Shade::record_samples`].
    pub(crate) fn prepare_samples(&mut self, gpu: &Gpu, with_normals: bool) {
        if self.samples_kernel.as_ref().is_none_or(|(normals, _)| *normals != with_normals) {
            let program = samples_program(with_normals).flag("stored_shadows", self.stored_shadows);
            let kernel = Kernel::new(gpu, "light samples", &program, "light_samples");
            self.samples_kernel = Some((with_normals, kernel));
        }
    }

    /// Diffuse light at `count` points of a head's surface.
    pub(crate) fn record_samples(
        &self,
        r: &mut Recorder<'_>,
        lighting: &Lighting<'_>,
        head: &PosedHead<'_>,
        [samples, light]: [&wgpu::Buffer; 2],
        count: u32,
    ) {
        let Some((_, kernel)) = &self.samples_kernel else { return };
        let params = r.uniform("light samples", &params(lighting, head));
        let mut resources = self.resources(lighting, head, &params);
        resources.extend([("surface_samples", samples.bound()), ("sample_light", light.bound())]);
        r.dispatch(kernel, &resources, [count.div_ceil(64), 1, 1]);
    }

    /// Bindings of the light on a head, for pixels or points.
    pub(crate) fn resources<'a>(
        &'a self,
        lighting: &Lighting<'a>,
        posed: &PosedHead<'a>,
        params: &'a wgpu::Buffer,
    ) -> Vec<Resource<'a>> {
        let maps = posed.head.maps.as_ref();
        let own_albedo = self.own_albedo.as_ref().filter(|_| maps.is_some_and(|m| m.has_own_color));
        vec![
            ("view", lighting.seen.view.bound()),
            ("params", params.bound()),
            ("visible", lighting.seen.ids.bound()),
            ("depth", lighting.seen.depth.bound()),
            ("shadows", lighting.light.shadows.bound()),
            ("environment", lighting.light.environment.map_or(&self.black, |e| &e.filtered).bound()),
            ("trilinear_repeat", self.trilinear_repeat.bound()),
            ("linear_clamp", self.linear_clamp.bound()),
            ("compare", self.compare.bound()),
            ("slabs", lighting.transmittance.map_or(&self.black, |t| &t.slabs).bound()),
            ("directional_albedo", own_albedo.unwrap_or(&self.directional_albedo.1).bound()),
            ("positions", posed.positions.bound()),
            ("vertices", posed.head.vertices.bound()),
            ("triangles", posed.head.triangles.bound()),
            ("frames", posed.tangent_frames.bound()),
            ("bounced", posed.bounced.bound()),
            ("skin_map", maps.map_or(&self.black, |m| &m.skin).bound()),
            ("gloss_map", maps.map_or(&self.black, |m| &m.gloss).bound()),
            ("slope_map", maps.map_or(&self.black, |m| &m.slopes).bound()),
            ("wrinkle_maps", maps.map_or(&self.black_array, |m| &m.wrinkles).bound()),
            ("blood", posed.blood.bound()),
            ("wrinkle_weights", posed.wrinkle_weights.bound()),
            ("skin_color", posed.head.skin_color.bound()),
        ]
    }
}

impl AuthoredKernels {
    fn new(gpu: &Gpu, stored_shadows: bool) -> Self {
        let program = authored_program().flag("stored_shadows", stored_shadows);
        let table = vec![vec![ggx_albedo::table()]];
        Self {
            opaque: Kernel::new(gpu, "shade authored", &program, "shade_authored"),
            layer: Kernel::new(gpu, "shade layer", &program, "shade_layer"),
            ggx_albedo: texture::upload_half(gpu, "GGX albedo", ggx_albedo::SIZE, &table),
            white: texture::upload_half(gpu, "white", [1, 1], &[vec![vec![[1.0; 4]]]]),
        }
    }
}

fn upload_directional_albedo(gpu: &Gpu, method: SpecularMethod) -> wgpu::TextureView {
    let table = vec![vec![directional_albedo::table(method.lobes())]];
    texture::upload_half(gpu, "directional albedo", directional_albedo::SIZE, &table)
}

/// Numbers of the pass for one head.
pub(crate) fn params(lighting: &Lighting<'_>, posed: &PosedHead<'_>) -> Params {
    let maps = posed.head.maps.as_ref();
    let quality = lighting.quality;
    let hemoglobin_scale = match quality.color {
        ColorMethod::Static => 1.0,
        ColorMethod::Hemoglobin => posed.state.hemoglobin_scale,
    };
    Params {
        slope_scale: if maps.is_some_and(|m| m.has_given_relief) { 1.0 } else { RELIEF_SCALE },
        wrinkle_strength: 1.25,
        // Keeps the product finite: blood beyond its range is clamped, NaN would not be.
        hemoglobin_scale: hemoglobin_scale.clamp(-1e6, 1e6),
        head: posed.index,
        environment_intensity: lighting.light.environment_intensity,
        environment_levels: lighting.light.environment_levels(),
        has_maps: u32::from(maps.is_some()),
        wrinkle_map_count: match quality.wrinkles {
            WrinkleMethod::None => 0,
            WrinkleMethod::PartialDerivative | WrinkleMethod::Difference => {
                maps.map_or(0, |m| m.wrinkle_maps)
            }
        },
        is_second_sample: u32::from(lighting.first.is_some()),
        skin_flags: u32::from(quality.wrinkles == WrinkleMethod::Difference)
            | u32::from(maps.is_some_and(|m| m.has_own_color)) << 1
            | if lighting.light.bounces { BOUNCES } else { 0 },
        pupil_mm: posed.state.pupil_mm,
        transmit_per_mm: lighting.transmittance.map_or(0.0, |t| 1.0 / t.thickness_max_mm),
        lobes: match maps {
            Some(maps) if maps.has_own_color => SpecularMethod::OneLobe.lobes(),
            _ => quality.specular.lobes(),
        },
        mm_per_texture: posed.head.mm_per_texture,
        ring_taps_mm: lighting.transmittance.map_or([0.0; RINGS], |t| t.ring_taps_mm),
        ring_ends_mm: lighting.transmittance.map_or([0.0; RINGS], |t| t.ring_ends_mm),
        slab: lighting.transmittance.map_or([0.0; 4], |t| t.slab),
        hair_color: maps.map_or([0.0; 4], |m| {
            let [r, g, b] = m.hair_color_linear;
            [r, g, b, 1.0]
        }),
        middle: middle(posed).to_array(),
        harmonics: lighting.light.harmonics(),
        lights: lighting.light.lights,
    }
}

/// The plane between the halves of a head: its dot product with a place in the world is positive on the character's left.
fn middle(posed: &PosedHead<'_>) -> Vec4 {
    let (low, high) = posed.head.bounds;
    let left = posed.world_from_head.transform_vector3(Vec3::X);
    let center = posed.world_from_head.transform_point3(0.5 * (low + high));
    left.extend(-left.dot(center))
}
