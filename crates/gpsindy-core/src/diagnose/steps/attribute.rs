//! Attribute: which effects cause the gap, and is anything left that has no name.

use crate::diagnose::Diagnose;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::fit::tolerance::charge_tolerated;
use crate::diagnose::steps::contest::{Contest, Expansion, NEAR, Summary, keep_first_of_each, sort_by_score};
use crate::diagnose::steps::detect::{Detected, detect, rival_p_value};
use crate::diagnose::steps::merge::merged;
use crate::diagnose::steps::prepare;
use crate::diagnose::steps::prune::{NAMED, gap_size, pruned, strongest};
use crate::error::Result;
use crate::parallel::*;
use crate::refine::Refine;

/// Structure that the winner leaves.
#[derive(Debug, Clone)]
pub(crate) struct Left {
    /// Mean squared residual (noise units) that a function without a name would still remove.
    pub(crate) energy: f64,
    /// Chance that noise alone would give as much.
    pub(crate) p_value: f64,
    /// State in whose equation it lies, and the variables that it depends on.
    pub(crate) state: usize,
    pub(crate) depends_on: Vec<String>,
}

/// What the contest found.
pub(crate) struct Outcome {
    /// The nominal model that the winner is compared with, where it is not the first one.
    pub(crate) nominal: Option<Fitted>,
    pub(crate) best: Fitted,
    /// For every effect of the winner: contestants that differ from the winner in that effect alone, the winner included.
    pub(crate) alternatives: Vec<Vec<Fitted>>,
    /// Mean squared residual (noise units) that each effect of the winner removes, taken last.
    pub(crate) removed: Vec<f64>,
    /// Where no effect convinced: single effects, best first.
    pub(crate) singles: Vec<Fitted>,
    pub(crate) left: Option<Left>,
    /// Straight-line gain of every hypothesis at the winner.
    pub(crate) screened: Vec<Summary>,
}

impl Outcome {
    pub(crate) fn no_gap(nominal: &Fitted, first: &Expansion) -> Self {
        Self {
            nominal: None,
            best: nominal.clone(),
            alternatives: Vec::new(),
            removed: Vec::new(),
            singles: first.fits.iter().filter(|f| f.hypotheses.len() == 1).cloned().collect(),
            left: None,
            screened: first.screened.clone(),
        }
    }
}

/// A nominal model, whether it has a gap, and what causes it.
pub(crate) struct Judged {
    pub(crate) nominal: Fitted,
    pub(crate) detected: Detected,
    /// Gain and degrees of freedom of every rival at the nominal model.
    pub(crate) free_gains: Vec<(f64, usize)>,
    pub(crate) outcome: Outcome,
}

/// A nominal model after every suspect was tried once: whether it has a gap.
pub(crate) struct Suspected {
    nominal: Fitted,
    first: Expansion,
    free_gains: Vec<(f64, usize)>,
    pub(crate) detected: Detected,
}

impl Suspected {
    /// The verdict where no gap was detected.
    pub(crate) fn without_gap(self) -> Judged {
        let outcome = Outcome::no_gap(&self.nominal, &self.first);
        Judged { nominal: self.nominal, detected: self.detected, free_gains: self.free_gains, outcome }
    }
}

/// Detects a gap.
pub(crate) fn suspect(
    contest: &Contest<'_>,
    nominal: Fitted,
    rivals: &[Rival],
    settings: &Diagnose,
) -> Result<Suspected> {
    let (nominal, first) = suspects(contest, nominal)?;
    let free_gains = contest.rivals(&nominal, rivals);
    let detected = detect(&first, &free_gains, settings.confidence, &nominal);
    Ok(Suspected { nominal, first, free_gains, detected })
}

/// Detects a gap, and where there is one finds its causes.
pub(crate) fn judge(
    contest: &Contest<'_>,
    nominal: Fitted,
    rivals: &[Rival],
    settings: &Diagnose,
    notes: &mut Vec<String>,
) -> Result<Judged> {
    let suspected = suspect(contest, nominal, rivals, settings)?;
    if !suspected.detected.gap {
        return Ok(suspected.without_gap());
    }
    let Suspected { nominal, first, free_gains, detected } = suspected;
    let outcome = attribute(contest, &nominal, first, rivals, settings.most_effects, notes)?;
    Ok(Judged { nominal, detected, free_gains, outcome })
}

