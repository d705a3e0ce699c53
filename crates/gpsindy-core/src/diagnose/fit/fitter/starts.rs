//! Starts of the windows of a simulator that steps: a fit goes over no stop and no limit, so that they are looked for beside it.

use super::Fitter;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, CHAIN_GAIN, CHAINED, DOUBTED, POOR};
use crate::error::{Result, unless_refused};
use crate::refine::{Experiment, drawn_starts, first_starts, guess_starts, nearer_starts};
use std::sync::Arc;

impl Fitter {
    /// The same contestant, the windows of a simulator that steps whose residuals stand out fitted once more from the best of several drawn
    /// starts. What a local minimum of a start leaves looks like a gap, and whatever has a further parameter would get the credit.
    pub(crate) fn redrawn(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        if doubted(&contestant).is_empty() {
            return Ok(contestant);
        }
        let contestant = self.chained(contestant, budget)?;
        let doubted = doubted(&contestant);
        if doubted.is_empty() {
            return Ok(contestant);
        }
        let Contestant { system, experiment, refined, .. } = &contestant;
        let drawn = drawn_starts(system, experiment, &refined.parameters, &doubted)?;
        let moved = self.carried_on(moved_to(contestant.clone(), doubted, drawn), budget)?;
        Ok(if moved.evidence.squares() < contestant.evidence.squares() { moved } else { contestant })
    }

    /// The same contestant, its fit carried on; of a simulator that steps for as long as that helps, since each fit hands what it found along
    /// the motion to one window more.
    fn chained(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let mut best = contestant;
        for _ in 0..CHAINED {
            let helps;
            (best, helps) = self.linked(best, budget)?;
            if !helps {
                break;
            }
        }
        Ok(best)
    }

    /// One fit of such a chain, and whether another one may help.
    pub(crate) fn linked(self, contestant: Contestant, budget: Budget) -> Result<(Contestant, bool)> {
        if contestant.system.engine().is_none() {
            return Ok((self.carried_on(contestant, budget)?, false));
        }
        let before = contestant.evidence.squares();
        let next = self.carried_on(contestant.clone(), budget)?;
        let after = next.evidence.squares();
        Ok((if after < before { next } else { contestant }, after < before * (1.0 - CHAIN_GAIN)))
    }

    /// The same contestant with the starts that its windows' first samples determine, for fits that go on from it. The fit of a simulator that
    /// steps pulls its starts off where it lacks something, over stops and limits from which a better model does not find back.
    pub(crate) fn with_beginnings(self, contestant: &Contestant) -> Result<Contestant> {
        let Contestant { system, experiment, refined, .. } = contestant;
        if system.engine().is_none() {
            return Ok(contestant.clone());
        }
        let beginnings = Some(Arc::new(first_starts(system, experiment, &refined.parameters)?));
        Ok(Contestant { beginnings, ..contestant.clone() })
    }

    /// The same contestant, its fit carried on with the windows whose residuals stand out at starts along ever longer beginnings, where those
    /// miss less. The starts of a simulator that steps end at stops and limits, and no fit goes back over those.
    pub(crate) fn refollowed(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let doubted = doubted(&contestant);
        if doubted.is_empty() {
            return Ok(contestant);
        }
        let Contestant { system, experiment, refined, .. } = &contestant;
        let windows = doubted.iter().map(|&w| experiment.windows[w]).collect();
        let few = Experiment { windows, ..experiment.clone() };
        let old: Vec<Vec<f64>> = doubted.iter().map(|&w| refined.initial[w].clone()).collect();
        let new = guess_starts(system, &few, &refined.parameters)?;
        let nearer = nearer_starts(system, &few, &refined.parameters, [&old, &new]);
        self.carried_on(moved_to(contestant, doubted, nearer), budget)
    }

    /// The same contestant, fitted once more from the initial states that the logs show, where that is better.
    ///
    /// A poor model pulls the initial states of its windows off, and a better one that starts there may stay there.
    pub(crate) fn restarted(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let is_poor = contestant.evidence.misfit() >= POOR;
        // Starts of a simulator that steps end at stops and saturations, too few of them to make the whole fit a poor one.
        if !is_poor && doubted(&contestant).is_empty() {
            return Ok(contestant);
        }
        let again = self.on(&contestant, &contestant.experiment, budget);
        let Some(other) = unless_refused(again)? else { return Ok(contestant) };
        let is_better_in = |w: usize| {
            let cost = |fit: &Contestant| {
                fit.refined.residuals[w].iter().filter(|e| e.is_finite()).map(|e| e * e).sum::<f64>()
            };
            cost(&other) < cost(&contestant)
        };
        // Each window from the better of its two starts.
        let moved: Vec<usize> = (0..contestant.experiment.windows.len()).filter(|&w| is_better_in(w)).collect();
        if moved.is_empty() {
            return Ok(contestant);
        }
        let is_better = other.evidence.squares() < contestant.evidence.squares();
        let mut mixed = if is_better { other.clone() } else { contestant.clone() };
        for w in 0..mixed.refined.initial.len() {
            let from = if moved.contains(&w) { &other } else { &contestant };
            mixed.refined.initial[w].clone_from(&from.refined.initial[w]);
        }
        let mixed = self.carried_on(mixed, budget)?;
        let best = if is_better { other } else { contestant };
        Ok(if mixed.evidence.squares() < best.evidence.squares() { mixed } else { best })
    }
}

/// Windows of a simulator that steps whose residuals stand out among all windows'.
fn doubted(contestant: &Contestant) -> Vec<usize> {
    match contestant.system.engine() {
        Some(_) => standing_out(&contestant.refined.residuals),
        None => Vec::new(),
    }
}

/// Windows whose mean squared residual is far above that of the middle one.
pub(crate) fn standing_out(residuals: &[Vec<f64>]) -> Vec<usize> {
    let mean = |window: &Vec<f64>| {
        let values = || window.iter().filter(|e| e.is_finite());
        values().map(|e| e * e).sum::<f64>() / values().count().max(1) as f64
    };
    let means: Vec<f64> = residuals.iter().map(mean).collect();
    let mut sorted = means.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(middle) = sorted.get(sorted.len() / 2) else { return Vec::new() };
    (0..means.len()).filter(|&w| means[w] > DOUBTED * middle).collect()
}

/// The same contestant with other starts of some windows.
fn moved_to(mut contestant: Contestant, windows: Vec<usize>, starts: Vec<Vec<f64>>) -> Contestant {
    for (window, start) in windows.into_iter().zip(starts) {
        contestant.refined.initial[window] = start;
    }
    contestant
}
