//! FLIP: the difference between two images as a person sees who flips between them.
//!
//! ```text
//! linear RGB --> YCxCz --contrast sensitivity--> Hunt-adjusted L*a*b* --HyAB--> colour difference --+
//!         +--> achromatic --edges, points--> feature difference -------------------------------------+--> 0..1
//! ```
//!
//! Theory: Andersson et al. 2020, "FLIP: a difference evaluator for alternating images"; for light over 1 Andersson et
//! al. 2021, "Visualizing errors in rendered high dynamic range images": the largest difference over a range of
//! exposures.

use rayon::prelude::*;

use super::Pixels;

/// Pixels in a degree of vision: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643;

/// Sums of two Gaussians `a sqrt(pi / b) e^(-pi^2 x^2 / b)` (a, b), x in degrees: sensitivity to contrast of the
/// achromatic, red-green and blue-yellow channels.
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];
/// Exponents of colour and feature difference.
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
/// Colour differences up to this share of the largest one fill this share of the result.
const COLOR_KNEE: (f64, f64) = (0.4, 0.95);
/// Width of a feature, degrees.
const FEATURE_DEGREES: f64 = 0.082;
/// Linear Rec. 709 to XYZ.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// A plane of numbers.
type Plane = Vec<f64>;

fn xyz(rgb: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|j| XYZ[i][j] * rgb[j]).sum())
}

fn white() -> [f64; 3] {
    xyz([1.0; 3])
}

/// Linear RGB from relative XYZ by Cramer's rule.
fn rgb_from_xyz(v: [f64; 3]) -> [f64; 3] {
    let m = glam::DMat3::from_cols_array_2d(&XYZ).transpose();
    (m.inverse() * glam::DVec3::from_array(v)).to_array()
}

fn ycxcz(rgb: [f64; 3]) -> [f64; 3] {
    let (v, w) = (xyz(rgb), white());
    let [x, y, z] = [v[0] / w[0], v[1] / w[1], v[2] / w[2]];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_ycxcz(c: [f64; 3]) -> [f64; 3] {
    let w = white();
    let y = (c[0] + 16.0) / 116.0;
    rgb_from_xyz([(y + c[1] / 500.0) * w[0], y * w[1], (y - c[2] / 200.0) * w[2]])
}

/// CIE L*a*b* with chroma scaled by lightness (Hunt 1952).
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    let (v, w) = (xyz(rgb), white());
    let f = |t: f64| {
        let d: f64 = 6.0 / 29.0;
        if t > d.powi(3) { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let [x, y, z] = [f(v[0] / w[0]), f(v[1] / w[1]), f(v[2] / w[2])];
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// City block in lightness, Euclidean in chroma (Abasi, Tehran and Fairchild 2020).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// A separable filter with repeated borders.
fn filter(plane: &[f64], width: usize, across: &[f64], down: &[f64]) -> Plane {
    let height = plane.len() / width;
    let sum = |kernel: &[f64], last: usize, at: usize, get: &dyn Fn(usize) -> f64| {
        let radius = kernel.len() / 2;
        let tap = |(k, w): (usize, &f64)| w * get((at + k).saturating_sub(radius).min(last));
        kernel.iter().enumerate().map(tap).sum::<f64>()
    };
    let rows: Plane = plane
        .par_chunks(width)
        .flat_map_iter(|row| (0..width).map(move |x| sum(across, width - 1, x, &|i| row[i])))
        .collect();
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let rows = &rows;
            (0..width).map(move |x| sum(down, height - 1, y, &|i| rows[i * width + x]))
        })
        .collect()
}

fn planes(pixels: &[[f64; 3]]) -> [Plane; 3] {
    std::array::from_fn(|c| pixels.iter().map(|p| p[c]).collect())
}

/// Detail that an eye at this distance can resolve, as Hunt-adjusted L*a*b*.
fn perceived(opponent: &[[f64; 3]], width: usize, pixels_per_degree: f64) -> Vec<[f64; 3]> {
    let widest = SENSITIVITY.iter().flatten().fold(0.0f64, |m, t| m.max(t.1));
    let radius =
        (3.0 * (widest / (2.0 * std::f64::consts::PI.powi(2))).sqrt() * pixels_per_degree).ceil() as i64;
    let filtered: Vec<Plane> = planes(opponent)
        .iter()
        .zip(SENSITIVITY)
        .map(|(plane, terms)| {
            let mut result = vec![0.0; plane.len()];
            let mut total = 0.0;
            for (a, b) in terms.into_iter().filter(|t| t.0 > 0.0) {
                let line: Vec<f64> = (-radius..=radius)
                    .map(|i| (-(std::f64::consts::PI * i as f64 / pixels_per_degree).powi(2) / b).exp())
                    .collect();
                let scale = a * (std::f64::consts::PI / b).sqrt();
                total += scale * line.iter().sum::<f64>().powi(2);
                for (r, v) in result.iter_mut().zip(filter(plane, width, &line, &line)) {
                    *r += scale * v;
                }
            }
            result.iter_mut().for_each(|v| *v /= total);
            result
        })
        .collect();
    (0..opponent.len())
        .map(|i| {
            let rgb = rgb_from_ycxcz([filtered[0][i], filtered[1][i], filtered[2][i]]);
            hunt_lab(rgb.map(|v| v.clamp(0.0, 1.0)))
        })
        .collect()
}

/// Strength of edges and of points in the achromatic channel.
fn features(opponent: &[[f64; 3]], width: usize, pixels_per_degree: f64) -> [Plane; 2] {
    let gray: Plane = opponent.iter().map(|p| (p[0] + 16.0) / 116.0).collect();
    let deviation = 0.5 * FEATURE_DEGREES * pixels_per_degree;
    let radius = (3.0 * deviation).ceil() as i64;
    let sample = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (-radius..=radius).map(|i| f(i as f64)).collect() };
    let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let smooth = sample(&bell);
    let smooth_sum: f64 = smooth.iter().sum();
    let smooth: Vec<f64> = smooth.iter().map(|v| v / smooth_sum).collect();
    // Positive weights sum to one and negative ones to minus one.
    let balanced = |kernel: Vec<f64>| -> Vec<f64> {
        let positive: f64 = kernel.iter().filter(|v| **v > 0.0).sum();
        let negative: f64 = -kernel.iter().filter(|v| **v < 0.0).sum::<f64>();
        kernel.iter().map(|v| if *v > 0.0 { v / positive } else { v / negative }).collect()
    };
    let kernels = [
        balanced(sample(&|x| -x * bell(x))),
        balanced(sample(&|x| (x * x / (deviation * deviation) - 1.0) * bell(x))),
    ];
    kernels.map(|k| {
        let (x, y) = (filter(&gray, width, &k, &smooth), filter(&gray, width, &smooth, &k));
        x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
    })
}

