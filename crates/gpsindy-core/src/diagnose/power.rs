//! Power: which effects could these logs reveal, from what size, and what would each be taken for?
//!
//! Every effect that can act is planted in simulated copies of the user's own logs (their times, controls and starts,
//! the noise that the diagnosis found) and withheld; the diagnosis is run on the copies as on the logs. Sizes are
//! chosen by the gap that the nominal model would show without noise, in units of the noise.

use super::bench::{Bench, normal};
use super::effect::{Effect, separating_experiment};
use super::fitted::Fitted;
use super::hypothesis::Hypothesis;
use super::plant::{Planted, plant};
use super::report::{Diagnosis, PowerEffect, PowerNull, PowerReport, PowerRival, PowerTrial};
use super::scene::Scene;
use super::{Diagnose, Diagnosed};
use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::model::{Model, System};
use crate::progress::{Progress, step};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Settings of a power study.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `gap_to_noise` | 1, 3, 10 | above 0, rising | sizes of the planted effects; the middle one is tried first |
/// | `draws` | 2 | 1 and above | copies a size, each with noise of its own |
/// | `null_draws` | 20 | 0 and above | copies without any effect |
/// | `seed` | 0 | | of the noise |
#[derive(Debug, Clone, PartialEq)]
pub struct Power {
    /// Gaps of the planted effects in units of the noise, rising.
    pub gap_to_noise: Vec<f64>,
    /// Copies of the logs a size.
    pub draws: usize,
    /// Copies without any effect.
    pub null_draws: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Power {
    fn default() -> Self {
        Self { gap_to_noise: vec![1.0, 3.0, 10.0], draws: 2, null_draws: 20, seed: 0 }
    }
}

impl Power {
    pub(crate) fn check(&self) -> Result<()> {
        let rising = self.gap_to_noise.windows(2).all(|w| w[0] < w[1]);
        if self.gap_to_noise.is_empty() || !rising || !self.gap_to_noise.iter().all(|g| *g > 0.0 && g.is_finite()) {
            return Err(Error::range(
                "gap_to_noise",
                "one or more rising numbers above 0",
                format!("{:?}", self.gap_to_noise),
            ));
        }
        if self.draws == 0 {
            return Err(Error::range("draws", "at least 1", self.draws));
        }
        Ok(())
    }
}

/// How near the gap of a planted effect must come to the one asked for: no finding depends on a tenth.
const CLOSE: f64 = 0.1;

/// What a study needs of the diagnosis that it belongs to.
pub(crate) struct Study<'a> {
    pub(crate) settings: &'a Diagnose,
    pub(crate) power: &'a Power,
    pub(crate) hypotheses: &'a [Hypothesis],
    pub(crate) scene: &'a Scene,
    pub(crate) progress: &'a dyn Progress,
}

/// Counts the copies that are through, and passes a wish to stop on.
struct Count<'a> {
    progress: &'a dyn Progress,
    done: AtomicUsize,
    total: usize,
}

impl Progress for Count<'_> {
    fn report(&self, _stage: &str, _done: usize, _total: usize) -> bool {
        self.progress.report("power", self.done.load(Ordering::Relaxed).min(self.total), self.total)
    }
}

impl Count<'_> {
    fn add(&self, count: usize) -> Result<()> {
        let done = self.done.fetch_add(count, Ordering::Relaxed) + count;
        step(self.progress, "power", done.min(self.total), self.total)
    }
}

