//! Draws scenes.

use std::collections::BTreeMap;
use std::collections::VecDeque;

use serde::Serialize;

use crate::channels::{Channel, ChannelData, Extent};
use crate::device::readback::{Coming, Mapped, Readback, TextureReadback};
use crate::device::{FrameTimes, Gpu, Image as FrameImage, Images, PassTimer, PendingTimes, Recorder, Ticks};
use crate::error::RenderError;
use crate::frame::{Frame, Passes, Past, realtime, reference};
use crate::passes::antialias::{self, Antialias, History};
use crate::passes::diffusion::{Needs, Prepared, surface};
use crate::passes::geometry::raster::Rasteriser;
use crate::scene::lamp::lamps;
use crate::scene::level::levelled;
use crate::scene::posed_head::{Instance, posed};
use crate::scene::{HeadInstance, MAX_HEADS, MAX_LIGHTS, Scene};
use crate::settings::{DetailMethod, RasterMethod, ScatterMethod, Settings, TransmitMethod};

/// A picture, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA, sRGB transfer, opaque.
    pub rgba: Vec<u8>,
}

/// Cost of a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameStats {
    /// GPU milliseconds of each pass, in order; empty where the adapter has no timestamps.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// GPU milliseconds from the beginning of the first pass to the end of the last; 0 without timestamps.
    pub frame_ms: f64,
    /// Triangles of all heads.
    pub triangles: u64,
    /// Bytes of heads, buffers and images on the device.
    pub memory_bytes: u64,
    /// Relative standard error of the diffuse light, for methods that draw samples.
    pub scatter_noise: Option<f64>,
}

/// Frames that [`Renderer::measure`] submits before it waits: enough to keep the device busy.
const FRAMES_IN_FLIGHT: usize = 3;
/// Rounds of [`Renderer::choose_raster`] in which the methods take turns, as a device that just woke up is slow at first; frames of a method in
/// each: those left out, and those whose median counts.
const ROUNDS: usize = 3;
const WARM_UP: u32 = 2;
const MEASURED: u32 = 5;

/// Draws scenes. Keeps pipelines, images while frames use them, and the history of temporal antialiasing.
pub struct Renderer {
    gpu: Gpu,
    passes: Passes,
    /// What `auto` stands for.
    fastest: Rasteriser,
    diffusion: Prepared,
    instances: Vec<Instance>,
    images: Images,
    timer: PassTimer,
    past: Past,
    /// Sizes and antialiasing that the history belongs to.
    past_shape: Option<([u32; 2], [u32; 2], antialias::Settings)>,
    checked: Option<Settings>,
    /// Channels of the last frame.
    kept: BTreeMap<Channel, FrameImage>,
}

/// A submitted frame.
pub struct Drawn {
    gpu: Gpu,
    submission: wgpu::SubmissionIndex,
    picture: TextureReadback,
    times: PendingTimes,
    stats: FrameStats,
    channels: Vec<(Channel, Copy)>,
}

/// A frame that the device is done with.
pub struct Arrived {
    picture: TextureReadback<Mapped>,
    times: Ticks<Mapped>,
    stats: FrameStats,
    channels: Vec<(Channel, Copy<Mapped>)>,
}

/// Numbers of a channel, being read back.
enum Copy<B = Readback> {
    Image(TextureReadback<B>, wgpu::TextureFormat),
    Buffer(B),
}

impl Copy {
    fn ask(self) -> Copy<Coming> {
        match self {
            Self::Image(texels, format) => Copy::Image(texels.ask(), format),
            Self::Buffer(floats) => Copy::Buffer(floats.ask()),
        }
    }
}

impl Copy<Coming> {
    async fn arrive(self) -> Result<Copy<Mapped>, RenderError> {
        Ok(match self {
            Self::Image(texels, format) => Copy::Image(texels.arrive().await?, format),
            Self::Buffer(floats) => Copy::Buffer(floats.arrive().await?),
        })
    }
}

