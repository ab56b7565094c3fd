//! Mean and standard deviation in a disk around every texel (Jimenez 2012 eq. 7.1), exactly.
//!
//! ```text
//! f32 values --fixed point, 25 bits--> prefix sums of (q, count) packed and of q^2 (u64, wrapping), along rows and columns
//!            --disk = square + 2 caps of rows + 2 caps of columns--> sums of the window --integers--> mean, sigma
//! ```
//!
//! The disk is `|u| <= r` on texel centres. Texels outside the mask and everything beyond the border take no
//! part. Sums are integers, so they do not depend on the order, and the sum of squares about an integer near the mean
//! has no cancellation: sigma is right to the fixed point even where it is 10^-4 of the mean, and 0 where the window is constant.
//!
//! The largest square inside the disk slides down with its block, one row in and one out; only the caps around it
//! are summed row by row (above and below) and column by column (at the sides), two reads each: 0.6 of the reads of
//! summing all rows of the disk.
//!
//! Rows are worked on in bands, columns in blocks that fit the second-level cache: 32 bytes per texel of one band and
//! block per thread.

use rayon::prelude::*;

use super::HemoglobinError;
use crate::map::Map;
use crate::mask::Mask;

/// Local statistics of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalStatistics {
    /// `mu`: mean of the mapped texels in the disk, 1 channel.
    pub mean: Map,
    /// `sigma`: their standard deviation (of the population), 1 channel.
    pub deviation: Map,
    /// Texels whose disk holds at least one mapped texel; the others have mean and deviation 0.
    pub covered: Mask,
}

/// Largest radius of a disk, texels: beyond it 64-bit sums would cost precision.
pub const MAX_RADIUS_PX: u32 = 1024;

/// Rows of output that a band computes at once. Band and block were tuned at r = 64 on 2 MB of second-level cache.
const BAND: usize = 128;
/// Columns of output in a block.
const BLOCK: usize = 256;
/// Columns summed in registers.
const LANES: usize = 16;

/// Half width of the row of a disk at a distance from its middle: `floor(sqrt(r^2 - dy^2))`.
fn half_width(radius: usize, dy: usize) -> usize {
    (radius * radius - dy * dy).isqrt()
}

/// Mean and deviation in the disk of `radius_px` texels around each texel of a 1-channel map.
///
/// # Errors
/// A map of several channels, a mask of another size, a radius of 0 or beyond the larger side, or a mapped value that
/// is not finite.
pub fn local_statistics(map: &Map, mask: &Mask, radius_px: u32) -> Result<LocalStatistics, HemoglobinError> {
    super::check_map("map", map, mask)?;
    let (width, height) = (map.width as usize, map.height as usize);
    let largest = map.width.max(map.height).min(MAX_RADIUS_PX);
    if radius_px == 0 || radius_px > largest {
        return Err(HemoglobinError {
            at: "radius".into(),
            found: format!("{radius_px} texels"),
            expected: format!("1 to {largest} (at most the larger side of the map and {MAX_RADIUS_PX})"),
        });
    }
    let radius = radius_px as usize;
    // Half side of the largest square inside the disk; rows and columns outside the square are no longer than its side.
    let square = (radius * radius / 2).isqrt();
    let caps: Vec<(usize, usize)> = (square + 1..=radius).map(|d| (d, half_width(radius, d))).collect();
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (v, m) in map.values.iter().zip(&mask.mapped) {
        if *m {
            (low, high) = (low.min(*v), high.max(*v));
        }
    }
    // A window's sum of squares must fit 64 bits, and so must its sum beside its count: 25 bits per value up to a
    // radius of 72 texels, 20 at the largest.
    let side = 2 * square as u64 + 1;
    let window = side * side + caps.iter().map(|(_, w)| 4 * (2 * *w as u64 + 1)).sum::<u64>();
    let window_bits = u64::BITS - window.leading_zeros();
    let bits = ((64 - window_bits) / 2).min(64 - 2 * window_bits);
    let levels = ((1u64 << bits) - 1) as f64;
    let range = (f64::from(high) - f64::from(low)).max(0.0);
    // No mapped texel, or all equal: any step represents them.
    let to_fixed = if range > 0.0 { levels / range } else { 0.0 };
    let step = range / levels;

    let mut mean =
        Map { width: map.width, height: map.height, channels: 1, values: vec![0.0; width * height] };
    let mut deviation = mean.clone();
    let mut covered = Mask { width: map.width, height: map.height, mapped: vec![false; width * height] };
    let window = Window {
        map,
        mask,
        caps: &caps,
        square,
        radius,
        low: f64::from(low),
        to_fixed,
        step,
        count_shift: 64 - window_bits,
    };
    mean.values
        .par_chunks_mut(BAND * width)
        .zip(deviation.values.par_chunks_mut(BAND * width))
        .zip(covered.mapped.par_chunks_mut(BAND * width))
        .enumerate()
        .for_each(|(band, ((mean, deviation), covered))| {
            let mut left = 0;
            while left < width {
                let columns = BLOCK.min(width - left);
                window.block(band * BAND, left, columns, mean, deviation, covered);
                left += columns;
            }
        });
    Ok(LocalStatistics { mean, deviation, covered })
}

