//! Noise level of every column, outliers, windows and integration steps, before anything is judged.

use crate::data::Dataset;
use crate::error::Result;
use crate::model::{Model, System};
use crate::refine::{Experiment, Free, Hold, Log, Refine};

/// A spike this many robust standard deviations above its neighbours is taken out.
const OUTLIER: f64 = 8.0;

/// Share of a column's spread beyond which a rollout is no longer near the log: windows are then halved.
const NEAR: f64 = 0.5;

/// Growth of an initial error over a window beyond which the window is halved.
const GROWTH: f64 = 100.0;

/// Residual (noise units, root mean square) beyond which a longer rollout tells nothing that a shorter one does not.
///
/// So far above the noise every effect shows within the time of one motion. Longer rollouts only pile up what the model
/// lacks, until two effects that are needed together look worthless alone: a bias that dry friction does not hold at rest
/// drifts away, and dry friction without the bias creeps.
const LOUD: f64 = 30.0;

/// Fewest samples of a window.
const SHORTEST: usize = 24;

/// Noise standard deviation of each column from differences of its samples, in its unit.
///
/// Differences of order 2 to 5, scaled to unit noise gain; the smallest is least spoilt by the signal.
/// Never below the noise of the sensor's step.
pub(crate) fn noise_levels(logs: &[Log], n_columns: usize) -> Vec<f64> {
    (0..n_columns)
        .map(|column| {
            let by_order = (2..=5).map(|order| difference_noise(logs, column, order));
            let smallest = by_order.filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
            let step = resolution(logs, column) / 12f64.sqrt();
            let size = logs
                .iter()
                .flat_map(|l| l.measured[column].iter())
                .filter(|v| v.is_finite())
                .fold(0.0, |a: f64, v| a.max(v.abs()));
            let measured = if smallest.is_finite() { smallest } else { 0.0 };
            // Without any noise at all the arithmetic of the log's digits remains.
            measured.max(step).max(1e-9 * size).max(f64::MIN_POSITIVE)
        })
        .collect()
}

fn difference_noise(logs: &[Log], column: usize, order: usize) -> f64 {
    let binomial = |k: usize| (0..k).fold(1.0, |b, i| b * (order - i) as f64 / (i + 1) as f64);
    let weights: Vec<f64> = (0..=order).map(|k| if k % 2 == 0 { binomial(k) } else { -binomial(k) }).collect();
    let gain: f64 = weights.iter().map(|w| w * w).sum();
    let mut squares: Vec<f64> = logs
        .iter()
        .flat_map(|l| l.measured[column].windows(order + 1))
        .map(|w| w.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>().powi(2))
        .filter(|s| s.is_finite())
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    squares.sort_by(f64::total_cmp);
    // The largest fiftieth may be outliers and jumps; a normal variable keeps 0.857 of its variance without it.
    let kept = squares.len() - squares.len() / 50;
    let trimmed = squares[..kept].iter().sum::<f64>() / kept as f64;
    let share_kept = if squares.len() >= 50 { 0.857 } else { 1.0 };
    (trimmed / share_kept / gain).sqrt()
}

/// Smallest step between different values, where the column looks quantised; else zero.
pub(crate) fn resolution(logs: &[Log], column: usize) -> f64 {
    let mut values: Vec<f64> =
        logs.iter().flat_map(|l| l.measured[column].iter().copied()).filter(|v| v.is_finite()).collect();
    let total = values.len();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() < 2 || values.len() * 2 > total {
        return 0.0;
    }
    values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min)
}

/// Marks isolated spikes as missing; returns how many.
pub(crate) fn remove_outliers(logs: &mut [Log], noise: &[f64]) -> usize {
    let mut removed = 0;
    for log in logs {
        for (column, &noise) in log.measured.iter_mut().zip(noise) {
            let bend: Vec<f64> = column.windows(3).map(|w| w[1] - 0.5 * (w[0] + w[2])).collect();
            let mut sizes: Vec<f64> = bend.iter().map(|b| b.abs()).filter(|b| b.is_finite()).collect();
            sizes.sort_by(f64::total_cmp);
            let typical = sizes.get(sizes.len() / 2).map_or(0.0, |m| 1.4826 * m).max(1.2 * noise);
            let spikes: Vec<usize> = (1..bend.len().saturating_sub(1))
                .filter(|&i| {
                    // A spike bends its neighbours half as much the other way; a corner does not.
                    let neighbours = -0.5 * bend[i];
                    let like = |b: f64| (b - neighbours).abs() < 0.4 * bend[i].abs();
                    bend[i].abs() > OUTLIER * typical && like(bend[i - 1]) && like(bend[i + 1])
                })
                .collect();
            removed += spikes.len();
            for i in spikes {
                column[i + 1] = f64::NAN;
            }
        }
    }
    removed
}

