//! Profiles from diffusion theory: dipoles, the slab, normalized diffusion, photon beam diffusion.
//!
//! Every model gives R(r) per unit of light that passed the boundary. The light that is reflected back inside on its
//! way out is already subtracted; reflection on the way in belongs to the specular term.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::medium::{Boundary, Medium, fresnel_from_inside};
use super::numerics::{gauss_legendre, integrate};
use super::table::RadialTable;
use crate::error::SkinError;

/// `(1 + s d) e^(-s d) / (4 pi d^3)`: the flux of a source of strength one, over its signed depth.
fn flux(sigma_tr: f64, d: f64) -> f64 {
    (1.0 + sigma_tr * d) * (-sigma_tr * d).exp() / (4.0 * PI * d.powi(3))
}

/// Integral of `z flux(d)` outside of a disk: `z e^(-s d) / (2 d)`, signed as z is.
fn flux_beyond(sigma_tr: f64, z: f64, r_mm: f64) -> f64 {
    let d = r_mm.hypot(z);
    0.5 * z * (-sigma_tr * d).exp() / d
}

/// Standard dipole: Jensen, Marschner, Levoy and Hanrahan 2001.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Medium", into = "Medium")]
pub struct StandardDipole {
    medium: Medium,
    z_r: f64,
    z_v: f64,
    sigma_tr: f64,
}

impl StandardDipole {
    /// The dipole of a valid medium.
    pub fn new(medium: Medium) -> Result<Self, SkinError> {
        medium.validate()?;
        let Medium { sigma_a_per_mm, .. } = medium;
        let z_r = medium.mean_free_path_mm();
        let sigma_tr = (3.0 * sigma_a_per_mm * medium.sigma_t_prime_per_mm()).sqrt();
        Ok(Self { medium, z_r, z_v: z_r * (1.0 + 4.0 / 3.0 * egan_a(medium.eta)), sigma_tr })
    }

    /// R(r), mm^-2.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let term = |z: f64| z * flux(self.sigma_tr, r_mm.hypot(z));
        self.medium.albedo() * (term(self.z_r) + term(self.z_v))
    }

    /// Integral of R outside of a disk; `alpha'/2 (e^(-s z_r) + e^(-s z_v))` at 0.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let term = |z: f64| flux_beyond(self.sigma_tr, z, r_mm);
        self.medium.albedo() * (term(self.z_r) + term(self.z_v))
    }
}

/// `A = (1 + F) / (1 - F)` with the mean Fresnel reflectance of Egan, Hilgeman and Reichman 1973 as used by Jensen
/// et al. 2001; at a matched index the fit is forced to its limit, 1.
fn egan_a(eta: f64) -> f64 {
    let f = if eta > 1.0 {
        -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta
    } else if eta < 1.0 {
        // Fit of the same authors for light that meets a denser outside.
        -0.4399 + 0.7099 / eta - 0.3319 / (eta * eta) + 0.0636 / eta.powi(3)
    } else {
        0.0
    };
    (1.0 + f) / (1.0 - f)
}

/// Better dipole: d'Eon 2012, with Grosjean's diffusion coefficient and both terms of the exitance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Medium", into = "Medium")]
pub struct BetterDipole {
    medium: Medium,
    boundary: Boundary,
    diffusion: f64,
    z_r: f64,
    z_v: f64,
    sigma_tr: f64,
}

impl BetterDipole {
    /// The dipole of a valid medium.
    pub fn new(medium: Medium) -> Result<Self, SkinError> {
        medium.validate()?;
        let boundary = Boundary::new(medium.eta);
        let diffusion = grosjean(&medium);
        let z_r = medium.mean_free_path_mm();
        Ok(Self {
            medium,
            boundary,
            diffusion,
            z_r,
            z_v: -z_r - 4.0 * boundary.a_e * diffusion,
            sigma_tr: (medium.sigma_a_per_mm / diffusion).sqrt(),
        })
    }

