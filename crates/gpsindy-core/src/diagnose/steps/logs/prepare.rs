//! Prepare: noise level of every column, outliers, windows and integration steps.

use crate::data::Dataset;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::fit::substeps::choose_substeps;
use crate::diagnose::fit::tolerance::tolerated;
use crate::diagnose::limits::{
    Budget, DENSE_NOISE, DENSE_SPREAD, INTEGRATION, LOWERED, MOST_SAMPLES, OVERSTATED, STRETCHES, TURN, VERY_LONG,
    WRAPPED, WRAPPED_BELOW,
};
use crate::diagnose::notes::Note;
use crate::diagnose::run::Run;
use crate::diagnose::steps::findings::Judged;
use crate::diagnose::steps::logs::affordable::affordable;
use crate::diagnose::steps::logs::check;
use crate::diagnose::steps::logs::noise::{moves, news, noise_levels, remove_outliers, still_levels};
use crate::diagnose::steps::logs::sampled::set_clocks;
use crate::diagnose::steps::logs::windows::{Purpose, choose_windows, halvings, whole_runs};
use crate::error::Result;
use crate::excitation::{choose, excitation, variance};
use crate::model::{Model, System};
use crate::refine::{Experiment, Hold, Log, Window, guess_initial, present};

/// What is known beforehand.
pub(crate) struct Known<'a> {
    /// What controls do between samples, where the user says it.
    pub(crate) hold: Option<Hold>,
    /// State and root mean square by which the model misses the simulator that it replaces.
    pub(crate) model_error: &'a [(String, f64)],
    /// Share of the motion below which a gap is none.
    pub(crate) material: f64,
}

/// Logs that were checked, and the nominal model fitted to those to learn from.
pub(crate) struct Prepared {
    pub(crate) train: Dataset,
    pub(crate) holdout: Dataset,
    pub(crate) nominal: Contestant,
    pub(crate) fitter: Fitter,
    /// Whether controls may be interpolated between the samples: the user does not say, and the samples are the log's own.
    pub(crate) may_interpolate: bool,
    /// What the user should know of the logs.
    pub(crate) notes: Vec<Note>,
}

impl Prepared {
    /// Whether an account has another hold of the controls than the logs were prepared with.
    pub(crate) fn is_other_hold(&self, found: &Judged) -> bool {
        found.nominal.experiment.hold != self.nominal.experiment.hold
    }
}

/// Checks the logs `[train, holdout]`, finds their noise, takes outliers out, chooses windows and steps, and fits the
/// nominal model's starts and tolerated parameters.
///
/// # Errors
/// Logs that nothing can be learnt from, and a model that leaves them at once.
pub(crate) fn prepare(run: &Run<'_>, system: &System, logs: [&Dataset; 2], known: &Known<'_>) -> Result<Prepared> {
    let model = system.model();
    let (train, mut notes) = unwrapped(model, logs[0])?;
    let (holdout, _) = unwrapped(model, logs[1])?;
    notes.extend(check::logs(model, &train, &holdout)?);
    let (train, holdout) = match affordable(run, system, [&train, &holdout])? {
        Some((train, holdout, note)) => {
            notes.push(note);
            (train, holdout)
        }
        None => (train, holdout),
    };
    let (experiment, of_experiment) = experiment(run, system, &train, known.hold)?;
    notes.extend(of_experiment);
    let fitter = Fitter { model_error: error_of(known, model, &experiment) };
    let samples: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    let is_averaged = samples < train.runs().iter().map(|r| r.n_samples()).sum();
    let budget = Budget::Thorough;
    let stage = run.stage("nominal model: fitting", budget.refine().max_iterations)?;
    let watch = |done: usize| stage.reach(done);
    let nominal = fitter.nominal_watched(system.clone(), experiment, tolerated(model), budget, &watch)?;
    check::nominal(&nominal)?;
    // Starts are drawn within the noise as it is known then, and a better one may show that there is less of it.
    let nominal = fitter.redrawn(with_less_noise(fitter, nominal, budget)?, budget)?;
    let nominal = with_less_noise(fitter, nominal, budget)?;
    // Means over several samples are held exactly, but not interpolated: they would act half a step too early.
    let may_interpolate = known.hold.is_none() && !is_averaged;
    Ok(Prepared { train, holdout, nominal, fitter, may_interpolate, notes })
}

