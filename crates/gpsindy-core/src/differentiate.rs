//! Time derivatives of the states as the target of the regression: given columns, differences,
//! the derivative of the Gaussian process over time, or the paper's second Gaussian process from
//! smoothed states or controls to differences.

use crate::data::{Dataset, Run};
use crate::error::{Error, Result};
use crate::gp::{Conditioned, Fit, FitSettings, Kernel, Points, Quantity, Weakness, fit};
use crate::parallel;
use crate::progress::{Progress, step};
use crate::smooth::Smoothed;
use faer::Mat;

/// How the time derivative of each state is found.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Differentiation {
    /// The log carries the derivatives: one channel (index) a state.
    Given(Vec<usize>),
    /// Parabola through three neighbouring samples, any grid; one-sided at the ends of a run.
    Central,
    /// `(x[i+1] - x[i-1]) / (t[i+1] - t[i-1])`, as the paper's authors; the same as `Central` on a uniform grid.
    Slope,
    /// Derivative posterior of the Gaussian process over time; with its covariance where the smoother kept it.
    GpTime,
    /// The paper's second stage: a Gaussian process from the smoothed states to noisy derivatives,
    /// predicted at the smoothed states.
    GpState(SecondStage),
    /// The same from the controls.
    GpControl(SecondStage),
}

/// Settings of the paper's second stage.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `kernels` | `se`, `matern32`, `matern52`, `rq` | tried on every state; the lowest negative log marginal likelihood wins |
/// | `given` | `None` | channels that carry noisy derivatives, one a state; `None` takes slopes of the raw samples |
/// | `isotropic` | `false` | one length for all inputs instead of one each |
/// | `covariance` | `false` | whether the joint covariance at the samples of a run is kept |
/// | `dense_limit` | 2000 | samples of all runs together; of more, an even part of this many represents all |
#[derive(Debug, Clone)]
pub struct SecondStage {
    /// Kernels to try.
    pub kernels: Vec<Kernel>,
    /// Channels that carry noisy derivatives.
    pub given: Option<Vec<usize>>,
    /// One length for all inputs.
    pub isotropic: bool,
    /// Whether covariances are kept.
    pub covariance: bool,
    /// Samples of all runs together; of more, an even part of this many represents all.
    pub dense_limit: usize,
}

impl Default for SecondStage {
    fn default() -> Self {
        let kernels = vec![Kernel::SquaredExponential, Kernel::Matern32, Kernel::Matern52, Kernel::RationalQuadratic];
        Self {
            kernels,
            given: None,
            isotropic: false,
            covariance: false,
            dense_limit: FitSettings::default().dense_limit,
        }
    }
}

/// Derivatives of n states in all runs.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Derivatives {
    /// One entry a run, in the order of the dataset.
    pub runs: Vec<RunDerivatives>,
    /// Second-stage fit of each state; empty for the other methods.
    pub fits: Vec<Fit>,
}

/// Derivatives in one run of r samples.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RunDerivatives {
    /// (r x n), state unit per second; NaN where nothing can be said.
    pub dx: Mat<f64>,
    /// One (r x r) covariance a state; empty where the method has none or none was asked for.
    pub covariance: Vec<Mat<f64>>,
}

impl Differentiation {
    /// Derivatives of `states` (channel indices). `smoothed` holds those states in that order;
    /// the differences take the raw samples and need none.
    ///
    /// # Errors
    /// A missing smoothing or control where the method needs it, a number of channels that does
    /// not match the states; whatever the fit of the second stage says.
    pub fn differentiate(
        &self,
        data: &Dataset,
        states: &[usize],
        controls: &[usize],
        smoothed: Option<&Smoothed>,
        progress: &dyn Progress,
    ) -> Result<Derivatives> {
        check_channels(data, states.iter().chain(controls))?;
        match self {
            Self::Given(columns) => {
                check_given(data, columns, states)?;
                Ok(by_column(data, columns, |run, c| run.column(c).to_vec()))
            }
            Self::Central => Ok(by_column(data, states, |run, c| central(&run.time, run.column(c)))),
            Self::Slope => Ok(by_column(data, states, |run, c| slope(&run.time, run.column(c)))),
            Self::GpTime => Ok(gp_time(needed(smoothed, data, states, "gp-time")?)),
            Self::GpState(stage) => {
                let smoothed = needed(smoothed, data, states, "gp-state")?;
                let columns = |mean: &Mat<f64>| (0..mean.ncols()).map(|j| mean.col_as_slice(j).to_vec()).collect();
                let inputs: Vec<Vec<Vec<f64>>> = smoothed.runs.iter().map(|r| columns(&r.mean)).collect();
                stage.all_states(data, states, &inputs, progress)
            }
            Self::GpControl(stage) => {
                if controls.is_empty() {
                    return Err(Error::settings(
                        "derivatives from the controls need a control; name one or choose another method",
                    ));
                }
                let columns = |run: &Run| controls.iter().map(|&c| run.column(c).to_vec()).collect();
                let inputs: Vec<Vec<Vec<f64>>> = data.runs().iter().map(columns).collect();
                stage.all_states(data, states, &inputs, progress)
            }
        }
    }
}

