//! Closure: how far the corrected model's held-out rollouts come from the nominal ones to the noise floor.

use super::fitted::Fitted;
use super::prepare::{Purpose, choose_windows, noise_levels, remove_outliers};
use super::report::{Closure, ClosureState, RolloutFigure, finite, thinned};
use crate::data::Dataset;
use crate::error::Result;
use crate::refine::{Experiment, Refine, Window, guess_initial};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Share of a held-out rollout to whose first samples its start is fitted.
const START: f64 = 0.25;

/// Blocks of a run for the interval, and bootstrap draws.
const BLOCKS: usize = 8;
const DRAWS: usize = 400;

/// Held-out rollouts of the nominal and of the corrected model.
pub(crate) struct Verification {
    pub(crate) closure: Closure,
    pub(crate) figures: Vec<RolloutFigure>,
}

/// Outputs of a model on the held-out logs, in the column's unit: one list a window, columns beside each other.
fn rollouts(fitted: &Fitted, parameters: &[f64], experiment: &Experiment) -> Vec<Vec<f64>> {
    let own = Experiment { scale: fitted.experiment.scale.clone(), ..experiment.clone() };
    // The start is fitted to the first samples only, with every parameter fixed.
    let starts: Vec<Window> = own
        .windows
        .iter()
        .map(|w| {
            let samples = (START * (w.last - w.first) as f64) as usize;
            Window { last: w.last.min(w.first + samples.max(8)), ..*w }
        })
        .collect();
    let beginning = Experiment { windows: starts, ..own.clone() };
    let guess = super::lag::with_lagging(
        &fitted.system,
        &beginning,
        guess_initial(&fitted.system, &beginning),
        fitted.nominal_states(),
    );
    let settings = Refine { max_iterations: 15, tolerance: 1e-6 };
    let initial =
        settings.fit(&fitted.system, &beginning, parameters, &[], Some(&guess)).map_or(guess, |fit| fit.initial);
    let scaled = super::screen::outputs(&fitted.system, &own, parameters, &initial);
    let n_columns = own.columns.len();
    let unscale = |window: Vec<f64>| window.iter().enumerate().map(|(i, v)| v * own.noise[i % n_columns]).collect();
    scaled.into_iter().map(unscale).collect()
}

/// Squared, spread-scaled errors of one block of a run: sums and counts by column.
#[derive(Clone)]
struct Block {
    before: Vec<f64>,
    after: Vec<f64>,
    count: Vec<f64>,
}

pub(crate) fn closure(
    nominal: &Fitted,
    best: &Fitted,
    holdout: &Dataset,
    confidence: f64,
    notes: &mut Vec<String>,
) -> Result<Verification> {
    let system = &nominal.system;
    let mut experiment = Experiment::new(system, holdout, None)?;
    let spread: Vec<f64> = experiment.noise.clone();
    experiment.noise = noise_levels(&experiment.logs, spread.len());
    let noise = experiment.noise.clone();
    remove_outliers(std::sync::Arc::make_mut(&mut experiment.logs).as_mut_slice(), &noise);
    experiment.hold = best.experiment.hold;
    experiment.past = best.experiment.past;
    experiment.substeps = best.experiment.substeps;
    if best.experiment.windows.len() > best.experiment.logs.len() {
        let fitted = best.experiment.longest_window();
        // The search may have looked at shorter rollouts than the corrected model can predict.
        let (parameters, rollout) = (&best.refined.parameters, Purpose::Rollout);
        let longest = choose_windows(&best.system, best.experiment.clone(), parameters, &best.free, rollout);
        let length = longest.map_or(fitted, |(_, cut)| cut.unwrap_or(f64::INFINITY).max(fitted));
        if length.is_finite() {
            experiment = experiment.with_windows_of(length);
            notes.push(format!(
                "held-out rollouts are restarted every {length:.3} s: longer ones magnify any error of the start"
            ));
        }
    }
    // Before: the model exactly as it was handed in, tolerated parameters included.
    let before = rollouts(nominal, &system.parameter_values(), &experiment);
    let changed = !best.hypotheses.is_empty();
    let after = if changed { rollouts(best, &best.refined.parameters, &experiment) } else { before.clone() };

    let repeated = super::repeat::between_runs(&experiment.logs, &noise);
    let floor_source = if repeated.is_some() { "repeated runs" } else { "sensor noise" };
    let floor = repeated.unwrap_or_else(|| noise_floor(best, &noise));
    let blocks = blocks(&experiment, &spread, &before, &after);
    let overall = |pick: &dyn Fn(&Block) -> &Vec<f64>, chosen: &[Block]| {
        let sum: f64 = chosen.iter().map(|b| pick(b).iter().sum::<f64>()).sum();
        let count: f64 = chosen.iter().map(|b| b.count.iter().sum::<f64>()).sum();
        (sum / count).sqrt()
    };
    let present: f64 = blocks.iter().map(|b| b.count.iter().sum::<f64>()).sum();
    let floor_share: f64 = (0..spread.len())
        .map(|c| blocks.iter().map(|b| b.count[c]).sum::<f64>() / present * (floor[c] / spread[c]).powi(2))
        .sum();
    let floor_all = floor_share.sqrt();
    let (before_all, after_all) = (overall(&|b| &b.before, &blocks), overall(&|b| &b.after, &blocks));
    let closed = |before: f64, after: f64| (before - after) / (before - floor_all);
    // Without a gap above the floor there is nothing to close.
    let has_gap = before_all > 1.05 * floor_all && changed;
    let interval = has_gap.then(|| {
        bootstrap(&blocks, confidence, |chosen| closed(overall(&|b| &b.before, chosen), overall(&|b| &b.after, chosen)))
    });
    let by_state = by_state(system, &experiment, &spread, &floor, &blocks);
    let closure = Closure {
        metric: "rollout_rmse".into(),
        before: finite(before_all),
        after: finite(after_all),
        floor: finite(floor_all),
        floor_source: floor_source.into(),
        closed: if has_gap { finite(closed(before_all, after_all)) } else { None },
        low: interval.and_then(|i| finite(i.0)),
        high: interval.and_then(|i| finite(i.1)),
        by_state,
    };
    let figures = figures(system, &experiment, &before, changed.then_some(&after));
    Ok(Verification { closure, figures })
}

