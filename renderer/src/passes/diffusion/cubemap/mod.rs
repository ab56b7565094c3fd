//! `dipole-cubemap:N`: the BSSRDF summed over disks in what lamps see of a head, kept on six views along its axes.
//!
//! ```text
//! positions, lamps --draw: triangles into all layers at once--> depth, id of each layer   (lamps, six axes)
//!     --light--> texels: depth, normal, light per area of the layer, strength
//!     --gather: N samples per texel of an axis and layer--> far light of the six axes  (mean over frames while nothing moves)
//!     --smooth: means over 3 x 3 texels of one surface, less with every frame-->
//! irradiance --near: a disk on the picture--> near light --combine: axes that show the pixel--> scattered
//! ```
//!
//! Theory: the four passes of the DTU thesis draft "real-time directional subsurface scattering" (light buffer, array
//! texture of six views, disks of BSSRDF samples, combination) with its three sampling fixes (sections 4.4.1 to 4.4.3); standard dipole (Jensen
//! et al. 2001), better dipole (d'Eon 2012) or any other profile as a table, directional dipole (Frisvad et al. 2014)
//! with the refracted direction of the light. Light of a place is `sum K(way) flux / (N density)`; flux is the light over
//! the cosine towards the layer, so a sample stands for an area of the layer and not of the surface, and the cosine of
//! the thesis's sum is in that area.
//!
//! Differs from the source:
//! - Texels of the axes are a millimetre or more, and half of the light of skin leaves nearer. So the profile is divided
//!   by a window around [`near_radius_mm`]: what is narrower is a disk on the picture itself (as the methods on the screen,
//!   at their resolution), what is wider comes from the axes. With a directional dipole the layers carry the difference to
//!   its mean as well. Light between opposite sides of a thin part all goes through the layers.
//! - Radii of samples are quantiles of the profile (equal shares of light, weights one over the density) and not equal
//!   areas; the disk is tilted with the surface; behind a lit surface half of the samples are the quantiles of a slab of
//!   that depth. Sums are scaled so that an evenly lit plane or slab is exact with any N.
//! - Axes are weighed by the square of their cosine, and a texel by its distance from the tangent plane: an average over
//!   visible views shows a step where a view begins.
//! - Triangles are drawn by compute (one invocation per triangle and layer, two passes), as rasterising a head nine times
//!   costs nine times its vertices.
//!
//! The sky is light of the axes' own texels: each is a lamp that sees what it sees, and they share a place by the
//! squares of their cosines. So are lamps without shadows, which light what they do not see. This light has no direction
//! here, so a directional dipole scatters it by its mean.
//!
//! State: the far light of the axes of the last frame and the number of frames in it, while heads, lamps, sky, profile and quality
//! stay the same; the camera may move. [`Diffusion::forget`] drops it, which [`crate::Renderer::cut`] calls. After
//! [`MOST_REFINED`] frames the layers are not drawn again.
//!
//! Limits: light of places that no lamp's middle sees (the outer half of a penumbra) is missing and that of the inner half
//! is whole, so a penumbra is as narrow as a texel in the far light; places that no axis sees (deep in a nostril, between
//! lips) take the picture's light as even; an opaque part other than skin blocks only from 10 mm on; a lamp nearer to the
//! skin than 5 mm is outside of its own view.

mod layers;
mod tables;

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

use glam::Mat4;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Material;
use rubor_rig::skin::profile::Profile;

use self::layers::{AXES, Layer, MOST_LAYERS, layers, shines};
use self::tables::Tables;
use super::bssrdf::{BSSRDF, Dipole};
use super::screen::gather;
use super::{Before, Diffusion, Needs};
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::error::RenderError;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::pixel_groups;
use crate::passes::shade::{self, Lit};
use crate::scene::view::Seen;
use crate::scene::{Light, PosedHead, Scene};
use crate::settings::Quality;

