//! Hold: whether the control is held or interpolated between its samples.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, FINALISTS, HOLD};
use crate::diagnose::steps::attribution::attribute::attribute;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::detect::{Suspected, detect};
use crate::diagnose::steps::findings::{Forcing, Judged};
use crate::diagnose::steps::logs::prepare::Prepared;
use crate::error::{Result, unless_refused};
use crate::refine::{Experiment, Hold};

/// What the search begins with: the first round under interpolated controls, where one of its leaders accounts for the logs clearly
/// better with them than any does with held ones; the user does not say which.
///
/// A wrong hold is worth half a sample of delay everywhere, and a search that begins with it spends effects on that. Where one effect does not
/// account for the logs, it begins with held controls, and the hold is asked once more with the causes in place.
pub(crate) fn begun(contest: &Contest<'_>, prepared: &Prepared, held: Suspected) -> Result<Suspected> {
    let Some(leader) = held.first.fits.first().filter(|_| held.detected.gap && is_open(contest, prepared)) else {
        return Ok(held);
    };
    let others = held.first.fits.iter().take(FINALISTS).map(|fit| unless_refused(interpolated(contest, fit)));
    let others = others.collect::<Result<Vec<_>>>()?;
    if !others.iter().flatten().any(|other| contest.lead(other, leader) > HOLD) {
        return Ok(held);
    }
    let Some(start) = unless_refused(interpolated(contest, &prepared.nominal))? else { return Ok(held) };
    let follows = contest.lead(&start, &prepared.nominal) > HOLD;
    let other = detect(contest, start)?;
    if follows && !other.detected.gap {
        // Whatever held controls would need, interpolated ones leave nothing of it.
        return Ok(other);
    }
    // Where a rest is left, the holds are compared by what happens to be left of it.
    let is_better =
        |fit: &Contestant| contest.lead(fit, leader) > HOLD && !is_delayed(fit) && !fit.evidence.leaves_a_rest();
    if !other.detected.gap || !other.first.fits.first().is_some_and(is_better) {
        return Ok(held);
    }
    Ok(other)
}

/// The verdict under the other hold, where that is clearly the better account of the logs.
///
/// Decided with the causes in place: a gap of any kind can make one hold look better than the other, and
/// interpolation with a delay of half a sample is nearly a held control.
pub(crate) fn reconsider_hold(contest: &mut Contest<'_>, prepared: &Prepared, found: Judged) -> Result<Judged> {
    // Under random forces the rollouts of one hold are nearer to the logs by chance.
    let is_pushed = |forcing: &Forcing| !forcing.forces.is_empty() || found.outcome.best.hypotheses.is_empty();
    let is_random = found.forcing.as_ref().is_some_and(is_pushed);
    if !is_open(contest, prepared) || !found.detected.gap || is_random {
        return Ok(found);
    }
    if prepared.is_other_hold(&found) {
        return without_phantom(contest, prepared, found);
    }
    let mut held = found;
    let other = other_hold(contest, &prepared.nominal, &held)?;
    contest.with_places(&mut held.outcome.screened);
    let is_right = |other: &Judged| !is_phantom(other, &held) && (!other.detected.gap || wins(contest, other, &held));
    Ok(other.filter(is_right).unwrap_or(held))
}

/// The verdict under interpolated controls, where they look better with the causes in place, or leave no gap.
fn other_hold(contest: &mut Contest<'_>, start: &Contestant, held: &Judged) -> Result<Option<Judged>> {
    let is_better = |contest: &Contest<'_>, fit: &Contestant| -> Result<bool> {
        let other = unless_refused(interpolated(contest, fit))?;
        Ok(other.is_some_and(|other| contest.lead(&other, fit) > HOLD))
    };
    if is_better(contest, &held.outcome.best)? {
        let suspected = detect(contest, interpolated(contest, start)?)?;
        return Ok(Some(attribute(contest, suspected)?));
    }
    if !is_better(contest, start)? {
        return Ok(None);
    }
    // Causes that take the control as it is held look no better when it is not: only that no gap is left would count.
    let suspected = detect(contest, interpolated(contest, start)?)?;
    Ok((!suspected.detected.gap).then(|| suspected.without_gap()))
}

/// What was found under interpolated controls, unless held ones, which are tried where there is a doubt, account for the logs as well: where it has
/// a delay or a column that is read late or early, and where it leaves a rest, for beside a large gap the hold was chosen by what was left of it.
fn without_phantom(contest: &mut Contest<'_>, prepared: &Prepared, mut other: Judged) -> Result<Judged> {
    let best = &other.outcome.best;
    // What a column reads late or early may be half a sample of the control.
    let is_late = best.hypotheses.iter().any(|h| h.reads_the_past());
    let is_doubted = is_late || is_delayed(best) || best.evidence.leaves_a_rest();
    if is_doubted && !contest.run.is_out_of_time() {
        let suspected = detect(contest, prepared.nominal.clone())?;
        let held = attribute(contest, suspected)?;
        contest.with_places(&mut other.outcome.screened);
        if is_phantom(&other, &held) || !wins(contest, &other, &held) {
            return Ok(held);
        }
    }
    Ok(other)
}

