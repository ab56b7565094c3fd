//! Hashed lattice noise in three dimensions, with gradients.
//!
//! Deterministic: a value depends on its place and its seed alone, never on the order of evaluation.

use glam::Vec3;

/// Mixes lattice coordinates and a seed into 32 well-stirred bits.
pub(crate) fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = seed
        ^ (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// The upper 24 bits of a hash as a number in [0, 1).
pub(crate) fn unit(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A small generator for lists that are made once (moles, hairs, lines).
pub(crate) struct Stream {
    seed: u32,
    count: i32,
}

impl Stream {
    pub(crate) fn new(seed: u32) -> Self {
        Self { seed, count: 0 }
    }

    /// Uniform in [low, high).
    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        self.count += 1;
        low + (high - low) * unit(hash(self.count, 0x5bd1, 77, self.seed))
    }

    /// Mean 0 and standard deviation 1, within [-3.5, 3.5]: the sum of twelve uniform numbers.
    pub(crate) fn normal(&mut self) -> f32 {
        ((0..12).map(|_| self.range(0.0, 1.0)).sum::<f32>() - 6.0).clamp(-3.5, 3.5)
    }
}

/// Three components in [-1, 1] from ten bits each. The casts pass through `i32`, which has a vector instruction.
fn lattice_gradient(h: u32) -> Vec3 {
    let part = |bits: u32| (bits & 1023) as i32 as f32 * (2.0 / 1023.0) - 1.0;
    Vec3::new(part(h), part(h >> 10), part(h >> 20))
}

/// The lattice cell of a position and the place in it. Written with casts: without SSE 4.1, which is not assumed,
/// rounding is a call.
fn cell_of(p: Vec3) -> ([i32; 3], Vec3) {
    let floor = |x: f32| {
        let i = x as i32;
        i - i32::from(x < i as f32)
    };
    let cell = [floor(p.x), floor(p.y), floor(p.z)];
    (cell, p - Vec3::new(cell[0] as f32, cell[1] as f32, cell[2] as f32))
}

/// One coordinate's share of a lattice hash.
fn stir(coordinates: [i32; 3], seed: u32) -> [u32; 3] {
    let [x, y, z] = coordinates.map(|c| c as u32);
    [x.wrapping_mul(0x8da6_b343) ^ seed, y.wrapping_mul(0xd816_3841), z.wrapping_mul(0xcb1a_b31f)]
}

/// A lattice hash from the shares of its coordinates: one round, enough for noise.
fn settle(mixed: u32) -> u32 {
    let h = (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d);
    h ^ (h >> 14)
}

/// Per corner of a cell: its gradient and the ramp of that gradient at the place `f`; corner i is at
/// (i & 1, i >> 1 & 1, i >> 2). Arrays of eight, so that the compiler can use vectors.
fn ramps(cell: [i32; 3], f: Vec3, seed: u32) -> ([[f32; 8]; 3], [f32; 8]) {
    let low = stir(cell, seed);
    let high = stir(cell.map(|c| c.wrapping_add(1)), seed);
    let mut g = [[0.0; 8]; 3];
    let mut ramp = [0.0; 8];
    let pick = |axis: usize, bit: usize| if bit == 1 { high[axis] } else { low[axis] };
    let mut h = [0u32; 8];
    for (i, h) in h.iter_mut().enumerate() {
        *h = pick(0, i & 1) ^ pick(1, (i >> 1) & 1) ^ pick(2, i >> 2);
    }
    for h in &mut h {
        *h = settle(*h);
    }
    for (axis, g) in g.iter_mut().enumerate() {
        for (g, h) in g.iter_mut().zip(h) {
            *g = ((h >> (10 * axis)) & 1023) as i32 as f32 * (2.0 / 1023.0) - 1.0;
        }
    }
    for i in 0..8 {
        let d = [f.x - (i & 1) as f32, f.y - ((i >> 1) & 1) as f32, f.z - (i >> 2) as f32];
        ramp[i] = g[0][i] * d[0] + g[1][i] * d[1] + g[2][i] * d[2];
    }
    (g, ramp)
}

/// Makes the variance of [`gradient_noise`] about one (measured, see the test).
const UNIT_VARIANCE: f32 = 5.25;

/// Gradient noise (Perlin 2002) of lattice spacing 1, mean 0, variance about 1, and its gradient.
pub(crate) fn gradient_noise(p: Vec3, seed: u32) -> (f32, Vec3) {
    let (cell, f) = cell_of(p);
    let (g, ramp) = ramps(cell, f, seed);
    // Quintic fade and its derivative.
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let slope = 30.0 * f * f * (f * (f - 2.0) + 1.0);
    let mut value = 0.0;
    let mut gradient = Vec3::ZERO;
    for i in 0..8 {
        let pick = |bit: usize, t: f32, s: f32| if bit == 1 { (t, s) } else { (1.0 - t, -s) };
        let (wx, sx) = pick(i & 1, fade.x, slope.x);
        let (wy, sy) = pick((i >> 1) & 1, fade.y, slope.y);
        let (wz, sz) = pick(i >> 2, fade.z, slope.z);
        let w = wx * wy * wz;
        value += w * ramp[i];
        gradient += w * Vec3::new(g[0][i], g[1][i], g[2][i])
            + ramp[i] * Vec3::new(sx * wy * wz, wx * sy * wz, wx * wy * sz);
    }
    (value * UNIT_VARIANCE, gradient * UNIT_VARIANCE)
}

/// Value of [`gradient_noise`] at a wavelength in the unit of `p`.
pub(crate) fn noise(p: Vec3, wavelength: f32, seed: u32) -> f32 {
    let (cell, f) = cell_of(p / wavelength);
    let (_, r) = ramps(cell, f, seed);
    let t = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let along_x = [0, 2, 4, 6].map(|i| r[i] + t.x * (r[i + 1] - r[i]));
    let along_y = [0, 2].map(|i| along_x[i] + t.y * (along_x[i + 1] - along_x[i]));
    (along_y[0] + t.z * (along_y[1] - along_y[0])) * UNIT_VARIANCE
}

/// Calls `visit(hash, offset)` for the feature point of each of the 27 lattice cells around `p` (spacing 1);
/// `offset` goes from the feature to `p`.
pub(crate) fn features(p: Vec3, seed: u32, mut visit: impl FnMut(u32, Vec3)) {
    let (cell, f) = cell_of(p);
    let shares = [-1, 0, 1].map(|step| stir(cell.map(|c| c.wrapping_add(step)), seed));
    for k in 0..3 {
        for j in 0..3 {
            let share_yz = shares[j][1] ^ shares[k][2];
            for (i, share) in shares.iter().enumerate() {
                let h = settle(share[0] ^ share_yz);
                let corner = Vec3::new(i as f32, j as f32, k as f32) - 0.5;
                visit(h.wrapping_mul(0x9e37_79b1), f - corner - lattice_gradient(h) * 0.5);
            }
        }
    }
}

/// 0 below `low`, 1 above `high`, cubic between.
pub(crate) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_unit_variance_and_its_gradient_matches_differences() {
        let mut stream = Stream::new(3);
        let mut random = || Vec3::from_array([0; 3].map(|_| stream.range(-50.0, 50.0)));
        let (mut sum, mut squares) = (0.0, 0.0);
        let n = 20_000;
        for _ in 0..n {
            let v = gradient_noise(random(), 9).0;
            sum += v;
            squares += v * v;
        }
        let mean = sum / n as f32;
        let variance = squares / n as f32 - mean * mean;
        assert!(mean.abs() < 0.03, "mean {mean}");
        assert!((variance - 1.0).abs() < 0.1, "variance {variance}");
        for _ in 0..200 {
            let p = random();
            let (value, g) = gradient_noise(p, 9);
            assert!((noise(p * 3.0, 3.0, 9) - value).abs() < 1e-3);
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let e = 5e-3;
                let d = (gradient_noise(p + e * axis, 9).0 - gradient_noise(p - e * axis, 9).0) / (2.0 * e);
                assert!((d - g.dot(axis)).abs() < 0.02, "{d} is not {}", g.dot(axis));
            }
        }
    }

    #[test]
    fn streams_are_reproducible_and_standard() {
        let draw = |seed| {
            let mut s = Stream::new(seed);
            (0..4000).map(|_| s.normal()).collect::<Vec<_>>()
        };
        assert_eq!(draw(5), draw(5));
        assert_ne!(draw(5), draw(6));
        let values = draw(5);
        let mean = values.iter().sum::<f32>() / 4000.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / 4000.0;
        assert!(mean.abs() < 0.05 && (variance - 1.0).abs() < 0.08, "{mean} {variance}");
    }
}
