//! Lamps as places see them: the light of a point, from the places of a disk.

use std::f32::consts::TAU;

use glam::Vec3;

use crate::evaluate::LightState;
use crate::head::MM_PER_METRE;
use crate::timeline::LightKind;

/// A lamp. A lamp with a place lights as a point does and is as wide as a disk that faces what it lights, which is how the
/// renderer makes soft shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    kind: LightKind,
    /// Irradiance (directional), or that at a metre.
    power_linear: Vec3,
    position_mm: Vec3,
    /// Towards the lamp, of a directional one.
    towards: Vec3,
    /// Direction of a spot.
    axis: Vec3,
    /// Cosines of half angles: fully lit, dark.
    cone: [f32; 2],
    /// Radius in mm, or its tangent for a directional lamp.
    radius: f32,
}

/// Light that arrives from one place of a lamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arriving {
    /// Unit direction to it.
    pub(super) to_lamp: Vec3,
    pub(super) distance_mm: f32,
    /// Irradiance of a surface that faces it.
    pub(super) irradiance: Vec3,
}

impl Lamp {
    /// A lamp of a shot. `radius_m` is that of a lamp with a place, `tangent` that of a directional one: half of what it
    /// subtends. Every lamp casts shadows.
    pub fn new(state: &LightState, radius_m: f32, tangent: f32) -> Self {
        let directional = state.kind == LightKind::Directional;
        Self {
            kind: state.kind,
            power_linear: state.power_linear,
            position_mm: MM_PER_METRE * state.position,
            towards: -state.direction,
            axis: state.direction,
            cone: state.cone_half_angles.map(f32::cos),
            radius: if directional { tangent } else { MM_PER_METRE * radius_m },
        }
    }

    /// Light from the place `at` of its disk, two numbers from 0 to 1; (0, 0) is the middle.
    pub(super) fn arriving(&self, place_mm: Vec3, at: [f32; 2]) -> Arriving {
        let (sin, cos) = (TAU * at[1]).sin_cos();
        let offset = |axis: Vec3| {
            let (t, b) = axis.any_orthonormal_pair();
            self.radius * at[0].sqrt() * (cos * t + sin * b)
        };
        if self.kind == LightKind::Directional {
            let to_lamp = (self.towards + offset(self.towards)).normalize();
            return Arriving { to_lamp, distance_mm: f32::INFINITY, irradiance: self.power_linear };
        }
        let way = self.position_mm - place_mm;
        let distance_mm = way.length();
        let axis = way / distance_mm;
        let metres = distance_mm / MM_PER_METRE;
        let mut irradiance = self.power_linear / (metres * metres);
        if self.kind == LightKind::Spot {
            irradiance *= smoothstep(self.cone[1], self.cone[0], -axis.dot(self.axis));
        }
        let way = way + offset(axis);
        let distance_mm = way.length();
        Arriving { to_lamp: way / distance_mm, distance_mm, irradiance }
    }
}

fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low).max(1e-4)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
