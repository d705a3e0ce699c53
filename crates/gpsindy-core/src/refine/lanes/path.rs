//! The path of a fitted model, and how far small pushes along it move the readings.
//!
//! A suspect adds a signal to the rates. The signal is taken exactly, at the states of the path; the plant answers to it in a straight
//! line, `d' = A d + signal`, which is one recursion of small matrices for every suspect. So a plant is rolled out once for all of
//! them, and differentiated once.
//!
//! Where dry friction holds a state at rest, pushes on it are taken up by the friction.
//!
//! A signal enters an integration step by its value in the middle, where `A` is taken, too: both are right to the second order in the
//! step. Source: the variational equation, Hairer, Norsett and Wanner 1993, Solving Ordinary Differential Equations I, section I.14.

mod making;
mod signals;
mod stepped;
mod steps;

use super::Lanes;
use crate::model::change::{Change, Entry};
use crate::model::{LateState, System};
use crate::refine::experiment::{Experiment, Window};
use crate::refine::history::Histories;
use making::{Maker, Making};
use signals::Moment;
use std::sync::Arc;
use stepped::Stepped;

/// Steps, or samples, or columns that are computed side by side.
const L: usize = 8;

/// Most numbers that the matrices of a path may take: 256 MB. Beyond that rollouts cost less than the memory.
const MOST: usize = 1 << 25;

/// The paths of all windows.
#[derive(Clone)]
pub(crate) struct Path {
    n: usize,
    windows: Vec<Arc<Along>>,
    /// How late each late state is read, as [`LateState::amounts`](crate::model::LateState::amounts) has it.
    late: Vec<[f64; 2]>,
}

/// The path of one window: its integration steps and its samples.
struct Along {
    window: Window,
    /// How many steps lie before each sample.
    before: Vec<usize>,
    /// In the middle of every step, of a simulator at its beginning: states and then controls, one row of values each; times, s.
    middle: Vec<Vec<f64>>,
    middle_time: Vec<f64>,
    /// The same at every sample.
    sample: Vec<Vec<f64>>,
    sample_time: Vec<f64>,
    /// Step by step: by how much a difference at its beginning, and a rate in its middle, move its end (n x n, row after row); of a
    /// simulator what its own steps say instead.
    carried: Vec<f64>,
    pushed: Vec<f64>,
    stepped: Option<Stepped>,
    /// Sample by sample: derivatives of the logged readings (c x n); empty where all of them are states as they are.
    slopes: Vec<f64>,
}

/// What a column reads.
#[derive(Debug, Clone, Copy)]
enum Read {
    /// A state as it is.
    Now(usize),
    /// A state that the system reads late: its number among these.
    Late(usize),
}

