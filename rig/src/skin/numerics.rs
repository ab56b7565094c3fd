//! Quadrature, special functions and root finding, in f64.

use std::f64::consts::PI;

/// Abscissae and weights of Gauss-Legendre quadrature on [-1, 1], by Newton's method on the Legendre recurrence.
pub(crate) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut derivative = 1.0;
            for _ in 0..100 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                derivative = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                let step = p1 / derivative;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * derivative * derivative))
        })
        .collect()
}

/// Integral of `f` from `a` to `b` with the given Gauss-Legendre rule.
pub(crate) fn integrate(rule: &[(f64, f64)], a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (mid, half) = (0.5 * (a + b), 0.5 * (b - a));
    rule.iter().map(|&(x, w)| w * f(mid + half * x)).sum::<f64>() * half
}

/// Error function; the absolute error is below 1e-14.
///
/// Maclaurin series for small arguments, Laplace's continued fraction of erfc beyond.
pub(crate) fn erf(x: f64) -> f64 {
    let a = x.abs();
    if a < 2.5 {
        let (mut term, mut sum, mut n) = (a, a, 0.0);
        while term.abs() > 1e-17 * sum {
            n += 1.0;
            term *= -a * a / n;
            sum += term / (2.0 * n + 1.0);
            if n > 200.0 {
                break;
            }
        }
        (sum * 2.0 / PI.sqrt()).copysign(x)
    } else if a < 6.5 {
        let mut fraction = a;
        for k in (1..=80).rev() {
            fraction = a + 0.5 * k as f64 / fraction;
        }
        (1.0 - (-a * a).exp() / (PI.sqrt() * fraction)).copysign(x)
    } else {
        1f64.copysign(x)
    }
}

/// The radius where a non-decreasing `cdf` (0 at 0, 1 at infinity) passes `u`, by bracketing and bisection.
///
/// `scale` is a typical radius. `u` at or above what `cdf` reaches gives infinity.
pub(crate) fn invert_cdf(u: f64, scale: f64, cdf: impl Fn(f64) -> f64) -> f64 {
    if u.is_nan() || u <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, scale);
    while cdf(high) < u {
        low = high;
        high *= 2.0;
        if high > 1e12 * scale {
            return f64::INFINITY;
        }
    }
    // 80 halvings reach the last bit even when the root is far below `scale`.
    for _ in 0..80 {
        let mid = 0.5 * (low + high);
        if mid <= low || mid >= high {
            break;
        }
        if cdf(mid) < u {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        let rule = gauss_legendre(8);
        let value = integrate(&rule, 1.0, 3.0, |x| x.powi(15));
        assert!((value - (3f64.powi(16) - 1.0) / 16.0).abs() < 1e-7 * value);
    }

    #[test]
    fn erf_matches_published_values() {
        // Abramowitz and Stegun 1964, table 7.1 and 7.3.
        for (x, y) in [(0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650), (3.0, 0.9999779095)] {
            assert!((erf(x) - y).abs() < 1e-10, "{x}");
            assert_eq!(erf(-x), -erf(x));
        }
        assert!((erf(2.5 - 1e-12) - erf(2.5 + 1e-12)).abs() < 1e-13);
        assert_eq!(erf(40.0), 1.0);
    }

    #[test]
    fn inverse_of_a_known_cdf() {
        let r = invert_cdf(0.3, 1.0, |r| 1.0 - (-r).exp());
        assert!((r + 0.7f64.ln()).abs() < 1e-12);
        assert_eq!(invert_cdf(0.0, 1.0, |_| 0.0), 0.0);
        assert_eq!(invert_cdf(0.5, 1.0, |_| 0.1), f64::INFINITY);
    }
}
