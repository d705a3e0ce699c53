//! A simulator known by its logs only: identify a model from them, then diagnose it against the machine.
//!
//! The model must predict held-out simulated logs. Its error there does not count as a gap, so the diagnosis is of the
//! simulator and not of the identified model.

use crate::data::{Dataset, Run, difference_noise};
use crate::diagnose::{Diagnose, Diagnosed, hold_out};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::identify::{Identification, Identify};
use crate::model::Model;
use crate::progress::Progress;
use crate::score::{Scoring, StateError, score};
use crate::simulate::Simulate;

/// Settings of a diagnosis from paired logs.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `identify` | | states and controls named | how the simulated logs become a model |
/// | `diagnose` | whole catalogue | | how that is diagnosed |
/// | `least_r2` | 0.99 | below 1 | what the model must reach on held-out simulated logs |
#[derive(Debug, Clone)]
pub struct Paired {
    /// How the simulated logs become a model.
    pub identify: Identify,
    /// How the model is diagnosed against the machine's logs.
    pub diagnose: Diagnose,
    /// Least share of the variance of every column that rollouts over held-out simulated logs must explain.
    pub least_r2: f64,
}

impl Default for Paired {
    fn default() -> Self {
        Self { identify: Identify::default(), diagnose: Diagnose::default(), least_r2: 0.99 }
    }
}

/// A diagnosis from paired logs.
#[derive(Debug, Clone)]
pub struct PairedDiagnosis {
    /// The diagnosis; the model in it is the identified one.
    pub diagnosed: Diagnosed,
    /// What was identified from the simulated logs.
    pub model: Model,
    /// State, and share of its variance that rollouts over held-out simulated logs explain.
    pub r2: Vec<(String, f64)>,
}

/// Distance from 1 within which the coefficient of a lone velocity is 1: `x' = 0.9998 v` is `x' = v`.
const UNIT: f64 = 0.01;

/// Root mean square by which controls and starts of a pair may differ, as a share of their spread.
const ALIKE: f64 = 0.02;

/// Samples by which the clocks of a pair are tried against each other.
const SHIFTS: usize = 10;

impl Paired {
    /// Identifies the simulator from `simulated`, checks it there, and diagnoses it against `train`, verified on `holdout`.
    ///
    /// # Errors
    /// Those of [`Identify::fit`] and of [`Diagnose::run`]; an identified model that falls short of `least_r2`.
    pub fn run(
        &self,
        simulated: &Dataset,
        train: &Dataset,
        holdout: &Dataset,
        progress: &dyn Progress,
    ) -> Result<PairedDiagnosis> {
        let (learn, test) = hold_out(simulated)?;
        let found = self.identify.fit(&learn, progress)?;
        let model = with_exact_velocities(&found.model);
        let errors = self.check(&model, &found, &test, progress)?;
        let diagnose = Diagnose {
            model_error: errors.iter().map(|e| (e.state.clone(), without_noise(e, &test))).collect(),
            ..self.diagnose.clone()
        };
        let mut diagnosed = diagnose.run(&model, train, holdout, progress)?;
        let r2: Vec<(String, f64)> =
            errors.iter().map(|e| (e.state.clone(), 1.0 - e.normalised * e.normalised)).collect();
        let mut notes = vec![identified(&r2)];
        notes.extend(pairing(&model, simulated, [train, holdout]));
        notes.append(&mut diagnosed.diagnosis.notes);
        diagnosed.diagnosis.notes = notes;
        Ok(PairedDiagnosis { diagnosed, model, r2 })
    }