/// FLIP of images with values 0 to 1 (others are clamped), 0 for no visible difference to 1, pixel by pixel.
///
/// # Panics
/// The images differ in size.
pub fn ldr(test: &Pixels, reference: &Pixels, pixels_per_degree: f64) -> Vec<f32> {
    assert_eq!((test.width, test.height), (reference.width, reference.height), "images of one size");
    if reference.linear.is_empty() {
        return Vec::new();
    }
    let opponent = |p: &Pixels| -> Vec<[f64; 3]> {
        p.linear.par_iter().map(|c| ycxcz(c.map(|v| f64::from(v).clamp(0.0, 1.0)))).collect()
    };
    let (t, r) = (opponent(test), opponent(reference));
    let width = reference.width;
    let [seen_t, seen_r] = [&t, &r].map(|o| perceived(o, width, pixels_per_degree));
    let [found_t, found_r] = [&t, &r].map(|o| features(o, width, pixels_per_degree));
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = COLOR_KNEE.0 * largest;
    (0..t.len())
        .map(|i| {
            let d = hyab(seen_t[i], seen_r[i]).powf(COLOR_EXPONENT);
            let color = if d < knee {
                COLOR_KNEE.1 * d / knee
            } else {
                COLOR_KNEE.1 + (d - knee) / (largest - knee) * (1.0 - COLOR_KNEE.1)
            };
            let change = |f: usize| (found_t[f][i] - found_r[f][i]).abs();
            let feature = (change(0).max(change(1)) / 2f64.sqrt()).clamp(0.0, 1.0).powf(FEATURE_EXPONENT);
            color.clamp(0.0, 1.0).powf(1.0 - feature) as f32
        })
        .collect()
}

/// The ACES curve of Narkowicz 2015 with 0.6 before it, numerator and denominator by falling power.
const ACES: [f64; 6] = [0.9036, 0.018, 0.0, 0.8748, 0.354, 0.14];
/// Display value that the brightest and the median pixel are exposed to.
const EXPOSED: f64 = 0.85;

