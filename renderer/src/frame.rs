//! A frame: every pass, in order, and the images between them.

use std::sync::Arc;

use glam::{Mat4, Vec3};
use rubor_rig::skin::profile::Profile;
use serde::Serialize;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::head::{GpuVertex, HeadOnGpu};
use crate::pass_timer::{FrameLog, FrameTimes, PassTimer};
use crate::passes::antialias::{self, Antialias, History};
use crate::passes::appearance::{Appearance, Blended};
use crate::passes::compose::Compose;
use crate::passes::cropped_hair::CroppedHair;
use crate::passes::display::Display;
use crate::passes::fibre::Fibre;
use crate::passes::morph::Morph;
use crate::passes::overlay::{Overlaid, Overlay};
use crate::passes::scatter::surface::{self, Skin, Surface};
use crate::passes::scatter::{Images, Recorder, Scatter};
use crate::passes::shade::{Lighting, Shade, Shaded, Transmittance};
use crate::passes::shadow::Shadow;
use crate::passes::surface_frames::{FRAME_BYTES, SurfaceFrames};
use crate::passes::velocity::{Moving, Velocity};
use crate::passes::visibility::Visibility;
use crate::placement::{
    PICTURE_MARGIN, average_light, lamps, pixels_per_mm, place_lights, receivers, view, world_from_head,
};
use crate::scene::{MAX_HEADS, MAX_LIGHTS, Scene};
use crate::settings::{ColorMethod, Quality, ScatterMethod, Settings, TransmitMethod};
use crate::targets::Targets;

/// An image of the frame, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA, sRGB transfer, opaque.
    pub rgba: Vec<u8>,
}

/// What a frame cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameStats {
    /// GPU milliseconds of each pass, in order; empty where the adapter has no timestamps.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// Triangles of all heads.
    pub triangles: u64,
    /// Bytes of heads, buffers and images on the device.
    pub memory_bytes: u64,
    /// Relative standard error of the diffuse light, for `reference-surface`.
    pub scatter_noise: Option<f64>,
}

/// Frames that [`Renderer::measure`] hands to the device before it waits: enough to keep it busy.
const FRAMES_IN_FLIGHT: usize = 3;

/// The view as view.wgsl reads it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct View {
    pub(crate) clip_from_world: Mat4,
    pub(crate) previous_clip_from_world: Mat4,
    pub(crate) origin: [f32; 4],
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    pub(crate) size: [u32; 2],
    pub(crate) head_count: u32,
    pub(crate) has_environment: u32,
    pub(crate) jitter: [f32; 2],
    pub(crate) near: f32,
    pub(crate) light_count: u32,
    pub(crate) shading_jitter: [f32; 2],
    pub(crate) depth_origin_mm: f32,
    pub(crate) padding: f32,
}

/// Draws scenes. Keeps pipelines, and images of the last size, between frames; nothing else carries over.
pub struct Renderer {
    gpu: Gpu,
    morph: Morph,
    surface_frames: SurfaceFrames,
    appearance: Appearance,
    shadow: Shadow,
    visibility: Visibility,
    shade: Shade,
    scatter: Scatter,
    compose: Compose,
    fibre: Fibre,
    cropped_hair: CroppedHair,
    overlay: Overlay,
    display: Display,
    velocity: Velocity,
    antialias: Option<Antialias>,
    transmittance: Option<(Arc<Profile>, Transmittance)>,
    targets: Option<Targets>,
    instances: Vec<Instance>,
    timer: PassTimer,
    /// Whether the last frame's diffuse light is in `scattered` (or unscattered in `irradiance`).
    is_scattered: bool,
    /// What antialiasing over time remembers: the only thing that one frame leaves to the next.
    past: Past,
}

/// The previous frame.
#[derive(Default)]
struct Past {
    history: Option<History>,
    clip_from_world: Option<Mat4>,
    frames: u64,
}

/// Buffers of one head of a scene.
struct Instance {
    positions: wgpu::Buffer,
    previous_positions: wgpu::Buffer,
    frames: wgpu::Buffer,
    blended: Blended,
}

