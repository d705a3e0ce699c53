//! Makes contestants: fits a model with hypotheses to the training logs.

pub(crate) mod begun;
mod starts;

pub(crate) use starts::{above_noise, standing_out};

use crate::diagnose::catalogue::hypothesis::{Added, Applied};
use crate::diagnose::fit::contestant::{Contestant, Entrant, is_open};
use crate::diagnose::fit::evidence::Evidence;
use crate::diagnose::fit::lagging::{scale_lagging, with_lagging};
use crate::diagnose::fit::tried::breakaway::rested;
use crate::diagnose::fit::tried::late;
use crate::diagnose::fit::{by_run, tried};
use crate::diagnose::limits::{BEHIND, Budget, FAR, HOPELESS, OUT_OF_REACH, START_SAMPLES};
use crate::error::{Result, unless_refused};
use crate::model::System;
use crate::refine::{
    Experiment, Free, Past, Point, Refine, Refined, Starts, Window, chained_starts, costs, guess_starts, nearer_starts,
};
use std::sync::Arc;

/// Makes contestants of one diagnosis.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Fitter {
    /// Mean squared structure (noise units) that the model owes to its own making and not to the machine.
    pub(crate) model_error: f64,
}

impl Fitter {
    /// The nominal model with its initial states and the parameters in `free` fitted.
    pub(crate) fn nominal(
        self,
        system: System,
        experiment: Experiment,
        free: Vec<Free>,
        budget: Budget,
    ) -> Result<Contestant> {
        self.redrawn(self.nominal_watched(system, experiment, free, budget, &|_| Ok(()))?, budget)
    }

    /// As [`Fitter::nominal`], and no start is drawn anew; `watch` is called with the number of steps done, and may end the fit with an error.
    pub(crate) fn nominal_watched(
        self,
        system: System,
        experiment: Experiment,
        free: Vec<Free>,
        budget: Budget,
        watch: &dyn Fn(usize) -> Result<()>,
    ) -> Result<Contestant> {
        let at = (&system.parameter_values()[..], &free[..]);
        let (refined, _) = budget.refine().fit_watched(&system, &experiment, at, None, watch)?;
        let evidence = Evidence::of(&experiment, &refined, &free, (0, 0), self.model_error);
        let nominal = Contestant {
            hypotheses: Vec::new(),
            searches: Vec::new(),
            tried: Vec::new(),
            added: Vec::new(),
            system,
            experiment,
            free,
            refined,
            evidence,
            beginnings: None,
        };
        if starts(&nominal).more > 0.0 { self.carried_on(nominal, budget) } else { Ok(nominal) }
    }

