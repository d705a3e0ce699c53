//! Simulations of one MuJoCo model with parameters of their own, stepped one after another.

use super::batch::{Batch, Library};
use super::plan::{Base, Plan};
use crate::native::length::Length;
use gpsindy_core::Rows;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Simulations that are kept, each with parameters of its own: derivatives of a fit need one for every free parameter.
const KEPT: usize = 64;

/// The timestep as a field of the model.
const TIMESTEP: &std::ffi::CStr = c"opt.timestep";

/// Length of a base's quaternion below which it says nothing.
const NO_TURN: f64 = 1e-12;

/// Simulations, each of which has been set to some parameters.
pub(super) struct Simulations {
    plan: Arc<Plan>,
    batch: Batch,
    places: Places,
    /// Simulations by the bits of their parameters, and when each was last asked for.
    known: HashMap<Vec<u64>, (usize, usize)>,
    /// Parameters and timestep of every simulation.
    values: Vec<(Vec<f64>, f64)>,
    uses: usize,
}

/// Where the components are in a state.
struct Places {
    time: Range<usize>,
    positions: Range<usize>,
    velocities: Range<usize>,
    activations: Range<usize>,
    commands: Range<usize>,
    forces: Range<usize>,
}

/// What is held while a simulation makes some steps.
struct Held<'a> {
    commands: &'a [f64],
    forces: &'a [f64],
    parameters: &'a [f64],
}

impl Simulations {
    pub(super) fn new(plan: &Arc<Plan>, library: &Arc<Library>, model: usize) -> PyResult<Self> {
        let mut batch = Batch::new(library.clone(), model, KEPT, plan.warnings)?;
        let [time, positions, velocities, activations, commands, forces] =
            plan.components.map(|bit| batch.component(bit));
        let places = Places { time, positions, velocities, activations, commands, forces };
        let nominal: Vec<f64> = plan.settings.iter().map(|setting| setting.value).collect();
        let values = vec![(nominal, plan.timestep); KEPT];
        Ok(Self { plan: plan.clone(), batch, places, known: HashMap::new(), values, uses: 0 })
    }

    /// Steps of one simulation, nobody asking for its states.
    pub(super) fn idle(&mut self, count: usize) {
        self.batch.step(0, count);
    }

