//! Identification of equations from logs: Algorithm 1 of the paper and its refinement, as one body.
//!
//! Smooth the states, form the rows of the regression and select terms by sparse regression. Then refine by simulation: fit
//! coefficients, delays and initial states to the raw measurements, and drop, add and exchange terms by evidence.

mod algorithm1;
mod author;
mod bounds;
mod equations;
mod evidence;
mod excerpt;
mod grow;
mod limits;
mod names;
mod notes;
mod online;
mod outlook;
mod prepare;
mod report;
mod result;
mod saturating;
mod searched;
mod settings;
mod starting;
mod support;
mod velocities;

pub use author::{Author, AuthorResult};
pub use names::Regression;
pub use notes::Note;
pub use online::{Estimate, Online, OnlineSettings};
pub use outlook::{Doubt, Exchange, LeftOut, Outlook};
pub use result::{DelayReport, Fidelity, Identification, StateReport};
pub use settings::{Choice, Delay, Identify, SensorRange, Target};

use crate::data::Dataset;
use crate::error::Result;
use crate::progress::Progress;
use crate::refine::Hold;
use algorithm1::Algorithm1;
use algorithm1::regress::inclusion;
use excerpt::excerpt;
use limits::{MOST_SAMPLES, SEARCHED};
use report::report;
use searched::Searched;
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
        self.check_numbers(data.channels())?;
        if let Some(bounded) = self.with_numbers_bounded(data)?.filter(|bounded| bounded.library != self.library) {
            return bounded.fit(data, progress);
        }
        if let Some(started) = self.with_numbers_started(data, progress)? {
            let (settings, given) = started.into_given(data, progress)?;
            return match given {
                Some(searched) => searched.identification(progress),
                None => settings.fit(data, progress),
            };
        }
        let Some((part, note)) = excerpt(self, data, MOST_SAMPLES)? else { return self.fit_all(data, progress) };
        let mut found = Self { train_fraction: 1.0, ..self.clone() }.fit_all(&part, progress)?;
        found.notes.insert(0, note);
        Ok(found)
    }

    /// Learns from all samples; the terms are looked for in an excerpt where there are many.
    fn fit_all(&self, data: &Dataset, progress: &dyn Progress) -> Result<Identification> {
        let part = if self.refine { excerpt(self, data, SEARCHED)? } else { None };
        let Some((part, _)) = part else { return self.searched(data, progress)?.identification(progress) };
        let searched = Self { train_fraction: 1.0, ..self.clone() }.searched(&part, progress)?;
        match searched.fitted_to(self, data, progress)? {
            Some(whole) => whole.identification(progress),
            None => self.searched(data, progress)?.identification(progress),
        }
    }

    /// Algorithm 1 and the equations of the best evidence.
    fn searched(&self, data: &Dataset, progress: &dyn Progress) -> Result<Searched> {
        let done = self.chosen(Algorithm1::run(self, data, progress)?, progress)?;
        let mut notes = Vec::new();
        if !self.refine {
            return Ok(Searched { settings: self.clone(), done, member: None, notes });
        }
        let scope = Scope::new(self, &done, progress);
        let member = scope.equations(&done.regressed, &mut notes)?;
        let leaves = self.grow && member.as_ref().map_or(Ok(true), |found| scope.leaves_structure(found))?;
        let grown = if leaves { scope.grown((&done.regressed, member.as_ref()))? } else { None };
        let found = grown.unwrap_or_else(|| Searched { settings: self.clone(), done, member, notes });
        if self.grow && (leaves || found.is_long()) { found.saturating(self, progress) } else { Ok(found) }
    }
}

impl Searched {
    /// The result: what was found, or the regression where the refinement found nothing better.
    fn identification(self, progress: &dyn Progress) -> Result<Identification> {
        let Self { settings, done, member, mut notes } = self;
        let scope = Scope::new(&settings, &done, progress);
        let found = match member {
            Some(found) => scope.weighed(found, &mut notes)?,
            None => scope.unrefined(&done.regressed, inclusion(&settings, &done.regressed, &done.rows)?)?,
        };
        let mut notes = [done.motion.notes.clone(), done.logs.notes.clone(), notes].concat();
        notes.extend(found.equations.numbers_at_bounds());
        if settings.hold.is_none() && found.hold == Hold::Linear {
            notes.push(Note::Interpolated);
        }
        Ok(report(found, &done.regressed.chosen, &done.motion.kernels, notes))
    }
}

#[cfg(test)]
mod tests;