impl Renderer {
    /// Compiles the passes.
    ///
    /// # Errors
    /// The device refused a pipeline.
    pub fn new(gpu: Gpu) -> Result<Self, RenderError> {
        let renderer = Self {
            morph: Morph::new(&gpu),
            surface_frames: SurfaceFrames::new(&gpu),
            appearance: Appearance::new(&gpu),
            shadow: Shadow::new(&gpu),
            visibility: Visibility::new(&gpu),
            shade: Shade::new(&gpu),
            scatter: Scatter::default(),
            compose: Compose::new(&gpu),
            fibre: Fibre::new(&gpu),
            cropped_hair: CroppedHair::new(&gpu),
            overlay: Overlay::new(&gpu),
            display: Display::new(&gpu),
            velocity: Velocity::new(&gpu),
            antialias: None,
            transmittance: None,
            targets: None,
            instances: Vec::new(),
            timer: PassTimer::new(&gpu),
            is_scattered: false,
            past: Past::default(),
            gpu,
        };
        renderer.gpu.check()?;
        Ok(renderer)
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Forgets the previous frame: call it at a cut, so that antialiasing over time mixes nothing into the next one.
    /// `frame` is the number of the next frame: even and odd ones have their samples at other places.
    pub fn cut(&mut self, frame: u64) {
        self.past = Past { frames: frame, ..Past::default() };
    }

    /// Draws a scene and waits for the picture. Frames follow one another until [`Renderer::cut`].
    ///
    /// # Errors
    /// A size, a count or a value outside the limits; the device failed.
    pub fn render(
        &mut self,
        scene: &Scene<'_>,
        settings: &Settings,
    ) -> Result<(Image, FrameStats), RenderError> {
        self.prepare(scene, settings)?;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let scatter_noise = self.record_frame(&mut encoder, scene, settings)?;
        self.gpu.queue.submit([encoder.finish()]);
        let Some(targets) = &self.targets else { return Err(RenderError::Lost("no images".into())) };
        let image =
            if self.antialias.is_some() { &targets.image } else { targets.samples[0].displayed.texture() };
        let rgba = self.gpu.read_texture(image)?;
        let stats = FrameStats {
            passes_ms: self.timer.read(&self.gpu)?,
            scatter_noise,
            triangles: scene
                .heads
                .iter()
                .map(|h| u64::from(h.head.opaque_triangles + h.head.overlay_triangles))
                .sum(),
            memory_bytes: self.memory_bytes(scene),
        };
        Ok((Image { width: settings.output.size[0], height: settings.output.size[1], rgba }, stats))
    }

    /// Draws a scene `frames` times, one frame right after the other and without reading any picture, and says what each
    /// cost; the first `warm_up` of them are left out. Empty where the adapter has no timestamps.
    ///
    /// # Errors
    /// As [`Renderer::render`]; `reference-surface`, which is not drawn in one go.
    pub fn measure(
        &mut self,
        scene: &Scene<'_>,
        settings: &Settings,
        warm_up: u32,
        frames: u32,
    ) -> Result<Vec<FrameTimes>, RenderError> {
        if let ScatterMethod::ReferenceSurface(_) = settings.quality.scatter {
            return Err(RenderError::Limit {
                what: "method to measure",
                found: settings.quality.scatter.to_string(),
                expected: "one that draws a frame in one go".into(),
            });
        }
        self.prepare(scene, settings)?;
        let mut log = FrameLog::new(&self.gpu, frames);
        let mut submissions = std::collections::VecDeque::new();
        for frame in 0..warm_up + frames {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.record_frame(&mut encoder, scene, settings)?;
            if frame >= warm_up {
                self.timer.append(&mut encoder, &mut log);
            }
            submissions.push_back(self.gpu.queue.submit([encoder.finish()]));
            if submissions.len() > FRAMES_IN_FLIGHT {
                self.gpu.wait(submissions.pop_front())?;
            }
        }
        log.read(&self.gpu)
    }

    /// Bytes of heads, buffers and images of the last frame.
    fn memory_bytes(&self, scene: &Scene<'_>) -> u64 {
        self.targets.as_ref().map_or(0, Targets::bytes)
            + self.antialias.as_ref().map_or(0, Antialias::memory_bytes)
            + self.past.history.as_ref().map_or(0, History::memory_bytes)
            + scene.heads.iter().map(|h| h.head.memory_bytes).sum::<u64>()
    }

    /// Checks a scene and makes what its frames need.
    fn prepare(&mut self, scene: &Scene<'_>, settings: &Settings) -> Result<(), RenderError> {
        self.check(scene, settings)?;
        let lamps = lamps(scene, settings);
        let shadow_layers = lamps.iter().filter(|l| l.casts_shadow).count() as u32;
        if !self.targets.as_ref().is_some_and(|t| t.matches(settings, shadow_layers)) {
            self.targets = Some(Targets::new(&self.gpu, settings, shadow_layers));
            self.antialias = None;
            self.past = Past { frames: self.past.frames, ..Past::default() };
        }
        if settings.antialias().mode == antialias::Mode::None {
            self.antialias = None;
        } else if self.antialias.as_ref().is_none_or(|a| *a.settings() != settings.antialias()) {
            let format = wgpu::TextureFormat::Rgba8Unorm;
            self.antialias =
                Some(Antialias::new(&self.gpu, &settings.antialias(), settings.output.size, format)?);
        }
        self.fit_instances(scene);
        self.scatter.prepare(&self.gpu, settings.quality.scatter, settings.quality.profile.shared())?;
        if settings.quality.transmit == TransmitMethod::ShadowDepth
            && self.transmittance.as_ref().is_none_or(|(p, _)| *p != *settings.quality.profile.shared())
        {
            let table = Transmittance::new(&self.gpu, settings.quality.profile.shared())?;
            self.transmittance = Some((settings.quality.profile.shared().clone(), table));
        }
        self.shade.prepare_specular(&self.gpu, settings.quality.specular);
        if matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_)) {
            self.shade.prepare_samples(&self.gpu);
        }
        self.is_scattered = settings.quality.scatter != ScatterMethod::None;
        Ok(())
    }

    /// Deformed points of the first head of the last frame, world space, metres.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_positions(&self) -> Result<Vec<Vec3>, RenderError> {
        let Some(instance) = self.instances.first() else { return Ok(Vec::new()) };
        let bytes = self.gpu.read_buffer(&instance.positions)?;
        let points: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(points.into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect())
    }

    /// Ambient visibility of each point of the first head of the last frame.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_occlusion(&self) -> Result<Vec<f32>, RenderError> {
        let Some(instance) = self.instances.first() else { return Ok(Vec::new()) };
        let bytes = self.gpu.read_buffer(&instance.positions)?;
        let points: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(points.into_iter().map(|p| p[3]).collect())
    }

    /// Linear radiance of the last frame (of its last sample), RGB and coverage, rows from the top.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_hdr(&self) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some(targets) = &self.targets else { return Ok(Vec::new()) };
        let bytes = self.gpu.read_texture(targets.hdr.texture())?;
        let halves: Vec<[half::f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(halves.into_iter().map(|t| t.map(half::f16::to_f32)).collect())
    }

    /// Motion of each pixel since the previous frame in pixels, x right, y down; rows from the top. Empty unless the
    /// last frame kept a history.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_velocity(&self) -> Result<Vec<[f32; 2]>, RenderError> {
        let Some(velocity) = self.targets.as_ref().and_then(|t| t.velocity.as_ref()) else {
            return Ok(Vec::new());
        };
        let bytes = self.gpu.read_texture(velocity.texture())?;
        let halves: Vec<[half::f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(halves.into_iter().map(|t| [t[0].to_f32(), t[1].to_f32()]).collect())
    }

    /// Normal and tangent (w = sign of the bitangent) of each vertex of the first head of the last frame, world space.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_surface_frames(&self) -> Result<Vec<(Vec3, glam::Vec4)>, RenderError> {
        let Some(instance) = self.instances.first() else { return Ok(Vec::new()) };
        let bytes = self.gpu.read_buffer(&instance.frames)?;
        let frames: Vec<[f32; 8]> = bytemuck::pod_collect_to_vec(&bytes);
        let frame = |f: [f32; 8]| (Vec3::new(f[0], f[1], f[2]), glam::Vec4::new(f[4], f[5], f[6], f[7]));
        Ok(frames.into_iter().map(frame).collect())
    }

    /// Linear Rec. 709 albedo of the skin of the last frame (of its last sample), less what the surface turns back at this
    /// angle; 0 elsewhere; a = 1 on skin. Rows from the top.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_albedo(&self) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some(targets) = &self.targets else { return Ok(Vec::new()) };
        let bytes = self.gpu.read_texture(targets.albedo.texture())?;
        let halves: Vec<[half::f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(halves.into_iter().map(|t| t.map(half::f16::to_f32)).collect())
    }

    /// Diffuse light of the last frame before albedo: linear radiance of a white surface, a = scattering strength.
    /// Rows from the top; with supersampling, the frame's own pixels.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_diffuse(&self) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some(targets) = &self.targets else { return Ok(Vec::new()) };
        let image = if self.is_scattered { &targets.scattered } else { &targets.irradiance };
        let read = |image: &wgpu::TextureView| -> Result<Vec<[half::f16; 4]>, RenderError> {
            Ok(bytemuck::pod_collect_to_vec(&self.gpu.read_texture(image.texture())?))
        };
        let (light, strength) = (read(image)?, read(&targets.albedo)?);
        let pixel =
            |([r, g, b, _], [.., a]): ([half::f16; 4], [half::f16; 4])| [r, g, b, a].map(half::f16::to_f32);
        Ok(light.into_iter().zip(strength).map(pixel).collect())
    }

    fn check(&self, scene: &Scene<'_>, settings: &Settings) -> Result<(), RenderError> {
        let limit = |what, found: String, expected: String| Err(RenderError::Limit { what, found, expected });
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        let [w, h] = settings.output.size;
        if w == 0 || h == 0 || w > most || h > most {
            let expected = format!("1x1 to {most}x{most} on {}", self.gpu.info.name);
            return limit("image size", format!("{w}x{h}"), expected);
        }
        settings.validate()?;
        let n = settings.samples_per_side();
        if n == 0 || n > 64 || w * n > most || h * n > most {
            let expected = format!("1 to 8, and a frame of at most {most} pixels on a side");
            return limit("supersampling", n.to_string(), expected);
        }
        if settings.quality.shadow_size < 16 || settings.quality.shadow_size > most {
            return limit(
                "shadow map size",
                settings.quality.shadow_size.to_string(),
                format!("16 to {most}"),
            );
        }
        if scene.heads.len() > MAX_HEADS {
            return limit("number of heads", scene.heads.len().to_string(), format!("at most {MAX_HEADS}"));
        }
        if scene.lights.len() > MAX_LIGHTS {
            return limit(
                "number of lights",
                scene.lights.len().to_string(),
                format!("at most {MAX_LIGHTS}"),
            );
        }
        let c = scene.camera;
        if !(c.fov_degrees > 0.0 && c.fov_degrees < 170.0) {
            return limit(
                "field of view",
                format!("{} degrees", c.fov_degrees),
                "above 0 and below 170".into(),
            );
        }
        if !c.view_from_world().is_finite() {
            let expected = "a finite position and a target apart from it".into();
            return limit("camera", format!("{} looking at {}", c.position, c.target), expected);
        }
        for head in scene.heads {
            let (found, expected) = (head.state.shapes.len(), head.head.shape_count);
            if found != expected {
                return limit(
                    "number of shape weights",
                    found.to_string(),
                    format!("{expected}, one a shape"),
                );
            }
            let numbers = [&head.state.shapes, &head.state.zones, &head.state.distributions];
            if numbers.iter().any(|n| n.iter().any(|w| !w.is_finite()))
                || !(head.state.hemoglobin_scale + head.state.pupil_mm).is_finite()
            {
                return limit("face state", "a weight that is not finite".into(), "finite weights".into());
            }
        }
        Ok(())
    }

    fn fit_instances(&mut self, scene: &Scene<'_>) {
        let gpu = &self.gpu;
        for (i, head) in scene.heads.iter().enumerate() {
            let points = u64::from(head.head.point_count) * 16;
            let frames = u64::from(head.head.vertex_count) * FRAME_BYTES;
            let wrinkle_maps = head.head.maps.as_ref().map_or(0, |m| m.wrinkle_maps);
            let fits = |n: &Instance| {
                n.positions.size() == points && n.frames.size() == frames && n.blended.fits(wrinkle_maps)
            };
            if self.instances.get(i).is_some_and(fits) {
                continue;
            }
            let instance = Instance {
                positions: gpu.storage_zeroed("positions", points),
                previous_positions: gpu.storage_zeroed("previous positions", points),
                frames: gpu.storage_zeroed("surface frames", frames),
                blended: Blended::new(gpu, wrinkle_maps),
            };
            self.instances.truncate(i);
            self.instances.push(instance);
            self.past = Past { frames: self.past.frames, ..Past::default() };
        }
    }

    /// Every pass of a frame, in order.
    fn record_frame(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &Scene<'_>,
        settings: &Settings,
    ) -> Result<Option<f64>, RenderError> {
        let (gpu, timer) = (&self.gpu, &mut self.timer);
        let Some(targets) = &self.targets else { return Ok(None) };
        let mut scatter_noise = None;
        let transmittance = match (settings.quality.transmit, settings.quality.scatter) {
            // The integral over the surface holds the light from behind.
            (TransmitMethod::None, _) | (_, ScatterMethod::ReferenceSurface(_)) => None,
            (TransmitMethod::ShadowDepth, _) => self.transmittance.as_ref().map(|(_, t)| t),
        };
        timer.restart();
        let heads: Vec<(&HeadOnGpu, &Instance)> =
            scene.heads.iter().map(|h| h.head).zip(&self.instances).collect();
        let drawn: Vec<_> = heads.iter().map(|(h, i)| (*h, &i.positions)).collect();

        for (instance, (head, buffers)) in scene.heads.iter().zip(&heads) {
            let weights = gpu.storage("shape weights", &instance.state.shapes);
            let place = world_from_head(instance);
            self.morph.record(gpu, encoder, timer, head, place, &weights, &buffers.positions);
            self.surface_frames.record(gpu, encoder, timer, head, &buffers.positions, &buffers.frames);
            if let Some(maps) = &head.maps {
                let state = instance.state;
                let distributions: &[f32] = match settings.quality.color {
                    ColorMethod::Static => &[],
                    ColorMethod::Hemoglobin => &state.distributions,
                };
                let zones = &state.zones;
                self.appearance.record(gpu, encoder, timer, maps, distributions, zones, &buffers.blended);
            }
        }

        let lamps = &lamps(scene, settings);
        let (lights, layers) = place_lights(scene, lamps, &targets.shadows, &receivers(scene, settings));
        for (light, layer) in &layers {
            self.shadow.record(gpu, encoder, timer, light, &drawn, layer);
        }
        let shadows = crate::texture::array_view_of(&targets.shadows);

        let subsamples = settings.antialias().mode.subsamples(self.past.frames);
        let share = 1.0 / subsamples.len() as f32;
        let shading_jitter = subsamples
            .iter()
            .fold([0.0; 2], |sum, s| [sum[0] - share * s.position_px[0], sum[1] - share * s.position_px[1]]);
        for (sample, subsample) in targets.samples.iter().zip(subsamples) {
            let first = &targets.samples[0];
            // A camera reaches a place in the pixel by moving the image the other way.
            let jitter = subsample.position_px.map(|p| -p);
            let jitters = [jitter, shading_jitter];
            let view = view(scene, lamps, targets.size, jitters, self.past.clip_from_world);
            let pixels_per_mm = pixels_per_mm(scene, &view);
            let view = gpu.uniform("view", &view);
            self.visibility.record(gpu, encoder, timer, &view, &drawn, &sample.ids, &sample.depth);

            let lighting = Lighting {
                view: &view,
                lights,
                shadows: &shadows,
                environment: scene.environment,
                environment_intensity: scene.environment_intensity,
                ids: &sample.ids,
                depth: &sample.depth,
                transmittance,
                first: (!std::ptr::eq(sample, first)).then_some((&first.ids, &first.depth)),
            };
            let outputs = [&targets.irradiance, &targets.albedo, &targets.direct];
            for (index, (instance, (head, buffers))) in scene.heads.iter().zip(&heads).enumerate() {
                let shaded = shaded(index, instance, head, buffers, &settings.quality);
                self.shade.record(gpu, encoder, timer, &lighting, &shaded, outputs);
            }

            let images = Images {
                irradiance: &targets.irradiance,
                albedo: &targets.albedo,
                depth: &sample.depth,
                scratch: &targets.scratch,
                scattered: &targets.scattered,
            };
            let diffuse = match settings.quality.scatter {
                ScatterMethod::ReferenceSurface(batches) => {
                    let integral = Surface::new(gpu, settings.quality.profile.shared(), targets.size);
                    let inputs = surface::Inputs {
                        view: &view,
                        ids: &sample.ids,
                        irradiance: &targets.irradiance,
                        albedo: &targets.albedo,
                        depth: &sample.depth,
                        scattered: &targets.scattered,
                    };
                    // The sums need the light of this frame: the device works on it while samples are drawn.
                    let fresh = gpu.device.create_command_encoder(&Default::default());
                    gpu.queue.submit([std::mem::replace(encoder, fresh).finish()]);
                    let appearance = &settings.quality;
                    integrate(
                        gpu,
                        &self.shade,
                        scene,
                        &heads,
                        &lighting,
                        &integral,
                        &inputs,
                        appearance,
                        batches,
                    )?;
                    integral.record_finish(gpu, encoder, timer, &inputs);
                    scatter_noise = integral.relative_noise(gpu)?;
                    &targets.scattered
                }
                _ => {
                    let recorder = Recorder {
                        gpu,
                        encoder: &mut *encoder,
                        timer: &mut *timer,
                        view: &view,
                        pixels_per_mm,
                    };
                    self.scatter.record(recorder, &images)
                }
            };

            let inputs = [diffuse, &targets.albedo, &targets.direct, &sample.depth];
            self.compose.record(gpu, encoder, timer, scene.background_linear, inputs, &targets.hdr);
            let ambient = average_light(scene);
            // The first frame has nothing before it: its positions stand for the previous ones.
            let known = self.past.clip_from_world.is_some();
            let previous =
                |i: &'_ Instance| if known { i.previous_positions.clone() } else { i.positions.clone() };
            let previous_positions: Vec<wgpu::Buffer> = heads.iter().map(|(_, i)| previous(i)).collect();
            let velocity = targets.velocity.as_ref().filter(|_| std::ptr::eq(sample, first));
            if let Some(velocity) = velocity {
                let moving: Vec<_> = heads
                    .iter()
                    .zip(&previous_positions)
                    .map(|((head, i), previous_positions)| Moving {
                        head,
                        positions: &i.positions,
                        previous_positions,
                    })
                    .collect();
                self.velocity.record(gpu, encoder, timer, &view, &moving, &sample.ids, velocity);
            }
            let over = |has: fn(&HeadOnGpu) -> bool| -> Vec<_> {
                let all = heads.iter().zip(&previous_positions).filter(|((head, _), _)| has(head));
                all.map(|((head, i), previous_positions)| Overlaid {
                    head,
                    positions: &i.positions,
                    previous_positions,
                    frames: &i.frames,
                })
                .collect()
            };
            let light = (&self.fibre, &lighting);
            let haired = over(|head| head.hair_root_count > 0);
            if !haired.is_empty() {
                self.cropped_hair.record(gpu, encoder, timer, light, &haired, &targets.hdr, velocity);
            }
            let overlays = over(|head| head.overlay_triangles > 0);
            if !overlays.is_empty() {
                self.overlay.record(gpu, encoder, timer, light, ambient, &overlays, &targets.hdr, velocity);
            }

            let (exposure, samples) = (settings.look.exposure, settings.samples_per_side());
            self.display.record(gpu, encoder, timer, exposure, samples, &targets.hdr, &sample.displayed);
        }

        if let Some(antialias) = &self.antialias {
            let colors: Vec<_> = targets.samples.iter().map(|s| &s.displayed).collect();
            let depths: Vec<_> = targets.samples.iter().map(|s| &s.depth).collect();
            let inputs = antialias::Inputs {
                colors: &colors,
                depths: if settings.antialias().needs_depth() { &depths } else { &[] },
                velocity: targets.velocity.as_ref(),
                frame: self.past.frames,
            };
            let image = targets.image.create_view(&Default::default());
            let is_temporal = settings.quality.antialias.is_temporal();
            if is_temporal && self.past.history.is_none() {
                self.past.history = Some(History::new(gpu, settings.output.size));
            }
            let history = if is_temporal { self.past.history.as_mut() } else { None };
            antialias.record(gpu, encoder, timer, &inputs, &image, history)?;
            if is_temporal {
                for (_, buffers) in &heads {
                    let (from, to) = (&buffers.positions, &buffers.previous_positions);
                    encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
                }
                let aspect = targets.size[0] as f32 / targets.size[1] as f32;
                let camera = &scene.camera;
                self.past.clip_from_world = Some(camera.clip_from_view(aspect) * camera.view_from_world());
                self.past.frames += 1;
            }
        }
        timer.resolve(encoder);
        Ok(scatter_noise)
    }
}

