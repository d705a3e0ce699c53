//! Power: which effects could these logs reveal, from what size, and which would be mistaken for others?
//!
//! Every effect that can act is added to simulated copies of the user's logs (with their times, controls and initial
//! states, and the noise that the diagnosis found). The copies are diagnosed without knowledge of the effect. Sizes are
//! chosen by the noise-free gap of the nominal model, in units of the noise.

use crate::data::Dataset;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::planting::{Planted, plant};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::power::copies::Bench;
use crate::diagnose::power::settings::Power;
use crate::diagnose::power::trial::{Blind, Count, Table};
use crate::diagnose::report::PowerReport;
use crate::error::Result;
use crate::parallel;
use crate::progress::Progress;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// What the diagnosis found that the study belongs to.
pub(crate) struct Found {
    pub(crate) nominal: Contestant,
    pub(crate) best: Contestant,
    pub(crate) hypotheses: Vec<Hypothesis>,
    pub(crate) scene: Scene,
    pub(crate) train: Dataset,
    pub(crate) holdout: Dataset,
}

/// A study and what it needs.
pub(crate) struct Study<'a> {
    pub(crate) diagnose: &'a Blind<'a>,
    pub(crate) power: &'a Power,
    pub(crate) found: &'a Found,
    pub(crate) progress: &'a dyn Progress,
}

