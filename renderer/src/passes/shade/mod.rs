//! Light on what is seen: one compute dispatch a head over the visibility buffer.
//!
//! ```text
//! id, positions, frames, maps, blood, wrinkles, shadows, environment, lights
//!     --shade--> irradiance (diffuse radiance of a white surface; a = scattering strength)
//!              > albedo     (linear Rec. 709)
//!              > direct     (specular, and all of what does not scatter)
//! ```
//!
//! Theory: barycentrics and their screen derivatives from ray-plane volumes (exact under perspective); wrinkles as
//! partial-derivative normals or as differences of normals (papers/004 sections 8.2 and 8.2.1); hemoglobin and skin colour (section 7.6); Kelemen and
//! Szirmay-Kalos specular with the Beckmann distribution (papers/002, papers/004); percentage-closer soft shadows;
//! order-2 spherical harmonics and a prefiltered map for the environment; multiple-bounce ambient occlusion.
//!
//! The diffuse light of a lamp enters after the specular lobe took its share, and leaves towards the viewer likewise
//! (Kelemen and Szirmay-Kalos 2001, eq. 10 and 11; d'Eon and Luebke 2007, rho_dt). The albedo of skin is the reflectance
//! under an even sky seen from in front, without the surface's own reflection (`docs/color.md`), so
//!
//! ```text
//! f = albedo / pi (1 - rho(L)) (1 - rho(V)) / ((1 - mean rho) (1 - rho(normal)))
//! ```
//!
//! with rho of `directional_albedo`; the factor of V goes with the albedo, as scattering comes before it. Under an even
//! sky diffuse and specular light add up to rho(V) + albedo (1 - rho(V)) / (1 - rho(normal)), which is no more than 1 where the
//! albedo leaves room for rho(normal).
//!
//! Specular occlusion: the share of the lobe inside the cone of ambient visibility, which leans towards the viewer
//! (`specular_visibility`; `docs/occlusion.md`); for the environment and for lamps without a shadow map.
//!
//! Highlights of skin may have two lobes ([`SpecularMethod`]): D is their mix, so energy is that of the mix of tables.
//!
//! Differs from the sources: slope variance that minification hides widens the Beckmann lobe (Toksvig 2005), and so
//! does the size of a lamp; the iris is lit as a bowl behind a refracting cornea.
//!
//! Transmittance (papers/004 ch. 5): light through thin parts from shadow maps and T(s), added to the diffuse light that
//! is scattered next. Differs from the source: it sums the profile over what the light shines on around its ray, the
//! integral of eq. 5.8 with the surface that the shadow map holds, so tilt, thickness and the edges of thin parts need
//! no guess (no reversed normal, no 0.3 wrap, no shrinking); what the camera sees is left to `scatter`. Lamps without
//! shadows transmit nothing. For the environment, which has no shadow map, a lamp behind the surface tells the
//! thickness; where none shines from behind the head, `frame` places a dark one there.
//!
//! Eyes, teeth and the lining of the mouth scatter light too, but not in `scatter`, whose profile is that of skin: their
//! shadows are means over a disc as wide as light spreads in them (`spread_shadow`; the spread is about one over the
//! reduced scattering coefficient: Bashkatov et al. 2010 for sclera, Fried et al. 1995 for enamel and dentine), which is
//! all that a slab a few millimetres thick shows of it. How near lids and lips are is measured along the picture, so what
//! they hide from outside its border does not darken.
//!
//! Tears along the lower lid are a strip whose normal turns from the ball to the lid, so a line in it mirrors each lamp.
//! The iris is lit as the bowl on which the cornea gathers light, brightest opposite of a lamp's reflection; pigment,
//! vessels, caruncle, papillae and patches of the lining are noise of texture coordinates, made for the default head.
//!
//! Does not: reflect one part of the head in another; carry light between parts of an eye or the mouth.

pub(crate) mod directional_albedo;
#[cfg(test)]
mod tests;

