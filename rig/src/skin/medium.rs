//! Scattering media and their boundaries.

use serde::{Deserialize, Serialize};

use super::numerics::{gauss_legendre, integrate};
use crate::error::SkinError;

/// Relative index of refraction (inside over outside) that the models accept.
pub const ETA: std::ops::RangeInclusive<f64> = 0.5..=3.0;

/// A medium of isotropic scatterers, as similarity theory reduces any medium to one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Medium {
    /// Reduced scattering coefficient `sigma_s' = sigma_s (1 - g)`, mm^-1.
    pub sigma_s_prime_per_mm: f64,
    /// Absorption coefficient, mm^-1.
    pub sigma_a_per_mm: f64,
    /// Index of refraction inside over outside.
    pub eta: f64,
}

impl Medium {
    /// Checks the coefficients: finite, not negative, scattering above zero, eta inside of [`ETA`].
    ///
    /// A medium that does not scatter returns no light and has no profile; one that does not absorb is valid for
    /// the dipoles and the slab (they total one, or conserve energy) and an error for a photon walk.
    pub fn new(sigma_s_prime_per_mm: f64, sigma_a_per_mm: f64, eta: f64) -> Result<Self, SkinError> {
        let medium = Self { sigma_s_prime_per_mm, sigma_a_per_mm, eta };
        medium.validate()?;
        Ok(medium)
    }

    /// The medium of isotropic scatterers with the same reduced coefficients (similarity).
    pub fn reduced(
        sigma_s_per_mm: f64,
        anisotropy: f64,
        sigma_a_per_mm: f64,
        eta: f64,
    ) -> Result<Self, SkinError> {
        if !(-1.0 < anisotropy && anisotropy < 1.0) {
            return Err(SkinError::new("medium.anisotropy", anisotropy, "a mean cosine between -1 and 1"));
        }
        Self::new(sigma_s_per_mm * (1.0 - anisotropy), sigma_a_per_mm, eta)
    }

    /// The checks of [`Medium::new`], for a value that was filled in by hand or read from a file.
    pub fn validate(&self) -> Result<(), SkinError> {
        let Self { sigma_s_prime_per_mm: s, sigma_a_per_mm: a, eta } = *self;
        if !(s > 0.0 && s.is_finite()) {
            return Err(SkinError::new("medium.sigma_s_prime_per_mm", s, "a positive finite coefficient"));
        }
        if !(a >= 0.0 && a.is_finite()) {
            return Err(SkinError::new("medium.sigma_a_per_mm", a, "a finite coefficient, 0 or more"));
        }
        if !ETA.contains(&eta) {
            return Err(SkinError::new("medium.eta", eta, "a relative index of refraction from 0.5 to 3"));
        }
        Ok(())
    }

    /// Reduced extinction coefficient, mm^-1.
    pub fn sigma_t_prime_per_mm(&self) -> f64 {
        self.sigma_s_prime_per_mm + self.sigma_a_per_mm
    }

    /// Reduced albedo alpha' of a single scattering event.
    pub fn albedo(&self) -> f64 {
        self.sigma_s_prime_per_mm / self.sigma_t_prime_per_mm()
    }

    /// Reduced mean free path, mm.
    pub fn mean_free_path_mm(&self) -> f64 {
        1.0 / self.sigma_t_prime_per_mm()
    }
}

/// `sigma_s'` and `sigma_a` (R, G, B) of skin1: Jensen, Marschner, Levoy and Hanrahan 2001, mm^-1.
pub const SKIN1: [[f64; 3]; 2] = [[0.74, 0.88, 1.01], [0.032, 0.17, 0.48]];

/// `sigma_s'` and `sigma_a` (R, G, B) of skin2: Jensen, Marschner, Levoy and Hanrahan 2001, mm^-1.
pub const SKIN2: [[f64; 3]; 2] = [[1.09, 1.59, 1.79], [0.013, 0.070, 0.145]];

/// R, G, B media of a table of coefficients such as [`SKIN1`].
pub fn rgb_media(coefficients: &[[f64; 3]; 2], eta: f64) -> Result<[Medium; 3], SkinError> {
    let [s, a] = coefficients;
    Ok([Medium::new(s[0], a[0], eta)?, Medium::new(s[1], a[1], eta)?, Medium::new(s[2], a[2], eta)?])
}

/// Unpolarised Fresnel reflectance met from inside at the cosine `mu`, with `eta` inside over outside.
pub fn fresnel_from_inside(mu: f64, eta: f64) -> f64 {
    let sin2_outside = eta * eta * (1.0 - mu * mu);
    if sin2_outside >= 1.0 {
        return 1.0;
    }
    let mu_outside = (1.0 - sin2_outside).sqrt();
    let parallel = (mu - eta * mu_outside) / (mu + eta * mu_outside);
    let perpendicular = (eta * mu - mu_outside) / (eta * mu + mu_outside);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Boundary terms of a diffusion model, from exact moments of the Fresnel reflectance.
///
/// `C1` and `C2` are the integrals of `F mu` and `F mu^2` over `mu` in 0..1 (d'Eon and Irving 2011).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Boundary {
    /// `(1 - 2 C1) / 4`
    pub(crate) c_phi: f64,
    /// `(1 - 3 C2) / 2`
    pub(crate) c_e: f64,
    /// `(1 + 3 C2) / (1 - 2 C1)`
    pub(crate) a_e: f64,
}

