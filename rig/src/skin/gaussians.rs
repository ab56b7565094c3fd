//! Sums of Gaussians: the separable profiles.

use std::f64::consts::PI;

use libm::erf;
use serde::{Deserialize, Serialize};

use crate::error::SkinError;

/// One term `weight * G(variance, r)`, `G(v, r) = exp(-r^2 / (2 v)) / (2 pi v)` (d'Eon, Luebke and Enderton 2007).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GaussianTerm {
    /// Variance along one axis, mm^2; its root is the standard deviation that a blur pass uses.
    pub variance_mm2: f64,
    /// Energy of the term, the fraction of the entering light that it returns.
    pub weight: f64,
}

/// `R(r) = sum_i w_i G(v_i, r)`, narrowest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<GaussianTerm>", into = "Vec<GaussianTerm>")]
pub struct GaussianSum {
    terms: Vec<GaussianTerm>,
}

impl GaussianSum {
    /// A sum of at least one term with positive finite variances and finite weights >= 0 of a positive sum.
    pub fn new(mut terms: Vec<GaussianTerm>) -> Result<Self, SkinError> {
        for (i, t) in terms.iter().enumerate() {
            if !(t.variance_mm2 > 0.0 && t.variance_mm2.is_finite()) {
                let at = format!("gaussians[{i}].variance_mm2");
                return Err(SkinError::new(at, t.variance_mm2, "a positive finite variance"));
            }
            if !(t.weight >= 0.0 && t.weight.is_finite()) {
                return Err(SkinError::new(
                    format!("gaussians[{i}].weight"),
                    t.weight,
                    "a finite weight, 0 or more",
                ));
            }
        }
        let total: f64 = terms.iter().map(|t| t.weight).sum();
        if total.is_nan() || total <= 0.0 {
            return Err(SkinError::new("gaussians", format!("weights of sum {total}"), "a positive sum"));
        }
        terms.sort_by(|a, b| a.variance_mm2.total_cmp(&b.variance_mm2));
        Ok(Self { terms })
    }

    /// The terms, narrowest first.
    pub fn terms(&self) -> &[GaussianTerm] {
        &self.terms
    }

    /// R(r), mm^-2.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let r2 = r_mm * r_mm;
        let term =
            |t: &GaussianTerm| t.weight * (-r2 / (2.0 * t.variance_mm2)).exp() / (2.0 * PI * t.variance_mm2);
        self.terms.iter().map(term).sum()
    }

    /// Integral of R over the plane: the sum of the weights.
    pub fn total(&self) -> f64 {
        self.terms.iter().map(|t| t.weight).sum()
    }

    /// Integral of R outside of a disk.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let r2 = r_mm * r_mm;
        self.terms.iter().map(|t| t.weight * (-r2 / (2.0 * t.variance_mm2)).exp()).sum()
    }

    /// Fraction of the light with `|x| < x_mm`, `sum_i w_i erf(x / sqrt(2 v_i))` over the total.
    pub fn line_cdf(&self, x_mm: f64) -> f64 {
        let term = |t: &GaussianTerm| t.weight * erf(x_mm / (2.0 * t.variance_mm2).sqrt());
        self.terms.iter().map(term).sum::<f64>() / self.total()
    }

    /// T(s) as printed in Jimenez 2012, eq. 5.12: `sum_i w_i exp(-s^2 / v_i)`.
    ///
    /// With `G(v, r)` as above the integral of eq. 5.9 gives `exp(-s^2 / (2 v_i))`
    /// ([`RadialProfile::transmittance`](crate::skin::profile::RadialProfile::transmittance)),
    /// so this form is thinner: it is the exact one at a thickness of `sqrt(2) s`.
    pub fn thesis_transmittance(&self, s_mm: f64) -> f64 {
        self.terms.iter().map(|t| t.weight * (-s_mm * s_mm / t.variance_mm2).exp()).sum()
    }
}

impl TryFrom<Vec<GaussianTerm>> for GaussianSum {
    type Error = SkinError;

    fn try_from(terms: Vec<GaussianTerm>) -> Result<Self, SkinError> {
        Self::new(terms)
    }
}

impl From<GaussianSum> for Vec<GaussianTerm> {
    fn from(sum: GaussianSum) -> Self {
        sum.terms
    }
}

/// Variances (mm^2) and R, G, B weights of three-layer skin, six terms: d'Eon, Luebke and Enderton 2007.
///
/// A fit to the multipole model of Donner and Jensen 2005; Jimenez 2012, table 4.2.
pub const DEON_SIX: [(f64, [f64; 3]); 6] = [
    (0.0064, [0.233, 0.455, 0.649]),
    (0.0484, [0.100, 0.336, 0.344]),
    (0.187, [0.118, 0.198, 0.0]),
    (0.567, [0.113, 0.007, 0.007]),
    (1.99, [0.358, 0.004, 0.0]),
    (7.41, [0.078, 0.0, 0.0]),
];

/// Variances (mm^2) and R, G, B weights of the four-term fit to [`DEON_SIX`]: Jimenez, Sundstedt and Gutierrez 2009.
pub const JIMENEZ_FOUR: [(f64, [f64; 3]); 4] = [
    (0.0064, [0.240516183695, 0.447403391891, 0.615796108321]),
    (0.0516500425655, [0.115857499765, 0.366176401412, 0.343917471552]),
    (0.271928080903, [0.183619017698, 0.186420206697, 0.0]),
    (2.00626388153, [0.460007298842, 0.0, 0.0402864201267]),
];
