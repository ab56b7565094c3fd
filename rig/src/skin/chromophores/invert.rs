//! From a skin colour back to melanin and hemoglobin.
//!
//! The look-up is a surface in CIELAB; a colour is projected on it by damped Gauss-Newton steps from the nearest of a
//! coarse set of texels. A colour on the surface is found exactly; for any other the residual is its distance.

use super::{SkinLookup, fractions_at};
use crate::color::{ciede2000, lab_from_rec709};

/// The chromophores that come closest to a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChromophoreFit {
    /// Melanin volume fraction of the epidermis, 0 to 0.5.
    pub melanin: f32,
    /// Hemoglobin volume fraction of the dermis, 0 to 0.32.
    pub hemoglobin: f32,
    /// CIEDE2000 difference between the colour and that of these fractions.
    pub residual: f32,
}

/// Coarse texels per axis from which a search may start.
const STARTS: u32 = 17;

/// Inverse of a [`SkinLookup`].
#[derive(Clone, Debug)]
pub struct SkinInverse<'a> {
    lookup: &'a SkinLookup,
    starts: Vec<([f32; 2], [f64; 3])>,
}

impl<'a> SkinInverse<'a> {
    /// Prepares the starting points.
    pub fn new(lookup: &'a SkinLookup) -> Self {
        let mut starts = Vec::with_capacity((STARTS * STARTS) as usize);
        for j in 0..STARTS {
            for i in 0..STARTS {
                let address = [i, j].map(|k| k as f32 / (STARTS - 1) as f32);
                starts.push((address, lab_at(lookup, address)));
            }
        }
        Self { lookup, starts }
    }

    /// Fractions whose colour is nearest (in CIELAB) to a linear Rec. 709 colour of finite components.
    pub fn fit(&self, rgb_linear: [f32; 3]) -> ChromophoreFit {
        let target = lab_from_rec709(rgb_linear.map(f64::from));
        let distance2 = |lab: [f64; 3]| (0..3).map(|i| (lab[i] - target[i]).powi(2)).sum::<f64>();
        let mut best = ([0.0f32; 2], f64::INFINITY);
        for (address, lab) in &self.starts {
            let d = distance2(*lab);
            if d < best.1 {
                best = (*address, d);
            }
        }
        let (mut at, mut error) = best;
        let mut damping = 1e-3;
        let pitch = 1.0 / (self.lookup.width.max(self.lookup.height) - 1) as f32;
        for _ in 0..24 {
            // Differences over a texel: the look-up is bilinear, so a smaller step would see one cell only.
            let lab = lab_at(self.lookup, at);
            let mut normal = [0.0; 3];
            let mut gradient = [0.0; 2];
            let derivative = |axis: usize| {
                let (mut low, mut high) = (at, at);
                low[axis] = (at[axis] - 0.5 * pitch).max(0.0);
                high[axis] = (at[axis] + 0.5 * pitch).min(1.0);
                let width = f64::from(high[axis] - low[axis]);
                let (a, b) = (lab_at(self.lookup, low), lab_at(self.lookup, high));
                [0, 1, 2].map(|i| (b[i] - a[i]) / width)
            };
            let (du, dv) = (derivative(0), derivative(1));
            for i in 0..3 {
                let r = target[i] - lab[i];
                normal[0] += du[i] * du[i];
                normal[1] += du[i] * dv[i];
                normal[2] += dv[i] * dv[i];
                gradient[0] += du[i] * r;
                gradient[1] += dv[i] * r;
            }
            let mut improved = false;
            for _ in 0..6 {
                // Levenberg's damping keeps the step finite where very dark skin hides its blood.
                let (a, c) = (normal[0] * (1.0 + damping) + 1e-9, normal[2] * (1.0 + damping) + 1e-9);
                let det = a * c - normal[1] * normal[1];
                let step = [
                    (c * gradient[0] - normal[1] * gradient[1]) / det,
                    (a * gradient[1] - normal[1] * gradient[0]) / det,
                ];
                let next = [0, 1].map(|i| (at[i] + step[i] as f32).clamp(0.0, 1.0));
                let next_error = distance2(lab_at(self.lookup, next));
                if next_error < error {
                    improved = error - next_error > 1e-6;
                    (at, error) = (next, next_error);
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping = (damping * 8.0).min(1e6);
            }
            if !improved || error < 1e-8 {
                break;
            }
        }
        let [melanin, hemoglobin] = fractions_at(f64::from(at[0]), f64::from(at[1])).map(|f| f as f32);
        let residual = ciede2000(lab_at(self.lookup, at), target) as f32;
        ChromophoreFit { melanin, hemoglobin, residual }
    }

    /// The melanin whose colour is nearest (in CIELAB) when the hemoglobin is known: for hair, make-up and shadow,
    /// whose grey would otherwise be taken for blood.
    pub fn fit_melanin(&self, rgb_linear: [f32; 3], hemoglobin: f32) -> ChromophoreFit {
        let target = lab_from_rec709(rgb_linear.map(f64::from));
        let v = super::lookup_address(0.0, f64::from(hemoglobin))[1] as f32;
        let distance2 = |u: f32| {
            let lab = lab_at(self.lookup, [u, v]);
            (0..3).map(|i| (lab[i] - target[i]).powi(2)).sum::<f64>()
        };
        let steps = 32;
        let coarse = |i: u32| i as f32 / steps as f32;
        let best =
            (0..=steps).min_by(|a, b| distance2(coarse(*a)).total_cmp(&distance2(coarse(*b)))).unwrap_or(0);
        // Lightness falls with melanin, so the distance has one minimum.
        let (mut low, mut high) = (coarse(best.saturating_sub(1)), coarse((best + 1).min(steps)));
        for _ in 0..20 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance2(a) < distance2(b) {
                high = b;
            } else {
                low = a;
            }
        }
        let u = 0.5 * (low + high);
        let residual = ciede2000(lab_at(self.lookup, [u, v]), target) as f32;
        ChromophoreFit { melanin: fractions_at(f64::from(u), 0.0)[0] as f32, hemoglobin, residual }
    }
}

fn lab_at(lookup: &SkinLookup, address: [f32; 2]) -> [f64; 3] {
    lab_from_rec709(lookup.sample_at(address[0], address[1]).map(f64::from))
}
