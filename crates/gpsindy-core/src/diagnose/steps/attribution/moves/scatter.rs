//! Scatter: a size that differs between recordings, as a random effect of the run.
//!
//! An effect with one size for all runs leaves a rest where the machine's own differs from one recording to the next, and whatever differs
//! between these recordings too would get the credit: what warms up, drifts, or begins in one of them. So the effects that lead are also
//! tried with a size of their own in every recording. It costs as many parameters as it adds (BIC), and what is rare beforehand: machines
//! keep their sizes.
//!
//! Source: Laird and Ware 1982, Random-effects models for longitudinal data, Biometrics 38(4).

use crate::diagnose::fit::by_run::{Pooled, Products, Values, differing, is_inside, parts_of_recordings, size_of};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::own_sizes::with_own;
use crate::diagnose::limits::{Budget, CONVINCING, FINALISTS, OWN_ROUNDS, SUBSTITUTE};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::{Result, unless_refused};

/// The fits of a round, best first, the leaders among those with more effects than `base` and with as many each with sizes that differ between
/// recordings, where that convinces.
pub(crate) fn with_scattered(
    contest: &Contest<'_>,
    base: &Contestant,
    mut fits: Vec<Contestant>,
) -> Result<Vec<Contestant>> {
    // Where one size for all runs leaves only noise none differs.
    if fits.first().is_some_and(|best| !best.evidence.leaves_a_rest()) {
        return Ok(fits);
    }
    let own = base.hypotheses.len();
    let leaders = |is_wanted: &dyn Fn(usize) -> bool| {
        let of = fits.iter().enumerate().filter(|(_, fit)| is_wanted(fit.hypotheses.len()));
        of.map(|(place, _)| place).take(FINALISTS).collect::<Vec<usize>>()
    };
    // What takes the place of a size that differs differs as well.
    let mut places = leaders(&|count| count > own);
    if !differing(&base.experiment).is_empty() {
        places.extend(leaders(&|count| count == own));
    }
    let simplest = fits.iter().enumerate().filter(|(_, fit)| fit.added.iter().all(|added| added.len() == 1));
    places.extend(simplest.map(|(place, _)| place).take(FINALISTS));
    places.sort_unstable();
    places.dedup();
    let chosen: Vec<&Contestant> = places.iter().map(|&place| &fits[place]).collect();
    let found = base.each(chosen, |fit| scattered(contest, fit))?;
    for (place, fit) in places.into_iter().zip(found) {
        if let Some(fit) = fit {
            fits[place] = fit;
        }
    }
    contest.sort(&mut fits);
    Ok(fits)
}

/// The fit with the size of one of its effects by recording, where that convinces.
pub(crate) fn scattered(contest: &Contest<'_>, fit: &Contestant) -> Result<Option<Contestant>> {
    let parts = parts_of_recordings(&fit.experiment.logs);
    let is_open = parts.iter().any(|&part| part > 0) && fit.evidence.leaves_a_rest();
    if !is_open || contest.run.is_out_of_time() {
        return Ok(None);
    }
    let known = differing(&fit.experiment);
    let is_new = |&i: &usize| is_inside(fit, i) && !known.contains(&fit.free[i].parameter);
    let named = (0..fit.hypotheses.len()).filter(|&place| !fit.hypotheses[place].is_nameless());
    let sizes: Vec<usize> = named.filter_map(|place| size_of(fit, place)).filter(is_new).collect();
    let Some(products) = Products::new(fit, (&fit.system, &fit.free), &sizes, &parts) else { return Ok(None) };
    let gains = (0..sizes.len()).map(|k| products.gain_by_run(fit, &sizes, k));
    let Some((k, (gain, _))) = gains.enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { return Ok(None) };
    if gain < 2.0 * CONVINCING {
        return Ok(None);
    }
    let parameter = fit.free[sizes[k]].parameter;
    // The right form leaves nothing once its sizes are right; what an imitation leaves is smaller with more sizes, and still there.
    let is_taken = |before: &Contestant, next: &Contestant| {
        !next.evidence.leaves_a_rest() || next.evidence.rest() <= (1.0 - SUBSTITUTE) * before.evidence.rest()
    };
    let first = round(contest, fit, parameter, Budget::Rough)?.filter(|first| is_taken(fit, first));
    let Some(first) = first else { return Ok(None) };
    let found = settled(contest, first.clone(), parameter, &is_taken)?.unwrap_or(first);
    Ok(Some(found).filter(|found| !found.evidence.leaves_a_rest() && contest.is_convincing(found, fit)))
}

/// The `fit` once more with the sizes that its recordings have of their own, where it has such.
pub(crate) fn resettled(contest: &Contest<'_>, fit: Contestant) -> Result<Contestant> {
    let mut fit = fit;
    for parameter in differing(&fit.experiment) {
        fit = settled(contest, fit.clone(), parameter, &|_, _| true)?.unwrap_or(fit);
    }
    Ok(fit)
}

