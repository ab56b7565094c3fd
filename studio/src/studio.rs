//! The studio: a device, the heads that stand in front of it, and surroundings.
//!
//! ```text
//! Head --set_heads--> device        name --environment--> device
//! Shot (rig) + Settings --draw--> Drawn --finish--> Frame
//! ```
//!
//! This is the only file that knows the renderer's `Renderer` and how a device is opened.

use glam::{Mat4, Vec3};
use image::RgbImage;
use rubor_renderer::channels::{Channel, ChannelData, Extent};
use rubor_renderer::settings::Settings;
use rubor_renderer::{
    AdapterDescription, Camera, ColorTable, Environment, EnvironmentMap, FrameStats, FrameTimes, Gpu,
    HeadInstance, HeadOnGpu, Image, Light, LightKind, Renderer, Scene, list_adapters,
};
use rubor_rig::evaluate::{EnvironmentState, LightState, Shot};
use rubor_rig::head::Head;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinLookup, SkinModel};

use crate::environment;
use crate::error::{Failure, Outcome};
use crate::report::Adapter;

/// Radiance behind the heads: a grey that a face is neither lost nor dazzled before.
const BACKDROP_LINEAR: Vec3 = Vec3::new(0.016, 0.018, 0.021);
/// Side of the skin colour table (see `rubor_rig::skin::chromophores` for its error).
const COLOR_TABLE_SIDE: u32 = 64;
/// Radius of a lamp with a place, metres: a soft box of 24 cm.
const LAMP_RADIUS_METRES: f32 = 0.12;
/// Tangent of the angular radius of a directional light.
const DISTANT_LAMP_RADIUS: f32 = 0.05;

/// Opens an adapter by its number or a part of its name, or the best one.
///
/// # Errors
/// None is there, none has that name, the driver refuses.
pub fn open_device(wanted: Option<&str>) -> Outcome<Gpu> {
    Ok(Gpu::new(wanted)?)
}

/// The adapters of this machine, best first.
pub fn adapters() -> Vec<AdapterDescription> {
    list_adapters()
}

/// A device with the heads and surroundings that shots name.
pub struct Studio {
    renderer: Renderer,
    skin: SkinLookup,
    heads: Vec<HeadOnGpu>,
    surroundings: Surroundings,
}

/// The last environment. Filtering is the same for the same map and angle, so a frame does not depend on those before
/// it, and a light that turns through a sequence does not fill the memory.
#[derive(Default)]
struct Surroundings {
    map: Option<(String, EnvironmentMap)>,
    /// With its name and the columns that it is turned by.
    on_device: Option<(String, i64, Environment)>,
}

/// A frame that the device works on.
pub struct Drawn {
    frame: Frame,
}

