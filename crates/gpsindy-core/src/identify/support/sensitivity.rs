//! Sensitivities of trajectories to the coefficient of every candidate term, included or not, from one trajectory of the model.
//!
//! Along a trajectory of `x' = f(x, u)` the sensitivity S of the states to the coefficient of term theta_j in equation s obeys
//! `S' = (df/dx) S + e_s theta_j`, and is 0 at the start of a window. Over a step of length h, with the transition matrices
//! A of its first and B of its second half from perturbed rollouts, Simpson's rule gives
//! `S(t + h) = B (A (S(t) + h/6 theta(t)) + 4h/6 theta(t + h/2)) + h/6 theta(t + h)`: of the integrator's order.
//!
//! Source: Hairer, Norsett and Wanner 1993, Solving Ordinary Differential Equations I, section I.14.

use crate::error::Result;
use crate::identify::algorithm1::rows::{MIDDLE, WEIGHTS};
use crate::identify::algorithm1::track::Track;
use crate::identify::equations::Equations;
use crate::identify::limits::MOVED;
use crate::library::Library;
use crate::model::System;
use crate::refine::lanes::Lanes;
use crate::refine::{Experiment, Hold, Log, Point, Window};
use faer::Mat;
use nalgebra::DMatrix;

/// Lanes of a rollout, as many as a [`Lanes`] has: the trajectory itself and states moved a little. Exact.
const LANES: usize = 8;

/// What the sensitivities are taken along.
pub(crate) struct Course<'a> {
    pub(crate) equations: &'a Equations,
    /// The system of the terms in use.
    pub(crate) system: &'a System,
    pub(crate) experiment: &'a Experiment,
    /// One a log.
    pub(crate) tracks: &'a [Track],
}

/// A log with further points in time: the ends and middles of all integration steps.
struct Fine {
    log: Log,
    /// Points between two samples.
    per_sample: usize,
}

/// Sensitivities of the states to all candidates (n x candidates).
type Sensitivities = Vec<Vec<f64>>;