impl Study<'_> {
    /// Plants and diagnoses.
    pub(crate) fn run(
        &self,
        nominal: &Fitted,
        best: &Fitted,
        train: &Dataset,
        holdout: &Dataset,
    ) -> Result<PowerReport> {
        let bench = Bench::new(nominal, best, train, holdout)?;
        let model = nominal.system.model();
        let chosen = self.one_of_each();
        let planted = chosen.iter().map(|h| plant(h, model, self.scene)).collect::<Result<Vec<_>>>()?;
        let rows: Vec<(&Hypothesis, &Planted)> =
            chosen.iter().zip(&planted).filter_map(|(h, p)| Some((*h, p.as_ref()?))).collect();
        // Of each effect the middle size and at most all on one side of it.
        let sizes = self.power.gap_to_noise.len();
        let most = sizes.div_ceil(2).max(sizes - sizes / 2);
        let total = self.power.null_draws + rows.len() * most * self.power.draws;
        let count = Count { progress: self.progress, done: AtomicUsize::new(0), total };
        count.add(0)?;
        let table = Table { study: self, bench: &bench, system: &nominal.system, count: &count };
        let null = table.null()?;
        let one = |(row, (hypothesis, planted)): (usize, &(&Hypothesis, &Planted))| {
            let found = table.effect(row, hypothesis, planted)?;
            let tried = found.trials.iter().map(|t| t.draws).sum::<usize>();
            count.add((most * self.power.draws).saturating_sub(tried))?;
            Ok(found)
        };
        let effects = rows.par_iter().enumerate().map(one).collect::<Result<Vec<_>>>()?;
        Ok(PowerReport { seed: self.power.seed, noise: bench.noise_levels(), null, effects })
    }

    /// Every effect in every place; of couplings and of drifting parameters one in each equation.
    fn one_of_each(&self) -> Vec<&Hypothesis> {
        let mut random = ChaCha8Rng::seed_from_u64(self.power.seed);
        let mut chosen: Vec<&Hypothesis> = Vec::new();
        for hypothesis in self.hypotheses {
            let is_many = match Effect::from_id(hypothesis.id()) {
                Some(Effect::Coupling | Effect::ProductCoupling) => true,
                Some(Effect::Drift) => !hypothesis.variables.is_empty(),
                _ => false,
            };
            if !is_many {
                chosen.push(hypothesis);
                continue;
            }
            let like = |h: &Hypothesis| {
                h.id() == hypothesis.id()
                    && h.state == hypothesis.state
                    && h.variables.is_empty() == hypothesis.variables.is_empty()
            };
            if !chosen.iter().any(|h| like(h)) {
                let all: Vec<&Hypothesis> = self.hypotheses.iter().filter(|h| like(h)).collect();
                chosen.push(all[(random.next_u64() % all.len() as u64) as usize]);
            }
        }
        let order = |h: &&Hypothesis| (h.state, Effect::ALL.iter().position(|e| e.id() == h.id()));
        chosen.sort_by_key(order);
        chosen
    }
}

struct Table<'a> {
    study: &'a Study<'a>,
    bench: &'a Bench,
    system: &'a System,
    count: &'a Count<'a>,
}

/// What a blind diagnosis made of a copy.
enum Verdict {
    Missed,
    /// Named, in a group with others.
    Named(Vec<String>),
    Confused(PowerRival),
}

