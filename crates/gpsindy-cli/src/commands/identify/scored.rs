//! The logs that a model is scored on: held-out ones, the rest of the training logs, or these themselves.

use super::{Fit, Identify, On};
use crate::commands::{dataset, opened};
use crate::failure::Outcome;
use crate::screen::Screen;
use gpsindy_core::{Dataset, Identification, Identify as Settings, Progress, Run, Scoring, Simulate, score};
use gpsindy_files::Task;

/// What a model is scored on.
pub(super) enum Scored {
    /// The logs of --holdout.
    Holdout(Dataset),
    /// What --train-fraction left of the logs.
    Rest(Dataset),
    /// The very logs that were learnt from.
    Training(Dataset),
}

impl Scored {
    pub(super) fn new(
        command: &Identify,
        settings: &Settings,
        task: &Task,
        data: &Dataset,
        screen: &Screen,
    ) -> Outcome<Self> {
        if !command.holdout.is_empty() {
            let logs = opened(&command.holdout, &command.columns, screen)?;
            return Ok(Self::Holdout(dataset(&logs, task, &command.columns, &screen.quietly())?));
        }
        if settings.train_fraction >= 1.0 {
            return Ok(Self::Training(data.clone()));
        }
        let runs = data.runs().iter().map(|run| {
            let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
            let first = run.time.partition_point(|&t| t <= from + settings.train_fraction * (to - from));
            Run {
                name: run.name.clone(),
                time: run.time[first..].to_vec(),
                values: run.values.subrows(first, run.n_samples() - first).to_owned(),
            }
        });
        let runs: Vec<Run> = runs.filter(|run| run.n_samples() > 1).collect();
        match runs.is_empty() {
            true => Ok(Self::Training(data.clone())),
            false => Ok(Self::Rest(Dataset::new(data.channels().to_vec(), runs)?)),
        }
    }

    pub(super) fn score(&self, found: &Identification, progress: &dyn Progress) -> Outcome<Fit> {
        let (data, on) = match self {
            Self::Holdout(data) => (data, On::Holdout),
            Self::Rest(data) => (data, On::Rest),
            Self::Training(data) => (data, On::Training),
        };
        let simulate = Simulate { hold: found.hold, ..Simulate::default() };
        let scoring = Scoring { simulate, window: None };
        let score = score(&found.model.compile()?, data, &scoring, progress)?;
        Ok(Fit { score, on })
    }
}
