//! The weak form: integrals of the equation against test functions that vanish at their ends, so
//! that no sample is ever differentiated.
//!
//! For `x' = Theta xi` and a test function psi of compact support, integration by parts gives
//! `int psi Theta dt xi = -int psi' x dt`. Here `psi = (1 - s^2)^degree`, `s = (t - centre)/half_width`.
//! Source: Messenger & Bortz 2021, Weak SINDy: Galerkin-based data-driven model selection.

use crate::error::{Error, Result};
use faer::Mat;

/// Test functions of a run.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `half_width` | `None`: 12 sample periods, at most a quarter of the run | above 0, s | half of the support |
/// | `degree` | 6 | 1 to 30 | exponent: how smoothly they vanish |
/// | `per_width` | 4 | at least 1 | centres in a half width |
#[derive(Debug, Clone, Copy)]
pub struct WeakForm {
    /// Half of the support of a test function, s.
    pub half_width: Option<f64>,
    /// Exponent of the test functions.
    pub degree: u32,
    /// Centres in a half width.
    pub per_width: usize,
}

impl Default for WeakForm {
    fn default() -> Self {
        Self { half_width: None, degree: 6, per_width: 4 }
    }
}

/// Matrices that turn sampled columns into integral rows.
#[derive(Debug, Clone)]
pub struct WeakRows {
    /// (K x r): `v * theta` are the regression rows.
    pub v: Mat<f64>,
    /// (K x r): `-dv * x` are the targets. With white noise of deviation s on x the targets have
    /// the covariance `s^2 dv dv'`.
    pub dv: Mat<f64>,
    /// Centre of each test function, s.
    pub centres: Vec<f64>,
    /// Half width used, s.
    pub half_width: f64,
}

impl WeakForm {
    /// The matrices for samples at `time` (s, increasing, none missing).
    ///
    /// On a uniform grid the integrals are trapezoidal sums, which are as accurate as the test
    /// functions are smooth; on others a cubic through the four nearest samples is integrated
    /// over each interval.
    ///
    /// # Errors
    /// Fewer than eight samples, a setting out of range.
    pub fn rows(&self, time: &[f64]) -> Result<WeakRows> {
        let n = time.len();
        if n < 8 {
            return Err(Error::TooFewSamples { what: "weak form of a run".into(), needed: 8, found: n });
        }
        if !(1..=30).contains(&self.degree) {
            return Err(Error::range("degree", "from 1 to 30", self.degree));
        }
        let span = time[n - 1] - time[0];
        let period = span / (n - 1) as f64;
        let half_width = self.half_width.unwrap_or((12.0 * period).min(0.25 * span));
        if !(half_width > 1.5 * period && 2.0 * half_width <= span * (1.0 + 1e-12)) {
            let range =
                format!("above {} s (1.5 sample periods) and at most {} s (half the run)", 1.5 * period, 0.5 * span);
            return Err(Error::range("half_width", &range, half_width));
        }
        let room = span - 2.0 * half_width;
        let count = (room / half_width * self.per_width.max(1) as f64).floor() as usize + 1;
        let spread = |k: usize| if count > 1 { room * k as f64 / (count - 1) as f64 } else { 0.5 * room };
        let centres: Vec<f64> = (0..count).map(|k| time[0] + half_width + spread(k)).collect();
        let uniform = time.iter().enumerate().all(|(i, t)| (t - time[0] - i as f64 * period).abs() < 1e-6 * period);
        let (mut v, mut dv) = (Mat::zeros(count, n), Mat::zeros(count, n));
        for (k, &centre) in centres.iter().enumerate() {
            let psi = |t: f64| self.test_function((t - centre) / half_width, half_width);
            if uniform {
                for i in 0..n {
                    let (value, slope) = psi(time[i]);
                    let weight = if i == 0 || i == n - 1 { 0.5 * period } else { period };
                    (v[(k, i)], dv[(k, i)]) = (weight * value, weight * slope);
                }
            } else {
                integrate_cubics(time, centre, half_width, |i, weight, t| {
                    let (value, slope) = psi(t);
                    v[(k, i)] += weight * value;
                    dv[(k, i)] += weight * slope;
                });
            }
        }
        Ok(WeakRows { v, dv, centres, half_width })
    }

    /// psi and its time derivative at the scaled time s.
    fn test_function(&self, s: f64, half_width: f64) -> (f64, f64) {
        let base = 1.0 - s * s;
        if base <= 0.0 {
            return (0.0, 0.0);
        }
        let power = base.powi(self.degree as i32 - 1);
        (power * base, -2.0 * f64::from(self.degree) * s * power / half_width)
    }
}

/// Abscissae and weights of Gauss-Legendre quadrature with five points on [-1, 1].
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// Calls `add(i, weight, t)` so that `sum weight x_i g(t)` is the integral of g times the local cubics through x.
fn integrate_cubics(time: &[f64], centre: f64, half_width: f64, mut add: impl FnMut(usize, f64, f64)) {
    let n = time.len();
    for l in 0..n - 1 {
        let (a, b) = (time[l].max(centre - half_width), time[l + 1].min(centre + half_width));
        if b <= a {
            continue;
        }
        let first = l.saturating_sub(1).min(n - 4);
        for (x, w) in GAUSS {
            let t = 0.5 * (a + b) + 0.5 * (b - a) * x;
            for i in first..first + 4 {
                let others = (first..first + 4).filter(|&j| j != i);
                let lagrange: f64 = others.map(|j| (t - time[j]) / (time[i] - time[j])).product();
                add(i, 0.5 * (b - a) * w * lagrange, t);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residual(time: &[f64]) -> f64 {
        let rows = WeakForm::default().rows(time).unwrap();
        // x = sin t solves x' = cos t.
        let worst = |k: usize| {
            let sum = |m: &Mat<f64>, f: fn(f64) -> f64| (0..time.len()).map(|i| m[(k, i)] * f(time[i])).sum::<f64>();
            (sum(&rows.v, f64::cos) + sum(&rows.dv, f64::sin)).abs() / rows.half_width
        };
        (0..rows.centres.len()).map(worst).fold(0.0, f64::max)
    }

    #[test]
    fn a_known_solution_fulfils_the_weak_form() {
        let uniform: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        // The test functions have six continuous derivatives at their ends: step^7 and a factor.
        assert!(residual(&uniform) < 1e-6, "{:e}", residual(&uniform));
        let irregular: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i) + 0.03 * (f64::from(i) * 1.7).sin()).collect();
        // Cubics: the fourth power of the step, 1e-4, over 24 and less by cancellation.
        assert!(residual(&irregular) < 1e-5, "{:e}", residual(&irregular));
    }

    #[test]
    fn a_width_that_does_not_fit_is_refused() {
        let time: Vec<f64> = (0..20).map(f64::from).collect();
        let error = WeakForm { half_width: Some(11.0), ..WeakForm::default() }.rows(&time).unwrap_err();
        assert!(error.to_string().contains("half_width"), "{error}");
    }
}
