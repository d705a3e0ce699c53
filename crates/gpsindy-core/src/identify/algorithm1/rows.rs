//! Lines 4 to 6 of Algorithm 1: the rows of the regression, one set per state, in units of their noise.
//!
//! The weak form uses the states themselves: `x(t) = x(t0) + (integral of Theta from t0 to t) xi`. Its errors are those of
//! the sensor, hence independent and of known size, and nothing is differentiated. `x(t0)` of each stretch is free.
//!
//! Source: Dattner and Klaassen 2015, Optimal rate of direct estimators in systems of ordinary differential equations
//! linear in functions of the parameters; Schaeffer and McCalla 2017 (integral form of SINDy).

use crate::differentiate::{Derivatives, Differentiation};
use crate::error::{Error, Result};
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::algorithm1::track::Track;
use crate::identify::limits::{FEWEST, SURE};
use crate::identify::prepare::{Logs, mean_period};
use crate::identify::settings::{Identify, Target};
use crate::library::Library;
use crate::refine::Hold;
use crate::regress::Whitening;
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

/// Rows of the regression of every state whose equation is not given, the controls late by `delays` (s, one a control).
pub(crate) fn rows(
    settings: &Identify,
    logs: &Logs,
    motion: &Motion,
    hold: Hold,
    delays: &[f64],
) -> Result<Vec<Option<Rows>>> {
    let (frame, n) = (&logs.frame, logs.n_states());
    let library = &frame.library;
    let mut builders: Vec<Builder> = (0..n).map(|_| Builder::new(library.n_terms())).collect();
    let weak = matches!(settings.target, Target::Weak);
    let logged = !matches!(settings.target, Target::Derivative(ref d) if !matches!(d, Differentiation::Given(_)));
    let any_rate = logs.rates.iter().any(Option::is_some);
    for (index, track) in motion.tracks.iter().enumerate() {
        // Twice the shortest rollouts: a stretch has one free start, and is held out as a whole.
        let length = (2.0 * motion.shortest_window() / mean_period(&track.time)).round() as usize;
        let parts = stretches(track.n_samples(), length);
        let sums = if weak { Some(integrals(track, library, hold, delays)?) } else { None };
        let terms = if weak && !any_rate {
            None
        } else {
            Some(library.evaluate(track.samples(hold, delays).as_ref(), &track.time)?)
        };
        for (s, builder) in builders.iter_mut().enumerate().filter(|(s, _)| frame.fixed[*s].is_none()) {
            for &part in &parts {
                if let Some(sums) = &sums {
                    builder.weak(track.raw.col_as_slice(s), sums, part, motion.noise[s]);
                }
                if let (Some(column), true, Some(terms)) = (logs.rates[s], logged, &terms) {
                    let noise = motion.noise[column - frame.controls.len()];
                    builder.derivative(track.given.col_as_slice(s), terms, part, noise);
                }
            }
            if let (Some(derived), Some(terms)) = (&motion.derivatives, &terms) {
                pointwise(builder, derived, (index, s), terms, &parts)?;
            }
        }
    }
    let finish = |(s, builder): (usize, Builder)| match frame.fixed[s] {
        Some(_) => Ok(None),
        None => builder.finish(&frame.states[s].0).map(Some),
    };
    builders.into_iter().enumerate().map(finish).collect()
}

/// Integral of every term from the first sample to each (r x p).
fn integrals(track: &Track, library: &Library, hold: Hold, delays: &[f64]) -> Result<Mat<f64>> {
    let (r, p) = (track.n_samples(), library.n_terms());
    let steps = simpson(track, library, hold, delays, 0)?;
    let mut sums = Mat::zeros(r, p);
    for j in 0..p {
        for i in 1..r {
            sums[(i, j)] = sums[(i - 1, j)] + steps[(i - 1, j)];
        }
    }
    Ok(sums)
}

/// Weight of the middle in Simpson's rule, whose ends weigh 1. Exact.
pub(crate) const MIDDLE: f64 = 4.0;

/// Sum of the weights of Simpson's rule. Exact.
pub(crate) const WEIGHTS: f64 = 6.0;

