//! The studio: a device, the heads that stand in front of it, and environments.
//!
//! ```text
//! Head --set_heads--> device        name --environment--> device
//! Shot (rig) + Settings --draw--> Drawn --finish--> Frame
//! ```
//!
//! This is the only file that knows the renderer's `Renderer` and how a device is opened.

use std::rc::Rc;
use std::sync::Arc;

use glam::{Mat4, Vec3};
use image::RgbImage;
use rubor_assets::convert::levels;
use rubor_renderer::channels::{Channel, ChannelData};
use rubor_renderer::settings::{RasterMethod, Settings};
use rubor_renderer::{
    AdapterDescription, Camera, ColorTable, Environment, FrameStats, FrameTimes, Gpu, HeadInstance,
    HeadOnGpu, Image, Ladder, Light, LightKind, Optics, PendingTimes, Renderer, Scene, native,
};
use rubor_rig::authored::Authored;
use rubor_rig::evaluate::{LightState, Shot};
use rubor_rig::head::{Head, SkinMaps};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinLookup, SkinModel};

use crate::cache::{self, Cache};
use crate::environment;
use crate::error::{Failure, Outcome};
use crate::notes::Note;
use crate::report::Adapter;

/// Radiance behind the heads: a grey in front of which light and dark faces stand out.
const BACKDROP_LINEAR: Vec3 = Vec3::new(0.016, 0.018, 0.021);
/// Side of the skin colour table (see `rubor_rig::skin::chromophores` for its error).
const COLOR_TABLE_SIDE: u32 = 64;

/// Opens an adapter by its number or a part of its name, or the best one.
///
/// # Errors
/// No adapter exists, none has that name, or the driver refuses.
pub fn open_device(wanted: Option<&str>) -> Outcome<Gpu> {
    Ok(native::open(wanted)?)
}

/// The adapters of this machine, best first.
pub fn adapters() -> Vec<AdapterDescription> {
    native::adapters()
}

/// A device with the heads and surroundings that shots name.
pub struct Studio {
    renderer: Renderer,
    skin: SkinLookup,
    heads: Vec<Rc<HeadOnGpu>>,
    surroundings: Surroundings,
    notes: Vec<Note>,
    /// Whether what turns triangles into pixels was chosen for these heads.
    raster_is_chosen: bool,
    cache: Cache,
}

/// The last environment by its name: a rotated one is the same map at another angle.
type Surroundings = Option<(String, Environment)>;

/// A frame in flight on the device.
pub struct Drawn {
    frame: rubor_renderer::Drawn,
    /// Channels that the frame has to have.
    channels: usize,
}

/// A frame that the device is done with.
pub struct Arrived(rubor_renderer::Arrived);

impl Arrived {
    /// The frame: copies it out of memory of the device, on any thread.
    ///
    /// # Errors
    /// The device failed.
    pub fn take(self) -> Outcome<Frame> {
        let (image, stats, channels) = self.0.take()?;
        Ok(Frame { image, stats, channels })
    }
}

/// A finished frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// RGBA, sRGB transfer, opaque.
    pub image: Image,
    /// Its cost.
    pub stats: FrameStats,
    /// The channels that its settings name, in that order.
    pub channels: Vec<ChannelData>,
}

impl Frame {
    /// The picture without its alpha, which is 1 everywhere.
    pub fn picture(&self) -> RgbImage {
        RgbImage::from_fn(self.image.width, self.image.height, |x, y| {
            let i = 4 * (y as usize * self.image.width as usize + x as usize);
            image::Rgb([self.image.rgba[i], self.image.rgba[i + 1], self.image.rgba[i + 2]])
        })
    }
}

impl Studio {
    /// Opens an adapter by its number or a part of its name, or the best one.
    ///
    /// # Errors
    /// As [`open_device`].
    pub fn open(adapter: Option<&str>) -> Outcome<Self> {
        Self::on(open_device(adapter)?)
    }

