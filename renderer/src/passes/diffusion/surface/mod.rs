//! `reference-surface:N`: the integral of the profile over the deformed surface.
//!
//! ```text
//! positions --CPU: stratified by area, sorted into a grid--> samples --light_samples--> light of each
//!        irradiance, depth, samples, light --gather, one batch at a time--> sums, squares --finish--> scattered
//! ```
//!
//! Theory: radiant exitance is the integral of R(|x - y|) E(y) over the surface (Jensen et al. 2001 with a diffusion
//! profile; Jimenez 2012 eq. 5.1 without the plane). E uses the frame's own lights, shadows and maps and includes light
//! that arrives from behind, across gaps or around edges, so frames with this method use no transmittance.
//!
//! Within a radius of a millimetre the surface counts as flat: there the integral is the light of a disk times E(x),
//! plus the sampled difference of E (a control variate; without it the steep centre of R would be nearly all noise).
//!
//! A directional dipole depends on the direction of each lamp and on the normals of both places, so each lamp is lit and
//! gathered by itself; the sky's light has no direction and takes the mean. Within the radius where the surface counts as flat
//! the light is that of a disk at the lamp's incidence.
//!
//! A profile is that of a half space, and a thin part passes more than it brings to that depth. Frames with `--transmit shadow-depth` therefore
//! scale what comes from samples behind the surface (whose normal looks away) by what a slab of that depth passes over what the profile
//! brings there: an evenly lit plane behind a slab gives exactly the slab's light. With other transmittance the profile holds everywhere.
//!
//! The error falls at least as 1 / sqrt(N); it is estimated from the spread of the batches.
//!
//! Does not: see skin outside of the picture's frame by more than the kernel, average light over a pixel.

use std::sync::OnceLock;

use glam::{Mat4, Vec3};
use rubor_rig::head::Material;
use rubor_rig::random::SplitMix64;
use rubor_rig::skin::profile::{Profile, RadialProfile};

use crate::device::readback::Readback;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::error::RenderError;
use crate::passes::diffusion::Needs;
use crate::passes::diffusion::bssrdf::{BSSRDF, Dipole};
use crate::passes::pixel_groups;
use crate::passes::shade::{Lit, Transmittance};
use crate::scene::PosedHead;
use crate::scene::lamp::GpuLight;
use crate::scene::view::Seen;
use crate::settings::{Quality, TransmitMethod};

#[cfg(test)]
mod tests;

/// Samples per batch.
pub(crate) const BATCH: usize = 65_536;
/// Entries of the table of R.
const ENTRIES: usize = 4096;
/// Share of the widest channel's light inside of the kernel.
const COVERAGE: f64 = 0.9999;
/// Radius inside of which the surface counts as flat, mm; ears and lids are thicker.
const NEAR_MM: f64 = 1.0;
/// Strength from which a pixel counts as bare skin. Under hair strength is lower: kernels are narrow there, few samples
/// hit them, and the remaining noise is not that of skin.
pub const BARE_SKIN: f32 = 0.5;
/// Cells of the grid per radius of the kernel.
const CELLS_PER_RADIUS: f32 = 2.0;
/// Largest number of cells of a grid; larger grids get larger cells.
const MOST_CELLS: f32 = 4e6;

const SHADER: Module = module!("reference_surface", "surface.wesl");

const NORMALS: Module = module!("surface_normals", "normals.wesl");

/// Intervals of the cosine of incidence in `Params::near_by_cosine`.
const COSINES: usize = 32;

/// The shader of the passes, for a profile or a BSSRDF that knows the direction of light, or for a profile and slabs.
pub(crate) fn program(directional: bool, slab: bool) -> Program {
    let program = Program::new(SHADER).with(&[BSSRDF]).flag("directional", directional);
    program.flag("slab", slab).flag("with_normals", directional || slab)
}

/// Whether light through thin parts is that of slabs: a BSSRDF that knows the direction of light has its own.
fn takes_slabs(quality: &Quality) -> bool {
    quality.transmit == TransmitMethod::ShadowDepth && quality.profile.directional().is_none()
}

/// Whether light of samples has to come with their normals.
pub(crate) fn needs_normals(quality: &Quality) -> bool {
    takes_slabs(quality) || quality.profile.directional().is_some()
}

