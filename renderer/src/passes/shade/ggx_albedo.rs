//! Share of an even sky that GGX reflects, as a table: what the environment's mirrored light is weighted with (Karis 2013,
//! "Real shading in Unreal Engine 4", with the masking of glTF 2.0).

use std::f64::consts::PI;

use crate::device::texture::Texel;

/// Cosines of the viewer along a row, perceptual roughness down, both from 0 to 1.
pub(crate) const SIZE: [u32; 2] = [32, 32];
/// Cosine of the first column: at 0 nothing is seen.
const LEAST_COSINE: f64 = 1e-3;
/// Half vectors of an entry are this number squared.
const SIDE: u32 = 64;

/// `[scale, bias]`: the share is f0 scale + bias.
pub(crate) fn scale_and_bias(roughness: f64, cosine: f64) -> [f64; 2] {
    let cosine = cosine.max(LEAST_COSINE);
    let a2 = roughness.powi(4).max(1e-8);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let masking = |c: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
    let mut sum = [0.0; 2];
    for i in 0..SIDE * SIDE {
        let along = (f64::from(i / SIDE) + 0.5) / f64::from(SIDE);
        let around = 2.0 * PI * (f64::from(i % SIDE) + 0.5) / f64::from(SIDE);
        // Half vectors by D cos(H): their density in lights is D cos(H) / (4 cos(H, V)).
        let cos_half = ((1.0 - along) / (1.0 + (a2 - 1.0) * along)).sqrt();
        let sin_half = (1.0 - cos_half * cos_half).max(0.0).sqrt();
        let between = sine * sin_half * around.cos() + cosine * cos_half;
        let cos_light = 2.0 * between * cos_half - cosine;
        if between <= 0.0 || cos_light <= 0.0 {
            continue;
        }
        let weight = masking(cos_light) * masking(cosine) * between / (cos_half * cosine);
        let fresnel = (1.0 - between).powi(5);
        sum[0] += (1.0 - fresnel) * weight;
        sum[1] += fresnel * weight;
    }
    sum.map(|s| s / f64::from(SIDE * SIDE))
}

/// The table, row by row.
pub(crate) fn table() -> Vec<Texel> {
    let place = |i: u32, n: u32| f64::from(i) / f64::from(n - 1);
    (0..SIZE[0] * SIZE[1])
        .map(|i| {
            let [scale, bias] = scale_and_bias(place(i / SIZE[0], SIZE[1]), place(i % SIZE[0], SIZE[0]));
            [scale as f32, bias as f32, 0.0, 1.0]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::reference::MetallicRoughness;
    use super::*;

    #[test]
    fn entries_are_the_integral_of_the_equation() {
        for roughness in [0.2, 0.5, 1.0] {
            for cosine in [0.2, 0.6, 1.0] {
                let [scale, bias] = scale_and_bias(roughness, cosine);
                for f0 in [0.3, 1.0] {
                    let metal = MetallicRoughness { base: f0, metallic: 1.0, roughness };
                    let (found, expected) = (f0 * scale + bias, metal.reflected_sky(cosine));
                    assert!(
                        (found - expected).abs() < 0.004,
                        "{roughness} {cosine} {f0}: {found}, {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn nothing_is_reflected_twice() {
        for texel in table() {
            assert!((0.0..=1.001).contains(&(texel[0] + texel[1])) && texel[1] >= 0.0, "{texel:?}");
        }
    }
}
