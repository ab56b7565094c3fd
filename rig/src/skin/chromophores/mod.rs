//! Skin colour from melanin and hemoglobin: a layered spectral model, baked into a look-up.
//!
//! ```text
//! melanin, hemoglobin --coefficients--> sigma_a, sigma_s' of horny layer, epidermis and dermis at 61 wavelengths
//!                     --layers--------> diffuse reflectance spectrum (discrete ordinates; reference: monte_carlo)
//!                     --observer------> linear Rec. 709 under D65
//! SkinModel: a Chebyshev interpolant of that --bake--> SkinLookup (any size) --> renderer, map synthesis
//! ```
//!
//! Theory and source: Donner and Jensen 2006 (spectra and layers), Jimenez et al. 2010 (parameters, look-up;
//! Jimenez 2012 section 7.6). What differs: reflectance comes from the radiative transfer equation by discrete ordinates
//! instead of the multipole, which is exact also where absorption is as strong as scattering (dark skin, blue light);
//! a thin horny layer without melanin lies on the epidermis; without it dark skin is too orange.
//!
//! The look-up is addressed by `u = cbrt(C_m / 0.5)`, `v = cbrt(C_hd / 0.32)`: equation 7.7 with both axes scaled to
//! 0..1 over the ranges of table 7.1.
//!
//! ```
//! use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
//!
//! let skin = SkinModel::new(&ChromophoreModel::default());
//! let lookup = skin.bake(64, 64);
//! let [r, g, b] = lookup.sample(0.02, 0.02);
//! assert!(r > g && g > b && b > 0.0);
//! ```

pub mod coefficients;
pub mod invert;
pub mod layers;
pub mod monte_carlo;
pub mod published;
pub mod spectra;

use rayon::prelude::*;

use crate::color::{REC709_FROM_XYZ, transform};
use coefficients::{dermis, epidermis, stratum_corneum};
use layers::{Directions, HalfSpace};
use spectra::{D65, FIRST_NM, OBSERVER, OBSERVER_STEP_NM};

/// Largest melanin volume fraction of the epidermis (Jimenez 2012 table 7.1).
pub const MAX_MELANIN: f64 = 0.5;
/// Largest hemoglobin volume fraction of the dermis (Jimenez 2012 table 7.1).
pub const MAX_HEMOGLOBIN: f64 = 0.32;

/// Constants of skin that do not come from a map.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChromophoreModel {
    /// Share of eumelanin in melanin beta_m, 0 to 1; the rest is pheomelanin.
    pub eumelanin_share: f64,
    /// Hemoglobin fraction of the epidermis over that of the dermis, C_he / C_hd.
    pub epidermal_blood_share: f64,
    /// Oxygen saturation gamma, 0 to 1.
    pub oxygenation: f64,
    /// Thickness of the living epidermis, which holds the melanin, mm.
    pub epidermis_thickness_mm: f64,
    /// Thickness of the horny layer above it, mm; 0 for none.
    pub stratum_corneum_thickness_mm: f64,
    /// Reduced scattering of the dermis over that of the epidermis.
    pub dermis_scattering_share: f64,
    /// Index of refraction relative to air.
    pub eta: f64,
}

impl Default for ChromophoreModel {
    /// Donner and Jensen 2006 with the blends of Jimenez 2012 figure 7.9, but for the thicknesses: 0.012 mm of horny layer
    /// without melanin on 0.05 mm of living epidermis, as on the face (0.01 and 0.04 to 0.1 mm in histology), not
    /// 0.25 mm with melanin throughout. Chosen on the twenty colours of [`published`]: mean CIEDE2000 1.3 (0.7 for the
    /// measured means of Xiao et al. 2017). At 0.25 mm those lie 3.4 away: so thick a layer without much blood returns
    /// too much blue (grey-pink light skin, b* of 8 for 15). Without the horny layer dark skin is too orange: 4 away
    /// where it is 0.7 with it (tone 8 of Monk's scale).
    fn default() -> Self {
        Self {
            eumelanin_share: 0.61,
            epidermal_blood_share: 0.25,
            oxygenation: 0.75,
            epidermis_thickness_mm: 0.05,
            stratum_corneum_thickness_mm: 0.012,
            dermis_scattering_share: 0.5,
            eta: 1.4,
        }
    }
}