    /// R(r), mm^-2.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        self.medium.albedo().powi(2) * self.exitance(self.z_r, self.z_v, r_mm)
    }

    /// Exitance at r of a unit source at depth `z_r` and its negative image at the height `-z_v`.
    fn exitance(&self, z_r: f64, z_v: f64, r_mm: f64) -> f64 {
        let (d_r, d_v) = (r_mm.hypot(z_r), r_mm.hypot(z_v));
        let fluence = |d: f64| (-self.sigma_tr * d).exp() / (4.0 * PI * self.diffusion * d);
        self.boundary.c_e * (z_r * flux(self.sigma_tr, d_r) - z_v * flux(self.sigma_tr, d_v))
            + self.boundary.c_phi * (fluence(d_r) - fluence(d_v))
    }

    /// Integral of R outside of a disk.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let s = self.sigma_tr;
        let (d_r, d_v) = (r_mm.hypot(self.z_r), r_mm.hypot(self.z_v));
        // (e^(-s d_r) - e^(-s d_v)) / s, which stays finite without absorption. d_v - d_r in the form without
        // cancellation at large radii.
        let gap = (self.z_v.powi(2) - self.z_r.powi(2)) / (d_r + d_v);
        let fluence = if s * gap > 0.0 { (-s * d_r).exp() * -(-s * gap).exp_m1() / s } else { gap };
        self.medium.albedo().powi(2)
            * (self.boundary.c_e * (flux_beyond(s, self.z_r, r_mm) - flux_beyond(s, self.z_v, r_mm))
                + self.boundary.c_phi * fluence / (2.0 * self.diffusion))
    }
}

/// Grosjean's diffusion coefficient, `(2 sigma_a + sigma_s') / (3 sigma_t'^2)`, mm.
fn grosjean(medium: &Medium) -> f64 {
    (2.0 * medium.sigma_a_per_mm + medium.sigma_s_prime_per_mm)
        / (3.0 * medium.sigma_t_prime_per_mm().powi(2))
}

macro_rules! as_medium {
    ($($model:ty),*) => {$(
        impl TryFrom<Medium> for $model {
            type Error = SkinError;

            fn try_from(medium: Medium) -> Result<Self, SkinError> {
                Self::new(medium)
            }
        }

        impl From<$model> for Medium {
            fn from(model: $model) -> Medium {
                model.medium
            }
        }
    )*};
}
as_medium!(StandardDipole, BetterDipole, PhotonBeamDiffusion);

/// Which side of a slab light leaves on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SlabSide {
    /// The side where it entered: reflectance.
    Lit,
    /// The other side: transmittance.
    Far,
}

/// Parameters of a slab: see [`MultipoleSlab::new`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlabShape {
    /// Medium of the slab.
    pub medium: Medium,
    /// Thickness, mm.
    pub thickness_mm: f64,
    /// The side that the profile describes.
    pub side: SlabSide,
}

/// Multipole for a slab with the same index on both sides: Donner and Jensen 2005.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SlabShape", into = "SlabShape")]
pub struct MultipoleSlab {
    shape: SlabShape,
    z_r: f64,
    z_b: f64,
    sigma_tr: f64,
}

impl MultipoleSlab {
    /// The profile of a slab that is thicker than a mean free path (a thinner one would hold no source).
    pub fn new(shape: SlabShape) -> Result<Self, SkinError> {
        let SlabShape { medium, thickness_mm, .. } = shape;
        medium.validate()?;
        let z_r = medium.mean_free_path_mm();
        if !(thickness_mm > z_r && thickness_mm.is_finite()) {
            return Err(SkinError::new(
                "slab.thickness_mm",
                thickness_mm,
                "a finite thickness of more than one reduced mean free path",
            ));
        }
        let sigma_tr = (3.0 * medium.sigma_a_per_mm * medium.sigma_t_prime_per_mm()).sqrt();
        Ok(Self { shape, z_r, z_b: 2.0 / 3.0 * egan_a(medium.eta) * z_r, sigma_tr })
    }

    /// Distance after which the poles repeat.
    fn period(&self) -> f64 {
        2.0 * (self.shape.thickness_mm + 2.0 * self.z_b)
    }