/// What the windows are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To tell effects apart: no longer than the noise asks for.
    Search,
    /// To predict: as long as the model stays near the logs.
    Rollout,
}

/// Windows short enough that the model stays near the logs and initial errors do not explode.
///
/// Starts from whole runs and halves. Returns the experiment and, where they had to be cut, their length in s.
pub(crate) fn choose_windows(
    system: &System,
    experiment: Experiment,
    parameters: &[f64],
    free: &[Free],
    purpose: Purpose,
) -> Result<(Experiment, Option<f64>)> {
    let longest = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).fold(0.0, f64::max);
    let samples = experiment.logs.iter().map(|l| l.time.len()).max().unwrap_or(1);
    let settings = Refine { max_iterations: 6, tolerance: 1e-3 };
    let mut parts = 1usize;
    loop {
        let length = longest / parts as f64;
        let cut = if parts == 1 { whole_runs(experiment.clone()) } else { experiment.clone().with_windows_of(length) };
        let smallest = samples / (2 * parts) < SHORTEST;
        match settings.fit_with_jacobian(system, &cut, parameters, free, None) {
            Ok((fit, jacobian)) => {
                let loud = purpose == Purpose::Search && is_loud(system, &cut, &fit.residuals);
                let fits = stays_near(&cut, &fit.residuals, &jacobian) && !loud;
                if fits || smallest {
                    return Ok((cut, (parts > 1).then_some(length)));
                }
            }
            Err(error) if smallest => return Err(error),
            Err(_) => {}
        }
        parts *= 2;
    }
}

/// Whether rollouts stay near the logs, and errors of their starts do not explode.
pub(crate) fn stays_near(experiment: &Experiment, residuals: &[Vec<f64>], jacobian: &crate::refine::Jacobian) -> bool {
    near(experiment, residuals) && growth(experiment, jacobian) < GROWTH
}

/// Whether rollouts are so far above the noise that shorter ones would tell effects apart better.
///
/// A free motion has only its start: cut into pieces, each with a start of its own, it no longer shows what it loses.
pub(crate) fn is_loud(system: &System, experiment: &Experiment, residuals: &[Vec<f64>]) -> bool {
    let may_shrink = system.n_controls() > 0 && 0.5 * experiment.longest_window() >= motion_time(experiment);
    may_shrink && !within(experiment, residuals, |c| LOUD * experiment.noise[c])
}

/// The experiment with windows twice as long; none where every run is whole already.
pub(crate) fn doubled(experiment: &Experiment) -> Option<Experiment> {
    let length = 2.0 * experiment.longest_window();
    let longer = experiment.clone().with_windows_of(length);
    (longer.windows.len() < experiment.windows.len()).then_some(longer)
}

pub(crate) fn whole_runs(mut experiment: Experiment) -> Experiment {
    experiment.windows = experiment
        .logs
        .iter()
        .enumerate()
        .map(|(i, l)| crate::refine::Window { log: i, first: 0, last: l.time.len() - 1 })
        .collect();
    experiment
}

fn near(experiment: &Experiment, residuals: &[Vec<f64>]) -> bool {
    within(experiment, residuals, |c| (NEAR * experiment.scale[experiment.columns[c]]).max(3.0 * experiment.noise[c]))
}

/// Time in which the logged motion renews itself, s: where the autocorrelation of a column falls below 1/e, the longest.
fn motion_time(experiment: &Experiment) -> f64 {
    let of = |column: usize, log: &Log| {
        let values: Vec<f64> = log.measured[column].iter().copied().filter(|v| v.is_finite()).collect();
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count.max(1) as f64;
        let stride = (count / 2000).max(1);
        let product = |lag: usize| {
            let pairs = (0..count.saturating_sub(lag)).step_by(stride);
            let (sum, terms) =
                pairs.fold((0.0, 0.0), |(s, n), i| (s + (values[i] - mean) * (values[i + lag] - mean), n + 1.0));
            sum / f64::max(terms, 1.0)
        };
        let least = product(0) / std::f64::consts::E;
        let mut lag = 1;
        while lag < count / 2 && product(lag) > least {
            lag += (lag / 30).max(1);
        }
        lag as f64 * (log.time[log.time.len() - 1] - log.time[0]) / (log.time.len().max(2) - 1) as f64
    };
    let columns = 0..experiment.columns.len();
    columns.flat_map(|c| experiment.logs.iter().map(move |log| of(c, log))).fold(0.0, f64::max)
}

