//! The real plant: physics plus withheld effects, with exact switch times, true sticking and true play.

mod drive;

use crate::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
use crate::integrate::{Integrator, Stop, Values, WIDTH};
use crate::plant::Plant;

/// Where the commands of a run come from.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub enum Commands {
    /// Given beforehand, one row a sample.
    Open(Vec<Vec<f64>>),
    /// By the plant's feedback from noisy readings: reference and sensor noise by sample and state, dither by control.
    Closed { reference: Vec<Vec<f64>>, noise: Vec<Vec<f64>>, dither: Vec<Vec<f64>> },
}

/// A run before it is made.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Sample times.
    pub times: Vec<f64>,
    /// State at the first sample.
    pub start: Vec<f64>,
    /// The commands.
    pub commands: Commands,
    /// Is the control interpolated between samples (a trap) instead of held?
    pub linear: bool,
}

/// A run without sensor noise.
#[derive(Debug, Clone)]
pub struct Trace {
    /// True states by sample.
    pub states: Vec<Vec<f64>>,
    /// What noise-free sensors read, by sample and state.
    pub readings: Vec<Vec<f64>>,
    /// The logged commands by sample.
    pub controls: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Slip(f64),
    Stick,
}

/// A plant with its effects, ready to run.
pub struct Machine<'a> {
    plant: &'a Plant,
    effects: &'a [Effect],
    parameters: Vec<f64>,
    slots: Vec<usize>,
    width: usize,
    friction: Option<(usize, Friction)>,
    scale: Vec<f64>,
    tolerance: f64,
}

impl<'a> Machine<'a> {
    /// A machine whose states have about the sizes `scale`.
    pub fn new(plant: &'a Plant, effects: &'a [Effect], scale: &[f64], tolerance: f64) -> Self {
        let mut parameters = plant.values();
        let mut slots = Vec::new();
        let mut width = plant.states.len();
        let mut friction = None;
        for effect in effects {
            slots.push(width);
            width += effect.act.hidden();
            match effect.act {
                Act::Parameter { index, value } => parameters[index] = value,
                Act::Friction { law } => friction = Some((effect.state, law)),
                _ => {}
            }
        }
        Self { plant, effects, parameters, slots, width: width.min(WIDTH), friction, scale: scale.to_vec(), tolerance }
    }

    /// Other parameter values than the nominal ones.
    pub fn with_parameters(mut self, parameters: Vec<f64>) -> Self {
        self.parameters = parameters;
        self
    }

    /// Right side without dry friction.
    fn smooth(&self, t: f64, x: &Values, u: &[f64], d: &mut Values) {
        let n = self.plant.states.len();
        let mut applied = [0.0; 4];
        applied[..u.len()].copy_from_slice(u);
        for (effect, &slot) in self.effects.iter().zip(&self.slots) {
            match effect.act {
                Act::Actuator { control, law: Actuator::Lag { tau } } => {
                    d[slot] = (u[control] - x[slot]) / tau;
                    applied[control] = x[slot];
                }
                Act::Actuator { control, law: Actuator::SpeedLimit { s, z0, speed } } => {
                    let r = x[speed] / z0;
                    applied[control] = u[control].min(s * (1.0 - r)).max(-s * (1.0 + r));
                }
                Act::Sensor { law: Sensor::Filter { tau } } => d[slot] = (x[effect.state] - x[slot]) / tau,
                Act::Warming { control, tau, usual, .. } => {
                    d[slot] = ((u[control] / usual).powi(2) - x[slot]) / tau;
                }
                _ => {}
            }
        }
        let applied = &applied[..u.len()];
        let changed = self.changed(x);
        let parameters = changed.as_ref().unwrap_or(&self.parameters);
        let mut place = [0.0; WIDTH];
        place[..n].copy_from_slice(&x[..n]);
        for effect in self.effects {
            if let Act::Loose { p, q, c } = effect.act {
                let apart = x[p] - x[q];
                place[p] = x[q] + apart.signum() * (apart.abs() - c).max(0.0);
            }
        }
        (self.plant.flow)(parameters, &place[..n], applied, t, &mut d[..n]);
        for (effect, &slot) in self.effects.iter().zip(&self.slots) {
            d[effect.state] += effect.act.added(t, &x[..n], applied) + effect.act.hidden_flow(slot, x, d);
        }
        for effect in self.effects {
            if let Act::Inertia { c } = effect.act {
                d[effect.state] /= 1.0 + c;
            }
        }
    }

    /// The parameters where an effect changes one with the states.
    fn changed(&self, x: &Values) -> Option<Vec<f64>> {
        let mut changed = None;
        for (effect, &slot) in self.effects.iter().zip(&self.slots) {
            let (index, factor) = match effect.act {
                Act::Saturating { index, z, h } => (index, 1.0 / (1.0 + h * x[z])),
                Act::Slipping { index, z, q } => (index, 1.0 / (1.0 + q * x[z] * x[z]).sqrt()),
                Act::Warming { index, c, .. } => (index, 1.0 + c * x[slot]),
                _ => continue,
            };
            changed.get_or_insert_with(|| self.parameters.clone())[index] *= factor;
        }
        changed
    }