impl Copy<Mapped> {
    fn take(self, channel: Channel) -> Result<ChannelData, RenderError> {
        match self {
            Self::Image(texels, format) => {
                let size = texels.size;
                let bytes = texels.texels()?;
                let values = match format {
                    wgpu::TextureFormat::Rgba16Float => {
                        let texels: Vec<[half::f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
                        let n = channel.row().components.len();
                        texels.iter().flat_map(|t| t[..n].iter().map(|v| v.to_f32())).collect()
                    }
                    _ => bytemuck::pod_collect_to_vec(&bytes),
                };
                Ok(ChannelData { channel, size, values })
            }
            Self::Buffer(floats) => {
                let values = of_points(channel, &bytemuck::pod_collect_to_vec::<u8, f32>(&floats.bytes()?));
                let count = values.len() / channel.row().components.len();
                Ok(ChannelData { channel, size: [count as u32, 1], values })
            }
        }
    }
}

impl Drawn {
    /// The picture and its cost, once the device is done with it.
    ///
    /// # Errors
    /// The device failed.
    pub async fn finish(self) -> Result<(Image, FrameStats), RenderError> {
        let (image, stats, _) = self.finish_with_channels().await?;
        Ok((image, stats))
    }

    /// The same with the channels that the settings name, those that the frame has, in that order.
    ///
    /// # Errors
    /// The device failed.
    pub async fn finish_with_channels(self) -> Result<(Image, FrameStats, Vec<ChannelData>), RenderError> {
        self.arrive().await?.take()
    }

    /// Waits until the device is done with the frame. Nothing is copied yet.
    ///
    /// # Errors
    /// The device failed.
    pub async fn arrive(self) -> Result<Arrived, RenderError> {
        let Self { gpu, submission, picture, times, stats, channels } = self;
        gpu.wants(submission);
        // All are asked for before the first is waited for: who waits then waits for this frame alone.
        let (picture, times) = (picture.ask(), times.ask());
        let coming: Vec<_> = channels.into_iter().map(|(channel, copy)| (channel, copy.ask())).collect();
        let (picture, times) = (picture.arrive().await?, times.arrive().await?);
        let mut channels = Vec::with_capacity(coming.len());
        for (channel, copy) in coming {
            channels.push((channel, copy.arrive().await?));
        }
        gpu.check()?;
        Ok(Arrived { picture, times, stats, channels })
    }
}

impl Arrived {
    /// The picture, its cost and its channels: copies them out of memory of the device, on any thread.
    ///
    /// # Errors
    /// The device failed.
    pub fn take(self) -> Result<(Image, FrameStats, Vec<ChannelData>), RenderError> {
        let [width, height] = self.picture.size;
        let rgba = self.picture.texels()?;
        let FrameTimes { passes_ms, frame_ms } = self.times.times()?;
        let channels = self.channels.into_iter().map(|(channel, copy)| copy.take(channel));
        let channels = channels.collect::<Result<_, _>>()?;
        Ok((Image { width, height, rgba }, FrameStats { passes_ms, frame_ms, ..self.stats }, channels))
    }