/// Whether the hold is a question.
fn is_open(contest: &Contest<'_>, prepared: &Prepared) -> bool {
    prepared.may_interpolate && prepared.nominal.system.n_controls() > 0 && !contest.run.is_out_of_time()
}

/// The same contestant under interpolated controls.
fn interpolated(contest: &Contest<'_>, fit: &Contestant) -> Result<Contestant> {
    let experiment = Experiment { hold: Hold::Linear, ..fit.experiment.clone() };
    contest.fitter.on(fit, &experiment, Budget::Usual)
}

fn wins(contest: &Contest<'_>, other: &Judged, held: &Judged) -> bool {
    contest.lead(&other.outcome.best, &held.outcome.best) > HOLD
}

fn is_delayed(fit: &Contestant) -> bool {
    fit.hypotheses.iter().any(|h| h.is_imitated_by_hold())
}

/// A delay under interpolation that the held control does not need is the phantom of half a sample.
fn is_phantom(other: &Judged, held: &Judged) -> bool {
    is_delayed(&other.outcome.best) && !is_delayed(&held.outcome.best)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, Diagnosed, Note, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State, System};
    use crate::progress::Silent;
    use crate::refine::Hold;
    use crate::simulate::{Excitation, Simulate};
    use faer::Mat;

    const STEP: f64 = 0.04;

    fn oscillator(cubic: f64) -> Model {
        Model {
            states: vec![
                State::new("x", Expression::parse("v").unwrap()),
                State::new("v", Expression::parse(&format!("u - k*x - d*v - {cubic}*x^3")).unwrap()),
            ],
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("k", 60.0), Parameter::new("d", 1.5)],
            ..Model::default()
        }
    }

    /// An oscillator with a spring that hardens by so much, of which its model knows the linear part, twenty samples a period.
    fn hardening(cubic: f64, hold: Hold) -> Diagnosed {
        let machine = System::new(&oscillator(cubic)).unwrap();
        let runs = (0..4).map(|run| {
            let time: Vec<f64> = (0..300).map(|i| STEP * f64::from(i)).collect();
            let drive = |t: f64| {
                let waves = [(5.1, 14.0), (7.4, 12.0), (9.2, 10.0)];
                waves.iter().map(|(w, size)| size * (w * t + f64::from(run) * w).sin()).sum::<f64>()
            };
            let controls = Mat::from_fn(time.len(), 1, |i, _| drive(time[i]));
            let excitation = Excitation::new(&machine, &time, controls.as_ref(), hold).unwrap();
            let states = Simulate::default().rollout(&machine, &excitation, &[0.0, 0.0]).unwrap().outputs;
            let noise = |i: usize| 1e-3 * (1.7 * (i * i + 31 * i * (run as usize + 1)) as f64).sin();
            let values =
                Mat::from_fn(time.len(), 2, |i, c| if c == 0 { states[(i, 0)] + noise(i) } else { controls[(i, 0)] });
            Run { name: format!("run {run}"), time, values }
        });
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs.collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        Diagnose::default().run(&oscillator(0.0), &train, &holdout, &Silent).unwrap()
    }

    #[test]
    fn a_spring_that_hardens_is_one_cause_whether_its_control_was_held_or_interpolated() {
        for hold in [Hold::Zero, Hold::Linear] {
            let found = hardening(120.0, hold);
            let names: Vec<&str> = found.diagnosis.included().map(|cause| cause.effect.as_str()).collect();
            assert_eq!(names, ["cubic_stiffness"], "{hold:?}");
            assert_eq!(found.notes.contains(&Note::Interpolated), hold == Hold::Linear);
        }
    }

    #[test]
    fn a_search_does_not_begin_where_interpolated_controls_leave_no_gap() {
        let found = hardening(0.0, Hold::Linear);
        assert_eq!(found.diagnosis.verdict, Verdict::NoGap);
        assert_eq!(found.notes.iter().filter(|note| **note == Note::Interpolated).count(), 1, "{:?}", found.notes);
        let stages: Vec<&str> = found.diagnosis.work.iter().map(|work| work.stage.as_str()).collect();
        assert!(!stages.iter().any(|stage| stage.starts_with("move")), "{stages:?}");
    }
}
