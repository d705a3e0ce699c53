//! The refinement as one body: search, agree, settle, simplify; then weigh.

use crate::error::Result;
use crate::identify::algorithm1::regress::Regressed;
use crate::identify::notes::Note;
use crate::identify::report::Found;
use crate::identify::support::lengthen::explodes;
use crate::identify::support::scope::{Member, Scope};
use crate::identify::support::starts::starts;

impl Scope<'_> {
    /// The equations of the best evidence on the raw measurements, from what the regression chose; none where nothing is better
    /// than that, or it can't be rolled out.
    pub(crate) fn equations(&self, regressed: &Regressed, notes: &mut Vec<Note>) -> Result<Option<Member>> {
        let starts = starts(regressed);
        let mut found = match self.search(&starts, self.rollouts())? {
            Ok(found) => found,
            Err(error) => {
                notes.push(Note::NotRefined { reason: error.to_string() });
                return Ok(None);
            }
        };
        if self.needs_consensus(&found)? {
            found = self.agree(found, &starts, notes)?;
        }
        let Some(mut found) = self.settle(found, regressed, notes)? else { return Ok(None) };
        found.trial = self.fitter(found.hold).simplify(found.trial, found.window, &|| self.keep_going())?;
        Ok(Some(found))
    }

    /// What is reported of `found`: how it predicts, and how sure each of its terms is.
    pub(crate) fn weighed(&self, mut found: Member, notes: &mut Vec<Note>) -> Result<Found> {
        if !found.trial.converged {
            notes.push(Note::Restless);
        }
        let fitter = self.fitter(found.hold);
        let within = 2.0 * found.window;
        if found.window < self.motion.longest_run() && explodes(&fitter, &found.trial, found.window, within)? {
            notes.push(Note::Unpredictable { within });
        }
        let fidelity = self.fidelity(&found.trial.equations, found.hold)?;
        let linear = fitter.linearise(&found.trial, found.window)?;
        let foreseen = fidelity.map_or(f64::INFINITY, |fidelity| fidelity.length);
        let outlook = self.outlook(&found, &linear, foreseen, notes)?;
        fitter.weigh_choice(&mut found.trial, &linear);
        if let Some((rival, lead)) = found.rival.take() {
            found.trial.allow_for(&rival, (0.5 * lead).exp().min(1.0));
        }
        Ok(found.found(self.settings.ensemble > 0, fidelity, Some(outlook)))
    }
}