/// What noise alone leaves, by column in its unit: the winner's residual where it is about as small as the
/// noise of differences (it then shows coloured noise, too), else the noise of differences.
fn noise_floor(best: &Fitted, noise: &[f64]) -> Vec<f64> {
    best.colours
        .iter()
        .zip(noise)
        .zip(&best.experiment.noise)
        .map(|((colour, &held_out), &train)| {
            let residual = train * colour.variance().sqrt();
            if colour.variance() < 1.5 { residual } else { held_out.min(train) }
        })
        .collect()
}

fn blocks(experiment: &Experiment, spread: &[f64], before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<Block> {
    let n_columns = spread.len();
    let mut all = Vec::new();
    for (w, window) in experiment.windows.iter().enumerate() {
        let log = &experiment.logs[window.log];
        let samples = window.last - window.first + 1;
        let parts = BLOCKS.min(samples);
        for part in 0..parts {
            let mut block =
                Block { before: vec![0.0; n_columns], after: vec![0.0; n_columns], count: vec![0.0; n_columns] };
            for i in part * samples / parts..(part + 1) * samples / parts {
                for c in 0..n_columns {
                    let measured = log.measured[c][window.first + i];
                    if measured.is_finite() {
                        let row = i * n_columns + c;
                        block.before[c] += ((measured - before[w][row]) / spread[c]).powi(2);
                        block.after[c] += ((measured - after[w][row]) / spread[c]).powi(2);
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
    spread: &[f64],
    floor: &[f64],
    blocks: &[Block],
) -> Vec<ClosureState> {
    (0..spread.len())
        .map(|c| {
            let state = &system.model().states[experiment.columns[c]];
            let count: f64 = blocks.iter().map(|b| b.count[c]).sum();
            let rms = |pick: &dyn Fn(&Block) -> f64| (blocks.iter().map(pick).sum::<f64>() / count).sqrt() * spread[c];
            ClosureState {
                state: state.name.clone(),
                before: finite(rms(&|b| b.before[c])),
                after: finite(rms(&|b| b.after[c])),
                floor: finite(floor[c]),
                unit: state.unit.clone(),
            }
        })
        .collect()
}

fn figures(
    system: &crate::model::System,
    experiment: &Experiment,
    before: &[Vec<f64>],
    after: Option<&Vec<Vec<f64>>>,
) -> Vec<RolloutFigure> {
    let n_columns = experiment.columns.len();
    let mut all = Vec::new();
    for (index, log) in experiment.logs.iter().enumerate() {
        let kept = thinned(log.time.len());
        let windows: Vec<(usize, &Window)> =
            experiment.windows.iter().enumerate().filter(|(_, w)| w.log == index).collect();
        let series = |values: &[Vec<f64>], c: usize| -> Vec<Option<f64>> {
            let mut line = vec![None; log.time.len()];
            for (w, window) in &windows {
                for i in window.first..=window.last {
                    line[i] = finite(values[*w][(i - window.first) * n_columns + c]);
                }
            }
            kept.iter().map(|&i| line[i]).collect()
        };
        for (c, &state) in experiment.columns.iter().enumerate() {
            let state = &system.model().states[state];
            all.push(RolloutFigure {
                run: log.name.clone(),
                column: state.name.clone(),
                unit: state.unit.clone(),
                time: kept.iter().map(|&i| log.time[i]).collect(),
                measured: kept.iter().map(|&i| finite(log.measured[c][i])).collect(),
                before: series(before, c),
                after: after.map_or(Vec::new(), |a| series(a, c)),
            });
        }
    }
    all
}
