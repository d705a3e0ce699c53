//! Rows of the regression, one set a state: what the library must explain, in units of its noise.
//!
//! The weak form compares the states themselves: `x(t) = x(t0) + (integral of Theta from t0 to t) xi`. Its errors are those of
//! the sensor, hence independent and of known size, and nothing is differentiated. `x(t0)` of each stretch is free.
//!
//! Source: Dattner and Klaassen 2015, Optimal rate of direct estimators in systems of ordinary differential equations
//! linear in functions of the parameters; Schaeffer and McCalla 2017 (integral form of SINDy).

use crate::error::{Error, Result};
use crate::identify::algorithm1::track::Track;
use crate::library::Library;
use faer::Mat;

/// Rows of one state's regression, whitened: errors of standard deviation 1, independent.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    /// (rows x p)
    pub(crate) theta: Mat<f64>,
    /// One value a row.
    pub(crate) target: Vec<f64>,
    /// Rows of each stretch of time, one after the other; a stretch is held out as a whole.
    pub(crate) lengths: Vec<usize>,
}

/// Integral of every term from the first sample to each (r x p), by Simpson's rule on the smoothed path.
pub(crate) fn integrals(track: &Track, library: &Library, delays: &[f64]) -> Result<Mat<f64>> {
    let (r, p) = (track.n_samples(), library.n_terms());
    let parts = track.steps(delays);
    let middle: Vec<f64> = track.time.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let times = [&track.time[..r.saturating_sub(1)], &middle, &track.time[1.min(r)..]];
    let mut values = Vec::with_capacity(3);
    for (part, time) in parts.iter().zip(times) {
        values.push(library.evaluate(part.as_ref(), time)?);
    }
    let mut sums = Mat::zeros(r, p);
    for j in 0..p {
        for i in 1..r {
            let h = track.time[i] - track.time[i - 1];
            let step = h / 6.0 * (values[0][(i - 1, j)] + 4.0 * values[1][(i - 1, j)] + values[2][(i - 1, j)]);
            sums[(i, j)] = sums[(i - 1, j)] + step;
        }
    }
    Ok(sums)
}

/// Collects rows stretch by stretch.
pub(crate) struct Builder {
    n_terms: usize,
    theta: Vec<f64>,
    target: Vec<f64>,
    lengths: Vec<usize>,
}

impl Builder {
    pub(crate) fn new(n_terms: usize) -> Self {
        Self { n_terms, theta: Vec::new(), target: Vec::new(), lengths: Vec::new() }
    }

    /// The weak form of `values` (r, NaN is missing) on the samples `first..end`, `integrals` as of [`integrals`].
    ///
    /// The free start of the stretch is eliminated: means are taken off both sides.
    pub(crate) fn weak(&mut self, values: &[f64], integrals: &Mat<f64>, (first, end): (usize, usize), noise: f64) {
        let there: Vec<usize> = (first..end).filter(|&i| values[i].is_finite()).collect();
        if there.len() < 2 {
            return;
        }
        let count = there.len() as f64;
        let mean: Vec<f64> =
            (0..self.n_terms).map(|j| there.iter().map(|&i| integrals[(i, j)]).sum::<f64>() / count).collect();
        let level = there.iter().map(|&i| values[i]).sum::<f64>() / count;
        for &i in &there {
            self.theta.extend(mean.iter().enumerate().map(|(j, m)| (integrals[(i, j)] - m) / noise));
            self.target.push((values[i] - level) / noise);
        }
        self.lengths.push(there.len());
    }

    /// Derivatives `values` (r, NaN is missing) on the samples `first..end`, `terms` (r x p) at the same samples.
    pub(crate) fn derivative(&mut self, values: &[f64], terms: &Mat<f64>, (first, end): (usize, usize), noise: f64) {
        let there: Vec<usize> = (first..end).filter(|&i| values[i].is_finite()).collect();
        for &i in &there {
            self.theta.extend((0..self.n_terms).map(|j| terms[(i, j)] / noise));
            self.target.push(values[i] / noise);
        }
        if !there.is_empty() {
            self.lengths.push(there.len());
        }
    }

    /// Rows already whitened.
    pub(crate) fn whitened(&mut self, theta: &Mat<f64>, target: &[f64]) {
        for (i, &value) in target.iter().enumerate() {
            self.theta.extend((0..self.n_terms).map(|j| theta[(i, j)]));
            self.target.push(value);
        }
        self.lengths.push(target.len());
    }

    pub(crate) fn finish(self, state: &str) -> Result<Rows> {
        let (rows, p) = (self.target.len(), self.n_terms);
        if rows < 4 {
            let what = format!("regression of state `{state}`");
            return Err(Error::TooFewSamples { what, needed: 4, found: rows });
        }
        let theta = Mat::from_fn(rows, p, |i, j| self.theta[i * p + j]);
        Ok(Rows { theta, target: self.target, lengths: self.lengths })
    }
}

/// Cuts `n` samples into stretches of about `length`.
pub(crate) fn stretches(n: usize, length: usize) -> Vec<(usize, usize)> {
    let count = (n as f64 / length.max(1) as f64).round().max(1.0) as usize;
    (0..count).map(|k| (k * n / count, (k + 1) * n / count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::LibrarySettings;
    use crate::regress::{LeastSquares, Regressor};

    /// x' = -0.5 x + u with u = 1 for t < 2, then -1, exact.
    fn decay() -> Track {
        let time: Vec<f64> = (0..41).map(|i| 0.1 * i as f64).collect();
        let x = |t: f64| {
            let early = |t: f64| 2.0 + (3.0 - 2.0) * (-0.5 * t).exp();
            if t <= 2.0 { early(t) } else { -2.0 + (early(2.0) + 2.0) * (-0.5 * (t - 2.0)).exp() }
        };
        let u = |t: f64| if t < 1.999 { 1.0 } else { -1.0 };
        let column = |f: &dyn Fn(f64) -> f64| Mat::from_fn(41, 1, |i, _| f(time[i]));
        Track {
            raw: column(&x),
            mean: column(&x),
            slope: column(&|t| -0.5 * x(t) + u(t)),
            given: column(&|_| f64::NAN),
            controls: column(&u),
            hold: crate::refine::Hold::Zero,
            time: time.clone(),
        }
    }

    #[test]
    fn the_weak_form_gives_the_coefficients_of_a_known_system() {
        let track = decay();
        let settings = LibrarySettings { degree: 1, ..LibrarySettings::default() };
        let library = Library::new(&["x"], &["u"], &settings).unwrap();
        let sums = integrals(&track, &library, &[0.0]).unwrap();
        let mut builder = Builder::new(3);
        for stretch in stretches(41, 20) {
            builder.weak(track.raw.col_as_slice(0), &sums, stretch, 0.01);
        }
        let rows = builder.finish("x").unwrap();
        assert_eq!(rows.lengths, [20, 21]);
        let fit = LeastSquares.fit(rows.theta.as_ref(), &rows.target).unwrap();
        // The step of u at t = 2 makes the slope there one-sided: an error of h^2/12 in one step.
        for (found, truth) in fit.coefficients.iter().zip([0.0, -0.5, 1.0]) {
            assert!((found - truth).abs() < 2e-3, "{:?}", fit.coefficients);
        }
    }

    #[test]
    fn stretches_cover_every_sample_once() {
        assert_eq!(stretches(9, 4), [(0, 4), (4, 9)]);
        let total: usize = stretches(103, 20).iter().map(|(a, b)| b - a).sum();
        assert_eq!(total, 103);
        assert_eq!(stretches(5, 100), [(0, 5)]);
    }
}
