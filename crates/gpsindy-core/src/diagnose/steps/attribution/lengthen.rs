//! Lengthen: a better model allows longer rollouts, up to whole runs.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, PILED};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::logs::windows::{doubled, is_loud, stays_near};
use crate::error::{Result, unless_refused};

/// The nominal model and the winner on the longest rollouts on which the winner stays near the logs, and what it leaves grows no faster than
/// `steady` from one length to the next; none where these are the present ones.
pub(crate) fn lengthen(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    steady: f64,
) -> Result<Option<(Contestant, Contestant)>> {
    let fitter = contest.fitter;
    let is_whole = nominal.experiment.windows.len() == nominal.experiment.logs.len();
    if is_whole || best.hypotheses.is_empty() || contest.run.is_out_of_time() {
        return Ok(None);
    }
    let mut moved = best.clone();
    // From one length to the next, so that each fit starts near its end.
    while let Some(longer) = doubled(&moved.experiment).filter(|_| !contest.run.is_out_of_time()) {
        let Some(next) = unless_refused(fitter.on(&moved, &longer, Budget::Thorough))? else { break };
        let growth = if moved.evidence.is_structured() { PILED } else { steady };
        let is_steady = next.evidence.misfit() <= growth * moved.evidence.misfit().max(1.0);
        let residuals = &next.refined.residuals;
        let is_near = stays_near(&next.experiment, residuals, &next.linearised()?.jacobian);
        if !is_steady || !is_near || is_loud(&next.system, &next.experiment, residuals) {
            break;
        }
        moved = next;
    }
    if moved.experiment.windows.len() == best.experiment.windows.len() {
        return Ok(None);
    }
    let base = unless_refused(fitter.on(nominal, &moved.experiment, Budget::Thorough))?;
    Ok(base.map(|base| (base, moved)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::enumerate::enumerate;
    use crate::diagnose::fit::fitter::{Fitter, starts, unsearched};
    use crate::diagnose::fit::outputs::scene_of;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::limits::STEADY;
    use crate::diagnose::run::Run;
    use crate::diagnose::steps::attribution::suspects::Suspects;
    use crate::model::System;
    use crate::progress::Silent;
    use crate::refine::{Experiment, Refine, Refined, Starts};

    /// The fits of a drive that loses `loses(x)` in windows of 0.4 s: nominal, with a quadratic drag, and that one on longer
    /// windows where they say more.
    fn in_short_windows(loses: impl Fn(f64) -> f64) -> (Contestant, Contestant, Contestant) {
        let (model, data) = drive(None, loses, 0.002, (2, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.002])).unwrap().with_windows_of(0.4);
        let fitter = Fitter::default();
        let nominal = fitter.nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let scene = scene_of(&nominal);
        let hypotheses = enumerate(&model, &scene, &[0], &[]).unwrap();
        let drag = hypotheses.iter().find(|h| h.id() == "quadratic_drag").unwrap();
        let applied = drag.apply(&model, &scene).unwrap();
        let fit = fitter.with(&nominal, &[unsearched(drag)], &applied, &[vec![0.5]], Budget::Thorough).unwrap();
        let fit = fitter.carried_on(fit, Budget::Thorough).unwrap();
        let run = Run::new(&Silent, None);
        let suspects = Suspects {
            hypotheses: hypotheses.clone(),
            behind: Vec::new(),
            joint: Vec::new(),
            rivals: Vec::new(),
            scene,
            places: Vec::new(),
            random: false,
        };
        let contest = Contest::new(&run, fitter, suspects, 6);
        let longer =
            lengthen(&contest, &nominal, &fit, STEADY).unwrap().map_or_else(|| fit.clone(), |(_, longer)| longer);
        (nominal, fit, longer)
    }

    #[test]
    fn rollouts_grow_longer_where_nothing_is_left() {
        let (nominal, fit, longer) = in_short_windows(|x| x + 0.8 * x * x.abs());
        assert!(
            nominal.evidence.is_structured() && !fit.evidence.is_structured(),
            "{}, {}",
            nominal.evidence.misfit(),
            fit.evidence.misfit()
        );
        assert_eq!(longer.experiment.windows.len(), 2);
        // What is left is noise, so that all samples count alike.
        assert_eq!(starts(&fit).more, 0.0);
    }

    #[test]
    fn rollouts_stay_short_and_start_at_the_logs_where_something_is_left_that_piles_up() {
        let (_, fit, longer) = in_short_windows(|x| x + 0.8 * x * x.abs() + 0.3);
        assert!(fit.evidence.is_structured(), "{}", fit.evidence.misfit());
        assert_eq!(longer.experiment.windows, fit.experiment.windows);
        // Where every sample counts alike, the starts are where they take up as much as they can.
        let alike = Experiment { starts: Starts::default(), ..fit.experiment.clone() };
        let parameters = &fit.refined.parameters;
        let free = Refine::default().fit(&fit.system, &alike, parameters, &fit.free, None).unwrap();
        let first = |fit: &Refined| fit.residuals.iter().map(|window| window[0].powi(2)).sum::<f64>();
        assert!(first(&fit.refined) < 0.1 * first(&free), "{}, {}", first(&fit.refined), first(&free));
    }
}
