//! The state of a face at one moment: everything that the renderer needs besides the head itself.

use glam::{Quat, Vec3};

use crate::head::Head;
use crate::life::CALM_PUPIL_MM;

/// Weights of one moment, resolved against one head. Everything is an index into the head; there are no names.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceState {
    /// Weight of each of [`Head::shapes`], combinations and in-betweens included. 0 to 1, and beyond where the
    /// track of a single shape goes there.
    pub shapes: Vec<f32>,
    /// Weight of each of `maps.zones`, 0 to 1: already summed over expressions and clamped (Jimenez 2012 section 8.2).
    pub zones: Vec<f32>,
    /// Weight of each of `maps.distributions`; the neutral distribution has the rest, `1 - sum`.
    pub distributions: Vec<f32>,
    /// Global factor of hemoglobin (Jimenez 2012 section 7.7: 1.27 for anger, 0.81 for fear); 1 is neutral.
    pub hemoglobin_scale: f32,
    /// Diameter of the pupils, millimetres.
    pub pupil_mm: f32,
    /// Rotation of the head about the origin of its space: where the skull rests on the neck.
    pub head_rotation: Quat,
    /// Translation after the rotation, metres.
    pub head_translation: Vec3,
}

impl FaceState {
    /// The neutral face of a head.
    pub fn neutral(head: &Head) -> Self {
        Self {
            shapes: vec![0.0; head.shapes.len()],
            zones: vec![0.0; head.maps.zones.len()],
            distributions: vec![0.0; head.maps.distributions.len()],
            hemoglobin_scale: 1.0,
            pupil_mm: CALM_PUPIL_MM,
            head_rotation: Quat::IDENTITY,
            head_translation: Vec3::ZERO,
        }
    }
}
