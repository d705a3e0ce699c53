//! What a fit cannot walk to, found by trial before it.

pub(crate) mod breakaway;
mod instants;
pub(crate) mod late;
mod stops;

use crate::diagnose::catalogue::hypothesis::Added;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::sampling;
use crate::diagnose::limits::Budget;
use crate::error::Result;
use crate::model::System;
use crate::refine::{Experiment, Free, Point};

/// Puts periods of sampling, ends of a travel, instants, delays in whole steps and levels at rest among `fitted` in `point` where the logs fit best; `from` as for
/// [`sampling::settle`].
pub(crate) fn settle(
    from: &Contestant,
    (system, experiment): (&System, &Experiment),
    (fitted, free): (&[(usize, Added)], &[Free]),
    (point, budget): (&mut Point, Budget),
) -> Result<()> {
    sampling::settle(from, system, experiment, (fitted, free), point)?;
    stops::settle(system, experiment, (fitted, free), point)?;
    instants::settle(system, experiment, (fitted, free), point)?;
    late::settle(from, (system, experiment), (fitted, free), (point, budget))?;
    breakaway::settle(system, experiment, (fitted, free), (point, budget))
}
