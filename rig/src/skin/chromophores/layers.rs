//! Diffuse reflectance of plane layers: discrete ordinates, exact up to the number of directions.
//!
//! Theory. Finite layers on a semi-infinite one of the same index of refraction, under a smooth surface.
//! Scattering is isotropic with the reduced coefficient (similarity relation). With N directions mu_j of weight w_j
//! on (0, 1], the azimuthal mean J of the radiance (times 2 pi) obeys
//! `mu dJ/dtau = -J + (omega / 2) sum_j w_j (J_down + J_up)` (Chandrasekhar 1950, ch. 3). Its solutions are
//! `J_down = e^(-k tau) / (1 - k mu)`, `J_up = e^(-k tau) / (1 + k mu)` for the roots +-k of
//! `1 = omega sum_j w_j / (1 - k^2 mu_j^2)`. Boundary conditions give their amplitudes: the dermis becomes an N x N
//! reflection matrix, and each layer above one linear system of size 2N: a new matrix, or a number under the surface.
//!
//! The result is the reflectance factor seen along the normal under diffuse light, without the light that the
//! surface reflects: which is the d/0 geometry of skin colorimeters. By reciprocity it is also the fraction of a beam
//! along the normal that leaves again, which a photon walk counts. So the beam needs no resonant particular solution.

// Indices are those of the matrices in the equations.
#![allow(clippy::needless_range_loop)]

use super::coefficients::Medium;

/// Directions in a hemisphere: half of them inside the critical angle, half outside.
pub const STREAMS: usize = 8;

/// Nodes and weights of the 4-point Gauss-Legendre rule on (0, 1).
const GAUSS_4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_13, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Nodes and weights of the 8-point Gauss-Legendre rule on (0, 1).
const GAUSS_8: [(f64, f64); 8] = [
    (0.019_855_071_751_231_88, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_6, 0.111_190_517_226_687_2),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_6),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_824_9, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_6),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_2),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

type Vector = [f64; STREAMS];
type Matrix = [Vector; STREAMS];

/// Fraction of unpolarised light that a smooth surface reflects; `cosine` and `eta = n_t / n_i` on the incident side.
pub fn fresnel_reflectance(cosine: f64, eta: f64) -> f64 {
    let sine2_t = (1.0 - cosine * cosine) / (eta * eta);
    if sine2_t >= 1.0 {
        return 1.0;
    }
    let cosine_t = (1.0 - sine2_t).sqrt();
    let s = (cosine - eta * cosine_t) / (cosine + eta * cosine_t);
    let p = (eta * cosine - cosine_t) / (eta * cosine + cosine_t);
    0.5 * (s * s + p * p)
}

/// Directions and surface of a skin: all that does not depend on the wavelength.
#[derive(Clone, Debug)]
pub struct Directions {
    mu: Vector,
    weight: Vector,
    /// Internal reflectance of the surface in each direction.
    reflectance: Vector,
    /// Radiance that unit diffuse irradiance sends down each direction, times 2 pi.
    entering: Vector,
    /// Share of the radiance along the normal that leaves, over n^2.
    leaving_normal: f64,
}