impl Table<'_> {
    /// Noise of a copy: streams do not overlap, so no copy depends on which others were made.
    fn random(&self, row: usize, size: usize, draw: usize) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.study.power.seed);
        random.set_stream(((row as u64 + 1) << 32) | ((size as u64) << 16) | draw as u64);
        random
    }

    fn null(&self) -> Result<PowerNull> {
        let draws = self.study.power.null_draws;
        let one = |draw: usize| {
            let report = self.blind(self.system.model().clone(), None, &mut self.random(usize::MAX >> 40, 0, draw))?;
            Ok((report.gap.detected, report.included().next().is_some()))
        };
        let found = (0..draws).into_par_iter().map(one).collect::<Result<Vec<_>>>()?;
        let alarms = found.iter().filter(|f| f.0).count();
        Ok(PowerNull { draws, alarms, included: found.iter().filter(|f| f.1).count() })
    }

    /// Diagnoses a copy of the logs with `model` as the machine, its tolerated parameters drawn (but `fixed`).
    fn blind(&self, mut model: Model, fixed: Option<usize>, random: &mut ChaCha8Rng) -> Result<Diagnosis> {
        for (i, parameter) in model.parameters.iter_mut().enumerate() {
            if let Some(tolerance) = parameter.tolerance.filter(|_| fixed != Some(i)) {
                parameter.value *= 1.0 + tolerance * normal(random);
            }
        }
        let readings = self.bench.readings(&model)?;
        let (train, holdout) = self.bench.copies(&readings, Some(random))?;
        let settings = Diagnose { power: None, ..self.study.settings.clone() };
        let Diagnosed { diagnosis, .. } = settings.run_system(self.system, &train, &holdout, self.count)?;
        self.count.add(1)?;
        Ok(diagnosis)
    }

    /// The sizes of one effect: the middle one first, then smaller ones while it is named, else larger ones until it is.
    fn effect(&self, row: usize, hypothesis: &Hypothesis, planted: &Planted) -> Result<PowerEffect> {
        let targets = &self.study.power.gap_to_noise;
        let mut known: Vec<(f64, f64)> = Vec::new();
        let mut found = self.empty(hypothesis, planted);
        let mut rivals: Vec<PowerRival> = Vec::new();
        let mut size = targets.len() / 2;
        let mut way = 0_isize;
        loop {
            let strength = self.strength(planted, targets[size], &mut known);
            let Some((strength, gap)) = strength else {
                let largest = known.iter().filter(|k| k.1.is_finite()).fold(0.0, |a: f64, k| a.max(k.1));
                let why =
                    if planted.end.is_empty() { "the free starts and tolerances take it up" } else { planted.end };
                found.limit = Some(format!("a gap above {:.2} times the noise is out of reach: {why}", largest));
                // Smaller ones may still be in reach.
                if way > 0 || size == 0 {
                    break;
                }
                way = -1;
                size -= 1;
                continue;
            };
            let trial = self.trial(row, size, hypothesis, planted, (strength, gap), &mut found.group, &mut rivals)?;
            found.trials.push(trial);
            let named = trial.named == trial.draws;
            if way == 0 {
                way = if named { -1 } else { 1 };
            }
            let go_on = if way < 0 { named && size > 0 } else { !named && size + 1 < targets.len() };
            if !go_on {
                break;
            }
            size = size.saturating_add_signed(way);
        }
        rivals.sort_by_key(|r| std::cmp::Reverse(r.draws));
        found.trials.sort_by(|a, b| a.gap_to_noise.total_cmp(&b.gap_to_noise));
        found.detected_from = smallest(&found.trials, |t| t.detected == t.draws);
        found.named_from = smallest(&found.trials, |t| t.named == t.draws);
        let other = found.group.first().or(rivals.iter().map(|r| &r.effect).find(|id| *id != "none"));
        found.next_experiment =
            other.filter(|id| *id != hypothesis.id()).map(|id| separating_experiment(hypothesis.id(), id).to_string());
        found.confused_with = rivals;
        Ok(found)
    }

    fn empty(&self, hypothesis: &Hypothesis, planted: &Planted) -> PowerEffect {
        PowerEffect {
            effect: hypothesis.id().into(),
            state: self.system.model().states[hypothesis.state].name.clone(),
            variables: hypothesis.variables.clone(),
            parameter: planted.symbol.into(),
            unit: planted.unit.clone(),
            detected_from: None,
            named_from: None,
            group: Vec::new(),
            confused_with: Vec::new(),
            next_experiment: None,
            limit: None,
            trials: Vec::new(),
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn trial(
        &self,
        row: usize,
        size: usize,
        hypothesis: &Hypothesis,
        planted: &Planted,
        (strength, gap): (f64, f64),
        group: &mut Vec<String>,
        rivals: &mut Vec<PowerRival>,
    ) -> Result<PowerTrial> {
        let draws = self.study.power.draws;
        let one = |draw: usize| {
            let mut random = self.random(row, size, draw);
            match self.blind(planted.model(strength), Some(planted.parameter()), &mut random) {
                Ok(report) => Ok((report.gap.detected, self.judge(hypothesis, &report))),
                Err(Error::Cancelled) => Err(Error::Cancelled),
                // A copy that can't be diagnosed reveals nothing.
                Err(_) => Ok((false, Verdict::Missed)),
            }
        };
        let found = (0..draws).into_par_iter().map(one).collect::<Result<Vec<_>>>()?;
        let detected = found.iter().filter(|f| f.0).count();
        let mut named = 0;
        for (_, verdict) in found {
            match verdict {
                Verdict::Missed => {}
                Verdict::Named(others) => {
                    named += 1;
                    for id in others {
                        if !group.contains(&id) {
                            group.push(id);
                        }
                    }
                }
                Verdict::Confused(rival) => {
                    let same = |r: &&mut PowerRival| {
                        (&r.effect, &r.state, &r.variables) == (&rival.effect, &rival.state, &rival.variables)
                    };
                    match rivals.iter_mut().find(same) {
                        Some(known) => known.draws += 1,
                        None => rivals.push(rival),
                    }
                }
            }
        }
        Ok(PowerTrial { gap_to_noise: gap, size: planted.size(strength), draws, detected, named })
    }

    /// Whether the first included cause is the planted effect, or a group with it.
    fn judge(&self, hypothesis: &Hypothesis, report: &Diagnosis) -> Verdict {
        let state = &self.system.model().states[hypothesis.state].name;
        let Some(cause) = report.included().next() else {
            if !report.gap.detected {
                return Verdict::Missed;
            }
            let (effect, state) = ("none".into(), String::new());
            return Verdict::Confused(PowerRival { effect, state, variables: Vec::new(), draws: 1 });
        };
        let is_it = cause.effect == hypothesis.id() && cause.state == *state && cause.variables == hypothesis.variables;
        if is_it {
            return Verdict::Named(cause.equivalent.clone());
        }
        if cause.equivalent.iter().any(|id| id == hypothesis.id()) {
            let others = cause.equivalent.iter().chain([&cause.effect]).filter(|id| *id != hypothesis.id());
            return Verdict::Named(others.cloned().collect());
        }
        let (effect, state, variables) = (cause.effect.clone(), cause.state.clone(), cause.variables.clone());
        Verdict::Confused(PowerRival { effect, state, variables, draws: 1 })
    }

    /// The strength at which the gap is `target` times the noise, and that gap; `None` where none within reach is.
    fn strength(&self, planted: &Planted, target: f64, known: &mut Vec<(f64, f64)>) -> Option<(f64, f64)> {
        if !(planted.first > 0.0 && planted.most > 0.0) {
            return None;
        }
        let close = |gap: f64| (gap / target).ln().abs() < CLOSE;
        let mut next = planted.first.min(planted.most);
        for _ in 0..16 {
            if let Some(&hit) = known.iter().find(|k| close(k.1)) {
                return Some(hit);
            }
            // The gap grows with the strength: stay between the last one too small and the first too large.
            let below = known
                .iter()
                .filter(|k| k.1 < target)
                .fold(None, |best: Option<(f64, f64)>, k| if best.is_none_or(|b| k.0 > b.0) { Some(*k) } else { best });
            let above = known.iter().filter(|k| k.1 >= target).map(|k| k.0).fold(f64::INFINITY, f64::min);
            if let Some((strength, gap)) = below {
                if strength >= planted.most {
                    return None;
                }
                let guess = strength * (target / gap.max(1e-9 * target)).clamp(1.02, 30.0);
                next = if guess < above { guess.min(planted.most) } else { (strength * above).sqrt() };
            } else if let Some(&(strength, gap)) = known.iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
                next = strength * if gap.is_finite() { (target / gap).clamp(1.0 / 30.0, 0.98) } else { 0.1 };
            }
            known.push((next, self.bench.gap(planted, next)));
        }
        // What no step hits (a delay of whole samples under a held control) is taken from the nearest above.
        known
            .iter()
            .copied()
            .filter(|k| k.1.is_finite() && k.1 > target && k.1 < 2.0 * target)
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Smallest gap's size from which `holds` for it and every larger one that was tried.
fn smallest(trials: &[PowerTrial], holds: impl Fn(&PowerTrial) -> bool) -> Option<f64> {
    trials.iter().rev().take_while(|t| holds(t)).last().map(|t| t.size)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};
    use crate::expression::Expression;
    use crate::model::{Control, Parameter, State};
    use crate::progress::Silent;
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
        assert_eq!((friction.state.as_str(), friction.unit.as_str()), ("v", "m/s/s"));
        assert!(friction.named_from.is_some_and(|c| c > 0.0), "{friction:?}");
        assert!(friction.named_from >= friction.detected_from, "{friction:?}");
        assert!(found.effects.iter().all(|e| !e.trials.is_empty()), "{:?}", found.effects);
        // The noise of the copies is that of the logs; 480 values tell a deviation to 3 %, doubled for the differences.
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