/// Adds all heads to the integral of `reference-surface`.
fn integrate(
    gpu: &Gpu,
    shade: &Shade,
    scene: &Scene<'_>,
    heads: &[(&HeadOnGpu, &Instance)],
    lighting: &Lighting<'_>,
    integral: &Surface,
    inputs: &surface::Inputs<'_>,
    appearance: &Quality,
    batches: u32,
) -> Result<(), RenderError> {
    let size = inputs.scattered.texture().size();
    let aspect = size.width as f32 / size.height as f32;
    let clip_from_world = scene.camera.clip_from_view(aspect) * scene.camera.view_from_world();
    for (index, (instance, (head, buffers))) in scene.heads.iter().zip(heads).enumerate() {
        let triangles: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(&head.triangles)?);
        let vertices: Vec<GpuVertex> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(&head.vertices)?);
        let points: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(&buffers.positions)?);
        let points: Vec<Vec3> = points.into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect();
        let point_of_vertex: Vec<u32> = vertices.iter().map(|v| v.point).collect();
        let opaque = &triangles[..head.opaque_triangles as usize];
        let skin = Skin::new(opaque, &point_of_vertex, &points, &clip_from_world, PICTURE_MARGIN);
        let shaded = shaded(index, instance, head, buffers, appearance);
        integral.add_head(gpu, inputs, index as u32, &skin, batches, &mut |encoder, samples, light| {
            let count = surface::BATCH as u32;
            shade.record_samples(gpu, encoder, lighting, &shaded, [samples, light], count);
        })?;
    }
    Ok(())
}

fn shaded<'a>(
    index: usize,
    instance: &crate::scene::HeadInstance<'_>,
    head: &'a HeadOnGpu,
    buffers: &'a Instance,
    appearance: &Quality,
) -> Shaded<'a> {
    Shaded {
        index: index as u32,
        head,
        positions: &buffers.positions,
        frames: &buffers.frames,
        blended: &buffers.blended,
        hemoglobin_scale: match appearance.color {
            ColorMethod::Static => 1.0,
            ColorMethod::Hemoglobin => instance.state.hemoglobin_scale,
        },
        wrinkles: appearance.wrinkles,
        specular: appearance.specular,
        pupil_mm: instance.state.pupil_mm,
        world_from_head: world_from_head(instance),
    }
}
