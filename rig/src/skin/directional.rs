//! Directional dipole: a BSSRDF of positions, normals and the direction of the light (Frisvad, Hachisuka and Kjeldsen
//! 2014).
//!
//! ```text
//! light from outside --refract--> ray source --(real - mirrored about n*)--> S_d(way, normals, refracted direction)
//! S_d on a plane, mean of all directions of a uniform sky --> R(r), for methods that know only a distance
//! ```
//!
//! Theory: the diffusion field of a ray of light in an infinite medium, a monopole and a dipole along the ray, and its mirror image in a
//! plane that contains the way from entry to exit (n*), so that the boundary need not be flat. Near the entry the
//! distance is regularised by the depth from which light can come.
//!
//! Units: S_d in mm^-2 sr^-1 per unit of light that passed the boundary. [`DirectionalDipole::exitance`] is S_d over all directions of exit,
//! with the share that the boundary reflects back inside: mm^-2, as R(r) of the other models.
//!
//! Limits: diffusion theory, so dense media; S_d is cut at zero. Light is not conserved: at normal incidence on a plane its
//! total is 1.29, 1.60 and 2.35 times that of a photon walk at reduced albedos of 0.99, 0.9 and 0.7 (index 1.4), so
//! pictures use it relative to its own total under a uniform sky. Not reciprocal: the direction of exit is not an
//! argument.

use std::f64::consts::PI;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::medium::{Boundary, Medium, fresnel_from_inside};
use super::numerics::{gauss_legendre, integrate};
use super::table::RadialTable;
use crate::error::SkinError;

/// From the place where light enters to the place where it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Exit minus entry, mm.
    pub way_mm: DVec3,
    /// Unit normal at the entry, outwards.
    pub normal_in: DVec3,
    /// Unit normal at the exit, outwards.
    pub normal_out: DVec3,
    /// Unit direction of the light behind the boundary, inwards: see [`refracted`].
    pub refracted: DVec3,
}

/// Direction of light behind a boundary: `to_light` and `normal` are unit vectors, `eta` is inside over outside.
/// `None` for total reflection, which needs an eta under 1.
pub fn refracted(to_light: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = normal.dot(to_light);
    let inside = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    (inside >= 0.0).then(|| ((cosine / eta - inside.sqrt()) * normal - to_light / eta).normalize())
}

/// What a directional dipole is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionalMedium {
    /// The reduced medium.
    #[serde(flatten)]
    pub medium: Medium,
    /// Mean cosine g, -1 to 1. It sets the unreduced extinction, which is the depth from which light comes where the
    /// ray does not go away from the surface.
    pub anisotropy: f64,
}

/// The directional dipole of a medium, and its mean over directions as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DirectionalMedium", into = "DirectionalMedium")]
pub struct DirectionalDipole {
    shape: DirectionalMedium,
    numbers: DirectionalNumbers,
    mean: RadialTable,
}

/// The constants of the model: everything that an evaluation needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalNumbers {
    /// Index of refraction inside over outside.
    pub eta: f64,
    /// Diffusion coefficient D = 1 / (3 sigma_t'), mm.
    pub diffusion_mm: f64,
    /// sqrt(sigma_a / D), 1/mm.
    pub sigma_tr_per_mm: f64,
    /// Extrapolation distance `2.131 D / sqrt(alpha')`, mm.
    pub d_e_mm: f64,
    /// Reflection at the boundary in the extrapolation, A.
    pub a_e: f64,
    /// Square of the least distance where light does not come from below the exit: `1 / (3 sigma_t)^2`, mm^2.
    pub least_mm2: f64,
    /// `(1 - 2 C1) / 4` of the boundary seen from inside.
    pub c_phi: f64,
    /// `(1 - 3 C2) / 2` of the boundary seen from inside.
    pub c_e: f64,
}

