//! The search for equations: from every start a fit, better supports, longer rollouts, and the other hold.

use crate::error::{Error, Result, unless_cancelled};
use crate::identify::algorithm1::timing::Timing;
use crate::identify::equations::Equations;
use crate::identify::limits::{INTERPOLATED, LOOKS, TIE};
use crate::identify::support::fit::Trial;
use crate::identify::support::scope::{Member, Rollouts, Scope};
use crate::parallel;
use crate::refine::Hold;

impl Scope<'_> {
    /// The equations of the best evidence, or why there are none.
    pub(crate) fn search(
        &self,
        starts: &[Equations],
        rollouts: Rollouts,
    ) -> Result<std::result::Result<Member, Error>> {
        let (trial, hold) = match self.best_of_starts(starts, rollouts.shortest())? {
            Ok(found) => found,
            Err(error) => return Ok(Err(error)),
        };
        let (trial, window) = self.lengthen(&self.fitter(hold), trial, rollouts)?;
        self.compare_holds(Member { trial, window, hold, rival: None }, rollouts).map(Ok)
    }

    /// The first fits and their better supports, from every start, with held and with interpolated controls where the rows
    /// left that open; the one of the best evidence, or why there is none.
    fn best_of_starts(&self, starts: &[Equations], window: f64) -> Result<std::result::Result<(Trial, Hold), Error>> {
        let likely = self.timings.iter().filter(|timing| !timing.unlikely);
        let pairs: Vec<(&Timing, &Equations)> =
            likely.flat_map(|timing| starts.iter().map(move |start| (timing, start))).collect();
        let fit = |&(timing, start): &(&Timing, &Equations)| {
            let equations = Equations { delays: timing.delays.clone(), ..start.clone() };
            (timing.hold, self.fitter(timing.hold).fit(&equations, window, None))
        };
        let (mut fitted, mut failure) = (Vec::new(), None);
        for (hold, fit) in parallel::map(&pairs, fit) {
            match fit {
                Ok(trial) => fitted.push((trial, hold)),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => failure = Some(error),
            }
        }
        self.keep_going()?;
        let rank = self.fitter(Hold::Zero).ranked(fitted.iter().map(|(trial, _)| trial));
        let mut best: Option<(Trial, Hold)> = None;
        for (trial, hold) in rank.into_iter().take(LOOKS).map(|k| fitted[k].clone()) {
            let fitter = self.fitter(hold);
            let trial = fitter.improve(trial, window, &|| self.keep_going())?;
            if best.as_ref().is_none_or(|(other, _)| fitter.lead(&trial, other) > TIE) {
                best = Some((trial, hold));
            }
        }
        let nothing = || Error::settings("no start of the search");
        Ok(best.ok_or_else(|| failure.unwrap_or_else(nothing)))
    }

    /// The hold that explains long rollouts, since short ones hardly distinguish the two; and the equations under the other
    /// one, with their lead.
    ///
    /// The rival starts from the short rollouts as well: where motions are chaotic, no fit finds from the long ones of one hold
    /// to those of the other.
    fn compare_holds(&self, found: Member, rollouts: Rollouts) -> Result<Member> {
        let Some(other) = self.timings.iter().find(|timing| timing.hold != found.hold) else {
            return Ok(found);
        };
        let fitter = self.fitter(other.hold);
        let equations = Equations { delays: other.delays.clone(), ..found.trial.equations.clone() };
        let rival = unless_cancelled(fitter.fit(&equations, rollouts.shortest(), None))?;
        let Some(rival) = rival else { return Ok(found) };
        let (rival, window) = self.lengthen(&fitter, rival, rollouts)?;
        // Longer rollouts leave more, so that only equal ones compare.
        if window != found.window {
            return Ok(found);
        }
        let lead = fitter.lead(&rival, &found.trial);
        if lead < if other.hold == Hold::Linear { INTERPOLATED } else { -INTERPOLATED } {
            return Ok(Member { rival: Some((rival, lead)), ..found });
        }
        Ok(Member { trial: rival, window, hold: other.hold, rival: Some((found.trial, -lead)) })
    }
}