/// The shader of the normals.
pub(crate) fn normals_program() -> Program {
    Program::new(NORMALS)
}

/// Size of the picture with its margin relative to the picture, for light that scatters in from outside.
const PICTURE_MARGIN: f32 = 1.25;

/// Requirements on the frame: the integral needs backs and the margin, and includes the light through thin parts.
pub(crate) const NEEDS: Needs =
    Needs { backs: true, margin: PICTURE_MARGIN, transmittance: false, before_view: false };

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) origin: [f32; 3],
    pub(crate) head: u32,
    pub(crate) cells: [u32; 3],
    pub(crate) cell_mm: f32,
    pub(crate) half_width_mm: f32,
    pub(crate) near_mm: f32,
    pub(crate) sample_mm2: f32,
    pub(crate) batches: f32,
    pub(crate) near_light: [f32; 4],
    pub(crate) lamp: [f32; 4],
    pub(crate) light_index: u32,
    pub(crate) light_count: u32,
    pub(crate) padding: [u32; 2],
    pub(crate) slab: [f32; 4],
    pub(crate) dipole: Dipole,
    pub(crate) near_by_cosine: [[f32; 4]; COSINES + 1],
}

/// A light of a batch: all of it, one lamp, or the sky.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a> {
    /// The light of pixels under it alone.
    pub(crate) lit: &'a Lit,
    /// The lamp, for light that has a direction.
    pub(crate) lamp: Option<&'a GpuLight>,
    /// Its place in the list of lights, and their number.
    pub(crate) index: [u32; 2],
}

/// A sample as the shaders read it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct SurfaceSample {
    pub(crate) place: [f32; 4],
    pub(crate) barycentric: [f32; 4],
}

/// Skin triangles of a head that can contribute to the picture.
pub(crate) struct Skin {
    /// Index in the head's list, and corners in world space, metres.
    triangles: Vec<(u32, [Vec3; 3])>,
    /// Sums of areas up to and with each triangle, mm^2.
    area_mm2: Vec<f64>,
    origin: Vec3,
    size: Vec3,
}

/// A batch of samples, sorted by cell.
pub(crate) struct Batch {
    pub(crate) samples: Vec<SurfaceSample>,
    pub(crate) starts: Vec<u32>,
}

/// The grid of a head.
#[derive(Clone, Copy)]
struct Grid {
    cells: [u32; 3],
    cell_mm: f32,
}

impl Skin {
    /// Chooses triangles (three vertices and a material each) that are in the picture or so near to it that light
    /// scatters in from.
    pub(crate) fn new(
        triangles: &[[u32; 4]],
        point_of_vertex: &[u32],
        points: &[Vec3],
        clip_from_world: &Mat4,
    ) -> Self {
        let skin = Material::Skin.number();
        // All corners beyond one side of the widened picture, and in front of the camera.
        let is_outside = |corners: &[Vec3; 3]| {
            let c = corners.map(|p| *clip_from_world * p.extend(1.0));
            let beyond =
                |f: &dyn Fn(glam::Vec4) -> f32| c.iter().all(|c| c.w > 0.0 && f(*c) > PICTURE_MARGIN * c.w);
            beyond(&|c| c.x) || beyond(&|c| -c.x) || beyond(&|c| c.y) || beyond(&|c| -c.y)
        };
        let mut chosen = Vec::new();
        let (mut area_mm2, mut sum) = (Vec::new(), 0.0);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (i, t) in triangles.iter().enumerate().filter(|(_, t)| t[3] == skin) {
            let corners = [t[0], t[1], t[2]].map(|v| points[point_of_vertex[v as usize] as usize]);
            if is_outside(&corners) {
                continue;
            }
            let cross = (corners[1] - corners[0]).as_dvec3().cross((corners[2] - corners[0]).as_dvec3());
            sum += 0.5e6 * cross.length();
            chosen.push((i as u32, corners));
            area_mm2.push(sum);
            for c in corners {
                (low, high) = (low.min(c), high.max(c));
            }
        }
        Self { triangles: chosen, area_mm2, origin: low, size: high - low }
    }

    /// Area, mm^2.
    fn total_mm2(&self) -> f64 {
        self.area_mm2.last().copied().unwrap_or(0.0)
    }