impl DirectionalNumbers {
    fn new(shape: &DirectionalMedium) -> Self {
        let DirectionalMedium { medium, anisotropy } = *shape;
        let boundary = Boundary::new(medium.eta);
        let diffusion_mm = medium.mean_free_path_mm() / 3.0;
        let sigma_t = medium.sigma_s_prime_per_mm / (1.0 - anisotropy) + medium.sigma_a_per_mm;
        Self {
            eta: medium.eta,
            diffusion_mm,
            sigma_tr_per_mm: (medium.sigma_a_per_mm / diffusion_mm).sqrt(),
            d_e_mm: 2.131 * diffusion_mm / medium.albedo().sqrt(),
            a_e: boundary.a_e,
            least_mm2: (3.0 * sigma_t).powi(-2),
            c_phi: boundary.c_phi,
            c_e: boundary.c_e,
        }
    }

    /// Exitance of the real or the mirrored source: `x` from the source to the exit, its direction, the distance, and
    /// the normal at the exit.
    fn source(&self, x: DVec3, direction: DVec3, r: f64, normal: DVec3) -> f64 {
        let (d, s) = (self.diffusion_mm, self.sigma_tr_per_mm * r);
        let (along, up) = (x.dot(direction), x.dot(normal));
        let one = 1.0 + s;
        let fluence = r * r / d + 3.0 * one * along;
        let flux = 3.0 * d * one * direction.dot(normal)
            - (one + 3.0 * d * (3.0 * one + s * s) / (r * r) * along) * up;
        (-s).exp() / (4.0 * PI * r.powi(3)) * (self.c_phi * fluence - self.c_e * flux)
    }

    /// Light that leaves at the exit in all directions, mm^-2 per unit of light that passed the boundary at the entry;
    /// 0 or more, finite wherever the way or the regularised distance is above zero.
    pub fn exitance(&self, passage: &Passage) -> f64 {
        let Passage { way_mm: x, normal_in, normal_out, refracted } = *passage;
        let square = x.length_squared();
        // Normal of the mirror plane, at right angles to the way (eq. 22): the normal at the entry where there is none.
        let tilted = normal_in * square - x * x.dot(normal_in);
        let mirror =
            if tilted.length_squared() > 1e-12 * square * square { tilted.normalize() } else { normal_in };
        let source_v = 2.0 * self.a_e * self.d_e_mm * mirror;
        let direction_v = refracted - 2.0 * refracted.dot(mirror) * mirror;
        let mu = -normal_out.dot(refracted);
        let (d, d_e) = (self.diffusion_mm, self.d_e_mm);
        let r_square = if mu > 0.0 {
            let across = (square - x.dot(refracted).powi(2)).max(0.0);
            let cos_beta = -(across / (square + d_e * d_e)).sqrt();
            square + d * mu * (d * mu - 2.0 * d_e * cos_beta)
        } else {
            square + self.least_mm2
        };
        let to_virtual = x - source_v;
        let real = self.source(x, refracted, r_square.max(1e-12).sqrt(), normal_out);
        let virtual_ = self.source(to_virtual, direction_v, to_virtual.length().max(1e-6), normal_out);
        (real - virtual_).max(0.0)
    }
}

/// Nodes over the cosine of incidence, and over half a turn around the entry.
const DIRECTIONS: usize = 12;
const TURNS: usize = 16;

impl DirectionalDipole {
    /// The dipole of a valid medium that absorbs (its mean is a table, which would be infinite without).
    pub fn new(shape: DirectionalMedium) -> Result<Self, SkinError> {
        let DirectionalMedium { medium, anisotropy } = shape;
        medium.validate()?;
        if !(-1.0 < anisotropy && anisotropy < 1.0) {
            return Err(SkinError::new("medium.anisotropy", anisotropy, "a mean cosine between -1 and 1"));
        }
        if medium.albedo() > 0.99999 {
            return Err(SkinError::new(
                "medium.albedo",
                medium.albedo(),
                "a reduced albedo of at most 0.99999",
            ));
        }
        let numbers = DirectionalNumbers::new(&shape);
        let mfp = medium.mean_free_path_mm();
        let (inner, outer) = (1e-3 * mfp, 15.0 * mfp.max(1.0 / numbers.sigma_tr_per_mm));
        let count = (24.0 * (outer / inner).log10()).ceil() as usize;
        let radii: Vec<f64> =
            (0..=count).map(|i| inner * (outer / inner).powf(i as f64 / count as f64)).collect();
        let sky = sky(medium.eta);
        let values = radii
            .iter()
            .map(|&r| sky.iter().map(|&(cosine, weight)| weight * ring(&numbers, r, cosine)).sum())
            .collect();
        Ok(Self { shape, numbers, mean: RadialTable::from_points(radii, values)? })
    }

