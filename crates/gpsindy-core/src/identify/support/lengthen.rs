//! Lengthens the rollouts step by step: short ones first, because even a wrong equation follows the logs in them; then as long
//! as the rollouts follow the logs, because long ones carry more information.

use crate::error::{Error, Result, unless_cancelled};
use crate::identify::limits::{GROWTH, ON_COURSE, UNCHANGED};
use crate::identify::support::fit::{Fitter, Trial};
use crate::identify::support::scope::{Member, Rollouts, Scope};

impl Scope<'_> {
    /// The equations with rollouts that grow while they stay on course, the terms looked at again wherever they show something
    /// new; and the length of the last ones, s.
    pub(crate) fn lengthen(&self, fitter: &Fitter<'_>, trial: Trial, rollouts: Rollouts) -> Result<(Trial, f64)> {
        let (mut best, mut window) = match rollouts {
            Rollouts::Fixed(length) => return Ok((trial, length)),
            Rollouts::Growing(shortest) => (trial, shortest),
        };
        let keep_going = || self.keep_going();
        let whole = self.motion.longest_run();
        // Whether the terms were looked at since the rollouts last grew.
        let mut fresh = true;
        while window < whole {
            keep_going()?;
            let longer = (2.0 * window).min(whole);
            if explodes(fitter, &best, window, longer)? {
                break;
            }
            match fitter.fit(&best.equations, longer, Some(&best)) {
                Ok(trial) if growth(&best, &trial) <= ON_COURSE => {
                    fresh = false;
                    let unchanged = growth(&best, &trial) <= UNCHANGED;
                    (best, window) = (trial, longer);
                    if unchanged {
                        continue;
                    }
                }
                _ if fresh => break,
                // The terms of shorter rollouts may be too few for longer ones.
                _ => {}
            }
            best = fitter.improve(best, window, &keep_going)?;
            fresh = true;
        }
        if !fresh {
            best = fitter.improve(best, window, &keep_going)?;
        }
        Ok((best, window))
    }

    /// The same terms with rollouts that grow while they stay on course, and the length of the last ones, s.
    pub(crate) fn stretch(&self, fitter: &Fitter<'_>, trial: Trial, rollouts: Rollouts) -> Result<(Trial, f64)> {
        let (mut best, mut window) = match rollouts {
            Rollouts::Fixed(length) => return Ok((trial, length)),
            Rollouts::Growing(shortest) => (trial, shortest),
        };
        let whole = self.motion.longest_run();
        while window < whole {
            self.keep_going()?;
            let longer = (2.0 * window).min(whole);
            if explodes(fitter, &best, window, longer)? {
                break;
            }
            match fitter.fit(&best.equations, longer, Some(&best)) {
                Ok(trial) if growth(&best, &trial) <= ON_COURSE => (best, window) = (trial, longer),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                _ => break,
            }
        }
        Ok((best, window))
    }

    /// The same terms fitted to longer and longer rollouts, on course or not: short ones with free starts hide where an
    /// approximation leads in the end.
    pub(crate) fn with_longer_rollouts(&self, member: &Member) -> Result<Vec<Member>> {
        let fitter = self.fitter(member.hold);
        let whole = self.motion.longest_run();
        let (mut near, mut window) = (member.trial.clone(), member.window);
        let mut found = Vec::new();
        while window < whole {
            self.keep_going()?;
            let longer = (2.0 * window).min(whole);
            if explodes(&fitter, &near, window, longer)? {
                break;
            }
            window = longer;
            let trial = unless_cancelled(fitter.fit(&near.equations, window, Some(&near)))?;
            let Some(trial) = trial else { break };
            near = trial;
            found.push(Member { trial: near.clone(), window, hold: member.hold, rival: None });
        }
        Ok(found)
    }
}

/// Whether small differences would outgrow their derivatives in rollouts of `longer` seconds: what grows by a in `window`
/// seconds grows by a^2 in twice as many.
pub(crate) fn explodes(fitter: &Fitter<'_>, trial: &Trial, window: f64, longer: f64) -> Result<bool> {
    Ok(fitter.amplification(trial, window)?.powf(longer / window) > GROWTH)
}

/// By how much the residual of a column grows with longer rollouts, at most.
fn growth(short: &Trial, long: &Trial) -> f64 {
    short.noise.iter().zip(&long.noise).map(|(short, long)| long / short).fold(0.0, f64::max)
}
