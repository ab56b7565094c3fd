//! Local mean and deviation of a quantity on the surface (papers/004 eq. 7.1).
//!
//! The averaging disc of eq. 7.1 is laid on the skin, not on the texture: values are gathered in a coarse grid of
//! canonical space and smoothed there, so the statistics do not change at UV borders.

use glam::Vec3;

/// Edge of a grid cell, mm.
const CELL_MM: f32 = 3.0;
/// Box filters per axis; with the cell they give the variance of a disc of [`RADIUS_MM`].
const PASSES: usize = 2;
/// Radius of the disc that the smoothing stands for, mm: a disc has variance r^2/4 along each axis, the two boxes of
/// three cells and the trilinear splat and fetch together (2 * 2/3 + 2 * 1/4) cells^2.
pub(crate) const RADIUS_MM: f32 = 8.0;

/// Mean and standard deviation about each place.
pub(crate) struct LocalStatistics {
    origin: Vec3,
    size: [usize; 3],
    mean: Vec<f32>,
    deviation: Vec<f32>,
}

/// A value on the surface, with the area that it stands for.
#[derive(Clone, Copy)]
pub(crate) struct Sample {
    pub place: Vec3,
    pub area: f32,
    pub value: f32,
}

impl LocalStatistics {
    /// Statistics of samples (at least one of positive area).
    pub(crate) fn of(samples: &[Sample]) -> Self {
        let low = samples.iter().fold(Vec3::MAX, |l, s| l.min(s.place));
        let high = samples.iter().fold(Vec3::MIN, |h, s| h.max(s.place));
        let margin = (PASSES + 2) as f32 * CELL_MM;
        let origin = low - margin;
        let extent = ((high - low + 2.0 * margin) / CELL_MM).ceil();
        let size = [extent.x as usize + 1, extent.y as usize + 1, extent.z as usize + 1];
        let count = size[0] * size[1] * size[2];
        // Subtracting a constant first keeps E[x^2] - mu^2 from losing what is small.
        let total: f64 = samples.iter().map(|s| f64::from(s.area)).sum();
        let shift =
            (samples.iter().map(|s| f64::from(s.area * s.value)).sum::<f64>() / total.max(1e-30)) as f32;
        let mut sums = [vec![0.0f32; count], vec![0.0f32; count], vec![0.0f32; count]];
        for s in samples {
            let x = s.value - shift;
            corners((s.place - origin) / CELL_MM, size, |i, w| {
                let w = w * s.area;
                sums[0][i] += w;
                sums[1][i] += w * x;
                sums[2][i] += w * x * x;
            });
        }
        for sum in &mut sums {
            for _ in 0..PASSES {
                for axis in 0..3 {
                    box3(sum, size, axis);
                }
            }
        }
        let [weight, first, second] = sums;
        let (mut mean, mut deviation) = (vec![0.0; count], vec![0.0; count]);
        for i in 0..count {
            if weight[i] > 0.0 {
                let m = first[i] / weight[i];
                mean[i] = m + shift;
                deviation[i] = (second[i] / weight[i] - m * m).max(0.0).sqrt();
            }
        }
        // Cells off the surface have no weight; a fetch ignores them.
        for i in 0..count {
            if weight[i] <= 0.0 {
                mean[i] = f32::NAN;
            }
        }
        Self { origin, size, mean, deviation }
    }

    /// Mean and standard deviation about a place near the samples.
    pub(crate) fn at(&self, place: Vec3) -> (f32, f32) {
        let (mut mean, mut deviation, mut total) = (0.0, 0.0, 0.0);
        corners((place - self.origin) / CELL_MM, self.size, |i, w| {
            if !self.mean[i].is_nan() {
                mean += w * self.mean[i];
                deviation += w * self.deviation[i];
                total += w;
            }
        });
        if total > 0.0 { (mean / total, deviation / total) } else { (0.0, 0.0) }
    }
}

/// The eight grid points about a position in cells, with trilinear weights.
fn corners(p: Vec3, size: [usize; 3], mut visit: impl FnMut(usize, f32)) {
    let p = p.clamp(Vec3::ZERO, Vec3::new(size[0] as f32, size[1] as f32, size[2] as f32) - 1.001);
    let base = p.floor();
    let f = p - base;
    let (x, y, z) = (base.x as usize, base.y as usize, base.z as usize);
    for corner in 0..8 {
        let (i, j, k) = (corner & 1, (corner >> 1) & 1, corner >> 2);
        let pick = |bit: usize, t: f32| if bit == 1 { t } else { 1.0 - t };
        let w = pick(i, f.x) * pick(j, f.y) * pick(k, f.z);
        visit(((z + k) * size[1] + y + j) * size[0] + x + i, w);
    }
}

/// Sum of three neighbours along an axis; beyond the grid there is nothing.
fn box3(values: &mut [f32], size: [usize; 3], axis: usize) {
    let stride = [1, size[0], size[0] * size[1]][axis];
    let length = size[axis];
    let lines = values.len() / length;
    for line in 0..lines {
        let start = match axis {
            0 => line * size[0],
            1 => (line / size[0]) * size[0] * size[1] + line % size[0],
            _ => line,
        };
        let mut before = 0.0;
        for i in 0..length {
            let at = start + i * stride;
            let here = values[at];
            let after = if i + 1 < length { values[at + stride] } else { 0.0 };
            values[at] = before + here + after;
            before = here;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::Stream;
    use super::*;

    #[test]
    fn a_gaussian_field_gives_back_its_mean_and_deviation() {
        let mut stream = Stream::new(1);
        let samples: Vec<Sample> = (0..160 * 160)
            .map(|i| {
                let (x, y) = ((i % 160) as f32 * 0.5, (i / 160) as f32 * 0.5);
                // Tiny deviation on a large mean: the case where E[x^2] - mu^2 fails in f32.
                Sample { place: Vec3::new(x, y, 20.0), area: 0.25, value: 10.0 + 0.001 * stream.normal() }
            })
            .collect();
        let local = LocalStatistics::of(&samples);
        let (mean, deviation) = local.at(Vec3::new(40.0, 40.0, 20.0));
        assert!((mean - 10.0).abs() < 2e-4, "{mean}");
        assert!((deviation / 0.001 - 1.0).abs() < 0.1, "{deviation}");
    }

    #[test]
    fn the_smoothing_has_the_variance_of_its_disc() {
        // The mean of x^2 about 0 over the kernel is its variance along x.
        let samples: Vec<Sample> = (0..200 * 200)
            .map(|i| {
                let (x, y) = ((i % 200) as f32 * 0.5 - 50.0, (i / 200) as f32 * 0.5 - 50.0);
                Sample { place: Vec3::new(x, y, 0.0), area: 1.0, value: x * x }
            })
            .collect();
        let variance = LocalStatistics::of(&samples).at(Vec3::ZERO).0;
        let disc = RADIUS_MM * RADIUS_MM / 4.0;
        assert!((variance / disc - 1.0).abs() < 0.15, "{variance} is not {disc}");
    }
}
