//! Closure: how far the corrected model's held-out rollouts come from the nominal ones to the noise floor.

use crate::data::Dataset;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::outputs;
use crate::diagnose::notes::{Note, Notes};
use crate::diagnose::report::{Closure, ClosureState, RolloutFigure, finite, thinned};
use crate::diagnose::steps::noise::{noise_levels, remove_outliers};
use crate::diagnose::steps::windows::{Purpose, choose_windows};
use crate::error::Result;
use crate::refine::{Experiment, Jacobian, Point, Refine, Window, guess_initial};
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

/// Starts of the held-out rollouts, fitted to their first samples only, with every parameter fixed.
fn starts(fitted: &Contestant, parameters: &[f64], own: &Experiment) -> Vec<Vec<f64>> {
    let beginning = Experiment { windows: beginnings(&own.windows), ..own.clone() };
    let guess = crate::diagnose::fit::lagging::with_lagging(
        &fitted.system,
        &beginning,
        guess_initial(&fitted.system, &beginning),
        fitted.nominal_states(),
    );
    let settings = Refine { max_iterations: 15, tolerance: 1e-6 };
    settings.fit(&fitted.system, &beginning, parameters, &[], Some(&guess)).map_or(guess, |fit| fit.initial)
}

/// Outputs of a model on the held-out logs, in the column's unit: one list a window, columns beside each other.
fn rollouts(fitted: &Contestant, parameters: &[f64], experiment: &Experiment) -> Vec<Vec<f64>> {
    let own = Experiment { scale: fitted.experiment.scale.clone(), ..experiment.clone() };
    let initial = starts(fitted, parameters, &own);
    let scaled = outputs(&fitted.system, &own, parameters, &initial);
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
    nominal: &Contestant,
    best: &Contestant,
    holdout: &Dataset,
    confidence: f64,
    notes: &Notes,
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
        let longest =
            choose_windows(&best.system, best.experiment.clone(), (parameters, &best.free), rollout, &|_| Ok(()));
        let length = longest.map_or(fitted, |(_, cut)| cut.unwrap_or(f64::INFINITY).max(fitted));
        if length.is_finite() {
            experiment = experiment.with_windows_of(length);
            notes.say(Note::HoldoutRestarted { length });
        }
    }
    // Before: the model exactly as it was handed in, tolerated parameters included.
    let before = rollouts(nominal, &system.parameter_values(), &experiment);
    let changed = !best.hypotheses.is_empty();
    let after = if changed { rollouts(best, &best.refined.parameters, &experiment) } else { before.clone() };

    let repeated = crate::diagnose::steps::floor::between_runs(&experiment.logs, &noise);
    let floor_source = if repeated.is_some() { "repeated runs" } else { "sensor noise" };
    let floor = repeated.unwrap_or_else(|| with_start(best, &experiment, noise_floor(best, &noise)));
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
fn noise_floor(best: &Contestant, noise: &[f64]) -> Vec<f64> {
    best.evidence
        .colours
        .iter()
        .zip(noise)
        .zip(&best.experiment.noise)
        .map(|((colour, &held_out), &train)| {
            let residual = train * colour.variance().sqrt();
            if colour.variance() < 1.5 { residual } else { held_out.min(train) }
        })
        .collect()
}

/// The windows' beginnings, to which their starts are fitted.
fn beginnings(windows: &[Window]) -> Vec<Window> {
    let of = |w: &Window| {
        let samples = (START * (w.last - w.first) as f64) as usize;
        Window { last: w.last.min(w.first + samples.max(8)), ..*w }
    };
    windows.iter().map(of).collect()
}

