//! How far a signal separates a pair of simulators: expected log odds in favour of the right one.
//!
//! For truth i and rival j: `min over d of (|y_i - y_j - D_j d|^2 + d' P_j d)/2`, averaged over what is known of i's sizes.
//! `y` are the logged columns in units of their noise, `D_j` the derivatives of `y_j` by its start and its sizes, `P_j` what
//! the earlier logs say of its sizes: a rival may have any start, and adjusts its sizes as far as they allow.

use crate::diagnose::design::open::{Candidate, Open};
use crate::diagnose::design::settings::Design;
use crate::diagnose::design::signals::{Form, Frame, Signal};
use crate::diagnose::fit::lagging::start_of;
use crate::diagnose::fit::outputs::{outputs, trajectories};
use crate::diagnose::fit::substeps::choose_substeps;
use crate::diagnose::limits::{INTEGRATION, KEPT_SIGN, MOMENTS, SHRINKINGS, SIZES, SMALLER, TYPICAL_NOISE, UNKNOWN};
use crate::error::{Error, Result};
use crate::model::{Dynamics, System};
use crate::parallel;
use crate::random::normal;
use crate::refine::{Experiment, Free, Jacobian, Log, Past, Point, Starts, Window};
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use std::sync::Arc;

/// Share of the information on a start that is added to it, so that what does not show can be solved for. Rounding.
const RIDGE: f64 = 1e-9;

/// One candidate, compiled.
struct Player {
    system: System,
    free: Vec<Free>,
    /// Inverse of the covariance of the free parameters.
    precision: DMatrix<f64>,
    /// Its own parameters, then draws of them.
    parameters: Vec<Vec<f64>>,
    /// Logged columns among its states.
    columns: Vec<usize>,
}

/// What a candidate says of one signal.
struct Prediction {
    /// Noise-scaled readings for the parameters, and for every draw of them.
    readings: Vec<Vec<f64>>,
    /// Derivatives by start and free parameters.
    derivative: DMatrix<f64>,
    n_states: usize,
}

/// How far one pair is separated.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub(crate) pair: (usize, usize),
    /// Nats at equally spaced moments, the last at the end.
    pub(crate) growth: Vec<f64>,
}

impl Part {
    pub(crate) fn nats(&self) -> f64 {
        self.growth.last().copied().unwrap_or(0.0)
    }
}