    fn grid(&self, half_width_mm: f32) -> Grid {
        let mut cell_mm = half_width_mm / CELLS_PER_RADIUS;
        let most = (1e3 * self.size + cell_mm) / cell_mm;
        cell_mm *= (most.x * most.y * most.z / MOST_CELLS).cbrt().max(1.0);
        let cells = (1e3 * self.size / cell_mm).floor().as_uvec3() + 1;
        Grid { cells: cells.to_array(), cell_mm }
    }

    /// Samples of batch number `batch`: evenly along the sum of areas, so that each triangle has its share to within
    /// one sample, at random places of the triangle.
    fn batch(&self, batch: u32, count: usize, grid: &Grid) -> Batch {
        let mut random = SplitMix64(0x9E37_79B9_7F4A_7C15 ^ (u64::from(batch) << 32));
        let step = self.total_mm2() / count as f64;
        let shift = random.uniform();
        let mut triangle = 0;
        let mut cells = Vec::with_capacity(count);
        let mut unsorted = Vec::with_capacity(count);
        for i in 0..count {
            let at = (i as f64 + shift) * step;
            while triangle + 1 < self.triangles.len() && self.area_mm2[triangle] < at {
                triangle += 1;
            }
            let (index, corners) = self.triangles[triangle];
            // Uniform over the triangle: the square folded along its diagonal.
            let (mut u, mut v) = (random.uniform() as f32, random.uniform() as f32);
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let world = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]);
            let mm = 1e3 * (world - self.origin);
            let cell: [u32; 3] =
                std::array::from_fn(|a| ((mm[a] / grid.cell_mm).max(0.0) as u32).min(grid.cells[a] - 1));
            cells.push((cell[2] * grid.cells[1] + cell[1]) * grid.cells[0] + cell[0]);
            unsorted.push(SurfaceSample {
                place: [mm.x, mm.y, mm.z, f32::from_bits(index)],
                barycentric: [u, v, 0.0, 0.0],
            });
        }
        let cell_count = grid.cells.iter().product::<u32>() as usize;
        let mut starts = vec![0u32; cell_count + 1];
        for c in &cells {
            starts[*c as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut samples: Vec<SurfaceSample> = vec![bytemuck::Zeroable::zeroed(); count];
        for (c, s) in cells.iter().zip(&unsorted) {
            samples[next[*c as usize] as usize] = *s;
            next[*c as usize] += 1;
        }
        Batch { samples, starts }
    }
}

/// Share of the light of a profile beyond the radii of its table.
fn beyond(profile: &Profile, half_width_mm: f64) -> Vec<[f32; 4]> {
    let of = |i: usize| {
        let x = i as f64 / (ENTRIES - 1) as f64;
        let light = |c: &RadialProfile| (c.mass_beyond(half_width_mm * x * x) / c.total()) as f32;
        let [r, g, b] = profile.channels.each_ref().map(light);
        [r, g, b, 0.0]
    };
    (0..ENTRIES).map(of).collect()
}

/// The passes and sums of one sample of a frame.
pub(crate) struct Surface {
    gather: Kernel,
    finish: Kernel,
    profile: wgpu::Buffer,
    half_width_mm: f64,
    near_light: [f32; 4],
    directional: Option<Directional>,
    /// Light of the profile beyond radii, and slabs, where thin parts pass what slabs do.
    slabs: Option<(wgpu::Buffer, Transmittance)>,
    clamped: wgpu::Sampler,
    normals: OnceLock<Image>,
    sums: wgpu::Buffer,
    squares: wgpu::Buffer,
}

/// A BSSRDF that knows the direction of the light.
struct Directional {
    dipole: Dipole,
    near_by_cosine: [[f32; 4]; COSINES + 1],
    /// Sums of a batch over its lights so far.
    batch_sums: wgpu::Buffer,
}

