//! Verify: held-out rollout errors of the nominal and the corrected model against the noise floor, by column.
//!
//! Every column is measured in units of its own noise, so that a column with a large range does not dominate.

mod sums;

use crate::data::Dataset;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::begun;
use crate::diagnose::fit::outputs::outputs;
use crate::diagnose::limits::verify::{ALLOWED, BLOCKS, DRAWS, GROWN, LEFT, LOST, LOST_NOISE, NO_GAP, RARELY, SEVERAL};
use crate::diagnose::notes::Note;
use crate::diagnose::report::{Closure, ClosureState, ResidualCheck, RolloutFigure, finite};
use crate::diagnose::steps::findings::Judged;
use crate::diagnose::steps::logs::noise::{moves, noise_levels, remove_outliers};
use crate::diagnose::steps::logs::sampled::set_clocks;
use crate::diagnose::steps::logs::windows::{Purpose, choose_windows, halved};
use crate::diagnose::steps::verdict::spread::{self, Spread};
use crate::diagnose::steps::verdict::start::{beginnings, starts};
use crate::diagnose::steps::verdict::{curves, floor, own_size};
use crate::error::Result;
use crate::refine::{Experiment, Point};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use sums::{Block, floor_of_all, is_quiet, overall, reached, rms};

/// Held-out rollouts of the nominal and of the corrected model.
pub(crate) struct Verification {
    pub(crate) closure: Closure,
    pub(crate) figures: Vec<RolloutFigure>,
    pub(crate) checks: Vec<ResidualCheck>,
    /// By column that moves, how surely the corrected model misses it by more than its noise allows.
    pub(crate) missed: Vec<Missed>,
    /// The same where every recording has a size of its own for causes whose sizes differ: of their form alone.
    pub(crate) form_missed: f64,
    /// States whose columns never move.
    pub(crate) resting: Vec<usize>,
    /// How random forces predict the held-out errors; none where there are none, or nothing predicts them.
    pub(crate) spread: Option<Spread>,
    /// What the user should know of the held-out rollouts.
    pub(crate) notes: Vec<Note>,
}

impl Verification {
    /// Probability that the corrected model misses a column; columns share what is wrong, so the surest speaks for all.
    pub(crate) fn missed(&self) -> f64 {
        surest(&self.missed)
    }

    /// Whether the floor is computed from the sensors' noise: it was not seen between runs.
    pub(crate) fn has_computed_floor(&self) -> bool {
        self.closure.floor_source == floor::SENSORS
    }

    /// Whether held-out rollouts of the nominal model miss by no more than noise does. Below a floor that its own starts have raised nothing
    /// is quiet: it holds any cause.
    pub(crate) fn is_quiet(&self) -> bool {
        let errors = self.closure.before.zip(self.closure.floor);
        errors.is_some_and(|errors| is_quiet(errors, self.has_computed_floor()))
    }

    /// The same where no cause is included: after is before, and nothing is closed.
    pub(crate) fn without_causes(mut self) -> Self {
        let closure = &mut self.closure;
        closure.after = closure.before;
        let none = closure.before.map(|_| 0.0);
        (closure.closed, closure.low, closure.high) = (none, none, none);
        for state in &mut closure.by_state {
            state.after = state.before;
            state.closed = state.before.map(|_| 0.0);
        }
        for figure in &mut self.figures {
            figure.after.clear();
            figure.fit_after = None;
        }
        self.checks.clear();
        self
    }
}

fn surest(missed: &[Missed]) -> f64 {
    missed.iter().map(|m| m.probability).fold(0.0, f64::max)
}

/// How surely a corrected model misses a column by more than its noise allows.
pub(crate) struct Missed {
    /// The column.
    pub(crate) name: String,
    pub(crate) probability: f64,
    /// Its error is more than half of the column's motion within the rollouts.
    pub(crate) is_lost: bool,
}

/// Held-out logs as the rollouts see them.
struct Heldout {
    experiment: Experiment,
    /// Columns that move.
    moving: Vec<usize>,
    /// Length of the rollouts, s, where they are not whole runs.
    cut: Option<f64>,
    /// What noise leaves of every column, in units of the noise, and what it was taken from.
    floor: Vec<f64>,
    floor_source: &'static str,
    /// Columns of which an error with a memory is the sensor's own.
    sensors: Vec<usize>,
}