    /// Channels that it has.
    pub fn channels(&self) -> usize {
        self.channels.len()
    }
}

impl Renderer {
    /// Compiles the passes.
    ///
    /// # Errors
    /// The device refused a pipeline.
    pub fn new(gpu: Gpu) -> Result<Self, RenderError> {
        let renderer = Self {
            passes: Passes::new(&gpu, Rasteriser::Hardware),
            fastest: Rasteriser::Hardware,
            diffusion: Prepared::default(),
            instances: Vec::new(),
            images: Images::default(),
            timer: PassTimer::default(),
            past: Past::default(),
            past_shape: None,
            checked: None,
            kept: BTreeMap::new(),
            gpu,
        };
        renderer.gpu.check()?;
        Ok(renderer)
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Clears the history, for a cut: temporal antialiasing and methods that refine a still scene then mix no previous frame
    /// into the next one.
    /// `frame` is the number of the next frame: even and odd frames have different sample positions.
    pub fn cut(&mut self, frame: u64) {
        self.past = Past { frames: frame, ..Past::default() };
        self.forget_light();
    }

    /// The method of the last frame, for tests that change it.
    #[cfg(test)]
    pub(crate) fn diffusion(&mut self) -> &mut Option<Box<dyn crate::passes::diffusion::Diffusion>> {
        &mut self.diffusion.method
    }

    /// The pass that shades, for tests that change it.
    #[cfg(test)]
    pub(crate) fn shade(&mut self) -> &mut crate::passes::shade::Shade {
        &mut self.passes.shade
    }

    fn forget_light(&mut self) {
        if let Some(method) = &mut self.diffusion.method {
            method.forget();
        }
    }

    /// Records a frame into the caller's encoder and its picture into the caller's texture: `Rgba8Unorm`, of the size
    /// in the settings, usable as storage. Nothing is submitted and nothing is waited for. Frames follow one another
    /// until [`Renderer::cut`]; the encoders have to be submitted in the order of the frames. The times can be read once the
    /// encoder was submitted.
    ///
    /// # Errors
    /// A size, a count or a value outside the limits; a method that does not draw in one go; a texture that does not fit.
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &Scene<'_>,
        settings: &Settings,
        into: &wgpu::Texture,
    ) -> Result<PendingTimes, RenderError> {
        let [width, height] = settings.output.size;
        if [into.width(), into.height()] != [width, height]
            || into.format() != wgpu::TextureFormat::Rgba8Unorm
            || !into.usage().contains(wgpu::TextureUsages::STORAGE_BINDING)
        {
            return Err(RenderError::Limit {
                what: "texture for the picture",
                found: format!("{:?}, {}x{}, {:?}", into.format(), into.width(), into.height(), into.usage()),
                expected: format!("expected Rgba8Unorm, {width}x{height}, with STORAGE_BINDING"),
            });
        }
        let view = into.create_view(&Default::default());
        let heads = self.prepare(scene, settings)?;
        self.record_frame(encoder, &Scene { heads: &heads, ..*scene }, settings, Some(&view))?;
        Ok(self.timer.finish(&self.gpu, encoder))
    }

    /// Draws a scene and waits for nothing: the next frame can be drawn while this one is read. Frames follow one another
    /// until [`Renderer::cut`].
    ///
    /// # Errors
    /// A size, a count or a value outside the limits; a method that does not draw in one go.
    pub fn draw(&mut self, scene: &Scene<'_>, settings: &Settings) -> Result<Drawn, RenderError> {
        let heads = self.prepare(scene, settings)?;
        let scene = &Scene { heads: &heads, ..*scene };
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let image = self.record_frame(&mut encoder, scene, settings, None)?;
        self.hand_over(encoder, scene, settings, image, None)
    }

    /// Draws a scene with any method. Frames follow one another until [`Renderer::cut`].
    ///
    /// # Errors
    /// A size, a count or a value outside the limits; the device failed.
    pub async fn render(
        &mut self,
        scene: &Scene<'_>,
        settings: &Settings,
    ) -> Result<(Image, FrameStats), RenderError> {
        self.draw_any(scene, settings).await?.finish().await
    }

    /// As [`Renderer::draw`], with any method: one that needs samples of the surface waits for the device between them.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub async fn draw_any(&mut self, scene: &Scene<'_>, settings: &Settings) -> Result<Drawn, RenderError> {
        let ScatterMethod::ReferenceSurface(batches) = settings.quality.scatter else {
            return self.draw(scene, settings);
        };
        let heads = self.prepare(scene, settings)?;
        let scene = &Scene { heads: &heads, ..*scene };
        self.passes.shade.prepare_samples(&self.gpu, surface::needs_normals(&settings.quality));
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.images.begin_frame();
        self.timer.restart();
        let mut r = Recorder {
            gpu: &self.gpu,
            encoder: &mut encoder,
            timer: &mut self.timer,
            images: &mut self.images,
        };
        let mut frame =
            frame(&self.passes, scene, settings, &self.instances, &mut self.past, surface::NEEDS, None);
        let (image, noise) = reference::draw(&mut r, &mut frame, batches).await?;
        self.kept = frame.kept;
        self.hand_over(encoder, scene, settings, image, noise)
    }