/// The candidates, ready to be driven.
pub(crate) struct Bench<'a> {
    open: &'a Open,
    frame: &'a Frame,
    players: Vec<Player>,
    noise: Vec<f64>,
    start: Vec<f64>,
    bounds: Vec<(usize, f64, f64)>,
    substeps: usize,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(
        design: &Design,
        open: &'a Open,
        simulator: Option<Arc<dyn Dynamics>>,
        frame: &'a Frame,
    ) -> Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(design.seed);
        random.set_stream(u64::MAX);
        let mut players = Vec::with_capacity(open.candidates.len());
        for candidate in &open.candidates {
            players.push(Player::new(candidate, open, simulator.clone(), &mut random)?);
        }
        let model = &open.candidates[0].model;
        let known = |name: &String| {
            let given = design.start.iter().chain(&open.start).find(|s| s.0 == *name).map(|s| s.1);
            given.or_else(|| model.initial.get(name).copied()).unwrap_or(0.0)
        };
        let start = model.states.iter().map(|s| known(&s.name)).collect();
        let bound = |(name, low, high): &(String, f64, f64)| Some((model.state_index(name)?, *low, *high));
        let mut bench = Self {
            open,
            frame,
            players,
            noise: open.noise.iter().map(|n| n.1).collect(),
            start,
            bounds: design.bounds.iter().filter_map(bound).collect(),
            substeps: 1,
        };
        let busy = [frame.draw(Form::Steps, 0), frame.draw(Form::Multisine, 0)];
        for player in bench.players.iter().filter(|player| player.system.engine().is_none()) {
            let (experiment, initial) = bench.experiment(player, &busy);
            let chosen = choose_substeps(&player.system, experiment, &player.parameters[0], &initial, INTEGRATION);
            bench.substeps = bench.substeps.max(chosen.substeps);
        }
        Ok(bench)
    }

    /// The signals, smaller where a candidate would leave the bounds of a state; those that leave them all the same are
    /// left out.
    pub(crate) fn within_bounds(&self, signals: Vec<Signal>) -> Vec<Signal> {
        if self.bounds.is_empty() {
            return signals;
        }
        let (mut kept, mut outside) = (Vec::new(), signals);
        for shrinking in 0..=SHRINKINGS {
            let stays = self.stays(&outside);
            let (inside, beyond): (Vec<_>, Vec<_>) = outside.into_iter().zip(stays).partition(|(_, stays)| *stays);
            kept.extend(inside.into_iter().map(|(signal, _)| signal));
            if shrinking == SHRINKINGS {
                break;
            }
            outside = beyond.iter().map(|(signal, _)| self.frame.shrunk(signal, SMALLER)).collect();
        }
        kept
    }

    /// Whether every candidate stays within all bounds, for every signal.
    fn stays(&self, signals: &[Signal]) -> Vec<bool> {
        let mut stays = vec![true; signals.len()];
        for player in &self.players {
            let (experiment, initial) = self.experiment(player, signals);
            let paths = trajectories(&player.system, &experiment, &player.parameters[0], &initial);
            for (stays, path) in stays.iter_mut().zip(paths) {
                let inside =
                    |&(state, low, high): &(usize, f64, f64)| path[state].iter().all(|v| (low..=high).contains(v));
                *stays &= self.bounds.iter().all(inside);
            }
        }
        stays
    }

    /// How far every signal parts every pair; none where a candidate diverges.
    ///
    /// # Errors
    /// A request to stop.
    pub(crate) fn part(&self, signals: &[Signal]) -> Result<Vec<Option<Vec<Part>>>> {
        let mut predictions: Vec<Vec<Option<Prediction>>> = Vec::with_capacity(self.players.len());
        for player in &self.players {
            predictions.push(self.predict(player, signals)?);
        }
        let one = |signal: usize| {
            let of = |candidate: usize| predictions[candidate][signal].as_ref();
            self.open.pairs.iter().map(|&(i, j)| self.separated((i, j), of(i)?, of(j)?)).collect::<Option<Vec<_>>>()
        };
        Ok(parallel::map(0..signals.len(), one))
    }

    fn predict(&self, player: &Player, signals: &[Signal]) -> Result<Vec<Option<Prediction>>> {
        if player.system.engine().is_some() {
            // All in one go costs an engine least; one that diverges spoils the others.
            if let Ok(all) = self.predicted(player, signals) {
                return Ok(all.into_iter().map(Some).collect());
            }
        }
        let one = |signal: &Signal| match self.predicted(player, std::slice::from_ref(signal)) {
            Ok(mut one) => Ok(one.pop()),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(_) => Ok(None),
        };
        if player.system.engine().is_some() {
            return signals.iter().map(one).collect();
        }
        parallel::try_map(signals, one)
    }

    fn predicted(&self, player: &Player, signals: &[Signal]) -> Result<Vec<Prediction>> {
        let (experiment, initial) = self.experiment(player, signals);
        let point = Point { parameters: player.parameters[0].clone(), initial: initial.clone() };
        let jacobian = Jacobian::new(&player.system, &experiment, &point, &player.free)?;
        // Measured values of zero: the residual is the reading.
        let own = jacobian.blocks.iter().map(|block| block.residual.iter().map(|r| -r).collect());
        let mut readings: Vec<Vec<Vec<f64>>> = own.map(|own| vec![own]).collect();
        for drawn in &player.parameters[1..] {
            let drawn = outputs(&player.system, &experiment, drawn, &initial);
            readings.iter_mut().zip(drawn).for_each(|(all, one)| all.push(one));
        }
        let n_states = jacobian.n_states;
        let predictions = jacobian.blocks.into_iter().zip(readings);
        Ok(predictions
            .map(|(block, readings)| Prediction { readings, derivative: block.derivative, n_states })
            .collect())
    }

    /// The signals as runs of a player, with readings of zero, and where it starts in each.
    fn experiment(&self, player: &Player, signals: &[Signal]) -> (Experiment, Vec<Vec<f64>>) {
        let model = player.system.model();
        let r = self.frame.time.len();
        let log = |signal: &Signal| Log {
            name: "next experiment".into(),
            time: self.frame.time.clone(),
            controls: signal.values.clone(),
            measured: vec![vec![0.0; r]; player.columns.len()],
            ..Log::default()
        };
        let known = &self.open.candidates[0].model.states;
        let start = |signal: &Signal| -> Vec<f64> {
            let of = |state: &crate::model::State| match known.iter().position(|s| s.name == state.name) {
                Some(place) => self.start[place],
                None => start_of(model, state, &self.start, |control| signal.values[control][0]),
            };
            model.states.iter().map(of).collect()
        };
        let experiment = Experiment {
            logs: signals.iter().map(log).collect::<Vec<_>>().into(),
            columns: player.columns.clone(),
            noise: self.noise.clone(),
            news: vec![1.0; player.columns.len()],
            windows: (0..signals.len()).map(|log| Window { log, first: 0, last: r - 1 }).collect(),
            hold: self.open.hold(),
            past: Past::Still,
            starts: Starts::default(),
            substeps: self.substeps,
            scale: self.scale(player),
            tally: Default::default(),
        };
        (experiment, signals.iter().map(start).collect())
    }

    /// Typical sizes of the states: many deviations of their noise, and where they are not logged their start or one.
    fn scale(&self, player: &Player) -> Vec<f64> {
        let of = |j: usize| match player.columns.iter().position(|&c| c == j) {
            Some(column) => TYPICAL_NOISE * self.noise[column],
            None => self.start.get(j).map_or(1.0, |start| start.abs().max(1.0)),
        };
        (0..player.system.n_states()).map(of).collect()
    }

    fn separated(&self, pair: (usize, usize), one: &Prediction, other: &Prediction) -> Option<Part> {
        let there = self.separation(one, &self.players[pair.1], other)?;
        let back = self.separation(other, &self.players[pair.0], one)?;
        let growth = there.into_iter().zip(back).map(|(a, b)| a.min(b)).collect();
        Some(Part { pair, growth })
    }

    /// Nats by which `truth` is distinguished from the rival, at every moment; `None` where a number is not finite.
    fn separation(&self, truth: &Prediction, rival: &Player, other: &Prediction) -> Option<Vec<f64>> {
        let width = other.derivative.ncols();
        let base = &other.readings[0];
        let differences: Vec<DVector<f64>> = truth
            .readings
            .iter()
            .map(|reading| DVector::from_iterator(base.len(), reading.iter().zip(base).map(|(a, b)| a - b)))
            .collect();
        let mut information = DMatrix::zeros(width, width);
        let n = other.n_states;
        information.view_mut((n, n), (width - n, width - n)).copy_from(&rival.precision);
        let mut slopes = vec![DVector::zeros(width); differences.len()];
        let mut squares = vec![0.0; differences.len()];
        let mut growth = Vec::with_capacity(MOMENTS);
        let (samples, n_columns) = (self.frame.time.len(), self.noise.len());
        let mut begin = 0;
        for moment in 1..=MOMENTS {
            let end = n_columns * (samples * moment / MOMENTS);
            let rows = other.derivative.rows(begin, end - begin);
            information += rows.tr_mul(&rows);
            for ((slope, square), difference) in slopes.iter_mut().zip(&mut squares).zip(&differences) {
                let part = difference.rows(begin, end - begin);
                *slope += rows.tr_mul(&part);
                *square += part.norm_squared();
            }
            begin = end;
            let mut held = information.clone();
            (0..width).for_each(|k| held[(k, k)] += RIDGE * held[(k, k)] + f64::MIN_POSITIVE.sqrt());
            let solved = held.cholesky()?;
            let left = |(slope, square): (&DVector<f64>, &f64)| (square - slope.dot(&solved.solve(slope))).max(0.0);
            let sum: f64 = slopes.iter().zip(&squares).map(left).sum();
            growth.push(0.5 * sum / differences.len() as f64);
        }
        growth.iter().all(|nats| nats.is_finite()).then_some(growth)
    }
}

