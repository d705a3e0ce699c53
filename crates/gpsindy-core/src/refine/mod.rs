//! Fits parameters and initial states to the raw measurements by simulation.
//!
//! Multiple shooting with free initial states, solved by Levenberg-Marquardt; the initial states of
//! each window are eliminated from the normal equations, so that many windows cost no more than one.
//! Source: Bock 1983, Recent advances in parameter identification techniques for ODE; Nocedal and
//! Wright 2006, Numerical Optimization, section 10.3.

mod blocks;
pub(crate) mod dots;
mod experiment;
mod history;
mod jacobian;
mod kept;
pub(crate) mod lanes;
mod normal;
mod profile;
mod search;
mod stepped;
pub(crate) mod tally;

pub(crate) use crate::data::Hold;
pub(crate) use experiment::present;
pub use experiment::{Experiment, Log, Past, Starts, Window};
pub(crate) use jacobian::{Block, Jacobian, Point, costs, misses, prior_cost};
pub(crate) use kept::Kept;
pub(crate) use lanes::guided::Guided;
pub(crate) use lanes::lockstep::{Job, roll_together};
pub(crate) use lanes::path::Path;
pub(crate) use lanes::tangent::{Tangent, tangent};
pub(crate) use profile::Profile;
pub(crate) use stepped::{
    chained_starts, drawn_around, drawn_starts, draws_of_readings, first_starts, guess_starts, nearer_starts,
};

use crate::error::{Error, Result};
use crate::model::System;
use nalgebra::DMatrix;
use normal::Normal;
pub(crate) use normal::bounded_solution;
use search::Wanted;
use std::sync::Arc;

/// A parameter that a fit may change.
#[derive(Debug, Clone, PartialEq)]
pub struct Free {
    /// Which of the system's parameters.
    pub parameter: usize,
    /// Lowest value allowed.
    pub lower: f64,
    /// Highest value allowed.
    pub upper: f64,
    /// Typical size: sets the step of the finite difference.
    pub scale: f64,
    /// What is believed beforehand: mean and standard deviation.
    pub prior: Option<(f64, f64)>,
}

impl Free {
    /// A parameter without bounds or belief, of typical size `scale`.
    pub fn new(parameter: usize, scale: f64) -> Self {
        Self { parameter, lower: f64::NEG_INFINITY, upper: f64::INFINITY, scale, prior: None }
    }
}

/// Settings of the refinement.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `max_iterations` | 30 | 1 and above | Gauss-Newton steps |
/// | `tolerance` | 1e-6 | above 0 | stop when a step lowers the cost by less than this share |
/// | `hopeless` | infinity | above 0 | stop above this cost where steps lower it by little (equations only) |
#[derive(Debug, Clone, PartialEq)]
pub struct Refine {
    /// Largest number of steps.
    pub max_iterations: usize,
    /// Relative decrease of the cost below which the search stops.
    pub tolerance: f64,
    /// Cost above which a search ends once two steps in a row have lowered it by less than a tenth each.
    pub hopeless: f64,
}

impl Default for Refine {
    fn default() -> Self {
        Self { max_iterations: 30, tolerance: 1e-6, hopeless: f64::INFINITY }
    }
}

/// What a refinement found.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Refined {
    /// All parameters of the system.
    pub parameters: Vec<f64>,
    /// Initial state of every window.
    pub initial: Vec<Vec<f64>>,
    /// Sum of the squared, noise-scaled residuals and of the beliefs' terms.
    pub cost: f64,
    /// (measured - model)/noise: one list a window, sample by sample, columns side by side; NaN is missing.
    pub residuals: Vec<Vec<f64>>,
    /// Covariance of the free parameters for residuals of unit variance, initial states being free.
    pub covariance: Vec<Vec<f64>>,
    /// Windows that the covariance leaves out, because overflow or rounding made their own equations singular: empty is good.
    pub left_out: Vec<usize>,
    /// Whether the search came to rest.
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
    /// Derivatives for the next fit, where they are handed on.
    pub(crate) kept: Option<Arc<Kept>>,
}

/// What a fit starts from, and what it must end with.
struct Beginning<'a> {
    /// Initial states of all windows, as far as they are known.
    initial: Option<&'a [Vec<f64>]>,
    /// Derivatives of an earlier fit.
    kept: Option<&'a Arc<Kept>>,
    wanted: Wanted,
}

/// Steps up to which a fit only ranks. A Jacobian costs as much as several of them.
const RANKING: usize = 5;

impl Refine {
    /// Fits the `free` parameters and every window's initial state, from `parameters` (all of the system's).
    ///
    /// # Errors
    /// [`Error::Diverged`] when the model leaves all bounds at the start already.
    pub fn fit(
        &self,
        system: &System,
        experiment: &Experiment,
        parameters: &[f64],
        free: &[Free],
        initial: Option<&[Vec<f64>]>,
    ) -> Result<Refined> {
        let (refined, _) = self.fit_watched(system, experiment, (parameters, free), initial, &|_| Ok(()))?;
        Ok(refined)
    }