use glam::{Mat4, Vec3, Vec4};
use rubor_rig::skin::profile::Profile;
use rubor_rig::skin::transmittance::TransmittanceTable;

use crate::environment::Environment;
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;
use crate::passes::appearance::Blended;
use crate::passes::shadow::LightView;
use crate::scene::{Light, LightKind, MAX_LIGHTS};
use crate::settings::{SpecularMethod, WrinkleMethod};

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/math.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("../../shared/light.wgsl"),
    include_str!("shade.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("mouth.wgsl"),
    include_str!("micro.wgsl")
);

/// WGSL of the pass that lights points of the surface.
pub(crate) const SAMPLES_SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/math.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("../../shared/light.wgsl"),
    include_str!("shade.wgsl"),
    include_str!("eye.wgsl"),
    include_str!("mouth.wgsl"),
    include_str!("micro.wgsl"),
    include_str!("light_samples.wgsl")
);

/// Entries of T(s): a step of 0.03 mm for skin.
const TRANSMITTANCE_ENTRIES: usize = 256;
/// Rings of the plane across a light; `TRANSMIT_RINGS` of the shader.
const RINGS: usize = 4;
/// A light as the shader reads it; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuLight {
    pub(crate) clip_from_world: Mat4,
    pub(crate) color: [f32; 4],
    pub(crate) position: [f32; 4],
    pub(crate) spot: [f32; 4],
    pub(crate) shape: [f32; 4],
    pub(crate) shadow: [f32; 4],
}

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
    pub(crate) adds_differences: u32,
    pub(crate) pupil_mm: f32,
    pub(crate) lobes: [f32; 3],
    pub(crate) mm_per_texture: f32,
    pub(crate) ring_taps_mm: [f32; RINGS],
    pub(crate) ring_ends_mm: [f32; RINGS],
    pub(crate) middle: [f32; 4],
    pub(crate) harmonics: [[f32; 4]; 9],
    pub(crate) lights: [GpuLight; MAX_LIGHTS],
}

impl GpuLight {
    /// A light with its shadow map, if it has one.
    pub(crate) fn new(light: &Light, shadow: Option<(u32, LightView)>) -> Self {
        let mut result: Self = bytemuck::Zeroable::zeroed();
        result.color = light.color_linear.extend(light.radius).to_array();
        result.spot[3] = -2.0;
        match light.kind {
            LightKind::Directional { direction } => {
                result.position = (-direction.normalize_or(Vec3::NEG_Z)).extend(0.0).to_array();
            }
            LightKind::Point { position } => result.position = position.extend(1.0).to_array(),
            LightKind::Spot { position, direction, outer_degrees, inner_degrees } => {
                result.position = position.extend(1.0).to_array();
                let outer = outer_degrees.to_radians().cos();
                result.spot = direction.normalize_or(Vec3::NEG_Z).extend(outer).to_array();
                // smoothstep needs two different edges.
                result.shape[0] = inner_degrees.to_radians().cos().max(outer + 1e-4);
            }
        }
        result.shape[1] = -1.0;
        if let Some((layer, view)) = shadow {
            result.clip_from_world = view.clip_from_world;
            result.shape[1] = layer as f32;
            result.shape[2] = view.near;
            result.shape[3] = view.far;
            result.shadow[0] = view.across;
        }
        result
    }
}

/// What the pass reads that is the same for all heads of a frame.
pub(crate) struct Lighting<'a> {
    pub(crate) view: &'a wgpu::Buffer,
    pub(crate) lights: [GpuLight; MAX_LIGHTS],
    pub(crate) shadows: &'a wgpu::TextureView,
    pub(crate) environment: Option<&'a Environment>,
    pub(crate) environment_intensity: f32,
    pub(crate) ids: &'a wgpu::TextureView,
    pub(crate) depth: &'a wgpu::TextureView,
    /// Ids and depth of the pixel's first sample, where this is not it: what looks the same there is not shaded again.
    pub(crate) first: Option<(&'a wgpu::TextureView, &'a wgpu::TextureView)>,
    pub(crate) transmittance: Option<&'a Transmittance>,
}