impl SecondStage {
    fn all_states(
        &self,
        data: &Dataset,
        states: &[usize],
        inputs: &[Vec<Vec<f64>>],
        progress: &dyn Progress,
    ) -> Result<Derivatives> {
        if let Some(given) = &self.given {
            check_given(data, given, states)?;
        }
        let targets = |j: usize| -> Vec<Vec<f64>> {
            let of_run = |run: &Run| match &self.given {
                Some(given) => run.column(given[j]).to_vec(),
                None => slope(&run.time, run.column(states[j])),
            };
            data.runs().iter().map(of_run).collect()
        };
        let results = parallel::try_map(0..states.len(), |j| {
            let prediction = self.predict(inputs, &targets(j));
            step(progress, "differentiate", j + 1, states.len())?;
            prediction
        })?;
        let runs = (0..data.runs().len()).map(|r| RunDerivatives {
            dx: Mat::from_fn(data.runs()[r].n_samples(), states.len(), |i, j| results[j].runs[r].0[i]),
            covariance: if self.covariance {
                results.iter().filter_map(|p| p.runs[r].1.clone()).collect()
            } else {
                Vec::new()
            },
        });
        Ok(Derivatives { runs: runs.collect(), fits: results.into_iter().map(|p| p.fit).collect() })
    }

    /// One derivative: fits a process from `inputs` (runs, columns, samples) to `targets` (runs,
    /// samples) and predicts it at the inputs. For another choice of inputs per state than
    /// [`Differentiation`] offers.
    ///
    /// Samples with a missing input or target are left out of the fit; NaN is predicted where an input is missing.
    ///
    /// # Errors
    /// Sizes that differ, no complete sample, a covariance that stays indefinite.
    pub fn predict(&self, inputs: &[Vec<Vec<f64>>], targets: &[Vec<f64>]) -> Result<Prediction> {
        if inputs.len() != targets.len() {
            return Err(Error::shape("runs of the inputs", targets.len(), inputs.len()));
        }
        let points = inputs.iter().zip(targets).map(|(i, t)| complete(i, t)).collect::<Result<Vec<Points>>>()?;
        let pooled = pool(&points, self.dense_limit);
        let settings =
            FitSettings { isotropic: self.isotropic, dense_limit: self.dense_limit, ..FitSettings::default() };
        let mut fit = fit(&self.kernels, std::slice::from_ref(&pooled), &settings)?;
        if pooled.len() < points.iter().map(Points::len).sum() {
            fit.weak.push(Weakness::Thinned);
        }
        let process = Conditioned::new(&fit, &pooled)?;
        let runs = inputs.iter().map(|columns| predict_run(&process, columns, self.covariance));
        let runs = runs.collect::<Result<Vec<_>>>()?;
        Ok(Prediction { runs, fit })
    }
}

/// Derivative predicted by a second stage.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Mean and, where asked for, covariance at the samples of each run.
    pub runs: Vec<(Vec<f64>, Option<Mat<f64>>)>,
    /// The process.
    pub fit: Fit,
}

fn predict_run(process: &Conditioned, columns: &[Vec<f64>], covariance: bool) -> Result<(Vec<f64>, Option<Mat<f64>>)> {
    let n = columns.first().map_or(0, Vec::len);
    let rows: Vec<usize> = (0..n).filter(|&i| columns.iter().all(|c| c[i].is_finite())).collect();
    let at: Vec<Vec<f64>> = columns.iter().map(|c| rows.iter().map(|&i| c[i]).collect()).collect();
    let law = process.predict(&at, &[Quantity::Value], covariance)?;
    if rows.len() == n {
        return Ok((law.mean, law.covariance));
    }
    let mut mean = vec![f64::NAN; n];
    let mut full = covariance.then(|| Mat::from_fn(n, n, |_, _| f64::NAN));
    for (k, &i) in rows.iter().enumerate() {
        mean[i] = law.mean[k];
        if let (Some(full), Some(c)) = (&mut full, &law.covariance) {
            rows.iter().enumerate().for_each(|(l, &j)| full[(i, j)] = c[(k, l)]);
        }
    }
    Ok((mean, full))
}

