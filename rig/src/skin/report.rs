//! The report on a profile.

use serde::{Deserialize, Serialize};

use super::fit::{Emphasis, GaussianFit, fit_gaussians};
use super::profile::Profile;
use super::transmittance::TransmittanceTable;
use crate::error::SkinError;

/// A profile in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileReport {
    /// The profile itself.
    pub profile: Profile,
    /// Total diffuse reflectance, R, G, B.
    pub total: [f64; 3],
    /// Radius that holds half of the light, mm, R, G, B.
    pub median_radius_mm: [f64; 3],
    /// R(r) at radii that are even in ln r.
    pub reflectance: Vec<ReflectanceAt>,
    /// Gaussians with common variances and their errors.
    pub fit: GaussianFit,
    /// T(s), 64 entries.
    pub transmittance: TransmittanceTable,
}

/// R at a radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReflectanceAt {
    /// Radius, mm.
    pub radius_mm: f64,
    /// R(r), mm^-2, R, G, B.
    pub reflectance_per_mm2: [f64; 3],
    /// Fraction of the light inside of the radius, R, G, B.
    pub cdf: [f64; 3],
}

/// Reports on a profile: R at `points` radii (2 or more), a fit of `terms` Gaussians by eq. 2.2.
pub fn profile_report(profile: &Profile, terms: usize, points: usize) -> Result<ProfileReport, SkinError> {
    if !(2..=100_000).contains(&points) {
        return Err(SkinError::new("report.points", points, "2 to 100000 radii"));
    }
    let fit = fit_gaussians(profile, terms, Emphasis::Peak)?;
    let quantile = |u: f64| profile.channels.each_ref().map(|c| c.sample_radius(u));
    let low = quantile(1e-3).into_iter().fold(f64::INFINITY, f64::min);
    let high = quantile(1.0 - 1e-4).into_iter().fold(0.0, f64::max);
    let reflectance = (0..points)
        .map(|i| {
            let radius_mm = low * (high / low).powf(i as f64 / (points - 1) as f64);
            let reflectance_per_mm2 = profile.reflectance(radius_mm);
            ReflectanceAt { radius_mm, reflectance_per_mm2, cdf: profile.cdf(radius_mm) }
        })
        .collect();
    Ok(ProfileReport {
        profile: profile.clone(),
        total: profile.total(),
        median_radius_mm: quantile(0.5),
        reflectance,
        fit,
        transmittance: TransmittanceTable::new(profile, 64, None)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_survives_json() {
        let report = profile_report(&Profile::deon_six(), 4, 32).unwrap();
        let again: ProfileReport = serde_json::from_str(&serde_json::to_string(&report).unwrap()).unwrap();
        assert_eq!(again.reflectance.len(), 32);
        assert_eq!(again.profile, report.profile);
        let medians = report.median_radius_mm;
        assert!(medians[0] > medians[1] && medians[1] > medians[2], "{medians:?}");
        assert!(report.fit.errors.iter().all(|e| e.root_mean_square < 0.05), "{:?}", report.fit.errors);
    }

    #[test]
    fn too_few_points_are_an_error() {
        assert_eq!(profile_report(&Profile::deon_six(), 4, 1).unwrap_err().at, "report.points");
    }
}