pub(crate) fn closure(judged: &Judged, holdout: &Dataset, confidence: f64) -> Result<Verification> {
    let (nominal, best) = (&judged.nominal, &judged.outcome.best);
    let system = &nominal.system;
    let Heldout { experiment, moving, cut, floor, floor_source, .. } =
        predictable(best, held_out(best, holdout, &judged.sensors)?);
    let mut notes: Vec<Note> = cut.map(|length| Note::HoldoutRestarted { length }).into_iter().collect();
    let is_computed = floor_source == floor::SENSORS;
    let (floor, slow) = match judged.detected.gap {
        _ if !is_computed => (floor, Vec::new()),
        true => (floor, judged.sensors.clone()),
        false => with_slow_errors(best, &experiment, floor),
    };
    notes.extend(slow.into_iter().map(|c| slow_error(best, &experiment, c)));
    let resting: Vec<usize> =
        (0..experiment.columns.len()).filter(|c| !moving.contains(c)).map(|c| experiment.columns[c]).collect();
    if !resting.is_empty() {
        let columns = resting.iter().map(|&j| system.model().states[j].name.clone()).collect();
        notes.push(Note::Resting { columns });
    }
    // Before: the model exactly as it was handed in, tolerated parameters included.
    let before = rollouts(nominal, &system.parameter_values(), &experiment);
    let changed = !best.hypotheses.is_empty();
    let after = if changed { rollouts(best, &best.refined.parameters, &experiment) } else { before.clone() };
    let forcing = judged.forcing.as_ref().filter(|forcing| !forcing.forces.is_empty());
    let spread = forcing.and_then(|forcing| spread::of(best, &experiment, &moving, &after, forcing));
    let blocks = blocks(&experiment, &moving, &before, &after);
    let floor = if is_computed && judged.detected.gap { reached(&blocks, floor) } else { floor };
    let (before_all, after_all) = (overall(&blocks, |b| &b.before), overall(&blocks, |b| &b.after));
    let floor_all = floor_of_all(&blocks, &floor);
    let interval = bootstrap(&blocks, confidence, |chosen| {
        closed(overall(chosen, |b| &b.before), overall(chosen, |b| &b.after), floor_of_all(chosen, &floor))
    });
    let closure = Closure {
        metric: "rollout_rmse".into(),
        before: finite(before_all),
        after: finite(after_all),
        floor: finite(floor_all),
        floor_source: floor_source.into(),
        closed: finite(closed(before_all, after_all, floor_all)),
        low: finite(interval.0),
        high: finite(interval.1),
        horizon: finite(experiment.longest_window()),
        spread: spread.as_ref().map(|spread| spread.within),
        by_state: moving.iter().map(|&c| by_state(system, &experiment, &floor, &blocks, c)).collect(),
    };
    let model_error = nominal.evidence.model_error;
    let missed = |&c: &usize| Missed {
        name: system.model().states[experiment.columns[c]].name.clone(),
        probability: missed(&blocks, floor[c], model_error, c),
        is_lost: changed && is_lost(&experiment, &blocks, c),
    };
    let missed: Vec<Missed> = moving.iter().map(missed).collect();
    let of_form = |after: &Vec<Vec<f64>>| {
        let blocks = self::blocks(&experiment, &moving, &before, after);
        moving.iter().map(|&c| self::missed(&blocks, floor[c], model_error, c)).fold(0.0, f64::max)
    };
    let rollouts_of = |held_out: &Experiment| rollouts(best, &best.refined.parameters, held_out);
    let of_own = own_size::with_sizes_of_their_own(best, &experiment, &after, &rollouts_of);
    let form_missed = of_own.map_or_else(|| surest(&missed), |after| of_form(&after));
    let figures = curves::rollouts(system, &experiment, &moving, &before, changed.then_some(&after));
    let checks = curves::checks(system, &experiment, &moving, &after);
    Ok(Verification { closure, figures, checks, missed, form_missed, resting, spread, notes })
}

/// The held-out logs, cut into rollouts that are as long as the corrected model can predict.
fn held_out(best: &Contestant, holdout: &Dataset, sensors: &[usize]) -> Result<Heldout> {
    let mut experiment = Experiment::new(&best.system, holdout, None)?;
    let known = &best.experiment;
    experiment.scale.clone_from(&known.scale);
    let own = noise_levels(&experiment.logs, experiment.columns.len());
    remove_outliers(std::sync::Arc::make_mut(&mut experiment.logs).as_mut_slice(), &own);
    set_clocks(&mut experiment, &known.logs);
    // A column that rests here says nothing of its noise.
    let moves_here = |c: usize| moves(&experiment.logs, c);
    // One that repeats its readings may be too short here to show that it does.
    let is_known_better = |c: usize| !moves_here(c) || known.news[c] < 1.0;
    let noise = |c: usize| if is_known_better(c) { known.noise[c] } else { own[c].min(known.noise[c]) };
    let noise: Vec<f64> = (0..own.len()).map(noise).collect();
    let moving = (0..own.len()).filter(|&c| moves_here(c) || moves(&known.logs, c)).collect();
    experiment.noise = noise;
    experiment.hold = known.hold;
    experiment.past = known.past;
    experiment.substeps = known.substeps;
    let mut cut = None;
    if known.windows.len() > known.logs.len() {
        let fitted = known.longest_window();
        // The search may have looked at shorter rollouts than the corrected model can predict.
        let (parameters, rollout) = (&best.refined.parameters, Purpose::Rollout);
        let longest = choose_windows(&best.system, known.clone(), (parameters, &best.free), rollout, &|_| Ok(()));
        let length = longest.map_or(fitted, |(_, cut)| cut.unwrap_or(f64::INFINITY).max(fitted));
        if length.is_finite() {
            experiment = experiment.with_windows_of(length);
            cut = Some(length);
        }
    }
    let (floor, floor_source) = floor_of(best, &experiment, sensors);
    Ok(Heldout { experiment, moving, cut, floor, floor_source, sensors: sensors.to_vec() })
}

