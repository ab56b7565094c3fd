//! Quadrature, special functions and root finding, in f64.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

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

/// Least squares with bounds: minimises the squared norm of `residual` from `start` (Levenberg 1944, Marquardt 1963).
///
/// Derivatives are central differences of `step`; a parameter that would leave its bounds stops there.
pub(crate) fn levenberg_marquardt(
    residual: impl Fn(&[f64]) -> DVector<f64>,
    start: &[f64],
    bounds: &[(f64, f64)],
    step: f64,
) -> (Vec<f64>, f64) {
    let clamp = |x: Vec<f64>| -> Vec<f64> {
        x.iter().zip(bounds).map(|(x, &(low, high))| x.clamp(low, high)).collect()
    };
    let mut x = clamp(start.to_vec());
    let mut r = residual(&x);
    let mut cost = r.norm_squared();
    let mut damping = 1e-3;
    for _ in 0..60 {
        let mut jacobian = DMatrix::zeros(r.len(), x.len());
        for k in 0..x.len() {
            let (mut ahead, mut behind) = (x.clone(), x.clone());
            ahead[k] += step;
            behind[k] -= step;
            jacobian.set_column(k, &((residual(&ahead) - residual(&behind)) / (2.0 * step)));
        }
        let gradient = jacobian.tr_mul(&r);
        let normal = jacobian.tr_mul(&jacobian);
        let mut improved = 0.0;
        for _ in 0..12 {
            let mut damped = normal.clone();
            for k in 0..x.len() {
                damped[(k, k)] += damping * normal[(k, k)].max(1e-12 * cost.max(1e-30));
            }
            let Some(factor) = damped.cholesky() else {
                damping *= 4.0;
                continue;
            };
            let move_by = factor.solve(&gradient);
            let trial = clamp(x.iter().zip(move_by.iter()).map(|(x, d)| x - d).collect());
            let trial_r = residual(&trial);
            let trial_cost = trial_r.norm_squared();
            if trial_cost < cost {
                improved = (cost - trial_cost) / cost;
                (x, r, cost) = (trial, trial_r, trial_cost);
                damping = (damping * 0.3).max(1e-12);
                break;
            }
            damping *= 4.0;
        }
        if improved < 1e-9 {
            break;
        }
    }
    (x, cost)
}

/// The `x >= 0` that minimises `|A x - b|` (Lawson and Hanson 1974), from `A^T A` and `A^T b`.
pub(crate) fn non_negative_least_squares(normal: &DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    let n = right.len();
    let mut x = DVector::zeros(n);
    let mut free = vec![false; n];
    let tolerance = 1e-12 * right.amax();
    // Each round frees one column; more than three rounds per column mean a cycle caused by rounding.
    for _ in 0..3 * n {
        let gradient = right - normal * &x;
        let candidate = (0..n).filter(|&i| !free[i]).max_by(|&a, &b| gradient[a].total_cmp(&gradient[b]));
        match candidate {
            Some(i) if gradient[i] > tolerance => free[i] = true,
            _ => break,
        }
        loop {
            let set: Vec<usize> = (0..n).filter(|&i| free[i]).collect();
            let mut sub = DMatrix::from_fn(set.len(), set.len(), |a, b| normal[(set[a], set[b])]);
            for a in 0..set.len() {
                sub[(a, a)] *= 1.0 + 1e-13;
            }
            let rhs = DVector::from_fn(set.len(), |a, _| right[set[a]]);
            let Some(solution) = sub.lu().solve(&rhs) else { return x };
            if solution.iter().all(|&s| s > 0.0) {
                x.fill(0.0);
                set.iter().zip(solution.iter()).for_each(|(&i, &s)| x[i] = s);
                break;
            }
            // Step to the first column that would turn negative and fix it at zero.
            let mut fraction = 1.0f64;
            for (&i, &s) in set.iter().zip(solution.iter()) {
                if s <= 0.0 {
                    fraction = fraction.min(x[i] / (x[i] - s));
                }
            }
            let fraction = if fraction.is_finite() { fraction } else { 0.0 };
            for (&i, &s) in set.iter().zip(solution.iter()) {
                x[i] += fraction * (s - x[i]);
                if s <= 0.0 && x[i] <= 1e-15 {
                    x[i] = 0.0;
                    free[i] = false;
                }
            }
            if set.iter().all(|&i| free[i]) {
                // Rounding kept every column: stop, or the loop would not end.
                return x;
            }
        }
    }
    x
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
    fn inverse_of_a_known_cdf() {
        let r = invert_cdf(0.3, 1.0, |r| 1.0 - (-r).exp());
        assert!((r + 0.7f64.ln()).abs() < 1e-12);
        assert_eq!(invert_cdf(0.0, 1.0, |_| 0.0), 0.0);
        assert_eq!(invert_cdf(0.5, 1.0, |_| 0.1), f64::INFINITY);
    }

    #[test]
    fn non_negative_solution_of_a_known_problem() {
        // Unconstrained it would be (2, -1).
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
        let b = DVector::from_row_slice(&[1.0, 2.0, -1.0]);
        let x = non_negative_least_squares(&a.tr_mul(&a), &a.tr_mul(&b));
        assert!((x[0] - 1.5).abs() < 1e-10 && x[1] == 0.0, "{x}");
    }

    #[test]
    fn rosenbrock_valley_is_followed_and_bounds_hold() {
        let residual = |x: &[f64]| DVector::from_row_slice(&[10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        let (x, cost) = levenberg_marquardt(residual, &[-1.2, 1.0], &[(-5.0, 5.0); 2], 1e-5);
        assert!(cost < 1e-12 && (x[0] - 1.0).abs() < 1e-5, "{x:?} {cost}");
        let (x, _) = levenberg_marquardt(residual, &[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)], 1e-5);
        assert!(x[0] <= 0.5);
    }
}