/// Every hypothesis tried at the nominal model, with integration steps short enough for the best of them.
///
/// Ripples and edges need shorter ones than the nominal model does, and lose the contest without.
fn suspects(contest: &Contest<'_>, mut nominal: Fitted) -> Result<(Fitted, Expansion)> {
    loop {
        let first = contest.expand(&nominal, "suspects")?;
        let finer = first.fits.first().and_then(Fitted::finer);
        let Some(finer) = finer else { return Ok((nominal, first)) };
        nominal = nominal.on(&finer, &contest.settings)?;
    }
}

/// The contest from first suspects to a winner, its rivals and what it leaves.
fn attribute(
    contest: &Contest<'_>,
    nominal: &Fitted,
    first: Expansion,
    rivals: &[Rival],
    most: usize,
    notes: &mut Vec<String>,
) -> Result<Outcome> {
    let singles: Vec<Fitted> = first.fits.iter().filter(|f| f.hypotheses.len() == 1).map(Fitted::slim).collect();
    let (rough, mut known) = contest.run(nominal, first, most)?;
    let (rough, _) = pruned(contest, nominal, rough, rivals);
    let windows = rough.experiment.windows.clone();
    let (lengthened, rough) = lengthen(nominal, rough, notes)?;
    let n_tolerated = lengthened.free.len();
    let (nominal, charged) = charge_tolerated(contest, lengthened, rough, notes)?;
    // Once more, because longer rollouts show what an effect is worth.
    let (mut best, is_structured) = pruned(contest, &nominal, charged, rivals);
    let unchanged = best.experiment.windows == windows && nominal.free.len() == n_tolerated;
    if !unchanged {
        known.clear();
    }
    let thorough = Refine { max_iterations: 60, tolerance: 1e-6 };
    let mut alternatives: Vec<Vec<Fitted>> = Vec::new();
    let mut removed: Vec<f64> = Vec::new();
    // Swap: leave each effect out in turn, and let all others apply for its place.
    let mut swaps = 0;
    let mut place = 0;
    loop {
        if place == best.hypotheses.len() {
            // Where a rest is left anyhow, fewer effects explain it no better.
            let simpler = if is_structured { None } else { merged(contest, &nominal, &best, &removed, &mut known)? };
            match simpler {
                Some(simpler) => best = simpler,
                None => break,
            }
            alternatives.clear();
            removed.clear();
            place = 0;
        }
        let Ok(rest) = without(contest, &nominal, &best, place) else {
            // Without this one the others can't even be simulated: it has no alternative.
            alternatives.push(vec![best.clone()]);
            removed.push(gap_size(&nominal, &best).max(0.0));
            place += 1;
            continue;
        };
        let mut fits = contest.expand_once(&rest, "alternatives", &mut known)?;
        // Several that apply together for the place of one must convince; they are no alternatives to one.
        let several = fits.iter().find(|f| f.hypotheses.len() > best.hypotheses.len());
        if let Some(richer) = several.filter(|f| swaps < 4 && contest.is_convincing(f, &best)) {
            best = richer.clone().again(&thorough);
            alternatives.clear();
            removed.clear();
            swaps += 1;
            place = 0;
            continue;
        }
        // While structure is left, its use to a more flexible effect is no evidence for that one.
        let slight = NAMED * gap_size(&nominal, &best);
        let is_plain =
            |f: &Fitted| !is_structured || f.complexity() <= best.complexity() || f.misfit() < best.misfit() - slight;
        fits.retain(|f| f.hypotheses.len() == best.hypotheses.len() && is_plain(f));
        fits.push(best.clone());
        let leader = fits.iter().map(|f| contest.score(f)).fold(f64::NEG_INFINITY, f64::max);
        let finish = |f: Fitted| if contest.score(&f) > leader - NEAR { f.again(&thorough) } else { f };
        let mut fits: Vec<Fitted> = fits.into_par_iter().map(finish).collect();
        sort_by_score(&mut fits, |f| contest.score(f));
        keep_first_of_each(&mut fits);
        let gain = contest.score(&fits[0]) - contest.score(&best);
        let same = fits[0].hypotheses.iter().all(|h| best.hypotheses.contains(h));
        if !contest.is_convincing(&best, &rest) && best.hypotheses.len() > 1 {
            // Others have made this effect superfluous.
            best = rest;
            alternatives.clear();
            removed.clear();
            place = 0;
            continue;
        }
        if !same && gain > 0.5 && swaps < 4 {
            best = fits[0].clone();
            alternatives.clear();
            removed.clear();
            swaps += 1;
            place = 0;
            continue;
        }
        alternatives.push(fits);
        removed.push((rest.misfit() - best.misfit()).max(0.0));
        place += 1;
    }
    let last = contest.survey(&best, "what is left")?;
    let gains = contest.rivals(&best, rivals);
    let left = left_over(&best, &last, &gains, rivals);
    Ok(Outcome { nominal: Some(nominal), best, alternatives, removed, singles, left, screened: last.screened })
}