/// The nominal model with the noise lowered to what its fit leaves, the fit carried on each time.
fn with_less_noise(fitter: Fitter, mut nominal: Contestant, budget: Budget) -> Result<Contestant> {
    for _ in 0..LOWERED {
        let Some(noise) = quieter(&nominal) else { break };
        let experiment = Experiment { noise, ..nominal.experiment };
        nominal = fitter.carried_on(Contestant { experiment, ..nominal }, budget)?;
    }
    Ok(nominal)
}

/// The noise of the columns where differences of samples overstate it, as they do where the motion is faster than the samples: a fit cannot
/// leave less than noise. `None` where they do nowhere. A column that never moves has that of one reading.
pub(crate) fn quieter(nominal: &Contestant) -> Option<Vec<f64>> {
    let Contestant { experiment, refined, .. } = nominal;
    let columns = experiment.noise.len();
    let mean = |column: usize| {
        let own = refined.residuals.iter().flat_map(|window| window.iter().skip(column).step_by(columns));
        let (sum, count) =
            own.filter(|e| e.is_finite()).fold((0.0, 0_usize), |(sum, count), e| (sum + e * e, count + 1));
        sum / count.max(1) as f64
    };
    let shares: Vec<f64> = (0..columns).map(mean).collect();
    let is_overstated = |c: usize| OVERSTATED.contains(&shares[c]) && moves(&experiment.logs, c);
    let lower = |c: usize| if is_overstated(c) { experiment.noise[c] * shares[c].sqrt() } else { experiment.noise[c] };
    (0..columns).any(is_overstated).then(|| (0..columns).map(lower).collect())
}

/// The experiment of a diagnosis: noise, outliers, hold, windows and steps chosen; and what is left of the logs.
fn experiment(run: &Run<'_>, system: &System, data: &Dataset, hold: Option<Hold>) -> Result<(Experiment, Vec<Note>)> {
    let mut notes = Vec::new();
    let mut experiment = Experiment { tally: run.tally.clone(), ..Experiment::new(system, data, None)? };
    check::columns(system, &experiment)?;
    // What is chosen below depends on what the control does between the samples.
    experiment.hold = hold.unwrap_or_default();
    let n_columns = experiment.columns.len();
    let model = system.model();
    let units: Vec<&str> = experiment.columns.iter().map(|&j| model.states[j].unit.as_str()).collect();
    let scale: Vec<f64> = experiment.columns.iter().map(|&j| experiment.scale[j]).collect();
    let levels = |experiment: &Experiment| {
        let mut noise = noise_levels(&experiment.logs, n_columns);
        still_levels(&mut noise, &experiment.logs, &units, &scale);
        noise
    };
    experiment.noise = levels(&experiment);
    let noise = experiment.noise.clone();
    let removed = remove_outliers(std::sync::Arc::make_mut(&mut experiment.logs).as_mut_slice(), &noise);
    if removed > 0 {
        notes.push(Note::Outliers { count: removed });
        experiment.noise = levels(&experiment);
    }
    if let Some((sparser, stride)) = decimated(&experiment) {
        experiment = sparser;
        notes.push(Note::Decimated { stride });
    }
    experiment.news = news(&experiment.logs, n_columns);
    let own = experiment.logs.clone();
    let own = set_clocks(&mut experiment, &own);
    notes.extend(own.into_iter().map(|state| Note::OwnClock { column: model.states[state].name.clone() }));
    let free = tolerated(system.model());
    let parameters = system.parameter_values();
    let start = guess_initial(system, &experiment);
    let stage = run.stage("length of rollouts", halvings(&experiment))?;
    experiment = choose_substeps(system, experiment, &parameters, &start, INTEGRATION);
    let watch = |done: usize| stage.reach(done);
    let (mut experiment, cut) = choose_windows(system, experiment, (&parameters, &free), Purpose::Search, &watch)?;
    if let Some((thinner, note)) = thinned(&experiment) {
        experiment = thinner;
        notes.push(note);
    }
    notes.extend(cut.map(|length| Note::Restarted { length, steps: system.engine().is_some() }));
    Ok((experiment, notes))
}