    /// Sums `f(z_+) - f(z_-)` over the pole pairs that contribute out to `r_mm`, farthest first.
    fn poles(&self, r_mm: f64, f: impl Fn(f64) -> f64) -> f64 {
        let pairs = (40.0 * r_mm / self.period()).ceil().clamp(60.0, 4000.0);
        let pair = |j: i32| {
            let shift = self.period() * j as f64;
            let (plus, minus) = (shift + self.z_r, shift - self.z_r - 2.0 * self.z_b);
            match self.shape.side {
                SlabSide::Lit => f(plus) - f(minus),
                SlabSide::Far => f(self.shape.thickness_mm - plus) - f(self.shape.thickness_mm - minus),
            }
        };
        let last = pairs as i32;
        // Without absorption the pairs fall as 1/j^3, so the rest is close to the last one times j^3 / (2 (j+1/2)^2);
        // with it the last one is nothing.
        let rest = (pair(last) + pair(-last)) * pairs.powi(3) / (2.0 * (pairs + 0.5).powi(2));
        rest + (1..=last).rev().map(|j| pair(j) + pair(-j)).sum::<f64>() + pair(0)
    }

    /// R(r) or T(r), mm^-2. Far out the alternating series can fall below zero by rounding; it is clamped to 0.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let sum = self.poles(r_mm, |z| z * flux(self.sigma_tr, r_mm.hypot(z)));
        (self.shape.medium.albedo() * sum).max(0.0)
    }

    /// Total in closed form (the pole pairs are a geometric series).
    pub fn total(&self) -> f64 {
        let (s, q_period) = (self.sigma_tr, self.period());
        let (z_r, z_b, t) = (self.z_r, self.z_b, self.shape.thickness_mm);
        let albedo = self.shape.medium.albedo();
        // Limit without absorption: reflectance and transmittance add up to the albedo.
        if s * q_period < 1e-5 {
            let far = 2.0 * (z_r + z_b) / q_period;
            return albedo * if self.shape.side == SlabSide::Far { far } else { 1.0 - far };
        }
        let e = |x: f64| (-s * x).exp();
        let series = 1.0 / -(-s * q_period).exp_m1();
        let image = z_r + 2.0 * z_b;
        0.5 * albedo
            * match self.shape.side {
                SlabSide::Lit => {
                    e(z_r)
                        + e(image)
                        + series
                            * (e(q_period + z_r) + e(q_period + image)
                                - e(q_period - z_r)
                                - e(q_period - image))
                }
                SlabSide::Far => {
                    series * (e(t - z_r) - e(t + image) - e(q_period - t + z_r) + e(q_period - t - image))
                }
            }
    }

    /// Integral outside of a disk, within a millionth of the total (the series ends).
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let within = |z: f64| flux_beyond(self.sigma_tr, z, 0.0) - flux_beyond(self.sigma_tr, z, r_mm);
        (self.total() - self.shape.medium.albedo() * self.poles(r_mm, within)).max(0.0)
    }
}

impl TryFrom<SlabShape> for MultipoleSlab {
    type Error = SkinError;

    fn try_from(shape: SlabShape) -> Result<Self, SkinError> {
        Self::new(shape)
    }
}

impl From<MultipoleSlab> for SlabShape {
    fn from(slab: MultipoleSlab) -> Self {
        slab.shape
    }
}

/// Normalized diffusion: `R = A (e^(-r/d) + e^(-r/(3d))) / (8 pi d r)`, Christensen and Burley 2015.
///
/// R is infinite at r = 0; its integral is finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NormalizedDiffusion {
    /// Total diffuse reflectance A.
    pub albedo: f64,
    /// Width d, mm.
    pub d_mm: f64,
}

impl NormalizedDiffusion {
    /// Checks `0 < albedo <= 1` and a positive finite width.
    pub fn new(albedo: f64, d_mm: f64) -> Result<Self, SkinError> {
        if !(albedo > 0.0 && albedo <= 1.0) {
            return Err(SkinError::new("normalized_diffusion.albedo", albedo, "above 0 and at most 1"));
        }
        if !(d_mm > 0.0 && d_mm.is_finite()) {
            return Err(SkinError::new("normalized_diffusion.d_mm", d_mm, "a positive finite width"));
        }
        Ok(Self { albedo, d_mm })
    }