impl Path {
    /// The path of `system` from the `initial` states of every window; `None` where it has no such straight line: a simulator that
    /// steps, a function of a late reading, a rollout that diverges.
    pub(crate) fn new(
        system: &System,
        experiment: &Experiment,
        parameters: &[f64],
        initial: &[Vec<f64>],
    ) -> Option<Self> {
        let n = system.n_states();
        let read = read(system, experiment);
        if system.engine().is_some() || (read.is_none() && !system.late_states().is_empty()) {
            return None;
        }
        // A path knows one moment of every late reading, whatever the run.
        let is_own = experiment.logs.iter().any(|log| !log.sampled.is_empty());
        if is_own && system.late_states().iter().any(LateState::is_held) {
            return None;
        }
        if 2 * n * n * experiment.n_samples() * experiment.substeps > MOST {
            return None;
        }
        let maker = Maker { system, experiment, read };
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let mut lanes: Option<(usize, Lanes<'_, 1>)> = None;
        let mut windows = Vec::with_capacity(experiment.windows.len());
        for (window, start) in experiment.windows.iter().zip(initial) {
            if lanes.as_ref().is_none_or(|(log, _)| *log != window.log) {
                let log = &experiment.logs[window.log];
                lanes = Some((window.log, Lanes::new(system, log, (experiment.hold, experiment.past), &lane)));
            }
            let (_, lanes) = lanes.as_mut()?;
            let made = pulp::Arch::new().dispatch(Making { maker: &maker, lanes, window: *window, start })?;
            windows.push(Arc::new(made));
        }
        let late = system.late_states().iter().map(|late| late.amounts(&lane)[0]).collect();
        Some(Self { n, windows, late })
    }

    /// The paths of some of the windows.
    pub(crate) fn of(&self, windows: impl Iterator<Item = usize>) -> Self {
        Self { windows: windows.map(|w| self.windows[w].clone()).collect(), ..self.clone() }
    }

    /// The responses of the logged readings, in their units, to a change of the model with each of several sets of `parameters` (those
    /// of the change's tapes): by set and window, sample by sample, columns side by side.
    pub(crate) fn responses(
        &self,
        system: &System,
        experiment: &Experiment,
        change: &Change,
        parameters: &[Vec<f64>],
    ) -> Vec<Vec<Vec<f64>>> {
        let n_columns = experiment.columns.len();
        let read = read(system, experiment);
        // Which of the readings that change are logged, and their columns.
        let logged = |(place, j): (usize, &usize)| Some((place, experiment.columns.iter().position(|c| c == j)?));
        let (places, columns): (Vec<usize>, Vec<usize>) = change.shown.iter().enumerate().filter_map(logged).unzip();
        let mut all: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(self.windows.len()); parameters.len()];
        for (number, sets) in parameters.chunks(L).enumerate() {
            let mut histories: Option<(usize, Vec<Histories<'_, 1>>)> = None;
            for along in &self.windows {
                let log = &experiment.logs[along.window.log];
                let in_run = |set: &Vec<f64>| log.parameters(&set.iter().map(|&v| [v]).collect::<Vec<[f64; 1]>>());
                let sets: Vec<Vec<f64>> = sets.iter().map(|set| in_run(set).iter().map(|v| v[0]).collect()).collect();
                let of = |set: &Vec<f64>| {
                    let lane: Vec<[f64; 1]> = set.iter().map(|&v| [v]).collect();
                    Histories::<1>::new(&change.inputs, log, experiment.hold, &lane)
                };
                if histories.as_ref().is_none_or(|(index, _)| *index != along.window.log) {
                    histories = Some((along.window.log, sets.iter().map(of).collect()));
                }
                let Some((_, histories)) = histories.as_mut() else { continue };
                let mut signals = Vec::with_capacity(sets.len());
                let mut shown = Vec::with_capacity(sets.len());
                for (set, history) in sets.iter().zip(histories) {
                    let [middle, sample] = along.inputs(experiment, history, change.inputs.len());
                    signals.push(along.signals(system, &change.added, set, (&middle, &[]), Moment::Middle));
                    let late = along.late(experiment, change, set);
                    let mut all = along.signals(system, &change.readings, set, (&sample, &late), Moment::Sample);
                    shown.push(places.iter().map(|&place| std::mem::take(&mut all[place])).collect::<Vec<_>>());
                }
                let moved = along.moved((system, self.n), (&change.entries, &mut signals), (&columns, &shown));
                for (lane, shown) in shown.iter().enumerate() {
                    let mut values = self.read_out(system, along, read.as_deref(), &moved, lane);
                    for (&column, shown) in columns.iter().zip(shown) {
                        let own = values[column..].iter_mut().step_by(n_columns);
                        own.zip(shown).for_each(|(value, shown)| *value += shown);
                    }
                    all[number * L + lane].push(values);
                }
            }
        }
        all
    }
}

impl Path {
    /// The responses of the logged readings, in their units, to each of several `terms` of one row's rate, taken `size` times: by term
    /// and window, sample by sample.
    pub(crate) fn responses_to_terms(
        &self,
        system: &System,
        experiment: &Experiment,
        terms: &Change,
        (parameters, size): (&[f64], f64),
    ) -> Vec<Vec<Vec<f64>>> {
        let read = read(system, experiment);
        let Some(entry) = terms.entries.first() else { return Vec::new() };
        let mut all: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(self.windows.len()); terms.entries.len()];
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let mut history: Option<(usize, Histories<'_, 1>)> = None;
        for along in &self.windows {
            let number = along.window.log;
            if history.as_ref().is_none_or(|(index, _)| *index != number) {
                let log = &experiment.logs[number];
                history = Some((number, Histories::<1>::new(&terms.inputs, log, experiment.hold, &lane)));
            }
            let Some((_, history)) = history.as_mut() else { continue };
            let [middle, _] = along.inputs(experiment, history, terms.inputs.len());
            let mut signals = along.signals(system, &terms.added, parameters, (&middle, &[]), Moment::Middle);
            signals.iter_mut().flatten().for_each(|value| *value *= size);
            for (number, signals) in signals.chunks(L).enumerate() {
                let mut signals: Vec<Vec<Vec<f64>>> = signals.iter().map(|signal| vec![signal.clone()]).collect();
                let moved = along.moved((system, self.n), (&[*entry], &mut signals), (&[], &[]));
                for lane in 0..signals.len() {
                    all[number * L + lane].push(self.read_out(system, along, read.as_deref(), &moved, lane));
                }
            }
        }
        all
    }

