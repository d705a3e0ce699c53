//! Simulates a model under the controls of a run: accurate integration between all break points.

// Indices are those of the formulas.
#![allow(clippy::needless_range_loop)]

mod closed_loop;
mod dense;
mod excitation;
mod explicit;
mod holding;
mod initial;
mod integrate;
mod inversion;
mod local_fit;
mod rates;
mod rosenbrock;
mod stepped;

pub use closed_loop::Controller;
pub use excitation::Excitation;
pub use initial::{StateReader, initial_state, unmeasure};
pub(crate) use inversion::Inversion;

use crate::data::Hold;
use crate::error::{Error, Result};
use crate::model::{LateState, System};
use dense::DenseStep;
use faer::Mat;
use rates::Rates;
use std::ops::Range;

/// How the equations are integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// Dormand-Prince 5(4) with step control and dense output; goes over to [`Method::Rosenbrock`] where the model is stiff.
    #[default]
    DormandPrince,
    /// RODAS 4(3) with step control, for stiff models.
    Rosenbrock,
    /// The classical fourth order, this many equal steps between samples (and break points).
    RungeKutta4 {
        /// Steps, at least 1.
        substeps: usize,
    },
    /// Forward Euler, this many equal steps between samples (and break points).
    Euler {
        /// Steps, at least 1.
        substeps: usize,
    },
}

impl Method {
    fn has_fixed_steps(self) -> bool {
        matches!(self, Self::RungeKutta4 { .. } | Self::Euler { .. })
    }
}

/// Settings of a simulation.
///
/// ```
/// use gpsindy_core::{Excitation, Expression, Hold, Model, Simulate, State};
/// let model = Model { states: vec![State::new("x", Expression::parse("-x")?)], ..Model::default() };
/// let system = model.compile()?;
/// let no_controls = faer::Mat::zeros(3, 0);
/// let excitation = Excitation::new(&system, &[0.0, 0.5, 1.0], no_controls.as_ref(), Hold::Zero)?;
/// let rollout = Simulate::default().rollout(&system, &excitation, &[1.0])?;
/// assert!((rollout.states[(2, 0)] - (-1.0_f64).exp()).abs() < 1e-7);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulate {
    /// What controls do between samples; default [`Hold::Zero`]. For callers that build an [`Excitation`] from a log.
    pub hold: Hold,
    /// Default [`Method::DormandPrince`].
    pub method: Method,
    /// Error allowed in a step relative to the largest size of the state so far; default 1e-8, range 1e-13 to 0.1.
    pub tolerance: f64,
    /// Steps after which an integration gives up; default 2,000,000.
    pub max_steps: usize,
    /// Size of a state at which an integration counts as diverged, in the state's unit; default 1e12. It is at least a million times the
    /// largest start, or `bound` times that.
    pub bound: f64,
}

impl Default for Simulate {
    fn default() -> Self {
        Self { hold: Hold::Zero, method: Method::DormandPrince, tolerance: 1e-8, max_steps: 2_000_000, bound: 1e12 }
    }
}

/// A simulated stretch of a run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Rollout {
    /// Sample times, s, r of them.
    pub time: Vec<f64>,
    /// (r x n), the states.
    pub states: Mat<f64>,
    /// (r x n), what `measured` says of each state.
    pub outputs: Mat<f64>,
    /// Steps that were tried.
    pub n_steps: usize,
    /// Steps that were accepted above the tolerance, because the rates jump to and fro there (dry friction at rest).
    pub n_coarse: usize,
    /// Time from which the implicit method was used because the model is stiff, s.
    pub stiff_from: Option<f64>,
}

/// Growth beyond what was logged, or beyond the start, that still counts as no divergence: no unit of a column makes a rollout diverge.
/// Convention.
const FAR: f64 = 1e6;

impl Simulate {
    /// The same beside logs with values up to `largest`.
    pub(crate) fn beside(self, largest: f64) -> Self {
        Self { bound: self.bound.max(self.bound.min(FAR) * largest), ..self }
    }

    /// Simulates the whole run from `initial` (n) at its first sample.
    ///
    /// # Errors
    /// As [`Simulate::rollout_range`].
    pub fn rollout(&self, system: &System, excitation: &Excitation, initial: &[f64]) -> Result<Rollout> {
        self.rollout_range(system, excitation, initial, 0..excitation.time().len())
    }