/// T(s) of a profile as a texture of one row.
pub(crate) struct Transmittance {
    table: wgpu::TextureView,
    thickness_max_mm: f32,
    ring_taps_mm: [f32; RINGS],
    ring_ends_mm: [f32; RINGS],
}

impl Transmittance {
    /// Samples T(s) of a profile.
    ///
    /// # Errors
    /// The profile has no finite width.
    pub(crate) fn new(gpu: &Gpu, profile: &Profile) -> Result<Self, RenderError> {
        let table = TransmittanceTable::new(profile, TRANSMITTANCE_ENTRIES, None)?;
        let mut texels: Vec<_> =
            table.values.iter().map(|t| [t[0] as f32, t[1] as f32, t[2] as f32, 1.0]).collect();
        // What is thicker than the table lets nothing through.
        if let Some(last) = texels.last_mut() {
            *last = [0.0; 4];
        }
        let size = [texels.len() as u32, 1];
        let (ring_taps_mm, ring_ends_mm) = rings(&table);
        Ok(Self {
            ring_taps_mm,
            ring_ends_mm,
            table: crate::texture::upload_half(gpu, "transmittance", size, &[vec![texels]]),
            thickness_max_mm: table.thickness_max_mm as f32,
        })
    }
}

/// Radii of taps and outer edges of rings that hold equal shares of the light that reaches a point from a plane behind
/// it, where the plane is so deep that a quarter of the farthest-reaching channel comes through; the last ring has no end.
fn rings(table: &TransmittanceTable) -> ([f32; RINGS], [f32; RINGS]) {
    // T falls, so bisect.
    let thickness_at = |share: f64| {
        let (mut low, mut high) = (0.0, table.thickness_max_mm);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if table.sample(middle).into_iter().fold(0.0, f64::max) > share {
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

/// What it reads of one head.
pub(crate) struct Shaded<'a> {
    pub(crate) index: u32,
    pub(crate) head: &'a HeadOnGpu,
    pub(crate) positions: &'a wgpu::Buffer,
    pub(crate) frames: &'a wgpu::Buffer,
    pub(crate) blended: &'a Blended,
    pub(crate) hemoglobin_scale: f32,
    pub(crate) pupil_mm: f32,
    pub(crate) wrinkles: WrinkleMethod,
    pub(crate) specular: SpecularMethod,
    pub(crate) world_from_head: Mat4,
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

/// The pipeline of the pass.
pub(crate) struct Shade {
    pipeline: wgpu::ComputePipeline,
    /// Made by the first frame that lights points of the surface.
    samples_pipeline: Option<wgpu::ComputePipeline>,
    trilinear_repeat: wgpu::Sampler,
    linear_clamp: wgpu::Sampler,
    compare: wgpu::Sampler,
    black: wgpu::TextureView,
    black_array: wgpu::TextureView,
    /// Share of an even sky that the specular lobes of a method reflect.
    directional_albedo: (SpecularMethod, wgpu::TextureView),
}

impl Shade {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let linear = wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        };
        let sampler = |d: &wgpu::SamplerDescriptor<'_>| gpu.device.create_sampler(d);
        let black = crate::texture::upload_half(gpu, "black", [1, 1], &[vec![vec![[0.0; 4]]]]);
        let specular = SpecularMethod::OneLobe;
        Self {
            directional_albedo: (specular, upload_directional_albedo(gpu, specular)),
            pipeline: gpu.compute_pipeline("shade", SHADER, "shade"),
            samples_pipeline: None,
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
            black_array: crate::texture::array_view(&black),
            black,
        }
    }

    /// Makes what the method needs.
    pub(crate) fn prepare_specular(&mut self, gpu: &Gpu, method: SpecularMethod) {
        if self.directional_albedo.0 != method {
            self.directional_albedo = (method, upload_directional_albedo(gpu, method));
        }
    }

    /// Shades the pixels that see one head into (irradiance, albedo, direct); head 0 also clears where nothing is.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        lighting: &Lighting<'_>,
        shaded: &Shaded<'_>,
        outputs: [&wgpu::TextureView; 3],
    ) {
        let maps = shaded.head.maps.as_ref();
        let params = params(lighting, shaded);
        let params = gpu.uniform("shade", &params);
        let texture = wgpu::BindingResource::TextureView;
        let environment = lighting.environment.map_or(&self.black, |e| &e.filtered);
        let shared = gpu.bind(
            "shade: frame",
            &self.pipeline,
            0,
            &[
                lighting.view.as_entire_binding(),
                params.as_entire_binding(),
                texture(lighting.ids),
                texture(lighting.shadows),
                texture(environment),
                wgpu::BindingResource::Sampler(&self.trilinear_repeat),
                wgpu::BindingResource::Sampler(&self.linear_clamp),
                wgpu::BindingResource::Sampler(&self.compare),
                texture(lighting.depth),
                texture(lighting.first.map_or(lighting.ids, |f| f.0)),
                texture(lighting.first.map_or(lighting.depth, |f| f.1)),
                texture(lighting.transmittance.map_or(&self.black, |t| &t.table)),
                texture(&self.directional_albedo.1),
            ],
        );
        let head = gpu.bind(
            "shade: head",
            &self.pipeline,
            1,
            &[
                shaded.positions.as_entire_binding(),
                shaded.head.vertices.as_entire_binding(),
                shaded.head.triangles.as_entire_binding(),
                shaded.frames.as_entire_binding(),
                texture(maps.map_or(&self.black, |m| &m.skin)),
                texture(maps.map_or(&self.black, |m| &m.gloss)),
                texture(maps.map_or(&self.black, |m| &m.slopes)),
                texture(maps.map_or(&self.black_array, |m| &m.wrinkles)),
                texture(&shaded.blended.blood),
                texture(&shaded.blended.wrinkles),
                texture(&shaded.head.skin_color),
            ],
        );
        let targets = gpu.bind("shade: targets", &self.pipeline, 2, &outputs.map(texture));
        let mut pass = timer.compute(encoder, "shade");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &shared, &[]);
        pass.set_bind_group(1, &head, &[]);
        pass.set_bind_group(2, &targets, &[]);
        let size = outputs[0].texture().size();
        pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
    }

    /// Makes what [`Shade::record_samples`] needs.
    pub(crate) fn prepare_samples(&mut self, gpu: &Gpu) {
        self.samples_pipeline
            .get_or_insert_with(|| gpu.compute_pipeline("light samples", SAMPLES_SHADER, "light_samples"));
    }

    /// Diffuse light at `count` points of a head's surface.
    pub(crate) fn record_samples(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        lighting: &Lighting<'_>,
        shaded: &Shaded<'_>,
        [samples, light]: [&wgpu::Buffer; 2],
        count: u32,
    ) {
        let Some(pipeline) = &self.samples_pipeline else { return };
        let maps = shaded.head.maps.as_ref();
        let params = gpu.uniform("light samples", &params(lighting, shaded));
        let texture = wgpu::BindingResource::TextureView;
        let sampler = wgpu::BindingResource::Sampler;
        let bind = |group: u32, resources: Vec<(u32, wgpu::BindingResource<'_>)>| {
            let entries: Vec<_> = resources
                .into_iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("light samples"),
                layout: &pipeline.get_bind_group_layout(group),
                entries: &entries,
            })
        };
        let frame = bind(
            0,
            vec![
                (0, lighting.view.as_entire_binding()),
                (1, params.as_entire_binding()),
                (2, texture(lighting.ids)),
                (3, texture(lighting.shadows)),
                (5, sampler(&self.trilinear_repeat)),
                (6, sampler(&self.linear_clamp)),
                (7, sampler(&self.compare)),
                (12, texture(&self.directional_albedo.1)),
            ],
        );
        let head = bind(
            1,
            vec![
                (0, shaded.positions.as_entire_binding()),
                (1, shaded.head.vertices.as_entire_binding()),
                (2, shaded.head.triangles.as_entire_binding()),
                (3, shaded.frames.as_entire_binding()),
                (4, texture(maps.map_or(&self.black, |m| &m.skin))),
                (5, texture(maps.map_or(&self.black, |m| &m.gloss))),
                (6, texture(maps.map_or(&self.black, |m| &m.slopes))),
                (7, texture(maps.map_or(&self.black_array, |m| &m.wrinkles))),
                (8, texture(&shaded.blended.blood)),
                (9, texture(&shaded.blended.wrinkles)),
                (10, texture(&shaded.head.skin_color)),
            ],
        );
        let data = bind(2, vec![(3, samples.as_entire_binding()), (4, light.as_entire_binding())]);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &frame, &[]);
        pass.set_bind_group(1, &head, &[]);
        pass.set_bind_group(2, &data, &[]);
        pass.dispatch_workgroups(count.div_ceil(64), 1, 1);
    }
}