    /// `base` with more hypotheses at once, fitted from the best of several `values` of their parameters.
    pub(crate) fn with(
        self,
        base: &Contestant,
        entrants: &[Entrant<'_>],
        applied: &Applied,
        values: &[Vec<f64>],
        budget: Budget,
    ) -> Result<Contestant> {
        let (system, parameters) = base.written(applied)?;
        let mut free = base.free.clone();
        // What is already beyond its lower end stays there.
        let stays = |place: usize, added: &Added| {
            added
                .beyond()
                .is_some_and(|beyond| !values.is_empty() && values.iter().all(|v| v.get(place) == Some(&beyond)))
        };
        for (place, (index, added)) in applied.fitted.iter().enumerate() {
            free.retain(|f| f.parameter != *index);
            if added.is_tried() || stays(place, added) {
                continue;
            }
            free.push(Free { lower: added.lower, upper: added.upper, ..Free::new(*index, added.scale) });
        }
        let mut experiment = Experiment { starts: starts(base), ..base.experiment.clone() };
        scale_lagging(&mut experiment, applied);
        let lagging =
            |initial: &[Vec<f64>]| with_lagging(&system, &experiment, initial.to_vec(), base.system.n_states());
        let initial = lagging(&base.refined.initial);
        let starts = values.iter().map(|values| {
            let mut start = parameters.clone();
            for (place, ((index, added), &value)) in applied.fitted.iter().zip(values).enumerate() {
                start[*index] = if stays(place, added) { value } else { value.clamp(added.lower, added.upper) };
            }
            start
        });
        let mut starts: Vec<Vec<f64>> = starts.collect();
        let chosen = if starts.len() > 1 { nearest(&system, &experiment, &starts, &initial, &free) } else { 0 };
        let parameters = if starts.is_empty() { parameters } else { starts.swap_remove(chosen) };
        let initial = match &base.beginnings {
            Some(first) => nearer_starts(&system, &experiment, &parameters, [&initial, &lagging(first)]),
            None => initial,
        };
        let mut point = Point { parameters, initial };
        // A search by trial costs more than all else of a first step, and most suspects take no second one. Along straight lines it is cheap.
        if budget != Budget::Glance || system.engine().is_some() {
            let new = applied.each().zip(entrants).filter(|(own, entrant)| is_open(entrant.is_tried, own));
            let untried: Vec<(usize, Added)> = new.flat_map(|(own, _)| own).cloned().collect();
            tried::settle(base, (&system, &experiment), (&untried, &free), (&mut point, budget))?;
        }
        let Point { parameters, initial } = point;
        let kept = base.refined.kept.as_ref();
        let refine =
            Refine { hopeless: HOPELESS * base.refined.cost, ..budget.refine_of(base.evidence.effective_count()) };
        let fit = |experiment: &Experiment| refine.fit_on(&system, experiment, (&parameters, &free), &initial, kept);
        let mut refined = fit(&experiment)?;
        if entrants.iter().any(|e| e.hypothesis.reads_the_past()) {
            // What the late sensor saw before the log is as the logs have it.
            let other = match experiment.past {
                Past::Still => Past::Moving,
                Past::Moving => Past::Still,
            };
            let moved = Experiment { past: other, ..experiment.clone() };
            if let Some(better) = unless_refused(fit(&moved))?.filter(|f| f.cost < refined.cost) {
                (refined, experiment) = (better, moved);
            }
        }
        let mut with = Contestant { system, experiment, free, refined, beginnings: None, ..base.clone() };
        with.hypotheses.extend(entrants.iter().map(|e| e.hypothesis.clone()));
        with.searches.extend(entrants.iter().map(|e| e.searches));
        with.tried.extend(entrants.iter().map(|e| e.is_tried));
        with.added.extend(applied.each().map(<[_]>::to_vec));
        self.judge(&mut with);
        if budget.only_ranks() { Ok(with) } else { self.beyond(with, budget) }
    }

    /// The same contestant with parameters beyond their lower ends, where that is better.
    ///
    /// Dry friction that holds at rest is the limit of a corner that gets ever sharper, but no fit goes there on its own: long
    /// rollouts find another corner first that suits one of their stops. Rivals are compared in the form that suits each of
    /// them, as one of another kind would use what is left of the corner.
    fn beyond(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let all: Vec<(usize, f64)> = contestant.beyond().collect();
        let mut best = contestant;
        for (parameter, value) in all {
            let mut other = best.clone();
            other.refined.parameters[parameter] = value;
            other.free.retain(|f| f.parameter != parameter);
            let Contestant { system, experiment, free, .. } = &other;
            let fit = |refine: Refine, from: &Refined| {
                let at = (&from.parameters[..], &free[..]);
                unless_refused(refine.fit_on(system, experiment, at, &from.initial, from.kept.as_ref()))
            };
            // A simulator that steps would make its derivatives twice.
            let first = match system.engine() {
                Some(_) => Some(other.refined.clone()),
                None => fit(Budget::Glance.refine(), &other.refined)?,
            };
            let Some(first) = first.filter(|first| first.cost <= OUT_OF_REACH * best.refined.cost) else { continue };
            let hopeless = BEHIND * best.refined.cost;
            let refine = Refine { hopeless, ..budget.refine_of(other.evidence.effective_count()) };
            let Some(refined) = fit(refine, &first)? else { continue };
            other.refined = refined;
            self.judge(&mut other);
            if other.evidence.score() > best.evidence.score() {
                best = other;
            }
        }
        Ok(best.all_tried())
    }

    /// The same contestant, its fit carried on.
    pub(crate) fn carried_on(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let carried = self.stepped_on(contestant, budget)?;
        if budget.only_ranks() { Ok(carried) } else { self.beyond(carried, budget) }
    }

    fn stepped_on(self, contestant: Contestant, budget: Budget) -> Result<Contestant> {
        let experiment = Experiment { starts: starts(&contestant), ..contestant.experiment.clone() };
        let Contestant { system, free, refined: Refined { parameters, initial, kept, .. }, .. } = &contestant;
        let mut point = Point { parameters: parameters.clone(), initial: initial.clone() };
        if system.engine().is_some() {
            point.initial =
                chained_starts(system, (&experiment, &experiment.windows), &point.parameters, &point.initial);
        }
        // What was left out at the first step.
        if budget == Budget::Rough && system.engine().is_none() {
            let untried: Vec<(usize, Added)> = contestant.untried().cloned().collect();
            tried::settle(&contestant, (system, &experiment), (&untried, free), (&mut point, budget))?;
        }
        if !budget.only_ranks() {
            let all: Vec<(usize, Added)> = contestant.added.iter().flatten().cloned().collect();
            late::settle(&contestant, (system, &experiment), (&all, free), (&mut point, budget))?;
        }
        let at = (&point.parameters[..], &free[..]);
        let refine = budget.refine_of(contestant.evidence.effective_count());
        let fit = refine.fit_on(system, &experiment, at, &point.initial, kept.as_ref());
        // Where not one step further can be taken it stays where it is.
        let Some(refined) = unless_refused(fit)? else { return Ok(contestant) };
        let mut carried = Contestant { refined, experiment, ..contestant };
        self.judge(&mut carried);
        Ok(carried)
    }

    /// The same contestant on other windows or with another hold, fitted again from where it is.
    pub(crate) fn on(self, contestant: &Contestant, experiment: &Experiment, budget: Budget) -> Result<Contestant> {
        let own = &contestant.experiment;
        // The logs are the same, but for what effects have of their own in each.
        let (scale, logs) = (own.scale.clone(), own.logs.clone());
        let experiment = Experiment { scale, logs, starts: starts(contestant), ..experiment.clone() };
        let n = contestant.system.n_states();
        // A window that starts where an earlier one did starts as that one was fitted.
        let place = |window: &Window| own.windows.iter().position(|w| w.log == window.log && w.first == window.first);
        let known = |window| place(window).map(|place| contestant.refined.initial[place][..n].to_vec());
        let is_moved = experiment.windows != own.windows;
        let known: Vec<_> = experiment.windows.iter().map(|w| if is_moved { known(w) } else { None }).collect();
        let guess = match known.iter().cloned().collect::<Option<Vec<_>>>() {
            Some(all) => all,
            None => {
                let guess = guess_starts(&contestant.system, &experiment, &contestant.refined.parameters)?;
                known.into_iter().zip(guess).map(|(known, guess)| known.unwrap_or(guess)).collect()
            }
        };
        let initial = with_lagging(&contestant.system, &experiment, guess, contestant.nominal_states());
        let initial = rested(&contestant.system, &experiment, &contestant.refined.parameters, &initial);
        let at = (&contestant.refined.parameters[..], &contestant.free[..]);
        let kept = contestant.refined.kept.as_ref();
        let refine = budget.refine_of(contestant.evidence.effective_count());
        let refined = refine.fit_on(&contestant.system, &experiment, at, &initial, kept)?;
        let mut moved = Contestant { experiment, refined, ..contestant.clone() };
        self.judge(&mut moved);
        Ok(moved)
    }

    /// The evidence of a contestant whose fit has changed.
    fn judge(self, contestant: &mut Contestant) {
        // What is beyond its end is fitted no more.
        let is_free = |index: usize| contestant.free.iter().any(|f| f.parameter == index);
        let fitted = contestant.added.iter().flatten().filter(|(index, a)| is_free(*index) || a.beyond().is_none());
        let fitted = fitted.count();
        let own =
            by_run::sizes_of_their_own(&contestant.experiment) + begun::places(contestant) + contestant.given_starts();
        let brought = (fitted + own, contestant.added_starts());
        let Contestant { experiment, refined, free, .. } = &*contestant;
        contestant.evidence = Evidence::of(experiment, refined, free, brought, self.model_error);
    }
}

/// By how much the first samples of the windows count more than the others: where logs are cut into windows, every
/// state is logged, and what is left is no noise, as much as it is larger than noise can be.
///
/// A start for every short window could take up what an effect should explain. Where a state is not logged, the first
/// samples do not determine the start.
pub(crate) fn starts(contestant: &Contestant) -> Starts {
    let experiment = &contestant.experiment;
    let is_cut = experiment.windows.len() > experiment.logs.len();
    if is_cut && experiment.columns.len() >= contestant.nominal_states() {
        Starts {
            samples: START_SAMPLES * contestant.experiment.rows_a_value(),
            more: (contestant.evidence.misfit() - FAR).max(0.0),
        }
    } else {
        Starts::default()
    }
}

/// `base` with the tolerated parameters and the initial states of another contestant, as starts of further fits; and with its residual,
/// which says how much the first samples of their windows count, and from which cost a fit is no rival: fits that count them otherwise end
/// elsewhere.
pub(crate) fn standing_at(base: &Contestant, other: &Contestant) -> Contestant {
    let mut moved = base.clone();
    for free in &base.free {
        if let Some(&value) = other.refined.parameters.get(free.parameter) {
            moved.refined.parameters[free.parameter] = value;
        }
    }
    if base.experiment.windows == other.experiment.windows {
        let n = base.system.n_states();
        for (own, theirs) in moved.refined.initial.iter_mut().zip(&other.refined.initial) {
            own.copy_from_slice(&theirs[..n.min(theirs.len())]);
        }
        moved.experiment = begun::as_in(&moved.experiment, &other.experiment);
        moved.evidence.clone_from(&other.evidence);
        moved.refined.cost = other.refined.cost;
        moved.beginnings.clone_from(&other.beginnings);
        if let Some(kept) = other.refined.kept.as_ref().filter(|_| base.system.engine().is_none()) {
            moved.refined.kept = Some(Arc::new(kept.of_parameters_in(&base.system)));
        }
    }
    moved
}

/// Which of several sets of parameters leaves the smallest residual from the same initial states.
fn nearest(
    system: &System,
    experiment: &Experiment,
    parameters: &[Vec<f64>],
    initial: &[Vec<f64>],
    free: &[Free],
) -> usize {
    let points: Vec<Point> =
        parameters.iter().map(|p| Point { parameters: p.clone(), initial: initial.to_vec() }).collect();
    let costs = costs(system, experiment, &points, free);
    (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
}

/// A hypothesis of the tests, which no search chose.
#[cfg(test)]
pub(crate) fn unsearched(hypothesis: &crate::diagnose::catalogue::hypothesis::Hypothesis) -> Entrant<'_> {
    Entrant::new(hypothesis, crate::diagnose::fit::contestant::Searches::NONE)
}
