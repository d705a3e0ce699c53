//! Rollouts in which a controller closes the loop.

use super::{Excitation, Rollout, Simulate, latest};
use crate::data::Hold;
use crate::error::{Error, Result};
use crate::model::System;
use faer::Mat;

/// What closes a loop: from the time (s) and what the sensors read (n) to the controls (m), held until the next time.
pub type Controller<'a> = dyn FnMut(f64, &[f64], &mut [f64]) -> Result<()> + 'a;

impl Simulate {
    /// Simulates `system` from `initial` (n) over `time` (s, rising, r of them), controlled by `controller` at each of the
    /// times; gives the rollout and the controls (r x m).
    ///
    /// Delays see what the controller said before, and its first controls before the first time. Controls are held,
    /// whatever [`Simulate::hold`] says: a controller cannot know the next ones.
    ///
    /// # Errors
    /// As [`Simulate::rollout_range`], and the controller's own errors.
    pub fn closed_loop(
        &self,
        system: &System,
        time: &[f64],
        initial: &[f64],
        controller: &mut Controller<'_>,
    ) -> Result<(Rollout, Mat<f64>)> {
        let (n, m, r) = (system.n_states(), system.n_controls(), time.len());
        if r < 2 || time.windows(2).any(|w| !(w[1] > w[0])) {
            return Err(Error::settings("a closed loop needs two times or more, in s and rising"));
        }
        let mut states = Mat::zeros(r, n);
        let mut outputs = Mat::zeros(r, n);
        let mut controls: Mat<f64> = Mat::zeros(r, m);
        let (mut reading, mut command) = (vec![0.0; n], vec![0.0; m]);
        let (mut n_steps, mut n_coarse, mut stiff_from) = (0, 0, None);
        initial.iter().take(n).enumerate().for_each(|(j, &value)| states[(0, j)] = value);
        let quiet = Excitation::new(system, &time[..1], Mat::<f64>::zeros(1, m).as_ref(), Hold::Zero)?;
        let first = self.rollout_range(system, &quiet, initial, 0..1)?;
        // How far back what happens next depends on states and on controls, s.
        let late = latest(system, (time[0], time[r - 1]));
        let memory = quiet.memory();
        (0..n).for_each(|j| reading[j] = first.outputs[(0, j)]);
        (0..n).for_each(|j| outputs[(0, j)] = reading[j]);
        for k in 0..r {
            controller(time[k], &reading, &mut command)?;
            if let Some(j) = command.iter().position(|u| !u.is_finite()) {
                let what =
                    format!("what the controller says for `{}` at {} s", system.model().controls[j].name, time[k]);
                return Err(Error::NotFinite { what });
            }
            command.iter().enumerate().for_each(|(j, &u)| controls[(k, j)] = u);
            if k + 1 == r {
                break;
            }
            // The present command reaches to the next time; what is late begins further back.
            let begin = time.partition_point(|t| *t < time[k] - late).saturating_sub(1).min(k);
            let past = time.partition_point(|t| *t < time[begin] - memory).saturating_sub(1).min(begin);
            let known = Mat::from_fn(k + 2 - past, m, |i, j| controls[((past + i).min(k), j)]);
            let excitation = Excitation::new(system, &time[past..k + 2], known.as_ref(), Hold::Zero)?;
            let start: Vec<f64> = (0..n).map(|j| states[(begin, j)]).collect();
            let part = self.rollout_range(system, &excitation, &start, begin - past..k + 2 - past)?;
            let last = part.time.len() - 1;
            for j in 0..n {
                states[(k + 1, j)] = part.states[(last, j)];
                reading[j] = part.outputs[(last, j)];
                outputs[(k + 1, j)] = reading[j];
            }
            n_steps += part.n_steps;
            n_coarse += part.n_coarse;
            stiff_from = stiff_from.or(part.stiff_from);
        }
        Ok((Rollout { time: time.into(), states, outputs, n_steps, n_coarse, stiff_from }, controls))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};

    fn cart(command: &str) -> System {
        let state = |name: &str, equation: String| State::new(name, Expression::parse(&equation).unwrap());
        let model = Model {
            states: vec![state("x", "v".into()), state("v", format!("{command} - 0.4*v"))],
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("tau", 0.15), Parameter::new("width", 0.3)],
            ..Model::default()
        };
        model.compile().unwrap()
    }

    /// The loop step by step is the whole rollout under the controls that the loop gave.
    #[test]
    fn a_loop_is_the_open_rollout_under_its_own_controls() {
        let time: Vec<f64> = (0..120).map(|i| 0.05 * f64::from(i)).collect();
        for command in ["u", "delay(u, tau)", "play(u, width)"] {
            let system = cart(command);
            let simulate = Simulate::default();
            let mut controller = |t: f64, y: &[f64], u: &mut [f64]| {
                u[0] = 3.0 * (f64::from(t > 1.0) - y[0]) - 1.5 * y[1];
                Ok(())
            };
            let (closed, controls) = simulate.closed_loop(&system, &time, &[0.2, 0.0], &mut controller).unwrap();
            let excitation = Excitation::new(&system, &time, controls.as_ref(), Hold::Zero).unwrap();
            let open = simulate.rollout(&system, &excitation, &[0.2, 0.0]).unwrap();
            for i in 0..time.len() {
                // The two choose their steps differently, each within the tolerance.
                assert!((open.states[(i, 0)] - closed.states[(i, 0)]).abs() < 1e-6, "{command} at {i}");
            }
        }
    }

    #[test]
    fn what_is_no_number_is_told_by_name() {
        let mut controller = |_: f64, _: &[f64], u: &mut [f64]| {
            u[0] = f64::NAN;
            Ok(())
        };
        let stated = Simulate::default().closed_loop(&cart("u"), &[0.0, 0.1], &[0.0, 0.0], &mut controller);
        assert!(stated.unwrap_err().to_string().contains("`u` at 0 s"));
    }
}