    /// As [`Refine::fit`], from where an earlier fit ended, of the same windows where it can be.
    pub(crate) fn fit_on(
        &self,
        system: &System,
        experiment: &Experiment,
        (parameters, free): (&[f64], &[Free]),
        initial: &[Vec<f64>],
        kept: Option<&Arc<Kept>>,
    ) -> Result<Refined> {
        let wanted = if self.only_ranks() { Wanted::Rank } else { Wanted::Derivatives };
        let from = Beginning { initial: Some(initial), kept, wanted };
        let (refined, _) = self.fit_from(system, experiment, (parameters, free), from, &|_| Ok(()))?;
        Ok(refined)
    }

    /// As [`Refine::fit`], and the Jacobian at the end; `watch` gets how many steps are done, and may end the fit with an error.
    pub(crate) fn fit_watched(
        &self,
        system: &System,
        experiment: &Experiment,
        (parameters, free): (&[f64], &[Free]),
        initial: Option<&[Vec<f64>]>,
        watch: &dyn Fn(usize) -> Result<()>,
    ) -> Result<(Refined, Jacobian)> {
        self.fit_from(
            system,
            experiment,
            (parameters, free),
            Beginning { initial, kept: None, wanted: Wanted::Derivatives },
            watch,
        )
    }

    /// Whether a fit with so few steps only ranks: it is not worth derivatives of where it ends.
    fn only_ranks(&self) -> bool {
        self.max_iterations <= RANKING
    }

    fn fit_from(
        &self,
        system: &System,
        experiment: &Experiment,
        (parameters, free): (&[f64], &[Free]),
        Beginning { initial, kept, wanted }: Beginning<'_>,
        watch: &dyn Fn(usize) -> Result<()>,
    ) -> Result<(Refined, Jacobian)> {
        experiment.tally.fit();
        if parameters.len() != system.n_parameters() {
            return Err(Error::shape("parameters", system.n_parameters(), parameters.len()));
        }
        let initial = match initial {
            Some(initial) if initial.len() == experiment.windows.len() => initial.to_vec(),
            _ => guess_starts(system, experiment, parameters)?,
        };
        let mut point = Point { parameters: parameters.to_vec(), initial };
        for f in free {
            point.parameters[f.parameter] = point.parameters[f.parameter].clamp(f.lower, f.upper);
        }
        if system.engine().is_some() {
            return stepped::fit(self, (system, experiment, free), point, kept, watch);
        }
        let kept = kept.map(Arc::as_ref);
        let found = search::fit(self, (system, experiment, free), (point, kept), wanted, watch)?;
        Ok(found.refined(experiment, free))
    }
}

/// What a search ended with.
struct Found {
    point: Point,
    jacobian: Jacobian,
    cost: f64,
    converged: bool,
    iterations: usize,
}

impl Found {
    fn refined(self, experiment: &Experiment, free: &[Free]) -> (Refined, Jacobian) {
        let Self { point, jacobian, cost, converged, iterations } = self;
        let (covariance, left_out) = Normal::new(&jacobian, experiment, &point, free).covariance();
        let refined = Refined {
            parameters: point.parameters,
            initial: point.initial,
            cost,
            residuals: jacobian.residuals(),
            covariance: rows(&covariance),
            left_out,
            converged,
            iterations,
            kept: None,
        };
        (refined, jacobian)
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Initial states from the first samples of each window: a straight line through up to eight of them.
///
/// An unlogged velocity takes the slope of its position; other unlogged states start at the model's
/// `initial` value or at zero, and are found by the fit.
pub(crate) fn guess_initial(system: &System, experiment: &Experiment) -> Vec<Vec<f64>> {
    let model = system.model();
    experiment
        .windows
        .iter()
        .map(|window| {
            let log = &experiment.logs[window.log];
            let lines: Vec<(f64, f64)> = log.measured.iter().map(|c| first_line(&log.time, c, window)).collect();
            (0..model.states.len())
                .map(|j| {
                    if let Some(c) = experiment.column_of(j) {
                        return lines[c].0;
                    }
                    match model.integral_of(j).and_then(|i| Some((i, experiment.column_of(i)?))) {
                        Some((place, c)) => lines[c].1 / model.per_rate(place),
                        None => model.initial.get(&model.states[j].name).copied().unwrap_or(0.0),
                    }
                })
                .collect()
        })
        .collect()
}

/// Value and slope at the start of the window by least squares.
fn first_line(time: &[f64], values: &[f64], window: &Window) -> (f64, f64) {
    let start = time[window.first];
    let points: Vec<(f64, f64)> = (window.first..=window.last)
        .filter(|&i| values[i].is_finite())
        .take(8)
        .map(|i| (time[i] - start, values[i]))
        .collect();
    let count = points.len() as f64;
    if points.is_empty() {
        return (0.0, 0.0);
    }
    let (mt, mv) = points.iter().fold((0.0, 0.0), |(a, b), (t, v)| (a + t / count, b + v / count));
    let stt: f64 = points.iter().map(|(t, _)| (t - mt) * (t - mt)).sum();
    if stt == 0.0 {
        return (mv, 0.0);
    }
    let slope = points.iter().map(|(t, v)| (t - mt) * (v - mv)).sum::<f64>() / stt;
    (mv - slope * mt, slope)
}

#[cfg(test)]
mod tests;
