//! Integration steps between two samples: as many as the outputs need.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::outputs;
use crate::diagnose::limits::{IMITATED, INTEGRATION, MOST_STIFF, MOST_SUBSTEPS};
use crate::model::System;
use crate::refine::Experiment;

/// Doubles the integration steps until the outputs no longer change by `allowed` times the noise; further where they are no numbers, as
/// those of a stiff model are that steps too far.
pub(crate) fn choose_substeps(
    system: &System,
    mut experiment: Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
    allowed: f64,
) -> Experiment {
    let outputs = |e: &Experiment| outputs(system, e, parameters, initial);
    let mut coarse = outputs(&experiment);
    let is_finite = |outputs: &[Vec<f64>]| outputs.iter().flatten().all(|value| value.is_finite());
    while experiment.substeps < if is_finite(&coarse) { MOST_SUBSTEPS } else { MOST_STIFF } {
        let finer = Experiment { substeps: 2 * experiment.substeps, ..experiment.clone() };
        let fine = outputs(&finer);
        let count = fine.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let change: f64 = coarse.iter().flatten().zip(fine.iter().flatten()).map(|(a, b)| (a - b) * (a - b)).sum();
        if (change / count).sqrt() < allowed {
            return experiment;
        }
        experiment = finer;
        coarse = fine;
    }
    // What diverges at any step is not stiff.
    if !is_finite(&coarse) {
        experiment.substeps = MOST_SUBSTEPS;
    }
    experiment
}

/// The experiment with the shorter integration steps that a contestant needs, if it needs any.
pub(crate) fn finer(contestant: &Contestant) -> Option<Experiment> {
    with_change_below(contestant, INTEGRATION)
}

/// The same where no other effect may gain by what the integration adds: in a long log a small share of the noise is many nats, and whatever
/// has one more parameter takes them up.
pub(crate) fn exact(contestant: &Contestant) -> Option<Experiment> {
    let alone = contestant.evidence.alone() * contestant.evidence.count() as f64;
    with_change_below(contestant, INTEGRATION.min((2.0 * IMITATED / alone.max(1.0)).sqrt()))
}

fn with_change_below(contestant: &Contestant, share: f64) -> Option<Experiment> {
    // A simulator that steps has steps of its own.
    if contestant.system.engine().is_some() {
        return None;
    }
    let (parameters, initial) = (&contestant.refined.parameters, &contestant.refined.initial);
    let allowed = share * contestant.evidence.misfit().max(1.0).sqrt();
    let finer = choose_substeps(&contestant.system, contestant.experiment.clone(), parameters, initial, allowed);
    (finer.substeps > contestant.experiment.substeps).then_some(finer)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Model, State};
    use faer::Mat;

    #[test]
    fn a_stiff_model_has_as_many_steps_as_give_numbers() {
        let states = vec![State::new("x", Expression::parse("-200*(x - sin(t))").unwrap())];
        let system = System::new(&Model { states, ..Model::default() }).unwrap();
        let time: Vec<f64> = (0..200).map(f64::from).collect();
        let values = Mat::from_fn(200, 1, |i, _| time[i].sin());
        let run = Run { name: "run".into(), time, values };
        let data = Dataset::new(vec![Channel::new("x")], vec![run]).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
        let chosen = choose_substeps(&system, experiment, &[], &[vec![0.0]], INTEGRATION);
        // An explicit method of fourth order is stable with steps below 2.8/200 s.
        assert!((72..=256).contains(&chosen.substeps), "{}", chosen.substeps);
        assert!(outputs(&system, &chosen, &[], &[vec![0.0]]).iter().flatten().all(|v| v.is_finite()));
        // One that grows without bound is not stiff.
        let states = vec![State::new("x", Expression::parse("1 + x^3").unwrap())];
        let system = System::new(&Model { states, ..Model::default() }).unwrap();
        let experiment = Experiment { substeps: 1, ..chosen };
        assert_eq!(choose_substeps(&system, experiment, &[], &[vec![0.0]], INTEGRATION).substeps, MOST_SUBSTEPS);
    }
}
