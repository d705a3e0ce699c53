//! Identification of equations from logs: Algorithm 1 of the paper and its refinement, as one body.
//!
//! Smooth the states, form the rows of the regression and select terms by sparse regression. Then refine by simulation: fit
//! coefficients, delays and initial states to the raw measurements, and drop, add and exchange terms by evidence.

mod algorithm1;
mod author;
mod equations;
mod evidence;
mod excerpt;
mod grow;
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
use algorithm1::Algorithm1;
use algorithm1::regress::inclusion;
use excerpt::excerpt;
use report::report;
use support::scope::{Member, Scope};

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
        let done = self.chosen(Algorithm1::run(self, data, progress)?, progress)?;
        let mut notes = Vec::new();
        if !self.refine {
            return self.finished(&done, None, notes, progress);
        }
        let scope = Scope::new(self, &done, progress);
        let found = scope.equations(&done.regressed, &mut notes)?;
        if self.grow
            && found.as_ref().map_or(Ok(true), |found| scope.leaves_structure(found))?
            && let Some(grown) = scope.grown((&done.regressed, found.as_ref()))?
        {
            return grown.settings.finished(&grown.done, grown.member, grown.notes, progress);
        }
        self.finished(&done, found, notes, progress)
    }

    /// The result: what was found, or the regression where the refinement found nothing better.
    fn finished(
        &self,
        done: &Algorithm1,
        found: Option<Member>,
        mut notes: Vec<Note>,
        progress: &dyn Progress,
    ) -> Result<Identification> {
        let scope = Scope::new(self, done, progress);
        let found = match found {
            Some(found) => scope.weighed(found, &mut notes)?,
            None => scope.unrefined(&done.regressed, inclusion(self, &done.regressed, &done.rows)?)?,
        };
        let mut notes = [done.motion.notes.clone(), done.logs.notes.clone(), notes].concat();
        if self.hold.is_none() && found.hold == Hold::Linear {
            notes.push(Note::Interpolated);
        }
        Ok(report(found, &done.regressed.chosen, &done.motion.kernels, notes))
    }
}

#[cfg(test)]
mod tests;
