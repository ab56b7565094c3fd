//! The view of a frame as shaders read it.

use glam::{Mat4, Vec3};

use super::placement::world_from_head;
use super::{HeadInstance, Light, NEAR_METRES, Scene};
use crate::device::Image;

/// The view as view.wesl reads it.
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
    pub(crate) environment_turn: f32,
}

/// What the camera sees through one sample of each pixel.
pub(crate) struct Seen {
    /// The [`View`].
    pub(crate) view: wgpu::Buffer,
    /// Pixels per millimetre of the farthest head.
    pub(crate) pixels_per_mm: f64,
    /// r32uint: head << 27 | triangle + 1, 0 = nothing.
    pub(crate) ids: Image,
    /// Reversed, infinite.
    pub(crate) depth: Image,
}

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
        // Depths near that of the nearest head are the most precise.
        depth_origin_mm: 1000.0 * head_depths(scene, view_from_world).reduce(f32::min).unwrap_or(0.0),
        environment_turn: scene.environment_rotation / (2.0 * std::f32::consts::PI),
    }
}

/// View depths of the heads before the camera, between middle and front, metres.
fn head_depths<'a>(scene: &'a Scene<'_>, view_from_world: Mat4) -> impl Iterator<Item = f32> + 'a {
    let depth = move |instance: &HeadInstance<'_>| {
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
