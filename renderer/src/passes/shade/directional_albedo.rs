//! Share of a uniform environment that the specular lobe reflects: the factor of the prefiltered map.
//!
//! `A(m, cos) = integral of D(m) F(f0) / |L + V|^2 cos(L) dL = f0 scale + bias`, with the lobe of the lamps (Kelemen and
//! Szirmay-Kalos 2001 with Beckmann's D and Schlick's F), so a sky and many lamps in its place give the same light.
//! Split as by Karis 2013, "Real shading in Unreal Engine 4".

use std::f32::consts::TAU;

use glam::Vec3;

use super::ggx_albedo;

/// Columns (cosines of the viewer) and rows (roughnesses); the first and the last are at 0 and 1.
const SIDE: u32 = 32;
/// Columns of the table before the mean, for the shader.
pub(crate) const COSINES: u32 = SIDE;
/// Columns and rows of the table: one column more holds the mean over the hemisphere.
pub(crate) const SIZE: [u32; 2] = [SIDE + 1, SIDE];
/// Samples along and around the lobe.
const SAMPLES: [u32; 2] = [24, 24];
/// Smallest square of |L + V|: the lobe would be unbounded where both graze.
pub(crate) const LEAST_SQUARE: f32 = 0.3;

/// Factor of f0, and the term added to it.
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

/// The table, row by row, as texels: scale and bias of one lobe, then of two with factors of roughness and the share of
/// the second.
pub(crate) fn table([first, second, share]: [f32; 3]) -> Vec<[f32; 4]> {
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    let texel = |roughness: f32, cosine: f32| {
        let one = scale_and_bias(roughness, cosine);
        let mut skin = one;
        if share > 0.0 {
            let (a, b) =
                (scale_and_bias(first * roughness, cosine), scale_and_bias(second * roughness, cosine));
            skin = std::array::from_fn(|k| (1.0 - share) * a[k] + share * b[k]);
        }
        [one[0], one[1], skin[0], skin[1]]
    };
    let mut texels = Vec::new();
    for row in 0..SIDE {
        let of_cosines: Vec<[f32; 4]> = (0..SIDE).map(|i| texel(at(row), at(i))).collect();
        texels.extend_from_slice(&of_cosines);
        texels.push(mean(&of_cosines));
    }
    texels
}

/// The table with GGX by glTF's equations in the place of the skin's lobes; its alpha, the width of slopes, goes down the rows.
pub(crate) fn table_of_base_colors() -> Vec<[f32; 4]> {
    let mut texels = table([1.0, 1.0, 0.0]);
    for (row, texels) in texels.chunks_exact_mut(SIZE[0] as usize).enumerate() {
        let roughness = (row as f64 / f64::from(SIDE - 1)).sqrt();
        for (i, texel) in texels[..SIDE as usize].iter_mut().enumerate() {
            let [scale, bias] = ggx_albedo::scale_and_bias(roughness, i as f64 / f64::from(SIDE - 1));
            (texel[2], texel[3]) = (scale as f32, bias as f32);
        }
        texels[SIDE as usize] = mean(&texels[..SIDE as usize]);
    }
    texels
}

/// `2 integral of f(c) c dc`, f a straight line between cosines.
fn mean(of_cosines: &[[f32; 4]]) -> [f32; 4] {
    let step = 1.0 / (of_cosines.len() - 1) as f32;
    let mut sum = [0.0; 4];
    for (i, ends) in of_cosines.windows(2).enumerate() {
        let (a, b) = (i as f32 * step, (i + 1) as f32 * step);
        for k in 0..4 {
            // Exact for the product of two straight lines.
            sum[k] += step / 3.0 * (ends[0][k] * (2.0 * a + b) + ends[1][k] * (a + 2.0 * b));
        }
    }
    sum
}

/// Light of a lamp at a cosine that enters skin, relative to that of a uniform sky, for tests: the factor of
/// shade.wesl.
#[cfg(test)]
pub(crate) fn entering(specular: f32, roughness: f32, cosine: f32) -> f64 {
    let rho = |cosine: f32| {
        let [scale, bias] = scale_and_bias(roughness, cosine);
        f64::from(specular * (0.028 * scale + bias))
    };
    let n = 200;
    let mean =
        (0..n).map(|i| (i as f32 + 0.5) / n as f32).map(|c| 2.0 * f64::from(c) * rho(c) / f64::from(n));
    (1.0 - rho(cosine)) / (1.0 - mean.sum::<f64>())
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
        for lobes in [[1.0, 1.0, 0.0], [0.72, 1.5, 0.278]] {
            for row in table(lobes).chunks(SIZE[0] as usize) {
                for pair in [0, 2] {
                    // For skin, f0 = 0.028: the lobe alone is not bounded by one at grazing angles.
                    let albedo = |texel: &[f32; 4]| 0.028 * texel[pair] + texel[pair + 1];
                    assert!(row.iter().all(|t| (0.0..=1.0).contains(&albedo(t))), "{row:?}");
                    let [.., mean] = row else { panic!("no columns") };
                    // The share of a uniform sky that enters, summed lamp by lamp, is that of the mean.
                    let n = 4000;
                    let entering: f64 = (0..n)
                        .map(|i| {
                            let c = (f64::from(i) + 0.5) / f64::from(n);
                            let x = c * f64::from(SIDE - 1);
                            let (i, t) = (x as usize, x.fract());
                            let between =
                                f64::from(albedo(&row[i])) * (1.0 - t) + f64::from(albedo(&row[i + 1])) * t;
                            2.0 * c * (1.0 - between) / f64::from(n)
                        })
                        .sum();
                    assert!((entering - f64::from(1.0 - albedo(mean))).abs() < 1e-4);
                }
            }
        }
    }
}
