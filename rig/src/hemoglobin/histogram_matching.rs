//! Exact local histogram matching: the mapping that scale and bias approximate by Gaussians (Jimenez 2012 section 7.4).
//!
//! For every texel the cumulative histograms of the neutral and of the target map in its disk are updated by sliding:
//! a step along a row adds one edge of the disk and removes the other. Values have 16 bits; the inverse of a tie
//! is its own level, so matching a map with itself changes nothing. Slow on purpose: it is the oracle.

use rayon::prelude::*;

use super::{HemoglobinError, check_map};
use crate::map::Map;
use crate::mask::Mask;

const LEVELS: usize = 1 << 16;
const GROUP: usize = 1 << 8;

/// A histogram of 16-bit levels with coarse counts of 256 levels each.
struct Histogram {
    fine: Vec<u32>,
    coarse: Vec<u32>,
    total: u32,
}

impl Histogram {
    fn new() -> Self {
        Self { fine: vec![0; LEVELS], coarse: vec![0; LEVELS / GROUP], total: 0 }
    }

    fn add(&mut self, level: u16) {
        self.fine[level as usize] += 1;
        self.coarse[level as usize / GROUP] += 1;
        self.total += 1;
    }

    fn remove(&mut self, level: u16) {
        self.fine[level as usize] -= 1;
        self.coarse[level as usize / GROUP] -= 1;
        self.total -= 1;
    }

    fn clear(&mut self) {
        self.fine.fill(0);
        self.coarse.fill(0);
        self.total = 0;
    }

    /// Share of the window below a level, ties counted half: 0..1.
    fn quantile_of(&self, level: u16) -> f64 {
        let group = level as usize / GROUP;
        let below: u32 = self.coarse[..group].iter().sum::<u32>()
            + self.fine[group * GROUP..level as usize].iter().sum::<u32>();
        (f64::from(below) + 0.5 * f64::from(self.fine[level as usize])) / f64::from(self.total)
    }

    /// Level at which the cumulative count exceeds a share of the window.
    fn level_at(&self, quantile: f64) -> u16 {
        let rank = quantile * f64::from(self.total);
        let mut below = 0u32;
        let mut group = 0;
        while group + 1 < self.coarse.len() && f64::from(below + self.coarse[group]) < rank {
            below += self.coarse[group];
            group += 1;
        }
        let mut level = group * GROUP;
        while level + 1 < LEVELS && f64::from(below + self.fine[level]) < rank {
            below += self.fine[level];
            level += 1;
        }
        level as u16
    }
}

/// Matches the neutral map to the target in the disk of `radius_px` around each texel.
///
/// Texels outside either mask keep the neutral value. Both maps have the same size.
///
/// # Errors
/// Maps of different sizes, with more than 1 channel or with a mapped value that is not finite; a radius of 0.
pub fn match_locally(
    neutral: &Map,
    target: &Map,
    mask: &Mask,
    radius_px: u32,
) -> Result<Map, HemoglobinError> {
    check_map("neutral map", neutral, mask)?;
    check_map("target map", target, mask)?;
    if radius_px == 0 {
        let (at, found) = ("radius".into(), "0 texels".into());
        return Err(HemoglobinError { at, found, expected: "at least 1".into() });
    }
    let (width, height) = (neutral.width as usize, neutral.height as usize);
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (i, m) in mask.mapped.iter().enumerate() {
        if *m {
            low = low.min(neutral.values[i]).min(target.values[i]);
            high = high.max(neutral.values[i]).max(target.values[i]);
        }
    }
    let step = ((high - low) / (LEVELS - 1) as f32).max(f32::MIN_POSITIVE);
    let levels = |map: &Map| -> Vec<u16> {
        map.values.iter().map(|v| ((v - low) / step + 0.5).clamp(0.0, (LEVELS - 1) as f32) as u16).collect()
    };
    let (from, to) = (levels(neutral), levels(target));
    let r = radius_px as i64;
    let half: Vec<i64> = (-r..=r).map(|dy| ((r * r - dy * dy) as u64).isqrt() as i64).collect();

    let mut out = neutral.clone();
    out.values.par_chunks_mut(width).enumerate().for_each_init(
        || (Histogram::new(), Histogram::new()),
        |(a, b), (y, row)| {
            a.clear();
            b.clear();
            let rows: Vec<(usize, i64)> = (-r..=r)
                .zip(&half)
                .map(|(dy, w)| (y as i64 + dy, *w))
                .filter(|(py, _)| (0..height as i64).contains(py))
                .map(|(py, w)| (py as usize * width, w))
                .collect();
            let mapped = |base: usize, x: i64| {
                (0..width as i64).contains(&x).then(|| base + x as usize).filter(|i| mask.mapped[*i])
            };
            for (base, w) in &rows {
                for i in (-1 - w..*w).filter_map(|x| mapped(*base, x)) {
                    a.add(from[i]);
                    b.add(to[i]);
                }
            }
            for (x, value) in row.iter_mut().enumerate() {
                for (base, w) in &rows {
                    if let Some(i) = mapped(*base, x as i64 - 1 - w) {
                        a.remove(from[i]);
                        b.remove(to[i]);
                    }
                    if let Some(i) = mapped(*base, x as i64 + w) {
                        a.add(from[i]);
                        b.add(to[i]);
                    }
                }
                let here = y * width + x;
                if mask.mapped[here] {
                    *value = low + step * f32::from(b.level_at(a.quantile_of(from[here])));
                }
            }
        },
    );
    Ok(out)
}

/// How far one map is from another over some texels, in the maps' unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct MapDifference {
    /// Texels compared.
    pub texels: usize,
    /// Mean of the reference.
    pub reference_mean: f64,
    /// Mean of the absolute difference.
    pub mean_absolute: f64,
    /// Root mean square difference.
    pub rms: f64,
    /// 99th percentile of the absolute difference.
    pub percentile_99: f64,
    /// Largest absolute difference.
    pub max: f64,
}

/// Difference of `found` from `reference` over the texels of a region.
pub fn map_difference(reference: &Map, found: &Map, region: &Mask) -> MapDifference {
    let mut errors = Vec::new();
    let (mut sum, mut square, mut mean) = (0.0, 0.0, 0.0);
    for ((r, f), _) in reference.values.iter().zip(&found.values).zip(&region.mapped).filter(|(_, m)| **m) {
        let e = (f64::from(*f) - f64::from(*r)).abs();
        (sum, square, mean) = (sum + e, square + e * e, mean + f64::from(*r));
        errors.push(e);
    }
    if errors.is_empty() {
        return MapDifference::default();
    }
    let n = errors.len() as f64;
    errors.sort_by(f64::total_cmp);
    MapDifference {
        texels: errors.len(),
        reference_mean: mean / n,
        mean_absolute: sum / n,
        rms: (square / n).sqrt(),
        percentile_99: errors[((errors.len() - 1) as f64 * 0.99) as usize],
        max: errors[errors.len() - 1],
    }
}