    /// The responses of the logged readings, in their units, to pushes on the rates of some `rows`: by window, sample by sample.
    /// `push` gives the values of each row in the middles of a window's steps, whose times it is given, s.
    pub(crate) fn pushed(
        &self,
        system: &System,
        experiment: &Experiment,
        rows: &[usize],
        push: &mut dyn FnMut(&[f64]) -> Vec<Vec<f64>>,
    ) -> Vec<Vec<f64>> {
        let read = read(system, experiment);
        let entries: Vec<Entry> = rows.iter().copied().map(Entry::Rate).collect();
        let one = |along: &Arc<Along>| {
            let moved = along.moved((system, self.n), (&entries, &mut [push(&along.middle_time)]), (&[], &[]));
            self.read_out(system, along, read.as_deref(), &moved, 0)
        };
        self.windows.iter().map(one).collect()
    }

    /// What one lane of differences from the path does to the readings.
    fn read_out(
        &self,
        system: &System,
        along: &Along,
        read: Option<&[Read]>,
        moved: &[[f64; L]],
        lane: usize,
    ) -> Vec<f64> {
        let (n, samples) = (self.n, along.sample_time.len());
        let n_columns = read.map_or(along.slopes.len() / (samples * n).max(1), <[Read]>::len);
        let mut values = vec![0.0; samples * n_columns];
        for column in 0..n_columns {
            let own = values[column..].iter_mut().step_by(n_columns).enumerate();
            match read.map(|read| read[column]) {
                Some(Read::Now(state)) => own.for_each(|(i, value)| *value = moved[i * n + state][lane]),
                Some(Read::Late(number)) => {
                    let late = &system.late_states()[number];
                    let then = |i: usize| late.moment(along.sample_time[i], self.late[number]);
                    own.for_each(|(i, value)| *value = along.moved_at(n, moved, late.state, lane, then(i)));
                }
                None => own.for_each(|(i, value)| {
                    let slopes = &along.slopes[(i * n_columns + column) * n..][..n];
                    *value = (0..n).map(|j| slopes[j] * moved[i * n + j][lane]).sum();
                }),
            }
        }
        values
    }
}

/// What each logged column reads, where all read one state.
fn read(system: &System, experiment: &Experiment) -> Option<Vec<Read>> {
    let n = system.n_states();
    let first = system.outputs().n_variables() - system.late_states().len();
    let of = |&c: &usize| match system.outputs().bare_variable(c)? {
        state if state < n => Some(Read::Now(state)),
        late if late >= first => Some(Read::Late(late - first)),
        _ => None,
    };
    experiment.columns.iter().map(of).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};
    use faer::Mat;