/// Added to both colours of a change of blood, so that components near 0, or slightly below, have a ratio: half a step of
/// 8 bits.
pub const CHANGE_FLOOR: f32 = 0.002;
/// Largest factor, and one over the least, by which blood changes a component of a colour that skin has by itself. Changes
/// between 1 % and 8 % blood stay within it at any melanin.
pub const MOST_CHANGE: f32 = 4.0;

/// Address in the look-up of volume fractions, clamped to 0..1 (Jimenez 2012 eq. 7.7, scaled to the ranges of table 7.1).
pub fn lookup_address(melanin: f64, hemoglobin: f64) -> [f64; 2] {
    [(melanin / MAX_MELANIN).clamp(0.0, 1.0).cbrt(), (hemoglobin / MAX_HEMOGLOBIN).clamp(0.0, 1.0).cbrt()]
}

/// Volume fractions (melanin, hemoglobin) at an address, the inverse of [`lookup_address`].
pub fn fractions_at(u: f64, v: f64) -> [f64; 2] {
    [MAX_MELANIN * u * u * u, MAX_HEMOGLOBIN * v * v * v]
}

/// Wavelengths in use and the linear Rec. 709 colour under D65 of a unit reflectance at each; the colours sum to 1.
///
/// The rows below 400 nm and above 700 nm (0.5 % of the weight of any primary) join their nearest neighbour inside.
pub fn spectral_weights() -> Vec<(f64, [f64; 3])> {
    let norm: f64 = OBSERVER.iter().zip(&D65).map(|(cmf, power)| cmf[1] * power).sum();
    let mut weights: Vec<(f64, [f64; 3])> = (0..61).map(|i| (400.0 + 5.0 * i as f64, [0.0; 3])).collect();
    for (i, (cmf, power)) in OBSERVER.iter().zip(&D65).enumerate() {
        let nm = FIRST_NM + OBSERVER_STEP_NM * i as f64;
        let band = ((nm.clamp(400.0, 700.0) - 400.0) / 5.0).round() as usize;
        let color = transform(&REC709_FROM_XYZ, cmf.map(|c| c * power / norm));
        for (sum, c) in weights[band].1.iter_mut().zip(color) {
            *sum += c;
        }
    }
    weights
}

/// Diffuse reflectance at one wavelength, 0 to 1, without interpolation between fractions.
pub fn spectral_reflectance(
    model: &ChromophoreModel,
    wavelength_nm: f64,
    melanin: f64,
    hemoglobin: f64,
) -> f64 {
    let directions = Directions::new(model.eta);
    let base = directions.half_space(dermis(model, wavelength_nm, hemoglobin));
    layered_reflectance(model, &directions, wavelength_nm, melanin, hemoglobin, &base)
}

/// Reflectance of horny layer and epidermis on a dermis.
fn layered_reflectance(
    model: &ChromophoreModel,
    directions: &Directions,
    wavelength_nm: f64,
    melanin: f64,
    hemoglobin: f64,
    dermis: &HalfSpace,
) -> f64 {
    let layer = epidermis(model, wavelength_nm, melanin, hemoglobin);
    if model.stratum_corneum_thickness_mm <= 0.0 {
        return directions.reflectance(layer, model.epidermis_thickness_mm, dermis);
    }
    let skin = directions.over(layer, model.epidermis_thickness_mm, dermis);
    directions.reflectance(stratum_corneum(wavelength_nm), model.stratum_corneum_thickness_mm, &skin)
}

