//! The blur of a map in f64, from its definition.

use super::plan::{TAP_STEP, taps};

/// An image of premultiplied light; a = 1 where light is known.
#[derive(Clone, Debug)]
pub(super) struct Texels {
    pub(super) size: [usize; 2],
    pub(super) values: Vec<[f64; 4]>,
}

impl Texels {
    /// Bilinear between texels, repeated beyond the border; a place in texels.
    pub(super) fn at(&self, x: f64, y: f64) -> [f64; 4] {
        let clamped = |v: f64, n: usize| v.clamp(0.0, n as f64 - 1.0) as usize;
        let (fx, fy) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (sx, sy) = (x - 0.5 - fx, y - 0.5 - fy);
        let mut sum = [0.0; 4];
        for (dx, dy, w) in [
            (0.0, 0.0, (1.0 - sx) * (1.0 - sy)),
            (1.0, 0.0, sx * (1.0 - sy)),
            (0.0, 1.0, (1.0 - sx) * sy),
            (1.0, 1.0, sx * sy),
        ] {
            let t =
                self.values[clamped(fy + dy, self.size[1]) * self.size[0] + clamped(fx + dx, self.size[0])];
            for c in 0..4 {
                sum[c] += w * t[c];
            }
        }
        sum
    }
}

/// One line of a Gaussian at each texel: along the vector that `deviation` gives, in texels of the source. The source
/// is `halvings` times twice as large as the result.
pub(super) fn line(source: &Texels, halvings: u32, deviation: impl Fn(usize, usize) -> [f64; 2]) -> Texels {
    let scale = f64::from(1u32 << halvings);
    let size = source.size.map(|n| n >> halvings);
    let (weights, _) = taps();
    let mut values = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let d = deviation(x, y);
            let middle = [(x as f64 + 0.5) * scale, (y as f64 + 0.5) * scale];
            let tap = |i: f64| source.at(middle[0] + i * TAP_STEP * d[0], middle[1] + i * TAP_STEP * d[1]);
            let own = tap(0.0);
            let is_known = own[3] >= 0.1;
            let mut sum = own.map(|v| v * weights[0]);
            for (i, w) in weights.iter().enumerate().skip(1) {
                for side in [-1.0, 1.0] {
                    let t = tap(side * i as f64);
                    for c in 0..4 {
                        sum[c] += w * t[c];
                    }
                }
            }
            let [r, g, b, a] = sum;
            values.push(if is_known { [r / a, g / a, b / a, 1.0] } else { [0.0; 4] });
        }
    }
    Texels { size, values }
}