fn complete(columns: &[Vec<f64>], targets: &[f64]) -> Result<Points> {
    if let Some(c) = columns.iter().find(|c| c.len() != targets.len()) {
        return Err(Error::shape("samples of an input", targets.len(), c.len()));
    }
    let rows: Vec<usize> =
        (0..targets.len()).filter(|&i| !targets[i].is_nan() && columns.iter().all(|c| !c[i].is_nan())).collect();
    Ok(Points {
        inputs: columns.iter().map(|c| rows.iter().map(|&i| c[i]).collect()).collect(),
        targets: rows.iter().map(|&i| targets[i]).collect(),
        noise_weights: Vec::new(),
    })
}

/// All runs as one, thinned evenly to `limit` points at most: the cost grows with their third power, and derivatives of
/// neighbouring samples say nearly the same.
fn pool(runs: &[Points], limit: usize) -> Points {
    let total: usize = runs.iter().map(Points::len).sum();
    let kept = total.min(limit.max(1));
    let rows: Vec<usize> = (0..kept).map(|k| (2 * k + 1) * total / (2 * kept)).collect();
    let pick = |column: Vec<f64>| rows.iter().map(|&i| column[i]).collect::<Vec<f64>>();
    let joined = |column: &dyn Fn(&Points) -> Vec<f64>| pick(runs.iter().flat_map(column).collect());
    Points {
        inputs: (0..runs.first().map_or(0, Points::dimension)).map(|d| joined(&|r| r.inputs[d].clone())).collect(),
        targets: joined(&|r| r.targets.clone()),
        noise_weights: Vec::new(),
    }
}

fn check_channels<'a>(data: &Dataset, mut channels: impl Iterator<Item = &'a usize>) -> Result<()> {
    let n = data.channels().len();
    channels.find(|c| **c >= n).map_or(Ok(()), |c| Err(Error::range("channel", &format!("below {n}"), c)))
}

fn check_given(data: &Dataset, columns: &[usize], states: &[usize]) -> Result<()> {
    if columns.len() != states.len() {
        return Err(Error::shape("derivative columns", format!("{}, one a state", states.len()), columns.len()));
    }
    check_channels(data, columns.iter())
}

fn needed<'a>(smoothed: Option<&'a Smoothed>, data: &Dataset, states: &[usize], method: &str) -> Result<&'a Smoothed> {
    let Some(smoothed) = smoothed else {
        return Err(Error::settings(format!("derivatives by `{method}` need smoothed states; switch the smoother on")));
    };
    let size = (smoothed.runs.len(), smoothed.channels.len());
    if size != (data.runs().len(), states.len()) {
        let words = |(r, c): (usize, usize)| format!("{r} runs x {c} states");
        return Err(Error::shape("smoothed states", words((data.runs().len(), states.len())), words(size)));
    }
    Ok(smoothed)
}

fn gp_time(smoothed: &Smoothed) -> Derivatives {
    let run = |r: &crate::SmoothedRun| RunDerivatives {
        dx: r.derivative.clone(),
        covariance: r.derivative_covariance.clone(),
    };
    Derivatives { runs: smoothed.runs.iter().map(run).collect(), fits: Vec::new() }
}

fn by_column(data: &Dataset, columns: &[usize], derivative: impl Fn(&Run, usize) -> Vec<f64>) -> Derivatives {
    let of_run = |run: &Run| {
        let all: Vec<Vec<f64>> = columns.iter().map(|&c| derivative(run, c)).collect();
        let dx = Mat::from_fn(run.n_samples(), columns.len(), |i, j| all[j][i]);
        RunDerivatives { dx, covariance: Vec::new() }
    };
    Derivatives { runs: data.runs().iter().map(of_run).collect(), fits: Vec::new() }
}

/// Nearest samples before and after i that are not missing.
fn neighbours(x: &[f64], i: usize) -> (Option<usize>, Option<usize>) {
    let there = |k: &usize| !x[*k].is_nan();
    ((0..i).rev().find(there), (i + 1..x.len()).find(there))
}

