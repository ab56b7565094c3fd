//! T(s) as a look-up table (Jimenez 2012, chapter 5).

use serde::{Deserialize, Serialize};

use super::numerics::invert_cdf;
use super::profile::Profile;
use crate::error::SkinError;

/// Light through a slab over its thickness, R, G, B, at even steps from 0 to `thickness_max_mm`.
///
/// Scaled so that the profile's total is 1: the albedo comes from the surface, as for reflectance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransmittanceTable {
    /// Thickness of the last entry, mm.
    pub thickness_max_mm: f64,
    /// T at each step.
    pub values: Vec<[f64; 3]>,
}

/// Transmittance at which a table may end: under half a step of 8 bits.
const END: f64 = 1.0 / 512.0;

impl TransmittanceTable {
    /// A table of 2 or more entries.
    ///
    /// With no `thickness_max_mm` it ends where the last channel falls under a 512th.
    pub fn new(profile: &Profile, entries: usize, thickness_max_mm: Option<f64>) -> Result<Self, SkinError> {
        if !(2..=65536).contains(&entries) {
            return Err(SkinError::new("transmittance.entries", entries, "2 to 65536 entries"));
        }
        let end = |c: &super::profile::RadialProfile| invert_cdf(1.0 - END, c.scale_mm(), |r| c.cdf(r));
        let thickness_max_mm =
            thickness_max_mm.unwrap_or_else(|| profile.channels.iter().map(end).fold(0.0, f64::max));
        if !(thickness_max_mm > 0.0 && thickness_max_mm.is_finite()) {
            return Err(SkinError::new(
                "transmittance.thickness_max_mm",
                thickness_max_mm,
                "a positive finite thickness",
            ));
        }
        let total = profile.total();
        let entry = |i: usize| {
            let t = profile.transmittance(thickness_max_mm * i as f64 / (entries - 1) as f64);
            std::array::from_fn(|c| t[c] / total[c])
        };
        Ok(Self { thickness_max_mm, values: (0..entries).map(entry).collect() })
    }

    /// Linear interpolation, as a sampler does it; clamped at both ends.
    pub fn sample(&self, thickness_mm: f64) -> [f64; 3] {
        let last = self.values.len() - 1;
        let x = (thickness_mm / self.thickness_max_mm).clamp(0.0, 1.0) * last as f64;
        let i = (x as usize).min(last - 1);
        let t = x - i as f64;
        std::array::from_fn(|c| self.values[i][c] * (1.0 - t) + self.values[i + 1][c] * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skin::profile::RadialProfile;

    #[test]
    fn gaussians_fall_as_the_integral_of_equation_5_9() {
        let profile = Profile::deon_six();
        let table = TransmittanceTable::new(&profile, 1025, Some(4.0)).unwrap();
        assert_eq!(table.values[0].map(|t| (t * 1e9).round()), [1e9; 3]);
        for s in [0.3, 1.0, 2.5] {
            // Direct quadrature of 2 pi r R(sqrt(r^2 + s^2)).
            let n = 200_000;
            let step = 20.0 / n as f64;
            for c in 0..3 {
                let sum: f64 = (0..n)
                    .map(|i| {
                        let r = (i as f64 + 0.5) * step;
                        std::f64::consts::TAU * r * profile.channels[c].reflectance(r.hypot(s)) * step
                    })
                    .sum();
                assert!((table.sample(s)[c] - sum).abs() < 1e-4, "{s} {c}");
            }
            // Equation 5.12 as printed is this one at sqrt(2) of the thickness.
            let RadialProfile::Gaussians(sum) = &profile.channels[0] else { panic!("a sum of Gaussians") };
            let printed = sum.thesis_transmittance(s / 2f64.sqrt());
            assert!((printed - profile.transmittance(s)[0]).abs() < 1e-12);
        }
        assert!(table.values.windows(2).all(|w| (0..3).all(|c| w[1][c] <= w[0][c])));
        assert_eq!(table.sample(99.0), table.values[1024]);
        assert_eq!(table.sample(-1.0), table.values[0]);
    }

    #[test]
    fn red_reaches_farthest_and_the_table_ends_where_light_does() {
        let table = TransmittanceTable::new(&Profile::deon_six(), 64, None).unwrap();
        let [red, green, blue] = table.sample(1.5);
        assert!(red > 10.0 * green && green > 3.0 * blue, "{red} {green} {blue}");
        let last = table.values[63];
        assert!((last[0] - END).abs() < 1e-9 && last[1] < END && last[2] < END);
    }

    #[test]
    fn unusable_tables_are_errors() {
        let profile = Profile::deon_six();
        for entries in [0, 1, 100_000] {
            assert!(TransmittanceTable::new(&profile, entries, None).is_err());
        }
        for thickness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = TransmittanceTable::new(&profile, 64, Some(thickness)).unwrap_err();
            assert_eq!(error.at, "transmittance.thickness_max_mm");
        }
    }
}
