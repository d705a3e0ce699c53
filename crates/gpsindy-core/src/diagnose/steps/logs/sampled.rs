//! Sampled: when a slow sensor samples in each run, where its clock begins anew with the run.

use crate::diagnose::catalogue::excited::repeats::{own_moment, own_period};
use crate::refine::Experiment;
use std::sync::Arc;

/// Sets the moments at which such sensors sample in the runs of `experiment`, with the periods that the logs of `known` show.
pub(crate) fn set_clocks(experiment: &mut Experiment, known: &Experiment) {
    for (column, &state) in known.columns.iter().enumerate() {
        let Some(period) = own_period(&known.logs, column) else { continue };
        for log in Arc::make_mut(&mut experiment.logs) {
            let moment = own_moment(log, column, period);
            log.sampled.extend(moment.map(|moment| (state, moment)));
        }
    }
}
