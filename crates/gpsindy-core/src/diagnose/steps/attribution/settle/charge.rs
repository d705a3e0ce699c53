//! Charge: a parameter that the fit moves clearly and materially from its nominal value becomes a hypothesis, which competes
//! with the other effects.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::fit::moved::clearly_moved;
use crate::diagnose::limits::Budget;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::Result;

/// Parameters that became hypotheses.
pub(crate) struct Charged {
    /// The nominal model without their tolerance.
    pub(crate) nominal: Contestant,
    /// The winner with them as hypotheses.
    pub(crate) best: Contestant,
    pub(crate) names: Vec<String>,
}

/// What the fit moved out of its tolerance, as hypotheses; none where nothing is, or the winner can't be fitted so.
pub(crate) fn charge_tolerated(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
) -> Result<Option<Charged>> {
    let charged = clearly_moved(best);
    if charged.is_empty() {
        return Ok(None);
    }
    let mut causes = Vec::new();
    for &index in &charged {
        let parameter = &nominal.system.model().parameters[index];
        let is_its = |h: &&Hypothesis| is_error_of(h, &parameter.name);
        let Some(hypothesis) = contest.hypotheses.iter().find(is_its) else { return Ok(None) };
        // It was chosen among the parameters with a tolerance.
        let searches = Searches::of(best.free.len());
        causes.push((Entrant::new(hypothesis, searches), vec![best.refined.parameters[index]]));
    }
    causes.extend(best.entrants_without(&[]));
    let free = nominal.free.iter().filter(|f| !charged.contains(&f.parameter)).cloned().collect();
    let (system, experiment) = (nominal.system.clone(), nominal.experiment.clone());
    let base = contest.fitter.nominal(system, experiment, free, Budget::Usual)?;
    let Some(fit) = contest.again_with(&base, best, &causes)? else { return Ok(None) };
    let names = charged.iter().map(|&index| nominal.system.model().parameters[index].name.clone()).collect();
    Ok(Some(Charged { nominal: base, best: fit, names }))
}

fn is_error_of(hypothesis: &Hypothesis, parameter: &str) -> bool {
    hypothesis.frees() == Some(parameter)
}
