//! Separable kernels: a profile as two one-dimensional passes (Jimenez 2012, chapter 6).
//!
//! ```text
//! profile --> spectrum --> edges     (straight edges of light in all directions)
//!        +--> light of each cell of a grid of taps --> line spread     (sums of rows)
//!                                                 +--> singular value  (best separable kernel by eq. 6.3)
//!                                                 +--> least squares   (best of the family of eq. 6.1)
//! artist's width, strength, falloff --------------------> eq. 6.1
//! ```
//!
//! The light of a cell is exact: it follows from the profile's CDF (`RadialProfile::quadrant_cdf`).

use libm::erf;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::gaussians::DEON_SIX;
use super::numerics::{invert_cdf, levenberg_marquardt};
use super::profile::{Profile, RadialProfile};
use crate::error::SkinError;

/// Smallest and largest number of taps of a kernel.
pub const SAMPLES: std::ops::RangeInclusive<usize> = 5..=65;

/// Fraction of the light of the widest channel that lies inside of a kernel's half width.
///
/// The rest is folded into the taps; a larger fraction spends taps on invisible light.
const COVERAGE: f64 = 0.99;

/// Method by which a kernel is made from a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KernelMethod {
    /// Least squares over straight edges of light in all directions; the method of frames.
    Edges,
    /// The profile's line spread function: exact for light that varies along one axis, as across an upright shadow, and
    /// farthest off across a diagonal one, where the product of two line spreads is wider than the profile.
    LineSpread,
    /// The family of [`ArtistKernel`], fitted to the 2D kernel by constrained non-linear least squares (6.1-6.3).
    LeastSquares,
    /// The first singular vector of the 2D kernel: before it is normalized, no separable kernel has a smaller squared
    /// error (6.3).
    SingularValue,
}

/// A kernel that is applied along x and then along y.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeparableKernel {
    /// Places of the taps, mm, ascending and symmetric; the middle one is 0.
    pub offsets_mm: Vec<f64>,
    /// R, G, B weight of each tap; each channel sums to one.
    pub weights: Vec<[f64; 3]>,
}

/// The artist's parameters (Jimenez 2012, eq. 6.1): `s(x) = p(x / a) strength + delta(x) (1 - strength)`.
///
/// p is d'Eon's red channel without its narrowest Gaussian; the delta stands for the light of that Gaussian, and p uses
/// units of a millimetre. The kernel's half width is three such units, so `a = (0.001 + falloff) width_mm / 3`: a
/// falloff of 1 and a width of 3 mm give d'Eon's own red.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArtistKernel {
    /// Half width of the kernel, mm.
    pub width_mm: f64,
    /// Fraction of the light that scatters, R, G, B, each 0 to 1.
    pub strength: [f64; 3],
    /// Width of the gradients relative to d'Eon's red, R, G, B, each 0 or more.
    pub falloff: [f64; 3],
}

/// A kernel, its method and its distance from the profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelReport {
    /// Name of the profile.
    pub profile: String,
    /// How the kernel was made.
    pub method: KernelMethod,
    /// The kernel.
    pub kernel: SeparableKernel,
    /// The parameters that were fitted, for [`KernelMethod::LeastSquares`].
    pub artist: Option<ArtistKernel>,
    /// First singular value of the 2D kernel over the sum of all: how separable each channel is.
    pub separability: [f64; 3],
    /// Error of each channel.
    pub errors: [KernelError; 3],
}

/// Distance of a separable kernel from the 2D kernel of its profile, over the square that its taps cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelError {
    /// Root of the sum over the taps' cells of the squared difference in light (eq. 6.3) over that of the squared
    /// light.
    pub root_mean_square: f64,
    /// Fraction of the light in the wrong cell: half the sum of the absolute differences.
    pub misplaced: f64,
}

impl SeparableKernel {
    /// The kernel of [`KernelMethod::Edges`] of a profile with an odd number of taps, 5 to 65.
    pub fn of(profile: &Profile, samples: usize) -> Result<Self, SkinError> {
        check_samples(samples)?;
        Ok(edges(profile, &Grid::new(samples, half_width_mm(profile)?)))
    }