struct Window<'a> {
    map: &'a Map,
    mask: &'a Mask,
    /// Distance from the middle and half width of each row (or column) of a cap, outwards.
    caps: &'a [(usize, usize)],
    /// Half side of the square.
    square: usize,
    radius: usize,
    low: f64,
    to_fixed: f64,
    step: f64,
    /// The count stands above the sum in packed sums, from this bit.
    count_shift: u32,
}

/// Prefix sums of one quantity in a block with its surroundings.
struct Prefix {
    /// Entry (i, j): sum of row i over the columns before `left - radius + j`.
    along_rows: Vec<u64>,
    /// Entry (i, j): sum of column `left - radius + j` over the rows before i; one row more than the block has.
    along_columns: Vec<u64>,
    /// Entries in a row.
    pitch: usize,
}

impl Window<'_> {
    /// Statistics of `columns` texels from `left` of the rows that the output slices hold, from row `top`.
    fn block(
        &self,
        top: usize,
        left: usize,
        columns: usize,
        mean: &mut [f32],
        deviation: &mut [f32],
        covered: &mut [bool],
    ) {
        let (width, height) = (self.map.width as usize, self.map.height as usize);
        let rows = mean.len() / width;
        let first_row = top.saturating_sub(self.radius);
        let last_row = (top + rows + self.radius).min(height);
        let count = last_row - first_row;
        let [sums, squares] = self.prefixes(first_row, count, left, columns);
        let lanes = columns.next_multiple_of(LANES);
        let (mut square_sums, mut square_squares) = (vec![0u64; lanes], vec![0u64; lanes]);
        // Rows of the square about the row before the first: one enters and one leaves at each step.
        for y in first_row.max(top.saturating_sub(self.square + 1))..(top + self.square).min(last_row) {
            self.slide(&sums, &mut square_sums, y - first_row, u64::wrapping_add);
            self.slide(&squares, &mut square_squares, y - first_row, u64::wrapping_add);
        }
        let mut inverse = (0, 0.0);
        for row in 0..rows {
            let y = top + row;
            if y + self.square < last_row {
                let entering = y + self.square - first_row;
                self.slide(&sums, &mut square_sums, entering, u64::wrapping_add);
                self.slide(&squares, &mut square_squares, entering, u64::wrapping_add);
            }
            if y > self.square {
                let leaving = y - self.square - 1 - first_row;
                self.slide(&sums, &mut square_sums, leaving, u64::wrapping_sub);
                self.slide(&squares, &mut square_squares, leaving, u64::wrapping_sub);
            }
            let middle = y - first_row;
            for x in (0..columns).step_by(LANES) {
                let sum = self.disk(&sums, &square_sums, middle, count, x);
                let square = self.disk(&squares, &square_squares, middle, count, x);
                for lane in 0..LANES.min(columns - x) {
                    let n = sum[lane] >> self.count_shift;
                    if n > 0 {
                        let out = row * width + left + x + lane;
                        if n != inverse.0 {
                            inverse = (n, 1.0 / n as f64);
                        }
                        let total = sum[lane] & ((1 << self.count_shift) - 1);
                        let average = total as f64 * inverse.1;
                        // About an integer near the mean: sum (q - m)^2 is an integer, exact and small.
                        let m = average as u64;
                        let rest = (total as f64) - (n * m) as f64;
                        let about = (square[lane])
                            .wrapping_sub(m.wrapping_mul(2).wrapping_mul(total))
                            .wrapping_add(n.wrapping_mul(m.wrapping_mul(m)));
                        let variance = (about as f64 - rest * rest * inverse.1).max(0.0) * inverse.1;
                        mean[out] = (self.low + self.step * average) as f32;
                        deviation[out] = (self.step * variance.sqrt()) as f32;
                        covered[out] = true;
                    }
                }
            }
        }
    }

    /// Prefix sums of (q, count) and of q^2 for `count` rows from `first_row` and the columns about a block.
    fn prefixes(&self, first_row: usize, count: usize, left: usize, columns: usize) -> [Prefix; 2] {
        let width = self.map.width as usize;
        // Rounded up so that the last lanes read inside.
        let pitch = columns.next_multiple_of(LANES) + 2 * self.radius + 1;
        let new = || Prefix {
            along_rows: vec![0; count * pitch],
            along_columns: vec![0; (count + 1) * pitch],
            pitch,
        };
        let (mut sums, mut squares) = (new(), new());
        for i in 0..count {
            let texels = (first_row + i) * width..(first_row + i + 1) * width;
            let (values, mapped) = (&self.map.values[texels.clone()], &self.mask.mapped[texels]);
            let (mut sum, mut square) = (0u64, 0u64);
            let row = i * pitch..(i + 1) * pitch;
            let (rows1, rows2) = (&mut sums.along_rows[row.clone()], &mut squares.along_rows[row]);
            let below = (i + 1) * pitch;
            let (above1, below1) = sums.along_columns.split_at_mut(below);
            let (above2, below2) = squares.along_columns.split_at_mut(below);
            let (above1, above2) = (&above1[i * pitch..], &above2[i * pitch..]);
            for j in 0..pitch {
                (rows1[j], rows2[j]) = (sum, square);
                let x = (left + j).wrapping_sub(self.radius);
                let (mut packed, mut squared) = (0, 0);
                if x < width && mapped[x] {
                    let q = ((f64::from(values[x]) - self.low) * self.to_fixed + 0.5) as u64;
                    (packed, squared) = (q + (1 << self.count_shift), q * q);
                }
                (sum, square) = (sum.wrapping_add(packed), square.wrapping_add(squared));
                below1[j] = above1[j].wrapping_add(packed);
                below2[j] = above2[j].wrapping_add(squared);
            }
        }
        [sums, squares]
    }

    /// Adds or takes away the part of a row that the square covers, for every column of the block.
    fn slide(&self, prefix: &Prefix, sums: &mut [u64], row: usize, step: fn(u64, u64) -> u64) {
        let row = &prefix.along_rows[row * prefix.pitch..(row + 1) * prefix.pitch];
        let before = &row[self.radius - self.square..];
        let after = &row[self.radius + self.square + 1..];
        for ((sum, before), after) in sums.iter_mut().zip(before).zip(after) {
            *sum = step(*sum, after.wrapping_sub(*before));
        }
    }

    /// Sums over the disk about row `middle` of `rows` for the texels `x..x + LANES`, from those of the square.
    /// A window's sum is right even where a prefix wrapped.
    fn disk(&self, prefix: &Prefix, square: &[u64], middle: usize, rows: usize, x: usize) -> [u64; LANES] {
        let pitch = prefix.pitch;
        let mut total: [u64; LANES] = *square[x..].first_chunk().expect("whole lanes");
        let center = x + self.radius;
        for (distance, half) in self.caps {
            let length = 2 * half + 1;
            if *distance <= middle {
                let row = (middle - distance) * pitch;
                total = plus(total, &prefix.along_rows[row + center - half..], length);
            }
            if middle + distance < rows {
                let row = (middle + distance) * pitch;
                total = plus(total, &prefix.along_rows[row + center - half..], length);
            }
            let above = middle.saturating_sub(*half);
            let gap = ((middle + half + 1).min(rows) - above) * pitch;
            let column = &prefix.along_columns[above * pitch + center - distance..];
            total = plus(total, column, gap);
            total = plus(total, &column[2 * distance..], gap);
        }
        total
    }
}