    /// A studio on a device that is open.
    ///
    /// # Errors
    /// The device refuses a shader.
    pub fn on(gpu: Gpu) -> Outcome<Self> {
        let renderer = Renderer::new(gpu)?;
        let skin = SkinModel::new(&ChromophoreModel::default()).bake(COLOR_TABLE_SIDE, COLOR_TABLE_SIDE);
        Ok(Self {
            renderer,
            skin,
            heads: Vec::new(),
            surroundings: None,
            notes: Vec::new(),
            raster_is_chosen: false,
            cache: Cache::default(),
        })
    }

    /// Keeps what takes seconds and follows from the heads alone, from the next heads on.
    pub fn keep_in(&mut self, cache: Cache) {
        self.cache = cache;
    }

    /// The device.
    pub fn adapter(&self) -> Adapter {
        let info = &self.renderer.gpu().info;
        Adapter {
            name: info.name.clone(),
            backend: format!("{:?}", info.backend),
            driver: info.driver_info.clone(),
        }
    }

    /// The open device.
    pub fn gpu(&self) -> &Gpu {
        self.renderer.gpu()
    }

    /// Whether the device is a processor and not a graphics card.
    pub fn is_software(&self) -> bool {
        self.renderer.gpu().is_software()
    }

    /// Whether passes can be timed.
    pub fn has_timestamps(&self) -> bool {
        self.renderer.gpu().has_timestamps
    }

    /// Bytes of the heads on the device, with what frames write of them.
    pub fn head_bytes(&self) -> u64 {
        self.heads.iter().map(|head| head.bytes_in_scene()).sum()
    }

    /// Single hairs of the scalps of all heads: those on the device.
    pub fn hairs(&self) -> u32 {
        self.heads.iter().map(|head| head.hair_counts()[0]).sum()
    }

