//! Light of a lamp on bare skin, from the equations, in f64.

use std::f64::consts::PI;

use glam::DVec3;

use super::SKIN_F0;
use super::directional_albedo::{LEAST_SQUARE, scale_and_bias};

/// Bare skin with one specular lobe.
pub(crate) struct Skin {
    /// Linear albedo, as seen from the front.
    pub(crate) albedo: f64,
    /// Factor of the specular lobe.
    pub(crate) specular: f64,
    /// Beckmann m.
    pub(crate) roughness: f64,
}

impl Skin {
    /// Share of the light from a direction that the surface reflects (d'Eon and Luebke 2007, rho_dt).
    pub(crate) fn reflected(&self, cosine: f64) -> f64 {
        let [scale, bias] = scale_and_bias(self.roughness as f32, cosine as f32).map(f64::from);
        self.specular * (f64::from(SKIN_F0) * scale + bias).min(1.0)
    }

    /// Its mean over the hemisphere: 2 integral of rho(c) c dc.
    fn mean_reflected(&self) -> f64 {
        let n = 400;
        let cosines = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n));
        cosines.map(|c| 2.0 * c * self.reflected(c) / f64::from(n)).sum()
    }

    /// Radiance towards a viewer for unit irradiance across the light; all unit vectors.
    ///
    /// f = albedo / pi (1 - rho(L)) (1 - rho(V)) / ((1 - mean rho) (1 - rho(normal)))  +  D F / |L + V|^2
    /// (Kelemen and Szirmay-Kalos 2001, eq. 10 and 11, with Beckmann's D and Schlick's F).
    pub(crate) fn radiance(&self, normal: DVec3, to_light: DVec3, to_viewer: DVec3) -> f64 {
        let cos_light = normal.dot(to_light);
        if cos_light <= 0.0 {
            return 0.0;
        }
        let entering = (1.0 - self.reflected(cos_light)) / (1.0 - self.mean_reflected());
        let leaving = (1.0 - self.reflected(normal.dot(to_viewer))) / (1.0 - self.reflected(1.0));
        let half = to_light + to_viewer;
        let cos_half = normal.dot(half.normalize());
        let (c2, m2) = (cos_half * cos_half, self.roughness * self.roughness);
        let beckmann = ((c2 - 1.0) / (c2 * m2)).exp() / (PI * m2 * c2 * c2);
        let f0 = f64::from(SKIN_F0);
        let fresnel = f0 + (1.0 - f0) * (1.0 - half.normalize().dot(to_viewer)).powi(5);
        let lobe = beckmann * fresnel / half.length_squared().max(f64::from(LEAST_SQUARE));
        cos_light * (self.albedo / PI * entering * leaving + self.specular * lobe)
    }
}