    /// Draws a scene `frames` times, one frame right after the other and without reading any picture, and returns the
    /// cost of each; the first `warm_up` frames are left out. Empty where the adapter has no timestamps.
    ///
    /// # Errors
    /// As [`Renderer::draw`]; the device failed.
    pub async fn measure(
        &mut self,
        scene: &Scene<'_>,
        settings: &Settings,
        warm_up: u32,
        frames: u32,
    ) -> Result<Vec<FrameTimes>, RenderError> {
        let heads = self.prepare(scene, settings)?;
        let scene = &Scene { heads: &heads, ..*scene };
        let mut pending = VecDeque::new();
        let mut times = Vec::new();
        for frame in 0..warm_up + frames {
            // The cost of a frame in which something moves.
            self.forget_light();
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.record_frame(&mut encoder, scene, settings, None)?;
            let of_frame = self.timer.finish(&self.gpu, &mut encoder);
            pending.push_back((frame, self.gpu.queue.submit([encoder.finish()]), of_frame));
            if pending.len() > FRAMES_IN_FLIGHT {
                self.collect(pending.pop_front(), warm_up, &mut times).await?;
            }
        }
        while let Some(oldest) = pending.pop_front() {
            self.collect(Some(oldest), warm_up, &mut times).await?;
        }
        times.retain(|t| !t.passes_ms.is_empty());
        Ok(times)
    }

    async fn collect(
        &self,
        pending: Option<(u32, wgpu::SubmissionIndex, PendingTimes)>,
        warm_up: u32,
        times: &mut Vec<FrameTimes>,
    ) -> Result<(), RenderError> {
        let Some((frame, submission, of_frame)) = pending else { return Ok(()) };
        self.gpu.wants(submission);
        let of_frame = of_frame.read().await?;
        if frame >= warm_up {
            times.push(of_frame);
        }
        self.gpu.check()
    }