/// Whether the root mean square residual of every column stays within a limit, in the column's unit.
fn within(experiment: &Experiment, residuals: &[Vec<f64>], limit: impl Fn(usize) -> f64) -> bool {
    let n_columns = experiment.columns.len();
    (0..n_columns).all(|c| {
        let values = || residuals.iter().flat_map(|w| w.iter().skip(c).step_by(n_columns)).filter(|e| e.is_finite());
        let count = values().count().max(1) as f64;
        let rms = (values().map(|e| e * e).sum::<f64>() / count).sqrt() * experiment.noise[c];
        rms <= limit(c)
    })
}

/// How much larger an initial error is in the last tenth of a window than the state itself is.
fn growth(experiment: &Experiment, jacobian: &crate::refine::Jacobian) -> f64 {
    let n_columns = experiment.columns.len();
    let mut largest: f64 = 0.0;
    for block in &jacobian.blocks {
        let rows = block.derivative.nrows();
        for j in 0..jacobian.n_states {
            for row in (rows - (rows / 10).max(n_columns.min(rows)))..rows {
                let c = row % n_columns;
                let moved = block.derivative[(row, j)] * experiment.noise[c] * experiment.scale[j];
                largest = largest.max((moved / experiment.scale[experiment.columns[c]]).abs());
            }
        }
    }
    largest
}

/// Doubles the integration steps until the outputs no longer change by `allowed` times the noise.
pub(crate) fn choose_substeps(
    system: &System,
    mut experiment: Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
    allowed: f64,
) -> Experiment {
    const MOST: usize = 32;
    let outputs = |e: &Experiment| crate::diagnose::steps::screen::outputs(system, e, parameters, initial);
    let mut coarse = outputs(&experiment);
    while experiment.substeps < MOST {
        let finer = Experiment { substeps: 2 * experiment.substeps, ..experiment.clone() };
        let fine = outputs(&finer);
        let count = fine.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let change: f64 = coarse.iter().flatten().zip(fine.iter().flatten()).map(|(a, b)| (a - b) * (a - b)).sum();
        if (change / count).sqrt() < allowed {
            return experiment;
        }
        experiment = finer;
        coarse = fine;
    }
    experiment
}

/// The logs with wrapped angles unwrapped: columns of states that stay within a turn and jump by one.
pub(crate) fn unwrapped(model: &Model, data: &Dataset, notes: &mut Vec<String>) -> Result<Dataset> {
    use std::f64::consts::{PI, TAU};
    let mut data = data.clone();
    for state in model.states.iter().filter(|s| s.unit.is_empty() || s.unit == "rad") {
        let Ok(column) = data.index_of(&state.name) else { continue };
        let values = || data.runs().iter().flat_map(|r| r.column(column).iter().copied()).filter(|v| v.is_finite());
        let within = values().all(|v| v.abs() < 1.02 * PI) || values().all(|v| (-0.02 * PI..1.02 * TAU).contains(&v));
        let jumps =
            |r: &crate::data::Run| r.column(column).windows(2).any(|w| ((w[1] - w[0]).abs() - TAU).abs() < 0.2 * PI);
        if within && data.runs().iter().any(jumps) {
            data.unwrap_angle(&state.name)?;
            notes.push(format!("column `{}` jumps by full turns: it was unwrapped", state.name));
        }
    }
    Ok(data)
}

/// The experiment of a diagnosis: noise, outliers, hold, windows and steps chosen; says what it did in `notes`.
pub(crate) fn experiment(
    system: &System,
    data: &Dataset,
    hold: Option<Hold>,
    notes: &mut Vec<String>,
) -> Result<Experiment> {
    let mut experiment = Experiment::new(system, data, None)?;
    check_columns(system, &experiment)?;
    let n_columns = experiment.columns.len();
    experiment.noise = noise_levels(&experiment.logs, n_columns);
    let noise = experiment.noise.clone();
    let removed = remove_outliers(std::sync::Arc::make_mut(&mut experiment.logs).as_mut_slice(), &noise);
    if removed > 0 {
        notes.push(format!("{removed} isolated spike(s) in the logs were left out as outliers"));
        experiment.noise = noise_levels(&experiment.logs, n_columns);
    }
    experiment = decimate(experiment, notes);
    let free = crate::diagnose::fit::tolerance::tolerated(system.model());
    let parameters = system.parameter_values();
    let start = crate::refine::guess_initial(system, &experiment);
    experiment = choose_substeps(system, experiment, &parameters, &start, ROUNDING);
    let (experiment, cut) = choose_windows(system, experiment, &parameters, &free, Purpose::Search)?;
    let mut experiment = thin(experiment, notes);
    experiment.hold = hold.unwrap_or_default();
    if let Some(length) = cut {
        notes.push(format!(
            "rollouts are restarted every {length:.3} s in the fits: on longer ones the nominal model leaves the logs, or its errors only pile up"
        ));
    }
    Ok(experiment)
}