/// Integral of every term over each step between samples from sample `first` on, by Simpson's rule on the smoothed path.
pub(crate) fn simpson(track: &Track, library: &Library, hold: Hold, delays: &[f64], first: usize) -> Result<Mat<f64>> {
    let time = &track.time[first..];
    let count = time.len().saturating_sub(1);
    let middle: Vec<f64> = time.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let times = [&time[..count], &middle, &time[1.min(time.len())..]];
    let mut values = Vec::with_capacity(3);
    for (part, time) in track.steps(hold, delays).iter().zip(times) {
        values.push(library.evaluate(part.subrows(first, count), time)?);
    }
    Ok(Mat::from_fn(count, library.n_terms(), |i, j| {
        let h = time[i + 1] - time[i];
        h / WEIGHTS * (values[0][(i, j)] + MIDDLE * values[1][(i, j)] + values[2][(i, j)])
    }))
}

/// Collects rows stretch by stretch.
struct Builder {
    n_terms: usize,
    theta: Vec<f64>,
    target: Vec<f64>,
    lengths: Vec<usize>,
}

impl Builder {
    fn new(n_terms: usize) -> Self {
        Self { n_terms, theta: Vec::new(), target: Vec::new(), lengths: Vec::new() }
    }

    /// The weak form of `values` (r, NaN is missing) on the samples `first..end`, `integrals` as of [`integrals`].
    ///
    /// The free start of the stretch is eliminated: means are taken off both sides.
    fn weak(&mut self, values: &[f64], integrals: &Mat<f64>, (first, end): (usize, usize), noise: f64) {
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
    fn derivative(&mut self, values: &[f64], terms: &Mat<f64>, (first, end): (usize, usize), noise: f64) {
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
    fn whitened(&mut self, theta: &Mat<f64>, target: &[f64]) {
        for (i, &value) in target.iter().enumerate() {
            self.theta.extend((0..self.n_terms).map(|j| theta[(i, j)]));
            self.target.push(value);
        }
        self.lengths.push(target.len());
    }

    fn finish(self, state: &str) -> Result<Rows> {
        let (rows, p) = (self.target.len(), self.n_terms);
        if rows < FEWEST {
            let what = format!("regression of state `{state}`");
            return Err(Error::TooFewSamples { what, needed: FEWEST, found: rows });
        }
        let theta = Mat::from_fn(rows, p, |i, j| self.theta[i * p + j]);
        Ok(Rows { theta, target: self.target, lengths: self.lengths })
    }
}

/// Rows from derivatives at the samples; whitened by their covariance where there is one.
fn pointwise(
    builder: &mut Builder,
    derived: &Derivatives,
    (run, state): (usize, usize),
    terms: &Mat<f64>,
    parts: &[(usize, usize)],
) -> Result<()> {
    let derivatives = &derived.runs[run];
    let values = derivatives.dx.col_as_slice(state);
    for &(first, end) in parts {
        match derivatives.covariance.get(state) {
            Some(covariance) => {
                let size = end - first;
                let mean = (first..end).map(|i| covariance[(i, i)]).sum::<f64>() / size as f64;
                let part = Mat::from_fn(size, size, |i, j| {
                    covariance[(first + i, first + j)] + if i == j { SURE * mean } else { 0.0 }
                });
                let whitening = Whitening::from_covariance(&part)?;
                let mut theta = Mat::from_fn(size, terms.ncols(), |i, j| terms[(first + i, j)]);
                let mut target = values[first..end].to_vec();
                whitening.apply(&mut theta);
                whitening.apply_column(&mut target);
                builder.whitened(&theta, &target);
            }
            None => builder.derivative(values, terms, (first, end), 1.0),
        }
    }
    Ok(())
}

/// Cuts `n` samples into stretches of about `length`.
fn stretches(n: usize, length: usize) -> Vec<(usize, usize)> {
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
            time: time.clone(),
        }
    }

    #[test]
    fn the_weak_form_gives_the_coefficients_of_a_known_system() {
        let track = decay();
        let settings = LibrarySettings { degree: 1, ..LibrarySettings::default() };
        let library = Library::new(&["x"], &["u"], &settings).unwrap();
        let sums = integrals(&track, &library, Hold::Zero, &[0.0]).unwrap();
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