const COMMON: Module = module!("cubemap_common", "common.wesl");
const DRAW: Module = module!("cubemap_draw", "draw.wesl");
const LIGHT: Module = module!("cubemap_light", "light.wesl");
const GATHER: Module = module!("cubemap_gather", "gather.wesl");
const SMOOTH: Module = module!("cubemap_smooth", "smooth.wesl");
const COMBINE: Module = module!("cubemap_combine", "combine.wesl");
const NEAR: Module = module!("cubemap_near", "near.wesl");

/// Texels on a side of an axis.
const SIDES: [u32; 3] = [64, 128, 256];
/// Pixels of the picture that a texel of an axis may cover.
const PIXELS_PER_TEXEL: f32 = 2.0;
/// Largest radius around which the profile is divided between the picture and the layers, mm.
const MOST_NEAR_MM: f32 = 2.0;
/// The same in texels of the largest side.
const NEAR_TEXELS: f32 = 2.0;
/// Frames that far light is refined in. A half float resolves no smaller share of a frame.
pub(crate) const MOST_REFINED: u32 = 64;
/// Strength under which light counts as unscattered.
const LEAST_STRENGTH: f32 = 0.02;
/// Offsets of the first two fixes, and the bias of the third, in texels of an axis.
const LAMP_SHRINK_TEXELS: f32 = 1.0;
const AXIS_SHRINK_TEXELS: f32 = 0.5;
const BIAS_TEXELS: f32 = 0.75;

/// The fixes of the thesis's section 4.4 and the weights of axes, as bits of `Cube::fixes`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fixes {
    /// 4.4.1: layers of lamps are read nearer to the inside of the head.
    pub(crate) shrinks_to_lamp: bool,
    /// 4.4.2: the same for the axes.
    pub(crate) shrinks_to_axis: bool,
    /// 4.4.3: a bias when depths are compared.
    pub(crate) has_bias: bool,
    /// Axes count by the square of their cosine; without, every axis that shows a place counts alike.
    pub(crate) weighs_by_facing: bool,
}

impl Fixes {
    pub(crate) const ALL: Self =
        Self { shrinks_to_lamp: true, shrinks_to_axis: true, has_bias: true, weighs_by_facing: true };

    fn bits(self) -> u32 {
        let Self { shrinks_to_lamp, shrinks_to_axis, has_bias, weighs_by_facing } = self;
        u32::from(shrinks_to_lamp)
            | u32::from(shrinks_to_axis) << 1
            | u32::from(has_bias) << 2
            | u32::from(weighs_by_facing) << 3
    }
}

/// Numbers of a head, as common.wesl reads them; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Cube {
    pub(crate) head: u32,
    pub(crate) size: u32,
    pub(crate) lamps: u32,
    pub(crate) layers: u32,
    pub(crate) triangles: u32,
    pub(crate) samples: u32,
    pub(crate) refined: u32,
    pub(crate) fixes: u32,
    pub(crate) has_sky: u32,
    pub(crate) half_width_mm: f32,
    pub(crate) near_start_mm: f32,
    pub(crate) near_end_mm: f32,
    pub(crate) lamp_shrink_mm: f32,
    pub(crate) axis_shrink_mm: f32,
    pub(crate) bias_mm: f32,
    pub(crate) texel_mm: f32,
    pub(crate) near_light: [f32; 4],
    pub(crate) plane_factor: [f32; 4],
    pub(crate) dipole: Dipole,
    pub(crate) layer: [Layer; MOST_LAYERS],
}

/// The shader that draws.
pub(crate) fn draw_program() -> Program {
    Program::new(DRAW).with(&[COMMON, BSSRDF]).constant("SKIN", Material::Skin.number())
}

/// The shader that lights the layers.
pub(crate) fn light_program() -> Program {
    shade::importing(LIGHT, None).with(&[COMMON, BSSRDF])
}

