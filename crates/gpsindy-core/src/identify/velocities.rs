//! Unlogged states: if an equation `x' = v` is given, v is at first the slope of the smoothed x; if `y' = f(y, h)` is, h is what makes
//! that so.
//!
//! The regression treats these values as a measurement. The refinement starts from it and compares only positions.

use crate::data::{Channel, Dataset, Run};
use crate::differentiate::central;
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::identify::algorithm1::second_opinion::smooth_columns;
use crate::identify::algorithm1::smooth::filled;
use crate::identify::notes::Note;
use crate::identify::settings::Identify;
use crate::progress::Progress;
use crate::simulate::Inversion;
use crate::smooth::{Noise, Smoother};
use faer::Mat;
use std::borrow::Cow;

/// A state that no log carries, and the column of the one whose given equation holds it.
struct Unlogged {
    velocity: String,
    position: usize,
    /// The equation, where the state is not just that column's slope.
    inversion: Option<Inversion>,
}

/// Values and slopes of one run, a column an [`Unlogged`].
struct Slopes {
    values: Mat<f64>,
    slopes: Mat<f64>,
}

impl Identify {
    /// `data` with a column for every state that it lacks, and what a reader of the result should know of them.
    pub(crate) fn with_velocities<'a>(
        &self,
        data: &'a Dataset,
        progress: &dyn Progress,
    ) -> Result<(Cow<'a, Dataset>, Vec<Note>)> {
        let unlogged = self.unlogged(data)?;
        if unlogged.is_empty() {
            return Ok((Cow::Borrowed(data), Vec::new()));
        }
        // What is held out must not show in the slopes of what is learnt from.
        let runs = data.runs().iter().map(|run| {
            let end = run.time.partition_point(|t| *t <= self.training_end(run));
            let value = |i: usize, j: usize| if i < end { run.values[(i, unlogged[j].position)] } else { f64::NAN };
            Run { values: Mat::from_fn(run.n_samples(), unlogged.len(), value), ..run.clone() }
        });
        let positions: Vec<&Channel> = unlogged.iter().map(|u| &data.channels()[u.position]).collect();
        let logged = Dataset::new(positions.iter().map(|&c| c.clone()).collect(), runs.collect())?;
        let slopes = match &self.smoother {
            Some(smoother) => smooth_slopes(smoother, &unlogged[0].velocity, &logged, progress)?,
            None => {
                logged.runs().iter().map(|run| central_slopes(run, logged.channels())).collect::<Result<Vec<_>>>()?
            }
        };

        let rate = |unit: &str| if unit.is_empty() { String::new() } else { format!("{unit}/s") };
        let mut channels = data.channels().to_vec();
        let mut notes = Vec::new();
        for (Unlogged { velocity, inversion, .. }, position) in unlogged.iter().zip(positions) {
            let unit = if inversion.is_none() { rate(&position.unit) } else { String::new() };
            channels.push(Channel::new(velocity).with_unit(unit));
            let (hidden, position) = (velocity.clone(), position.name.clone());
            notes.push(match inversion {
                None => Note::UnloggedVelocity { velocity: hidden, position },
                Some(_) => Note::Hidden { state: hidden, from: position },
            });
        }
        let width = data.channels().len();
        let runs = data.runs().iter().zip(&slopes).map(|(run, slopes)| {
            let found = unlogged.iter().enumerate().map(|(k, one)| one.in_run(k, (data, run), slopes));
            let found: Vec<Vec<f64>> = found.collect::<Result<_>>()?;
            let value = |i: usize, j: usize| if j < width { run.values[(i, j)] } else { found[j - width][i] };
            Ok(Run { values: Mat::from_fn(run.n_samples(), channels.len(), value), ..run.clone() })
        });
        let runs = runs.collect::<Result<Vec<_>>>()?;
        Ok((Cow::Owned(Dataset::new(channels, runs)?), notes))
    }

    fn unlogged(&self, data: &Dataset) -> Result<Vec<Unlogged>> {
        let mut found: Vec<Unlogged> = Vec::new();
        for fixed in &self.constraints.fixed {
            let is_bare = matches!(fixed.equation, Expression::Variable(_));
            let names = fixed.equation.variables();
            let is_known =
                |name: &String| data.index_of(name).is_ok() || found.iter().any(|other| other.velocity == *name);
            let Some(hidden) = names.iter().find(|name| self.states.contains(name) && !is_known(name)) else {
                continue;
            };
            // A hidden state's own equation says nothing of it where that state is not logged either.
            if !is_bare && data.index_of(&fixed.state).is_err() {
                continue;
            }
            let column = |name: &str| data.index_of(name).ok();
            let numbers: Vec<(String, f64)> =
                self.library.numbers.iter().map(|number| (number.name.clone(), number.middle())).collect();
            let inversion = Inversion::new(&fixed.equation, hidden, &numbers, &column);
            found.push(Unlogged {
                velocity: hidden.clone(),
                position: data.index_of(&fixed.state)?,
                inversion: if is_bare { None } else { Some(inversion?) },
            });
        }
        Ok(found)
    }

    /// Last time of a run that is learnt from, s.
    pub(crate) fn training_end(&self, run: &Run) -> f64 {
        let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
        from + self.train_fraction * (to - from)
    }
}

impl Unlogged {
    /// This state, number `k` of its kind, at the samples of a run.
    fn in_run(&self, k: usize, (data, run): (&Dataset, &Run), slopes: &Slopes) -> Result<Vec<f64>> {
        let own = slopes.slopes.col_as_slice(k);
        let Some(inversion) = &self.inversion else { return Ok(own.to_vec()) };
        let mut columns = Vec::with_capacity(data.channels().len());
        for (c, channel) in data.channels().iter().enumerate() {
            columns.push(if c == self.position || run.column(c).iter().all(|v| v.is_nan()) {
                slopes.values.col_as_slice(k).to_vec()
            } else {
                filled(run, c, channel)?
            });
        }
        Ok(inversion.solve(run, own, &|i, c| columns[c][i]))
    }
}

/// Slopes of all columns by a Gaussian process, one matrix a run.
fn smooth_slopes(
    smoother: &Smoother,
    velocity: &str,
    logged: &Dataset,
    progress: &dyn Progress,
) -> Result<Vec<Slopes>> {
    let kernels = smoother.kernels.iter().filter(|kernel| kernel.differentiable()).cloned().collect::<Vec<_>>();
    if kernels.is_empty() {
        let text = "is not in the logs, and kernel matern12 has no slope; take matern32 or a smoother one";
        return Err(Error::settings(format!("state `{velocity}` {text}")));
    }
    let smoother = Smoother { kernels, noise: Noise::Estimated, covariance: false, ..smoother.clone() };
    let columns: Vec<usize> = (0..logged.channels().len()).collect();
    let smoothed = smooth_columns(&smoother, logged, &columns, progress)?;
    Ok(smoothed.runs.into_iter().map(|run| Slopes { values: run.mean, slopes: run.derivative }).collect())
}

/// Slopes of all columns of a run by parabolas through three samples.
fn central_slopes(run: &Run, channels: &[Channel]) -> Result<Slopes> {
    let mut slopes = Mat::zeros(run.n_samples(), channels.len());
    let mut all = slopes.clone();
    for (j, channel) in channels.iter().enumerate() {
        let values = filled(run, j, channel)?;
        slopes.col_as_slice_mut(j).copy_from_slice(&central(&run.time, &values));
        all.col_as_slice_mut(j).copy_from_slice(&values);
    }
    Ok(Slopes { values: all, slopes })
}