impl Surface {
    /// The passes for the profile of a quality and a picture.
    ///
    /// # Errors
    /// A directional dipole whose channels refract differently.
    pub(crate) fn new(gpu: &Gpu, quality: &Quality, size: [u32; 2]) -> Result<Self, RenderError> {
        let profile: &Profile = &quality.profile;
        let half_width_mm = profile.channels.iter().map(|c| c.sample_radius(COVERAGE)).fold(0.0, f64::max);
        let near_mm = NEAR_MM.min(half_width_mm);
        let total = profile.total();
        let table: Vec<[f32; 4]> = (0..ENTRIES)
            .map(|i| {
                // Half an entry instead of 0, where R may be infinite.
                let x = (i as f64).max(0.5) / (ENTRIES - 1) as f64;
                let r = profile.reflectance(half_width_mm * x * x);
                let [r, g, b] = [0, 1, 2].map(|c| (r[c] / total[c]) as f32);
                [r, g, b, 0.0]
            })
            .collect();
        let near = profile.cdf(near_mm).map(|l| l as f32);
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let directional = Dipole::of(profile)?.map(|dipole| Directional {
            dipole,
            near_by_cosine: std::array::from_fn(|i| {
                let channels = profile.directional().unwrap_or_else(|| unreachable!("it has a dipole"));
                let cosine = i as f64 / COSINES as f64;
                let inside = |c: usize| (channels[c].light_inside(near_mm, cosine) / total[c]) as f32;
                [inside(0), inside(1), inside(2), 0.0]
            }),
            batch_sums: gpu.storage_zeroed("sums of a batch", 16 * pixels),
        });
        let slabs = match takes_slabs(quality) {
            true => Some((
                gpu.storage("light beyond", &beyond(profile, half_width_mm)),
                Transmittance::new(gpu, profile)?,
            )),
            false => None,
        };
        let program = program(directional.is_some(), slabs.is_some());
        Ok(Self {
            gather: Kernel::new(gpu, "reference-surface", &program, "gather"),
            finish: Kernel::new(gpu, "reference-surface", &program, "finish"),
            directional,
            slabs,
            clamped: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("linear clamp"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            normals: OnceLock::new(),
            profile: gpu.storage("profile", &table),
            half_width_mm,
            near_light: [near[0], near[1], near[2], 0.0],
            sums: gpu.storage_zeroed("sums", 16 * pixels),
            squares: gpu.storage_zeroed("squares", 16 * pixels),
        })
    }

    /// Whether lamps have to be gathered one by one.
    pub(crate) fn is_directional(&self) -> bool {
        self.directional.is_some()
    }

    /// Whether light of samples comes with their normals.
    fn has_normals(&self) -> bool {
        self.directional.is_some() || self.slabs.is_some()
    }

    /// Finds the normals of pixels, which slabs and a directional BSSRDF need before the first batch.
    pub(crate) fn record_normals(&self, r: &mut Recorder<'_>, seen: &Seen, heads: &[PosedHead<'_>]) {
        if !self.has_normals() {
            return;
        }
        let kernel = Kernel::new(r.gpu, "reference-surface", &normals_program(), "pixel_normals");
        let normals = r.image("normals", ImageSpec::light(seen.ids.size()));
        let numbers: Vec<_> = heads.iter().map(|h| r.uniform("head", &[h.index, 0, 0, 0])).collect();
        let each = heads.iter().zip(&numbers).map(|(h, number)| {
            let resources = vec![
                ("view", seen.view.bound()),
                ("head", number.bound()),
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("frames", h.tangent_frames.bound()),
                ("visible", seen.ids.bound()),
                ("normals", normals.bound()),
            ];
            (resources, pixel_groups(seen.ids.size()))
        });
        r.dispatch_each(&kernel, each);
        let _ = self.normals.set(normals);
    }