/// The shader of the disks.
pub(crate) fn gather_program(refines: bool, directional: bool) -> Program {
    Program::new(GATHER)
        .with(&[COMMON, BSSRDF])
        .flag("refines", refines)
        .flag("directional", directional)
        .constant("LEAST_STRENGTH", LEAST_STRENGTH)
}

/// The shader of the means over neighbours.
pub(crate) fn smooth_program() -> Program {
    Program::new(SMOOTH).with(&[COMMON, BSSRDF]).constant("LEAST_STRENGTH", LEAST_STRENGTH)
}

/// The shader of the combination.
pub(crate) fn combine_program() -> Program {
    Program::new(COMBINE).with(&[COMMON, BSSRDF]).constant("LEAST_STRENGTH", LEAST_STRENGTH)
}

/// The shader of the picture's own disk.
pub(crate) fn near_program() -> Program {
    gather::program(NEAR)
}

/// Everything that the far light depends on, to tell whether anything moved.
#[derive(PartialEq)]
struct Scenery {
    heads: Vec<(wgpu::Buffer, FaceState, Mat4, u32)>,
    lights: Vec<Light>,
    environment: Option<wgpu::TextureView>,
    environment_rotation: f32,
    environment_intensity: f32,
    quality: Quality,
}

/// The axes of a head with their light.
struct OfHead {
    cube: wgpu::Buffer,
    texels: Image,
    /// As gathered: the mean of the frames so far.
    far: Image,
    /// The same, smoothed.
    smoothed: Image,
}

/// What is divided around one radius.
struct Divided {
    near_mm: f32,
    tables: Tables,
    profile: wgpu::Buffer,
    disk: wgpu::Buffer,
    plane_factor: [f32; 3],
    near: gather::Gather,
}

/// The method for one profile.
pub(crate) struct DipoleCubemap {
    samples: u32,
    profile: Profile,
    fixes: Fixes,
    draw: [Kernel; 2],
    light: Kernel,
    gather: Kernel,
    /// Made by the first frame that is refined.
    refine: Option<Kernel>,
    smooth: Kernel,
    combine: Kernel,
    divided: Option<Divided>,
    /// Depths and ids of the layers of one head at a time.
    drawn: Option<[wgpu::Buffer; 2]>,
    scenery: Option<Scenery>,
    /// Frames in the far light.
    refined: u32,
    heads: Vec<OfHead>,
}

/// Radius around which the profile is divided for heads whose largest texel has this side, mm: whole halvings, so that
/// it does not change with every head.
fn near_radius_mm(largest_texel_mm: f32) -> f32 {
    let halvings = (MOST_NEAR_MM / (NEAR_TEXELS * largest_texel_mm).max(1e-3)).log2().floor();
    MOST_NEAR_MM * (-halvings.max(0.0)).exp2()
}

impl DipoleCubemap {
    /// Makes the pipelines.
    ///
    /// # Errors
    /// The profile has no finite width, or directions of light that differ between channels.
    pub(crate) fn new(
        gpu: &Gpu,
        rasteriser: Rasteriser,
        profile: &Profile,
        samples: u32,
    ) -> Result<Self, RenderError> {
        // What is wrong with a profile is said before the first frame.
        let is_directional = Tables::new(profile, f64::from(MOST_NEAR_MM))?.dipole.is_some();
        let kernel = |label, program: &Program, entry| Kernel::new(gpu, label, program, entry);
        let draw = draw_program();
        Ok(Self {
            samples,
            profile: profile.clone(),
            fixes: Fixes::ALL,
            draw: [kernel("scatter: depth", &draw, "draw_depth"), kernel("scatter: ids", &draw, "draw_ids")],
            light: kernel(
                "scatter: light",
                &light_program().flag("stored_shadows", rasteriser.stores_depth()),
                "light_layers",
            ),
            gather: kernel("scatter: disks", &gather_program(false, is_directional), "gather_layers"),
            refine: None,
            smooth: kernel("scatter: smooth", &smooth_program(), "smooth_axes"),
            combine: kernel("scatter: combine", &combine_program(), "combine"),
            divided: None,
            drawn: None,
            scenery: None,
            refined: 0,
            heads: Vec::new(),
        })
    }

