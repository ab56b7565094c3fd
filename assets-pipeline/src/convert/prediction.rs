//! Distributions and wrinkle weights predicted from geometry, for heads without measured expressions.
//!
//! ```text
//! expression --deformed points--> strain of the surface --StrainModel--> ratios of mean and contrast, wrinkle weight
//!            --texture of the head--> Distribution; mean over each mask --> weight of each wrinkle zone
//! ```
//!
//! Papers/004 leaves it open (section 7.8); the model is linear in the strain, see [`rubor_rig::strain`]. Everything
//! made here is labelled `predicted`.

use glam::Vec3;
use rubor_rig::head::{Distribution, Head};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rubor_rig::skin::chromophores::MAX_HEMOGLOBIN;
use rubor_rig::strain::{StrainModel, point_strain};

use super::skin_texels::SkinTexels;

/// The prediction from the strain of one expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Scale and bias on the neutral mean that was given.
    pub distribution: Distribution,
    /// Weight of each zone of the head, 0 to 1: the mean of the wrinkle weight over the zone's mask.
    pub zone_weights: Vec<f32>,
}

/// Predicts the blood and the wrinkles of a head whose points have moved to `deformed`; `mean` is `mu_n`.
///
/// # Panics
/// When `deformed` has another length than the head's points.
pub fn predict(head: &Head, model: &StrainModel, name: &str, deformed: &[Vec3], mean: &Map) -> Prediction {
    let strain: Vec<_> = point_strain(&head.mesh, deformed).iter().map(|s| model.predict(s)).collect();
    let texels = SkinTexels::new(head, mean.width, mean.height);
    let field = |value: fn(&rubor_rig::strain::StrainPrediction) -> f32| {
        texels.map_of_points(&strain.iter().map(value).collect::<Vec<_>>())
    };
    let mut bias = field(|p| p.bias_ratio);
    for (b, m) in bias.values.iter_mut().zip(&mean.values) {
        *b = (*b * m).clamp(0.0, MAX_HEMOGLOBIN as f32);
    }
    let wrinkles = field(|p| p.wrinkle);
    let skin = texels.mask();
    let zone_weights = head.maps.zones.iter().map(|z| weighted_mean(&wrinkles, &z.mask, &skin)).collect();
    Prediction {
        distribution: Distribution { name: name.to_owned(), scale: field(|p| p.scale), bias },
        zone_weights,
    }
}

/// A state of a head that has a distribution, to which a model can be fitted.
#[derive(Clone, Debug)]
pub struct KnownState<'a> {
    /// Deformed points of the head.
    pub deformed: Vec<Vec3>,
    /// Its scale and bias, of any size.
    pub distribution: &'a Distribution,
}

/// The coefficients of blood that come closest to the distributions of some states by least squares over the skin; those
/// of wrinkles stay as they are. A coefficient that no strain speaks of stays too.
///
/// # Panics
/// When a state has another number of points than the head.
pub fn fit(head: &Head, model: &StrainModel, states: &[KnownState<'_>], mean: &Map) -> StrainModel {
    let texels = SkinTexels::new(head, mean.width, mean.height);
    let skin = texels.mask();
    // Compression and stretch never meet in one place, so their normal equations part.
    let (mut compression, mut stretch, mut area) = ([0.0f64; 2], [0.0f64; 2], [0.0f64; 2]);
    let add = |sums: &mut [f64; 2], x: f64, y: f64| *sums = [sums[0] + x * y, sums[1] + x * x];
    for state in states {
        let strain: Vec<f32> = point_strain(&head.mesh, &state.deformed).iter().map(|s| s.area).collect();
        let strain = texels.map_of_points(&strain);
        for i in (0..mean.values.len()).filter(|i| skin.mapped[*i] && mean.values[*i] > 1e-6) {
            let u = ((i as u32 % mean.width) as f32 + 0.5) / mean.width as f32;
            let v = ((i as u32 / mean.width) as f32 + 0.5) / mean.height as f32;
            let x = f64::from(strain.values[i]);
            let bias = f64::from(state.distribution.bias.sample(u, v, 0) / mean.values[i]) - 1.0;
            add(if x < 0.0 { &mut compression } else { &mut stretch }, x, bias);
            add(&mut area, x, f64::from(state.distribution.scale.sample(u, v, 0)) - 1.0);
        }
    }
    let slope = |[xy, xx]: [f64; 2], before: f32| if xx > 1e-9 { (xy / xx) as f32 } else { before };
    StrainModel {
        bias_per_compression: slope(compression, model.bias_per_compression),
        bias_per_stretch: slope(stretch, model.bias_per_stretch),
        scale_per_area: slope(area, model.scale_per_area),
        ..*model
    }
}

/// Mean of a map over the skin, weighted by a mask of any size; 0 where the mask is empty.
fn weighted_mean(map: &Map, weights: &Map, skin: &Mask) -> f32 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (i, v) in map.values.iter().enumerate().filter(|(i, _)| skin.mapped[*i]) {
        let u = ((i as u32 % map.width) as f32 + 0.5) / map.width as f32;
        let t = ((i as u32 / map.width) as f32 + 0.5) / map.height as f32;
        let w = weights.sample(u, t, 0);
        (sum, weight) = (sum + w * v, weight + w);
    }
    if weight > 0.0 { sum / weight } else { 0.0 }
}