    /// Errors of rollouts over held-out simulated logs, where they are small enough.
    fn check(
        &self,
        model: &Model,
        found: &Identification,
        test: &Dataset,
        progress: &dyn Progress,
    ) -> Result<Vec<StateError>> {
        let simulate = Simulate { hold: found.hold, ..Simulate::default() };
        let scored = score(&model.compile()?, test, &Scoring { simulate, window: None }, progress)?;
        let remedy = "log every state of the simulator, densely and under varied inputs, give it more candidate terms, or hand in its equations";
        if scored.rollout.n_diverged > 0 {
            return Err(Error::data(format!(
                "the model identified from the simulated logs diverges on held-out ones, so nothing can be said of the simulator: {remedy}"
            )));
        }
        // A column that never moves needs no model.
        let moving: Vec<StateError> =
            scored.rollout.by_state.into_iter().filter(|e| e.normalised.is_finite()).collect();
        let worst = moving.iter().max_by(|a, b| a.normalised.total_cmp(&b.normalised));
        let Some(worst) = worst else {
            return Err(Error::data("no state of the simulated logs moves; simulate the runs of the machine"));
        };
        let r2 = 1.0 - worst.normalised * worst.normalised;
        if r2 < self.least_r2 {
            return Err(Error::data(format!(
                "the model identified from the simulated logs explains {r2:.3} of the variance of held-out `{}`, and {} is needed to say what the simulator lacks: {remedy}",
                worst.state, self.least_r2
            )));
        }
        Ok(moving)
    }
}

/// The model with `x' = v` where the only term is a state with a coefficient of nearly one.
fn with_exact_velocities(model: &Model) -> Model {
    let mut model = model.clone();
    let Some(record) = &model.identification else { return model };
    let mut exact = Vec::new();
    for (j, row) in record.coefficients.iter().enumerate() {
        let kept: Vec<usize> = (0..row.len()).filter(|&k| row[k] != 0.0).collect();
        if let [only] = kept[..]
            && (row[only] - 1.0).abs() < UNIT
            && model.state_index(&record.terms[only]).is_some_and(|other| other != j)
        {
            exact.push((j, Expression::variable(record.terms[only].clone())));
        }
    }
    for (j, velocity) in exact {
        model.states[j].equation = velocity;
    }
    // The equations are no longer those of the record.
    model.identification = None;
    model
}

/// Root mean square error of a column without the noise of the simulated log itself.
fn without_noise(error: &StateError, test: &Dataset) -> f64 {
    let Ok(column) = test.index_of(&error.state) else { return error.rmse };
    let noise = difference_noise(test.runs().iter().map(|r| r.column(column)), 3);
    (error.rmse * error.rmse - noise * noise).max(0.0).sqrt()
}

fn identified(r2: &[(String, f64)]) -> String {
    let each: Vec<String> = r2.iter().map(|(state, r2)| format!("{:.5} of `{state}`", r2)).collect();
    format!(
        "the simulator was identified from its logs; on held-out ones the model explains {} (share of the variance), and what it misses there counts as no gap",
        each.join(", ")
    )
}

/// What is to be said of how the logs of simulator and machine belong together.
fn pairing(model: &Model, simulated: &Dataset, real: [&Dataset; 2]) -> Vec<String> {
    let mut notes = Vec::new();
    let names: Vec<&str> = model.controls.iter().map(|c| c.name.as_str()).collect();
    let mut paired = 0;
    let mut shifted: Vec<String> = Vec::new();
    let mut total = 0;
    for data in real {
        for run in data.runs() {
            total += 1;
            let shifts = simulated.runs().iter().filter_map(|other| shift(&names, (simulated, other), (data, run)));
            match shifts.min_by_key(|s| s.unsigned_abs()) {
                Some(0) => paired += 1,
                Some(shift) => shifted.push(format!("{} by {shift} samples", run.name)),
                None => {}
            }
        }
    }
    if !shifted.is_empty() {
        notes.push(format!(
            "simulated and real logs have the same controls on clocks that differ ({}): a delay of that size may be the clocks'",
            shifted.join(", ")
        ));
    }
    if !names.is_empty() && paired + shifted.len() < total {
        notes.push(format!(
            "{} of {total} real runs have no simulated run of the same controls: for those only the identified model is used",
            total - paired - shifted.len()
        ));
    }
    for state in model.states.iter().map(|s| s.name.as_str()).chain(names) {
        let [Some(inner), Some(first), Some(second)] = [simulated, real[0], real[1]].map(|d| range(d, state)) else {
            continue;
        };
        let (low, high) = (first.0.min(second.0), first.1.max(second.1));
        let reach = 0.25 * (inner.1 - inner.0);
        if low < inner.0 - reach || high > inner.1 + reach {
            notes.push(format!(
                "the real logs take `{state}` from {low:.3} to {high:.3}, the simulated ones from {:.3} to {:.3}: beyond, the identified model extrapolates",
                inner.0, inner.1
            ));
        }
    }
    notes
}