/// Mean square of the model's own error over the logged columns, and of a gap that does not matter, in units of their noise.
fn error_of(known: &Known<'_>, model: &Model, experiment: &Experiment) -> f64 {
    let error = |state: usize| known.model_error.iter().find(|(name, _)| *name == model.states[state].name);
    let of = |(c, &state): (usize, &usize)| {
        let own = error(state).map_or(0.0, |(_, rms)| rms.powi(2));
        (own + known.material.powi(2) * variance(&column(experiment, c))) / experiment.noise[c].powi(2)
    };
    let sum: f64 = experiment.columns.iter().enumerate().map(of).sum();
    sum / experiment.columns.len() as f64
}

/// What was measured in a column, log after log, missing values included.
fn column(experiment: &Experiment, c: usize) -> Vec<f64> {
    experiment.logs.iter().flat_map(|log| log.measured[c].iter().copied()).collect()
}

/// The logs with wrapped angles unwrapped: columns of states that stay within a turn and jump by one; and which they are.
fn unwrapped(model: &Model, data: &Dataset) -> Result<(Dataset, Vec<Note>)> {
    use std::f64::consts::{PI, TAU};
    let (mut data, mut notes) = (data.clone(), Vec::new());
    for state in model.states.iter().filter(|s| s.unit.is_empty() || s.unit == "rad") {
        let Ok(column) = data.index_of(&state.name) else { continue };
        let values = || data.runs().iter().flat_map(|r| r.column(column).iter().copied()).filter(|v| v.is_finite());
        let within = values().all(|v| v.abs() < WRAPPED * PI)
            || values().all(|v| (-WRAPPED_BELOW * PI..WRAPPED * TAU).contains(&v));
        let jumps = |r: &crate::data::Run| {
            present(r.column(column)).windows(2).any(|w| ((w[1].1 - w[0].1).abs() - TAU).abs() < TURN * PI)
        };
        if within && data.runs().iter().any(jumps) {
            data.unwrap_angle(&state.name)?;
            notes.push(Note::Unwrapped { column: state.name.clone() });
        }
    }
    Ok((data, notes))
}

/// The most exciting windows, and some of every part, where the logs are longer than a contest needs.
fn thinned(experiment: &Experiment) -> Option<(Experiment, Note)> {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    if total <= MOST_SAMPLES {
        return None;
    }
    let seconds: f64 = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).sum();
    let length = experiment.windows.iter().map(|w| {
        let time = &experiment.logs[w.log].time;
        time[w.last] - time[w.first]
    });
    let length = length.fold(0.0, f64::max).min(seconds * MOST_SAMPLES as f64 / total as f64 / STRETCHES * 2.0);
    let mut experiment = experiment.clone().with_windows_of(length);
    let keep_every = total.div_ceil(MOST_SAMPLES);
    let count = experiment.windows.len();
    let kept = choose(&excitations(&experiment), count.div_ceil(keep_every));
    experiment.windows = kept.iter().map(|&i| experiment.windows[i]).collect();
    let note = Note::Thinned { samples: total, length, windows: kept.len(), of: count };
    Some((experiment, note))
}

/// How much controls and columns move within each window.
fn excitations(experiment: &Experiment) -> Vec<f64> {
    let all = |log: &Log| log.controls.iter().chain(&log.measured).map(|v| variance(v)).collect::<Vec<f64>>();
    let each: Vec<Vec<f64>> = experiment.logs.iter().map(all).collect();
    let count = each.len() as f64;
    let spreads: Vec<f64> = (0..each.first().map_or(0, Vec::len))
        .map(|c| (each.iter().map(|variances| variances[c]).sum::<f64>() / count).sqrt())
        .collect();
    let of = |window: &Window| {
        let log = &experiment.logs[window.log];
        let columns = log.controls.iter().chain(&log.measured);
        excitation(columns.zip(&spreads).map(|(values, &spread)| (&values[window.first..=window.last], spread)))
    };
    experiment.windows.iter().map(of).collect()
}