    /// The kernel of an artist's parameters.
    pub fn artist(parameters: &ArtistKernel, samples: usize) -> Result<Self, SkinError> {
        check_samples(samples)?;
        parameters.validate()?;
        Ok(parameters.kernel(&Grid::new(samples, parameters.width_mm)))
    }

    /// Half the width, mm: the last offset.
    pub fn half_width_mm(&self) -> f64 {
        self.offsets_mm.last().copied().unwrap_or(0.0)
    }

    /// Makes a kernel from the weights of the centre and the taps on one side; makes each channel sum to one.
    fn mirrored(grid: &Grid, half: [Vec<f64>; 3]) -> Self {
        let last = grid.half.len() - 1;
        let sums = half.each_ref().map(|w| w[0] + 2.0 * w[1..].iter().sum::<f64>());
        let tap = |i: usize| i.abs_diff(last);
        Self {
            offsets_mm: (0..=2 * last)
                .map(|i| if i < last { -grid.half[tap(i)] } else { grid.half[tap(i)] })
                .collect(),
            weights: (0..=2 * last).map(|i| std::array::from_fn(|c| half[c][tap(i)] / sums[c])).collect(),
        }
    }

    /// The centre and the taps on one side of a channel.
    fn half(&self, channel: usize) -> Vec<f64> {
        self.weights[self.weights.len() / 2..].iter().map(|w| w[channel]).collect()
    }
}

/// Makes a kernel of a profile with an odd number of taps, 5 to 65, and reports on it.
pub fn kernel_report(
    profile: &Profile,
    method: KernelMethod,
    samples: usize,
) -> Result<KernelReport, SkinError> {
    check_samples(samples)?;
    let grid = Grid::new(samples, half_width_mm(profile)?);
    let exact = profile.channels.each_ref().map(|channel| grid.quadrant(channel));
    let decompositions = exact.each_ref().map(|kernel| SymmetricEigen::new(kernel.clone()));
    let separability = decompositions.each_ref().map(|e| e.eigenvalues.amax() / e.eigenvalues.abs().sum());
    let mut artist = None;
    let kernel = match method {
        KernelMethod::Edges => edges(profile, &grid),
        KernelMethod::LineSpread => line_spread(profile, &grid),
        KernelMethod::SingularValue => {
            SeparableKernel::mirrored(&grid, decompositions.each_ref().map(|e| grid.first_vector(e)))
        }
        KernelMethod::LeastSquares => {
            let parameters = fit_artist(&grid, &exact);
            artist = Some(parameters);
            parameters.kernel(&grid)
        }
    };
    let errors = std::array::from_fn(|c| grid.error(&exact[c], &kernel.half(c)));
    Ok(KernelReport { profile: profile.name.clone(), method, kernel, artist, separability, errors })
}

impl ArtistKernel {
    /// Strengths and falloffs of Jimenez 2012, table 6.1, at a half width (3 mm shows skin of natural size).
    pub fn thesis(width_mm: f64) -> Self {
        Self { width_mm, strength: [0.78, 0.70, 0.75], falloff: [0.57, 0.13, 0.08] }
    }

    /// Checks the ranges of the fields.
    pub fn validate(&self) -> Result<(), SkinError> {
        if !(self.width_mm > 0.0 && self.width_mm.is_finite()) {
            return Err(SkinError::new("kernel.width_mm", self.width_mm, "a positive finite width"));
        }
        for c in 0..3 {
            if !(0.0..=1.0).contains(&self.strength[c]) {
                return Err(SkinError::new(format!("kernel.strength[{c}]"), self.strength[c], "0 to 1"));
            }
            if !(self.falloff[c] >= 0.0 && self.falloff[c].is_finite()) {
                return Err(SkinError::new(
                    format!("kernel.falloff[{c}]"),
                    self.falloff[c],
                    "a finite falloff, 0 or more",
                ));
            }
        }
        Ok(())
    }