    /// Measures what turns triangles into pixels faster on this device, for a scene, and uses it where the settings say
    /// [`RasterMethod::Auto`]: by the best of some rounds. A software device is not measured: its raster unit is faster. Begins a new history.
    ///
    /// # Errors
    /// As [`Renderer::measure`].
    pub async fn choose_raster(
        &mut self,
        scene: &Scene<'_>,
        settings: &Settings,
    ) -> Result<RasterMethod, RenderError> {
        if self.gpu.is_software() || !self.gpu.has_timestamps {
            return Ok(RasterMethod::Hardware);
        }
        let mut cost_ms = [f64::INFINITY; 2];
        let methods = [RasterMethod::Hardware, RasterMethod::Compute];
        let mut settings = settings.clone();
        if matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_)) {
            settings.quality.scatter = ScatterMethod::None;
        }
        for turn in 0..ROUNDS * methods.len() {
            let of = turn % methods.len();
            settings.quality.raster = methods[of];
            let mut frames: Vec<_> =
                self.measure(scene, &settings, WARM_UP, MEASURED).await?.iter().map(|t| t.frame_ms).collect();
            frames.sort_by(f64::total_cmp);
            let median = frames.get(frames.len() / 2).copied().unwrap_or(f64::INFINITY);
            cost_ms[of] = cost_ms[of].min(median);
        }
        self.past.forget();
        let (rasteriser, method) = match cost_ms[1] < cost_ms[0] {
            true => (Rasteriser::compute(&self.gpu), RasterMethod::Compute),
            false => (Rasteriser::Hardware, RasterMethod::Hardware),
        };
        self.fastest = rasteriser;
        Ok(method)
    }

    /// A channel of the last frame, which its settings have to name in [`crate::settings::Output::channels`]; those over
    /// points and vertices are always there, where they are not named those of the level that was drawn. Empty where the frame has no such channel.
    ///
    /// # Errors
    /// The device failed.
    pub async fn read(&self, channel: Channel) -> Result<ChannelData, RenderError> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let Some(copy) = self.copy(&mut encoder, channel) else {
            return Ok(ChannelData { channel, size: [0, 0], values: Vec::new() });
        };
        self.gpu.queue.submit([encoder.finish()]);
        let data = copy.ask().arrive().await?.take(channel)?;
        self.gpu.check()?;
        Ok(data)
    }

    /// Copies a channel of the last frame, if the frame has it.
    fn copy(&self, encoder: &mut wgpu::CommandEncoder, channel: Channel) -> Option<Copy> {
        let of_head =
            |buffer: &wgpu::Buffer| Copy::Buffer(Readback::of_buffer(&self.gpu, &mut *encoder, buffer));
        match (channel, self.instances.first()) {
            (Channel::Positions | Channel::Visibility, head) => head.map(|h| &h.positions).map(of_head),
            (Channel::TangentFrames, head) => head.map(|h| &h.tangent_frames).map(of_head),
            _ => self.kept.get(&channel).map(|image| {
                let texture = image.texture();
                Copy::Image(TextureReadback::new(&self.gpu, encoder, texture), texture.format())
            }),
        }
    }

    /// Checks a scene and makes the passes that its frames need. Returns its heads at the levels that are drawn.
    fn prepare<'a>(
        &mut self,
        scene: &Scene<'a>,
        settings: &Settings,
    ) -> Result<Vec<HeadInstance<'a>>, RenderError> {
        if self.checked.as_ref() != Some(settings) {
            check_settings(&self.gpu, settings)?;
            self.checked = Some(settings.clone());
        }
        check_scene(scene)?;
        let shape = (settings.output.size, settings.frame_size(), settings.antialias());
        if self.past_shape.as_ref() != Some(&shape) {
            self.past_shape = Some(shape);
            self.past.forget();
        }
        let rasteriser = self.rasteriser(scene, settings);
        let profile = settings.quality.profile.shared();
        self.diffusion.prepare(&self.gpu, rasteriser, settings.quality.scatter, profile)?;
        let needs = self.needs();
        // Methods over the surface lay it out once; who reads points wants all of them.
        let is_whole = needs.before_view
            || matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_))
            || settings.output.channels.iter().any(|c| c.row().extent != Extent::Pixels);
        let detail = if is_whole { DetailMethod::Full } else { settings.quality.detail };
        let heads = levelled(&self.gpu, scene, detail, settings.frame_size());
        let scene = &Scene { heads: &heads, ..*scene };
        for instance in &mut self.instances {
            instance.is_new = false;
        }
        for (i, placed) in heads.iter().enumerate() {
            match self.instances.get_mut(i) {
                Some(instance) if instance.fits(placed.head) => {}
                Some(instance) if instance.is_of(placed.head) => {
                    *instance = Instance::new(&self.gpu, placed.head);
                }
                _ => {
                    self.instances.truncate(i);
                    self.instances.push(Instance::new(&self.gpu, placed.head));
                    self.past.forget();
                }
            }
        }
        if self.passes.rasteriser != rasteriser {
            self.passes = Passes::new(&self.gpu, rasteriser);
        }
        if let Some(method) = &mut self.diffusion.method {
            method.take_heads(&self.gpu, scene.heads)?;
        }
        self.passes.prepare(&self.gpu, scene, settings, &needs)?;
        Ok(heads)
    }

    /// What the settings ask for, as far as the device has the memory.
    fn rasteriser(&self, scene: &Scene<'_>, settings: &Settings) -> Rasteriser {
        let wanted = match settings.quality.raster {
            RasterMethod::Auto => self.fastest,
            RasterMethod::Hardware => Rasteriser::Hardware,
            RasterMethod::Compute => Rasteriser::compute(&self.gpu),
        };
        let [width, height] = settings.frame_size().map(u64::from);
        let shadows = u64::from(settings.quality.shadow_size).pow(2) * (scene.lights.len() as u64 + 1);
        let most = self.gpu.device.limits().max_storage_buffer_binding_size;
        if (8 * width * height).max(4 * shadows) > most { Rasteriser::Hardware } else { wanted }
    }

    fn needs(&self) -> Needs {
        self.diffusion.method.as_ref().map_or(surface::NEEDS, |m| m.needs())
    }

    fn record_frame(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &Scene<'_>,
        settings: &Settings,
        into: Option<&wgpu::TextureView>,
    ) -> Result<Option<FrameImage>, RenderError> {
        let needs = self.needs();
        let Some(diffusion) = &mut self.diffusion.method else {
            return Err(RenderError::Limit {
                what: "scattering method",
                found: settings.quality.scatter.to_string(),
                expected: "expected one that draws a frame in one go".into(),
            });
        };
        self.images.begin_frame();
        self.timer.restart();
        let mut r = Recorder { gpu: &self.gpu, encoder, timer: &mut self.timer, images: &mut self.images };
        let mut frame = frame(&self.passes, scene, settings, &self.instances, &mut self.past, needs, into);
        let image = realtime::record(&mut r, &mut frame, diffusion.as_mut())?;
        self.kept = frame.kept;
        Ok(image)
    }

    /// Submits a frame together with copies of its picture and its times.
    fn hand_over(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        scene: &Scene<'_>,
        settings: &Settings,
        image: Option<FrameImage>,
        scatter_noise: Option<f64>,
    ) -> Result<Drawn, RenderError> {
        let Some(image) = image else { return Err(RenderError::Lost("no picture".into())) };
        let picture = TextureReadback::new(&self.gpu, &mut encoder, image.texture());
        let channels = settings.output.channels.iter();
        let channels = channels.filter_map(|c| Some((*c, self.copy(&mut encoder, *c)?))).collect();
        let times = self.timer.finish(&self.gpu, &mut encoder);
        let submission = self.gpu.queue.submit([encoder.finish()]);
        let triangles = |h: &crate::scene::HeadInstance<'_>| {
            let (opaque, overlay) = h.head.triangle_counts();
            u64::from(opaque) + u64::from(overlay)
        };
        let stats = FrameStats {
            passes_ms: Vec::new(),
            frame_ms: 0.0,
            triangles: scene.heads.iter().map(triangles).sum(),
            memory_bytes: self.memory_bytes(scene),
            scatter_noise,
        };
        Ok(Drawn { gpu: self.gpu.clone(), submission, picture, times, stats, channels })
    }

    /// Bytes of heads, buffers and images, and what the diffusion method keeps.
    fn memory_bytes(&self, scene: &Scene<'_>) -> u64 {
        self.images.bytes()
            + self.instances.iter().map(Instance::bytes).sum::<u64>()
            + self.passes.visibility.bytes()
            + self.passes.shadow.bytes()
            + self.passes.cropped_hair.bytes()
            + self.diffusion.method.as_ref().map_or(0, |m| m.memory_bytes())
            + self.passes.antialias.as_ref().map_or(0, Antialias::memory_bytes)
            + self.past.history.as_ref().map_or(0, History::memory_bytes)
            + scene.heads.iter().map(|h| h.head.total_bytes()).sum::<u64>()
    }
}

