//! Share of an even environment that the specular lobe reflects: what the prefiltered map is multiplied with.
//!
//! `A(m, cos) = integral of D(m) F(f0) / |L + V|^2 cos(L) dL = f0 scale + bias`, with the lobe of the lamps (Kelemen and
//! Szirmay-Kalos 2001 with Beckmann's D and Schlick's F), so a sky and many lamps in its place give the same light.
//! Split as by Karis 2013, "Real shading in Unreal Engine 4".

use std::f32::consts::TAU;

use glam::Vec3;

/// Entries on a side: cosine of the viewer along a row, roughness down; the first and last stand at 0 and 1.
pub(crate) const SIDE: u32 = 32;
/// Samples along and around the lobe.
const SAMPLES: [u32; 2] = [24, 24];
/// Least square of |L + V|, as in shade.wgsl: where both graze, the lobe would leave any bound.
const LEAST_SQUARE: f32 = 0.3;

/// Factor of f0 and what is added to it.
pub(crate) fn scale_and_bias(roughness: f32, cosine: f32) -> [f32; 2] {
    let m2 = (roughness * roughness).max(1e-4);
    let cosine = cosine.clamp(0.01, 1.0);
    let viewer = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let [along, around] = SAMPLES;
    let (mut scale, mut bias) = (0.0, 0.0);
    for i in 0..along {
        // Half vectors in proportion to D cos: tan^2 = -m^2 ln(1 - u).
        let tan2 = -m2 * (1.0 - (i as f32 + 0.5) / along as f32).ln();
        let cos_half = 1.0 / (1.0 + tan2).sqrt();
        let sin_half = (1.0 - cos_half * cos_half).max(0.0).sqrt();
        for j in 0..around {
            let phi = TAU * (j as f32 + 0.5) / around as f32;
            let half = Vec3::new(sin_half * phi.cos(), sin_half * phi.sin(), cos_half);
            let cos_difference = half.dot(viewer);
            let light = 2.0 * cos_difference * half - viewer;
            if light.z <= 0.0 || cos_difference <= 0.0 {
                continue;
            }
            let square = (light + viewer).length_squared().max(LEAST_SQUARE);
            // The density of light directions is D cos_half / (4 cos_difference).
            let weight = light.z / square * 4.0 * cos_difference / cos_half;
            let fresnel = (1.0 - cos_difference).powi(5);
            scale += weight * (1.0 - fresnel);
            bias += weight * fresnel;
        }
    }
    let count = (along * around) as f32;
    [scale / count, bias / count]
}

/// The table, row by row, as texels.
pub(crate) fn table() -> Vec<[f32; 4]> {
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    (0..SIDE * SIDE)
        .map(|i| {
            let [scale, bias] = scale_and_bias(at(i / SIDE), at(i % SIDE));
            [scale, bias, 0.0, 0.0]
        })
        .collect()
}

/// The lobe over f0 = 1 without Fresnel, for tests: D / |L + V|^2.
#[cfg(test)]
fn lobe(light: Vec3, viewer: Vec3, roughness: f32) -> f32 {
    let half = light + viewer;
    let c2 = half.normalize().z.powi(2);
    let m2 = roughness * roughness;
    ((c2 - 1.0) / (c2 * m2)).exp() / (0.5 * TAU * m2 * c2 * c2) / half.length_squared().max(LEAST_SQUARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_integral_over_lamps() {
        for (roughness, cosine) in [(0.3f32, 1.0f32), (0.3, 0.5), (0.5, 0.2), (0.8, 0.7)] {
            let viewer = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
            // Lamps of equal solid angle all over the hemisphere.
            let n = 600;
            let mut sum = 0.0f64;
            for i in 0..n {
                let z = (i as f32 + 0.5) / n as f32;
                let r = (1.0 - z * z).sqrt();
                for j in 0..2 * n {
                    let phi = TAU * (j as f32 + 0.5) / (2 * n) as f32;
                    let light = Vec3::new(r * phi.cos(), r * phi.sin(), z);
                    sum += f64::from(lobe(light, viewer, roughness) * z);
                }
            }
            let direct = (sum * f64::from(TAU) / f64::from(2 * n * n)) as f32;
            let [scale, bias] = scale_and_bias(roughness, cosine);
            assert!(
                (scale + bias - direct).abs() < 0.02 * direct,
                "{roughness} {cosine}: {scale} {bias} {direct}"
            );
        }
    }

    #[test]
    fn a_polished_surface_reflects_what_fresnel_says_and_none_creates_light() {
        let [scale, bias] = scale_and_bias(0.02, 1.0);
        assert!((scale - 1.0).abs() < 0.01 && bias < 1e-3, "{scale} {bias}");
        for texel in table() {
            // Of skin, f0 = 0.028: the lobe alone is not bounded by one at grazing angles.
            let albedo = 0.028 * texel[0] + texel[1];
            assert!((0.0..=1.0).contains(&albedo), "{texel:?}");
        }
    }
}
