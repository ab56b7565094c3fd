//! Which texels of a map carry data, with averages and hole filling that use only those.

use rayon::prelude::*;

use crate::map::Map;

/// The mapped texels of a map: those that a surface uses or a camera saw.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` flags, row by row.
    pub mapped: Vec<bool>,
}

impl Mask {
    /// Every texel is mapped.
    pub fn full(width: u32, height: u32) -> Self {
        Self { width, height, mapped: vec![true; width as usize * height as usize] }
    }

    /// Texels where a channel of a map is above a threshold.
    pub fn above(map: &Map, channel: u32, threshold: f32) -> Self {
        let mapped = map
            .values
            .iter()
            .skip(channel as usize)
            .step_by(map.channels as usize)
            .map(|v| *v > threshold)
            .collect();
        Self { width: map.width, height: map.height, mapped }
    }

    /// Number of mapped texels.
    pub fn count(&self) -> usize {
        self.mapped.iter().filter(|m| **m).count()
    }

    /// Texels mapped in both; the sizes must agree.
    ///
    /// # Panics
    /// The sizes differ.
    pub fn and(&self, other: &Mask) -> Mask {
        assert_eq!((self.width, self.height), (other.width, other.height), "masks of one size");
        let mapped = self.mapped.iter().zip(&other.mapped).map(|(a, b)| *a && *b).collect();
        Mask { mapped, ..*self }
    }
}

/// Area average of the mapped texels under each texel of a `width` by `height` map, and where there was any.
///
/// Works in both directions; enlarging repeats texels. Texels without data are 0 and unmapped.
pub fn resize_area(map: &Map, mask: &Mask, width: u32, height: u32) -> (Map, Mask) {
    // One axis: for each output texel the input range and its coverage at the ends.
    let spans = |from: u32, to: u32| -> Vec<Vec<(usize, f64)>> {
        let ratio = f64::from(from) / f64::from(to);
        (0..to)
            .map(|i| {
                let (a, b) = (f64::from(i) * ratio, f64::from(i + 1) * ratio);
                let (first, last) = (a.floor() as u32, (b.ceil() as u32).min(from));
                (first..last)
                    .map(|k| (k as usize, b.min(f64::from(k + 1)) - a.max(f64::from(k))))
                    .filter(|(_, w)| *w > 1e-9)
                    .collect()
            })
            .collect()
    };
    let (xs, ys) = (spans(map.width, width), spans(map.height, height));
    let channels = map.channels as usize;
    let count = width as usize * height as usize;
    let mut out = Map { width, height, channels: map.channels, values: vec![0.0; count * channels] };
    let mut mapped = vec![false; count];
    let row = |rows: &[(usize, f64)], out: &mut [f32], mapped: &mut [bool]| {
        let mut sums = vec![0.0f64; channels];
        for ((columns, out), mapped) in xs.iter().zip(out.chunks_exact_mut(channels)).zip(mapped) {
            sums.fill(0.0);
            let mut weight = 0.0;
            for (y, wy) in rows {
                for (x, wx) in columns {
                    let i = y * map.width as usize + x;
                    if mask.mapped[i] {
                        weight += wx * wy;
                        for (s, v) in sums.iter_mut().zip(&map.values[i * channels..]) {
                            *s += wx * wy * f64::from(*v);
                        }
                    }
                }
            }
            *mapped = weight > 0.0;
            if *mapped {
                for (o, s) in out.iter_mut().zip(&sums) {
                    *o = (s / weight) as f32;
                }
            }
        }
    };
    ys.par_iter()
        .zip(out.values.par_chunks_exact_mut(width as usize * channels))
        .zip(mapped.par_chunks_exact_mut(width as usize))
        .for_each(|((rows, out), mapped)| row(rows, out, mapped));
    (out, Mask { width, height, mapped })
}

/// Gives unmapped texels smooth values from the mapped ones around them, so that filtering across a texture seam reads
/// skin instead of background; mapped texels stay as they are.
///
/// Push and pull (Gortler et al. 1996): holes take the average of the nearest coarser level that has data. A map
/// without any mapped texel becomes 0.
pub fn fill_unmapped(map: &mut Map, mask: &Mask) {
    if mask.mapped.iter().all(|m| *m) {
        return;
    }
    if map.width == 1 && map.height == 1 {
        map.values.fill(0.0);
        return;
    }
    let (mut coarse, coarse_mask) = resize_area(map, mask, map.width.div_ceil(2), map.height.div_ceil(2));
    fill_unmapped(&mut coarse, &coarse_mask);
    let channels = map.channels as usize;
    for y in 0..map.height {
        for x in 0..map.width {
            let i = y as usize * map.width as usize + x as usize;
            if !mask.mapped[i] {
                let u = (x as f32 + 0.5) / map.width as f32;
                let v = (y as f32 + 0.5) / map.height as f32;
                for c in 0..channels {
                    map.values[i * channels + c] = coarse.sample(u, v, c as u32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averages_and_filling_ignore_unmapped_texels() {
        // Left half is skin of 0.5, the right half is background garbage.
        let (w, h) = (27, 51);
        let mapped: Vec<bool> = (0..w * h).map(|i| i % w < 13).collect();
        let values = mapped.iter().map(|m| if *m { 0.5 } else { f32::NAN }).collect();
        let mask = Mask { width: w, height: h, mapped };
        let mut map = Map { width: w, height: h, channels: 1, values };
        let (small, small_mask) = resize_area(&map, &mask, 8, 8);
        for (v, m) in small.values.iter().zip(&small_mask.mapped) {
            assert!(if *m { (*v - 0.5).abs() < 1e-7 } else { *v == 0.0 }, "{v}");
        }
        assert_eq!(small_mask.mapped[..8], [true, true, true, true, false, false, false, false]);
        fill_unmapped(&mut map, &mask);
        assert!(map.values.iter().all(|v| (*v - 0.5).abs() < 1e-6));
    }

    #[test]
    fn the_average_of_a_map_survives_resizing() {
        let values: Vec<f32> = (0..35).map(|i| ((i * 7919) % 97) as f32).collect();
        let mean = values.iter().sum::<f32>() / 35.0;
        let map = Map { width: 7, height: 5, channels: 1, values };
        for (w, h) in [(1, 1), (3, 2), (14, 10)] {
            let (out, _) = resize_area(&map, &Mask::full(7, 5), w, h);
            let found = out.values.iter().sum::<f32>() / (w * h) as f32;
            assert!((found - mean).abs() < 1e-3, "{w}x{h}: {found} {mean}");
        }
    }

    #[test]
    fn a_map_without_data_is_filled_with_zero() {
        let mut map = Map::filled(3, 3, &[7.0, 8.0]);
        fill_unmapped(&mut map, &Mask { width: 3, height: 3, mapped: vec![false; 9] });
        assert!(map.values.iter().all(|v| *v == 0.0));
    }
}