/// Exposures (stops) at which a reference is looked at: from its brightest pixel to its median one.
pub fn exposures(reference: &Pixels) -> Vec<f64> {
    let [a, b, c, d, e, f] = ACES;
    let (qa, qb, qc) = (a - EXPOSED * d, b - EXPOSED * e, c - EXPOSED * f);
    let x = (-qb + (qb * qb - 4.0 * qa * qc).sqrt()) / (2.0 * qa);
    let x = x.max((-qb - (qb * qb - 4.0 * qa * qc).sqrt()) / (2.0 * qa));
    let mut luminance: Vec<f64> =
        reference.linear.iter().map(|p| xyz(p.map(f64::from))[1].max(0.0)).collect();
    luminance.sort_by(f64::total_cmp);
    let at = |i: usize| luminance.get(i).copied().unwrap_or(1.0).max(1e-5);
    let (median, most) = (at(luminance.len() / 2), at(luminance.len().saturating_sub(1)));
    let (start, stop) = ((x / most).log2(), (x / median).log2());
    let count = ((stop - start).ceil() as usize).max(2);
    (0..count).map(|i| start + (stop - start) * i as f64 / (count - 1) as f64).collect()
}

/// FLIP of images of any radiance: the largest of [`ldr`] over [`exposures`] of the reference.
///
/// # Panics
/// The images differ in size.
pub fn hdr(test: &Pixels, reference: &Pixels, pixels_per_degree: f64) -> Vec<f32> {
    let mut result = vec![0.0f32; reference.linear.len()];
    for stops in exposures(reference) {
        let exposed = |p: &Pixels| Pixels {
            linear: p
                .linear
                .iter()
                .map(|c| {
                    c.map(|v| {
                        let x = f64::from(v).max(0.0) * stops.exp2();
                        let [a, b, c, d, e, f] = ACES;
                        ((a * x * x + b * x + c) / (d * x * x + e * x + f)).clamp(0.0, 1.0) as f32
                    })
                })
                .collect(),
            ..*p
        };
        for (r, v) in result.iter_mut().zip(ldr(&exposed(test), &exposed(reference), pixels_per_degree)) {
            *r = r.max(v);
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(f: impl Fn(usize, usize) -> [f32; 3]) -> Pixels {
        Pixels { width: 27, height: 51, linear: (0..27 * 51).map(|i| f(i % 27, i / 27)).collect() }
    }

    fn pattern(shift: f32) -> Pixels {
        image(|x, y| {
            let v = ((x * 7 + y * 13) % 23) as f32 / 22.0;
            [v, (v + shift).fract(), 1.0 - v]
        })
    }

    #[test]
    fn equal_images_have_no_difference_and_opposites_the_largest() {
        let p = pattern(0.2);
        assert!(ldr(&p, &p, PIXELS_PER_DEGREE).iter().all(|v| *v == 0.0));
        assert!(hdr(&p, &p, PIXELS_PER_DEGREE).iter().all(|v| *v == 0.0));
        let (green, blue) = (image(|_, _| [0.0, 1.0, 0.0]), image(|_, _| [0.0, 0.0, 1.0]));
        assert!(ldr(&green, &blue, PIXELS_PER_DEGREE).iter().all(|v| (*v - 1.0).abs() < 1e-6));
    }

    #[test]
    fn it_does_not_matter_which_is_the_reference() {
        let (a, b) = (pattern(0.2), pattern(0.5));
        let (ab, ba) = (ldr(&a, &b, PIXELS_PER_DEGREE), ldr(&b, &a, PIXELS_PER_DEGREE));
        assert!(ab.iter().zip(&ba).all(|(x, y)| (x - y).abs() < 1e-6 && (0.0..=1.0).contains(x)));
        assert!(ab.iter().any(|v| *v > 0.1));
    }

    #[test]
    fn colours_convert_and_return() {
        for rgb in [[0.2, 0.5, 0.9], [1.0, 1.0, 1.0], [0.0, 0.3, 0.0]] {
            let back = rgb_from_ycxcz(ycxcz(rgb));
            assert!((0..3).all(|c| (back[c] - rgb[c]).abs() < 1e-9), "{back:?}");
        }
        let lab = hunt_lab([1.0; 3]);
        assert!((lab[0] - 100.0).abs() < 1e-9 && lab[1].abs() < 1e-9 && lab[2].abs() < 1e-9);
    }

    #[test]
    fn exposures_reach_from_the_brightest_to_the_median() {
        let p = image(|x, y| if x == 3 && y == 4 { [64.0; 3] } else { [0.5; 3] });
        let stops = exposures(&p);
        assert_eq!(stops.len(), 7);
        assert!((stops[6] - stops[0] - 7.0).abs() < 1e-9);
    }
}