    /// The derivative of the states at a point, in motion; for statistics.
    pub fn derivative(&self, t: f64, x: &[f64], u: &[f64]) -> Vec<f64> {
        let mut full = [0.0; WIDTH];
        full[..x.len()].copy_from_slice(x);
        let mut d = [0.0; WIDTH];
        self.smooth(t, &full, u, &mut d);
        if let Some((row, law)) = self.friction {
            let v = x[row];
            d[row] -= v.signum() * law.level(v, v, x, u);
        }
        d[..x.len()].to_vec()
    }

    /// Mode that the friction takes at rest: it holds while the other forces stay below its static level.
    fn at_rest(&self, t: f64, x: &Values, u: &[f64]) -> Mode {
        let Some((row, law)) = self.friction else { return Mode::Slip(1.0) };
        let force = self.force(t, x, u, row);
        let n = self.plant.states.len();
        if force.abs() <= law.level(0.0, force, &x[..n], u) { Mode::Stick } else { Mode::Slip(force.signum()) }
    }

    fn force(&self, t: f64, x: &Values, u: &[f64], row: usize) -> f64 {
        let mut d = [0.0; WIDTH];
        self.smooth(t, x, u, &mut d);
        d[row]
    }

    /// Integrates over one piece on which the inputs are `value + slope (t - from)`.
    #[allow(clippy::too_many_arguments)]
    fn piece(
        &self,
        integrator: &mut Integrator,
        mode: &mut Mode,
        from: f64,
        to: f64,
        value: &[f64],
        slope: &[f64],
        x: &mut Values,
    ) -> Option<()> {
        let m = value.len();
        let n = self.plant.states.len();
        let input = |t: f64| {
            let mut u = [0.0; 4];
            for j in 0..m {
                u[j] = value[j] + slope[j] * (t - from);
            }
            u
        };
        let Some((row, law)) = self.friction else {
            let flow = |t: f64, x: &Values, d: &mut Values| self.smooth(t, x, &input(t)[..m], d);
            return (integrator.advance(&flow, None, from, to, x) == Stop::End).then_some(());
        };
        let mut t = from;
        // The input may have jumped: what was stuck may break loose here.
        if *mode == Mode::Stick {
            *mode = self.at_rest(t, x, &input(t)[..m]);
        }
        for _ in 0..10_000 {
            let stop = match *mode {
                Mode::Slip(sign) => {
                    let flow = |t: f64, x: &Values, d: &mut Values| {
                        let u = input(t);
                        self.smooth(t, x, &u[..m], d);
                        d[row] -= sign * law.level(x[row], sign, &x[..n], &u[..m]);
                    };
                    let moving = |_: f64, x: &Values| sign * x[row];
                    integrator.advance(&flow, Some(&moving), t, to, x)
                }
                Mode::Stick => {
                    let flow = |t: f64, x: &Values, d: &mut Values| {
                        self.smooth(t, x, &input(t)[..m], d);
                        d[row] = 0.0;
                    };
                    let holding = |t: f64, x: &Values| {
                        let u = input(t);
                        let force = self.force(t, x, &u[..m], row);
                        law.level(0.0, force, &x[..n], &u[..m]) - force.abs()
                    };
                    integrator.advance(&flow, Some(&holding), t, to, x)
                }
            };
            match stop {
                Stop::End => return Some(()),
                Stop::Diverged => return None,
                Stop::Event(at) => {
                    t = at;
                    x[row] = 0.0;
                    let was = *mode;
                    *mode = self.at_rest(t, x, &input(t)[..m]);
                    if was == Mode::Stick && *mode == Mode::Stick {
                        // Landed within rounding of the edge: it is the edge.
                        *mode = Mode::Slip(self.force(t, x, &input(t)[..m], row).signum());
                    }
                    if t >= to {
                        return Some(());
                    }
                }
            }
        }
        None
    }

