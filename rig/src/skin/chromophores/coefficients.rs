//! Absorption and scattering of the two layers of skin by wavelength.

use super::ChromophoreModel;
use super::spectra::{FIRST_NM, HEMOGLOBIN, HEMOGLOBIN_STEP_NM};

/// A homogeneous layer at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Absorption coefficient, mm^-1.
    pub absorption_per_mm: f64,
    /// Reduced scattering coefficient, mm^-1.
    pub scattering_per_mm: f64,
}

impl Medium {
    /// Extinction sigma_t', mm^-1.
    pub fn extinction_per_mm(&self) -> f64 {
        self.absorption_per_mm + self.scattering_per_mm
    }

    /// Single-scattering albedo alpha', 0 to 1.
    pub fn albedo(&self) -> f64 {
        self.scattering_per_mm / self.extinction_per_mm()
    }
}

/// Absorption of eumelanin, mm^-1 (Donner and Jensen 2006).
///
/// In cm^-1 the factor is 6.6e11; texts that print 6.6e11 mm^-1 are ten times too dark.
pub fn eumelanin_per_mm(wavelength_nm: f64) -> f64 {
    6.6e10 * wavelength_nm.powf(-3.33)
}

/// Absorption of pheomelanin, mm^-1 (Donner and Jensen 2006).
pub fn pheomelanin_per_mm(wavelength_nm: f64) -> f64 {
    2.9e14 * wavelength_nm.powf(-4.75)
}

/// Absorption of skin without chromophores, mm^-1 (Jacques 1998).
pub fn baseline_per_mm(wavelength_nm: f64) -> f64 {
    0.0244 + 8.53 * (-(wavelength_nm - 154.0) / 66.2).exp()
}

/// Absorption of whole blood with 150 g/L hemoglobin (64 500 g/mol) at an oxygen saturation, mm^-1.
///
/// Linear between the entries of the table; clamped to it outside 380 to 780 nm.
pub fn blood_per_mm(wavelength_nm: f64, oxygenation: f64) -> f64 {
    let x = ((wavelength_nm - FIRST_NM) / HEMOGLOBIN_STEP_NM).clamp(0.0, (HEMOGLOBIN.len() - 1) as f64);
    let i = (x as usize).min(HEMOGLOBIN.len() - 2);
    let t = x - i as f64;
    let extinction = |j: usize| oxygenation * HEMOGLOBIN[j][0] + (1.0 - oxygenation) * HEMOGLOBIN[j][1];
    let per_cm_molar = (1.0 - t) * extinction(i) + t * extinction(i + 1);
    // 2.303 = ln 10, as the compiler of the table gives it; 0.1 is mm^-1 from cm^-1.
    0.1 * 2.303 * per_cm_molar * 150.0 / 64_500.0
}

/// Reduced scattering of the epidermis, mm^-1 (Donner and Jensen 2006).
pub fn epidermis_scattering_per_mm(wavelength_nm: f64) -> f64 {
    14.74 * wavelength_nm.powf(-0.22) + 2.2e11 * wavelength_nm.powi(-4)
}

/// Epidermis with a melanin fraction and the model's share of `hemoglobin` (the dermal fraction).
pub fn epidermis(model: &ChromophoreModel, wavelength_nm: f64, melanin: f64, hemoglobin: f64) -> Medium {
    let melanin_per_mm = model.eumelanin_share * eumelanin_per_mm(wavelength_nm)
        + (1.0 - model.eumelanin_share) * pheomelanin_per_mm(wavelength_nm);
    let blood = model.epidermal_blood_share * hemoglobin;
    let absorption_per_mm = melanin * melanin_per_mm
        + blood * blood_per_mm(wavelength_nm, model.oxygenation)
        + (1.0 - melanin - blood).max(0.0) * baseline_per_mm(wavelength_nm);
    Medium { absorption_per_mm, scattering_per_mm: epidermis_scattering_per_mm(wavelength_nm) }
}

/// Horny layer: the epidermis without melanin and blood.
pub fn stratum_corneum(wavelength_nm: f64) -> Medium {
    Medium {
        absorption_per_mm: baseline_per_mm(wavelength_nm),
        scattering_per_mm: epidermis_scattering_per_mm(wavelength_nm),
    }
}

/// Dermis with a hemoglobin fraction.
pub fn dermis(model: &ChromophoreModel, wavelength_nm: f64, hemoglobin: f64) -> Medium {
    let absorption_per_mm = hemoglobin * blood_per_mm(wavelength_nm, model.oxygenation)
        + (1.0 - hemoglobin) * baseline_per_mm(wavelength_nm);
    let scattering_per_mm = model.dermis_scattering_share * epidermis_scattering_per_mm(wavelength_nm);
    Medium { absorption_per_mm, scattering_per_mm }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values printed with the tables (Donner and Jensen 2006; Prahl).
    #[test]
    fn coefficients_match_published_values() {
        let check =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        for (nm, eu, pheo, base, scatter) in [
            (450.0, 96.460, 72.383, 0.12192, 9.2091),
            (550.0, 49.447, 27.905, 0.04593, 6.0823),
            (650.0, 28.349, 12.620, 0.02915, 4.7778),
        ] {
            check(eumelanin_per_mm(nm), eu);
            check(pheomelanin_per_mm(nm), pheo);
            check(baseline_per_mm(nm), base);
            check(epidermis_scattering_per_mm(nm), scatter);
        }
        for (nm, oxy, deoxy) in [
            (450.0, 336.43, 553.21),
            (542.0, 285.42, 257.87),
            (560.0, 174.67, 288.08),
            (576.0, 297.46, 214.73),
            (660.0, 1.712, 17.281),
        ] {
            check(10.0 * blood_per_mm(nm, 1.0), oxy);
            check(10.0 * blood_per_mm(nm, 0.0), deoxy);
        }
    }

    #[test]
    fn oxy_and_deoxy_meet_at_the_isosbestic_points() {
        for nm in [390.0, 422.0, 452.4, 500.1, 529.2, 545.3, 570.2, 584.1] {
            let (oxy, deoxy) = (blood_per_mm(nm, 1.0), blood_per_mm(nm, 0.0));
            // The points are rounded to 0.1 nm, and the table changes by up to 8 % per nm.
            assert!((oxy / deoxy - 1.0).abs() < 1e-2, "{nm} nm: {oxy} {deoxy}");
        }
    }
}
