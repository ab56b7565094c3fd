//! The view of a frame as shaders read it.

use glam::{Mat4, Vec2, Vec3};

use super::clusters::{Sphere, Viewer, visible};
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
    pub(crate) windows: [[u32; 4]; WINDOWS],
}

/// [`MAX_HEADS`], rounded up.
const WINDOWS: usize = 32;

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
    /// Of each head.
    pub(crate) windows: Vec<Window>,
}

/// The pixels that a head may cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Window {
    pub(crate) first: [u32; 2],
    pub(crate) size: [u32; 2],
    /// Width of a pixel on the nearest part of the head, metres; 0 where the camera is inside of its box.
    pub(crate) pixel_metres: f32,
}

impl Seen {
    /// Workgroups of 8 x 8 pixels for the window of a head; the whole picture where none is known.
    pub(crate) fn groups(&self, head: u32) -> [u32; 3] {
        let [x, y] = self.windows.get(head as usize).map_or(self.ids.size(), |w| w.size);
        [x.div_ceil(8), y.div_ceil(8), 1]
    }

    /// Width of a pixel on the nearest part of a head, metres; 0 where it is not known.
    pub(crate) fn pixel_metres(&self, head: u32) -> f32 {
        self.windows.get(head as usize).map_or(0.0, |w| w.pixel_metres)
    }
}

/// Pixels around a window: samples lie beside the middle of their pixel.
const RIM: f32 = 2.0;
/// How far shapes move a face out of the box of the neutral one.
const BULGE_METRES: f32 = 0.01;
/// Room around what shapes move, metres: eyeballs turn in their sockets.
const ROOM_METRES: f32 = 0.003;

/// The pixels that each head may cover; all of them for the first, whose invocations also write what no head covers.
pub(crate) fn windows(scene: &Scene<'_>, size: [u32; 2]) -> Vec<Window> {
    let clip_from_view = scene.camera.clip_from_view(size[0] as f32 / size[1] as f32);
    let viewer = Viewer {
        position: scene.camera.position,
        clip_from_world: clip_from_view * scene.camera.view_from_world(),
        margin: 1.0,
        sees_backs: true,
    };
    let of = |index: usize, instance: &HeadInstance<'_>| {
        let pixel_metres = nearest_pixel_metres(scene, size, instance);
        let whole = Window { first: [0; 2], size, pixel_metres };
        if index == 0 {
            return whole;
        }
        let place = world_from_head(instance);
        let parts = visible(&instance.head.clusters, &instance.state.shapes, place, &viewer);
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for Sphere { center, radius } in parts {
            let view = scene.camera.view_from_world().transform_point3(center);
            let (radius, depth) = (radius + ROOM_METRES, -view.z);
            if depth - radius < NEAR_METRES {
                return whole;
            }
            // The sides of a box around the sphere, at its nearest and farthest depth.
            for depth in [depth - radius, depth + radius] {
                for side in [-radius, radius] {
                    let clip = clip_from_view * (view.truncate() + side).extend(-depth).extend(1.0);
                    let pixel = (clip.truncate().truncate() / clip.w * Vec2::new(0.5, -0.5) + 0.5)
                        * Vec2::new(size[0] as f32, size[1] as f32);
                    (low, high) = (low.min(pixel), high.max(pixel));
                }
            }
        }
        if low.x > high.x {
            return Window { size: [0; 2], ..whole };
        }
        let first = (low - RIM).floor().max(Vec2::ZERO).as_uvec2();
        let end = (high + RIM).ceil().max(Vec2::ZERO).as_uvec2().min(size.into());
        Window { first: first.to_array(), size: end.saturating_sub(first).to_array(), pixel_metres }
    };
    scene.heads.iter().enumerate().map(|(i, head)| of(i, head)).collect()
}

/// Width of a pixel on the nearest part of a head, metres; 0 where the camera is inside of its box.
pub(crate) fn nearest_pixel_metres(scene: &Scene<'_>, size: [u32; 2], instance: &HeadInstance<'_>) -> f32 {
    let (low, high) = instance.head.bounds;
    let camera = world_from_head(instance).inverse().transform_point3(scene.camera.position);
    let distance = camera.distance(camera.clamp(low, high)) - BULGE_METRES;
    let pixels_per_radian = 0.5 * size[1] as f32 / (0.5 * scene.camera.fov_degrees.to_radians()).tan();
    distance.max(0.0) / pixels_per_radian
}

/// The view of a frame as shaders read it.
pub(crate) fn view(
    scene: &Scene<'_>,
    lamps: &[Light],
    size: [u32; 2],
    [jitter, shading_jitter]: [[f32; 2]; 2],
    windows: &[Window],
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
        windows: std::array::from_fn(|i| {
            windows.get(i).map_or([0; 4], |w| [w.first[0], w.first[1], w.size[0], w.size[1]])
        }),
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
