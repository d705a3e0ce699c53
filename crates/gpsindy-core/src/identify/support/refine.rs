//! The refinement as one body: search, lengthen, agree, weigh.

use crate::error::Result;
use crate::identify::equations::Equations;
use crate::identify::notes::Note;
use crate::identify::support::lengthen::explodes;
use crate::identify::support::scope::{Member, Rollouts, Scope};

impl Scope<'_> {
    /// The equations of the best evidence on the raw measurements, from these starts; none where no start can be rolled out.
    pub(crate) fn refine(&self, starts: &[Equations], notes: &mut Vec<Note>) -> Result<Option<Member>> {
        let rollouts = match self.settings.window {
            Some(length) => Rollouts::Fixed(length),
            None => Rollouts::Growing(self.motion.shortest_window()),
        };
        let mut found = match self.search(starts, rollouts)? {
            Ok(found) => found,
            Err(error) => {
                notes.push(Note::NotRefined { reason: error.to_string() });
                return Ok(None);
            }
        };
        if self.needs_consensus(&found)? {
            found = self.agree(found, starts, notes)?;
        }
        if !found.trial.converged {
            notes.push(Note::Restless);
        }
        let fitter = self.fitter(found.hold);
        let within = 2.0 * found.window;
        if found.window < self.motion.longest_run() && explodes(&fitter, &found.trial, found.window, within)? {
            notes.push(Note::Unpredictable { within });
        }
        fitter.weigh_choice(&mut found.trial, found.window)?;
        if let Some((rival, lead)) = found.rival.take() {
            found.trial.allow_for(&rival, (0.5 * lead).exp().min(1.0));
        }
        Ok(Some(found))
    }
}