/// Pearson's correlation of two lists of one length; `None` where one of them is constant or both are empty.
pub fn correlation(a: &[f32], b: &[f32]) -> Option<f64> {
    let n = a.len().min(b.len()) as f64;
    let mean = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (f64::from(*x) - ma, f64::from(*y) - mb);
        (ab, aa, bb) = (ab + x * y, aa + x * x, bb + y * y);
    }
    let norm = (aa * bb).sqrt();
    (norm > 1e-15 * n).then(|| ab / norm)
}

#[cfg(test)]
mod tests {
    use super::super::skin_texels::tests::sheet;
    use super::*;
    use glam::Vec2;
    use rubor_rig::head::WrinkleZone;

    #[test]
    fn a_squeezed_sheet_drains_everywhere_and_wrinkles_in_its_zones() {
        let mut head = sheet(Vec2::ZERO, Vec2::new(0.5, 1.0));
        head.maps.wrinkle_slopes = vec![Map::filled(1, 1, &[0.1, 0.0])];
        let zone =
            |name: &str, v| WrinkleZone { name: name.into(), wrinkle_map: 0, mask: Map::filled(2, 2, &[v]) };
        head.maps.zones = vec![zone("all", 1.0), zone("none", 0.0)];
        let squeezed: Vec<Vec3> = head.mesh.points.iter().map(|p| Vec3::new(0.8 * p.x, p.y, p.z)).collect();
        let mean = Map::filled(16, 16, &[0.05]);
        let found = predict(&head, &StrainModel::default(), "joy", &squeezed, &mean);
        // Area shrinks by a fifth; the default model takes 0.6 of that from the mean and 0.4 from the contrast.
        for (scale, bias) in found.distribution.scale.values.iter().zip(&found.distribution.bias.values) {
            assert!((scale - 0.92).abs() < 1e-4 && (bias - 0.05 * 0.88).abs() < 1e-5, "{scale} {bias}");
        }
        assert!((found.zone_weights[0] - 0.6).abs() < 1e-3 && found.zone_weights[1] == 0.0);
        let still = predict(&head, &StrainModel::default(), "joy", &head.mesh.points, &mean);
        assert!(still.distribution.bias.values.iter().all(|b| (b - 0.05).abs() < 1e-7));
        assert_eq!(still.zone_weights, [0.0, 0.0]);
    }

    #[test]
    fn a_fit_finds_the_coefficients_that_made_the_maps() {
        let head = sheet(Vec2::ZERO, Vec2::ONE);
        let truth = StrainModel {
            bias_per_compression: -0.7,
            bias_per_stretch: 0.2,
            scale_per_area: 1.1,
            ..Default::default()
        };
        let mean = Map::filled(16, 16, &[0.05]);
        let moved =
            |f: f32| -> Vec<Vec3> { head.mesh.points.iter().map(|p| Vec3::new(f * p.x, p.y, p.z)).collect() };
        let distributions =
            [0.8, 1.3].map(|f| predict(&head, &truth, "state", &moved(f), &mean).distribution);
        let states: Vec<_> = [0.8, 1.3]
            .into_iter()
            .zip(&distributions)
            .map(|(f, distribution)| KnownState { deformed: moved(f), distribution })
            .collect();
        let found = fit(&head, &StrainModel::default(), &states, &mean);
        assert!(
            (found.bias_per_compression + 0.7).abs() < 1e-3 && (found.bias_per_stretch - 0.2).abs() < 1e-3
        );
        assert!((found.scale_per_area - 1.1).abs() < 1e-3, "{found:?}");
        assert_eq!(fit(&head, &truth, &[], &mean), truth);
    }

    #[test]
    fn correlation_has_its_known_values() {
        let a = [1.0, 2.0, 3.0, 4.0];
        assert!((correlation(&a, &[2.0, 4.0, 6.0, 8.0]).unwrap() - 1.0).abs() < 1e-12);
        assert!((correlation(&a, &[1.0, -1.0, -3.0, -5.0]).unwrap() + 1.0).abs() < 1e-12);
        assert!(correlation(&a, &[1.0, -1.0, -1.0, 1.0]).unwrap().abs() < 1e-12);
        assert_eq!(correlation(&a, &[5.0; 4]), None);
        assert_eq!(correlation(&[], &[]), None);
    }
}
