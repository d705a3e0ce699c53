//! Detect: is there a gap that is significant, material, and beyond the tolerances of the parameters?

mod nearer;

use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{chi_squared_tail, gain_tail, log_likelihood, with_fitted_level};
use crate::diagnose::fit::moved::{Moved, clearly_moved, moved};
use crate::diagnose::fit::substeps::finer;
use crate::diagnose::limits::{Budget, CERTAIN, CHANCE, TOLERABLE};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::round::{Expansion, expand, expand_further};
use crate::diagnose::steps::attribution::screen::nameless;
use crate::diagnose::steps::findings::{Detected, Judged, Outcome};
use crate::error::Result;
use nearer::nearer;

/// A nominal model after every suspect was tried once: whether it has a gap.
pub(crate) struct Suspected {
    pub(crate) nominal: Contestant,
    pub(crate) first: Expansion,
    /// Of every function without a name, where they were asked.
    pub(crate) nameless: Option<Vec<(f64, usize)>>,
    pub(crate) detected: Detected,
    /// Whether every parameter is at its nominal value, because the tolerated ones together would take the gap up.
    pub(crate) is_pinned: bool,
}

impl Suspected {
    /// The verdict where no gap was detected.
    pub(crate) fn without_gap(self) -> Judged {
        let outcome = Outcome {
            best: self.nominal.clone(),
            seats: Vec::new(),
            singles: self.first.singles(),
            near: self.first.fits,
            left: None,
            screened: self.first.screened,
        };
        Judged {
            nominal: self.nominal,
            detected: self.detected,
            nameless: self.nameless.unwrap_or_default(),
            outcome,
            forcing: None,
            was_asked_for_forces: false,
            sensors: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Tries every suspect, and every function without a name, once; where the tolerated parameters together take up what the logs clearly show,
/// and none of them alone, with all of them at their nominal values.
///
/// What moves all of them a little is one cause as often as not, which is within the tolerance of each.
pub(crate) fn detect(contest: &Contest<'_>, nominal: Contestant) -> Result<Suspected> {
    let found = tried(contest, nominal)?;
    if !is_only_strained(contest, &found)? || contest.run.is_out_of_time() {
        return Ok(found);
    }
    let Contestant { system, experiment, .. } = found.nominal.clone();
    let pinned = contest.fitter.nominal(system, experiment, Vec::new(), Budget::Usual)?;
    let pinned = tried(contest, pinned)?;
    Ok(if pinned.detected.gap { Suspected { is_pinned: true, ..pinned } } else { found })
}

/// Whether nothing but the tolerated parameters says that there is a gap, and none of them alone is an error.
fn is_only_strained(contest: &Contest<'_>, found: &Suspected) -> Result<bool> {
    let Suspected { nominal, first, nameless, detected, .. } = found;
    if !detected.gap || strained(nominal) > CHANCE || !clearly_moved(nominal).is_empty() {
        return Ok(false);
    }
    let is_noise = |nameless: Option<&[(f64, usize)]>| searched(first, nameless, nominal).iter().all(|&p| p > CHANCE);
    Ok(is_noise(nameless.as_deref()) && (nameless.is_some() || is_noise(Some(&self::nameless(contest, nominal)?))))
}

fn tried(contest: &Contest<'_>, nominal: Contestant) -> Result<Suspected> {
    let (nominal, first) = suspects(contest, nominal)?;
    // Functions without a name are asked only where the suspects leave a doubt; where they lie, later.
    let detected = judge(&first, None, &nominal);
    if detected.p_value < CERTAIN {
        return Ok(Suspected { nominal, first, nameless: None, detected, is_pinned: false });
    }
    let nameless = nameless(contest, &nominal)?;
    let detected = judge(&first, Some(&nameless), &nominal);
    Ok(Suspected { nominal, first, nameless: Some(nameless), detected, is_pinned: false })
}

/// The same after the hypotheses behind the leaders of a gap were tried, too, each of which an effect that leads imitates; where there is no
/// gap, after all that wait: a clock that is fast shows what is still to come, which no delay imitates.
pub(crate) fn detect_behind(contest: &mut Contest<'_>, suspected: Suspected) -> Result<Suspected> {
    let new = if suspected.detected.gap { contest.calls(suspected.first.leaders()) } else { contest.calls_all() };
    if new.is_empty() || contest.run.is_out_of_time() {
        return Ok(suspected);
    }
    let Suspected { nominal, first, nameless, is_pinned, .. } = suspected;
    let first = expand_further(contest, &nominal, (&nominal, first), new)?;
    let detected = judge(&first, nameless.as_deref(), &nominal);
    Ok(Suspected { nominal, first, nameless, detected, is_pinned })
}

/// Every hypothesis tried at the nominal model, with integration steps short enough for the best of them, and rollouts short enough for ripples.
///
/// Ripples and edges need shorter steps than the nominal model does, and lose the contest without.
fn suspects(contest: &Contest<'_>, mut nominal: Contestant) -> Result<(Contestant, Expansion)> {
    loop {
        let first = expand(contest, &nominal, &nominal, "suspects")?;
        if let Some(finer) = first.fits.first().and_then(finer) {
            nominal = contest.fitter.on(&nominal, &finer, Budget::Usual)?;
        } else if let Some(near) = nearer(contest, &nominal, &first)? {
            nominal = near;
        } else {
            return Ok((nominal, first));
        }
    }
}

/// Chance that noise and negligible structure give as large a gain as the best rival (Bonferroni).
pub(crate) fn nameless_p_value(gains: &[(f64, usize)], at: &Contestant) -> f64 {
    let (count, spent) = (at.evidence.count(), at.evidence.spent());
    let allowed = at.evidence.negligible() * count as f64;
    let tail =
        |&(gain, degrees): &(f64, usize)| gain_tail(with_fitted_level(gain - allowed, count), degrees, count, spent);
    Searches::of(gains.len()).pay(gains.iter().map(tail).fold(1.0, f64::min))
}

/// Judges the nominal model by all that was tried at it, and by how far its tolerated parameters move.
fn judge(first: &Expansion, nameless: Option<&[(f64, usize)]>, nominal: &Contestant) -> Detected {
    let [refitted, screened, nameless] = searched(first, nameless, nominal);
    let searches = [refitted, screened, nameless, strained(nominal)];
    let p_value = Searches::of(searches.len()).pay(searches.into_iter().fold(1.0, f64::min));
    Detected { gap: p_value <= CHANCE, p_value }
}

/// Chances of the best fit of an effect, of the best straight line, and of the best function without a name.
fn searched(first: &Expansion, nameless: Option<&[(f64, usize)]>, nominal: &Contestant) -> [f64; 3] {
    let evidence = &nominal.evidence;
    let count = evidence.count();
    let allowed = evidence.negligible() * count as f64;
    // A smooth gap in a short log looks like coloured noise to the screening, but not compared with a fit that explains it.
    let refitted = first.fits.iter().map(|fit| {
        let gain = 2.0 * (log_likelihood(&fit.evidence.colours) - log_likelihood(&evidence.colours));
        gain_tail(gain - allowed, fit.evidence.complexity(), count, evidence.spent())
    });
    let refitted = first.searches.pay(refitted.fold(1.0, f64::min));
    let nameless = nameless.map_or(1.0, |gains| nameless_p_value(gains, nominal));
    [refitted, first.p_value(nominal), nameless]
}

/// Chance that the tolerated parameters move as far where the nominal model is right.
fn strained(nominal: &Contestant) -> f64 {
    let (evidence, free) = (&nominal.evidence, &nominal.free);
    let count = evidence.count() as f64;
    let allowed = |is_believed: bool| match is_believed {
        true => TOLERABLE + evidence.model_error,
        false => evidence.negligible(),
    };
    let moved = moved(nominal);
    // Several tolerated parameters may replace each other: then none is determined alone, but all together are.
    let together = evidence.strain - allowed(moved.iter().all(|m| m.is_believed));
    let together = chi_squared_tail(together * count / evidence.inflation(), free.len());
    let one = |moved: &Moved| chi_squared_tail(moved.squared - allowed(moved.is_believed) * count, 1);
    let alone = Searches::of(free.len()).pay(moved.iter().map(one).fold(1.0, f64::min));
    alone.min(together)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Dataset, Run};
    use crate::diagnose::fixture::{drive, drive_of};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    #[test]
    fn what_tolerated_parameters_take_up_together_has_a_cause_where_the_sensors_show_it() {
        // Three parameters for two ratios: none of them is determined.
        let equation = Expression::parse("(g*u - k*x)/m").unwrap();
        let tolerated = |name: &str| Parameter { tolerance: Some(0.05), ..Parameter::new(name, 1.0) };
        let model = Model {
            states: vec![State::new("x", equation)],
            controls: vec![Control::new("u")],
            parameters: ["g", "k", "m"].map(tolerated).into(),
            ..Model::default()
        };
        let named = |noise: f64| {
            let (_, data) = drive(None, |x| 1.03 * x, noise, (4, 300));
            let (train, holdout) = hold_out(&data).unwrap();
            let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
            let names: Vec<String> = found.included().map(|c| format!("{} {:?}", c.effect, c.variables)).collect();
            (found.verdict, names)
        };
        // The outputs move by 0.02.
        assert_eq!(named(0.1).0, Verdict::NoGap);
        let (verdict, names) = named(0.003);
        assert_eq!(verdict, Verdict::Explained, "{names:?}");
        let of_k = ["parameter_error [\"k\"]", "viscous_friction [\"x\"]", "linear_stiffness [\"x\"]"];
        assert!(names.len() == 1 && of_k.contains(&names[0].as_str()), "{names:?}");
    }

    #[test]
    fn at_most_one_in_twenty_logs_without_a_gap_has_a_p_value_below_the_level() {
        let alarms = (0..40).filter(|&seed| {
            let (model, data) = drive_of(seed, None, |x| x, 0.02, (3, 120));
            let (train, holdout) = hold_out(&data).unwrap();
            let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
            assert_eq!(found.gap.detected, found.gap.p_value <= 0.05);
            found.gap.detected
        });
        // Six or more of 40 have a chance of 0.014 at a level of 5 %.
        assert!(alarms.count() < 6);
    }

    #[test]
    fn the_noise_that_a_controller_was_fed_makes_no_column_early() {
        const STEP: f64 = 0.02;
        let alarms = (0..6).filter(|&seed| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let runs = (0..4).map(|run| {
                let (mut x, mut values) = (1.0 + f64::from(run), Mat::zeros(200, 2));
                for i in 0..200 {
                    let read = x + 0.05 * normal(&mut random);
                    let control = 8.0 * ((0.1 * i as f64).sin() - read);
                    (values[(i, 0)], values[(i, 1)]) = (read, control);
                    x = control + (x - control) * (-STEP).exp();
                }
                let time = (0..200).map(|i| STEP * f64::from(i)).collect();
                Run { name: format!("run {run}"), time, values }
            });
            let (model, data) = drive_of(seed, None, |x| x, 0.05, (1, 10));
            let data = Dataset::new(data.channels().to_vec(), runs.collect()).unwrap();
            let (train, holdout) = hold_out(&data).unwrap();
            let clock = Diagnose { effects: vec!["clock".into()], ..Diagnose::default() };
            clock.run(&model, &train, &holdout, &Silent).unwrap().diagnosis.gap.detected
        });
        // Two or more of six have a chance of 0.03 at a level of 5 %.
        assert!(alarms.count() < 2);
    }

    #[test]
    fn a_column_that_shows_what_is_still_to_come_is_a_gap() {
        // Its clock is ahead by a sample: no delay of it, and none of the control, does that.
        let (model, data) = drive(None, |x| x, 0.002, (3, 300));
        let ahead = |run: &Run| Run {
            values: Mat::from_fn(299, 2, |i, c| run.values[(if c == 0 { i + 1 } else { i }, c)]),
            time: run.time[..299].to_vec(),
            ..run.clone()
        };
        let data = Dataset::new(data.channels().to_vec(), data.runs().iter().map(ahead).collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["clock"], "{:?} {}", found.verdict, found.gap.p_value);
    }
}
