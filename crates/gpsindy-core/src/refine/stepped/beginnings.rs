//! Starts of a simulator that steps, found along ever longer beginnings of their windows.
//!
//! Servos saturate, friction sticks and contacts close, so that a start within the noise of its reading may still be several
//! of those events away from the true one, and a fit over the whole window stops at the first of them. Over three samples
//! there is nothing to stop at; each beginning that is a little longer starts where the last one ended.

use crate::error::{Error, Result};
use crate::model::System;
use crate::refine::{Experiment, Refine, Window, guess_initial};

/// Samples of the first beginning: three determine a place, a rate and what drives it.
const FIRST: usize = 3;

/// By how much each beginning is longer than the last. A six-joint arm with saturating servos, windows of 24 and of 96 samples:
/// 1.4 left none of 62 windows above 1.4 times the noise's variance, 2 left 6, and the whole window at once 27.
const LONGER: f64 = 1.4;

/// Samples beyond which no beginning is followed: what comes later depends on the machine, and little on the start.
const LONGEST: usize = 128;

/// Steps on each: the next one goes on, so that a thousandth of the cost is not worth another.
const STEPS: Refine = Refine { max_iterations: 5, tolerance: 1e-3 };

/// Initial states of all windows at these parameters (all of the system's): what the first samples determine, and where the system
/// steps on its own also what its rollouts do.
///
/// # Errors
/// A computation that was asked to stop.
pub(crate) fn guess_starts(system: &System, experiment: &Experiment, parameters: &[f64]) -> Result<Vec<Vec<f64>>> {
    let mut starts = guess_initial(system, experiment);
    if system.engine().is_none() {
        return Ok(starts);
    }
    for (window, start) in experiment.windows.iter().zip(&mut starts) {
        for (c, &state) in experiment.columns.iter().enumerate() {
            let first = experiment.logs[window.log].measured[c][window.first];
            if first.is_finite() {
                start[state] = first;
            }
        }
    }
    let longest = experiment.windows.iter().map(|w| w.last - w.first + 1).max().unwrap_or(0);
    let mut count = FIRST;
    while count < longest.min(LONGEST) {
        let beginning = |w: &Window| Window { last: w.last.min(w.first + count - 1), ..*w };
        let cut = Experiment { windows: experiment.windows.iter().map(beginning).collect(), ..experiment.clone() };
        match STEPS.fit(system, &cut, parameters, &[], Some(&starts)) {
            Ok(fit) => starts = fit.initial,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // Longer ones would leave all bounds, too.
            Err(_) => break,
        }
        count = (LONGER * count as f64).ceil() as usize;
    }
    Ok(starts)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Control, Dynamics, Model, Rows, State, Steps};
    use faer::Mat;
    use std::sync::Arc;

    /// A joint with dry friction under a stiff servo, which saturates 3 mrad from where it should be.
    struct Servo;

    impl Steps for Servo {
        fn period(&self) -> f64 {
            0.005
        }

        fn n_forces(&self) -> usize {
            0
        }

        fn n_parameters(&self) -> usize {
            0
        }

        fn step(&self, rows: &Rows<'_>, dt: f64, next: &mut [f64]) -> Result<()> {
            for ((x, u), next) in rows.states.chunks(2).zip(rows.commands).zip(next.chunks_mut(2)) {
                let force = (1000.0 * (u - x[0]) - 3.0 * x[1]).clamp(-3.0, 3.0);
                let pushed = x[1] + dt * force / 0.03;
                next[1] = pushed.signum() * (pushed.abs() - dt * 0.05 / 0.03).max(0.0);
                next[0] = x[0] + dt * next[1];
            }
            Ok(())
        }
    }

    impl Dynamics for Servo {
        fn n_states(&self) -> usize {
            2
        }

        fn n_controls(&self) -> usize {
            1
        }

        fn derivative(&self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) -> Result<()> {
            Err(Error::settings("it steps"))
        }

        fn steps(&self) -> Option<&dyn Steps> {
            Some(self)
        }
    }

    #[test]
    fn a_start_is_found_over_many_saturations() {
        let noise = [1e-3, 1e-2];
        let mut model = Model {
            states: ["q", "v"].map(|name| State::new(name, Expression::Pi)).into(),
            controls: vec![Control::new("u")],
            ..Model::default()
        };
        model.call_simulator(&[(0, 1)]);
        let system = System::with_simulator(&model, Some(Arc::new(Servo))).unwrap();
        let (count, per) = (960, 2);
        // Numbers in -1 to 1 without a pattern.
        let drawn = |i: usize| (((i as f64 + 1.0) * 12.9898).sin() * 43758.5453).fract();
        let mut values = Mat::zeros(count, 3);
        let mut x = vec![0.0, 0.0];
        for i in 0..count {
            let u = drawn(9000 + i / 40);
            for (j, noise) in noise.iter().enumerate() {
                values[(i, j)] = x[j] + 3f64.sqrt() * noise * drawn(2 * i + j);
            }
            values[(i, 2)] = u;
            for _ in 0..per {
                let rows = Rows { count: 1, states: &x.clone(), commands: &[u], forces: &[], parameters: &[] };
                Servo.step(&rows, 0.005, &mut x).unwrap();
            }
        }
        let run = Run { name: "steps".into(), time: (0..count).map(|i| 0.01 * i as f64).collect(), values };
        let data = Dataset::new(["q", "v", "u"].map(Channel::new).into(), vec![run]).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&noise)).unwrap().with_windows_of(0.95);
        let per_value = |starts: &[Vec<f64>]| {
            let fit = Refine::default().fit(&system, &experiment, &[], &[], Some(starts)).unwrap();
            fit.cost / (2 * count) as f64
        };
        let followed = per_value(&guess_starts(&system, &experiment, &[]).unwrap());
        let at_once = per_value(&guess_initial(&system, &experiment));
        assert!(followed < 1.4, "{followed}");
        assert!(at_once > 2.0 * followed, "{at_once}, {followed}");
    }
}