impl Study<'_> {
    /// Plants and diagnoses.
    pub(crate) fn run(&self) -> Result<PowerReport> {
        let Found { nominal, best, train, holdout, .. } = self.found;
        let bench = Bench::new(nominal, best, train, holdout)?;
        let model = nominal.system.model();
        let chosen = self.one_of_each();
        let planted = chosen.iter().map(|h| plant(h, model, &self.found.scene)).collect::<Result<Vec<_>>>()?;
        let rows: Vec<(&Hypothesis, &Planted)> =
            chosen.iter().zip(&planted).filter_map(|(h, p)| Some((*h, p.as_ref()?))).collect();
        // Of each effect the middle size and at most all on one side of it.
        let sizes = self.power.gap_to_noise.len();
        let most = sizes.div_ceil(2).max(sizes - sizes / 2);
        let total = self.power.null_draws + rows.len() * most * self.power.draws;
        let count = Count::new(self.progress, total);
        count.add(0)?;
        let (diagnose, power) = (self.diagnose, self.power);
        let table = Table { diagnose, power, bench: &bench, system: &nominal.system, count: &count };
        let null = table.null()?;
        let one = |(row, (hypothesis, planted)): (usize, &(&Hypothesis, &Planted))| {
            let found = table.effect(row, hypothesis, planted)?;
            let tried = found.trials.iter().map(|t| t.draws).sum::<usize>();
            count.add((most * self.power.draws).saturating_sub(tried))?;
            Ok(found)
        };
        let effects = parallel::try_map(rows.iter().enumerate(), one)?;
        Ok(PowerReport { seed: self.power.seed, noise: bench.noise_levels(), null, effects })
    }

    /// Every effect in every place; of couplings and of drifting parameters one in each equation.
    fn one_of_each(&self) -> Vec<&Hypothesis> {
        let mut random = ChaCha8Rng::seed_from_u64(self.power.seed);
        let mut chosen: Vec<&Hypothesis> = Vec::new();
        for hypothesis in &self.found.hypotheses {
            if !hypothesis.has_many_places() {
                chosen.push(hypothesis);
                continue;
            }
            let like = |h: &Hypothesis| {
                h.id() == hypothesis.id()
                    && h.state == hypothesis.state
                    && h.variables.is_empty() == hypothesis.variables.is_empty()
            };
            if !chosen.iter().any(|h| like(h)) {
                let all: Vec<&Hypothesis> = self.found.hypotheses.iter().filter(|h| like(h)).collect();
                chosen.push(all[(random.next_u64() % all.len() as u64) as usize]);
            }
        }
        let order = |h: &&Hypothesis| (h.state, h.effect());
        chosen.sort_by_key(order);
        chosen
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};
    use crate::diagnose::Diagnose;
    use crate::error::Error;
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use crate::simulate::{Excitation, Simulate};
    use faer::Mat;

    /// A cart on a spring; its position and speed are logged.
    fn cart() -> Model {
        let state = |name: &str, unit: &str, equation: &str| State {
            unit: unit.into(),
            ..State::new(name, Expression::parse(equation).unwrap())
        };
        Model {
            name: "cart".into(),
            states: vec![state("x", "m", "v"), state("v", "m/s", "(u - k*x - b*v)/m")],
            controls: vec![Control { name: "u".into(), unit: "N".into() }],
            parameters: vec![Parameter::new("m", 1.2), Parameter::new("k", 4.0), Parameter::new("b", 0.6)],
            ..Model::default()
        }
    }

    /// Gap-free logs of the cart under a control, with noise of 0.004 m and 0.01 m/s.
    fn logs(control: impl Fn(f64, usize) -> f64) -> (Dataset, Dataset) {
        let system = cart().compile().unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let channels = vec![Channel::new("x"), Channel::new("v"), Channel::new("u")];
        let mut runs: Vec<Run> = (0..3)
            .map(|run| {
                let time: Vec<f64> = (0..160).map(|i| 0.05 * f64::from(i)).collect();
                let u = Mat::from_fn(160, 1, |i, _| control(time[i], run));
                let excitation = Excitation::new(&system, &time, u.as_ref(), crate::refine::Hold::Zero).unwrap();
                let rollout = Simulate::default().rollout(&system, &excitation, &[0.3, 0.0]).unwrap();
                let values = Mat::from_fn(160, 3, |i, j| match j {
                    2 => u[(i, 0)],
                    _ => rollout.states[(i, j)] + [0.004, 0.01][j] * normal(&mut random),
                });
                Run { name: format!("run {run}"), time, values }
            })
            .collect();
        let held_out = runs.pop().unwrap();
        (Dataset::new(channels.clone(), runs).unwrap(), Dataset::new(channels, vec![held_out]).unwrap())
    }

    fn study(effects: &[&str], power: Power, (train, holdout): (Dataset, Dataset)) -> PowerReport {
        let effects = effects.iter().map(ToString::to_string).collect();
        let settings = Diagnose { effects, power: Some(power), ..Diagnose::default() };
        settings.run(&cart(), &train, &holdout, &Silent).unwrap().diagnosis.power.unwrap()
    }

    /// Steps between levels that no filter of the plant can hide.
    fn steps(t: f64, run: usize) -> f64 {
        let levels = [1.8, -2.4, 0.6, -0.9, 2.7, -1.5, 0.3, 2.1];
        levels[((t / 0.9) as usize + 3 * run) % levels.len()]
    }

    #[test]
    fn coulomb_friction_is_revealed_and_copies_without_effect_do_not_alarm() {
        let suspects = ["coulomb_friction", "viscous_friction", "quadratic_drag", "bias", "input_delay"];
        let power = Power { draws: 1, null_draws: 12, ..Power::default() };
        let found = study(&suspects, power, logs(steps));
        // At a level of 5 % two or more of 12 have a chance of 0.12, three of 0.02.
        assert!(found.null.draws == 12 && found.null.alarms <= 2 && found.null.included == 0, "{:?}", found.null);
        let friction = found.effects.iter().find(|e| e.effect == "coulomb_friction").unwrap();
        assert_eq!((friction.state.as_str(), friction.unit.as_str()), ("v", "m/s^2"));
        assert!(friction.named_from.is_some_and(|c| c > 0.0), "{friction:?}");
        assert!(friction.named_from >= friction.detected_from, "{friction:?}");
        assert!(found.effects.iter().all(|e| !e.trials.is_empty()), "{:?}", found.effects);
        // The noise of the copies is that of the logs; 480 values give a deviation to 3 %, doubled for the differences.
        assert!((found.noise[0].rms / 0.004 - 1.0).abs() < 0.2 && !found.noise[0].coloured, "{:?}", found.noise);
    }

    #[test]
    fn a_constant_control_reveals_no_dead_zone() {
        let suspects = ["input_dead_zone", "input_bias", "input_gain", "bias"];
        let power = Power { draws: 1, null_draws: 0, ..Power::default() };
        let found = study(&suspects, power.clone(), logs(|_, _| 0.0));
        let dead_zone = found.effects.iter().find(|e| e.effect == "input_dead_zone").unwrap();
        assert!(dead_zone.detected_from.is_none() && dead_zone.trials.is_empty(), "{dead_zone:?}");
        assert!(dead_zone.limit.is_some());
        // Off zero it acts as an offset, and is not named alone.
        let found = study(&suspects, power, logs(|_, _| 1.5));
        let dead_zone = found.effects.iter().find(|e| e.effect == "input_dead_zone").unwrap();
        assert!(dead_zone.named_from.is_none() || !dead_zone.group.is_empty(), "{dead_zone:?}");
    }

    #[test]
    fn settings_out_of_range_are_refused_before_any_work() {
        for power in [
            Power { gap_to_noise: vec![], ..Power::default() },
            Power { gap_to_noise: vec![3.0, 1.0], ..Power::default() },
            Power { draws: 0, ..Power::default() },
        ] {
            assert!(power.check().is_err(), "{power:?}");
        }
    }

    struct Impatient;

    impl Progress for Impatient {
        fn report(&self, stage: &str, done: usize, _total: usize) -> bool {
            !(stage == "power" && done >= 2)
        }
    }

    #[test]
    fn a_study_stops_on_request() {
        let (train, holdout) = logs(steps);
        let power = Some(Power { draws: 1, null_draws: 4, ..Power::default() });
        let settings = Diagnose { effects: vec!["bias".into()], power, ..Diagnose::default() };
        let stopped = settings.run(&cart(), &train, &holdout, &Impatient);
        assert!(matches!(stopped, Err(Error::Cancelled)), "{stopped:?}");
    }
}
