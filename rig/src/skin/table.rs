//! Tabulated radial profiles.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::error::SkinError;

/// A positive function of the radius, a power law between its points, so that its integral is exact.
///
/// Inside of the first point the first power law continues (a pencil beam gives `1/r`); outside of the last it is 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Points", into = "Points")]
pub struct RadialTable {
    points: Points,
    /// Power of each interval, `R ~ r^-power`; the first also holds inside of the first point.
    powers: Vec<f64>,
    /// Integral over the plane outside of each point.
    beyond: Vec<f64>,
    /// Integral over the disk inside of the first point.
    inner: f64,
}

/// The points of a [`RadialTable`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Points {
    /// Ascending radii, mm.
    pub radii_mm: Vec<f64>,
    /// R at each radius, mm^-2, positive.
    pub reflectance_per_mm2: Vec<f64>,
}

/// Integral of `2 pi r R` from `a` to `b` where `R = value (r/a)^-power`.
fn power_mass(a: f64, b: f64, value: f64, power: f64) -> f64 {
    let x = (2.0 - power) * (b / a).ln();
    // (e^x - 1) / x, 1 at x = 0
    let growth = if x.abs() < 1e-12 { 1.0 } else { x.exp_m1() / x };
    2.0 * PI * value * a * a * (b / a).ln() * growth
}

impl RadialTable {
    /// A table through points: at least two, ascending positive radii, positive finite values.
    ///
    /// A tail of zeros is cut off.
    pub fn from_points(mut radii_mm: Vec<f64>, mut reflectance_per_mm2: Vec<f64>) -> Result<Self, SkinError> {
        if radii_mm.len() != reflectance_per_mm2.len() {
            return Err(SkinError::new(
                "table",
                format!("{} radii and {} values", radii_mm.len(), reflectance_per_mm2.len()),
                "as many radii as values",
            ));
        }
        while reflectance_per_mm2.last() == Some(&0.0) {
            radii_mm.pop();
            reflectance_per_mm2.pop();
        }
        if radii_mm.len() < 2 {
            return Err(SkinError::new(
                "table",
                format!("{} points above zero", radii_mm.len()),
                "two or more points with light",
            ));
        }
        for (i, (&r, &v)) in radii_mm.iter().zip(&reflectance_per_mm2).enumerate() {
            if !(r.is_finite() && r > 0.0 && (i == 0 || r > radii_mm[i - 1])) {
                return Err(SkinError::new(
                    format!("table.radii_mm[{i}]"),
                    r,
                    "a positive, ascending radius",
                ));
            }
            if !(v.is_finite() && v > 0.0) {
                return Err(SkinError::new(
                    format!("table.reflectance_per_mm2[{i}]"),
                    v,
                    "a positive finite value",
                ));
            }
        }
        let points = Points { radii_mm, reflectance_per_mm2 };
        Ok(Self::integrated(points))
    }

    fn integrated(points: Points) -> Self {
        let Points { radii_mm: r, reflectance_per_mm2: v } = &points;
        let n = r.len();
        let powers: Vec<f64> = (0..n - 1).map(|i| -(v[i + 1] / v[i]).ln() / (r[i + 1] / r[i]).ln()).collect();
        let mut beyond = vec![0.0; n];
        for i in (0..n - 1).rev() {
            beyond[i] = beyond[i + 1] + power_mass(r[i], r[i + 1], v[i], powers[i]);
        }
        // r^-2 and steeper would hold infinite energy at the centre.
        let inner = 2.0 * PI * v[0] * r[0] * r[0] / (2.0 - powers[0].clamp(0.0, 1.5));
        Self { points, powers, beyond, inner }
    }

    /// A table with these integrals over rings: `edges_mm` has one entry more than `masses`.
    ///
    /// Points stand at the logarithmic middles. The mean over a ring is not the value at its middle where the
    /// profile curves, so the values are corrected until the rings of the table hold the given integrals.
    pub(crate) fn from_rings(edges_mm: &[f64], masses: &[f64]) -> Result<Self, SkinError> {
        // Few photons leave rings empty; those are merged into the next one outside, at the end into the last one.
        let (mut edges, mut merged) = (vec![edges_mm[0]], Vec::new());
        let mut pending = 0.0;
        for (edge, mass) in edges_mm[1..].iter().zip(masses) {
            pending += mass;
            if pending > 0.0 {
                edges.push(*edge);
                merged.push(pending);
                pending = 0.0;
            }
        }
        let masses = merged;
        let radii: Vec<f64> = edges.windows(2).map(|e| (e[0] * e[1]).sqrt()).collect();
        let values =
            edges.windows(2).zip(&masses).map(|(e, m)| m / (PI * (e[1] * e[1] - e[0] * e[0]))).collect();
        let mut table = Self::from_points(radii, values)?;
        for _ in 0..2 {
            let mut points = table.points.clone();
            for (i, e) in edges.windows(2).enumerate() {
                let held = table.mass_beyond(e[0]) - table.mass_beyond(e[1]);
                if i > 0 && i + 1 < masses.len() && held > 0.0 {
                    points.reflectance_per_mm2[i] *= masses[i] / held;
                }
            }
            table = Self::integrated(points);
        }
        Ok(table)
    }