fn upload_directional_albedo(gpu: &Gpu, method: SpecularMethod) -> wgpu::TextureView {
    let table = vec![vec![directional_albedo::table(method.lobes())]];
    crate::texture::upload_half(gpu, "directional albedo", directional_albedo::SIZE, &table)
}

/// Numbers of the pass for one head.
fn params(lighting: &Lighting<'_>, shaded: &Shaded<'_>) -> Params {
    let maps = shaded.head.maps.as_ref();
    Params {
        // Maps hold true depths; interreflection between pores, which is not drawn, would deepen them to the eye.
        slope_scale: 1.35,
        wrinkle_strength: 1.25,
        // Finite times finite: blood beyond its range is clamped, but NaN would not be.
        hemoglobin_scale: shaded.hemoglobin_scale.clamp(-1e6, 1e6),
        head: shaded.index,
        environment_intensity: lighting.environment_intensity,
        environment_levels: lighting.environment.map_or(1.0, |e| e.levels as f32),
        has_maps: u32::from(maps.is_some()),
        wrinkle_map_count: match shaded.wrinkles {
            WrinkleMethod::None => 0,
            WrinkleMethod::PartialDerivative | WrinkleMethod::Difference => {
                maps.map_or(0, |m| m.wrinkle_maps)
            }
        },
        is_second_sample: u32::from(lighting.first.is_some()),
        adds_differences: u32::from(shaded.wrinkles == WrinkleMethod::Difference),
        pupil_mm: shaded.pupil_mm,
        transmit_per_mm: lighting.transmittance.map_or(0.0, |t| 1.0 / t.thickness_max_mm),
        lobes: shaded.specular.lobes(),
        mm_per_texture: shaded.head.mm_per_texture,
        ring_taps_mm: lighting.transmittance.map_or([0.0; RINGS], |t| t.ring_taps_mm),
        ring_ends_mm: lighting.transmittance.map_or([0.0; RINGS], |t| t.ring_ends_mm),
        hair_color: maps.map_or([0.0; 4], |m| {
            let [r, g, b] = m.hair_color_linear;
            [r, g, b, 1.0]
        }),
        middle: middle(shaded).to_array(),
        harmonics: lighting.environment.map_or([[0.0; 4]; 9], |e| e.harmonics),
        lights: lighting.lights,
    }
}

/// The plane between the halves of a head: its dot product with a place in the world is positive on the character's left.
fn middle(shaded: &Shaded<'_>) -> Vec4 {
    let (low, high) = shaded.head.bounds;
    let left = shaded.world_from_head.transform_vector3(Vec3::X);
    let center = shaded.world_from_head.transform_point3(0.5 * (low + high));
    left.extend(-left.dot(center))
}