    /// The published width `d = l / s`, `s = 1.85 - A + 7 |A - 0.8|^3` (searchlight configuration), for a mean free
    /// path l; it was fitted to an index-matched medium.
    pub fn published(albedo: f64, mean_free_path_mm: f64) -> Result<Self, SkinError> {
        let s = 1.85 - albedo + 7.0 * (albedo - 0.8).abs().powi(3);
        Self::new(albedo, mean_free_path_mm / s)
    }

    /// The published width for diffuse illumination, `s = 1.9 - A + 3.5 (A - 0.8)^2`.
    pub fn published_diffuse(albedo: f64, mean_free_path_mm: f64) -> Result<Self, SkinError> {
        let s = 1.9 - albedo + 3.5 * (albedo - 0.8).powi(2);
        Self::new(albedo, mean_free_path_mm / s)
    }

    /// R(r), mm^-2; infinite at 0.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let x = r_mm / self.d_mm;
        self.albedo * ((-x).exp() + (-x / 3.0).exp()) / (8.0 * PI * self.d_mm * r_mm)
    }

    /// Integral of R outside of a disk.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let x = r_mm / self.d_mm;
        self.albedo * (0.25 * (-x).exp() + 0.75 * (-x / 3.0).exp())
    }

    /// Exact inverse of the CDF (Golubev 2019): the cubic of `e^(-r / (3d))` in closed form.
    pub fn sample_radius(&self, u: f64) -> f64 {
        let v = 1.0 - u;
        if v <= 0.0 {
            return f64::INFINITY;
        }
        let g = 1.0 + 4.0 * v * (2.0 * v + (1.0 + 4.0 * v * v).sqrt());
        let root = g.cbrt();
        3.0 * self.d_mm * ((1.0 + root + 1.0 / root) / (4.0 * v)).ln().max(0.0)
    }
}

/// One term `weight e^(-r/l) / (2 pi l r)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExponentialTerm {
    /// Length l, mm.
    pub length_mm: f64,
    /// Energy of the term.
    pub weight: f64,
}

/// `R(r) = sum_i w_i e^(-r/l_i) / (2 pi l_i r)`: normalized diffusion with free lengths and weights.
///
/// Two terms of lengths d, 3d and weights A/4, 3A/4 are [`NormalizedDiffusion`]. Like it, R is infinite at r = 0, as
/// the singly scattered light of a pencil beam is; total, CDF and transmittance stay elementary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<ExponentialTerm>", into = "Vec<ExponentialTerm>")]
pub struct ExponentialSum {
    terms: Vec<ExponentialTerm>,
}

impl ExponentialSum {
    /// A sum of terms with positive finite lengths and weights >= 0 of a positive sum.
    pub fn new(mut terms: Vec<ExponentialTerm>) -> Result<Self, SkinError> {
        for (i, t) in terms.iter().enumerate() {
            if !(t.length_mm > 0.0 && t.length_mm.is_finite()) {
                let at = format!("exponentials[{i}].length_mm");
                return Err(SkinError::new(at, t.length_mm, "a positive finite length"));
            }
            if !(t.weight >= 0.0 && t.weight.is_finite()) {
                let at = format!("exponentials[{i}].weight");
                return Err(SkinError::new(at, t.weight, "a finite weight, 0 or more"));
            }
        }
        let total: f64 = terms.iter().map(|t| t.weight).sum();
        if total.is_nan() || total <= 0.0 {
            return Err(SkinError::new("exponentials", format!("weights of sum {total}"), "a positive sum"));
        }
        terms.sort_by(|a, b| a.length_mm.total_cmp(&b.length_mm));
        Ok(Self { terms })
    }

    /// The terms, shortest first.
    pub fn terms(&self) -> &[ExponentialTerm] {
        &self.terms
    }