    /// As [`super::copies::Copies::step`].
    pub(super) fn step(
        &mut self,
        rows: &Rows<'_>,
        (dt, samples, count): (&Length<'_>, usize, usize),
        next: &mut [f64],
    ) -> PyResult<()> {
        let widths = [&rows.commands, &rows.forces].map(|part| part.len() / (rows.count * samples).max(1));
        let [n, p] = [rows.states, rows.parameters].map(|part| part.len() / rows.count.max(1));
        let of = |row: usize, width: usize| row * width..(row + 1) * width;
        for row in 0..rows.count {
            let parameters = &rows.parameters[of(row, p)];
            let simulation = self.set(parameters, dt.of(row))?;
            self.put(simulation, &rows.states[of(row, n)]);
            for sample in row * samples..(row + 1) * samples {
                let held = Held {
                    commands: &rows.commands[of(sample, widths[0])],
                    forces: &rows.forces[of(sample, widths[1])],
                    parameters,
                };
                let own = of(sample, n);
                if self.hold(simulation, &held, count) {
                    self.read(simulation, &mut next[own]);
                } else {
                    next[own.start..(row + 1) * samples * n].fill(f64::NAN);
                    break;
                }
            }
        }
        Ok(())
    }

    /// The simulation of such parameters, with this timestep.
    fn set(&mut self, parameters: &[f64], dt: f64) -> PyResult<usize> {
        self.uses += 1;
        let key: Vec<u64> = parameters.iter().map(|value| value.to_bits()).collect();
        let simulation = match self.known.get_mut(&key) {
            Some((simulation, used)) => {
                *used = self.uses;
                *simulation
            }
            None => {
                let (simulation, is_new) = self.spare();
                self.write(simulation, is_new, parameters)?;
                self.known.insert(key, (simulation, self.uses));
                simulation
            }
        };
        if self.values[simulation].1 != dt {
            self.batch.field(TIMESTEP, simulation)?.fill(dt);
            self.values[simulation].1 = dt;
        }
        Ok(simulation)
    }

    /// A simulation that was never asked for, else the one that was not for the longest; and whether it is new.
    fn spare(&mut self) -> (usize, bool) {
        if self.known.len() < KEPT {
            return (self.known.len(), true);
        }
        let oldest = self.known.iter().min_by_key(|(_, (_, used))| *used).map(|(key, _)| key.clone());
        (oldest.and_then(|key| self.known.remove(&key)).map_or(0, |(simulation, _)| simulation), false)
    }

    /// Sets the numbers of the model that differ.
    fn write(&mut self, simulation: usize, is_new: bool, parameters: &[f64]) -> PyResult<()> {
        // A new one's constants are computed, too: what they are must not depend on what a simulation was before.
        let mut moves_constants = is_new && self.plan.settings.iter().any(|setting| setting.moves_constants);
        for ((setting, &value), own) in self.plan.settings.iter().zip(parameters).zip(&mut self.values[simulation].0) {
            if *own == value {
                continue;
            }
            *own = value;
            for write in &setting.writes {
                let number = value / write.at * write.value;
                if let Some(place) = self.batch.field(&write.field, simulation)?.get_mut(write.place) {
                    *place = number;
                }
            }
            moves_constants |= setting.moves_constants;
        }
        if moves_constants { self.batch.set_constants(simulation) } else { Ok(()) }
    }

    /// Puts a simulation into states: positions, velocities, activations.
    fn put(&mut self, simulation: usize, x: &[f64]) {
        let Self { plan, batch, places, .. } = self;
        let state = batch.state(simulation);
        state[places.time.clone()].fill(0.0);
        let (positions, rest) = x.split_at(plan.positions.len());
        let (velocities, activations) = rest.split_at(plan.velocities.len());
        for (place, value) in plan.positions.iter().zip(positions) {
            state[places.positions.start + place] = *value;
        }
        for (place, value) in plan.velocities.iter().zip(velocities) {
            state[places.velocities.start + place] = *value;
        }
        state[places.activations.clone()].copy_from_slice(activations);
    }

    fn read(&mut self, simulation: usize, x: &mut [f64]) {
        let Self { plan, batch, places, .. } = self;
        let state = batch.state(simulation);
        let positions = plan.positions.iter().map(|place| state[places.positions.start + place]);
        let velocities = plan.velocities.iter().map(|place| state[places.velocities.start + place]);
        let activations = state[places.activations.clone()].iter().copied();
        x.iter_mut().zip(positions.chain(velocities).chain(activations)).for_each(|(to, from)| *to = from);
    }

    /// So many steps; whether the engine made them.
    fn hold(&mut self, simulation: usize, held: &Held<'_>, count: usize) -> bool {
        let Self { plan, batch, places, .. } = self;
        let state = batch.state(simulation);
        for (place, force) in plan.velocities.iter().zip(held.forces) {
            state[places.forces.start + place] = *force;
        }
        let (commands, columns) = held.commands.split_at(plan.commands.len());
        for (place, command) in plan.commands.iter().zip(commands) {
            state[places.commands.start + place] = *command;
        }
        for lock in &plan.locks {
            state[places.positions.start + lock.position] = lock.at;
            state[places.velocities.start + lock.velocity] = 0.0;
        }
        if plan.base.is_none() && plan.drivers.is_empty() {
            return batch.step(simulation, count);
        }
        // A base is placed and a driver's loop closed anew at every step.
        (0..count).all(|_| {
            let state = batch.state(simulation);
            if let Some(base) = &plan.base {
                base.place(columns, places, state);
            }
            for driver in &plan.drivers {
                let position = state[places.positions.start + plan.positions[driver.joint]];
                let speed = state[places.velocities.start + plan.velocities[driver.joint]];
                let (kp, kd) = (held.parameters[driver.gain], held.parameters[driver.gain + 1]);
                state[places.commands.start + driver.actuator] =
                    kp * (commands[driver.command] - position) - kd * speed;
            }
            batch.step(simulation, 1)
        })
    }
}

impl Base {
    /// Moves the base as the columns of the logs say.
    fn place(&self, columns: &[f64], places: &Places, state: &mut [f64]) {
        let pose = places.positions.start + self.position;
        let motion = places.velocities.start + self.velocity;
        let force = places.forces.start + self.velocity;
        state[pose..pose + 7].copy_from_slice(&self.pose);
        state[motion..motion + 6].fill(0.0);
        if let Some((turn, rest)) = columns.split_first_chunk::<4>().filter(|_| self.columns > 0) {
            let length = turn.iter().map(|q| q * q).sum::<f64>().sqrt().max(NO_TURN);
            state[pose + 3..pose + 7].copy_from_slice(&turn.map(|q| q / length));
            state[motion + 3..motion + 6].copy_from_slice(&rest[..3]);
            state[force + 3..force + 6].copy_from_slice(&[3, 4, 5].map(|i| self.inertia * rest[i]));
            if let Some(place) = rest[6..].first_chunk::<9>() {
                state[pose..pose + 3].copy_from_slice(&place[..3]);
                state[motion..motion + 3].copy_from_slice(&place[3..6]);
                state[force..force + 3].copy_from_slice(&[6, 7, 8].map(|i| self.inertia * place[i]));
            }
        }
    }
}
