//! Where the camera, the heads, the lamps and their shadow maps of a frame stand.

use glam::{Mat4, Vec3};

use crate::clusters::{self, Sphere, Viewer};
use crate::frame::View;
use crate::passes::shade::GpuLight;
use crate::passes::shadow::LightView;
use crate::scene::{Light, LightKind, MAX_LIGHTS, NEAR_METRES, Scene};
use crate::settings::{ScatterMethod, Settings, TransmitMethod};

/// Size of the picture with its surroundings over its own, for light that comes in from outside of it.
pub(crate) const PICTURE_MARGIN: f32 = 1.25;

/// Cosine between the camera's view and the way to a lamp from which the lamp stands behind the heads.
const BEHIND_COSINE: f32 = 0.4;

/// The view of a frame as shaders read it.
pub(crate) fn view(
    scene: &Scene<'_>,
    lamps: &[Light],
    size: [u32; 2],
    [jitter, shading_jitter]: [[f32; 2]; 2],
    previous: Option<Mat4>,
) -> View {
    let camera = &scene.camera;
    let aspect = size[0] as f32 / size[1] as f32;
    let view_from_world = camera.view_from_world();
    let world_from_view = view_from_world.inverse();
    let tangent = (0.5 * camera.fov_degrees.to_radians()).tan();
    let axis = |v: Vec3| world_from_view.transform_vector3(v).extend(0.0).to_array();
    let clip_from_world = camera.clip_from_view(aspect) * view_from_world;
    View {
        clip_from_world,
        previous_clip_from_world: previous.unwrap_or(clip_from_world),
        origin: camera.position.extend(size[1] as f32 / (2.0 * tangent)).to_array(),
        right: axis(Vec3::X * tangent * aspect),
        up: axis(Vec3::Y * tangent),
        forward: axis(Vec3::NEG_Z),
        size,
        head_count: scene.heads.len() as u32,
        has_environment: u32::from(scene.environment.is_some()),
        jitter,
        near: NEAR_METRES,
        light_count: lamps.len() as u32,
        shading_jitter,
        // Depths near that of the nearest head are kept best.
        depth_origin_mm: 1000.0 * head_depths(scene, view_from_world).reduce(f32::min).unwrap_or(0.0),
        padding: 0.0,
    }
}

/// View depths of the heads before the camera, between middle and front, metres.
fn head_depths<'a>(scene: &'a Scene<'_>, view_from_world: Mat4) -> impl Iterator<Item = f32> + 'a {
    let depth = move |instance: &crate::scene::HeadInstance<'_>| {
        let (low, high) = instance.head.bounds;
        let middle = world_from_head(instance).transform_point3(0.5 * (low + high));
        -view_from_world.transform_point3(middle).z - 0.25 * (high - low).min_element()
    };
    scene.heads.iter().map(depth).filter(|d| *d > 0.0)
}

/// Pixels for a millimetre of the farthest head; 1 where none is before the camera.
pub(crate) fn pixels_per_mm(scene: &Scene<'_>, view: &View) -> f64 {
    let farthest = head_depths(scene, scene.camera.view_from_world()).reduce(f32::max);
    farthest.map_or(1.0, |depth| f64::from(view.origin[3]) / (1000.0 * f64::from(depth)))
}

/// Placement of a head: its own motion first, then its place in the scene.
pub(crate) fn world_from_head(instance: &crate::scene::HeadInstance<'_>) -> Mat4 {
    instance.world_from_head
        * Mat4::from_rotation_translation(instance.state.head_rotation, instance.state.head_translation)
}

