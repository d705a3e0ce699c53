//! Gross errors, found by trial: numbers of a simulator that are off by a factor, and dry friction that holds a machine.
//!
//! A straight line says what a number does near its value. Of a gain ten times too large it says little: the servo saturates at every step, and no
//! small change of the gain shows. So every number is tried at a few multiples of its value, before anything else moves. And a machine that comes to
//! rest is elsewhere than a nominal one that swings on: along the path of that one no friction shows. So it is tried at a few levels.

use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::lagging::with_lagging;
use crate::diagnose::limits::{CONVINCING, GROSS, GROSSEST, HOLDING, LOOKED};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::survey::{Screened, Survey};
use crate::error::{Result, unless_refused};
use crate::refine::{Experiment, Point, costs, guess_initial};

/// A suspect that is far from nothing nearer to the logs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gross {
    pub(crate) hypothesis: usize,
    /// What its fit begins with.
    pub(crate) values: Vec<f64>,
    /// By how much the sum of squares falls there.
    pub(crate) gain: f64,
}

/// The suspects of which trials gain most, best first.
pub(crate) fn gross(contest: &Contest<'_>, base: &Contestant, survey: &Survey) -> Result<Vec<Gross>> {
    if contest.run.is_out_of_time() {
        return Ok(Vec::new());
    }
    let is_engine = base.system.engine().is_some();
    let mut all = if is_engine { of_numbers(contest, base, survey) } else { of_frictions(contest, base, survey)? };
    all.retain(|gross| gross.gain > CONVINCING);
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut best: Vec<Gross> = Vec::new();
    for gross in all {
        if best.len() < GROSSEST && best.iter().all(|other| other.hypothesis != gross.hypothesis) {
            best.push(gross);
        }
    }
    Ok(best)
}

/// Some of the windows of an experiment, evenly spread: what is gross shows in every part of the logs.
struct Part {
    experiment: Experiment,
    every: usize,
    share: f64,
}

impl Part {
    fn of(experiment: &Experiment) -> Self {
        let every = experiment.windows.len().div_ceil(LOOKED).max(1);
        let windows: Vec<_> = experiment.windows.iter().step_by(every).copied().collect();
        let share = windows.len() as f64 / experiment.windows.len().max(1) as f64;
        Self { experiment: Experiment { windows, ..experiment.clone() }, every, share }
    }

    fn starts(&self, of_all: &[Vec<f64>]) -> Vec<Vec<f64>> {
        of_all.iter().step_by(self.every).cloned().collect()
    }
}

/// The numbers of a simulator that steps at multiples of their values.
fn of_numbers(contest: &Contest<'_>, base: &Contestant, survey: &Survey) -> Vec<Gross> {
    let numbers =
        contest.hypotheses.iter().zip(&survey.suspects).enumerate().filter_map(|(place, (hypothesis, found))| {
            let [(index, added)] = &found.as_ref().filter(|_| hypothesis.frees().is_some())?.applied.fitted[..] else {
                return None;
            };
            let value = *base.refined.parameters.get(*index)?;
            let is_free = base.free.iter().any(|free| free.parameter == *index);
            (value != 0.0 && !is_free).then_some((place, *index, value, (added.lower, added.upper)))
        });
    let Contestant { system, experiment, refined, .. } = base;
    let part = Part::of(experiment);
    let (mut trials, mut points) =
        (Vec::new(), vec![Point { parameters: refined.parameters.clone(), initial: part.starts(&refined.initial) }]);
    // The fit has pulled its own starts off.
    let initial = part.starts(base.beginnings.as_deref().unwrap_or(&refined.initial));
    for (hypothesis, index, value, (lower, upper)) in numbers {
        for value in GROSS.map(|factor| (factor * value).clamp(lower, upper)) {
            let mut parameters = refined.parameters.clone();
            parameters[index] = value;
            trials.push((hypothesis, value));
            points.push(Point { parameters, initial: initial.clone() });
        }
    }
    let costs = costs(system, &part.experiment, &points, &base.free);
    let gain = |cost: &f64| (costs[0] - cost) / part.share;
    let gains = trials.into_iter().zip(costs[1..].iter().map(gain));
    gains.map(|((hypothesis, value), gain)| Gross { hypothesis, values: vec![value], gain }).collect()
}

