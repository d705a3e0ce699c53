//! Curves of the report page: held-out rollouts with the logs, their residuals, and the logs themselves.

use crate::data::Dataset;
use crate::diagnose::limits::curves::{BAND_99, DRAWN_RUNS, LAGS};
use crate::diagnose::report::{ResidualCheck, RolloutFigure, SignalFigure, finite, thinned};
use crate::model::{Model, System};
use crate::refine::{Experiment, Window};

/// Rollouts of the nominal and of the corrected model with every held-out log, column by column.
pub(crate) fn rollouts(
    system: &System,
    experiment: &Experiment,
    moving: &[usize],
    before: &[Vec<f64>],
    after: Option<&Vec<Vec<f64>>>,
) -> Vec<RolloutFigure> {
    let n_columns = experiment.columns.len();
    let mut all = Vec::new();
    for (index, log) in experiment.logs.iter().enumerate() {
        let kept = thinned(log.time.len());
        let windows: Vec<(usize, &Window)> =
            experiment.windows.iter().enumerate().filter(|(_, w)| w.log == index).collect();
        let line = |values: &[Vec<f64>], c: usize| -> Vec<Option<f64>> {
            let mut line = vec![None; log.time.len()];
            for (w, window) in &windows {
                for i in window.first..=window.last {
                    line[i] = finite(values[*w][(i - window.first) * n_columns + c]);
                }
            }
            line
        };
        for &c in moving {
            let state = &system.model().states[experiment.columns[c]];
            let measured = &log.measured[c];
            let before = line(before, c);
            let after = after.map(|after| line(after, c));
            let thin = |line: &[Option<f64>]| kept.iter().map(|&i| line[i]).collect();
            all.push(RolloutFigure {
                run: log.name.clone(),
                column: state.name.clone(),
                unit: state.unit.clone(),
                time: kept.iter().map(|&i| log.time[i]).collect(),
                measured: kept.iter().map(|&i| finite(measured[i])).collect(),
                before: thin(&before),
                after: after.as_deref().map_or(Vec::new(), thin),
                fit_before: followed(measured, &before),
                fit_after: after.as_deref().and_then(|after| followed(measured, after)),
            });
        }
    }
    all
}

/// Share of a column's motion that a rollout follows.
fn followed(measured: &[f64], rollout: &[Option<f64>]) -> Option<f64> {
    let there: Vec<f64> = measured.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = there.iter().sum::<f64>() / there.len().max(1) as f64;
    let moved: f64 = there.iter().map(|v| (v - mean).powi(2)).sum();
    let pairs = measured.iter().zip(rollout).filter(|(v, _)| v.is_finite());
    let missed = pairs.map(|(v, r)| r.map_or(f64::INFINITY, |r| (v - r).powi(2))).sum::<f64>();
    finite(1.0 - (missed / moved).sqrt())
}

/// How what a model leaves of each column repeats itself, over all held-out rollouts.
pub(crate) fn checks(
    system: &System,
    experiment: &Experiment,
    moving: &[usize],
    values: &[Vec<f64>],
) -> Vec<ResidualCheck> {
    let n_columns = experiment.columns.len();
    let one = |&c: &usize| {
        let series: Vec<Vec<f64>> = experiment
            .windows
            .iter()
            .zip(values)
            .map(|(window, values)| {
                let measured = &experiment.logs[window.log].measured[c][window.first..=window.last];
                let rest = measured.iter().enumerate().map(|(i, v)| v - values[i * n_columns + c]);
                // Its own samples, one behind the other, whatever rows other topics have between them.
                rest.filter(|v| v.is_finite()).collect()
            })
            .collect();
        let product = |lag: usize| {
            let pairs = series.iter().flat_map(|s| s.iter().zip(s.iter().skip(lag)));
            pairs.map(|(a, b)| a * b).filter(|p| p.is_finite()).sum::<f64>()
        };
        let size = product(0);
        let count = series.iter().flatten().filter(|v| v.is_finite()).count();
        let most = series.iter().map(Vec::len).max().unwrap_or(0) / 4;
        ResidualCheck {
            column: system.model().states[experiment.columns[c]].name.clone(),
            autocorrelation: (1..=LAGS.min(most)).filter_map(|lag| finite(product(lag) / size)).collect(),
            band: BAND_99 / (count.max(1) as f64).sqrt(),
        }
    };
    moving.iter().map(one).collect()
}

/// The columns of the first runs as they were logged.
pub(crate) fn signals(model: &Model, train: &Dataset, holdout: &Dataset) -> Vec<SignalFigure> {
    let states = model.states.iter().map(|s| (&s.name, &s.unit, false));
    let names: Vec<_> = model.controls.iter().map(|c| (&c.name, &c.unit, true)).chain(states).collect();
    let mut all = Vec::new();
    for (data, held_out) in [(train, false), (holdout, true)] {
        for run in data.runs().iter().take(DRAWN_RUNS) {
            let kept = thinned(run.n_samples());
            for &(name, unit, is_control) in &names {
                let Ok(column) = data.index_of(name) else { continue };
                let values = run.column(column);
                all.push(SignalFigure {
                    run: run.name.clone(),
                    held_out,
                    column: name.clone(),
                    unit: unit.clone(),
                    is_control,
                    time: kept.iter().map(|&i| run.time[i]).collect(),
                    values: kept.iter().map(|&i| finite(values[i])).collect(),
                });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rollout_follows_all_of_a_motion_none_of_it_or_less() {
        let measured = [1.0, -1.0, 1.0, -1.0, f64::NAN];
        let of = |values: [f64; 5]| followed(&measured, &values.map(finite));
        assert_eq!(of([1.0, -1.0, 1.0, -1.0, 0.0]), Some(1.0));
        assert_eq!(of([0.0; 5]), Some(0.0));
        assert_eq!(of([-1.0, 1.0, -1.0, 1.0, 0.0]), Some(-1.0));
        assert_eq!(of([1.0, f64::NAN, 1.0, -1.0, 0.0]), None);
        assert_eq!(followed(&[2.0, 2.0], &[Some(2.0), Some(2.1)]), None);
    }
}