    /// Replaces the heads; a frame takes one shot per head, in this order. One that is there several times is kept once.
    ///
    /// # Errors
    /// A head breaks its rules or does not fit the device.
    pub fn set_heads<'a>(&mut self, heads: impl IntoIterator<Item = &'a Head>) -> Outcome {
        let color =
            ColorTable { width: self.skin.width, height: self.skin.height, texels: &self.skin.texels };
        let mut known: Vec<(&Head, Rc<HeadOnGpu>)> = Vec::new();
        for head in heads {
            let kept =
                known.iter().find(|(other, _)| std::ptr::eq(*other, head)).map(|(_, kept)| kept.clone());
            let on_gpu = match kept {
                Some(kept) => kept,
                None => {
                    let on_gpu = HeadOnGpu::new(self.renderer.gpu(), head, &color)?;
                    Rc::new(on_gpu.with_ladder(ladder(head, &self.cache)))
                }
            };
            known.push((head, on_gpu));
        }
        self.heads = known.into_iter().map(|(_, kept)| kept).collect();
        self.raster_is_chosen = false;
        Ok(())
    }

    /// Notes on everything that loading environments left out, decoded or repaired since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// The colours of skin.
    pub(crate) fn skin(&self) -> &SkinLookup {
        &self.skin
    }

    /// Clears the history: the next frame is number `frame`, and temporal antialiasing mixes no previous frame into it.
    pub fn cut(&mut self, frame: u32) {
        self.renderer.cut(u64::from(frame));
    }

    /// Draws a shot of one head, or of several that stand side by side `spacing_m` metres apart, and waits for it.
    /// Camera and light are those of the first.
    ///
    /// # Errors
    /// As [`Studio::draw`].
    pub fn render(&mut self, shots: &[Shot], spacing_m: f32, settings: &Settings) -> Outcome<Frame> {
        let drawn = self.draw(shots, spacing_m, settings)?;
        self.finish(drawn)
    }

    /// Submits a frame to the device. The next one can be drawn before this one is finished.
    ///
    /// # Errors
    /// No shot, or another number than there are heads; environments that do not load; errors of the renderer.
    pub fn draw(&mut self, shots: &[Shot], spacing_m: f32, settings: &Settings) -> Outcome<Drawn> {
        self.choose_raster(shots, spacing_m, settings)?;
        let gpu = self.renderer.gpu().clone();
        let frame = self.with_scene(shots, spacing_m, |renderer, scene| {
            Ok(native::wait(&gpu, renderer.draw_any(scene, settings))?)
        })?;
        Ok(Drawn { frame, channels: settings.output.channels.len() })
    }

    /// Waits for a frame.
    ///
    /// # Errors
    /// The device failed; the frame lacks a channel that its settings name.
    pub fn finish(&mut self, drawn: Drawn) -> Outcome<Frame> {
        self.arrive(drawn)?.take()
    }

    /// Waits until the device is done with a frame.
    ///
    /// # Errors
    /// As [`Studio::finish`].
    pub fn arrive(&mut self, drawn: Drawn) -> Outcome<Arrived> {
        let arrived = native::wait(self.renderer.gpu(), drawn.frame.arrive())?;
        let found = arrived.channels();
        if found < drawn.channels {
            return Err(Failure::job(format!(
                "channels: found {found}, expected {}: this frame does not have them all",
                drawn.channels
            )));
        }
        Ok(Arrived(arrived))
    }

    /// Submits a frame into a texture of the caller (see [`Renderer::record`]) and waits for nothing. The times of its passes
    /// can be read when the device is done.
    ///
    /// # Errors
    /// As [`Studio::draw`]; a method that does not draw a frame in one go; a texture that does not fit.
    pub fn draw_into(
        &mut self,
        shots: &[Shot],
        spacing_m: f32,
        settings: &Settings,
        into: &wgpu::Texture,
    ) -> Outcome<PendingTimes> {
        self.choose_raster(shots, spacing_m, settings)?;
        let gpu = self.renderer.gpu().clone();
        self.with_scene(shots, spacing_m, |renderer, scene| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let times = renderer.record(&mut encoder, scene, settings, into)?;
            gpu.queue.submit([encoder.finish()]);
            gpu.check()?;
            Ok(times)
        })
    }

    /// A channel of the last frame, which its settings have to name. Waits for the device.
    ///
    /// # Errors
    /// The device failed.
    pub fn read(&self, channel: Channel) -> Outcome<ChannelData> {
        Ok(native::wait(self.renderer.gpu(), self.renderer.read(channel))?)
    }

    /// Draws shots of heads side by side again and again, one frame right after the other, and returns the cost of each;
    /// the first `warm_up` frames are left out.
    ///
    /// # Errors
    /// As [`Studio::draw`]; a method that does not draw a frame in one go.
    pub fn measure(
        &mut self,
        shots: &[Shot],
        spacing_m: f32,
        settings: &Settings,
        warm_up: u32,
        frames: u32,
    ) -> Outcome<Vec<FrameTimes>> {
        self.choose_raster(shots, spacing_m, settings)?;
        let gpu = self.renderer.gpu().clone();
        self.with_scene(shots, spacing_m, |renderer, scene| {
            Ok(native::wait(&gpu, renderer.measure(scene, settings, warm_up, frames))?)
        })
    }

    /// Measures once what turns the triangles of these heads into pixels faster, if the settings leave it open.
    fn choose_raster(&mut self, shots: &[Shot], spacing_m: f32, settings: &Settings) -> Outcome {
        if self.raster_is_chosen || settings.quality.raster != RasterMethod::Auto {
            return Ok(());
        }
        let gpu = self.renderer.gpu().clone();
        self.with_scene(shots, spacing_m, |renderer, scene| {
            Ok(native::wait(&gpu, renderer.choose_raster(scene, settings))?)
        })?;
        self.raster_is_chosen = true;
        Ok(())
    }

    fn with_scene<T>(
        &mut self,
        shots: &[Shot],
        spacing_m: f32,
        draw: impl FnOnce(&mut Renderer, &Scene<'_>) -> Outcome<T>,
    ) -> Outcome<T> {
        let Some(first) = shots.first() else { return Err(Failure::input("there is no head to draw")) };
        if shots.len() != self.heads.len() {
            return Err(Failure::input(format!(
                "found {} shots, expected one for each of {} heads",
                shots.len(),
                self.heads.len()
            )));
        }
        if let Some(state) = &first.environment {
            self.load_environment(&state.name)?;
        }
        let middle = (shots.len() as f32 - 1.0) / 2.0;
        let instances: Vec<_> = self
            .heads
            .iter()
            .zip(shots)
            .enumerate()
            .map(|(i, (head, shot))| HeadInstance {
                head,
                state: &shot.face,
                world_from_head: Mat4::from_translation(Vec3::X * ((i as f32 - middle) * spacing_m)),
            })
            .collect();
        let lights: Vec<_> = first.lights.iter().map(light).collect();
        let scene = Scene {
            heads: &instances,
            camera: Camera {
                position: first.camera.position,
                target: first.camera.target,
                up: first.camera.up,
                fov_degrees: first.camera.fov_y.to_degrees(),
            },
            lights: &lights,
            environment: first.environment.as_ref().and(self.surroundings.as_ref().map(|(_, e)| e)),
            environment_rotation: first.environment.as_ref().map_or(0.0, |e| e.rotation_y),
            environment_intensity: first.environment.as_ref().map_or(0.0, |e| e.intensity),
            background_linear: BACKDROP_LINEAR,
            optics: optics(first),
        };
        draw(&mut self.renderer, &scene)
    }

    /// Forgets the last environment: its image may have changed.
    pub fn forget_surroundings(&mut self) {
        self.surroundings = None;
    }

    /// Loads an environment onto the device, unless it is there.
    fn load_environment(&mut self, name: &str) -> Outcome {
        if self.surroundings.as_ref().is_none_or(|(known, _)| known != name) {
            let (map, notes) = environment::load(name)?;
            self.notes.extend(notes);
            self.surroundings = Some((name.to_owned(), map.upload(self.renderer.gpu())));
        }
        Ok(())
    }
}