fn frame<'a>(
    passes: &'a Passes,
    scene: &'a Scene<'a>,
    settings: &'a Settings,
    instances: &'a [Instance],
    past: &'a mut Past,
    needs: Needs,
    into: Option<&'a wgpu::TextureView>,
) -> Frame<'a> {
    let transmits = needs.transmittance && settings.quality.transmit != TransmitMethod::None;
    Frame {
        passes,
        scene,
        settings,
        heads: posed(scene, instances, past.clip_from_world.is_some()),
        lamps: lamps(scene, transmits),
        needs,
        past,
        into,
        kept: BTreeMap::new(),
    }
}

/// Components of a channel from rows of four (points) or eight (tangent frames) floats.
fn of_points(channel: Channel, floats: &[f32]) -> Vec<f32> {
    match channel {
        Channel::Positions => floats.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
        Channel::Visibility => floats.chunks_exact(4).map(|p| p[3]).collect(),
        _ => floats.chunks_exact(8).flat_map(|f| [f[0], f[1], f[2], f[4], f[5], f[6], f[7]]).collect(),
    }
}

fn check_settings(gpu: &Gpu, settings: &Settings) -> Result<(), RenderError> {
    settings.validate()?;
    let most = gpu.device.limits().max_texture_dimension_2d;
    let limit = |what, found: String, expected: String| Err(RenderError::Limit { what, found, expected });
    let [w, h] = settings.output.size;
    if w == 0 || h == 0 || w > most || h > most {
        let expected = format!("1x1 to {most}x{most} on {}", gpu.info.name);
        return limit("image size", format!("{w}x{h}"), expected);
    }
    let n = settings.samples_per_side();
    if u64::from(w.max(h)) * u64::from(n) > u64::from(most) {
        let expected = format!("a frame of at most {most} pixels on a side");
        return limit("supersampling", n.to_string(), expected);
    }
    if settings.quality.shadow_size > most {
        return limit("shadow map size", settings.quality.shadow_size.to_string(), format!("at most {most}"));
    }
    Ok(())
}