    fn kernel(&self, grid: &Grid) -> SeparableKernel {
        let channel = |c: usize| {
            let scale_mm = (0.001 + self.falloff[c]) * self.width_mm / 3.0;
            grid.artist(scale_mm, self.strength[c])
        };
        SeparableKernel::mirrored(grid, [channel(0), channel(1), channel(2)])
    }
}

/// Integral of p (see [`ArtistKernel`]) from -x to x, x in units of p.
///
/// A slice through 2D Gaussians `w / (2 pi v) e^(-x^2 / 2v)` holds light in proportion to `w / sqrt(v)`.
fn slice_cdf(x: f64) -> f64 {
    let terms = DEON_SIX[1..].iter().map(|(v, w)| (v.sqrt(), w[0] / v.sqrt()));
    let (sum, norm) = terms.fold((0.0, 0.0), |(sum, norm), (deviation, weight)| {
        (sum + weight * erf(x / (deviation * std::f64::consts::SQRT_2)), norm + weight)
    });
    sum / norm
}

/// Fits strength and falloff of each channel to the exact kernel by eq. 6.3.
///
/// The samples are the taps' cells, which are as dense near the centre as the taps, each with its light.
fn fit_artist(grid: &Grid, exact: &[DMatrix<f64>; 3]) -> ArtistKernel {
    let width_mm = grid.width_mm();
    let mut artist = ArtistKernel { width_mm, strength: [0.0; 3], falloff: [0.0; 3] };
    for (c, exact) in exact.iter().enumerate() {
        let norm = exact.norm();
        let residual = |x: &[f64]| {
            let half = normalized(grid.artist(x[0].exp(), x[1]));
            let difference = (exact - grid.separable_quadrant(&half)) / norm;
            DVector::from_column_slice(difference.as_slice())
        };
        // The falloff, the part with several minima, is searched in steps of a constant factor.
        let (low, high) = ((0.001 * width_mm / 3.0f64).ln(), (4.0 * width_mm / 3.0f64).ln());
        let mut best = (vec![low, 0.5], f64::INFINITY);
        for i in 0..8 {
            let start = [low + (high - low) * (i as f64 + 0.5) / 8.0, 0.7];
            let found = levenberg_marquardt(residual, &start, &[(low, high), (0.0, 1.0)], 1e-5);
            if found.1 < best.1 {
                best = found;
            }
        }
        artist.falloff[c] = (best.0[0].exp() * 3.0 / width_mm - 0.001).max(0.0);
        artist.strength[c] = best.0[1];
    }
    artist
}

fn line_spread(profile: &Profile, grid: &Grid) -> SeparableKernel {
    let half = profile.channels.each_ref().map(|channel| grid.cells(|x| channel.line_cdf(x)));
    SeparableKernel::mirrored(grid, half)
}

/// Wave numbers of the edges of [`edges`], from this over the half width on, evenly spaced in the logarithm, and their
/// directions from an axis to the diagonal.
const LONGEST_WAVE: f64 = 0.2;
const SHORTEST_WAVE: f64 = 43.0;
const WAVES: usize = 60;
const DIRECTIONS: usize = 10;
/// Regularisation of each weight towards the line spread, where edges do not separate it from its neighbours.
const PULL: f64 = 0.1;