    /// The method without some of the fixes.
    #[cfg(test)]
    pub(crate) fn with_fixes(self, fixes: Fixes) -> Self {
        Self { fixes, ..self }
    }

    fn divide(&mut self, gpu: &Gpu, near_mm: f32) {
        if self.divided.as_ref().is_some_and(|d| d.near_mm == near_mm) {
            return;
        }
        self.divided = Tables::new(&self.profile, f64::from(near_mm)).ok().map(|tables| {
            let samples = tables.samples(self.samples as usize, 0.5);
            let reach = tables.near_taps.iter().map(|t| t.place[2]).fold(0.0, f32::max);
            Divided {
                near_mm,
                profile: gpu.storage("profile", &tables.entries),
                disk: gpu.storage("disk", &samples.places),
                plane_factor: samples.plane_factor,
                near: gather::Gather::new(
                    gpu,
                    &near_program(),
                    "near_disk",
                    &tables.near_taps,
                    reach.max(1e-3),
                    [0.0; 4],
                ),
                tables,
            }
        });
    }

    /// Buffers of zeros for the depths and ids of so many texels.
    fn cleared(&mut self, r: &mut Recorder<'_>, texels: u64) -> [wgpu::Buffer; 2] {
        let is_large_enough = |b: &[wgpu::Buffer; 2]| b[0].size() >= 4 * texels;
        let buffers = match self.drawn.take().filter(is_large_enough) {
            Some(buffers) => {
                for buffer in &buffers {
                    r.encoder.clear_buffer(buffer, 0, None);
                }
                buffers
            }
            None => ["depth of layers", "ids of layers"].map(|n| r.gpu.storage_zeroed(n, 4 * texels)),
        };
        self.drawn = Some(buffers.clone());
        buffers
    }
}

/// Texels on a side of the axes of a head for a picture.
fn side_of(frame: &Before<'_>, head: &PosedHead<'_>) -> u32 {
    let camera = &frame.scene.camera;
    let (low, high) = head.head.bounds;
    let center = head.world_from_head.transform_point3(0.5 * (low + high));
    let extent = (high - low).max_element();
    let depth = -camera.view_from_world().transform_point3(center).z - 0.5 * extent;
    let focal = frame.size[1] as f32 / (2.0 * (0.5 * camera.fov_degrees.to_radians()).tan());
    let pixels = extent * focal / depth.max(0.25 * extent);
    let last = SIDES[SIDES.len() - 1];
    SIDES.into_iter().find(|side| pixels <= PIXELS_PER_TEXEL * *side as f32).unwrap_or(last)
}

/// Whether there is light that the axes carry: of the sky, or of lamps without shadows.
fn has_even_light(scene: &Scene<'_>) -> bool {
    (scene.environment.is_some() && scene.environment_intensity > 0.0)
        || scene.lights.iter().any(|l| !l.casts_shadow && shines(l))
}

/// Side of the largest texel of a head's axes at their largest size, mm.
fn largest_texel_mm(head: &PosedHead<'_>) -> f32 {
    let (low, high) = head.head.bounds;
    1e3 * (high - low).max_element() / SIDES[SIDES.len() - 1] as f32
}

/// A number of a sequence without near repetitions (base 2 backwards), 0.5 first.
fn van_der_corput(index: u32) -> f64 {
    f64::from((index + 1).reverse_bits()) / 2f64.powi(32)
}

impl Diffusion for DipoleCubemap {
    fn needs(&self) -> Needs {
        // Light on all of the head, its shadows a little beyond the picture; the disks carry light through thin parts.
        Needs { backs: true, margin: 1.25, transmittance: false, before_view: true }
    }

    fn forget(&mut self) {
        self.scenery = None;
        self.refined = 0;
    }