impl Directions {
    /// Directions for an index of refraction relative to air, at least 1.
    pub fn new(eta: f64) -> Self {
        let critical = (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt();
        let mut d = Self {
            mu: [0.0; STREAMS],
            weight: [0.0; STREAMS],
            reflectance: [0.0; STREAMS],
            entering: [0.0; STREAMS],
            leaving_normal: (1.0 - fresnel_reflectance(1.0, 1.0 / eta)) / (eta * eta),
        };
        for i in 0..STREAMS {
            // The surface is discontinuous in slope at the critical angle: a rule on each side of it.
            (d.mu[i], d.weight[i]) = if critical < 1e-3 {
                GAUSS_8[i]
            } else if i < 4 {
                (critical * GAUSS_4[i].0, critical * GAUSS_4[i].1)
            } else {
                let width = 1.0 - critical;
                (critical + width * GAUSS_4[i - 4].0, width * GAUSS_4[i - 4].1)
            };
            d.reflectance[i] = fresnel_reflectance(d.mu[i], 1.0 / eta);
            // Irradiance 1 is radiance 1 / pi; refraction compresses it by n^2.
            d.entering[i] = 2.0 * eta * eta * (1.0 - d.reflectance[i]);
        }
        d
    }

    /// Positive roots k of the characteristic equation at a single-scattering albedo, ascending.
    fn roots(&self, albedo: f64) -> Vector {
        // Beyond these the modes of a layer coincide (no absorption) or turn into beams (no scattering).
        let albedo = albedo.clamp(1e-4, 1.0 - 1e-9);
        let squares = self.mu.map(|mu| mu * mu);
        let mut roots = [0.0; STREAMS];
        for (i, root) in roots.iter_mut().enumerate() {
            // Poles of the equation in x = k^2 enclose one root each; the first lies between 0 and the first pole.
            let largest = STREAMS - 1 - i;
            let upper = 1.0 / squares[largest];
            let lower = if i == 0 { 0.0 } else { 1.0 / squares[largest + 1] };
            let (mut a, mut b) = (lower, upper);
            let mut x = if i == 0 { 0.5 * upper } else { 0.5 * (a + b) };
            for _ in 0..60 {
                let (mut f, mut slope) = (1.0, 0.0);
                for j in 0..STREAMS {
                    let inverse = 1.0 / (1.0 - x * squares[j]);
                    let term = albedo * self.weight[j] * inverse;
                    f -= term;
                    slope -= term * inverse * squares[j];
                }
                if f > 0.0 {
                    a = x;
                } else {
                    b = x;
                }
                // Newton on f times the distances to both poles, which has no pole in the interval.
                let mut ratio = slope / f - 1.0 / (upper - x);
                if i > 0 {
                    ratio += 1.0 / (x - lower);
                }
                let step = -1.0 / ratio;
                if step.abs() <= 1e-14 * x {
                    x += step;
                    break;
                }
                x = if x + step > a && x + step < b { x + step } else { 0.5 * (a + b) };
            }
            *root = x.sqrt();
        }
        roots
    }

    /// Radiance of each mode in each direction, going with the mode (it decays that way) and against it,
    /// scaled so that the largest is 1; the third result is the source of the mode in that scale.
    fn modes(&self, roots: &Vector) -> (Matrix, Matrix, Vector) {
        let (mut with, mut against, mut source) =
            ([[0.0; STREAMS]; STREAMS], [[0.0; STREAMS]; STREAMS], [1.0; STREAMS]);
        for m in 0..STREAMS {
            let mut largest: f64 = 0.0;
            for j in 0..STREAMS {
                with[j][m] = 1.0 / (1.0 - roots[m] * self.mu[j]);
                against[j][m] = 1.0 / (1.0 + roots[m] * self.mu[j]);
                largest = largest.max(with[j][m].abs());
            }
            source[m] = 1.0 / largest;
            for j in 0..STREAMS {
                with[j][m] /= largest;
                against[j][m] /= largest;
            }
        }
        (with, against, source)
    }

    /// Reflection operator of a semi-infinite layer at its top.
    pub fn half_space(&self, medium: Medium) -> HalfSpace {
        let roots = self.roots(medium.albedo());
        let (with, against, source) = self.modes(&roots);
        // up = against * amplitudes, down = with * amplitudes: up = (against * with^-1) down.
        // Solved by rows: reflection^T = (with^T)^-1 against^T.
        let mut system = [[0.0; 2 * STREAMS]; STREAMS];
        let mut emission = [[0.0; STREAMS + 1]; STREAMS];
        for m in 0..STREAMS {
            for j in 0..STREAMS {
                system[m][j] = with[j][m];
                system[m][STREAMS + j] = against[j][m];
                emission[m][j] = with[j][m];
            }
            // Source seen along the normal from the top: integral of e^(-k tau) e^(-tau).
            emission[m][STREAMS] = source[m] / (roots[m] + 1.0);
        }
        solve(&mut system);
        solve(&mut emission);
        let mut half = HalfSpace { reflection: [[0.0; STREAMS]; STREAMS], normal: [0.0; STREAMS] };
        for j in 0..STREAMS {
            for i in 0..STREAMS {
                half.reflection[i][j] = system[j][STREAMS + i];
            }
            half.normal[j] = emission[j][STREAMS];
        }
        half
    }

    /// Reflection operator, at its top, of a layer of `thickness_mm` on `base`.
    pub fn over(&self, layer: Medium, thickness_mm: f64, base: &HalfSpace) -> HalfSpace {
        const N: usize = STREAMS;
        // One column per incident direction, without a surface above.
        let mut entering = [[0.0; N]; N];
        for j in 0..N {
            entering[j][j] = 1.0;
        }
        let returned = self.slab::<N, { 3 * N }>(layer, thickness_mm, base, &[0.0; N], &entering);
        let mut half = HalfSpace { reflection: [[0.0; N]; N], normal: [0.0; N] };
        for (j, (up, normal)) in returned.into_iter().enumerate() {
            for i in 0..N {
                half.reflection[i][j] = up[i];
            }
            half.normal[j] = normal;
        }
        half
    }

    /// Diffuse reflectance of a layer of `thickness_mm` under the surface, on what lies below it, 0 to 1.
    pub fn reflectance(&self, layer: Medium, thickness_mm: f64, base: &HalfSpace) -> f64 {
        let entering = self.entering.map(|e| [e]);
        let [(_, normal)] =
            self.slab::<1, { 2 * STREAMS + 1 }>(layer, thickness_mm, base, &self.reflectance, &entering);
        // J is 2 pi times the radiance; the reflectance factor is pi times the radiance that leaves.
        0.5 * self.leaving_normal * normal
    }

    /// For each column of `entering` (by direction): the radiance upwards at the top of a layer in each direction and
    /// along the normal. `surface` is the internal reflectance above it. `COLUMNS` is 2 N plus the number of columns.
    fn slab<const CASES: usize, const COLUMNS: usize>(
        &self,
        layer: Medium,
        thickness_mm: f64,
        base: &HalfSpace,
        surface: &Vector,
        entering: &[[f64; CASES]; STREAMS],
    ) -> [(Vector, f64); CASES] {
        const N: usize = STREAMS;
        let depth = layer.extinction_per_mm() * thickness_mm;
        let roots = self.roots(layer.albedo());
        let (with, against, source) = self.modes(&roots);
        let attenuation = roots.map(|k| (-k * depth).exp());
        // Unknowns: amplitudes of modes that decay downwards from the top, then of those that decay upwards from the
        // bottom. Rows: the top (down = surface * up + entering), then the bottom (up = base * down).
        let mut system = [[0.0; COLUMNS]; 2 * N];
        for j in 0..N {
            for m in 0..N {
                system[j][m] = with[j][m] - surface[j] * against[j][m];
                system[j][N + m] = attenuation[m] * (against[j][m] - surface[j] * with[j][m]);
            }
            system[j][2 * N..].copy_from_slice(&entering[j]);
            let row = &mut system[N + j];
            row[..N].copy_from_slice(&against[j]);
            row[N..2 * N].copy_from_slice(&with[j]);
            for i in 0..N {
                let r = base.reflection[j][i];
                for m in 0..N {
                    row[m] -= r * with[i][m];
                    row[N + m] -= r * against[i][m];
                }
            }
            for m in 0..N {
                row[m] *= attenuation[m];
            }
        }
        solve(&mut system);
        // Radiance along the normal at the top: the source through e^-tau, plus what the base sends up.
        let beam = (-depth).exp();
        std::array::from_fn(|case| {
            let mut normal = 0.0;
            let (mut top_up, mut bottom_down) = ([0.0; N], [0.0; N]);
            for m in 0..N {
                let (a, b) = (system[m][2 * N + case], system[N + m][2 * N + case]);
                let k = roots[m];
                normal += a * source[m] * (1.0 - attenuation[m] * beam) / (k + 1.0);
                // (e^-tau - e^(-k tau)) / (k - 1) has a removable pole where a root crosses 1.
                let difference = (k - 1.0) * depth;
                let upward = if difference.abs() < 1e-5 {
                    beam * depth * (1.0 - 0.5 * difference)
                } else {
                    (beam - attenuation[m]) / (k - 1.0)
                };
                normal += b * source[m] * upward;
                for j in 0..N {
                    top_up[j] += a * against[j][m] + b * attenuation[m] * with[j][m];
                    bottom_down[j] += a * attenuation[m] * with[j][m] + b * against[j][m];
                }
            }
            for j in 0..N {
                normal += beam * base.normal[j] * bottom_down[j];
            }
            (top_up, normal)
        })
    }
}

/// Reflection of a semi-infinite medium, or of layers on one, without a surface.
#[derive(Clone, Debug)]
pub struct HalfSpace {
    /// Radiance up in direction i by unit radiance down in direction j.
    reflection: Matrix,
    /// Radiance up along the normal by unit radiance down in direction j.
    normal: Vector,
}

/// Gaussian elimination with row pivoting: the columns beyond the square part become the solutions.
fn solve<const ROWS: usize, const COLUMNS: usize>(system: &mut [[f64; COLUMNS]; ROWS]) {
    for p in 0..ROWS {
        let mut best = p;
        for r in p + 1..ROWS {
            if system[r][p].abs() > system[best][p].abs() {
                best = r;
            }
        }
        system.swap(p, best);
        let pivot_row = system[p];
        let inverse = 1.0 / pivot_row[p];
        for row in system.iter_mut().skip(p + 1) {
            let factor = row[p] * inverse;
            if factor != 0.0 {
                for (value, pivot) in row[p + 1..].iter_mut().zip(&pivot_row[p + 1..]) {
                    *value -= factor * pivot;
                }
            }
        }
    }
    for p in (0..ROWS).rev() {
        for c in ROWS..COLUMNS {
            let mut sum = system[p][c];
            for q in p + 1..ROWS {
                sum -= system[p][q] * system[q][c];
            }
            system[p][c] = sum / system[p][p];
        }
    }
}