    /// The points.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The table with every value times `factor`, a positive number.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let mut points = self.points.clone();
        points.reflectance_per_mm2.iter_mut().for_each(|v| *v *= factor);
        Self::integrated(points)
    }

    /// The interval that holds a radius: 0 inside of the first point, none outside of the last.
    fn interval(&self, r_mm: f64) -> Option<usize> {
        let r = &self.points.radii_mm;
        let after = r.partition_point(|&x| x <= r_mm);
        (after < r.len()).then(|| after.saturating_sub(1))
    }

    /// R(r), mm^-2.
    pub fn reflectance(&self, r_mm: f64) -> f64 {
        let Some(i) = self.interval(r_mm) else { return 0.0 };
        let power = if r_mm < self.points.radii_mm[0] { self.inner_power() } else { self.powers[i] };
        self.points.reflectance_per_mm2[i] * (r_mm / self.points.radii_mm[i]).powf(-power)
    }

    fn inner_power(&self) -> f64 {
        self.powers[0].clamp(0.0, 1.5)
    }

    /// Integral of R over the plane.
    pub fn total(&self) -> f64 {
        self.inner + self.beyond[0]
    }

    /// Integral of R outside of a disk.
    pub fn mass_beyond(&self, r_mm: f64) -> f64 {
        let Some(i) = self.interval(r_mm) else { return 0.0 };
        let r = &self.points.radii_mm;
        if r_mm < r[0] {
            let inside = self.inner * (r_mm.max(0.0) / r[0]).powf(2.0 - self.inner_power());
            return self.total() - inside;
        }
        let value = self.reflectance(r_mm);
        self.beyond[i + 1] + power_mass(r_mm, r[i + 1], value, self.powers[i])
    }
}

impl TryFrom<Points> for RadialTable {
    type Error = SkinError;

    fn try_from(points: Points) -> Result<Self, SkinError> {
        Self::from_points(points.radii_mm, points.reflectance_per_mm2)
    }
}

impl From<RadialTable> for Points {
    fn from(table: RadialTable) -> Self {
        table.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_reproduced_exactly() {
        let radii: Vec<f64> = (0..20).map(|i| 0.01 * 1.5f64.powi(i)).collect();
        let values = radii.iter().map(|r| 2.0 / r).collect();
        let table = RadialTable::from_points(radii.clone(), values).unwrap();
        let outer = radii[19];
        // The integral of (2/r) 2 pi r dr is 4 pi r.
        assert!((table.total() - 4.0 * PI * outer).abs() < 1e-12 * table.total());
        for r in [0.001, 0.01, 0.3, 2.0] {
            assert!((table.reflectance(r) - 2.0 / r).abs() < 1e-9 / r);
            assert!((table.mass_beyond(r) - 4.0 * PI * (outer - r)).abs() < 1e-11);
        }
        assert_eq!(table.reflectance(outer * 1.01), 0.0);
        assert_eq!(table.mass_beyond(outer * 1.01), 0.0);
    }

    #[test]
    fn rings_keep_their_light() {
        let edges: Vec<f64> = (0..60).map(|i| 0.001 * 1.2f64.powi(i)).collect();
        let beyond = |r: f64| 0.6 * (-r / 0.8).exp();
        let masses: Vec<f64> = edges.windows(2).map(|e| beyond(e[0]) - beyond(e[1])).collect();
        let table = RadialTable::from_rings(&edges, &masses).unwrap();
        assert!((table.total() - 0.6).abs() < 2e-3, "{}", table.total());
        for r in [0.1, 0.5, 1.0, 3.0] {
            assert!((table.mass_beyond(r) - beyond(r)).abs() < 2e-3, "{r}");
        }
    }

    #[test]
    fn unusable_tables_are_errors() {
        for (radii, values) in [
            (vec![], vec![]),
            (vec![1.0], vec![1.0]),
            (vec![1.0, 2.0], vec![0.0, 0.0]),
            (vec![2.0, 1.0], vec![1.0, 1.0]),
            (vec![1.0, 2.0], vec![1.0, f64::NAN]),
            (vec![0.0, 2.0], vec![1.0, 1.0]),
            (vec![1.0, 2.0, 3.0], vec![1.0, 1.0]),
        ] {
            assert!(RadialTable::from_points(radii, values).is_err());
        }
    }
}
