//! Placement of the camera, the heads, the lamps and their shadow maps in a frame.

use glam::{Mat4, Vec3};

use super::clusters::{self, Sphere, Viewer};
use super::{HeadInstance, Light, LightKind, Scene};

/// Placement of a head: its own motion first, then its place in the scene.
pub(crate) fn world_from_head(instance: &HeadInstance<'_>) -> Mat4 {
    instance.world_from_head
        * Mat4::from_rotation_translation(instance.state.head_rotation, instance.state.head_translation)
}

/// The parts of the heads that are lit for a picture of a size: those in the camera's view, `margin` times as large as
/// the picture, and those that face away if `sees_backs`.
pub(crate) fn receivers(scene: &Scene<'_>, size: [u32; 2], margin: f32, sees_backs: bool) -> Vec<Sphere> {
    let [width, height] = size;
    let clip_from_view = scene.camera.clip_from_view(width as f32 / height as f32);
    let viewer = Viewer {
        position: scene.camera.position,
        clip_from_world: clip_from_view * scene.camera.view_from_world(),
        margin,
        sees_backs,
    };
    let of_head = |h: &HeadInstance<'_>| {
        clusters::visible(&h.head.clusters, &h.state.shapes, world_from_head(h), &viewer)
    };
    scene.heads.iter().flat_map(of_head).collect()
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
        scene.environment_intensity * Vec3::new(e.harmonics[0].x, e.harmonics[0].y, e.harmonics[0].z)
    });
    sky + lamps * (0.25 / std::f32::consts::PI)
}