/// Linear Rec. 709 diffuse albedo under D65 without interpolation between fractions: 61 solutions, about 0.3 ms.
pub fn skin_color_direct(model: &ChromophoreModel, melanin: f64, hemoglobin: f64) -> [f64; 3] {
    let mut color = [0.0; 3];
    for (nm, weight) in spectral_weights() {
        let r = spectral_reflectance(model, nm, melanin, hemoglobin);
        for (sum, w) in color.iter_mut().zip(weight) {
            *sum += w * r;
        }
    }
    color
}

/// Chebyshev nodes along each axis of [`SkinModel`].
pub const NODES: usize = 14;

/// Skin colour as a smooth function of the look-up address: a Chebyshev interpolant of the two-layer model.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinModel {
    /// Linear Rec. 709 at (node of u, node of v): `colors[v][u]`.
    colors: Vec<[[f64; 3]; NODES]>,
}

/// Chebyshev-Gauss-Lobatto node on 0..1: both ends are nodes.
fn node(i: usize) -> f64 {
    0.5 - 0.5 * (std::f64::consts::PI * i as f64 / (NODES - 1) as f64).cos()
}

/// Barycentric Lagrange weights of the nodes at x (Berrut and Trefethen 2004).
fn node_weights(x: f64) -> [f64; NODES] {
    let mut weights = [0.0; NODES];
    for i in 0..NODES {
        let distance = x - node(i);
        if distance == 0.0 {
            weights = [0.0; NODES];
            weights[i] = 1.0;
            return weights;
        }
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let end = if i == 0 || i == NODES - 1 { 0.5 } else { 1.0 };
        weights[i] = sign * end / distance;
    }
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

impl SkinModel {
    /// Solves the two-layer model at all nodes and wavelengths.
    pub fn new(model: &ChromophoreModel) -> Self {
        let directions = Directions::new(model.eta);
        let spectrum = spectral_weights();
        let row = |j: usize| {
            let mut row = [[0.0; 3]; NODES];
            for (nm, weight) in &spectrum {
                let hemoglobin = fractions_at(0.0, node(j))[1];
                let base = directions.half_space(dermis(model, *nm, hemoglobin));
                for (i, color) in row.iter_mut().enumerate() {
                    let melanin = fractions_at(node(i), 0.0)[0];
                    let r = layered_reflectance(model, &directions, *nm, melanin, hemoglobin, &base);
                    for (sum, w) in color.iter_mut().zip(weight) {
                        *sum += w * r;
                    }
                }
            }
            row
        };
        Self { colors: (0..NODES).into_par_iter().map(row).collect() }
    }

    /// Linear Rec. 709 diffuse albedo at an address, both 0..1.
    pub fn color_at(&self, u: f64, v: f64) -> [f64; 3] {
        self.combine(&node_weights(u), &node_weights(v))
    }

    /// Linear Rec. 709 diffuse albedo of volume fractions, clamped to the ranges of the model.
    pub fn color(&self, melanin: f64, hemoglobin: f64) -> [f64; 3] {
        let [u, v] = lookup_address(melanin, hemoglobin);
        self.color_at(u, v)
    }

    fn combine(&self, along_u: &[f64; NODES], along_v: &[f64; NODES]) -> [f64; 3] {
        let mut color = [0.0; 3];
        for (row, wv) in self.colors.iter().zip(along_v) {
            for (node_color, wu) in row.iter().zip(along_u) {
                for (sum, c) in color.iter_mut().zip(node_color) {
                    *sum += wu * wv * c;
                }
            }
        }
        color
    }

    /// Bakes a table of `width` (melanin) by `height` (hemoglobin) texels, each at least 2.
    pub fn bake(&self, width: u32, height: u32) -> SkinLookup {
        let (width, height) = (width.max(2), height.max(2));
        let along_u: Vec<_> = (0..width).map(|x| node_weights(f64::from(x) / f64::from(width - 1))).collect();
        let row = |y: u32| {
            let along_v = node_weights(f64::from(y) / f64::from(height - 1));
            // First down the columns, then along the row.
            let mut column = [[0.0; 3]; NODES];
            for (colors, wv) in self.colors.iter().zip(along_v) {
                for (sum, color) in column.iter_mut().zip(colors) {
                    for (s, c) in sum.iter_mut().zip(color) {
                        *s += wv * c;
                    }
                }
            }
            let texel = |wu: &[f64; NODES]| {
                let mut color = [0.0; 3];
                for (node_color, w) in column.iter().zip(wu) {
                    for (s, c) in color.iter_mut().zip(node_color) {
                        *s += w * c;
                    }
                }
                color.map(|c| c as f32)
            };
            along_u.iter().map(texel).collect::<Vec<_>>()
        };
        let texels = (0..height).into_par_iter().flat_map_iter(row).collect();
        SkinLookup { width, height, texels }
    }
}

/// The skin colour table of Jimenez 2012 figure 7.9: melanin along x, hemoglobin along y, cube-root axes.
///
/// Texel (x, y) stands at `u = x / (width - 1)`, `v = y / (height - 1)`: the first and last texels are the ends of the
/// ranges, so a sampler addresses the texture at `(u * (width - 1) + 0.5) / width`.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinLookup {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear Rec. 709 diffuse albedo, row by row; a component is slightly negative outside the gamut of Rec. 709.
    pub texels: Vec<[f32; 3]>,
}