/// The same in rollouts so short that the noise of a start does not grow beyond what the sensors add: longer ones show the start alone, and
/// no wrong model could miss them.
fn predictable(best: &Contestant, mut heldout: Heldout) -> Heldout {
    let is_grown = |floor: &[f64], moving: &[usize]| moving.iter().any(|&c| floor[c] > GROWN);
    while heldout.floor_source == floor::SENSORS && is_grown(&heldout.floor, &heldout.moving) {
        let Some(experiment) = halved(&heldout.experiment) else { break };
        let (floor, _) = floor_of(best, &experiment, &heldout.sensors);
        heldout = Heldout { cut: Some(experiment.longest_window()), experiment, floor, ..heldout };
    }
    heldout
}

/// The floor where no gap was found: all that the fit leaves of a column was taken for noise then, a slow error of its sensor, too, and no
/// rollout misses by less. And the columns where that is several times the noise that samples show beside each other.
fn with_slow_errors(best: &Contestant, experiment: &Experiment, floor: Vec<f64>) -> (Vec<f64>, Vec<usize>) {
    let several = (0..floor.len()).filter(|&c| left(best, experiment, c) > SEVERAL).collect();
    (floor.iter().enumerate().map(|(c, floor)| floor.max(left(best, experiment, c))).collect(), several)
}

/// What is to be said of a column whose sensor has a slow error.
fn slow_error(best: &Contestant, experiment: &Experiment, c: usize) -> Note {
    let column = best.system.model().states[experiment.columns[c]].name.clone();
    Note::SlowErrors { column, times: left(best, experiment, c) }
}

/// What the fit leaves of a column, in units of the noise.
fn left(best: &Contestant, experiment: &Experiment, c: usize) -> f64 {
    best.evidence.colours[c].variance().sqrt() * best.experiment.noise[c] / experiment.noise[c]
}

/// The floor in units of the noise, as everything here.
fn floor_of(best: &Contestant, experiment: &Experiment, sensors: &[usize]) -> (Vec<f64>, &'static str) {
    let (floor, source) = floor::of(best, experiment, sensors);
    (floor.iter().zip(&experiment.noise).map(|(floor, noise)| floor / noise).collect(), source)
}

/// Outputs of a model on the held-out logs, in the column's unit: one list a window, columns beside each other.
fn rollouts(fitted: &Contestant, parameters: &[f64], experiment: &Experiment) -> Vec<Vec<f64>> {
    let mut own = Experiment { scale: fitted.experiment.scale.clone(), ..experiment.clone() };
    let mut initial = starts(&fitted.system, &own, parameters, fitted.nominal_states());
    if !begun::limited(&fitted.system).is_empty() {
        // Where an actuator stands as a log begins is a part of its start, and looked for where that is.
        let beginning = Experiment { windows: beginnings(&own), ..own.clone() };
        let point = Point { parameters: parameters.to_vec(), initial: initial.clone() };
        if let Ok(found) = begun::settle(&fitted.system, beginning, &point) {
            own.logs = found.logs;
            initial = starts(&fitted.system, &own, parameters, fitted.nominal_states());
        }
    }
    let scaled = outputs(&fitted.system, &own, parameters, &initial);
    let n_columns = own.columns.len();
    let unscale = |window: Vec<f64>| window.iter().enumerate().map(|(i, v)| v * own.noise[i % n_columns]).collect();
    scaled.into_iter().map(unscale).collect()
}

/// Share of the gap that is closed: exact where there is a gap, and zero where there is none.
fn closed(before: f64, after: f64, floor: f64) -> f64 {
    if before == after { 0.0 } else { (before - after) / (before - floor).max(NO_GAP * floor) }
}

