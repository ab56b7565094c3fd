//! Diffusion profiles as values.
//!
//! A radial profile `R(r)` is the light that leaves a flat surface at the distance `r` from a point where light
//! enters, per unit of light that entered and per unit of area (mm^-2). Its integral over the plane is the total
//! diffuse reflectance.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::diffusion::{
    BetterDipole, ExponentialSum, MultipoleSlab, NormalizedDiffusion, PhotonBeamDiffusion, StandardDipole,
};
use super::directional::DirectionalDipole;
use super::gaussians::{DEON_SIX, GaussianSum, GaussianTerm, JIMENEZ_FOUR};
use super::numerics::{gauss_legendre, integrate, invert_cdf};
use super::table::RadialTable;

/// Eight nodes for a panel over which an integrand is smooth.
static PANEL_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(8));

/// One channel of a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RadialProfile {
    /// A sum of Gaussians.
    Gaussians(GaussianSum),
    /// Standard dipole.
    StandardDipole(StandardDipole),
    /// Better dipole.
    BetterDipole(BetterDipole),
    /// A slab's reflectance or transmittance.
    MultipoleSlab(MultipoleSlab),
    /// Normalized diffusion.
    NormalizedDiffusion(NormalizedDiffusion),
    /// Photon beam diffusion.
    PhotonBeamDiffusion(PhotonBeamDiffusion),
    /// Directional dipole; as a radial profile its mean over all directions of light.
    DirectionalDipole(DirectionalDipole),
    /// A sum of exponentials over r.
    Exponentials(ExponentialSum),
    /// A table, such as a photon walk's.
    Tabulated(RadialTable),
}

/// The same expression for the value inside of every variant.
macro_rules! each {
    ($self:expr, $p:ident => $body:expr) => {
        match $self {
            RadialProfile::Gaussians($p) => $body,
            RadialProfile::StandardDipole($p) => $body,
            RadialProfile::BetterDipole($p) => $body,
            RadialProfile::MultipoleSlab($p) => $body,
            RadialProfile::NormalizedDiffusion($p) => $body,
            RadialProfile::Exponentials($p) => $body,
            RadialProfile::PhotonBeamDiffusion(beam) => {
                let $p = beam.table();
                $body
            }
            RadialProfile::DirectionalDipole(dipole) => {
                let $p = dipole.table();
                $body
            }
            RadialProfile::Tabulated($p) => $body,
        }
    };
}

impl RadialProfile {
    /// R(r) in mm^-2, `r_mm >= 0`. Normalized diffusion and sums of exponentials are infinite at 0, tables may be.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        each!(self, p => p.reflectance(r_mm))
    }

    /// Total diffuse reflectance: the integral of R over the plane, in closed form for all but tables (exact for the
    /// table's own power laws).
    pub fn total(&self) -> f64 {
        self.mass_beyond(0.0)
    }

    /// Integral of R outside of a disk of radius `r_mm`; in closed form where the total is.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        each!(self, p => p.mass_beyond(r_mm))
    }

    /// A typical radius of the profile, where numerical searches start.
    pub(crate) fn scale_mm(&self) -> f64 {
        match self {
            Self::Gaussians(p) => p.terms()[0].variance_mm2.sqrt(),
            Self::NormalizedDiffusion(p) => p.d_mm,
            Self::Exponentials(p) => p.terms()[0].length_mm,
            // Tables and models of a medium: any power of two near a millimetre is reached by doubling or halving.
            _ => 0.125,
        }
    }

    /// Fraction of the returned light inside of a disk of radius `r_mm`, 0 to 1.
    pub fn cdf(&self, r_mm: f64) -> f64 {
        (1.0 - self.mass_beyond(r_mm) / self.total()).clamp(0.0, 1.0)
    }

    /// The radius inside of which the fraction `u` of the light returns: a uniform `u` samples `2 pi r R(r)`.
    pub fn sample_radius(&self, u: f64) -> f64 {
        match self {
            Self::NormalizedDiffusion(p) => p.sample_radius(u),
            _ => invert_cdf(u, self.scale_mm(), |r| self.cdf(r)),
        }
    }

    /// Mean distance between where light enters and where it leaves, mm.
    pub fn mean_radius_mm(&self) -> f64 {
        // The integral of the light beyond r over r. Panels double from a width at which next to nothing has happened.
        let beyond = |r: f64| self.mass_beyond(r) / self.total();
        let mut edge = 1e-3 * self.sample_radius(0.5);
        let mut sum = integrate(&PANEL_RULE, 0.0, edge, beyond);
        for _ in 0..60 {
            let panel = integrate(&PANEL_RULE, edge, 1.5 * edge, beyond);
            sum += panel;
            edge *= 1.5;
            if panel < 1e-6 * sum {
                break;
            }
        }
        sum
    }

    /// Light through a slab of thickness `s_mm` under uniform irradiance, as the profile of a half space has it: the integral of `R(sqrt(r^2 + s^2))` over
    /// the plane (Jimenez 2012, eq. 5.9).
    ///
    /// With `rho^2 = r^2 + s^2` it is the integral of R outside of a disk of radius s, for any profile. What a slab really passes is in [`super::slab`].
    pub fn transmittance(&self, s_mm: f64) -> f64 {
        self.mass_beyond(s_mm)
    }

    /// Fraction of the returned light with `|x| < x_mm`: the cumulative line spread function.
    ///
    /// A point at radius r has `|x| = r |cos phi|`, so this is the mean of `cdf(x / cos phi)` over a quarter turn.
    pub fn line_cdf(&self, x_mm: f64) -> f64 {
        if x_mm <= 0.0 {
            return 0.0;
        }
        if let Self::Gaussians(p) = self {
            return p.line_cdf(x_mm);
        }
        (1.0 - self.wedge_beyond(x_mm, f64::INFINITY) / (FRAC_PI_2 * self.total())).clamp(0.0, 1.0)
    }

    /// Fraction of the returned light in the rectangle `0 <= x <= x_mm`, `0 <= y <= y_mm`; a quarter at infinity.
    pub fn quadrant_cdf(&self, x_mm: f64, y_mm: f64) -> f64 {
        if x_mm <= 0.0 || y_mm <= 0.0 {
            return 0.0;
        }
        let outside = self.wedge_beyond(x_mm, y_mm / x_mm) + self.wedge_beyond(y_mm, x_mm / y_mm);
        (0.25 - outside / (2.0 * PI * self.total())).max(0.0)
    }

    /// Integral of `mass_beyond(x / cos phi)` for phi from 0 to `atan(slope_max)`.
    ///
    /// `cos phi = 1 / cosh u` spreads the samples near a right angle, where the radius covers all scales.
    fn wedge_beyond(&self, x_mm: f64, slope_max: f64) -> f64 {
        // Beyond u = 36 the remaining angle is below the last bit of the result.
        let end = slope_max.asinh().min(36.0);
        let (mut sum, mut u) = (0.0, 0.0);
        while u < end {
            let next = (u + 0.5).min(end);
            let panel = integrate(&PANEL_RULE, u, next, |u| self.mass_beyond(x_mm * u.cosh()) / u.cosh());
            sum += panel;
            if panel <= 1e-13 * sum {
                break;
            }
            u = next;
        }
        sum
    }
}

