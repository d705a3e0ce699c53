//! The paper's Algorithm 1: smoothing, regression rows, one sparse regression per state; and the timing of the controls.

pub(crate) mod made;
pub(crate) mod regress;
pub(crate) mod rows;
pub(crate) mod second_opinion;
pub(crate) mod smooth;
pub(crate) mod timing;
pub(crate) mod track;

use crate::data::Dataset;
use crate::error::Result;
use crate::identify::prepare::{Logs, prepare};
use crate::identify::settings::Identify;
use crate::progress::Progress;
use regress::{Regressed, regress};
use rows::{Rows, rows};
use smooth::{Motion, smooth};
use timing::{Timings, time};

/// Algorithm 1, done: what the refinement works on.
#[derive(Clone)]
pub(crate) struct Algorithm1 {
    pub(crate) logs: Logs,
    pub(crate) motion: Motion,
    pub(crate) timings: Timings,
    /// Of every state whose equation is not given.
    pub(crate) rows: Vec<Option<Rows>>,
    pub(crate) regressed: Regressed,
}

impl Algorithm1 {
    pub(crate) fn run(settings: &Identify, data: &Dataset, progress: &dyn Progress) -> Result<Self> {
        let logs = prepare(settings, data, progress)?;
        let motion = smooth(settings, &logs, progress)?;
        Self::of(settings, logs, motion, progress)
    }

    /// The same for settings that differ in the library alone: nothing is smoothed again.
    pub(crate) fn with_library_of(
        settings: &Identify,
        (logs, motion): (&Logs, &Motion),
        progress: &dyn Progress,
    ) -> Result<Self> {
        let logs = logs.with_library_of(settings)?;
        let motion = motion.with_library(settings, &logs.frame.library)?;
        Self::of(settings, logs, motion, progress)
    }

    pub(crate) fn of(settings: &Identify, logs: Logs, motion: Motion, progress: &dyn Progress) -> Result<Self> {
        let timings = time(settings, &logs, &motion, progress)?;
        let rows = rows(settings, &logs, &motion, timings.best.hold, &timings.best.delay_values())?;
        let regressed = regress(settings, logs.frame_with(&timings.best.delays), &rows, progress)?;
        Ok(Self { logs, motion, timings, rows, regressed })
    }
}
