//! Identification of equations from logs: Algorithm 1 of the paper and its refinement, as one body.
//!
//! Smooth the states, form the rows of the regression and select terms by sparse regression. Then refine by simulation: fit
//! coefficients, delays and initial states to the raw measurements, and drop, add and exchange terms by evidence.

mod algorithm1;
mod author;
mod equations;
mod evidence;
mod excerpt;
mod limits;
mod names;
mod notes;
mod online;
mod prepare;
mod report;
mod result;
mod settings;
mod support;
mod velocities;

pub use author::{Author, AuthorResult};
pub use names::Regression;
pub use notes::Note;
pub use online::{Estimate, Online, OnlineSettings};
pub use result::{DelayReport, Fidelity, Identification, StateReport};
pub use settings::{Choice, Delay, Identify, Target};

use crate::data::Dataset;
use crate::error::Result;
use crate::progress::Progress;
use crate::refine::Hold;
use algorithm1::regress::{inclusion, regress};
use algorithm1::rows::rows;
use algorithm1::smooth::smooth;
use algorithm1::timing::time;
use excerpt::excerpt;
use prepare::prepare;
use report::report;
use support::scope::Scope;

impl Identify {
    /// Learns the equations of `data`.
    ///
    /// A state that the data lack is allowed where an equation that is given, `x' = v`, says whose velocity it is.
    ///
    /// Of logs longer than an identification needs, the most exciting windows are learnt from; a note states which share.
    ///
    /// # Errors
    /// Unknown columns, settings out of range, too few samples; a request to stop.
    pub fn fit(&self, data: &Dataset, progress: &dyn Progress) -> Result<Identification> {
        let Some((part, note)) = excerpt(self, data)? else { return self.fit_all(data, progress) };
        let mut found = Self { train_fraction: 1.0, ..self.clone() }.fit_all(&part, progress)?;
        found.notes.insert(0, note);
        Ok(found)
    }

    /// Learns from all samples.
    fn fit_all(&self, data: &Dataset, progress: &dyn Progress) -> Result<Identification> {
        let logs = prepare(self, data, progress)?;
        let motion = smooth(self, &logs, progress)?;
        let timings = time(self, &logs, &motion, progress)?;
        let rows = rows(self, &logs, &motion, timings.best.hold, &timings.best.delay_values())?;
        let mut regressed = regress(self, logs.frame_with(&timings.best.delays), &rows, progress)?;
        let scope = Scope { settings: self, logs: &logs, motion: &motion, timings: &timings, rows: &rows, progress };
        if self.choice == Choice::Rollout {
            scope.choose_by_rollout(&mut regressed)?;
        }
        let mut notes = [motion.notes.clone(), logs.notes.clone()].concat();
        // Search the support, lengthen, agree.
        let refined = if self.refine { scope.refine(&regressed, &mut notes)? } else { None };
        let found = match refined {
            Some(found) => found,
            None => scope.unrefined(&regressed, inclusion(self, &regressed, &rows)?)?,
        };
        if self.hold.is_none() && found.hold == Hold::Linear {
            notes.push(Note::Interpolated);
        }
        Ok(report(found, &regressed.chosen, &motion.kernels, notes))
    }
}

#[cfg(test)]
mod tests;
