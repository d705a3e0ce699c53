//! Innovations: the one-step prediction errors of a filter along the logs, in place of residuals of rollouts.
//!
//! Rollouts of a model that lacks something leave the log; where they are ten or a hundred times the noise away, straight lines from
//! them point nowhere. A Kalman filter that takes the model's states as pushed at random stays near the log. Its memory is as long
//! as the model is good, state by state, as the intensities of the pushes are fitted to the logs first.
//!
//! Source: Jazwinski 1970, Stochastic Processes and Filtering Theory, chapter 8; the intensities by expectation maximisation as in
//! Shumway and Stoffer 1982, J. Time Ser. Anal. 3(4), the smoother with them by Rauch, Tung and Striebel 1965, AIAA J. 3(8).

mod kalman;

use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::guide::Guide;
use crate::diagnose::limits::innovations::{PUSH_ROUNDS, STRAIGHT};
use crate::refine::{Block, Experiment, Guided, Jacobian, Job, Window, present, roll_together};
use kalman::{Filter, shows};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The innovations of a contestant whose simulator steps: a point of its own to draw straight lines from.
pub(crate) struct Innovations {
    /// The contestant with the starts of the filter's path.
    pub(crate) contestant: Contestant,
    /// Innovations over the noise, and their derivatives by the free parameters; starts are the filter's.
    pub(crate) jacobian: Jacobian,
    pub(crate) guide: Guide,
}

impl Innovations {
    /// `None` where the simulator fails along the logs, none steps, or time is up.
    pub(crate) fn of(contestant: &Contestant, jacobian: &Jacobian) -> Option<Self> {
        let system = &contestant.system;
        system.engine()?;
        is_open(&contestant.experiment)?;
        let experiment = Experiment { starts: crate::refine::Starts::default(), ..contestant.experiment.clone() };
        let parameters = &contestant.refined.parameters;
        let mut filter = Filter::new(system, &experiment)?;
        let mut guided = Guided::along(system, &experiment, parameters, path_of(contestant, &experiment))?;
        for _ in 0..PUSH_ROUNDS {
            is_open(&experiment)?;
            filter.expect(&guided, &experiment)?;
        }
        // Once more along its own path, which has less of the readings' noise.
        let passes = filter.passes(&guided, &experiment)?;
        let mut path: Vec<Vec<Vec<f64>>> =
            (0..experiment.windows.len()).map(|window| guided.path(window).to_vec()).collect();
        for (states, pass) in path.iter_mut().zip(&passes) {
            for (state, sample) in states.iter_mut().zip(pass) {
                filter.put(&sample.state, state);
            }
        }
        is_open(&experiment)?;
        guided = Guided::along(system, &experiment, parameters, path.clone())?;
        let passes = filter.passes(&guided, &experiment)?;
        let gains = passes
            .iter()
            .map(|pass| pass.iter().map(|sample| filter.gain(sample, &experiment.noise)).collect())
            .collect();
        let (tangent, shown) = guided.corrected(system, &experiment, gains)?;
        let mut blocks = Vec::with_capacity(shown.len());
        for (window, (shown, old)) in experiment.windows.iter().zip(shown.iter().zip(&jacobian.blocks)) {
            let log = &experiment.logs[window.log];
            let mut residual = DVector::zeros(old.residual.len());
            for (row, value) in residual.iter_mut().enumerate().filter(|(row, _)| old.present[*row]) {
                let (sample, c) = (row / experiment.columns.len(), row % experiment.columns.len());
                *value = (log.measured[c][window.first + sample] - shown[sample][c]) / experiment.noise[c];
            }
            let finite = residual.iter().all(|v| v.is_finite());
            finite.then(|| {
                let derivative = DMatrix::zeros(residual.len(), contestant.free.len());
                blocks.push(Block { residual, derivative, present: old.present.clone() });
            })?;
        }
        let whitening = filter.whitening(&passes, &blocks);
        let mut contestant = Contestant { experiment, ..contestant.clone() };
        contestant.refined.initial = path.into_iter().map(|states| states.into_iter().next()).collect::<Option<_>>()?;
        let guide = Guide { tangent: Arc::new(tangent), whitening };
        let mut found = Self { contestant, jacobian: Jacobian { blocks, n_states: 0 }, guide };
        found.differentiate();
        Some(found)
    }

