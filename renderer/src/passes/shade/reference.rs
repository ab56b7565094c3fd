//! Light of a lamp on bare skin, from the equations, in f64.

use std::f64::consts::PI;

use glam::DVec3;
use rubor_rig::head::SKIN_F0;

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

/// What the extensions of glTF 2.0 add to a [`MetallicRoughness`] of metallic 0: an index of refraction, the strength of the
/// reflection and a clear coat.
pub(crate) struct Coated {
    /// What lies under the coat; its `metallic` is taken as 0.
    pub(crate) under: MetallicRoughness,
    /// Index of refraction (`KHR_materials_ior`).
    pub(crate) ior: f64,
    /// Factor of the reflection, at grazing angles too (`KHR_materials_specular`).
    pub(crate) specular: f64,
    /// Share and perceptual roughness of the coat (`KHR_materials_clearcoat`).
    pub(crate) coat: [f64; 2],
}

impl Coated {
    /// Radiance towards a viewer for unit irradiance across the light; all unit vectors:
    /// (1 - c F(V)) under + c F(V) D G / (4 cos(V)).
    pub(crate) fn radiance(&self, normal: DVec3, to_light: DVec3, to_viewer: DVec3) -> f64 {
        let (cos_light, cos_viewer) = (normal.dot(to_light), normal.dot(to_viewer));
        if cos_light <= 0.0 || cos_viewer <= 0.0 {
            return 0.0;
        }
        let half = (to_light + to_viewer).normalize();
        let lobe = |roughness: f64| {
            let a2 = roughness.powi(4);
            let d = a2 / (PI * (normal.dot(half).powi(2) * (a2 - 1.0) + 1.0).powi(2));
            let masking = |cosine: f64| 2.0 * cosine / (cosine + (a2 + (1.0 - a2) * cosine * cosine).sqrt());
            d * masking(cos_light) * masking(cos_viewer) / (4.0 * cos_viewer)
        };
        let schlick = |f0: f64, f90: f64, cosine: f64| f0 + (f90 - f0) * (1.0 - cosine).powi(5);
        let f0 = self.specular * ((self.ior - 1.0) / (self.ior + 1.0)).powi(2);
        let fresnel = schlick(f0, self.specular, half.dot(to_viewer));
        let under = cos_light * (1.0 - fresnel) * self.under.base / PI + fresnel * lobe(self.under.roughness);
        let coat = self.coat[0] * schlick(0.04, 1.0, cos_viewer);
        (1.0 - coat) * under + coat * lobe(self.coat[1])
    }
}

/// The metallic-roughness model of glTF 2.0, appendix B, with one lobe of GGX.
pub(crate) struct MetallicRoughness {
    /// Linear base colour of one channel.
    pub(crate) base: f64,
    /// 0 to 1.
    pub(crate) metallic: f64,
    /// Perceptual.
    pub(crate) roughness: f64,
}

impl MetallicRoughness {
    /// Radiance towards a viewer for unit irradiance across the light; all unit vectors (B.2 and B.3):
    /// cos(L) ((1 - F) (1 - metallic) base / pi + F D G / (4 cos(L) cos(V))).
    pub(crate) fn radiance(&self, normal: DVec3, to_light: DVec3, to_viewer: DVec3) -> f64 {
        let (cos_light, cos_viewer) = (normal.dot(to_light), normal.dot(to_viewer));
        if cos_light <= 0.0 || cos_viewer <= 0.0 {
            return 0.0;
        }
        let half = (to_light + to_viewer).normalize();
        let a2 = self.roughness.powi(4);
        let d = a2 / (PI * (normal.dot(half).powi(2) * (a2 - 1.0) + 1.0).powi(2));
        let masking = |cosine: f64| 2.0 * cosine / (cosine + (a2 + (1.0 - a2) * cosine * cosine).sqrt());
        let g = masking(cos_light) * masking(cos_viewer);
        let f0 = 0.04 + (self.base - 0.04) * self.metallic;
        let fresnel = f0 + (1.0 - f0) * (1.0 - half.dot(to_viewer)).powi(5);
        let diffuse = (1.0 - fresnel) * (1.0 - self.metallic) * self.base / PI;
        cos_light * diffuse + fresnel * d * g / (4.0 * cos_viewer)
    }

    /// Share of an even sky that it sends to a viewer: the integral of the radiance over the hemisphere of lights.
    pub(crate) fn reflected_sky(&self, cos_viewer: f64) -> f64 {
        let to_viewer = DVec3::new((1.0 - cos_viewer * cos_viewer).sqrt(), 0.0, cos_viewer);
        let (rings, spokes) = (600, 600);
        let mut sum = 0.0;
        for ring in 0..rings {
            // Half vectors evenly by the square root of their sine: the lobe is narrow about the normal.
            let theta = 0.5 * PI * ((f64::from(ring) + 0.5) / f64::from(rings)).powi(2);
            let d_theta = PI * (f64::from(ring) + 0.5) / f64::from(rings) / f64::from(rings);
            for spoke in 0..spokes {
                let phi = 2.0 * PI * (f64::from(spoke) + 0.5) / f64::from(spokes);
                let half = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let along = half.dot(to_viewer);
                if along <= 0.0 {
                    continue;
                }
                let to_light = 2.0 * along * half - to_viewer;
                // d(light) = 4 cos(H, V) d(half).
                let solid = 4.0 * along * theta.sin() * d_theta * 2.0 * PI / f64::from(spokes);
                sum += self.radiance(DVec3::Z, to_light, to_viewer) * solid;
            }
        }
        sum
    }
}