/// The dry frictions of equations at levels that hold.
fn of_frictions(contest: &Contest<'_>, base: &Contestant, survey: &Survey) -> Result<Vec<Gross>> {
    let mut all = Vec::new();
    if !base.evidence.leaves_a_rest() {
        return Ok(all);
    }
    let suspects = contest.hypotheses.iter().zip(&survey.suspects).enumerate();
    for (hypothesis, (_, found)) in suspects.filter(|(_, (h, _))| h.is(Effect::CoulombFriction)) {
        let Some(screened) = found else { continue };
        if let Some((values, gain)) = unless_refused(held(base, screened))?.flatten() {
            all.push(Gross { hypothesis, values, gain });
        }
    }
    Ok(all)
}

/// The values of a dry friction at its best level, the machine starting where the fit has it or where the logs show it, and what that gains.
fn held(base: &Contestant, screened: &Screened) -> Result<Option<(Vec<f64>, f64)>> {
    let applied = &screened.applied;
    let Some(first) = applied.starts.first().and_then(|start| start.columns.first()) else { return Ok(None) };
    let Some(typical) = applied.fitted.first().map(|(_, added)| added.scale) else { return Ok(None) };
    let of_level = |level: f64| [&[level], &first[1..]].concat();
    let (system, nothing) = base.written(applied)?;
    let point = |level: f64, initial: &Vec<Vec<f64>>| {
        let mut parameters = nothing.clone();
        applied.fitted.iter().zip(of_level(level)).for_each(|((index, _), value)| parameters[*index] = value);
        Point { parameters, initial: initial.clone() }
    };
    let part = Part::of(&base.experiment);
    let fitted = part.starts(&base.refined.initial);
    let mut shown = guess_initial(&base.system, &part.experiment);
    shown.iter_mut().zip(&fitted).for_each(|(shown, fitted)| shown.resize(fitted.len(), 0.0));
    let starts = [fitted, shown].map(|starts| with_lagging(&system, &part.experiment, starts, base.system.n_states()));
    let levels: Vec<f64> = HOLDING.iter().map(|level| level * typical).collect();
    let trials: Vec<(f64, &Vec<Vec<f64>>)> =
        starts.iter().flat_map(|initial| levels.iter().map(move |&level| (level, initial))).collect();
    let points: Vec<Point> = std::iter::once((0.0, &starts[0]))
        .chain(trials.iter().copied())
        .map(|(l, initial)| point(l, initial))
        .collect();
    let costs = costs(&system, &part.experiment, &points, &base.free);
    let best = trials.iter().zip(&costs[1..]).min_by(|a, b| a.1.total_cmp(b.1));
    Ok(best.map(|((level, _), cost)| (of_level(*level), (costs[0] - cost) / part.share)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fixture::{slider, slider_model};
    use crate::diagnose::limits::Budget;
    use crate::diagnose::run::Run;
    use crate::diagnose::steps::attribution::screen::screen;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::model::System;
    use crate::progress::Silent;

    /// What is gross about an oscillator whose friction has this level, 1/s^2.
    fn found(level: f64) -> Vec<(String, f64)> {
        let rate = |x: f64, v: f64, u: f64| u - 9.0 * x - 0.1 * v - level * (v / 0.005).tanh();
        let data = slider(3, rate, |time, run| 2.5 * (1.9 * time + run).sin(), [0.002, 0.004], 300);
        let model = slider_model("u - 9*x - 0.1*v");
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.002, 0.004])).unwrap();
        let nominal = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Usual).unwrap();
        let run = Run::new(&Silent, None);
        let all = suspects(&nominal, &Choice::default()).unwrap().0;
        let contest = Contest::new(&run, Fitter::default(), all, 6);
        let survey = screen(&contest, &nominal, &nominal, ("suspects", None)).unwrap();
        let found = gross(&contest, &nominal, &survey).unwrap();
        found.iter().map(|gross| (contest.hypotheses[gross.hypothesis].id().to_string(), gross.values[0])).collect()
    }

    #[test]
    fn friction_that_holds_a_machine_is_found_by_trial_and_none_where_there_is_none() {
        let held = found(1.5);
        assert!(held.len() == 1 && held[0].0 == "coulomb_friction" && (0.5..3.0).contains(&held[0].1), "{held:?}");
        assert!(found(0.0).is_empty());
    }
}