impl Course<'_> {
    /// Derivatives of model/noise by the coefficient of every candidate, all equations' terms that are allowed one after the
    /// other: one matrix a window, (samples x columns) x candidates, missing values included.
    pub(crate) fn sensitivities(&self, point: &Point) -> Result<Vec<DMatrix<f64>>> {
        let parameters: Vec<[f64; LANES]> = point.parameters.iter().map(|&value| [value; LANES]).collect();
        let mut all = vec![DMatrix::zeros(0, 0); self.experiment.windows.len()];
        for (number, log) in self.experiment.logs.iter().enumerate() {
            let fine = self.fine(log);
            let mut lanes =
                Lanes::<LANES>::new(self.system, &fine.log, (self.experiment.hold, self.experiment.past), &parameters);
            for (w, window) in self.experiment.windows.iter().enumerate().filter(|(_, w)| w.log == number) {
                all[w] = self.of_window(window, &point.initial[w], &fine, &mut lanes)?;
            }
        }
        Ok(all)
    }

    fn fine(&self, log: &Log) -> Fine {
        let per_sample = 2 * self.experiment.substeps;
        let last = log.time.len() - 1;
        let place = |k: usize| (k / per_sample, (k % per_sample) as f64 / per_sample as f64);
        let between = |values: &[f64], k: usize| match place(k) {
            (i, part) if part > 0.0 => values[i] + part * (values[i + 1] - values[i]),
            (i, _) => values[i],
        };
        let count = last * per_sample + 1;
        let control = |values: &Vec<f64>| match self.experiment.hold {
            Hold::Zero => (0..count).map(|k| values[place(k).0]).collect(),
            Hold::Linear => (0..count).map(|k| between(values, k)).collect(),
        };
        Fine {
            log: Log {
                name: log.name.clone(),
                time: (0..count).map(|k| between(&log.time, k)).collect(),
                controls: log.controls.iter().map(control).collect(),
                measured: Vec::new(),
                ..Log::default()
            },
            per_sample,
        }
    }

    fn of_window(
        &self,
        window: &Window,
        initial: &[f64],
        fine: &Fine,
        lanes: &mut Lanes<'_, LANES>,
    ) -> Result<DMatrix<f64>> {
        let (n, columns) = (self.equations.n_states(), &self.experiment.columns);
        let candidates = self.candidates();
        let first = window.first * fine.per_sample;
        let steps = (window.last - window.first) * fine.per_sample / 2;
        let mut rows = DMatrix::zeros((window.last - window.first + 1) * columns.len(), candidates.len());
        let mut states = initial.to_vec();
        let (mut path, mut transitions) = (vec![states.clone()], Vec::with_capacity(2 * steps));
        for k in 0..2 * steps {
            let (next, transition) = self.transition(lanes, first + k, &states);
            states = next;
            path.push(states.clone());
            transitions.push(transition);
        }
        let theta = self.terms(&self.tracks[window.log], &fine.log.time[first..=first + 2 * steps], &path)?;
        let mut now: Sensitivities = vec![vec![0.0; candidates.len()]; n];
        let mut next = now.clone();
        for sample in window.first..=window.last {
            let done = (sample - window.first) * fine.per_sample / 2;
            // At the last sample the terms are those of the end of the step before.
            let terms = if done < steps { 3 * done } else { 3 * done.max(1) - if steps > 0 { 1 } else { 3 } };
            for (c, &column) in columns.iter().enumerate() {
                let row = (sample - window.first) * columns.len() + c;
                let noise = self.experiment.noise[c];
                if column < n {
                    // At the end of its range a sensor shows no change.
                    let (low, high) = self.equations.ranges[column];
                    if !(low..=high).contains(&path[2 * done][column]) {
                        continue;
                    }
                    now[column].iter().enumerate().for_each(|(k, value)| rows[(row, k)] = kept(value / noise));
                    continue;
                }
                let here = first + (sample - window.first) * fine.per_sample;
                let (state, slopes) = self.rate_slopes(lanes, here, &path[2 * done], column);
                for (k, &(s, j)) in candidates.iter().enumerate() {
                    let through: f64 = slopes.iter().zip(&now).map(|(slope, own)| slope * own[k]).sum();
                    let direct = if s == state { theta[(terms, j)] } else { 0.0 };
                    rows[(row, k)] = kept((through + direct) / noise);
                }
            }
            if sample == window.last {
                break;
            }
            for step in done..done + fine.per_sample / 2 {
                let h = fine.log.time[first + 2 * step + 2] - fine.log.time[first + 2 * step];
                let push = |to: &mut Sensitivities, place: usize, weight: f64| {
                    for (k, &(s, j)) in candidates.iter().enumerate() {
                        to[s][k] += weight * kept(theta[(3 * step + place, j)]);
                    }
                };
                push(&mut now, 0, h / WEIGHTS);
                carry(&transitions[2 * step], &now, &mut next);
                push(&mut next, 1, MIDDLE * h / WEIGHTS);
                carry(&transitions[2 * step + 1], &next, &mut now);
                push(&mut now, 2, h / WEIGHTS);
            }
        }
        Ok(rows)
    }

    /// State and term of every candidate.
    fn candidates(&self) -> Vec<(usize, usize)> {
        let of = |(s, terms): (usize, &Vec<usize>)| terms.iter().map(move |&j| (s, j)).collect::<Vec<_>>();
        self.equations.allowed.iter().enumerate().flat_map(of).collect()
    }

    /// The states one fine step on, and their derivatives by the states before (n x n, by rows).
    fn transition(&self, lanes: &mut Lanes<'_, LANES>, at: usize, states: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let n = self.equations.n_states();
        let mut next = states.to_vec();
        let mut slopes = vec![vec![0.0; n]; n];
        for moved in chunks(n) {
            let initial = self.moved(states, &moved);
            lanes.roll_states((at, at + 1), &initial, 1, |sample, state, values| {
                if sample == at || state >= n {
                    return;
                }
                next[state] = values[0];
                for (lane, &j) in moved.iter().enumerate() {
                    slopes[state][j] = (values[lane + 1] - values[0]) / (MOVED * self.experiment.scale[j]);
                }
            });
        }
        (next, slopes)
    }

    /// The state whose rate column `column` carries, and the derivatives of that rate by the states.
    fn rate_slopes(&self, lanes: &mut Lanes<'_, LANES>, at: usize, states: &[f64], column: usize) -> (usize, Vec<f64>) {
        let n = self.equations.n_states();
        let given = (0..n).filter(|&s| self.equations.derivative_given[s]);
        let state = given.into_iter().nth(column - n).unwrap_or(0);
        let mut slopes = vec![0.0; n];
        for moved in chunks(n) {
            let initial = self.moved(states, &moved);
            lanes.roll((at, at), &initial, &[column], 1, |_, _, values| {
                for (lane, &j) in moved.iter().enumerate() {
                    slopes[j] = (values[lane + 1] - values[0]) / (MOVED * self.experiment.scale[j]);
                }
            });
        }
        (state, slopes)
    }

    /// `states` in every lane, those of `moved` a little off in a lane each behind the first.
    fn moved(&self, states: &[f64], moved: &[usize]) -> Vec<[f64; LANES]> {
        let mut initial: Vec<[f64; LANES]> = states.iter().map(|&value| [value; LANES]).collect();
        for (lane, &j) in moved.iter().enumerate() {
            initial[j][lane + 1] += MOVED * self.experiment.scale[j];
        }
        initial
    }

    /// All terms at the start, middle and end of every step: three rows a step; one row where there is no step.
    fn terms(&self, track: &Track, time: &[f64], path: &[Vec<f64>]) -> Result<Mat<f64>> {
        let library: &Library = &self.equations.library;
        let (n, m) = (self.equations.n_states(), self.equations.controls.len());
        let steps = (time.len() - 1) / 2;
        let mut values = Mat::zeros((3 * steps).max(1), n + m);
        let mut times = vec![time[0]; values.nrows()];
        for row in 0..values.nrows() {
            let step = row / 3;
            let at = 2 * step + row % 3;
            times[row] = time[at];
            (0..n).for_each(|j| values[(row, j)] = path[at][j]);
            let span = (time[2 * step], time[(2 * step + 2).min(time.len() - 1)]);
            for k in 0..m {
                let delay = self.equations.delays[k].value;
                values[(row, n + k)] = track.control(k, delay, self.experiment.hold, span, time[at]);
            }
        }
        library.values(values.as_ref(), &times)
    }
}