fn range(data: &Dataset, name: &str) -> Option<(f64, f64)> {
    let column = data.index_of(name).ok()?;
    let values = data.runs().iter().flat_map(|r| r.column(column).iter().copied()).filter(|v| v.is_finite());
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    (low <= high).then_some((low, high))
}

/// By how many samples the controls of a real run lag those of a simulated one; `None` where they are others.
fn shift(names: &[&str], (simulated, one): (&Dataset, &Run), (real, other): (&Dataset, &Run)) -> Option<isize> {
    let period = other.period();
    if names.is_empty() || !(period > 0.0) {
        return None;
    }
    let most = SHIFTS as isize;
    let offsets = std::iter::once(0).chain((1..=most).flat_map(|k| [k, -k]));
    let alike = |offset: isize| {
        names.iter().all(|name| {
            let (Ok(a), Ok(b)) = (simulated.index_of(name), real.index_of(name)) else { return false };
            let (a, b) = (one.column(a), other.column(b));
            let delay = offset as f64 * period;
            let (mut error, mut square, mut count) = (0.0, 0.0, 0.0);
            for (i, &value) in b.iter().enumerate() {
                let t = one.time[0] + other.time[i] - other.time[0] - delay;
                if t < one.time[0] || t > one.time[one.time.len() - 1] || !value.is_finite() {
                    continue;
                }
                // The held value; a hair later, so that equal clocks give equal samples.
                let at = one.time.partition_point(|&known| known <= t + 0.01 * period).max(1) - 1;
                if a[at].is_finite() {
                    error += (a[at] - value).powi(2);
                    square += value * value;
                    count += 1.0;
                }
            }
            // At least half of the run must overlap.
            count * 2.0 >= b.len() as f64 && error <= ALIKE * ALIKE * square.max(f64::MIN_POSITIVE)
        })
    };
    offsets.into_iter().find(|&offset| alike(offset))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::Channel;
    use crate::model::{Control, Parameter, State};
    use crate::progress::Silent;
    use crate::random::{normal, uniform};
    use crate::refine::Hold;
    use crate::simulate::Excitation;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A cart with the equation given for its speed.
    fn cart(equation: &str) -> Model {
        let state = |name: &str, equation: &str| State::new(name, Expression::parse(equation).unwrap());
        Model {
            states: vec![state("x", "v"), state("v", equation)],
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("c", 0.25)],
            ..Model::default()
        }
    }

    fn logs(equation: &str, noise: f64, seeds: std::ops::Range<u64>) -> Dataset {
        let system = cart(equation).compile().unwrap();
        let runs = seeds.map(|seed| {
            let mut levels = ChaCha8Rng::seed_from_u64(seed);
            let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
            let level: Vec<f64> = (0..10).map(|_| 6.0 * uniform(&mut levels) - 3.0).collect();
            let time: Vec<f64> = (0..200).map(|i| 0.04 * f64::from(i)).collect();
            let u = Mat::from_fn(200, 1, |i, _| level[i / 20]);
            let excitation = Excitation::new(&system, &time, u.as_ref(), Hold::Zero).unwrap();
            let rollout = Simulate::default().rollout(&system, &excitation, &[0.2, 0.0]).unwrap();
            let mut error = || noise * normal(&mut random);
            let values = Mat::from_fn(200, 3, |i, j| if j == 2 { u[(i, 0)] } else { rollout.states[(i, j)] + error() });
            Run { name: format!("run {seed}"), time, values }
        });
        Dataset::new(vec![Channel::new("x"), Channel::new("v"), Channel::new("u")], runs.collect()).unwrap()
    }

    fn paired() -> Paired {
        let library = crate::library::LibrarySettings { degree: 2, ..Default::default() };
        let identify = Identify {
            states: vec!["x".into(), "v".into()],
            controls: vec!["u".into()],
            hold: Some(Hold::Zero),
            library,
            ..Identify::default()
        };
        let effects = ["coulomb_friction", "viscous_friction", "bias", "input_gain"].map(String::from).to_vec();
        let diagnose = Diagnose { effects, hold: Some(Hold::Zero), ..Diagnose::default() };
        Paired { identify, diagnose, ..Paired::default() }
    }

    const SIMULATOR: &str = "u - 3*x - 0.5*v";

    #[test]
    fn friction_that_the_simulated_logs_lack_is_found() {
        let simulated = logs(SIMULATOR, 1e-4, 0..4);
        let (train, holdout) = hold_out(&logs(&format!("{SIMULATOR} - c*tanh(v/0.005)"), 0.004, 0..4)).unwrap();
        let found = paired().run(&simulated, &train, &holdout, &Silent).unwrap();
        assert!(found.r2.iter().all(|(_, r2)| *r2 > 0.999), "{:?}", found.r2);
        assert!(found.model.is_kinematic(0), "{:?}", found.model.states);
        let report = &found.diagnosed.diagnosis;
        let cause = report.included().next().unwrap();
        assert_eq!((cause.effect.as_str(), cause.state.as_str()), ("coulomb_friction", "v"));
        // Noise of 0.004 on 600 samples of two columns; the smoothing of the sign costs some percent.
        assert!((cause.parameters[0].value - 0.25).abs() < 0.03, "{:?}", cause.parameters);
        assert!(report.notes[0].contains("identified from its logs"), "{:?}", report.notes);
        assert!(!report.notes.iter().any(|n| n.contains("no simulated run")), "{:?}", report.notes);
    }

    #[test]
    fn a_simulator_that_is_right_has_no_gap() {
        let simulated = logs(SIMULATOR, 1e-4, 0..4);
        let (train, holdout) = hold_out(&logs(SIMULATOR, 0.004, 0..4)).unwrap();
        let found = paired().run(&simulated, &train, &holdout, &Silent).unwrap();
        assert!(!found.diagnosed.diagnosis.gap.detected, "{:?}", found.diagnosed.diagnosis.gap);
    }

    #[test]
    fn noise_of_the_simulated_logs_is_no_error_of_the_model() {
        let data = logs(SIMULATOR, 0.01, 0..4);
        let error = |rmse: f64| {
            let (state, unit) = ("x".to_string(), String::new());
            without_noise(&StateError { state, unit, rmse, normalised: 0.1, n_samples: 800 }, &data)
        };
        // The median of 788 third differences gives the noise to some percent.
        assert!(error(0.0103) < 0.006, "{}", error(0.0103));
        assert!((error(0.05) - 0.049).abs() < 1e-3, "{}", error(0.05));
    }

    #[test]
    fn a_model_that_misses_the_simulator_is_refused_with_a_remedy() {
        // A library of straight lines, and of nothing else, has no cubic spring.
        let simulated = logs("u - 9*x^3 - 0.3*v", 1e-4, 0..4);
        let (train, holdout) = hold_out(&logs("u - 9*x^3 - 0.3*v", 0.004, 0..4)).unwrap();
        let mut settings = paired();
        settings.identify.library.degree = 1;
        settings.identify.grow = false;
        let refused = settings.run(&simulated, &train, &holdout, &Silent).unwrap_err().to_string();
        assert!(refused.contains("more candidate terms") && refused.lines().count() == 1, "{refused}");
    }

    #[test]
    fn clocks_that_differ_and_runs_without_partner_are_stated() {
        let simulated = logs(SIMULATOR, 0.0, 0..2);
        let names = ["u"];
        let own = |run: usize| (&simulated, &simulated.runs()[run]);
        assert_eq!(shift(&names, own(0), own(0)), Some(0));
        assert_eq!(shift(&names, own(0), own(1)), None);
        let mut late = simulated.runs()[0].clone();
        for i in (0..200).rev() {
            late.values[(i, 2)] = late.values[(i.max(3) - 3, 2)];
        }
        assert_eq!(shift(&names, own(0), (&simulated, &late)), Some(3));
    }
}
