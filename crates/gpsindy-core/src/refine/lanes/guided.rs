//! Derivatives of a simulator that steps along paths that the logs guide, and not its own rollouts.
//!
//! A rollout of a model that is wrong leaves the log, and a straight line from there says little about the machine. A filter's path
//! stays: at every sample the readings move the predicted states by their innovations times a gain, and a suspect that moves the
//! prediction is moved back by the same gains.

use super::correction::Correction;
use super::lockstep::{Group, Job, L};
use super::tangent::{Step, Tangent};
use crate::model::System;
use crate::refine::{Experiment, Window};
use nalgebra::{DMatrix, DVector};

/// A path by window and sample: all states.
pub(crate) type Path = Vec<Vec<Vec<f64>>>;

/// The derivatives from every sample of a path to the next one.
pub(crate) struct Guided {
    parameters: Vec<f64>,
    path: Path,
    /// By window, sample and step.
    steps: Vec<Vec<Vec<Step>>>,
}

impl Guided {
    /// Differentiates along `path`; `None` where the simulator fails.
    pub(crate) fn along(system: &System, experiment: &Experiment, parameters: &[f64], path: Path) -> Option<Self> {
        let mut pairs = Experiment { windows: Vec::new(), ..experiment.clone() };
        let mut starts = Vec::new();
        for (window, states) in experiment.windows.iter().zip(&path) {
            for (sample, state) in (window.first..window.last).zip(states) {
                pairs.windows.push(Window { log: window.log, first: sample, last: sample + 1 });
                starts.push(state.clone());
            }
        }
        let mut steps = Tangent::new(system, &pairs, (parameters, &starts))?.steps.into_iter();
        let steps =
            experiment.windows.iter().map(|w| steps.by_ref().take(w.last - w.first).collect()).collect::<Vec<_>>();
        Some(Self { parameters: parameters.to_vec(), path, steps })
    }

    /// The simulator's states at every sample of a window's path.
    pub(crate) fn path(&self, window: usize) -> &[Vec<f64>] {
        &self.path[window]
    }

    /// Where a window's state at `sample` goes until the next one, and the derivative (n x n).
    pub(crate) fn transition(&self, window: usize, sample: usize) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let steps = &self.steps[window][sample];
        let n = steps.first()?.x.len();
        let mut transition = DMatrix::identity(n, n);
        for step in steps {
            transition = DMatrix::from_row_slice(n, n, &step.by_states) * transition;
        }
        Some((DVector::from_column_slice(&steps.last()?.next), transition))
    }

    /// The tangent along the path under filter `gains` (by window and sample, n x c), and the readings that it predicts.
    pub(crate) fn corrected(
        self,
        system: &System,
        experiment: &Experiment,
        gains: Vec<Vec<DMatrix<f64>>>,
    ) -> Option<(Tangent, Vec<Vec<Vec<f64>>>)> {
        let engine = system.engine()?;
        let Self { parameters, path, steps } = self;
        let initial: Vec<Vec<f64>> = path.iter().map(|states| states[0].clone()).collect();
        let mut corrections = Vec::with_capacity(path.len());
        let mut readings = Vec::with_capacity(path.len());
        for (window, gains) in gains.into_iter().enumerate() {
            let job = [Job { window, parameters: parameters.clone(), initial: initial[window].clone() }];
            let mut group = Group::new(system, experiment, &job, 0, 1);
            let (mut predicted, mut shown) = (Vec::new(), Vec::new());
            let mut show = |group: &mut Group<'_>| {
                let mut values = vec![f64::NAN; experiment.columns.len()];
                group.begin(Some(&experiment.columns), &mut |_, _, column, value| values[column] = value);
                shown.push(values);
            };
            for (sample, steps) in steps[window].iter().enumerate() {
                show(&mut group);
                let n = steps.first()?.x.len();
                predicted.push((0..n).map(|j| group.state(j)[0]).collect::<Vec<f64>>());
                (0..n).for_each(|j| group.set_state(j, [path[window][sample][j]; L]));
                for step in steps {
                    let dt = group.next_step(engine.period());
                    group.arguments_at(system, dt, &step.x, &[], &mut Vec::new());
                    group.take(system, engine.period(), dt, &step.next);
                }
            }
            show(&mut group);
            let each = predicted.into_iter().zip(&shown).zip(gains);
            corrections.push(
                each.map(|((predicted, shown), gain)| Correction {
                    predicted,
                    shown: shown.clone(),
                    gain: gain.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()).collect(),
                })
                .collect(),
            );
            readings.push(shown);
        }
        let steps = steps.into_iter().map(|window| window.into_iter().flatten().collect()).collect();
        Some((Tangent::of((&parameters, experiment), initial, steps, Some(corrections)), readings))
    }
}
