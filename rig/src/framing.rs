//! Where the face of a head is, and where a camera stands for a named framing.

use glam::Vec3;

use crate::camera::LensState;
use crate::evaluate::CameraState;
use crate::head::Head;
use crate::timeline::Framing;

/// Place and size of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceFrame {
    /// Middle between the eyes, metres: the origin of a sequence's positions.
    pub origin: Vec3,
    /// From the top of the head to the chin, metres.
    pub head_height: f32,
}

/// Vertical field of view of a framing, radians (22 degrees): that of a portrait lens, which does not enlarge the nose.
const PORTRAIT_FOV_Y: f32 = 0.384;
/// A picture is at least this wide in units of the framing's height; a narrower one is taken from further away.
const LEAST_ASPECT: f32 = 0.8;

impl FaceFrame {
    /// From landmarks where the head has them, else from its bounds by the proportions of a human head.
    pub fn of(head: &Head) -> Self {
        // From the top of the head to the chin of a tall adult, metres. Whatever is lower is neck and shoulders.
        const TALLEST_HEAD: f32 = 0.24;
        let landmark = |name: &str| head.landmarks.get(name).copied();
        let (low, high) = head.bounds().unwrap_or((Vec3::splat(-0.12), Vec3::splat(0.12)));
        let bounds_height = (high.y - low.y).min(TALLEST_HEAD);
        let head_height = match (landmark("vertex"), landmark("menton")) {
            (Some(top), Some(chin)) if top.y > chin.y => top.y - chin.y,
            _ => bounds_height,
        };
        let origin = match (landmark("eye-left"), landmark("eye-right")) {
            (Some(left), Some(right)) => 0.5 * (left + right),
            // Eyes lie halfway down the head and about a seventh of its height behind the tip of the nose.
            _ => {
                Vec3::new(0.5 * (low.x + high.x), high.y - 0.5 * bounds_height, high.z - 0.15 * bounds_height)
            }
        };
        Self { origin, head_height: head_height.max(1e-3) }
    }

    /// The camera of a framing: straight in front of the face. `fov_y` in radians replaces the portrait lens and keeps
    /// the size of the face by moving the camera; `aspect` is width over height of the picture.
    pub fn camera(&self, framing: Framing, fov_y: Option<f32>, aspect: f32) -> CameraState {
        // Height of the picture at the eyes' depth and how far its middle lies below the eyes, in head heights.
        // Judged on pictures of the default head.
        let (height, below) = match framing {
            Framing::Close => (0.85, 0.14),
            Framing::Head => (1.42, 0.04),
            Framing::Bust => (2.4, 0.4),
        };
        let fov_y = fov_y.unwrap_or(PORTRAIT_FOV_Y);
        let widen = (LEAST_ASPECT / aspect).max(1.0);
        let distance = 0.5 * height * self.head_height * widen / (0.5 * fov_y).tan();
        let target = self.origin - Vec3::Y * (below * self.head_height);
        CameraState {
            position: target + Vec3::Z * distance,
            target,
            up: Vec3::Y,
            fov_y,
            lens: LensState::default(),
        }
    }
}