/// Errors in blocks of every rollout; columns that rest count nothing.
fn blocks(experiment: &Experiment, moving: &[usize], before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<Block> {
    let n_columns = experiment.columns.len();
    let mut all = Vec::new();
    for (w, window) in experiment.windows.iter().enumerate() {
        let log = &experiment.logs[window.log];
        let samples = window.last - window.first + 1;
        let parts = BLOCKS.min(samples);
        for part in 0..parts {
            let mut block =
                Block { before: vec![0.0; n_columns], after: vec![0.0; n_columns], count: vec![0.0; n_columns] };
            for i in part * samples / parts..(part + 1) * samples / parts {
                for &c in moving {
                    let measured = log.measured[c][window.first + i];
                    if measured.is_finite() {
                        let row = i * n_columns + c;
                        block.before[c] += ((measured - before[w][row]) / experiment.noise[c]).powi(2);
                        block.after[c] += ((measured - after[w][row]) / experiment.noise[c]).powi(2);
                        block.count[c] += 1.0;
                    }
                }
            }
            all.push(block);
        }
    }
    all
}

/// Percentile interval over blocks drawn with replacement.
fn bootstrap(blocks: &[Block], confidence: f64, statistic: impl Fn(&[Block]) -> f64) -> (f64, f64) {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut values: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let chosen: Vec<Block> =
                (0..blocks.len()).map(|_| blocks[(random.next_u64() % blocks.len() as u64) as usize].clone()).collect();
            statistic(&chosen)
        })
        .filter(|v| v.is_finite())
        .collect();
    if values.is_empty() {
        return (f64::NAN, f64::NAN);
    }
    values.sort_by(f64::total_cmp);
    let at = |part: f64| values[(part * (values.len() - 1) as f64).round() as usize];
    (at(0.5 - 0.5 * confidence), at(0.5 + 0.5 * confidence))
}

fn by_state(
    system: &crate::model::System,
    experiment: &Experiment,
    floor: &[f64],
    blocks: &[Block],
    c: usize,
) -> ClosureState {
    let state = &system.model().states[experiment.columns[c]];
    let (before, after) = (rms(blocks, c, |b| b.before[c]), rms(blocks, c, |b| b.after[c]));
    let in_unit = |value: f64| finite(value * experiment.noise[c]);
    ClosureState {
        state: state.name.clone(),
        before: in_unit(before),
        after: in_unit(after),
        floor: in_unit(floor[c]),
        closed: finite(closed(before, after, floor[c])),
        unit: state.unit.clone(),
    }
}

/// How surely the error of column `c` is larger than its noise, or a hundredth of its gap, allows.
///
/// Student's t of the blocks' mean excess: sure where it is large and everywhere, open where one block alone shows it; with
/// what is known beforehand.
fn missed(blocks: &[Block], floor: f64, model_error: f64, c: usize) -> f64 {
    use statrs::distribution::{ContinuousCDF, StudentsT};
    let own: Vec<&Block> = blocks.iter().filter(|b| b.count[c] > 0.0).collect();
    let mean = |pick: &dyn Fn(&Block) -> f64| own.iter().map(|b| pick(b) / b.count[c]).sum::<f64>() / own.len() as f64;
    let (before, after) = (mean(&|b| b.before[c]), mean(&|b| b.after[c]));
    if !after.is_finite() {
        return 1.0;
    }
    let of_gap = floor + LEFT * (before.sqrt() - floor).max(0.0);
    let of_gap = if of_gap.is_finite() { of_gap * of_gap } else { 0.0 };
    let allowed = ((1.0 + ALLOWED) * (floor * floor + model_error)).max(of_gap);
    let variance = own.iter().map(|b| (b.after[c] / b.count[c] - after).powi(2)).sum::<f64>();
    let degrees = (own.len() as f64 - 1.0).max(1.0);
    // The mean of the blocks scatters by no more than two values of noise would: one block far off is a miss, too.
    let deviation = (variance / degrees / own.len() as f64).sqrt().clamp(1e-12 * allowed, allowed);
    let chance = StudentsT::new(0.0, 1.0, degrees).map_or(0.5, |t| t.sf((after - allowed) / deviation));
    let odds = RARELY * (1.0 - chance) / chance.max(f64::MIN_POSITIVE);
    odds / (1.0 + odds)
}

/// Whether the corrected model's error of column `c` is more than half of what the column moves within the rollouts.
fn is_lost(experiment: &Experiment, blocks: &[Block], c: usize) -> bool {
    let (mut squares, mut count) = (0.0, 0.0);
    for window in &experiment.windows {
        let values = &experiment.logs[window.log].measured[c][window.first..=window.last];
        let there: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let mean = there.iter().sum::<f64>() / there.len().max(1) as f64;
        squares += there.iter().map(|v| ((v - mean) / experiment.noise[c]).powi(2)).sum::<f64>();
        count += there.len() as f64;
    }
    let error: f64 = blocks.iter().map(|b| b.after[c]).sum::<f64>() / blocks.iter().map(|b| b.count[c]).sum::<f64>();
    // Noise alone is no motion.
    !(error <= (LOST * squares / count).max(LOST_NOISE))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