/// A finished frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// RGBA, sRGB transfer, opaque.
    pub image: Image,
    /// What it cost.
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
        let renderer = Renderer::new(open_device(adapter)?)?;
        let skin = SkinModel::new(&ChromophoreModel::default()).bake(COLOR_TABLE_SIDE, COLOR_TABLE_SIDE);
        Ok(Self { renderer, skin, heads: Vec::new(), surroundings: Surroundings::default() })
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

    /// Whether passes can be timed.
    pub fn has_timestamps(&self) -> bool {
        self.renderer.gpu().has_timestamps
    }

    /// Takes these heads in place of those before: the shots of a frame are of them, in this order.
    ///
    /// # Errors
    /// A head breaks its rules or does not fit the device.
    pub fn set_heads<'a>(&mut self, heads: impl IntoIterator<Item = &'a Head>) -> Outcome {
        let color =
            ColorTable { width: self.skin.width, height: self.skin.height, texels: &self.skin.texels };
        let heads: Result<_, _> =
            heads.into_iter().map(|head| HeadOnGpu::new(self.renderer.gpu(), head, &color)).collect();
        self.heads = heads?;
        Ok(())
    }

    /// Forgets the frames before: the next frame is number `frame` and antialiasing over time mixes nothing into it.
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

    /// Hands a frame to the device. The next one can be drawn before this one is finished.
    ///
    /// # Errors
    /// No shot, or another number than there are heads; surroundings that do not load; what the renderer refuses.
    pub fn draw(&mut self, shots: &[Shot], spacing_m: f32, settings: &Settings) -> Outcome<Drawn> {
        let (image, stats) =
            self.with_scene(shots, spacing_m, |renderer, scene| Ok(renderer.render(scene, settings)?))?;
        // Channels are those of the last frame drawn.
        let channels =
            settings.output.channels.iter().map(|c| self.read(*c, settings)).collect::<Outcome<_>>()?;
        Ok(Drawn { frame: Frame { image, stats, channels } })
    }

    /// Waits for a frame.
    ///
    /// # Errors
    /// The device failed.
    pub fn finish(&mut self, drawn: Drawn) -> Outcome<Frame> {
        Ok(drawn.frame)
    }

    /// Draws a shot of one head again and again, one frame right after the other, and says what each cost; the first
    /// `warm_up` frames are left out.
    ///
    /// # Errors
    /// As [`Studio::draw`]; a method that does not draw a frame in one go.
    pub fn measure(
        &mut self,
        shot: &Shot,
        settings: &Settings,
        warm_up: u32,
        frames: u32,
    ) -> Outcome<Vec<FrameTimes>> {
        let shots = std::slice::from_ref(shot);
        self.with_scene(shots, 0.0, |renderer, scene| Ok(renderer.measure(scene, settings, warm_up, frames)?))
    }

    /// A channel of the last frame drawn.
    fn read(&self, channel: Channel, settings: &Settings) -> Outcome<ChannelData> {
        let renderer = &self.renderer;
        let values: Vec<f32> = match channel {
            Channel::Radiance => renderer.read_hdr()?.concat(),
            Channel::Diffuse => renderer.read_diffuse()?.concat(),
            Channel::Albedo => renderer.read_albedo()?.concat(),
            Channel::Velocity => renderer.read_velocity()?.concat(),
            Channel::Positions => renderer.read_positions()?.iter().flat_map(|p| p.to_array()).collect(),
            Channel::Visibility => renderer.read_occlusion()?,
            Channel::TangentFrames => {
                let frames = renderer.read_surface_frames()?;
                frames.iter().flat_map(|(n, t)| [n.x, n.y, n.z, t.x, t.y, t.z, t.w]).collect()
            }
            Channel::Irradiance | Channel::Direct | Channel::Depth | Channel::Ids => {
                let expected = "radiance, diffuse, albedo, velocity, positions, visibility or tangent-frames";
                let found = channel.name();
                return Err(Failure::input(format!("channels: found {found}, expected {expected}")));
            }
        };
        let row = channel.row();
        let size = match row.extent {
            Extent::Pixels => settings.frame_size(),
            Extent::Points | Extent::Vertices => [(values.len() / row.components.len()) as u32, 1],
        };
        if values.len() != row.components.len() * size[0] as usize * size[1] as usize || values.is_empty() {
            let found = channel.name();
            return Err(Failure::input(format!("channels: found {found}, which this frame does not have"))
                .hint("velocity needs --antialias smaa-t2x or smaa-4x"));
        }
        Ok(ChannelData { channel, size, values })
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
            self.surroundings.load(state, self.renderer.gpu())?;
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
        let on_device = self.surroundings.on_device.as_ref();
        let scene = Scene {
            heads: &instances,
            camera: Camera {
                position: first.camera.position,
                target: first.camera.target,
                up: first.camera.up,
                fov_degrees: first.camera.fov_y.to_degrees(),
            },
            lights: &lights,
            environment: first.environment.as_ref().and(on_device.map(|(_, _, environment)| environment)),
            environment_intensity: first.environment.as_ref().map_or(0.0, |e| e.intensity),
            background_linear: BACKDROP_LINEAR,
        };
        draw(&mut self.renderer, &scene)
    }
}

impl Surroundings {
    /// Makes the environment of a state the one on the device.
    fn load(&mut self, state: &EnvironmentState, gpu: &Gpu) -> Outcome {
        if self.map.as_ref().is_none_or(|(name, _)| *name != state.name) {
            self.map = Some((state.name.clone(), environment::load(&state.name)?));
        }
        let Some((name, map)) = &self.map else { return Ok(()) };
        let degrees = state.rotation_y.to_degrees();
        // Maps are turned by whole columns: angles that round to the same one have the same light.
        let columns = ((degrees / 360.0 * map.width as f32).round() as i64).rem_euclid(i64::from(map.width));
        if !self.on_device.as_ref().is_some_and(|(of, by, _)| of == name && *by == columns) {
            self.on_device = Some((name.clone(), columns, map.rotated(degrees).upload(gpu)));
        }
        Ok(())
    }
}

fn light(state: &LightState) -> Light {
    use rubor_rig::timeline::LightKind as Kind;
    let (kind, radius) = match state.kind {
        Kind::Directional => (LightKind::Directional { direction: state.direction }, DISTANT_LAMP_RADIUS),
        Kind::Spot => {
            let [inner, outer] = state.cone_half_angles.map(f32::to_degrees);
            let spot = LightKind::Spot {
                position: state.position,
                direction: state.direction,
                inner_degrees: inner,
                outer_degrees: outer,
            };
            (spot, LAMP_RADIUS_METRES)
        }
        Kind::Point => (LightKind::Point { position: state.position }, LAMP_RADIUS_METRES),
    };
    Light { kind, color_linear: state.power_linear, radius, casts_shadow: state.shadow }
}