    /// Simulates the samples `range` from `initial` (n) at the first of them.
    ///
    /// Delayed controls see the run before the range. A state that `measured` reads late is held at its
    /// initial value before the range.
    ///
    /// # Errors
    /// [`Error::Diverged`] with time, state and value; [`Error::NotConverged`] where steps become too small
    /// or too many; [`Error::Callback`] from the user's own simulator; wrong sizes and settings.
    pub fn rollout_range(
        &self,
        system: &System,
        excitation: &Excitation,
        initial: &[f64],
        range: Range<usize>,
    ) -> Result<Rollout> {
        self.check(system, excitation, initial, &range)?;
        let settings = &self.beside(initial.iter().fold(0.0, |largest, v| largest.max(v.abs())));
        if system.engine().is_some() {
            return stepped::rollout(settings, system, excitation, initial, range);
        }
        let n = system.n_states();
        let time = &excitation.time()[range];
        let amounts = late_amounts(system);
        let (start, last) = (time[0], time[time.len() - 1]);
        // A negative delay looks ahead, beyond the last sample.
        let seen = amounts.iter().zip(system.late_states()).map(|(amounts, late)| late.moment(last, *amounts));
        let end = seen.fold(last, f64::max);

        let mut states = Mat::zeros(time.len(), n);
        for j in 0..n {
            states[(0, j)] = initial[j];
        }
        let mut next = 1;
        let mut history: Vec<DenseStep> = Vec::new();
        let mut rates = Rates::new(system, excitation);
        let mut accept = |step: &DenseStep| {
            // Rounding must not leave a sample between two steps.
            let reach = step.end() + 1e-12 * step.length;
            while next < time.len() && (time[next] <= reach) {
                for j in 0..n {
                    states[(next, j)] = step.value(time[next], j);
                }
                next += 1;
            }
            if !amounts.is_empty() {
                history.push(step.clone());
            }
        };
        let mut x = initial.to_vec();
        let march = integrate::march(settings, &mut rates, &mut x, (start, end), time, &mut accept)?;
        if end == last {
            for j in 0..n {
                states[(time.len() - 1, j)] = x[j];
            }
        }

        let mut outputs = Mat::zeros(time.len(), n);
        let (mut row, mut output) = (vec![0.0; n], vec![0.0; n]);
        let mut late = vec![0.0; amounts.len()];
        for (i, &t) in time.iter().enumerate() {
            row.iter_mut().enumerate().for_each(|(j, value)| *value = states[(i, j)]);
            for ((value, amounts), late_state) in late.iter_mut().zip(&amounts).zip(system.late_states()) {
                let moment = late_state.moment(t, *amounts);
                *value = past(&history, moment, late_state.state, initial);
            }
            rates.output(t, &row, &late, &mut output);
            output.iter().enumerate().for_each(|(j, &value)| outputs[(i, j)] = value);
        }
        Ok(Rollout {
            time: time.into(),
            states,
            outputs,
            n_steps: march.n_steps,
            n_coarse: march.n_coarse,
            stiff_from: march.stiff_from,
        })
    }

    fn check(&self, system: &System, excitation: &Excitation, initial: &[f64], range: &Range<usize>) -> Result<()> {
        let n = system.n_states();
        if initial.len() != n {
            return Err(Error::shape("initial state", format!("{n} states"), initial.len()));
        }
        if let Some(j) = initial.iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite {
                what: format!("initial value of state `{}`", system.model().states[j].name),
            });
        }
        if !(1e-13..=0.1).contains(&self.tolerance) {
            return Err(Error::range("tolerance", "between 1e-13 and 0.1", self.tolerance));
        }
        let r = excitation.time().len();
        if range.is_empty() || range.end > r {
            return Err(Error::range(
                "range of samples",
                &format!("not empty and within 0..{r}"),
                format!("{range:?}"),
            ));
        }
        Ok(())
    }
}

/// What [`LateState::amounts`] says of each of the late states.
fn late_amounts(system: &System) -> Vec<[f64; 2]> {
    let parameters: Vec<[f64; 1]> = system.parameter_values().into_iter().map(|value| [value]).collect();
    system.late_states().iter().map(|late: &LateState| late.amounts(&parameters)[0]).collect()
}

/// How late `measured` reads any state at most between two times, s.
pub(crate) fn latest(system: &System, span: (f64, f64)) -> f64 {
    let all = late_amounts(system).into_iter().zip(system.late_states());
    all.map(|(amounts, late)| late.lateness(amounts, span)).fold(0.0, f64::max)
}

/// State `j` at time `t` (s) out of the steps made; before the first the initial value.
fn past(history: &[DenseStep], t: f64, j: usize, initial: &[f64]) -> f64 {
    let Some(first) = history.first() else { return initial[j] };
    if t <= first.start {
        return initial[j];
    }
    let index = history.partition_point(|step| step.end() < t).min(history.len() - 1);
    history[index].value(t.min(history[index].end()), j)
}
