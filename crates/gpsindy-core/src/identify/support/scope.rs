//! The input and the result of a refinement.

use crate::error::Result;
use crate::identify::algorithm1::Algorithm1;
use crate::identify::algorithm1::regress::Regressed;
use crate::identify::algorithm1::rows::Rows;
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::algorithm1::timing::Timings;
use crate::identify::outlook::Outlook;
use crate::identify::prepare::Logs;
use crate::identify::report::Found;
use crate::identify::result::Fidelity;
use crate::identify::settings::Identify;
use crate::identify::support::fit::{Fitter, Trial};
use crate::progress::{Progress, step};
use crate::refine::Hold;

/// What a refinement works on.
#[derive(Clone, Copy)]
pub(crate) struct Scope<'a> {
    pub(crate) settings: &'a Identify,
    pub(crate) logs: &'a Logs,
    pub(crate) motion: &'a Motion,
    pub(crate) timings: &'a Timings,
    pub(crate) rows: &'a [Option<Rows>],
    pub(crate) progress: &'a dyn Progress,
}

impl<'a> Scope<'a> {
    pub(crate) fn new(settings: &'a Identify, done: &'a Algorithm1, progress: &'a dyn Progress) -> Self {
        Self { settings, logs: &done.logs, motion: &done.motion, timings: &done.timings, rows: &done.rows, progress }
    }

    pub(crate) fn fitter(&self, hold: Hold) -> Fitter<'a> {
        Fitter::new(self.logs, self.motion, hold)
    }

    /// What is reported of equations that were not refined.
    pub(crate) fn unrefined(&self, regressed: &Regressed, inclusion: Vec<Vec<f64>>) -> Result<Found> {
        let fidelity = self.fidelity(&regressed.equations, self.timings.best.hold)?;
        let nothing = || vec![0.0; regressed.equations.n_terms()];
        let errors = regressed.chosen.iter().map(|c| c.as_ref().map_or_else(nothing, |c| c.errors.clone()));
        Ok(Found {
            errors: errors.collect(),
            inclusion,
            delay_errors: Vec::new(),
            noise: self.motion.noise.clone(),
            window: None,
            hold: self.timings.best.hold,
            equations: regressed.equations.clone(),
            fidelity,
            outlook: None,
        })
    }

    /// The rollouts that a search begins with.
    pub(crate) fn rollouts(&self) -> Rollouts {
        match self.settings.window {
            Some(length) => Rollouts::Fixed(length),
            None => Rollouts::Growing(self.motion.shortest_window()),
        }
    }

    /// An error where the caller has asked to stop.
    pub(crate) fn keep_going(&self) -> Result<()> {
        step(self.progress, "refine", 0, 1)
    }
}

/// How long the rollouts of a search are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Rollouts {
    /// This many seconds.
    Fixed(f64),
    /// This many seconds at first, and longer while they stay on course.
    Growing(f64),
}

impl Rollouts {
    /// Length of the first rollouts, s.
    pub(crate) fn shortest(self) -> f64 {
        match self {
            Self::Fixed(length) | Self::Growing(length) => length,
        }
    }
}

/// Equations that a search has come to.
#[derive(Clone)]
pub(crate) struct Member {
    pub(crate) trial: Trial,
    /// Length of the last rollouts, s.
    pub(crate) window: f64,
    pub(crate) hold: Hold,
    /// The same equations under the other hold, with their lead.
    pub(crate) rival: Option<(Trial, f64)>,
}

impl Member {
    /// What is reported of it.
    pub(crate) fn found(self, with_inclusion: bool, fidelity: Option<Fidelity>, outlook: Option<Outlook>) -> Found {
        let trial = self.trial;
        Found {
            equations: trial.equations,
            errors: trial.errors,
            inclusion: if with_inclusion { trial.inclusion } else { Vec::new() },
            delay_errors: trial.delay_errors,
            noise: trial.noise,
            window: Some(self.window),
            hold: self.hold,
            fidelity,
            outlook,
        }
    }
}