/// `(x[i+1] - x[i-1]) / (t[i+1] - t[i-1])`, one-sided at the ends; missing samples are stepped
/// over; NaN where there are not two samples.
pub fn slope(time: &[f64], x: &[f64]) -> Vec<f64> {
    let over = |a: usize, b: usize| (x[b] - x[a]) / (time[b] - time[a]);
    let at = |i: usize| match neighbours(x, i) {
        (Some(a), Some(b)) => over(a, b),
        (Some(a), None) if !x[i].is_nan() => over(a, i),
        (None, Some(b)) if !x[i].is_nan() => over(i, b),
        _ => f64::NAN,
    };
    (0..x.len()).map(at).collect()
}

/// Slope of the parabola through a sample and its neighbours; elsewhere as [`slope`].
pub fn central(time: &[f64], x: &[f64]) -> Vec<f64> {
    let mut dx = slope(time, x);
    for (i, d) in dx.iter_mut().enumerate() {
        if let (Some(a), Some(b), false) = (neighbours(x, i).0, neighbours(x, i).1, x[i].is_nan()) {
            let (before, after) = (time[i] - time[a], time[b] - time[i]);
            let (left, right) = ((x[i] - x[a]) / before, (x[b] - x[i]) / after);
            *d = (left * after + right * before) / (before + after);
        }
    }
    dx
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Silent, Smoother};

    /// x' = v, v' = -x with a control u = v' as the third channel.
    fn circle(n: usize) -> Dataset {
        let time: Vec<f64> = (0..n).map(|i| 0.05 * i as f64).collect();
        let values = Mat::from_fn(n, 3, |i, j| [time[i].sin(), time[i].cos(), -time[i].sin()][j]);
        let channels = ["x", "v", "u"].map(Channel::new).to_vec();
        Dataset::new(channels, vec![Run { name: "a".into(), time, values }]).unwrap()
    }

    #[test]
    fn a_parabola_is_differentiated_exactly_on_any_grid() {
        let time = [0.0, 0.1, 0.4, 0.45, 1.0];
        let x: Vec<f64> = time.iter().map(|t| 3.0 * t * t - t).collect();
        let dx = central(&time, &x);
        for i in 1..4 {
            assert!((dx[i] - (6.0 * time[i] - 1.0)).abs() < 1e-13);
        }
        assert!((dx[0] - (x[1] - x[0]) / 0.1).abs() < 1e-13);
    }

    #[test]
    fn missing_samples_are_stepped_over() {
        let dx = slope(&[0.0, 1.0, 2.0, 3.0], &[0.0, f64::NAN, 4.0, 6.0]);
        assert_eq!(dx, [2.0, 2.0, 2.0, 2.0]);
        assert!(slope(&[0.0, 1.0], &[1.0, f64::NAN])[0].is_nan());
    }

    #[test]
    fn every_method_finds_the_derivative_of_a_circle() {
        let data = circle(120);
        let smoothed = Smoother { covariance: true, ..Smoother::default() }.smooth(&data, &[0, 1], &Silent).unwrap();
        let methods = [
            (Differentiation::Given(vec![1, 2]), 1e-15),
            // Third derivative over 6 times the step squared; at the ends half a step.
            (Differentiation::Central, 0.026),
            (Differentiation::Slope, 0.026),
            (Differentiation::GpTime, 1e-3),
            (Differentiation::GpState(SecondStage { covariance: true, ..SecondStage::default() }), 0.03),
        ];
        for (method, tolerance) in methods {
            let out = method.differentiate(&data, &[0, 1], &[2], Some(&smoothed), &Silent).unwrap();
            for i in 0..120 {
                let error = (out.runs[0].dx[(i, 1)] - data.runs()[0].column(2)[i]).abs();
                assert!(error < tolerance, "{method:?}: {error} at {i}");
            }
        }
        let thinned = SecondStage { dense_limit: 50, ..SecondStage::default() };
        let out =
            Differentiation::GpState(thinned).differentiate(&data, &[0, 1], &[2], Some(&smoothed), &Silent).unwrap();
        assert!((0..120).all(|i| (out.runs[0].dx[(i, 1)] - data.runs()[0].column(2)[i]).abs() < 0.03));
        assert!(out.fits.iter().all(|fit| fit.weak.contains(&Weakness::Thinned)));
        let stage = Differentiation::GpControl(SecondStage::default());
        let out = stage.differentiate(&data, &[1], &[2], None, &Silent).unwrap();
        assert!((out.runs[0].dx[(60, 0)] - data.runs()[0].column(2)[60]).abs() < 1e-2);
        assert!(Differentiation::GpTime.differentiate(&data, &[0], &[], None, &Silent).is_err());
    }
}
