//! Subsurface scattering in screen space: diffuse radiance of a white surface, blurred by the diffusion profile.
//!
//! ```text
//! irradiance (a = depth), strength, depth --the method of the frame--> scattered (rgba16f, linear Rec. 709)
//! ```
//!
//! All methods follow the same rules: kernels are in millimetres on the surface, projected with the depth, field of
//! view and tilt at each pixel and scaled by its strength; a neighbour off the tangent plane of the centre, or one that
//! is not skin, is replaced by the centre; a pixel whose kernel is under half a pixel keeps its light; weights sum to
//! one, so uniform light stays uniform.
//!
//! Does not: scatter across depth steps, or through thin parts (that is transmittance, in `shade`).

pub(crate) mod disk;
pub(crate) mod exact;
pub(crate) mod gather;
pub(crate) mod gauss;
pub(crate) mod jitter;
pub(crate) mod line;
pub(crate) mod separable;

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

use crate::device::wgsl::{Module, module};
pub(crate) use crate::passes::shade::FOLLOW_PER_MM;

/// Modules that the shaders of all screen methods share.
pub(crate) const COMMON: Module = module!("screen_common", "common.wesl");