/// Every k-th sample of logs that are far denser than their motion, with the mean of the controls between; and k.
fn decimated(experiment: &Experiment) -> Option<(Experiment, usize)> {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    let wanted = total.div_ceil(MOST_SAMPLES);
    // Of very long logs whatever stride is dense saves time and memory before windows are chosen.
    let mut strides = std::iter::successors(Some(wanted), |s| (total > VERY_LONG).then_some(s / 2));
    let stride = strides.find(|&s| s < 2 || is_dense(experiment, s)).filter(|s| *s > 1)?;
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
                own: log.own.clone(),
                begun: log.begun.clone(),
                sampled: log.sampled.clone(),
            }
        })
        .collect();
    Some((whole_runs(Experiment { logs: logs.into(), ..experiment.clone() }), stride))
}

/// Whether every column is a straight line over `stride` samples to either side, up to noise or a hundredth of its spread.
///
/// Columns with rows of their own are not: every k-th row might have none of their values.
fn is_dense(experiment: &Experiment, stride: usize) -> bool {
    let is_full =
        |log: &Log| log.measured.iter().all(|c| c.iter().filter(|v| v.is_finite()).count() * 10 > c.len() * 9);
    experiment.logs.iter().all(is_full)
        && (0..experiment.columns.len()).all(|c| {
            let bends = experiment.logs.iter().flat_map(|log| {
                let values = &log.measured[c];
                (stride..values.len().saturating_sub(stride))
                    .map(|i| values[i] - 0.5 * (values[i - stride] + values[i + stride]))
            });
            let finite: Vec<f64> = bends.filter(|b| b.is_finite()).collect();
            let rms = (finite.iter().map(|b| b * b).sum::<f64>() / finite.len().max(1) as f64).sqrt();
            rms < DENSE_NOISE * experiment.noise[c] || rms < DENSE_SPREAD * experiment.scale[experiment.columns[c]]
        })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{drive, fitted};

    use crate::data::{Channel, Run as Log};
    use crate::expression::Expression;
    use crate::model::{Control, State};
    use crate::progress::Silent;
    use faer::Mat;

    #[test]
    fn windows_are_chosen_under_the_hold_that_the_user_states() {
        // x' = u^2 under a control that changes its sign at every sample: interpolated, its square has a mean of a third.
        let model = Model {
            states: vec![State::new("x", Expression::parse("u^2").unwrap())],
            controls: vec![Control::new("u")],
            ..Model::default()
        };
        let wave = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let ripple = |i: usize| 1e-4 * (1.7 * (i * i) as f64).sin();
        let log = Log {
            name: "run".into(),
            time: (0..400).map(|i| 0.05 * f64::from(i)).collect(),
            values: Mat::from_fn(400, 2, |i, c| if c == 0 { i as f64 * 0.05 / 3.0 + ripple(i) } else { wave(i) }),
        };
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], vec![log]).unwrap();
        let windows = |hold| {
            let run = Run::new(&Silent, None);
            let (found, _) = experiment(&run, &System::new(&model).unwrap(), &data, Some(hold)).unwrap();
            assert_eq!(found.hold, hold);
            found.windows.len()
        };
        assert_eq!(windows(Hold::Linear), 1);
        assert!(windows(Hold::Zero) > 1);
    }

    #[test]
    fn noise_that_a_fit_undercuts_is_lowered_to_what_it_leaves() {
        let (model, data) = drive(None, |x| x, 0.02, (3, 120));
        let (_, nominal) = fitted(&model, &data, 0.02);
        assert_eq!(quieter(&nominal), None);
        let (_, overstated) = fitted(&model, &data, 0.1);
        let noise = quieter(&overstated).unwrap()[0];
        assert!((noise / 0.02 - 1.0).abs() < 0.15, "{noise}");
        let (_, without_noise) = fitted(&model, &data, 100.0);
        assert_eq!(quieter(&without_noise), None, "arithmetic is no noise");
    }
}