/// The lamps of a scene and, where the environment's light is to pass through thin parts and no lamp with shadows
/// shines from behind the heads, a dark one there whose shadow map tells how thick they are.
pub(crate) fn lamps(scene: &Scene<'_>, settings: &Settings) -> Vec<Light> {
    let mut lamps = scene.lights.to_vec();
    let (center, _) = bounding_sphere(scene);
    let view = (center - scene.camera.position).normalize_or(Vec3::NEG_Z);
    let is_behind = |l: &Light| {
        let direction = match l.kind {
            LightKind::Directional { direction } => direction,
            LightKind::Spot { position, .. } | LightKind::Point { position } => center - position,
        };
        l.casts_shadow && direction.normalize_or_zero().dot(view) < -BEHIND_COSINE
    };
    let transmits = settings.quality.transmit == TransmitMethod::ShadowDepth
        && !matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_));
    if transmits && scene.environment.is_some() && lamps.len() < MAX_LIGHTS && !lamps.iter().any(is_behind) {
        let kind = LightKind::Directional { direction: -view };
        lamps.push(Light { kind, color_linear: Vec3::ZERO, radius: 0.0, casts_shadow: true });
    }
    lamps
}

/// Where the heads are lit for a picture: what the camera sees of them, and for the integral over the surface also what
/// is turned away.
pub(crate) fn receivers(scene: &Scene<'_>, settings: &Settings) -> Vec<Sphere> {
    let [width, height] = settings.output.size;
    let clip_from_view = scene.camera.clip_from_view(width as f32 / height as f32);
    let is_surface = matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_));
    let viewer = Viewer {
        position: scene.camera.position,
        clip_from_world: clip_from_view * scene.camera.view_from_world(),
        margin: if is_surface { PICTURE_MARGIN } else { 1.0 },
        sees_backs: is_surface,
    };
    let of_head = |h: &crate::scene::HeadInstance<'_>| {
        clusters::visible(&h.head.clusters, &h.state.shapes, world_from_head(h), &viewer)
    };
    scene.heads.iter().flat_map(of_head).collect()
}

/// Lights for the shader, and (view, layer) of those that cast shadows.
pub(crate) fn place_lights(
    scene: &Scene<'_>,
    lamps: &[Light],
    shadows: &wgpu::Texture,
    receivers: &[Sphere],
) -> ([GpuLight; MAX_LIGHTS], Vec<(LightView, wgpu::TextureView)>) {
    let (center, radius) = bounding_sphere(scene);
    let mut gpu_lights: [GpuLight; MAX_LIGHTS] = bytemuck::Zeroable::zeroed();
    let mut layers = Vec::new();
    for (slot, light) in gpu_lights.iter_mut().zip(lamps) {
        let shadow = light.casts_shadow.then(|| {
            let view = LightView::fit(&light.kind, center, radius).narrowed(&light.kind, receivers);
            let layer = layers.len() as u32;
            let target = shadows.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            });
            layers.push((view, target));
            (layer, view)
        });
        *slot = GpuLight::new(light, shadow);
    }
    (gpu_lights, layers)
}

/// A sphere around all heads with room for their expressions, metres.
pub(crate) fn bounding_sphere(scene: &Scene<'_>) -> (Vec3, f32) {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for instance in scene.heads {
        let place = world_from_head(instance);
        let (a, b) = instance.head.bounds;
        for i in 0..8 {
            let corner = Vec3::new(
                if i & 1 == 0 { a.x } else { b.x },
                if i & 2 == 0 { a.y } else { b.y },
                if i & 4 == 0 { a.z } else { b.z },
            );
            let p = place.transform_point3(corner);
            (low, high) = (low.min(p), high.max(p));
        }
    }
    if low.x > high.x {
        return (Vec3::ZERO, 1.0);
    }
    (0.5 * (low + high), 0.52 * (high - low).length())
}

/// Irradiance / pi that hair sees on average: the mean of the environment and half of the lamps that reach it.
pub(crate) fn average_light(scene: &Scene<'_>) -> Vec3 {
    let (center, _) = bounding_sphere(scene);
    let lamps: Vec3 = scene
        .lights
        .iter()
        .map(|l: &Light| match l.kind {
            LightKind::Directional { .. } => l.color_linear,
            LightKind::Spot { position, .. } | LightKind::Point { position } => {
                l.color_linear / position.distance_squared(center).max(1e-4)
            }
        })
        .sum();
    let sky = scene.environment.map_or(Vec3::ZERO, |e| {
        scene.environment_intensity * Vec3::new(e.harmonics[0][0], e.harmonics[0][1], e.harmonics[0][2])
    });
    sky + lamps * (0.25 / std::f32::consts::PI)
}
