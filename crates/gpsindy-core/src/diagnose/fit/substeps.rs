//! Integration steps between two samples: as many as the outputs need.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::outputs;
use crate::diagnose::limits::{INTEGRATION, MOST_SUBSTEPS};
use crate::model::System;
use crate::refine::Experiment;

/// Doubles the integration steps until the outputs no longer change by `allowed` times the noise.
pub(crate) fn choose_substeps(
    system: &System,
    mut experiment: Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
    allowed: f64,
) -> Experiment {
    let outputs = |e: &Experiment| outputs(system, e, parameters, initial);
    let mut coarse = outputs(&experiment);
    while experiment.substeps < MOST_SUBSTEPS {
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
    experiment
}

/// The experiment with the shorter integration steps that a contestant needs, if it needs any.
pub(crate) fn finer(contestant: &Contestant) -> Option<Experiment> {
    let (parameters, initial) = (&contestant.refined.parameters, &contestant.refined.initial);
    let allowed = INTEGRATION * contestant.evidence.misfit().max(1.0).sqrt();
    let finer = choose_substeps(&contestant.system, contestant.experiment.clone(), parameters, initial, allowed);
    (finer.substeps > contestant.experiment.substeps).then_some(finer)
}
