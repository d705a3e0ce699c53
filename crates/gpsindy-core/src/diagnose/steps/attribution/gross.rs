//! Gross errors of a simulator's numbers: by a factor, found by trial.
//!
//! A straight line says what a number does near its value. Of a gain ten times too large it says little: the servo saturates at every step, and no
//! small change of the gain shows. So every number is tried at a few multiples of its value, before anything else moves.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{CONVINCING, GROSS, GROSSEST, LOOKED};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::survey::Survey;
use crate::refine::{Experiment, Point, costs};

/// A number that a factor brings nearer to the logs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gross {
    /// Of the suspect.
    pub(crate) hypothesis: usize,
    /// What its fit begins with.
    pub(crate) value: f64,
    /// By how much the sum of squares falls there.
    pub(crate) gain: f64,
}

/// The numbers of a simulator that steps whose errors by a factor gain most, best first; none of equations, where straight lines reach.
pub(crate) fn gross(contest: &Contest<'_>, base: &Contestant, survey: &Survey) -> Vec<Gross> {
    if base.system.engine().is_none() || contest.run.is_out_of_time() {
        return Vec::new();
    }
    let numbers =
        contest.hypotheses.iter().zip(&survey.suspects).enumerate().filter_map(|(place, (hypothesis, found))| {
            let [(index, added)] = &found.as_ref().filter(|_| hypothesis.frees().is_some())?.applied.fitted[..] else {
                return None;
            };
            let value = *base.refined.parameters.get(*index)?;
            let is_free = base.free.iter().any(|free| free.parameter == *index);
            (value != 0.0 && !is_free).then_some((place, *index, value, (added.lower, added.upper)))
        });
    // An error by a factor shows in every part of the logs.
    let Contestant { system, experiment, refined, .. } = base;
    let every = experiment.windows.len().div_ceil(LOOKED).max(1);
    let some = |starts: &[Vec<f64>]| starts.iter().step_by(every).cloned().collect::<Vec<_>>();
    let part =
        Experiment { windows: experiment.windows.iter().step_by(every).copied().collect(), ..experiment.clone() };
    let (mut trials, mut points) =
        (Vec::new(), vec![Point { parameters: refined.parameters.clone(), initial: some(&refined.initial) }]);
    // The fit has pulled its own starts off.
    let initial = some(base.beginnings.as_deref().unwrap_or(&refined.initial));
    for (hypothesis, index, value, (lower, upper)) in numbers {
        for value in GROSS.map(|factor| (factor * value).clamp(lower, upper)) {
            let mut parameters = refined.parameters.clone();
            parameters[index] = value;
            trials.push((hypothesis, value));
            points.push(Point { parameters, initial: initial.clone() });
        }
    }
    let costs = costs(system, &part, &points, &base.free);
    let share = part.windows.len() as f64 / experiment.windows.len().max(1) as f64;
    let gains = trials.into_iter().zip(&costs[1..]);
    let mut all: Vec<Gross> =
        gains.map(|((hypothesis, value), cost)| Gross { hypothesis, value, gain: (costs[0] - cost) / share }).collect();
    all.retain(|gross| gross.gain > CONVINCING);
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut best: Vec<Gross> = Vec::new();
    for gross in all {
        if best.len() < GROSSEST && best.iter().all(|other| other.hypothesis != gross.hypothesis) {
            best.push(gross);
        }
    }
    best
}