/// Adds, for each lane, the increase of a prefix over `gap` entries. By value, so that the sums stay in registers.
#[inline(always)]
fn plus(mut total: [u64; LANES], prefix: &[u64], gap: usize) -> [u64; LANES] {
    let before: &[u64; LANES] = prefix.first_chunk().expect("padded rows");
    let after: &[u64; LANES] = prefix[gap..].first_chunk().expect("padded rows");
    for lane in 0..LANES {
        total[lane] = total[lane].wrapping_add(after[lane].wrapping_sub(before[lane]));
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    /// Values that look random, 0..1.
    fn noise(i: usize) -> f64 {
        random::unit(random::mixed(i as u64 ^ 0x5555))
    }

    /// Equation 7.1 directly, in f64, with the mean subtracted first.
    fn direct(map: &Map, mask: &Mask, radius: i64, x: i64, y: i64) -> Option<(f64, f64)> {
        let mut values = Vec::new();
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let (px, py) = (x + dx, y + dy);
                let inside = px >= 0 && py >= 0 && px < i64::from(map.width) && py < i64::from(map.height);
                if dx * dx + dy * dy <= radius * radius && inside {
                    let i = (py * i64::from(map.width) + px) as usize;
                    if mask.mapped[i] {
                        values.push(f64::from(map.values[i]));
                    }
                }
            }
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        (n > 0.0).then_some((mean, variance.sqrt()))
    }

    #[test]
    fn statistics_are_those_of_a_direct_sum_at_odd_sizes() {
        for (w, h, r) in [
            (27u32, 51u32, 5u32),
            (530, 9, 3),
            (8, 8, 8),
            (1, 1, 1),
            (5, 140, 2),
            (70, 150, 23),
            (200, 3, 40),
        ] {
            let n = (w * h) as usize;
            let mask = Mask { width: w, height: h, mapped: (0..n).map(|i| noise(i + 77) > 0.3).collect() };
            let values = (0..n)
                .map(|i| if mask.mapped[i] { 0.02 + 0.1 * noise(i) as f32 } else { f32::NAN })
                .collect();
            let map = Map { width: w, height: h, channels: 1, values };
            let found = local_statistics(&map, &mask, r).unwrap();
            for y in 0..h {
                for x in 0..w {
                    let i = (y * w + x) as usize;
                    match direct(&map, &mask, i64::from(r), i64::from(x), i64::from(y)) {
                        Some((mean, deviation)) => {
                            assert!((f64::from(found.mean.values[i]) - mean).abs() < 2e-8);
                            assert!((f64::from(found.deviation.values[i]) - deviation).abs() < 2e-8);
                            assert!(found.covered.mapped[i]);
                        }
                        None => assert!(!found.covered.mapped[i] && found.mean.values[i] == 0.0),
                    }
                }
            }
        }
    }

    #[test]
    fn a_deviation_of_a_ten_thousandth_of_the_mean_survives_a_wide_range() {
        // sigma = 1e-4 of the mean beside a spot that is sixteen times as high.
        let (w, h) = (96u32, 40u32);
        let values = (0..w * h)
            .map(
                |i| if i % w > 90 { 0.32 } else { 0.02 * (1.0 + 1e-4 * if i % 2 == 0 { 1.0 } else { -1.0 }) },
            )
            .collect();
        let map = Map { width: w, height: h, channels: 1, values };
        let found = local_statistics(&map, &Mask::full(w, h), 20).unwrap();
        let at = (20 * w + 40) as usize;
        let expected = direct(&map, &Mask::full(w, h), 20, 40, 20).unwrap().1;
        // Both values of the texture move by at most half a step of the 26 bits that this radius leaves.
        let bound = 0.5 * 0.3 / 2f64.powi(26) / expected;
        assert!((f64::from(found.deviation.values[at]) / expected - 1.0).abs() < bound);
        assert!(bound < 1.2e-3);
        assert!((expected / 2e-6 - 1.0).abs() < 1e-2);
    }

    #[test]
    fn a_constant_map_has_no_deviation() {
        let map = Map::filled(33, 17, &[0.123]);
        let found = local_statistics(&map, &Mask::full(33, 17), 6).unwrap();
        assert!(found.deviation.values.iter().all(|d| *d == 0.0));
        assert!(found.mean.values.iter().all(|m| *m == 0.123));
    }

    #[test]
    fn bad_input_is_named() {
        let map = Map::filled(4, 3, &[0.1]);
        let mask = Mask::full(4, 3);
        let message = |r: Result<LocalStatistics, HemoglobinError>| r.unwrap_err().to_string();
        assert!(message(local_statistics(&map, &mask, 0)).contains("radius: found 0 texels"));
        assert!(message(local_statistics(&map, &mask, 5)).contains("1 to 4"));
        assert!(message(local_statistics(&map, &Mask::full(3, 4), 1)).contains("3x4"));
        let mut bad = map.clone();
        bad.values[6] = f32::NAN;
        assert!(message(local_statistics(&bad, &mask, 1)).contains("texel (2, 1)"));
        assert!(message(local_statistics(&Map::filled(4, 3, &[0.1, 0.2]), &mask, 1)).contains("2 channels"));
    }
}