/// The kernel that blurs straight edges of light, of all directions alike, as the profile does: the spectrum of a
/// separable kernel is the product of its line's at the two components of a wave, that of the profile is the spectrum of
/// its line spread at the length of the wave; an edge holds waves k in proportion to 1 / k.
fn edges(profile: &Profile, grid: &Grid) -> SeparableKernel {
    let half = profile.channels.each_ref().map(|channel| {
        let start = normalized(grid.cells(|x| channel.line_cdf(x)));
        let width = grid.width_mm();
        // The line spread in steps far finer than any wave, out to where its rest is folded in.
        let fine = Grid::new(801, 4.0 * width);
        let (places, light) = (&fine.half, normalized(fine.cells(|x| channel.line_cdf(x))));
        let spectrum = |places: &[f64], light: &[f64], k: f64| {
            light[0] + 2.0 * places.iter().zip(light).skip(1).map(|(x, w)| w * (k * x).cos()).sum::<f64>()
        };
        let wave = |i: usize| {
            let t = i as f64 / (WAVES - 1) as f64;
            LONGEST_WAVE / width * (SHORTEST_WAVE / LONGEST_WAVE).powf(t)
        };
        let truth: Vec<f64> = (0..WAVES).map(|i| spectrum(places, &light, wave(i))).collect();
        // Power 1 / k^2, integrated over steps of k proportional to k.
        let share: Vec<f64> = (0..WAVES).map(|i| wave(i).powf(-0.5)).collect();
        let norm = (DIRECTIONS as f64 * share.iter().map(|s| s * s).sum::<f64>()).sqrt();
        let taps = grid.half.len() - 1;
        let cosines = |part: fn(f64) -> f64| {
            DMatrix::from_fn(WAVES * DIRECTIONS, taps, |row, tap| {
                let angle = std::f64::consts::FRAC_PI_4 * (row % DIRECTIONS) as f64 / (DIRECTIONS - 1) as f64;
                2.0 * ((wave(row / DIRECTIONS) * part(angle) * grid.half[tap + 1]).cos() - 1.0)
            })
        };
        let (along, across) = (cosines(f64::cos), cosines(f64::sin));
        // The centre's weight is one minus the others, so a line's spectrum is 1 + sum of w (2 cos - 2).
        let residual = |weights: &[f64]| {
            let w = DVector::from_column_slice(weights);
            let (a, b) = (&along * &w, &across * &w);
            DVector::from_fn(WAVES * DIRECTIONS + taps, |row, _| match row.checked_sub(WAVES * DIRECTIONS) {
                Some(tap) => PULL * (weights[tap] - start[tap + 1]),
                None => {
                    let i = row / DIRECTIONS;
                    ((1.0 + a[row]) * (1.0 + b[row]) - truth[i]) * share[i] / norm
                }
            })
        };
        let (found, _) = levenberg_marquardt(residual, &start[1..], &vec![(0.0, 0.5); taps], 1e-5);
        let center = (1.0 - 2.0 * found.iter().sum::<f64>()).max(0.0);
        std::iter::once(center).chain(found).collect()
    });
    SeparableKernel::mirrored(grid, half)
}

fn check_samples(samples: usize) -> Result<(), SkinError> {
    if samples.is_multiple_of(2) || !SAMPLES.contains(&samples) {
        return Err(SkinError::new("kernel.samples", samples, "an odd number from 5 to 65"));
    }
    Ok(())
}

/// Where the line spread of the widest channel reaches [`COVERAGE`], mm.
fn half_width_mm(profile: &Profile) -> Result<f64, SkinError> {
    let width = |c: &RadialProfile| invert_cdf(COVERAGE, c.scale_mm(), |x| c.line_cdf(x));
    let width = profile.channels.iter().map(width).fold(0.0, f64::max);
    if width > 0.0 && width.is_finite() {
        return Ok(width);
    }
    Err(SkinError::new("kernel.profile", format!("a width of {width} mm"), "a profile of finite width"))
}

/// Weights of a half (centre first) that sum to one with their mirror image.
fn normalized(mut half: Vec<f64>) -> Vec<f64> {
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter_mut().for_each(|w| *w /= sum);
    half
}

/// The taps on one side, centre first, and the cells that they stand for.
struct Grid {
    /// Offsets, mm, from 0; quadratically denser near the centre (section 6.2.2).
    half: Vec<f64>,
    /// Outer edge of each cell, mm: halfway to the next tap; the last is as far outside as inside.
    edges: Vec<f64>,
}