    /// What straight lines go out from.
    pub(crate) fn linearised(&self) -> Linearised<'_> {
        let (jacobian, guide) = (self.jacobian.clone(), Some(self.guide.clone()));
        Linearised { contestant: &self.contestant, jacobian, guide, path: None }.with_steps()
    }

    /// Derivatives by the free parameters: the tangent is a straight line in them.
    fn differentiate(&mut self) {
        let Contestant { system, experiment, refined, free, .. } = &self.contestant;
        let n_columns = experiment.columns.len();
        for (place, free) in free.iter().enumerate() {
            let mut parameters = refined.parameters.clone();
            let by = STRAIGHT * free.scale;
            parameters[free.parameter] += by;
            let windows: Vec<usize> = (0..experiment.windows.len()).collect();
            let job = |&window: &usize| Job {
                window,
                parameters: parameters.clone(),
                initial: refined.initial[window].clone(),
            };
            let jobs: Vec<Job> = windows.iter().map(job).collect();
            let blocks = &mut self.jacobian.blocks;
            let mut receive = |window: usize, sample: usize, c: usize, value: f64| {
                let Window { log, first, .. } = experiment.windows[window];
                let (row, block) = ((sample - first) * n_columns + c, &mut blocks[window]);
                if block.present[row] {
                    let measured = experiment.logs[log].measured[c][sample];
                    let moved = (value - measured) / experiment.noise[c] + block.residual[row];
                    block.derivative[(row, place)] = moved / by;
                }
            };
            self.guide.tangent.roll(system, (experiment, &windows), &jobs, (&experiment.columns, true), &mut receive);
        }
    }
}

/// Nothing where time is up.
fn is_open(experiment: &Experiment) -> Option<()> {
    (!experiment.tally.is_over()).then_some(())
}

/// All states by window and sample: those that were read as they were, the others as the contestant's rollouts have them.
fn path_of(contestant: &Contestant, experiment: &Experiment) -> Vec<Vec<Vec<f64>>> {
    let (system, refined) = (&contestant.system, &contestant.refined);
    let job = |(window, start): (usize, &Vec<f64>)| Job {
        window,
        parameters: refined.parameters.clone(),
        initial: start.clone(),
    };
    let jobs: Vec<Job> = refined.initial.iter().enumerate().map(job).collect();
    let samples = |w: &Window| w.last - w.first + 1;
    let mut path: Vec<Vec<Vec<f64>>> =
        experiment.windows.iter().map(|w| vec![vec![0.0; system.n_states()]; samples(w)]).collect();
    roll_together(system, experiment, &jobs, None, &mut |job, sample, j, value| {
        path[job][sample - experiment.windows[job].first][j] = value;
    });
    for (window, states) in experiment.windows.iter().zip(&mut path) {
        let log = &experiment.logs[window.log];
        for (c, &j) in experiment.columns.iter().enumerate().filter(|(_, j)| shows(system, **j)) {
            follow(states, j, &present(&log.measured[c][window.first..=window.last]));
        }
    }
    path
}