fn check_scene(scene: &Scene<'_>) -> Result<(), RenderError> {
    let limit = |what, found: String, expected: String| Err(RenderError::Limit { what, found, expected });
    if scene.heads.len() > MAX_HEADS {
        return limit("number of heads", scene.heads.len().to_string(), format!("at most {MAX_HEADS}"));
    }
    if scene.lights.len() > MAX_LIGHTS {
        return limit("number of lights", scene.lights.len().to_string(), format!("at most {MAX_LIGHTS}"));
    }
    let c = scene.camera;
    if !(c.fov_degrees > 0.0 && c.fov_degrees < 170.0) {
        return limit("field of view", format!("{} degrees", c.fov_degrees), "above 0 and below 170".into());
    }
    if !c.view_from_world().is_finite() {
        let expected = "a finite position and a target apart from it".into();
        return limit("camera", format!("{} looking at {}", c.position, c.target), expected);
    }
    let optics = &scene.optics;
    let lens = [optics.sensor_height_mm, optics.f_stop.unwrap_or(1.0), optics.focus_metres];
    if !(lens.iter().all(|v| v.is_finite() && *v > 0.0)) {
        let found = format!("sensor {} mm, f-stop {:?}, focus {} m", lens[0], optics.f_stop, lens[2]);
        return limit("lens", found, "lengths and an f-stop above 0".into());
    }
    if !(optics.subject.is_finite() && optics.subject_height > 0.0 && optics.subject_height.is_finite()) {
        let found = format!("{} tall at {}", optics.subject_height, optics.subject);
        return limit("subject of the backdrop", found, "a place and a height above 0, metres".into());
    }
    if !scene.environment_rotation.is_finite() {
        let expected = "a finite angle".into();
        return limit("rotation of the environment", scene.environment_rotation.to_string(), expected);
    }
    for head in scene.heads {
        let (found, expected) = (head.state.shapes.len(), head.head.shape_count);
        if found != expected {
            return limit(
                "number of shape weights",
                found.to_string(),
                format!("{expected}, one for each shape"),
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