    /// R(r), mm^-2; infinite at 0.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let term =
            |t: &ExponentialTerm| t.weight * (-r_mm / t.length_mm).exp() / (2.0 * PI * t.length_mm * r_mm);
        self.terms.iter().map(term).sum()
    }

    /// Integral of R outside of a disk.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        self.terms.iter().map(|t| t.weight * (-r_mm / t.length_mm).exp()).sum()
    }
}

impl TryFrom<Vec<ExponentialTerm>> for ExponentialSum {
    type Error = SkinError;

    fn try_from(terms: Vec<ExponentialTerm>) -> Result<Self, SkinError> {
        Self::new(terms)
    }
}

impl From<ExponentialSum> for Vec<ExponentialTerm> {
    fn from(sum: ExponentialSum) -> Self {
        sum.terms
    }
}

/// Photon beam diffusion at normal incidence: Habel, Christensen and Jarosz 2013.
///
/// The refracted beam is a line of sources that weakens with depth, each with its image as in the better dipole and
/// the empirical correction near the beam, plus exact single scattering. Tabulated when it is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Medium", into = "Medium")]
pub struct PhotonBeamDiffusion {
    medium: Medium,
    table: RadialTable,
}

impl PhotonBeamDiffusion {
    /// The profile of a valid medium that absorbs (without absorption the table would be infinite).
    pub fn new(medium: Medium) -> Result<Self, SkinError> {
        let dipole = BetterDipole::new(medium)?;
        if medium.albedo() > 0.99999 {
            return Err(SkinError::new(
                "medium.albedo",
                medium.albedo(),
                "a reduced albedo of at most 0.99999",
            ));
        }
        let rule = gauss_legendre(8);
        let mfp = medium.mean_free_path_mm();
        // 15 decay lengths or mean free paths, whichever is longer, leave less than a millionth outside.
        let outer = 15.0 * mfp.max(1.0 / dipole.sigma_tr);
        let inner = 1e-4 * mfp;
        let count = (40.0 * (outer / inner).log10()).ceil() as usize;
        let radii: Vec<f64> =
            (0..=count).map(|i| inner * (outer / inner).powf(i as f64 / count as f64)).collect();
        let values = radii.iter().map(|&r| beam(&medium, &dipole, &rule, r)).collect();
        Ok(Self { medium, table: RadialTable::from_points(radii, values)? })
    }

    /// The tabulated profile.
    pub fn table(&self) -> &RadialTable {
        &self.table
    }
}

/// Multiple and single scattering of the beam at a radius, mm^-2.
fn beam(medium: &Medium, dipole: &BetterDipole, rule: &[(f64, f64)], r: f64) -> f64 {
    let sigma_t = medium.sigma_t_prime_per_mm();
    let albedo = medium.albedo();
    let extrapolation = 4.0 * dipole.boundary.a_e * dipole.diffusion;
    let along = |t: f64| {
        let d = r.hypot(t);
        let kappa = -(-2.0 * sigma_t * (d + t)).exp_m1();
        let multiple = albedo * kappa * dipole.exitance(t, -t - extrapolation, r);
        // Isotropic phase function, projected onto the surface, attenuated on the way up.
        let mu = t / d;
        let single = (-sigma_t * d).exp() * mu / (4.0 * PI * d * d);
        let single = single * (1.0 - fresnel_from_inside(mu, medium.eta));
        medium.sigma_s_prime_per_mm * (-sigma_t * t).exp() * (multiple + single)
    };
    // Single scattering starts abruptly at the critical angle, then panels double away from it.
    let critical = r * (medium.eta * medium.eta - 1.0).max(0.0).sqrt();
    let mut sum = 0.0;
    let mut near = 0.0;
    let mut step = 0.25 * r.min(1.0 / sigma_t);
    let end = 40.0 / sigma_t;
    while near < critical.min(end) {
        let far = (near + step).min(critical);
        sum += integrate(rule, near, far, along);
        near = far;
        step *= 2.0;
    }
    step = 0.02 * r.min(1.0 / sigma_t);
    let end = near + 40.0 / sigma_t;
    while near < end {
        sum += integrate(rule, near, near + step, along);
        near += step;
        step *= 1.7;
    }
    sum
}

#[cfg(test)]
mod tests;
