//! The scene of a frame: heads, camera, lights, environment.

use glam::camera::rh;
use glam::{Mat4, Vec3};
use rubor_rig::face_state::FaceState;

pub(crate) mod authored;
mod clusters;
mod environment;
pub mod footprint;
pub(crate) mod hair_roots;
pub(crate) mod head;
pub(crate) mod lamp;
pub(crate) mod level;
mod optics;
pub(crate) mod placement;
pub(crate) mod posed_head;
pub(crate) mod strands;
pub(crate) mod view;

pub use environment::{Environment, EnvironmentMap};
pub use head::{
    ColorTable, HeadOnGpu, Ladder, MAX_DISTRIBUTIONS, MAX_HEMOGLOBIN, MAX_MELANIN, MAX_WRINKLE_MAPS,
    MAX_ZONES, triangles_of_ids,
};
pub use optics::Optics;
pub(crate) use posed_head::PosedHead;

/// Lights that one frame can have; each may have a shadow map.
pub const MAX_LIGHTS: usize = 8;
/// Heads that one frame can show: the id of a visible triangle has 5 bits for its head.
pub const MAX_HEADS: usize = 31;

/// Everything in a frame.
pub struct Scene<'a> {
    /// At most [`MAX_HEADS`].
    pub heads: &'a [HeadInstance<'a>],
    /// The view.
    pub camera: Camera,
    /// At most [`MAX_LIGHTS`].
    pub lights: &'a [Light],
    /// Light from all directions; without it only `lights` shine.
    pub environment: Option<&'a Environment>,
    /// Rotation of the environment about +Y, radians; positive turns the surroundings to the left of a viewer who
    /// looks along -Z.
    pub environment_rotation: f32,
    /// Factor of the environment's radiance.
    pub environment_intensity: f32,
    /// Radiance behind the heads, linear Rec. 709.
    pub background_linear: Vec3,
    /// Lens, place of the backdrop, number of the frame. The default is a pinhole.
    pub optics: Optics,
}

/// A head at a place in a state.
pub struct HeadInstance<'a> {
    /// Its geometry and maps.
    pub head: &'a HeadOnGpu,
    /// Its weights.
    pub state: &'a FaceState,
    /// Rigid placement (rotation and translation only: millimetres stay millimetres).
    pub world_from_head: Mat4,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Metres.
    pub position: Vec3,
    /// Metres; must differ from `position`.
    pub target: Vec3,
    /// Upwards in the picture; must not be parallel to the view.
    pub up: Vec3,
    /// Vertical field of view, degrees, above 0 and below 170.
    pub fov_degrees: f32,
}

/// Distance of the near plane, metres: small enough for a close-up of an eye. The far plane is at infinity.
pub const NEAR_METRES: f32 = 0.01;

impl Camera {
    /// World to view: right-handed, the camera looks along -Z.
    pub fn view_from_world(&self) -> Mat4 {
        rh::view::look_at_mat4(self.position, self.target, self.up)
    }

    /// View to clip with infinite reversed depth: depth = near / distance, so 1 is near and 0 infinitely far.
    pub fn clip_from_view(&self, aspect: f32) -> Mat4 {
        rh::proj::directx::perspective_infinite_reverse(self.fov_degrees.to_radians(), aspect, NEAR_METRES)
    }
}

/// A lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Shape and place.
    pub kind: LightKind,
    /// Irradiance on a surface that faces the light (at 1 m for lamps with a place), linear Rec. 709.
    pub color_linear: Vec3,
    /// Radius of the source: metres for lamps with a place, tangent of the angular radius for a directional one
    /// (0.0047 is the sun). Sets the width of penumbrae.
    pub radius: f32,
    /// Whether it casts shadows.
    pub casts_shadow: bool,
}

/// Shape and place of a lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel rays; `direction` points from the light to the scene.
    Directional {
        /// Any length above zero.
        direction: Vec3,
    },
    /// A cone; irradiance falls with the square of the distance.
    Spot {
        /// Metres.
        position: Vec3,
        /// From the lamp to the scene, any length above zero.
        direction: Vec3,
        /// Half angle at which the light reaches zero, degrees, 0 to 89.
        outer_degrees: f32,
        /// Half angle within which the light is full, degrees, below `outer_degrees`.
        inner_degrees: f32,
    },
    /// Light in all directions from a place. Its shadow map covers the heads only.
    Point {
        /// Metres.
        position: Vec3,
    },
}

impl LightKind {
    /// Place, for lamps that have one.
    pub fn position(&self) -> Option<Vec3> {
        match *self {
            LightKind::Directional { .. } => None,
            LightKind::Spot { position, .. } | LightKind::Point { position } => Some(position),
        }
    }
}