    const COUNT: usize = 300;

    /// A cart under a push that its dry friction of 0.5 holds again and again.
    fn cart(rate: &str) -> Model {
        let names = [("f", 0.5), ("c", 0.0)];
        Model {
            states: [("x", "v"), ("v", rate)].map(|(n, e)| State::new(n, Expression::parse(e).unwrap())).into(),
            controls: vec![Control::new("u")],
            parameters: names.map(|(n, v)| Parameter::new(n, v)).into(),
            ..Model::default()
        }
    }

    fn experiment(system: &System) -> Experiment {
        let run = Run {
            name: "run".into(),
            time: (0..COUNT).map(|i| 0.02 * i as f64).collect(),
            values: Mat::from_fn(COUNT, 3, |i, c| if c == 2 { (2.1 * 0.02 * i as f64).sin() } else { 0.0 }),
        };
        let data = Dataset::new(["x", "v", "u"].map(Channel::new).into(), vec![run]).unwrap();
        Experiment { substeps: 4, ..Experiment::new(system, &data, Some(&[1.0, 1.0])).unwrap() }
    }

    /// Rollouts of a model of the cart, columns side by side.
    fn rolled(model: &Model, parameters: [f64; 2]) -> Vec<f64> {
        let system = System::new(model).unwrap();
        let experiment = experiment(&system);
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let log = &experiment.logs[0];
        let mut lanes = Lanes::<1>::new(&system, log, (experiment.hold, experiment.past), &lane);
        let mut values = vec![0.0; 2 * COUNT];
        lanes.roll((0, COUNT - 1), &[[0.0], [0.0]], &[0, 1], 4, |i, c, v| values[2 * i + c] = v[0]);
        values
    }

    #[test]
    fn what_dry_friction_holds_takes_no_push_and_what_it_lets_go_takes_all_of_it() {
        let base = cart("u - f*stick(v, 0)");
        let changed = cart("u - f*stick(v, 0) - c*v");
        let system = System::new(&base).unwrap();
        let experiment = experiment(&system);
        let path = Path::new(&system, &experiment, &[0.5, 0.0], &[vec![0.0, 0.0]]).unwrap();
        let change = Change::between(&system, &changed, &[]).unwrap().unwrap();
        let small = 1e-3;
        let found = path.responses(&system, &experiment, &change, &[vec![0.5, small]]).remove(0).remove(0);
        let without = rolled(&changed, [0.5, 0.0]);
        let expected: Vec<f64> = rolled(&changed, [0.5, small]).iter().zip(&without).map(|(a, b)| a - b).collect();
        let held = (0..COUNT).filter(|i| without[2 * i + 1] == 0.0).count();
        assert!((10..COUNT - 20).contains(&held), "{held}");
        let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
        let off = norm(&mut found.iter().zip(&expected).map(|(a, b)| a - b));
        let size = norm(&mut expected.iter().copied());
        // Moments at which the friction catches or lets go move with the push, by a share of a step.
        assert!(off < 0.05 * size, "{off} of {size}");
        assert!((0..COUNT).filter(|i| without[2 * i + 1] == 0.0).all(|i| found[2 * i + 1].abs() < 0.02 * size));
    }

    #[test]
    fn a_function_of_a_late_reading_has_no_path() {
        let mut late = cart("u - f*v");
        late.states[0].measured = Some(Expression::parse("2*delay(x, 0.1)").unwrap());
        let system = System::new(&late).unwrap();
        assert!(Path::new(&system, &experiment(&system), &[0.5, 0.0], &[vec![0.0, 0.0]]).is_none());
        // One that is read late as it is has one.
        late.states[0].measured = Some(Expression::parse("delay(x, 0.1)").unwrap());
        let system = System::new(&late).unwrap();
        assert!(Path::new(&system, &experiment(&system), &[0.5, 0.0], &[vec![0.0, 0.0]]).is_some());
    }
}