/// The fit with a value of `parameter` by recording: by straight lines from where it is, round by round, all else fitted on. The joint value is
/// the mean over the recordings. It ends where a round lowers the squares no more, or is not `worth` the next.
fn settled(
    contest: &Contest<'_>,
    fit: Contestant,
    parameter: usize,
    worth: &dyn Fn(&Contestant, &Contestant) -> bool,
) -> Result<Option<Contestant>> {
    let mut best: Option<Contestant> = None;
    for _ in 0..OWN_ROUNDS {
        let at = best.as_ref().unwrap_or(&fit);
        let Some(next) = round(contest, at, parameter, Budget::Usual)? else { break };
        if !(next.evidence.squares() < at.evidence.squares() && worth(at, &next)) {
            break;
        }
        best = Some(next);
    }
    Ok(best)
}

/// One round of it; nothing where there are no such values, or they can't be followed.
fn round(contest: &Contest<'_>, at: &Contestant, parameter: usize, budget: Budget) -> Result<Option<Contestant>> {
    let parts = parts_of_recordings(&at.experiment.logs);
    let Some(own) = at.free.iter().position(|free| free.parameter == parameter) else { return Ok(None) };
    let products = Products::new(at, (&at.system, &at.free), &[own], &parts);
    let values = products.and_then(|products| products.values(at, &[own], 0, &[0]));
    let next = values.and_then(|values| by_recording(at, own, &parts, &values));
    next.map_or(Ok(None), |next| unless_refused(contest.fitter.carried_on(next, budget)))
}

/// The fit, its free parameter number `own` with these values by part; nothing where they are none that it may have.
fn by_recording(fit: &Contestant, own: usize, parts: &[usize], values: &Values) -> Option<Contestant> {
    let free = &fit.free[own];
    let mean = Pooled::of(&values.values, &values.information)?.mean;
    // What a recording does not determine is as in the others.
    let of_part = |part: &usize| {
        let place = values.parts.iter().position(|known| known == part);
        place.map_or(mean, |place| values.values[place]).clamp(free.lower, free.upper)
    };
    let more: Vec<f64> = parts.iter().map(|part| of_part(part) - mean).collect();
    let is_there = more.iter().all(|more| more.is_finite()) && (free.lower..=free.upper).contains(&mean);
    let mut moved = is_there.then(|| with_own(fit, free.parameter, &more))?;
    moved.refined.parameters[free.parameter] = mean;
    Some(moved)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::Dataset;
    use crate::diagnose::fixture::drive_of;
    use crate::diagnose::report::{Diagnosis, Verdict};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::Model;
    use crate::progress::Silent;

    /// Runs of drives each of which loses what `loses(run, x)` says.
    fn recorded(count: u32, loses: impl Fn(f64, f64) -> f64) -> (Model, Dataset) {
        let of = |run: u32| {
            let (model, data) = drive_of(5 + u64::from(run), None, |x| loses(f64::from(run), x), 0.005, (4, 400));
            (model, data.with_runs(&[run as usize % 4]).unwrap().runs()[0].clone(), data.channels().to_vec())
        };
        let all: Vec<_> = (0..count).map(of).collect();
        let mut runs: Vec<_> = all.iter().map(|(_, run, _)| run.clone()).collect();
        runs.iter_mut().enumerate().for_each(|(i, run)| run.name = format!("log {i}"));
        (all[0].0.clone(), Dataset::new(all[0].2.clone(), runs).unwrap())
    }

    fn diagnosed(model: &Model, data: &Dataset) -> Diagnosis {
        let (train, holdout) = hold_out(data).unwrap();
        Diagnose::default().run(model, &train, &holdout, &Silent).unwrap().diagnosis
    }

    #[test]
    fn a_cause_whose_size_differs_between_recordings_keeps_its_name_and_has_its_values() {
        let sizes = [0.5, 0.62, 0.43, 0.55];
        let (model, data) = recorded(4, |run, x| x + sizes[run as usize] * x * x.abs());
        let found = diagnosed(&model, &data);
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["quadratic_drag"], "{:?}", found.causes);
        let cause = &found.causes[0];
        assert!(cause.probability > 0.8, "{cause:?}");
        for (run, truth) in cause.between_runs[0].runs.iter().zip(sizes) {
            assert!((run.value - truth).abs() < 0.02, "{:?}", cause.between_runs);
        }
        // The size of one more recording may be another one: the interval of three is wide, and holds their mean.
        let size = &cause.parameters[0];
        assert!(size.low.unwrap() < 0.43 && size.high.unwrap() > 0.62 && (size.value - 0.517).abs() < 0.02, "{size:?}");
        let constancy = found.checks.iter().find(|check| check.id == "constancy").unwrap();
        assert!(!constancy.passed && constancy.says.contains("between runs"), "{constancy:?}");
        assert_eq!(found.verdict, Verdict::PartlyExplained);
    }

    #[test]
    fn one_size_in_all_recordings_is_none_of_their_own() {
        let (model, data) = recorded(4, |_, x| x + 0.5 * x * x.abs());
        let found = diagnosed(&model, &data);
        assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.checks);
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["quadratic_drag"]);
    }
}
