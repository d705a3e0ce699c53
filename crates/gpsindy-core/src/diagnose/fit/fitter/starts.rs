//! Starts of the windows of a simulator that steps: a fit goes over no stop and no limit, so that they are looked for beside it.

use super::Fitter;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::start::{FEWEST_SAMPLES, UNTOLD};
use crate::diagnose::limits::{Budget, CHAIN_GAIN, CHAINED, DOUBTED, DOUBTED_COLUMN, MOST_DOUBTED, POOR, REDRAWN};
use crate::error::{Result, unless_refused};
use crate::refine::{
    Experiment, drawn_around, drawn_starts, draws_of_readings, first_starts, guess_starts, nearer_starts,
};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use std::collections::BTreeMap;
use std::sync::Arc;

impl Fitter {
    /// The same contestant, the windows of a simulator that steps whose residuals stand out fitted once more from the best of several drawn
    /// starts. What a local minimum of a start leaves looks like a gap, and whatever has a further parameter would get the credit. Where so many
    /// stand out that it is no matter of starts, they stay.
    pub(crate) fn redrawn(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        if doubted(&contestant).is_empty() {
            return Ok(contestant);
        }
        let contestant = self.chained(contestant, budget)?;
        let doubted = doubted(&contestant);
        let are_few = doubted.len() as f64 <= MOST_DOUBTED * contestant.experiment.windows.len() as f64;
        if doubted.is_empty() || !are_few {
            return Ok(contestant);
        }
        let mut draw = draws_of_readings(&contestant.system, &contestant.experiment);
        self.refitted(contestant, budget, doubted, &mut draw)
    }

    /// The same, of windows in which one column alone stands out, from starts of that column's place and rate: a servo that swings to its other
    /// side within the noise of its reading leaves a few samples of one joint, and draws of all joints at once rarely meet it.
    pub(crate) fn redrawn_by_column(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let mut best = contestant;
        for _ in 0..REDRAWN {
            let doubted = if best.system.engine().is_some() { columns_standing_out(&best) } else { Vec::new() };
            if doubted.is_empty() {
                break;
            }
            let squares = best.evidence.squares();
            let mut draw = draws_of_columns(&best, &doubted)?;
            best = self.refitted(best, budget, doubted.into_iter().map(|(w, _)| w).collect(), &mut draw)?;
            if best.evidence.squares() >= squares {
                break;
            }
        }
        Ok(best)
    }

    /// The same contestant from the starts of an `other` one on the same rollouts, in windows where those miss less.
    pub(crate) fn with_starts_of(
        self,
        contestant: Contestant,
        other: &Contestant,
        budget: Budget,
    ) -> Result<Contestant> {
        let Contestant { system, experiment, refined, .. } = &contestant;
        if system.engine().is_none() || experiment.windows != other.experiment.windows {
            return Ok(contestant);
        }
        let shared = contestant.nominal_states();
        let mut theirs = refined.initial.clone();
        theirs
            .iter_mut()
            .zip(&other.refined.initial)
            .for_each(|(own, other)| own[..shared].copy_from_slice(&other[..shared]));
        let nearer = nearer_starts(system, experiment, &refined.parameters, [&refined.initial, &theirs]);
        if nearer == refined.initial {
            return Ok(contestant);
        }
        let all = (0..experiment.windows.len()).collect();
        self.with_other_starts(contestant, budget, all, nearer)
    }

    /// Some windows fitted from the best of several drawn starts, where that is better.
    fn refitted(
        self,
        contestant: Contestant,
        budget: Budget,
        windows: Vec<usize>,
        draw: &mut dyn FnMut(usize) -> Vec<f64>,
    ) -> Result<Contestant> {
        let Contestant { system, experiment, refined, .. } = &contestant;
        let drawn = drawn_starts(system, experiment, &refined.parameters, &windows, draw)?;
        self.with_other_starts(contestant, budget, windows, drawn)
    }

