//! Photon walks in the layers: the reference for the fast solution.
//!
//! A beam enters along the normal; each collision absorbs a share of the photon's weight, and the smooth surface
//! splits it when it comes back. Lateral position does not matter for total reflectance, so a photon is a depth and a
//! direction cosine. Random numbers are reproducible: one stream per wavelength from the seed.

use rayon::prelude::*;

use super::coefficients::{Medium, dermis, epidermis, stratum_corneum};
use super::layers::fresnel_reflectance;
use super::{ChromophoreModel, spectral_weights};
use crate::random::SplitMix64;

/// How photons walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Photons per wavelength.
    pub photons: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Mean cosine g of scattering (Henyey and Greenstein 1941) in -1..1; scattering is sigma_s' / (1 - g).
    /// 0 is isotropic with the reduced coefficient, which is what [`super::layers`] solves.
    pub mean_cosine: f64,
}

/// Random numbers whose logarithm is finite.
struct Random(SplitMix64);

impl Random {
    /// Uniform in (0, 1].
    fn next(&mut self) -> f64 {
        self.0.uniform() + f64::EPSILON / 4.0
    }
}

/// Diffuse reflectance at one wavelength and its standard error.
pub fn reflectance(
    model: &ChromophoreModel,
    wavelength_nm: f64,
    melanin: f64,
    hemoglobin: f64,
    walk: Walk,
) -> (f64, f64) {
    let layers = [
        stratum_corneum(wavelength_nm),
        epidermis(model, wavelength_nm, melanin, hemoglobin),
        dermis(model, wavelength_nm, hemoglobin),
    ]
    .map(|m| Medium { scattering_per_mm: m.scattering_per_mm / (1.0 - walk.mean_cosine), ..m });
    let mut random = Random(SplitMix64(walk.seed ^ wavelength_nm.to_bits()));
    let entering = 1.0 - fresnel_reflectance(1.0, 1.0 / model.eta);
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..walk.photons {
        let r = entering * photon(&layers, model, walk.mean_cosine, &mut random);
        sum += r;
        sum2 += r * r;
    }
    let n = f64::from(walk.photons);
    let mean = sum / n;
    (mean, ((sum2 / n - mean * mean).max(0.0) / n).sqrt())
}

/// Weight of one photon that leaves through the surface.
fn photon(layers: &[Medium; 3], model: &ChromophoreModel, mean_cosine: f64, random: &mut Random) -> f64 {
    let corneum = model.stratum_corneum_thickness_mm;
    // Depth of the upper edge of each layer, and of the lower edge of the last.
    let edges = [0.0, corneum, corneum + model.epidermis_thickness_mm, f64::INFINITY];
    let (mut depth, mut cosine, mut weight, mut escaped) = (0.0, 1.0, 1.0, 0.0);
    let mut layer = 0;
    loop {
        let mut free = -random.next().ln();
        // Walk through layers and reflections until the optical path is used up.
        loop {
            let extinction = layers[layer].extinction_per_mm();
            let edge = if cosine > 0.0 { edges[layer + 1] } else { edges[layer] };
            let to_edge: f64 = (edge - depth) / cosine;
            if free < to_edge * extinction {
                depth += cosine * free / extinction;
                break;
            }
            free -= to_edge * extinction;
            if layer == 0 && cosine < 0.0 {
                depth = 0.0;
                let reflected = fresnel_reflectance(-cosine, 1.0 / model.eta);
                escaped += weight * (1.0 - reflected);
                weight *= reflected;
                cosine = -cosine;
                if weight == 0.0 {
                    return escaped;
                }
            } else {
                depth = edge;
                layer = if cosine > 0.0 { layer + 1 } else { layer - 1 };
            }
        }
        weight *= layers[layer].albedo();
        if weight < 1e-3 {
            // Russian roulette ends the walk without bias.
            if random.next() > 0.1 {
                return escaped;
            }
            weight *= 10.0;
        }
        cosine = scatter(cosine, mean_cosine, random);
    }
}

/// New direction cosine after a collision.
fn scatter(cosine: f64, g: f64, random: &mut Random) -> f64 {
    if g == 0.0 {
        return 2.0 * random.next() - 1.0 + f64::EPSILON;
    }
    let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * random.next());
    let turn: f64 = ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0);
    let azimuth = std::f64::consts::TAU * random.next();
    let next =
        cosine * turn + ((1.0 - cosine * cosine) * (1.0 - turn * turn)).max(0.0).sqrt() * azimuth.cos();
    // A photon that runs exactly along the layers would never reach an edge.
    if next == 0.0 { f64::EPSILON } else { next.clamp(-1.0, 1.0) }
}

/// Linear Rec. 709 diffuse albedo under D65 and the standard error of each component.
pub fn skin_color(
    model: &ChromophoreModel,
    melanin: f64,
    hemoglobin: f64,
    walk: Walk,
) -> ([f64; 3], [f64; 3]) {
    let spectrum = spectral_weights();
    let parts: Vec<_> = spectrum
        .par_iter()
        .map(|(nm, weight)| (reflectance(model, *nm, melanin, hemoglobin, walk), *weight))
        .collect();
    let (mut color, mut variance) = ([0.0; 3], [0.0; 3]);
    for ((mean, error), weight) in parts {
        for i in 0..3 {
            color[i] += weight[i] * mean;
            variance[i] += (weight[i] * error).powi(2);
        }
    }
    (color, variance.map(f64::sqrt))
}