    /// Runs the machine; `None` when it diverges.
    pub fn run(&self, setup: &Setup) -> Option<Trace> {
        let (n, m) = (self.plant.states.len(), self.plant.controls.len());
        let times = &setup.times;
        let mut x = [0.0; WIDTH];
        x[..n].copy_from_slice(&setup.start);
        let mut trace = Trace { states: Vec::new(), readings: Vec::new(), controls: Vec::new() };
        let mut integrator = Integrator::new(self.width, self.tolerance, &self.scale);
        let mut mode = Mode::Slip(1.0);
        let mut play: Vec<f64> = vec![0.0; m];
        let mut limited: Vec<f64> = vec![0.0; m];
        // What a late sensor shows: the state, the times that it shows, how many are known, their values.
        let mut late: Vec<(usize, Vec<f64>, usize, Vec<f64>)> = Vec::new();
        for effect in self.effects {
            match effect.act {
                Act::Sensor { law: Sensor::Delay { tau } } => {
                    late.push((effect.state, times.iter().map(|s| s - tau).collect(), 0, Vec::new()));
                }
                Act::Sensor { law: Sensor::Clock { slow } } => {
                    let seen = times.iter().map(|s| (1.0 - slow) * s);
                    late.push((effect.state, seen.collect(), 0, Vec::new()));
                }
                _ => {}
            }
        }
        for (k, &now) in times.iter().enumerate() {
            let mut reading: Vec<f64> = x[..n].to_vec();
            for (effect, &slot) in self.effects.iter().zip(&self.slots) {
                if let Act::Sensor { law } = effect.act {
                    match law {
                        Sensor::Bias { c } => reading[effect.state] += c,
                        Sensor::Scale { c } => reading[effect.state] *= 1.0 + c,
                        Sensor::Filter { .. } if k == 0 => x[slot] = x[effect.state],
                        Sensor::Filter { .. } => reading[effect.state] = x[slot],
                        Sensor::Delay { .. } | Sensor::Clock { .. } => {}
                    }
                }
            }
            for (state, seen, next, values) in &mut late {
                // Until the delay has passed the sensor shows the start.
                while seen.get(*next).is_some_and(|s| *s <= times[0]) {
                    values.push(setup.start[*state]);
                    *next += 1;
                }
                reading[*state] = values[k];
            }
            let command = self.command(setup, k, &reading);
            trace.states.push(x[..n].to_vec());
            trace.readings.push(reading);
            trace.controls.push(command);
            if k == 0 {
                for (effect, &slot) in self.effects.iter().zip(&self.slots) {
                    match effect.act {
                        Act::Actuator { control, law: Actuator::Lag { .. } } => x[slot] = trace.controls[0][control],
                        Act::Resonance { position, velocity, .. } => {
                            (x[slot], x[slot + 1]) = (x[position], x[velocity]);
                        }
                        _ => {}
                    }
                }
                limited.copy_from_slice(&trace.controls[0]);
                // A play starts in its middle: what comes out is what goes in.
                play.copy_from_slice(&trace.controls[0]);
                if let Some((row, _)) = self.friction {
                    let u = trace.controls[0].clone();
                    mode = if x[row] == 0.0 { self.at_rest(now, &x, &u) } else { Mode::Slip(x[row].signum()) };
                }
            }
            let Some(&end) = times.get(k + 1) else { break };
            let mut from = now;
            while from < end {
                let tiny = 1e-12 * (1.0 + end.abs());
                let mut to = end;
                let mut cut = |at: f64| {
                    if at > from + tiny && at < to - tiny {
                        to = at;
                    }
                };
                for effect in self.effects {
                    match effect.act {
                        Act::Step { t0, .. } => cut(t0),
                        Act::Actuator { law: Actuator::Delay { tau }, .. } => {
                            let first = times.partition_point(|&s| s + tau <= from + tiny);
                            if let Some(&s) = times[..=k].get(first) {
                                cut(s + tau);
                            }
                        }
                        _ => {}
                    }
                }
                for (_, seen, next, _) in &late {
                    if let Some(&s) = seen.get(*next) {
                        cut(s);
                    }
                }
                let (mut value, mut slope) = (vec![0.0; m], vec![0.0; m]);
                for j in 0..m {
                    (value[j], slope[j]) = self.applied(setup, &trace.controls, k, j, from + tiny, &mut play[j]);
                    if let Some(rate) = self.rate(j) {
                        let ahead = value[j] - limited[j];
                        if ahead.abs() > 1e-12 * (1.0 + value[j].abs()) {
                            let hit = from + ahead.abs() / rate;
                            if hit > from + tiny && hit < to - tiny {
                                to = hit;
                            }
                            (value[j], slope[j]) = (limited[j], rate * ahead.signum());
                        }
                    }
                }
                self.piece(&mut integrator, &mut mode, from, to, &value, &slope, &mut x)?;
                for j in 0..m {
                    limited[j] = value[j] + slope[j] * (to - from);
                }
                for (state, seen, next, values) in &mut late {
                    while seen.get(*next).is_some_and(|s| *s <= to + tiny) {
                        values.push(x[*state]);
                        *next += 1;
                    }
                }
                from = if (end - to).abs() <= tiny { end } else { to };
            }
        }
        Some(trace)
    }
}

/// The rows in which a variable acts: where the nominal derivative moves when it moves, found by trying.
pub fn rows_of(plant: &Plant, variable: Variable, points: &[(Vec<f64>, Vec<f64>)]) -> Vec<usize> {
    let n = plant.states.len();
    let mut rows = vec![false; n];
    for (x, u) in points {
        let (mut p, mut x1, mut u1) = (plant.values(), x.clone(), u.clone());
        let (mut before, mut after) = (vec![0.0; n], vec![0.0; n]);
        (plant.flow)(&p, x, u, 0.0, &mut before);
        match variable {
            Variable::State(i) => x1[i] += 1e-3 * (1.0 + x[i].abs()),
            Variable::Control(j) => u1[j] += 1e-3 * (1.0 + u[j].abs()),
            Variable::Parameter(k) => p[k] *= 1.01,
        }
        (plant.flow)(&p, &x1, &u1, 0.0, &mut after);
        for i in 0..n {
            rows[i] |= (after[i] - before[i]).abs() > 1e-12 * (1.0 + before[i].abs());
        }
    }
    (0..n).filter(|&i| rows[i]).collect()
}