    fn memory_bytes(&self) -> u64 {
        let drawn = self.drawn.iter().flatten().map(wgpu::Buffer::size).sum::<u64>();
        let divided = self.divided.as_ref().map_or(0, |d| d.profile.size() + d.disk.size());
        drawn + divided
    }

    fn before_view(&mut self, r: &mut Recorder<'_>, frame: &Before<'_>) {
        let scene = frame.scene;
        let sides: Vec<u32> = frame.heads.iter().map(|h| side_of(frame, h)).collect();
        let placed = frame.heads.iter().zip(&sides);
        let scenery = Scenery {
            heads: placed
                .map(|(h, side)| (h.head.rest_points().clone(), h.state.clone(), h.world_from_head, *side))
                .collect(),
            lights: scene.lights.to_vec(),
            environment: scene.environment.map(|e| e.filtered.clone()),
            environment_rotation: scene.environment_rotation,
            environment_intensity: scene.environment_intensity,
            quality: frame.quality.clone(),
        };
        let is_same = self.scenery.as_ref() == Some(&scenery) && self.heads.len() == frame.heads.len();
        self.refined = if is_same { self.refined + 1 } else { 0 };
        if is_same && self.refined >= MOST_REFINED {
            return;
        }
        self.scenery = Some(scenery);
        let near_mm = near_radius_mm(frame.heads.iter().map(largest_texel_mm).fold(0.0, f32::max));
        self.divide(r.gpu, near_mm);
        let past = std::mem::take(&mut self.heads);
        for (i, (head, side)) in frame.heads.iter().zip(sides).enumerate() {
            let before = if self.refined > 0 { past.get(i).map(|h| &h.far) } else { None };
            if let Some(of_head) = self.record_head(r, frame, head, side, before) {
                self.heads.push(of_head);
            }
        }
    }