impl Boundary {
    pub(crate) fn new(eta: f64) -> Self {
        let rule = gauss_legendre(64);
        // The reflectance has a root in its slope at the critical angle: the range is split there, and squared
        // steps away from it make the integrand smooth.
        let critical = if eta > 1.0 { (1.0 - 1.0 / (eta * eta)).sqrt() } else { 0.0 };
        let moment = |power: i32| {
            let total = critical.powi(power + 1) / (power + 1) as f64;
            let span = 1.0 - critical;
            total
                + integrate(&rule, 0.0, 1.0, |t| {
                    let mu = critical + span * t * t;
                    fresnel_from_inside(mu, eta) * mu.powi(power) * 2.0 * span * t
                })
        };
        let (c1, c2) = (moment(1), moment(2));
        Self {
            c_phi: (1.0 - 2.0 * c1) / 4.0,
            c_e: (1.0 - 3.0 * c2) / 2.0,
            a_e: (1.0 + 3.0 * c2) / (1.0 - 2.0 * c1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_match_the_published_polynomials() {
        // d'Eon and Irving 2011; their fits stray up to 0.0006 and 0.0045 from the integrals, checked by brute force.
        for eta in [1.05f64, 1.2, 1.3, 1.4, 1.5, 1.7] {
            let two_c1 = -9.23372 + 22.2272 * eta - 20.9292 * eta.powi(2) + 10.2291 * eta.powi(3)
                - 2.54396 * eta.powi(4)
                + 0.254913 * eta.powi(5);
            let three_c2 =
                -1641.1 + 135.926 / eta.powi(3) - 656.175 / eta.powi(2) + 1376.53 / eta + 1213.67 * eta
                    - 568.556 * eta.powi(2)
                    + 164.798 * eta.powi(3)
                    - 27.0181 * eta.powi(4)
                    + 1.91826 * eta.powi(5);
            let b = Boundary::new(eta);
            assert!((4.0 * b.c_phi - (1.0 - two_c1)).abs() < 1e-3, "{eta}");
            assert!((2.0 * b.c_e - (1.0 - three_c2)).abs() < 5e-3, "{eta}");
            let n = 200_000;
            let mu = (0..n).map(|i| (i as f64 + 0.5) / n as f64);
            let brute = |power: i32| {
                mu.clone().map(|m| fresnel_from_inside(m, eta) * m.powi(power)).sum::<f64>() / n as f64
            };
            assert!((4.0 * b.c_phi - (1.0 - 2.0 * brute(1))).abs() < 1e-6, "{eta}");
            assert!((2.0 * b.c_e - (1.0 - 3.0 * brute(2))).abs() < 1e-6, "{eta}");
            assert!((b.a_e - (1.0 - b.c_e) / (2.0 * b.c_phi)).abs() < 1e-12);
        }
    }

    #[test]
    fn matched_index_reflects_nothing() {
        let b = Boundary::new(1.0);
        assert_eq!((b.c_phi, b.c_e, b.a_e), (0.25, 0.5, 1.0));
        assert!((fresnel_from_inside(1.0, 1.5) - 0.04).abs() < 1e-15);
        assert_eq!(fresnel_from_inside(0.3, 1.5), 1.0);
    }

    #[test]
    fn coefficients_outside_of_physics_are_errors() {
        for (s, a, eta, at) in [
            (0.0, 0.1, 1.4, "medium.sigma_s_prime_per_mm"),
            (f64::INFINITY, 0.1, 1.4, "medium.sigma_s_prime_per_mm"),
            (f64::NAN, 0.1, 1.4, "medium.sigma_s_prime_per_mm"),
            (1.0, -0.1, 1.4, "medium.sigma_a_per_mm"),
            (1.0, f64::INFINITY, 1.4, "medium.sigma_a_per_mm"),
            (1.0, 0.1, 0.0, "medium.eta"),
            (1.0, 0.1, f64::NAN, "medium.eta"),
        ] {
            assert_eq!(Medium::new(s, a, eta).unwrap_err().at, at);
        }
        assert_eq!(Medium::reduced(1.0, 1.0, 0.1, 1.4).unwrap_err().at, "medium.anisotropy");
        assert!((Medium::reduced(10.0, 0.9, 1.0, 1.4).unwrap().albedo() - 0.5).abs() < 1e-12);
    }
}