impl Player {
    fn new(
        candidate: &Candidate,
        open: &Open,
        simulator: Option<Arc<dyn Dynamics>>,
        random: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let simulator = simulator.filter(|_| candidate.model.calls_simulator());
        let system = System::with_simulator(&candidate.model, simulator)?;
        let model = system.model();
        let first = &open.candidates[0].model;
        if model.controls.len() != first.controls.len()
            || (0..first.controls.len()).any(|i| model.controls[i].name != first.controls[i].name)
        {
            let names =
                |m: &crate::model::Model| m.controls.iter().map(|c| c.name.clone()).collect::<Vec<_>>().join(", ");
            return Err(Error::model(format!(
                "the simulators have different controls: {} and {}; give both the same, in the same order",
                names(first),
                names(model)
            )));
        }
        let columns = open.noise.iter().map(|(name, _)| {
            model.state_index(name).ok_or_else(|| Error::unknown("state", name, model.states.iter().map(|s| &s.name)))
        });
        let columns = columns.collect::<Result<Vec<_>>>()?;
        let size = candidate.parameters.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| {
            candidate.covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0)
        });
        let mean = system.parameter_values();
        let mut free = Vec::with_capacity(size);
        for (place, name) in candidate.parameters.iter().enumerate() {
            let index = model.parameter_index(name);
            let index =
                index.ok_or_else(|| Error::unknown("parameter", name, model.parameters.iter().map(|p| &p.name)))?;
            free.push(Free::new(index, mean[index].abs().max(covariance[(place, place)].sqrt()).max(1e-9)));
        }
        let scale = DMatrix::from_diagonal(&DVector::from_iterator(size, free.iter().map(|f| f.scale)));
        // In typical sizes, so that one ridge suits all of them; what the logs do not know may go by many of its sizes.
        let relative = DMatrix::from_fn(size, size, |i, j| {
            (covariance[(i, j)] / (free[i].scale * free[j].scale)).clamp(-UNKNOWN * UNKNOWN, UNKNOWN * UNKNOWN)
        });
        let relative = relative + DMatrix::identity(size, size) * RIDGE;
        let diagonal = || DMatrix::from_diagonal(&relative.diagonal());
        let root = relative.clone().cholesky().or_else(|| diagonal().cholesky());
        let root = root.ok_or_else(|| Error::model(format!("covariance of `{}` is not positive", candidate.label)))?;
        let inverse = DMatrix::from_fn(size, size, |i, j| if i == j { 1.0 / scale[(i, i)] } else { 0.0 });
        let precision = &inverse * root.inverse() * &inverse;
        let mut parameters = vec![mean.clone()];
        for _ in 0..if size == 0 { 0 } else { SIZES } {
            let normal = DVector::from_fn(size, |_, _| normal(random));
            let moved = &scale * (root.l() * normal);
            let mut drawn = mean.clone();
            for (f, change) in free.iter().zip(moved.iter()) {
                // A size keeps its sign: a friction that drives is none.
                let value = mean[f.parameter] + change;
                drawn[f.parameter] =
                    if value * mean[f.parameter] < 0.0 { KEPT_SIGN * mean[f.parameter] } else { value };
            }
            parameters.push(drawn);
        }
        Ok(Self { system, free, precision, parameters, columns })
    }
}