/// What is not finite carries no information.
fn kept(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// Numbers of the states that are moved in the same rollout.
fn chunks(n: usize) -> impl Iterator<Item = Vec<usize>> {
    (0..n).step_by(LANES - 1).map(move |first| (first..(first + LANES - 1).min(n)).collect())
}

/// `to = transition * from`.
fn carry(transition: &[Vec<f64>], from: &Sensitivities, to: &mut Sensitivities) {
    for (slopes, row) in transition.iter().zip(to.iter_mut()) {
        row.fill(0.0);
        for (&slope, own) in slopes.iter().zip(from).filter(|(slope, _)| **slope != 0.0) {
            row.iter_mut().zip(own).for_each(|(value, before)| *value += slope * before);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::identify::algorithm1::smooth::smooth;
    use crate::identify::prepare::prepare;
    use crate::identify::settings::{Delay, Identify};
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use crate::refine::{Free, Jacobian};

    /// An oscillator under a control, with its acceleration logged where `given`; every third value of v is missing.
    fn oscillator(given: bool) -> (Dataset, Identify) {
        let columns = ["x", "v", "u", "a"];
        let value = |i: usize, j: usize| match (j, 0.1 * i as f64) {
            (0, t) => (1.3 * t).sin(),
            (1, _) if i % 3 == 1 => f64::NAN,
            (1, t) => 1.3 * (1.3 * t).cos(),
            (2, t) => (0.7 * t).cos() + if (i / 7).is_multiple_of(2) { 0.5 } else { -0.5 },
            (_, t) => -1.69 * (1.3 * t).sin(),
        };
        let time = (0..40).map(|i| 0.1 * i as f64).collect();
        let run = Run { name: "a".into(), time, values: Mat::from_fn(40, 4, value) };
        let data = Dataset::new(columns.map(Channel::new).into(), vec![run]).unwrap();
        let identify = Identify {
            states: vec!["x".into(), "v".into()],
            controls: vec!["u".into()],
            derivatives: if given { vec![("v".into(), "a".into())] } else { vec![] },
            library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
            delays: vec![("u".into(), Delay::Fixed(0.13))],
            smoother: None,
            ..Identify::default()
        };
        (data, identify)
    }

    #[test]
    fn they_are_those_of_rollouts_with_every_coefficient_moved() {
        for (hold, given) in [(Hold::Zero, false), (Hold::Linear, true)] {
            let (data, identify) = oscillator(given);
            let logs = prepare(&identify, &data, &Silent).unwrap();
            let motion = smooth(&identify, &logs, &Silent).unwrap();
            let mut equations = logs.frame.clone();
            for (s, term, value) in [(0, "v", 1.0), (1, "x", -1.7), (1, "v", -0.2), (1, "u", 0.4), (1, "x^2", 0.1)] {
                let j = equations.library.names().iter().position(|name| *name == term).unwrap();
                equations.coefficients[s][j] = value;
                let coefficients = equations.coefficients[s].clone();
                equations.set(s, &coefficients);
            }
            let prepare = |equations: &Equations| {
                let system = equations.model_with_parameters().compile().unwrap();
                let mut experiment = Experiment::new(&system, &logs.data, Some(&motion.noise)).unwrap();
                experiment = experiment.with_windows_of(2.0);
                (experiment.hold, experiment.substeps) = (hold, 2);
                // Every sample whose number is a multiple of three is there.
                let start = |w: &Window| -> Vec<f64> {
                    let logged = |j: usize| motion.tracks[0].raw[(w.first - w.first % 3, j)];
                    (0..system.n_states()).map(|j| if j < 2 { logged(j) } else { 0.0 }).collect()
                };
                let initial = experiment.windows.iter().map(start).collect();
                let point = Point { parameters: system.parameter_values(), initial };
                (system, experiment, point)
            };
            let (system, experiment, point) = prepare(&equations);
            let course =
                Course { equations: &equations, system: &system, experiment: &experiment, tracks: &motion.tracks };
            let found = course.sensitivities(&point).unwrap();
            let mut whole = equations.clone();
            let all: Vec<usize> = (0..equations.n_candidates()).collect();
            whole.set_support(&all, &equations.coefficients);
            let (system, experiment, point) = prepare(&whole);
            let free: Vec<Free> = (0..system.n_parameters()).map(|k| Free::new(k, 1.0)).collect();
            let moved = Jacobian::new(&system, &experiment, &point, &free).unwrap();
            for (found, block) in found.iter().zip(&moved.blocks) {
                assert_eq!(found.ncols(), 20);
                for k in 0..found.ncols() {
                    let column = block.derivative.column(system.n_states() + k);
                    let difference = |i: usize| if block.present[i] { found[(i, k)] - column[i] } else { 0.0 };
                    let largest = (0..column.len()).map(|i| difference(i).abs()).fold(0.0, f64::max);
                    // The integrators' own errors at steps of 0.05 s: 2e-4 where held controls jump inside a step.
                    assert!(largest < 1e-3 * column.amax().max(1.0), "{hold:?} {k}: {largest} of {}", column.amax());
                }
            }
        }
    }
}