/// The floor with what noise does to the starts: they are fitted to a few noisy samples, and the rollout carries their
/// error on. In an unstable plant that is most of what noise leaves.
fn with_start(best: &Contestant, experiment: &Experiment, floor: Vec<f64>) -> Vec<f64> {
    let own = Experiment { scale: best.experiment.scale.clone(), noise: floor.clone(), ..experiment.clone() };
    let beginning = beginnings(&own.windows);
    let initial = starts(best, &best.refined.parameters, &own);
    let point = Point { parameters: best.refined.parameters.clone(), initial };
    let Ok(jacobian) = Jacobian::new(&best.system, &own, &point, &[]) else { return floor };
    let n_columns = own.columns.len();
    let mut sums = vec![(0.0, 0.0); n_columns];
    for ((block, window), start) in jacobian.blocks.iter().zip(&own.windows).zip(&beginning) {
        let fitted = (start.last - start.first + 1) * n_columns;
        let seen = block.derivative.rows(0, fitted.min(block.derivative.nrows()));
        let mut information = seen.tr_mul(&seen);
        let ridge = 1e-9 * information.diagonal().max() + f64::MIN_POSITIVE;
        (0..information.nrows()).for_each(|i| information[(i, i)] += ridge);
        let Some(factor) = information.cholesky() else { return floor };
        let carried = factor.solve(&block.derivative.transpose());
        for row in (0..(window.last - window.first + 1) * n_columns).filter(|&row| block.present[row]) {
            let blur: f64 = block.derivative.row(row).iter().zip(carried.column(row).iter()).map(|(a, b)| a * b).sum();
            let (sum, count) = &mut sums[row % n_columns];
            // What was fitted comes out closer than the noise, the rest further.
            *sum += if row < fitted { 1.0 - blur.min(1.0) } else { 1.0 + blur };
            *count += 1.0;
        }
    }
    let blurred = |(floor, (sum, count)): (f64, (f64, f64))| {
        let factor = if count > 0.0 { sum / count } else { 1.0 };
        if factor.is_finite() { floor * factor.max(1.0).sqrt() } else { floor }
    };
    floor.into_iter().zip(sums).map(blurred).collect()
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};
    use crate::diagnose::{Diagnose, Verdict, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, State};
    use crate::progress::Silent;
    use faer::Mat;

    #[test]
    fn the_floor_of_an_unstable_plant_holds_what_noise_does_to_its_starts() {
        // x' = 2x + 0.8u, held upright by its own noisy reading; the nominal model expects all of u.
        let (noise, step) = (0.02, 0.02_f64);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64).sum::<f64>() - 6.0;
        let runs = (0..4usize).map(|run| {
            let (mut x, mut values) = (0.1, Vec::new());
            for i in 0..500_usize {
                let wish = if (i / (40 + 7 * run)).is_multiple_of(2) { 0.5 } else { -0.5 };
                let read = x + noise * normal();
                let u = -5.0 * (read - wish) - 2.5 * wish;
                values.push([read, u]);
                let rest = -0.4 * u;
                x = rest + (x - rest) * (2.0 * step).exp();
            }
            let time = (0..500).map(|i| step * f64::from(i)).collect();
            Run { name: format!("run {run}"), time, values: Mat::from_fn(500, 2, |i, c| values[i][c]) }
        });
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs.collect()).unwrap();
        let model = Model {
            states: vec![State::new("x", Expression::parse("2*x + u").unwrap())],
            controls: vec![Control::new("u")],
            ..Model::default()
        };
        let (train, holdout) = hold_out(&data).unwrap();
        let diagnosis = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        assert_eq!(diagnosis.verdict, Verdict::Explained, "{:?} {:?}", diagnosis.causes, diagnosis.closure);
        // A linear plant of one state can't tell a weak input from a stretched scale.
        let cause = &diagnosis.causes[0];
        assert!(cause.effect == "input_gain" || cause.equivalent.iter().any(|e| e == "input_gain"), "{cause:?}");
        // Sensor noise alone leaves 0.02. A start from a quarter of a window, known to a third of the noise, grows over
        // the rest of it to about as much again.
        let floor = diagnosis.closure.by_state[0].floor.unwrap();
        assert!(floor > 1.2 * noise, "{floor}");
        assert!(diagnosis.closure.closed.unwrap() > 0.85, "{:?}", diagnosis.closure);
    }
}
