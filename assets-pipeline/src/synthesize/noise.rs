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

/// Three components in [-1, 1] from ten bits each.
fn lattice_gradient(h: u32) -> Vec3 {
    const STEP: f32 = 2.0 / 1023.0;
    Vec3::new((h & 1023) as f32, ((h >> 10) & 1023) as f32, ((h >> 20) & 1023) as f32) * STEP - 1.0
}

/// Makes the variance of [`gradient_noise`] about one (measured over 10^5 places, see the test).
const UNIT_VARIANCE: f32 = 3.95;

/// Gradient noise (Perlin 2002) of lattice spacing 1, mean 0, variance about 1, and its gradient.
pub(crate) fn gradient_noise(p: Vec3, seed: u32) -> (f32, Vec3) {
    let cell = p.floor();
    let f = p - cell;
    let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
    // Quintic fade and its derivative.
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let slope = 30.0 * f * f * (f * (f - 2.0) + 1.0);
    let mut value = 0.0;
    let mut gradient = Vec3::ZERO;
    for corner in 0..8 {
        let (i, j, k) = (corner & 1, (corner >> 1) & 1, corner >> 2);
        let g = lattice_gradient(hash(x + i, y + j, z + k, seed));
        let ramp = g.dot(f - Vec3::new(i as f32, j as f32, k as f32));
        let pick = |bit: i32, t: f32, s: f32| if bit == 1 { (t, s) } else { (1.0 - t, -s) };
        let (wx, sx) = pick(i, fade.x, slope.x);
        let (wy, sy) = pick(j, fade.y, slope.y);
        let (wz, sz) = pick(k, fade.z, slope.z);
        let w = wx * wy * wz;
        value += w * ramp;
        gradient += w * g + ramp * Vec3::new(sx * wy * wz, wx * sy * wz, wx * wy * sz);
    }
    (value * UNIT_VARIANCE, gradient * UNIT_VARIANCE)
}

/// Value of [`gradient_noise`] at a wavelength in the unit of `p`.
pub(crate) fn noise(p: Vec3, wavelength: f32, seed: u32) -> f32 {
    gradient_noise(p / wavelength, seed).0
}

/// Calls `visit(hash, offset)` for the feature point of each of the 27 lattice cells around `p` (spacing 1);
/// `offset` goes from the feature to `p`.
pub(crate) fn features(p: Vec3, seed: u32, mut visit: impl FnMut(u32, Vec3)) {
    let cell = p.floor();
    let f = p - cell;
    let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
    for k in -1..=1 {
        for j in -1..=1 {
            for i in -1..=1 {
                let h = hash(x + i, y + j, z + k, seed);
                let at = lattice_gradient(h) * 0.5 + 0.5 + Vec3::new(i as f32, j as f32, k as f32);
                visit(h.wrapping_mul(0x9e37_79b1), f - at);
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
        let mut random = || Vec3::from_fn(|_| stream.range(-50.0, 50.0));
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
            let g = gradient_noise(p, 9).1;
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
