//! Velocities that no log carries: where an equation `x' = v` is given, v is the slope of the smoothed x.
//!
//! Everything after takes the slope for a measurement; what its errors have in common over time is not accounted for.

use crate::data::{Channel, Dataset, Run};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::identify::notes::Note;
use crate::identify::settings::Identify;
use crate::progress::Progress;
use crate::smooth::{Noise, Smoother};
use faer::Mat;
use std::borrow::Cow;

impl Identify {
    /// `data` with a column for every velocity that it lacks, and what a reader of the result should know of them.
    pub(crate) fn with_velocities<'a>(
        &self,
        data: &'a Dataset,
        progress: &dyn Progress,
    ) -> Result<(Cow<'a, Dataset>, Vec<Note>)> {
        let (mut positions, mut velocities) = (Vec::new(), Vec::new());
        for fixed in &self.constraints.fixed {
            let Expression::Variable(velocity) = &fixed.equation else { continue };
            if self.states.contains(velocity) && data.index_of(velocity).is_err() && !velocities.contains(velocity) {
                positions.push(data.index_of(&fixed.state)?);
                velocities.push(velocity.clone());
            }
        }
        let Some(smoother) = self.smoother.as_ref().filter(|_| !velocities.is_empty()) else {
            return Ok((Cow::Borrowed(data), Vec::new()));
        };
        let kernels = smoother.kernels.iter().filter(|kernel| kernel.differentiable()).cloned().collect::<Vec<_>>();
        if kernels.is_empty() {
            let text = "is not in the logs, and kernel matern12 has no slope; take matern32 or a smoother one";
            return Err(Error::invalid(format!("state `{}` {text}", velocities[0])));
        }
        // What is held out must not show in the slopes of what is learnt from.
        let runs = data.runs().iter().map(|run| {
            let end = run.time.partition_point(|t| *t <= self.training_end(run));
            let value = |i: usize, j: usize| if i < end { run.values[(i, positions[j])] } else { f64::NAN };
            Run { values: Mat::from_fn(run.n_samples(), positions.len(), value), ..run.clone() }
        });
        let channels = positions.iter().map(|&c| data.channels()[c].clone()).collect();
        let logged = Dataset::new(channels, runs.collect())?;
        let smoother = Smoother { kernels, noise: Noise::Estimated, covariance: false, ..smoother.clone() };
        let smoothed = smoother.smooth(&logged, &(0..positions.len()).collect::<Vec<_>>(), progress)?;

        let rate = |unit: &str| if unit.is_empty() { String::new() } else { format!("{unit}/s") };
        let mut channels = data.channels().to_vec();
        let mut notes = Vec::new();
        for (velocity, &position) in velocities.iter().zip(&positions) {
            let position = &data.channels()[position];
            channels.push(Channel::new(velocity).with_unit(rate(&position.unit)));
            notes.push(Note::UnloggedVelocity { velocity: velocity.clone(), position: position.name.clone() });
        }
        let width = data.channels().len();
        let runs = data.runs().iter().zip(&smoothed.runs).map(|(run, smoothed)| {
            let value = |i, j| if j < width { run.values[(i, j)] } else { smoothed.derivative[(i, j - width)] };
            Run { values: Mat::from_fn(run.n_samples(), channels.len(), value), ..run.clone() }
        });
        let runs = runs.collect();
        Ok((Cow::Owned(Dataset::new(channels, runs)?), notes))
    }

    /// Last time of a run that is learnt from, s.
    pub(crate) fn training_end(&self, run: &Run) -> f64 {
        let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
        from + self.train_fraction * (to - from)
    }
}
