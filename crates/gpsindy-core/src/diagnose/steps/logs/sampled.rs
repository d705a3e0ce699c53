//! Sampled: when a slow sensor samples in each run, where its clock begins anew with the run.

use crate::diagnose::catalogue::excited::repeats::{Repeats, own_moment};
use crate::refine::{Experiment, Log};
use std::sync::Arc;

/// Sets the moments at which such sensors sample in the runs of `experiment`, with the periods that the `known` logs show; the states that they read.
pub(crate) fn set_clocks(experiment: &mut Experiment, known: &[Log]) -> Vec<usize> {
    let mut found = Vec::new();
    for (column, state) in experiment.columns.clone().into_iter().enumerate() {
        let Some(period) = Repeats::of(known, column).and_then(|repeats| repeats.own_period) else { continue };
        for log in Arc::make_mut(&mut experiment.logs) {
            let moment = own_moment(log, column, period);
            log.sampled.extend(moment.map(|moment| (state, moment)));
        }
        found.push(state);
    }
    found
}