    /// Adds batch number `batch` of one head. `light` records the pass that finds the light of samples.
    pub(crate) fn record_batch(
        &self,
        r: &mut Recorder<'_>,
        (seen, part): (&Seen, Part<'_>),
        (head, skin): (u32, &Skin),
        batch: u32,
        light: &dyn Fn(&mut Recorder<'_>, &wgpu::Buffer, &wgpu::Buffer),
    ) {
        if skin.total_mm2() <= 0.0 {
            return;
        }
        let grid = skin.grid(self.half_width_mm as f32);
        let Batch { samples, starts } = skin.batch(batch, BATCH, &grid);
        let params = Params {
            origin: skin.origin.to_array(),
            head,
            cells: grid.cells,
            cell_mm: grid.cell_mm,
            half_width_mm: self.half_width_mm as f32,
            near_mm: NEAR_MM.min(self.half_width_mm) as f32,
            sample_mm2: (skin.total_mm2() / BATCH as f64) as f32,
            batches: batch as f32,
            near_light: self.near_light,
            lamp: part.lamp.map_or([0.0, 0.0, 0.0, -1.0], |l| l.position),
            light_index: part.index[0],
            light_count: part.index[1],
            padding: [0; 2],
            slab: self.slabs.as_ref().map_or([0.0; 4], |(_, slabs)| slabs.slab),
            dipole: self.directional.as_ref().map_or(bytemuck::Zeroable::zeroed(), |d| d.dipole),
            near_by_cosine: self.directional.as_ref().map_or([[0.0; 4]; COSINES + 1], |d| d.near_by_cosine),
        };
        let params = r.uniform("reference-surface", &params);
        let samples = r.gpu.storage("surface samples", &samples);
        let lights = if self.has_normals() { 2 } else { 1 };
        let sample_light = r.gpu.storage_zeroed("sample light", lights * 16 * BATCH as u64);
        let starts = r.gpu.storage("cell starts", &starts);
        light(r, &samples, &sample_light);
        let mut resources = vec![
            ("view", seen.view.bound()),
            ("params", params.bound()),
            ("visible", seen.ids.bound()),
            ("irradiance", part.lit.irradiance.bound()),
            ("albedo", part.lit.albedo.bound()),
            ("depth", seen.depth.bound()),
            ("profile", self.profile.bound()),
            ("starts", starts.bound()),
            ("samples", samples.bound()),
            ("light", sample_light.bound()),
            ("sums", self.sums.bound()),
            ("squares", self.squares.bound()),
        ];
        if let Some(directional) = &self.directional {
            resources.push(("batch_sums", directional.batch_sums.bound()));
        }
        resources.extend(self.normals.get().map(|n| ("normals", n.bound())));
        if let Some((beyond, slabs)) = &self.slabs {
            resources.extend([
                ("beyond", beyond.bound()),
                ("slabs", slabs.slabs.bound()),
                ("linear_clamp", self.clamped.bound()),
            ]);
        }
        r.dispatch(&self.gather, &resources, pixel_groups(seen.ids.size()));
    }

    /// The mean of all batches; unscattered pixels keep their light.
    pub(crate) fn record_finish(&self, r: &mut Recorder<'_>, seen: &Seen, lit: &Lit) -> Image {
        let size = lit.irradiance.size();
        let scattered = r.image("scattered", ImageSpec::light(size));
        let resources = [
            ("view", seen.view.bound()),
            ("irradiance", lit.irradiance.bound()),
            ("sums", self.sums.bound()),
            ("scattered", scattered.bound()),
        ];
        r.dispatch(&self.finish, &resources, pixel_groups(size));
        scattered
    }

    /// Copies of the sums and of the sums of squares, for [`relative_noise`].
    pub(crate) fn read_sums(&self, r: &mut Recorder<'_>) -> [Readback; 2] {
        [&self.sums, &self.squares].map(|buffer| Readback::of_buffer(r.gpu, r.encoder, buffer))
    }
}

/// Root mean square standard error of the mean over that of the result, all channels of all pixels of bare skin; `None`
/// from fewer than two batches.
///
/// # Errors
/// The device failed.
pub(crate) async fn relative_noise([sums, squares]: [Readback; 2]) -> Result<Option<f64>, RenderError> {
    let sums: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&sums.read().await?);
    let squares: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&squares.read().await?);
    let (mut error, mut signal) = (0.0, 0.0);
    for (s, q) in sums.iter().zip(&squares) {
        let n = f64::from(s[3]);
        // The fourth sum of squares is that of the strength.
        if n < 2.0 || f64::from(q[3]) < f64::from(BARE_SKIN) * n {
            continue;
        }
        for c in 0..3 {
            let mean = f64::from(s[c]) / n;
            let variance = (f64::from(q[c]) / n - mean * mean).max(0.0) / (n - 1.0);
            error += variance;
            signal += mean * mean;
        }
    }
    Ok((signal > 0.0).then(|| (error / signal).sqrt()))
}