/// Puts a state on its readings (sample and value), and between them on the rollout, moved by what it misses at both.
fn follow(states: &mut [Vec<f64>], j: usize, readings: &[(usize, f64)]) {
    let missed: Vec<(usize, f64)> = readings.iter().map(|(k, value)| (*k, value - states[*k][j])).collect();
    let (Some(&(first, early)), Some(&(last, late))) = (missed.first(), missed.last()) else { return };
    for pair in missed.windows(2) {
        let ((from, before), (to, after)) = (pair[0], pair[1]);
        for k in from + 1..to {
            let part = (k - from) as f64 / (to - from) as f64;
            states[k][j] += before + part * (after - before);
        }
    }
    states[..first].iter_mut().for_each(|state| state[j] += early);
    states[last + 1..].iter_mut().for_each(|state| state[j] += late);
    readings.iter().for_each(|(k, value)| states[*k][j] = *value);
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fit::colours::noise::Noise;
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fit::guide::whiten;
    use crate::diagnose::fit::linear::basis::Basis;
    use crate::diagnose::limits::Budget;
    use crate::model::stepping::{Stepping, drawn};

    /// The fit of a servo of inertia 0.03 to logs of one of `inertia`, whose commands come `late` samples late. Place and speed are
    /// read in turns where they have rows of their `own`.
    fn fitted(inertia: f64, late: usize, own: bool) -> Contestant {
        let noise = [1e-3, 1e-2];
        let servo = Arc::new(Stepping::servo());
        let system = servo.system("q", ("inertia", 0.03));
        let command = |i: usize| drawn(9000 + i / 40);
        let sensor = |i: usize, j: usize, x: f64| match !own || i % 2 == j {
            true => x + 3f64.sqrt() * noise[j] * drawn(2 * i + j),
            false => f64::NAN,
        };
        let read = |i: usize, x: [f64; 2]| [sensor(i, 0, x[0]), sensor(i, 1, x[1])];
        let acting = |i: usize| command(i.saturating_sub(late));
        let data = servo.log(("q", inertia), ([0.0; 2], 1200), command, acting, read);
        let experiment = Experiment::new(&system, &data, Some(&noise)).unwrap().with_windows_of(0.6);
        Fitter::default().nominal(system, experiment, Vec::new(), Budget::Usual).unwrap()
    }

    /// Gains by the innovations of every effect of `ids`, with the values of the best start.
    fn gains(contestant: &Contestant, ids: &[&str]) -> Vec<(f64, Vec<f64>)> {
        use crate::diagnose::catalogue::enumerate::everything;
        let scene = crate::diagnose::fit::outputs::scene_of(contestant);
        let model = contestant.system.model();
        let all = everything(model, &scene, &contestant.experiment.columns, &[]).unwrap();
        let innovations = Innovations::of(contestant, &contestant.linearised().unwrap().jacobian).unwrap();
        let at = innovations.linearised();
        let basis = Basis::new(&at, Noise::Innovations, &[]);
        let of = |id: &&str| {
            let own = all.iter().filter(|h| h.id() == *id);
            let gains = own.flat_map(|h| {
                let applied = h.apply(model, &scene).unwrap();
                crate::diagnose::fit::linear::gains::gains(&applied, &at, &[&basis])
            });
            let best = gains
                .filter_map(|gains| gains.of(Noise::Innovations).cloned())
                .flatten()
                .max_by(|a, b| a.gain.total_cmp(&b.gain))
                .unwrap();
            (best.gain, best.values)
        };
        ids.iter().map(of).collect()
    }

    #[test]
    fn all_suspects_together_have_the_responses_of_each_on_its_own() {
        use crate::diagnose::catalogue::enumerate::everything;
        use crate::diagnose::fit::linear::responses::responses;
        let contestant = fitted(0.048, 0, false);
        let scene = crate::diagnose::fit::outputs::scene_of(&contestant);
        let model = contestant.system.model();
        let rollouts = || contestant.linearised().unwrap().with_steps();
        let innovations = Innovations::of(&contestant, &rollouts().jacobian).unwrap();
        let both = [("rollouts", [rollouts(), rollouts()]), ("innovations", [0, 1].map(|_| innovations.linearised()))];
        for (place, [together, alone]) in both {
            let alone = Linearised { path: None, ..alone };
            let (mut count, mut far) = (0, Vec::new());
            for hypothesis in everything(model, &scene, &contestant.experiment.columns, &[]).unwrap() {
                let Ok(applied) = hypothesis.apply(model, &scene) else { continue };
                let columns: Vec<&Vec<f64>> = applied.starts.iter().flat_map(|start| &start.columns).take(8).collect();
                // Late readings: a filter's own path is taken without what their correction does to themselves.
                let is_late = applied.model.states.iter().any(|s| s.measured.is_some());
                if columns.is_empty()
                    || (place == "innovations" && is_late)
                    || applied.model.states.len() > model.states.len()
                {
                    continue;
                }
                let all = [&together, &alone].map(|at| responses(&applied, at, &columns));
                let [Some(all), Some(each)] = all else { continue };
                // A reading that is late at a window's first sample is none of a rollout, which has nothing before it.
                let squares =
                    |column: &Vec<DVector<f64>>| column.iter().map(|of| of.rows_range(2..).norm_squared()).sum::<f64>();
                for (one, other) in all.iter().zip(&each) {
                    let off: Vec<DVector<f64>> = one.iter().zip(other).map(|(one, other)| one - other).collect();
                    count += 1;
                    let share = (squares(&off) / (squares(other) + 1e-4)).sqrt();
                    if share > 1e-5 {
                        far.push((hypothesis.id().to_string(), share));
                    }
                }
            }
            assert!(count > 100, "{place}: {count}");
            assert!(far.is_empty(), "{place}: {count}, {far:?}");
        }
    }

    #[test]
    fn a_wrong_inertia_leads_where_rollouts_have_left_the_log() {
        let contestant = fitted(0.048, 0, false);
        assert!(contestant.evidence.misfit() > 20.0, "{}", contestant.evidence.misfit());
        let found = gains(&contestant, &["parameter_error", "input_delay", "sensor_bias", "step_disturbance"]);
        assert!(found[1..].iter().all(|other| other.0 < 0.5 * found[0].0), "{found:?}");
        assert!((found[0].1[0] - 0.048).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_wrong_inertia_leads_where_place_and_speed_never_share_a_row() {
        let ids = ["parameter_error", "input_delay", "sensor_bias", "step_disturbance"];
        let found = gains(&fitted(0.048, 0, true), &ids);
        assert!(found[1..].iter().all(|other| other.0 < 0.5 * found[0].0), "{found:?}");
        assert!((found[0].1[0] - 0.048).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn between_readings_a_path_is_the_rollout_moved_by_what_it_misses() {
        let mut states: Vec<Vec<f64>> = (0..6).map(|k| vec![f64::from(k * k)]).collect();
        follow(&mut states, 0, &[(1, 2.0), (4, 20.0)]);
        let found: Vec<f64> = states.into_iter().map(|state| state[0]).collect();
        assert_eq!(found, [1.0, 2.0, 4.0 + 2.0, 9.0 + 3.0, 20.0, 29.0]);
    }

    #[test]
    fn a_command_that_comes_late_to_a_saturated_servo_leads() {
        let found =
            gains(&fitted(0.03, 3, false), &["input_delay", "parameter_error", "sensor_bias", "step_disturbance"]);
        assert!(found[1..].iter().all(|other| other.0 < 0.5 * found[0].0), "{found:?}");
    }

    #[test]
    fn a_true_model_leaves_nearly_white_innovations_and_no_gain() {
        let contestant = fitted(0.03, 0, false);
        let innovations = Innovations::of(&contestant, &contestant.linearised().unwrap().jacobian).unwrap();
        let all: Vec<Vec<f64>> = innovations
            .jacobian
            .blocks
            .iter()
            .zip(&innovations.guide.whitening)
            .map(|(block, by)| {
                let mut values = block.residual.clone();
                whiten(by, &mut values);
                values.iter().skip(1).step_by(2).copied().collect()
            })
            .collect();
        let count = all.iter().map(Vec::len).sum::<usize>() as f64;
        let lagged: f64 = all.iter().flat_map(|values| values.windows(2).map(|v| v[0] * v[1])).sum::<f64>() / count;
        assert!(lagged.abs() < 0.25, "{lagged}");
        let found = gains(&contestant, &["parameter_error", "input_delay"]);
        assert!(found.iter().all(|(gain, _)| *gain < 20.0), "{found:?}");
    }
}
