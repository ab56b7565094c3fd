//! From a shot of the rig to a scene of the renderer.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Mat4, Vec3};
use rubor_renderer::{
    AppearanceMethods, Camera, ColorTable, Environment, EnvironmentMap, FrameTimes, HeadInstance, HeadOnGpu,
    Light, LightKind, Renderer, ScatterMethod, Scene, Settings, TransmitMethod, antialias,
};
use rubor_rig::evaluate::{EnvironmentState, LightState, Shot};
use rubor_rig::head::Head;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use rubor_rig::skin::profile::Profile;

use crate::antialias_method::Antialias;
use crate::failure::{Failure, Outcome};

/// Radiance behind the heads: a grey that a face is neither lost nor dazzled before.
const BACKDROP_LINEAR: Vec3 = Vec3::new(0.016, 0.018, 0.021);
/// Side of the skin colour table (see `rubor_rig::skin::chromophores` for its error).
const COLOR_TABLE_SIDE: u32 = 64;
/// Radius of a lamp with a place, metres: a soft box of 24 cm.
const LAMP_RADIUS_METRES: f32 = 0.12;
/// Tangent of the angular radius of a directional light.
const DISTANT_LAMP_RADIUS: f32 = 0.05;

/// Texels on a side of a shadow map.
const SHADOW_SIZE: u32 = 2048;

/// How frames are made with these methods; skin is that of the measured six Gaussians.
pub(crate) fn settings(
    size: [u32; 2],
    scatter: ScatterMethod,
    transmit: TransmitMethod,
    antialias: Antialias,
    exposure: f32,
) -> Settings {
    let (mode, supersampling) = antialias.parts();
    Settings {
        size,
        scatter,
        transmit,
        appearance: AppearanceMethods::default(),
        profile: Arc::new(Profile::deon_six()),
        antialias: antialias::Settings::new(mode, antialias::Preset::High),
        supersampling,
        shadow_size: SHADOW_SIZE,
        exposure,
    }
}

/// A renderer with the heads and environments that shots name.
pub(crate) struct Studio {
    pub(crate) renderer: Renderer,
    heads: Vec<HeadOnGpu>,
    environments: BTreeMap<String, Environment>,
}

impl Studio {
    pub(crate) fn new(renderer: Renderer, heads: &[&Head]) -> Outcome<Self> {
        let lookup = SkinModel::new(&ChromophoreModel::default()).bake(COLOR_TABLE_SIDE, COLOR_TABLE_SIDE);
        let color = ColorTable { width: lookup.width, height: lookup.height, texels: &lookup.texels };
        let heads = heads
            .iter()
            .map(|head| HeadOnGpu::new(renderer.gpu(), head, &color))
            .collect::<Result<_, _>>()?;
        Ok(Self { renderer, heads, environments: BTreeMap::new() })
    }

    /// Draws a shot of one head, or of several that stand side by side `spacing` metres apart.
    pub(crate) fn render(
        &mut self,
        shots: &[Shot],
        spacing: f32,
        settings: &Settings,
    ) -> Outcome<(rubor_renderer::Image, rubor_renderer::FrameStats)> {
        self.with_scene(shots, spacing, |renderer, scene| Ok(renderer.render(scene, settings)?))
    }

    /// Draws a shot of one head again and again; see [`Renderer::measure`].
    pub(crate) fn measure(
        &mut self,
        shot: &Shot,
        settings: &Settings,
        warm_up: u32,
        frames: u32,
    ) -> Outcome<Vec<FrameTimes>> {
        let shots = std::slice::from_ref(shot);
        self.with_scene(shots, 0.0, |renderer, scene| Ok(renderer.measure(scene, settings, warm_up, frames)?))
    }

    fn with_scene<T>(
        &mut self,
        shots: &[Shot],
        spacing: f32,
        draw: impl FnOnce(&mut Renderer, &Scene<'_>) -> Outcome<T>,
    ) -> Outcome<T> {
        let Some(first) = shots.first() else { return Err(Failure::job("there is no head to draw")) };
        if let Some(environment) = &first.environment {
            self.load_environment(environment)?;
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
                world_from_head: Mat4::from_translation(Vec3::X * ((i as f32 - middle) * spacing)),
            })
            .collect();
        let lights: Vec<_> = first.lights.iter().map(light).collect();
        let environment = first.environment.as_ref().and_then(|e| self.environments.get(&key(e)));
        let scene = Scene {
            heads: &instances,
            camera: Camera {
                position: first.camera.position,
                target: first.camera.target,
                up: first.camera.up,
                fov_degrees: first.camera.fov_y.to_degrees(),
            },
            lights: &lights,
            environment,
            environment_intensity: first.environment.as_ref().map_or(0.0, |e| e.intensity),
            background_linear: BACKDROP_LINEAR,
        };
        draw(&mut self.renderer, &scene)
    }

    fn load_environment(&mut self, state: &EnvironmentState) -> Outcome {
        let key = key(state);
        if self.environments.contains_key(&key) {
            return Ok(());
        }
        let map = match EnvironmentMap::named(&state.name) {
            Some(map) => map,
            None => load_map(&state.name)?,
        };
        let environment = map.rotated(state.rotation_y.to_degrees()).upload(self.renderer.gpu());
        self.environments.insert(key, environment);
        Ok(())
    }
}

/// An environment is filtered once for each place that it is turned to; whole degrees are fine enough for soft light.
fn key(state: &EnvironmentState) -> String {
    format!("{}@{}", state.name, state.rotation_y.to_degrees().round())
}

fn load_map(path: &str) -> Outcome<EnvironmentMap> {
    let wrong = |e: &dyn std::fmt::Display| {
        let names = EnvironmentMap::NAMES.map(|n| format!("{n:?}")).join(", ");
        Failure::input(format!("environment {path:?}: {e}")).hint(format!(
            "built in are {names}; anything else is the path of an equirectangular .hdr or .exr image"
        ))
    };
    if !std::path::Path::new(path).is_file() {
        return Err(wrong(&"no such file, and no built-in environment of that name"));
    }
    let image = image::ImageReader::open(path)
        .map_err(|e| wrong(&e))?
        .with_guessed_format()
        .map_err(|e| wrong(&e))?
        .decode()
        .map_err(|e| wrong(&e))?
        .to_rgb32f();
    let texels: Vec<Vec3> = image.pixels().map(|p| Vec3::from_array(p.0)).collect();
    if texels.iter().any(|t| !t.is_finite() || t.min_element() < 0.0) {
        return Err(wrong(&"found a negative or infinite radiance, expected finite ones of 0 or more"));
    }
    Ok(EnvironmentMap { width: image.width(), height: image.height(), texels })
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