/// Share of the noise, or of the residual, that the integration may add.
pub(crate) const ROUNDING: f64 = 0.1;

/// Most samples that a contest looks at; more would not change its answer, only its time.
const MOST_SAMPLES: usize = 12_000;

/// Keeps evenly spread windows where the logs are longer than a contest needs.
fn thin(experiment: Experiment, notes: &mut Vec<String>) -> Experiment {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    if total <= MOST_SAMPLES {
        return experiment;
    }
    let seconds: f64 = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).sum();
    // At least forty stretches, so that every part of the logs is seen.
    let length = experiment.windows.iter().map(|w| {
        let time = &experiment.logs[w.log].time;
        time[w.last] - time[w.first]
    });
    let length = length.fold(0.0, f64::max).min(seconds * MOST_SAMPLES as f64 / total as f64 / 40.0 * 2.0);
    let mut experiment = experiment.with_windows_of(length);
    let keep_every = total.div_ceil(MOST_SAMPLES);
    experiment.windows = experiment.windows.into_iter().step_by(keep_every).collect();
    notes.push(format!("the logs hold {total} samples; the search looked at stretches of {length:.3} s spread over one in {keep_every} of them"));
    experiment
}

/// Takes every k-th sample of logs that are far denser than their motion, with the mean of the controls between.
fn decimate(experiment: Experiment, notes: &mut Vec<String>) -> Experiment {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    let stride = total.div_ceil(MOST_SAMPLES);
    if stride < 2 || !is_dense(&experiment, stride) {
        return experiment;
    }
    let logs: Vec<Log> = experiment
        .logs
        .iter()
        .map(|log| {
            let mean =
                |values: &Vec<f64>| values.chunks(stride).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
            Log {
                name: log.name.clone(),
                time: log.time.iter().copied().step_by(stride).collect(),
                controls: log.controls.iter().map(mean).collect(),
                measured: log.measured.iter().map(|c| c.iter().copied().step_by(stride).collect()).collect(),
            }
        })
        .collect();
    notes.push(format!("the logs are far denser than their motion: the search used one sample in {stride}"));
    whole_runs(Experiment { logs: logs.into(), ..experiment })
}

/// Whether every column is a straight line over `stride` samples to either side, up to noise or a hundredth of its spread.
fn is_dense(experiment: &Experiment, stride: usize) -> bool {
    (0..experiment.columns.len()).all(|c| {
        let bends = experiment.logs.iter().flat_map(|log| {
            let values = &log.measured[c];
            (stride..values.len().saturating_sub(stride))
                .map(|i| values[i] - 0.5 * (values[i - stride] + values[i + stride]))
        });
        let finite: Vec<f64> = bends.filter(|b| b.is_finite()).collect();
        let rms = (finite.iter().map(|b| b * b).sum::<f64>() / finite.len().max(1) as f64).sqrt();
        // Noise alone bends by sqrt(1 + 2/4) of itself.
        rms < 2.5 * experiment.noise[c] || rms < 0.01 * experiment.scale[experiment.columns[c]]
    })
}

/// Every state must be logged, be the rate of one that is, or have a start that its equation or `initial` gives.
fn check_columns(system: &System, experiment: &Experiment) -> Result<()> {
    use crate::error::Error;
    let model = system.model();
    for (j, state) in model.states.iter().enumerate() {
        let is_rate = model.integral_of(j).is_some_and(|i| experiment.column_of(i).is_some());
        let own = |name: &String| *name == state.name || model.state_index(name).is_none();
        let follows_input = state.equation.variables().iter().all(own);
        let known_start = model.initial.contains_key(&state.name);
        if experiment.column_of(j).is_none() && !is_rate && !follows_input && !known_start {
            return Err(Error::invalid(format!(
                "the logs have no column for state `{}`, and no logged state has it as its rate; log it, rename a column, or give it an [initial] value",
                state.name
            )));
        }
    }
    let needed = 8;
    for log in experiment.logs.iter() {
        if log.time.len() < needed {
            return Err(Error::TooFewSamples { what: format!("run `{}`", log.name), needed, found: log.time.len() });
        }
    }
    Ok(())
}