    /// Some windows fitted from other starts, where that is better.
    fn with_other_starts(
        self,
        contestant: Contestant,
        budget: Budget,
        windows: Vec<usize>,
        starts: Vec<Vec<f64>>,
    ) -> Result<Contestant> {
        let moved = self.carried_on(moved_to(contestant.clone(), windows, starts), budget)?;
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

/// Windows with the column whose residuals there stand out most among that column's.
fn columns_standing_out(contestant: &Contestant) -> Vec<(usize, usize)> {
    let n_columns = contestant.experiment.columns.len();
    let mut all: Vec<(usize, usize, f64)> = Vec::new();
    for c in 0..n_columns {
        let of_column = |window: &Vec<f64>| window.iter().skip(c).step_by(n_columns).copied().collect();
        let column: Vec<Vec<f64>> = contestant.refined.residuals.iter().map(of_column).collect();
        let count = |w: usize| column[w].iter().filter(|e| e.is_finite()).count().max(1) as f64;
        let deviation = |w: usize| (2.0 / count(w)).sqrt();
        let beyond =
            times_middle(&column).into_iter().enumerate().map(|(w, times)| (w, c, (times - 1.0) / deviation(w)));
        all.extend(beyond.filter(|(_, _, beyond)| *beyond > DOUBTED_COLUMN));
    }
    all.sort_by(|a, b| a.0.cmp(&b.0).then(b.2.total_cmp(&a.2)));
    all.dedup_by_key(|(w, _, _)| *w);
    all.into_iter().map(|(w, c, _)| (w, c)).collect()
}

/// Draws of some windows' starts: place and rate of one column each, in turn about their first readings and about what was fitted, as far as the
/// window's first samples leave it open. What comes later holds them where an event is that the true start has not.
fn draws_of_columns(
    contestant: &Contestant,
    doubted: &[(usize, usize)],
) -> Result<impl FnMut(usize) -> Vec<f64> + use<>> {
    let Contestant { system, experiment, refined, .. } = contestant;
    let blocks = contestant.linearised()?.jacobian.blocks;
    let model = system.model();
    let far: Vec<f64> = experiment.scale.iter().map(|scale| UNTOLD * scale).collect();
    let few = FEWEST_SAMPLES * experiment.columns.len();
    let one = |&(w, c): &(usize, usize)| {
        let state = experiment.columns[c];
        let is_own =
            |j: &usize| *j == state || model.integral_of(*j) == Some(state) || model.integral_of(state) == Some(*j);
        let own: Vec<usize> = (0..system.n_states()).filter(is_own).collect();
        (w, (blocks[w].known_start(few, &own, &far), own))
    };
    let known: BTreeMap<usize, _> = doubted.iter().map(one).collect();
    let (starts, mut random, mut is_of_fit) = (refined.initial.clone(), ChaCha8Rng::seed_from_u64(0), false);
    let mut of_readings = draws_of_readings(system, experiment);
    Ok(move |w: usize| {
        let mut start = starts[w].clone();
        let Some((Some(known), own)) = known.get(&w) else { return start };
        is_of_fit = !is_of_fit;
        let drawn: Vec<f64> = if is_of_fit {
            let part: Vec<f64> = own.iter().map(|&j| start[j]).collect();
            drawn_around(&part, known, &mut random).0
        } else {
            let read = of_readings(w);
            own.iter().map(|&j| read[j]).collect()
        };
        own.iter().zip(drawn).for_each(|(&j, value)| start[j] = value);
        start
    })
}

/// Windows whose mean squared residual is far above that of the middle one.
pub(crate) fn standing_out(residuals: &[Vec<f64>]) -> Vec<usize> {
    let times = times_middle(residuals);
    (0..times.len()).filter(|&w| times[w] > DOUBTED).collect()
}

/// Every window's mean squared residual over the middle one's.
fn times_middle(residuals: &[Vec<f64>]) -> Vec<f64> {
    let means = mean_squares(residuals);
    let mut sorted = means.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    means.into_iter().map(|mean| mean / middle).collect()
}

/// Windows whose mean squared residual is far above the noise.
pub(crate) fn above_noise(residuals: &[Vec<f64>]) -> Vec<usize> {
    let means = mean_squares(residuals);
    (0..means.len()).filter(|&w| means[w] > DOUBTED).collect()
}

fn mean_squares(residuals: &[Vec<f64>]) -> Vec<f64> {
    let mean = |window: &Vec<f64>| {
        let values = || window.iter().filter(|e| e.is_finite());
        values().map(|e| e * e).sum::<f64>() / values().count().max(1) as f64
    };
    residuals.iter().map(mean).collect()
}

/// The same contestant with other starts of some windows.
fn moved_to(mut contestant: Contestant, windows: Vec<usize>, starts: Vec<Vec<f64>>) -> Contestant {
    for (window, start) in windows.into_iter().zip(starts) {
        contestant.refined.initial[window] = start;
    }
    contestant
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::stepping::Stepping;
    use crate::refine::guess_initial;

    #[test]
    fn a_start_on_the_wrong_side_of_a_servo_s_limit_is_drawn_anew() {
        let (system, data) = Stepping::shaken_servo();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3, 1e-2])).unwrap().with_windows_of(0.95);
        let fitter = Fitter::default();
        let good = fitter.nominal_watched(system.clone(), experiment.clone(), Vec::new(), Budget::Usual, &|_| Ok(()));
        let windows = (0..experiment.windows.len()).step_by(5).collect();
        let starts = guess_initial(&system, &experiment).into_iter().step_by(5).collect();
        let bad = fitter.carried_on(moved_to(good.unwrap(), windows, starts), Budget::Usual).unwrap();
        let stands_out = columns_standing_out(&bad).len();
        let found = fitter.redrawn_by_column(bad.clone(), Budget::Usual).unwrap();
        let [before, after] = [&bad, &found].map(|fit| fit.evidence.squares() / fit.experiment.n_values() as f64);
        assert!(stands_out > 0 && before > 1.4, "{stands_out} windows, {before}");
        assert!(after < 1.2, "{before} and {after}");
    }
}
