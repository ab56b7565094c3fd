//! Light in the volume of a head, by path tracing: what every model of scattering is an approximation of.
//!
//! ```text
//! head in a pose --Body--> closed surface, blockers, tree of triangles
//! camera ray --> boundary: refract --> flight --> boundary? Fresnel: out (-> skin again, or away) | back in
//!                                       ^  |  \-- light of lamps through the boundary here
//!                                       |  v
//!                                      collision: isotropic, times albedo
//!                                          \-- light of lamps through the boundary nearby
//! ```
//!
//! Theory: the equation of transfer in a homogeneous medium of isotropic scatterers ([`super::medium::Medium`]) inside of a
//! closed surface, `L(x, w) = integral of e^(-sigma_t s) sigma_s (mean over all directions of L) ds`, plus the light at the
//! boundary times `e^(-sigma_t d)` (Chandrasekhar 1960). The boundary is a rough dielectric (Walter et al. 2007): [`Boundary`].
//! Paths begin at the camera, fly `-ln u / sigma_t` (one channel of three is drawn for; the balance heuristic of Veach and
//! Guibas 1995 joins them, as in Wilkie et al. 2014), and end by chance as they grow dim.
//!
//! Lamps are points or small disks that no path finds by itself. So each meeting with the boundary asks for their light
//! through it; and since microfacets refract a lamp into a narrow cone that few flights hit, each collision also looks back
//! along a direction drawn from the microfacets where that light is likely to enter. The balance heuristic joins both.
//!
//! *Diffuse light* is the light of paths that were refracted where the camera sees the skin and scattered inside at least
//! once. It includes light that left and entered elsewhere. What the surface reflects to the camera is summed by itself.
//!
//! Where a head is not a perfect solid:
//! - The lining of mouth and eyes is tissue of the same medium; open rims (the neck) are closed by fans of triangles.
//! - Eyes, teeth, gums and other parts are black.
//! - Where surfaces overlap, as lips may, the triangle that is met says from which side it was met.
//! - Normals are interpolated; the side is that of the triangle. A direction that leaves on the wrong side of the triangle is
//!   mirrored at it. Rays to lamps begin on the tangent planes of the corners (Hanika 2021), so facets of a terminator do not
//!   show; light may so reach a place that its triangle just hides. [`Normals::Facets`] has none of this.
//!
//! Does not: layers, anisotropic scattering (a reduced medium stands for it), polarisation, light that meets a second
//! microfacet, skies of pictures.
//!
//! Cost: about 40 microseconds for a path in the built-in head (47 000 triangles) under one lamp, one core of a server of 2023.
//!
//! Same seed, same light, on any number of threads: each pixel has random numbers of its own.

mod body;
mod boundary;
mod lamp;
mod picture;
mod walk;

use glam::Vec3;
use serde::{Deserialize, Serialize};

pub use body::{Body, Normals};
pub use boundary::{Boundary, Masking};
pub use lamp::Lamp;
pub use picture::{Filter, Options, Patch, Picture, View, flat_reflectance, patches, picture};
pub use walk::{Meet, Surroundings, What};

use crate::error::SkinError;
use crate::skin::medium::Medium;

/// R, G and B.
pub(crate) const CHANNELS: usize = 3;

/// A medium for each channel under one boundary.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flesh {
    /// Scattering coefficients, 1 / mm.
    scattering: Vec3,
    /// Extinction coefficients, 1 / mm.
    extinction: Vec3,
    boundary: Boundary,
}

impl Flesh {
    /// Media of R, G and B, which share an index, under a boundary of GGX roughness `alpha`.
    ///
    /// # Errors
    /// Media that are no media; indices that differ or are not above 1.05; an alpha out of range.
    pub fn new(media: &[Medium; CHANNELS], alpha: f64, masking: Masking) -> Result<Self, SkinError> {
        media.iter().try_for_each(Medium::validate)?;
        let eta = media[0].eta;
        if eta < 1.05 || media.iter().any(|m| m.eta != eta) {
            let found = media.map(|m| m.eta.to_string()).join(", ");
            return Err(SkinError::new("medium.eta", found, "the same index of 1.05 or more for R, G and B"));
        }
        if !(0.001..=1.0).contains(&alpha) {
            return Err(SkinError::new("boundary.alpha", alpha, "a roughness from 0.001 to 1"));
        }
        let each = |f: &dyn Fn(&Medium) -> f64| Vec3::from_array(media.each_ref().map(|m| f(m) as f32));
        Ok(Self {
            scattering: each(&|m| m.sigma_s_prime_per_mm),
            extinction: each(&|m| m.sigma_t_prime_per_mm()),
            boundary: Boundary { eta: eta as f32, alpha: alpha as f32, masking },
        })
    }

    /// The boundary.
    pub fn boundary(&self) -> &Boundary {
        &self.boundary
    }
}

#[cfg(test)]
mod tests;