/// Fitted values of the effect at `place`.
pub(crate) fn values(best: &Fitted, place: usize) -> Vec<f64> {
    best.added[place].iter().map(|(index, _)| best.refined.parameters[*index]).collect()
}

/// `base` with effects and their values, fitted all at once from where `best` stands: one at a time, the first would
/// be fitted without the others and might not find back.
pub(crate) fn again_with(
    contest: &Contest<'_>,
    base: &Fitted,
    best: &Fitted,
    effects: &[(&Hypothesis, Vec<f64>)],
) -> Result<Fitted> {
    let hypotheses: Vec<&Hypothesis> = effects.iter().map(|e| e.0).collect();
    let values: Vec<f64> = effects.iter().flat_map(|e| e.1.iter().copied()).collect();
    let applied = crate::diagnose::catalogue::joint::apply(&hypotheses, base.system.model(), &contest.scene)?;
    base.from(best).with_all(&hypotheses, &applied, &[values], &contest.settings)
}

/// The winner without the effect at `place`, fitted again from the nominal model.
pub(crate) fn without(contest: &Contest<'_>, nominal: &Fitted, best: &Fitted, place: usize) -> Result<Fitted> {
    let others = (0..best.hypotheses.len()).filter(|i| *i != place);
    let effects: Vec<_> = others.map(|i| (&best.hypotheses[i], values(best, i))).collect();
    again_with(contest, nominal, best, &effects)
}

/// Once the model is better, rollouts may be longer: whole runs again where the winner allows it.
fn lengthen(nominal: &Fitted, best: Fitted, notes: &mut Vec<String>) -> Result<(Fitted, Fitted)> {
    let is_whole = nominal.experiment.windows.len() == nominal.experiment.logs.len();
    if is_whole || best.hypotheses.is_empty() {
        return Ok((nominal.clone(), best));
    }
    // A constant error of a force makes four times the error of a place in twice the time.
    const STEADY: f64 = 16.0;
    // Where structure is left, rollouts that leave more of it tell of its piling up, and pull the effects after it.
    const PILED: f64 = 1.25;
    let settings = Refine { max_iterations: 60, tolerance: 1e-5 };
    let mut moved = best.clone();
    // From one length to the next, so that each fit starts near its end.
    while let Some(longer) = prepare::doubled(&moved.experiment) {
        let Ok(next) = moved.on(&longer, &settings) else { break };
        let growth = if moved.is_structured() { PILED } else { STEADY };
        let is_steady = next.misfit() <= growth * moved.misfit().max(1.0);
        let residuals = &next.refined.residuals;
        let is_near = prepare::stays_near(&next.experiment, residuals, &next.jacobian);
        if !is_steady || !is_near || prepare::is_loud(&next.system, &next.experiment, residuals) {
            break;
        }
        moved = next;
    }
    if moved.experiment.windows.len() == best.experiment.windows.len() {
        return Ok((nominal.clone(), best));
    }
    let Ok(base) = nominal.on(&moved.experiment, &settings) else { return Ok((nominal.clone(), best)) };
    notes.push("the corrected model stays near the logs for longer, so its fit uses longer rollouts".into());
    Ok((base, moved))
}