/// A diffusion profile: one radial profile for each of R, G and B.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Shown in reports.
    pub name: String,
    /// R, G, B.
    pub channels: [RadialProfile; 3],
}

impl Profile {
    /// Three-layer skin as six Gaussians (d'Eon, Luebke and Enderton 2007); white: each channel totals one.
    pub fn deon_six() -> Self {
        Self::from_gaussian_table("deon-six", &DEON_SIX)
    }

    /// The four Gaussians of Jimenez, Sundstedt and Gutierrez 2009; white.
    pub fn jimenez_four() -> Self {
        Self::from_gaussian_table("jimenez-four", &JIMENEZ_FOUR)
    }

    fn from_gaussian_table(name: &str, table: &[(f64, [f64; 3])]) -> Self {
        let channel = |c: usize| {
            let terms = table.iter().map(|&(variance_mm2, w)| GaussianTerm { variance_mm2, weight: w[c] });
            let sum = GaussianSum::new(terms.collect()).expect("published constants are valid");
            RadialProfile::Gaussians(sum)
        };
        Self { name: name.into(), channels: std::array::from_fn(channel) }
    }

    /// The channels as BSSRDFs that know the direction of the light, if they are.
    pub fn directional(&self) -> Option<[&DirectionalDipole; 3]> {
        let [r, g, b] = self.channels.each_ref().map(|c| match c {
            RadialProfile::DirectionalDipole(dipole) => Some(dipole),
            _ => None,
        });
        Some([r?, g?, b?])
    }

    /// R(r) of each channel, mm^-2.
    pub fn reflectance(&self, r_mm: f64) -> [f64; 3] {
        std::array::from_fn(|c| self.channels[c].reflectance(r_mm))
    }

    /// Total diffuse reflectance of each channel.
    pub fn total(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.channels[c].total())
    }

    /// [`RadialProfile::cdf`] of each channel.
    pub fn cdf(&self, r_mm: f64) -> [f64; 3] {
        std::array::from_fn(|c| self.channels[c].cdf(r_mm))
    }

    /// [`RadialProfile::transmittance`] of each channel.
    pub fn transmittance(&self, s_mm: f64) -> [f64; 3] {
        std::array::from_fn(|c| self.channels[c].transmittance(s_mm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_sums_are_white() {
        for profile in [Profile::deon_six(), Profile::jimenez_four()] {
            for total in profile.total() {
                assert!((total - 1.0).abs() < 1e-6, "{}: {total}", profile.name);
            }
        }
    }

    #[test]
    fn line_and_quadrant_agree_with_the_error_function() {
        let channel = &Profile::deon_six().channels[0];
        for x in [0.001, 0.01, 0.2, 1.0, 4.0] {
            let exact = channel.line_cdf(x);
            let generic = 1.0 - channel.wedge_beyond(x, f64::INFINITY) / FRAC_PI_2;
            assert!((generic - exact).abs() < 1e-9, "{x}: {generic} {exact}");
            let far = channel.quadrant_cdf(x, 1e3);
            assert!((far - exact / 4.0).abs() < 1e-9, "{x}: {far} {exact}");
        }
    }

    #[test]
    fn sampling_inverts_the_cdf() {
        let channel = &Profile::deon_six().channels[0];
        for u in [1e-6, 0.1, 0.5, 0.999] {
            assert!((channel.cdf(channel.sample_radius(u)) - u).abs() < 1e-9);
        }
    }
}