/// Coarser levels of a head, made when they are needed.
fn ladder(head: &Head, cache: &Cache) -> Ladder {
    let hair =
        SkinMaps { hair: head.maps.hair.clone(), hair_count: head.maps.hair_count, ..SkinMaps::default() };
    let geometry = Head {
        name: head.name.clone(),
        mesh: head.mesh.clone(),
        shapes: head.shapes.clone(),
        maps: hair,
        authored: Authored {
            images: Vec::new(),
            materials: head.authored.materials.clone(),
            of_parts: head.authored.of_parts.clone(),
            second_uvs: head.authored.second_uvs.clone(),
            colors_linear: head.authored.colors_linear.clone(),
            normals: head.authored.normals.clone(),
        },
        landmarks: head.landmarks.clone(),
        provenance: Vec::new(),
    };
    let cache = cache.clone();
    let make = move |head: &Head| cache::levels(&cache, head);
    Ladder::new(Arc::new(geometry), make, levels::least_error_metres(head))
}

/// The lens of a shot and where its backdrop is lit.
fn optics(shot: &Shot) -> Optics {
    let lens = shot.camera.lens;
    Optics {
        frame: shot.frame,
        sensor_height_mm: lens.sensor_height_mm,
        f_stop: lens.f_stop,
        focus_metres: lens.focus_metres,
        subject: shot.place.origin,
        subject_height: shot.place.head_height,
    }
}

fn light(state: &LightState) -> Light {
    use rubor_rig::timeline::LightKind as Kind;
    let kind = match state.kind {
        Kind::Directional => LightKind::Directional { direction: state.direction },
        Kind::Spot => {
            let [inner, outer] = state.cone_half_angles.map(f32::to_degrees);
            LightKind::Spot {
                position: state.position,
                direction: state.direction,
                inner_degrees: inner,
                outer_degrees: outer,
            }
        }
        Kind::Point => LightKind::Point { position: state.position },
    };
    Light { kind, color_linear: state.power_linear, radius: state.radius, casts_shadow: state.shadow }
}