/// Structure that a function without a name, or one more effect, would still remove.
fn left_over(best: &Fitted, last: &Expansion, gains: &[(f64, usize)], rivals: &[Rival]) -> Option<Left> {
    let (place, energy) = strongest(best, gains)?;
    let p_value = (2.0 * rival_p_value(gains, best).min(last.p_value(best))).min(1.0);
    let rival = &rivals[place];
    Some(Left { energy, p_value, state: rival.state, depends_on: rival.variables.clone() })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::excited::Scene;
    use crate::diagnose::catalogue::hypothesis::enumerate;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnosed, hold_out};
    use crate::model::System;
    use crate::progress::Silent;
    use crate::refine::{Experiment, Refined, Starts};

    /// The fits of a drive that loses `loses(x)` in windows of 0.4 s: nominal, with a quadratic drag, and that one on longer
    /// windows where they tell more.
    fn in_short_windows(loses: impl Fn(f64) -> f64) -> (Fitted, Fitted, Fitted) {
        let (model, data) = drive(None, loses, 0.002, (2, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.002])).unwrap().with_windows_of(0.4);
        let settings = Refine::default();
        let nominal = Fitted::nominal(system.clone(), experiment, Vec::new(), &settings).unwrap();
        let scene = Scene::new(&system, &nominal.experiment, &nominal.refined.parameters, &nominal.refined.initial);
        let hypotheses = enumerate(&model, &scene, &[0], &[]).unwrap();
        let drag = hypotheses.iter().find(|h| h.id() == "quadratic_drag").unwrap();
        let applied = drag.apply(&model, &scene).unwrap();
        let fit = nominal.with(drag, &applied, &[0.5], &settings).unwrap().again(&settings);
        let (_, longer) = lengthen(&nominal, fit.clone(), &mut Vec::new()).unwrap();
        (nominal, fit, longer)
    }

    #[test]
    fn rollouts_grow_longer_where_nothing_is_left() {
        let (nominal, fit, longer) = in_short_windows(|x| x + 0.8 * x * x.abs());
        assert!(nominal.is_structured() && !fit.is_structured(), "{}, {}", nominal.misfit(), fit.misfit());
        assert_eq!(longer.experiment.windows.len(), 2);
        // What is left is noise, so that all samples count alike.
        assert_eq!(fit.starts().more, 0.0);
    }

    #[test]
    fn rollouts_stay_short_and_start_at_the_logs_where_something_is_left_that_piles_up() {
        let (_, fit, longer) = in_short_windows(|x| x + 0.8 * x * x.abs() + 0.3);
        assert!(fit.is_structured(), "{}", fit.misfit());
        assert_eq!(longer.experiment.windows, fit.experiment.windows);
        // Where every sample counts alike, the starts are where they take up as much as they can.
        let alike = Experiment { starts: Starts::default(), ..fit.experiment.clone() };
        let parameters = &fit.refined.parameters;
        let free = Refine::default().fit(&fit.system, &alike, parameters, &fit.free, None).unwrap();
        let first = |fit: &Refined| fit.residuals.iter().map(|window| window[0].powi(2)).sum::<f64>();
        assert!(first(&fit.refined) < 0.1 * first(&free), "{}, {}", first(&fit.refined), first(&free));
    }

    /// A drive with a tolerance of 5 % whose true rate is 1.03/s.
    fn slightly_off(noise: f64) -> Diagnosed {
        let (model, data) = drive(Some(0.05), |x| 1.03 * x, noise, (4, 300));
        let (train, holdout) = hold_out(&data).unwrap();
        Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap()
    }

    #[test]
    fn a_parameter_within_its_tolerance_is_a_cause_only_where_the_sensors_show_it() {
        // The outputs move by 0.02: a fifth of one noise, seven times the other.
        let unseen = slightly_off(0.1).diagnosis;
        assert_eq!(unseen.verdict, Verdict::NoGap, "{unseen:?}");
        let seen = slightly_off(0.003).diagnosis;
        assert_eq!(seen.verdict, Verdict::Explained, "{seen:?}");
        let first = &seen.causes[0];
        let names: Vec<&str> = std::iter::once(&first.effect).chain(&first.equivalent).map(String::as_str).collect();
        assert!(first.included && names.contains(&"parameter_error"), "{:?}", seen.causes);
    }
}