impl SkinLookup {
    /// Linear Rec. 709 diffuse albedo of volume fractions (melanin, hemoglobin), clamped to the ranges; bilinear.
    pub fn sample(&self, melanin: f32, hemoglobin: f32) -> [f32; 3] {
        let [u, v] = lookup_address(f64::from(melanin), f64::from(hemoglobin)).map(|a| a as f32);
        self.sample_at(u, v)
    }

    /// Factors of a linear Rec. 709 colour that skin has by itself when its hemoglobin goes from one volume fraction to
    /// another: the ratio of the look-up's colours, at most [`MOST_CHANGE`] up or down; exactly 1 where nothing changes.
    pub fn change(&self, melanin: f32, from_hemoglobin: f32, to_hemoglobin: f32) -> [f32; 3] {
        let (from, to) = (self.sample(melanin, from_hemoglobin), self.sample(melanin, to_hemoglobin));
        [0, 1, 2].map(|c| {
            let floor = |v: f32| v.max(0.0) + CHANGE_FLOOR;
            (floor(to[c]) / floor(from[c])).clamp(1.0 / MOST_CHANGE, MOST_CHANGE)
        })
    }

    /// Linear Rec. 709 albedo of skin that has a colour by itself, after a change of blood: at most 1.
    pub fn with_blood(
        &self,
        own_linear: [f32; 3],
        melanin: f32,
        from_hemoglobin: f32,
        to_hemoglobin: f32,
    ) -> [f32; 3] {
        let change = self.change(melanin, from_hemoglobin, to_hemoglobin);
        [0, 1, 2].map(|c| (own_linear[c] * change[c]).min(own_linear[c].max(1.0)))
    }

    /// Bilinear sample at an address, 0..1; a value that is not a number counts as 0.
    pub fn sample_at(&self, u: f32, v: f32) -> [f32; 3] {
        let place = |a: f32, n: u32| {
            let x = if a > 0.0 { a.min(1.0) } else { 0.0 } * (n - 1) as f32;
            let i = (x as u32).min(n - 2);
            (i as usize, x - i as f32)
        };
        let ((x, fx), (y, fy)) = (place(u, self.width), place(v, self.height));
        let at = |x: usize, y: usize| self.texels[y * self.width as usize + x];
        let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
        [0, 1, 2].map(|i| {
            let top = a[i] + fx * (b[i] - a[i]);
            top + fy * (c[i] + fx * (d[i] - c[i]) - top)
        })
    }
}

#[cfg(test)]
mod tests;
