//! Unlogged velocities: if an equation `x' = v` is given, v is at first the slope of the smoothed x.
//!
//! The regression treats the slope as a measurement. The refinement starts from it and compares only positions.

use crate::data::{Channel, Dataset, Run};
use crate::differentiate::central;
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::identify::algorithm1::second_opinion::smooth_columns;
use crate::identify::algorithm1::smooth::filled;
use crate::identify::notes::Note;
use crate::identify::settings::Identify;
use crate::progress::Progress;
use crate::smooth::{Noise, Smoother};
use faer::Mat;
use std::borrow::Cow;

/// A velocity that no log carries, and the column of its position.
struct Unlogged {
    velocity: String,
    position: usize,
}

impl Identify {
    /// `data` with a column for every velocity that it lacks, and what a reader of the result should know of them.
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
        for (Unlogged { velocity, .. }, position) in unlogged.iter().zip(positions) {
            channels.push(Channel::new(velocity).with_unit(rate(&position.unit)));
            notes.push(Note::UnloggedVelocity { velocity: velocity.clone(), position: position.name.clone() });
        }
        let width = data.channels().len();
        let runs = data.runs().iter().zip(&slopes).map(|(run, slopes)| {
            let value = |i, j| if j < width { run.values[(i, j)] } else { slopes[(i, j - width)] };
            Run { values: Mat::from_fn(run.n_samples(), channels.len(), value), ..run.clone() }
        });
        let runs = runs.collect();
        Ok((Cow::Owned(Dataset::new(channels, runs)?), notes))
    }

    fn unlogged(&self, data: &Dataset) -> Result<Vec<Unlogged>> {
        let mut found: Vec<Unlogged> = Vec::new();
        for fixed in &self.constraints.fixed {
            let Expression::Variable(velocity) = &fixed.equation else { continue };
            let known = data.index_of(velocity).is_ok() || found.iter().any(|u| u.velocity == *velocity);
            if self.states.contains(velocity) && !known {
                found.push(Unlogged { velocity: velocity.clone(), position: data.index_of(&fixed.state)? });
            }
        }
        Ok(found)
    }

    /// Last time of a run that is learnt from, s.
    pub(crate) fn training_end(&self, run: &Run) -> f64 {
        let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
        from + self.train_fraction * (to - from)
    }
}

/// Slopes of all columns by a Gaussian process, one matrix a run.
fn smooth_slopes(
    smoother: &Smoother,
    velocity: &str,
    logged: &Dataset,
    progress: &dyn Progress,
) -> Result<Vec<Mat<f64>>> {
    let kernels = smoother.kernels.iter().filter(|kernel| kernel.differentiable()).cloned().collect::<Vec<_>>();
    if kernels.is_empty() {
        let text = "is not in the logs, and kernel matern12 has no slope; take matern32 or a smoother one";
        return Err(Error::settings(format!("state `{velocity}` {text}")));
    }
    let smoother = Smoother { kernels, noise: Noise::Estimated, covariance: false, ..smoother.clone() };
    let columns: Vec<usize> = (0..logged.channels().len()).collect();
    let smoothed = smooth_columns(&smoother, logged, &columns, progress)?;
    Ok(smoothed.runs.into_iter().map(|run| run.derivative).collect())
}

/// Slopes of all columns of a run by parabolas through three samples.
fn central_slopes(run: &Run, channels: &[Channel]) -> Result<Mat<f64>> {
    let mut slopes = Mat::zeros(run.n_samples(), channels.len());
    for (j, channel) in channels.iter().enumerate() {
        let values = filled(run, j, channel)?;
        slopes.col_as_slice_mut(j).copy_from_slice(&central(&run.time, &values));
    }
    Ok(slopes)
}