    /// The constants of the model.
    pub fn numbers(&self) -> &DirectionalNumbers {
        &self.numbers
    }

    /// Light that leaves at the exit in all directions: [`DirectionalNumbers::exitance`].
    pub fn exitance(&self, passage: &Passage) -> f64 {
        self.numbers.exitance(passage)
    }

    /// S_d, mm^-2 sr^-1: radiance of the exit per unit of light that passed the boundary at the entry, before the boundary takes
    /// its share on the way out.
    pub fn bssrdf(&self, passage: &Passage) -> f64 {
        self.exitance(passage) / (4.0 * PI * Boundary::new(1.0 / self.numbers.eta).c_phi)
    }

    /// R(r) on a plane under a uniform sky: the mean over all directions of light, each by what passes the boundary.
    pub fn table(&self) -> &RadialTable {
        &self.mean
    }

    /// Light that leaves a plane inside of a disk around the entry, per unit of light that passed the boundary at this
    /// cosine of incidence (outside, 0 to 1). An infinite radius gives the total.
    pub fn light_inside(&self, r_mm: f64, cosine: f64) -> f64 {
        let rule = gauss_legendre(8);
        let mfp = self.shape.medium.mean_free_path_mm();
        let outer = r_mm.min(20.0 * mfp.max(1.0 / self.numbers.sigma_tr_per_mm));
        let (mut sum, mut near) = (0.0, 0.0);
        let mut step = 0.05 * mfp;
        while near < outer {
            let far = (near + step).min(outer);
            sum += integrate(&rule, near, far, |r| 2.0 * PI * r * ring(&self.numbers, r, cosine));
            near = far;
            step *= 1.6;
        }
        sum
    }
}

/// Cosines of incidence and their shares of the light of a uniform sky that passes the boundary.
fn sky(eta: f64) -> Vec<(f64, f64)> {
    let rule = gauss_legendre(DIRECTIONS);
    let passing = |mu: f64| mu * (1.0 - fresnel_from_inside(mu, 1.0 / eta));
    let nodes: Vec<(f64, f64)> =
        rule.iter().map(|&(x, w)| (0.5 + 0.5 * x, w)).map(|(mu, w)| (mu, w * passing(mu))).collect();
    let total: f64 = nodes.iter().map(|n| n.1).sum();
    nodes.into_iter().map(|(mu, w)| (mu, w / total)).collect()
}

/// Mean exitance of a plane on a ring around the entry, for a cosine of incidence.
fn ring(numbers: &DirectionalNumbers, r_mm: f64, cosine: f64) -> f64 {
    let to_light = DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let Some(refracted) = refracted(to_light, DVec3::Z, numbers.eta) else { return 0.0 };
    let at = |i: usize| {
        let turn = PI * (i as f64 + 0.5) / TURNS as f64;
        let way_mm = r_mm * DVec3::new(turn.cos(), turn.sin(), 0.0);
        numbers.exitance(&Passage { way_mm, normal_in: DVec3::Z, normal_out: DVec3::Z, refracted })
    };
    (0..TURNS).map(at).sum::<f64>() / TURNS as f64
}

impl TryFrom<DirectionalMedium> for DirectionalDipole {
    type Error = SkinError;

    fn try_from(shape: DirectionalMedium) -> Result<Self, SkinError> {
        Self::new(shape)
    }
}

impl From<DirectionalDipole> for DirectionalMedium {
    fn from(dipole: DirectionalDipole) -> Self {
        dipole.shape
    }
}

#[cfg(test)]
mod tests;
