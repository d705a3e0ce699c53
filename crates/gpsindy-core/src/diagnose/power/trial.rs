//! One effect of a power study: at which sizes diagnoses of the copies detect and name it.

use crate::data::Dataset;
use crate::diagnose::catalogue::effect::separating_experiment;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::planting::Planted;
use crate::diagnose::limits::NO_ROW;
use crate::diagnose::power::copies::Bench;
use crate::diagnose::power::settings::Power;
use crate::diagnose::report::{Diagnosis, PowerEffect, PowerNull, PowerRival, PowerTrial};
use crate::error::{Error, Result};
use crate::model::{Model, System};
use crate::parallel;
use crate::progress::{Progress, step};
use crate::random::normal;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The diagnosis of logs to learn from and to verify on, as the user asked for it.
pub(crate) type Blind<'a> = dyn Fn(&Dataset, &Dataset, &dyn Progress) -> Result<Diagnosis> + Sync + 'a;

/// Counts the copies that are through, and passes a wish to stop on.
pub(crate) struct Count<'a> {
    progress: &'a dyn Progress,
    done: AtomicUsize,
    total: usize,
}

impl Progress for Count<'_> {
    fn report(&self, _stage: &str, _done: usize, _total: usize) -> bool {
        self.progress.report("power", self.done.load(Ordering::Relaxed).min(self.total), self.total)
    }
}

impl<'a> Count<'a> {
    pub(crate) fn new(progress: &'a dyn Progress, total: usize) -> Self {
        Self { progress, done: AtomicUsize::new(0), total }
    }

    pub(crate) fn add(&self, count: usize) -> Result<()> {
        let done = self.done.fetch_add(count, Ordering::Relaxed) + count;
        step(self.progress, "power", done.min(self.total), self.total)
    }
}

/// The diagnoses of all copies.
pub(crate) struct Table<'a> {
    pub(crate) diagnose: &'a Blind<'a>,
    pub(crate) power: &'a Power,
    pub(crate) bench: &'a Bench,
    pub(crate) system: &'a System,
    pub(crate) count: &'a Count<'a>,
}

/// One planted effect.
struct Row<'a> {
    number: u64,
    hypothesis: &'a Hypothesis,
    planted: &'a Planted,
}

/// What the planted effect was taken for: a group with others, or others alone.
#[derive(Default)]
struct Taken {
    group: Vec<String>,
    rivals: Vec<PowerRival>,
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
    fn random(&self, row: u64, size: usize, draw: usize) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.power.seed);
        // A row's number, a size's and a draw's, side by side.
        random.set_stream(((row + 1) << 32) | ((size as u64) << 16) | draw as u64);
        random
    }

    /// Copies without any effect: how many alarm, and how many name one.
    pub(crate) fn null(&self) -> Result<PowerNull> {
        let draws = self.power.null_draws;
        let one = |draw: usize| {
            let report = self.blind(self.system.model().clone(), None, &mut self.random(NO_ROW, 0, draw))?;
            Ok((report.gap.detected, report.included().next().is_some()))
        };
        let found = parallel::try_map(0..draws, one)?;
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
        let diagnosis = (self.diagnose)(&train, &holdout, self.count)?;
        self.count.add(1)?;
        Ok(diagnosis)
    }

    /// The sizes of one effect: the middle one first, then smaller ones while it is named, else larger ones until it is.
    pub(crate) fn effect(&self, row: usize, hypothesis: &Hypothesis, planted: &Planted) -> Result<PowerEffect> {
        let row = Row { number: row as u64, hypothesis, planted };
        let targets = &self.power.gap_to_noise;
        let mut known: Vec<(f64, f64)> = Vec::new();
        let mut found = self.empty(hypothesis, planted);
        let mut taken = Taken::default();
        let mut size = targets.len() / 2;
        let mut way = 0_isize;
        loop {
            let strength = self.bench.strength(planted, targets[size], &mut known);
            let Some((strength, gap)) = strength else {
                let largest = known.iter().filter(|k| k.1.is_finite()).fold(0.0, |a: f64, k| a.max(k.1));
                let why =
                    if planted.end().is_empty() { "the free starts and tolerances take it up" } else { planted.end() };
                found.limit = Some(format!("a gap above {:.2} times the noise is out of reach: {why}", largest));
                // Smaller ones may still be in reach.
                if way > 0 || size == 0 {
                    break;
                }
                way = -1;
                size -= 1;
                continue;
            };
            let trial = self.trial(&row, size, (strength, gap), &mut taken)?;
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
        let Taken { group, mut rivals } = taken;
        found.group = group;
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
            variables: hypothesis.stated().to_vec(),
            parameter: planted.symbol().into(),
            unit: planted.unit().into(),
            detected_from: None,
            named_from: None,
            group: Vec::new(),
            confused_with: Vec::new(),
            next_experiment: None,
            limit: None,
            trials: Vec::new(),
        }
    }

    /// One size of a row: blind diagnoses of its copies.
    fn trial(&self, row: &Row<'_>, size: usize, (strength, gap): (f64, f64), taken: &mut Taken) -> Result<PowerTrial> {
        let Row { number, hypothesis, planted } = *row;
        let Taken { group, rivals } = taken;
        let draws = self.power.draws;
        let one = |draw: usize| {
            let mut random = self.random(number, size, draw);
            match self.blind(planted.model(strength), Some(planted.parameter()), &mut random) {
                Ok(report) => Ok((report.gap.detected, self.judge(hypothesis, &report))),
                Err(Error::Cancelled) => Err(Error::Cancelled),
                // A copy that can't be diagnosed reveals nothing.
                Err(_) => Ok((false, Verdict::Missed)),
            }
        };
        let found = parallel::try_map(0..draws, one)?;
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
        let is_it = cause.effect == hypothesis.id() && cause.state == *state && cause.variables == hypothesis.stated();
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
}

/// Smallest gap's size from which `holds` for it and every larger one that was tried.
fn smallest(trials: &[PowerTrial], holds: impl Fn(&PowerTrial) -> bool) -> Option<f64> {
    trials.iter().rev().take_while(|t| holds(t)).last().map(|t| t.size)
}