impl Grid {
    fn new(samples: usize, half_width_mm: f64) -> Self {
        let last = samples / 2;
        let half: Vec<f64> = (0..=last).map(|i| half_width_mm * (i as f64 / last as f64).powi(2)).collect();
        let edges = (0..=last)
            .map(|i| if i < last { 0.5 * (half[i] + half[i + 1]) } else { 1.5 * half[i] - 0.5 * half[i - 1] })
            .collect();
        Self { half, edges }
    }

    fn width_mm(&self) -> f64 {
        self.half[self.half.len() - 1]
    }

    /// Number of mirror images of a cell along an axis.
    fn images(&self, i: usize) -> f64 {
        if i == 0 { 1.0 } else { 2.0 }
    }

    /// Light of each cell, where `cdf(x)` is the light from -x to x.
    fn cells(&self, cdf: impl Fn(f64) -> f64) -> Vec<f64> {
        let at: Vec<f64> = self.edges.iter().map(|&e| cdf(e)).collect();
        (0..at.len()).map(|i| if i == 0 { at[0] } else { 0.5 * (at[i] - at[i - 1]) }).collect()
    }

    /// Eq. 6.1 for one channel, before it is normalized to one. The light of p beyond the grid is folded in first.
    fn artist(&self, scale_mm: f64, strength: f64) -> Vec<f64> {
        let mut half = normalized(self.cells(|x| slice_cdf(x / scale_mm)));
        half.iter_mut().for_each(|w| *w *= strength);
        half[0] += 1.0 - strength;
        half
    }

    /// The exact 2D kernel: light of the cells with x, y >= 0, each times the root of the number of its mirror images,
    /// so that squares add up to those of the whole kernel.
    fn quadrant(&self, channel: &RadialProfile) -> DMatrix<f64> {
        let n = self.half.len();
        let mut corner = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                corner[(i, j)] = channel.quadrant_cdf(self.edges[i], self.edges[j]);
                corner[(j, i)] = corner[(i, j)];
            }
        }
        let at = |i: usize, j: usize| if i == 0 || j == 0 { 0.0 } else { corner[(i - 1, j - 1)] };
        DMatrix::from_fn(n, n, |i, j| {
            let quadrant = at(i + 1, j + 1) - at(i, j + 1) - at(i + 1, j) + at(i, j);
            // The centre's cells reach into two or four quadrants.
            let light = quadrant * 4.0 / (self.images(i) * self.images(j));
            light * self.scale(i) * self.scale(j)
        })
    }

    /// Root of the number of mirror images of a cell along an axis.
    fn scale(&self, i: usize) -> f64 {
        self.images(i).sqrt()
    }

    /// The 2D kernel of a separable one, scaled as [`Self::quadrant`].
    fn separable_quadrant(&self, half: &[f64]) -> DMatrix<f64> {
        let n = half.len();
        DMatrix::from_fn(n, n, |i, j| half[i] * self.scale(i) * half[j] * self.scale(j))
    }

    /// Weights of the best separable kernel, from the decomposition of [`Self::quadrant`].
    fn first_vector(&self, decomposition: &SymmetricEigen<f64, nalgebra::Dyn>) -> Vec<f64> {
        let first = decomposition.eigenvalues.imax();
        let vector = decomposition.eigenvectors.column(first);
        // The matrix is not negative, so by Perron and Frobenius neither is its first vector, up to its sign and
        // rounding.
        (0..self.half.len()).map(|i| vector[i].abs() / self.scale(i)).collect()
    }

    fn error(&self, exact: &DMatrix<f64>, half: &[f64]) -> KernelError {
        let difference = exact - self.separable_quadrant(half);
        let misplaced = (0..half.len())
            .flat_map(|i| (0..half.len()).map(move |j| (i, j)))
            .map(|(i, j)| {
                let light = difference[(i, j)].abs() / (self.scale(i) * self.scale(j));
                light * self.images(i) * self.images(j)
            })
            .sum::<f64>();
        KernelError { root_mean_square: difference.norm() / exact.norm(), misplaced: 0.5 * misplaced }
    }
}

#[cfg(test)]
mod tests;