    fn after_shading(
        &mut self,
        r: &mut Recorder<'_>,
        heads: &[PosedHead<'_>],
        seen: &Seen,
        lit: &Lit,
    ) -> Image {
        let Some(divided) = &mut self.divided else { return lit.irradiance.clone() };
        let near = divided.near.after_shading(r, heads, seen, lit);
        let size = near.size();
        let scattered = r.image("scattered", ImageSpec::light(size));
        let each = heads.iter().zip(&self.heads).map(|(head, own)| {
            let resources = vec![
                ("view", seen.view.bound()),
                ("cube", own.cube.bound()),
                ("positions", head.positions.bound()),
                ("vertices", head.head.vertices.bound()),
                ("triangles", head.head.triangles.bound()),
                ("frames", head.tangent_frames.bound()),
                ("visible", seen.ids.bound()),
                ("depth", seen.depth.bound()),
                ("albedo", lit.albedo.bound()),
                ("near", near.bound()),
                ("texels", own.texels.bound()),
                ("far", own.smoothed.bound()),
                ("scattered", scattered.bound()),
            ];
            (resources, seen.groups(head.index))
        });
        r.dispatch_each(&self.combine, each);
        // Without a head nothing scatters, and nobody wrote the picture.
        if heads.is_empty() { near } else { scattered }
    }
}

impl DipoleCubemap {
    /// Draws, lights and gathers one head. `before` is its far light so far.
    fn record_head(
        &mut self,
        r: &mut Recorder<'_>,
        frame: &Before<'_>,
        head: &PosedHead<'_>,
        side: u32,
        before: Option<&Image>,
    ) -> Option<OfHead> {
        let (layer, lamps) = layers(head.head.bounds, &head.world_from_head, frame.scene.lights);
        let count = (lamps + AXES) as u32;
        let [depths, ids] = self.cleared(r, u64::from(count) * u64::from(side) * u64::from(side));
        let axes = &layer[lamps..lamps + AXES];
        let texel_mm = axes.iter().map(|l| l.texel_mm(side)).sum::<f32>() / AXES as f32;
        let divided = self.divided.as_ref()?;
        let shift = van_der_corput(self.refined);
        let refined = match before {
            Some(_) => Some(divided.tables.samples(self.samples as usize, shift)),
            None => None,
        };
        let [x, y, z] = refined.as_ref().map_or(divided.plane_factor, |s| s.plane_factor);
        let [near_r, near_g, near_b] = divided.tables.near_light.map(|l| l as f32);
        let cube = Cube {
            head: head.index,
            size: side,
            lamps: lamps as u32,
            layers: count,
            triangles: head.head.opaque_triangles,
            samples: self.samples,
            refined: self.refined,
            fixes: self.fixes.bits(),
            has_sky: u32::from(has_even_light(frame.scene)),
            half_width_mm: divided.tables.half_width_mm as f32,
            near_start_mm: divided.tables.window_mm[0] as f32,
            near_end_mm: divided.tables.window_mm[1] as f32,
            lamp_shrink_mm: LAMP_SHRINK_TEXELS * texel_mm,
            axis_shrink_mm: AXIS_SHRINK_TEXELS * texel_mm,
            bias_mm: BIAS_TEXELS * texel_mm,
            texel_mm,
            near_light: [near_r, near_g, near_b, divided.tables.sampled_light() as f32],
            plane_factor: [x, y, z, shift as f32],
            dipole: divided.tables.dipole.unwrap_or(bytemuck::Zeroable::zeroed()),
            layer,
        };
        let cube = r.uniform("cube", &cube);
        let drawing = [
            ("cube", cube.bound()),
            ("positions", head.positions.bound()),
            ("vertices", head.head.vertices.bound()),
            ("triangles", head.head.triangles.bound()),
            ("keys", depths.bound()),
            ("ids", ids.bound()),
        ];
        let groups = [head.head.opaque_triangles.div_ceil(64).max(1), count, 1];
        for kernel in &self.draw {
            r.dispatch(kernel, &drawing, groups);
        }

        let array = |format| ImageSpec::storage([side; 2], format);
        let texels = r.image("texels", array(wgpu::TextureFormat::Rgba32Uint).layers(count));
        let seen = frame.without_picture(r);
        let lighting = frame.lighting(&seen, None);
        let params = r.uniform("shade layers", &shade::params(&lighting, head));
        let mut resources = frame.shade.resources(&lighting, head, &params);
        resources.extend([
            ("cube", cube.bound()),
            ("keys", depths.bound()),
            ("ids", ids.bound()),
            ("texels_out", texels.bound()),
        ]);
        let [x, y, _] = pixel_groups([side; 2]);
        r.dispatch(&self.light, &resources, [x, y, count]);

        let far = r.image("far light", array(wgpu::TextureFormat::Rgba16Float).layers(AXES as u32));
        let disk = match &refined {
            Some(samples) => r.gpu.storage("disk", &samples.places),
            None => divided.disk.clone(),
        };
        let mut resources = vec![
            ("cube", cube.bound()),
            ("profile", divided.profile.bound()),
            ("disk", disk.bound()),
            ("texels", texels.bound()),
            ("scattered", far.bound()),
        ];
        let kernel = match before {
            Some(before) => {
                resources.push(("before", before.bound()));
                let directional = divided.tables.dipole.is_some();
                self.refine.get_or_insert_with(|| {
                    Kernel::new(r.gpu, "scatter: disks", &gather_program(true, directional), "gather_layers")
                })
            }
            None => &self.gather,
        };
        r.dispatch(kernel, &resources, [x, y, AXES as u32]);
        let smoothed =
            r.image("smooth far light", array(wgpu::TextureFormat::Rgba16Float).layers(AXES as u32));
        let resources = [
            ("cube", cube.bound()),
            ("texels", texels.bound()),
            ("far", far.bound()),
            ("smoothed", smoothed.bound()),
        ];
        r.dispatch(&self.smooth, &resources, [x, y, AXES as u32]);
        Some(OfHead { cube, texels, far, smoothed })
    }
}
