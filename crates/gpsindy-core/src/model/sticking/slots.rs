//! The slots of several lanes: their modes, and the rates under them.

use super::Sticks;
use crate::model::System;
use nalgebra::DMatrix;
use pulp::Simd;

/// What a slot does in a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    /// A corner of some width: no mode at all.
    Smooth,
    /// Its state is above zero.
    Forward,
    /// Its state is below zero.
    Backward,
    /// Its state is held at zero.
    Held,
}

/// What is decided beforehand of a slot whose state is at zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kept {
    /// Its force decides.
    Open,
    /// It was let go into this mode.
    LetGo(Mode),
    /// It stays held, whatever its force.
    Held,
}

/// The slots of a system in `L` lanes.
pub(crate) struct Slots<'a, const L: usize> {
    system: &'a System,
    sticks: &'a Sticks,
    width: Vec<[f64; L]>,
    reach: Vec<[f64; L]>,
    /// Mode of every slot.
    modes: Vec<[Mode; L]>,
    kept: Vec<[Kept; L]>,
    registers: Vec<[f64; L]>,
    first: usize,
    /// Rates with every held slot at its lowest, then with one of them at its highest.
    table: Vec<Vec<[f64; L]>>,
    /// What each slot was when the table was made, and how far it is between its lowest and its highest.
    was_held: Vec<[bool; L]>,
    share: Vec<[f64; L]>,
    /// Value of every held slot that keeps its state at rest.
    force: Vec<[f64; L]>,
    /// Room for the equations of one lane.
    held: Vec<usize>,
    matrix: Vec<f64>,
}

impl<'a, const L: usize> Slots<'a, L> {
    /// At `parameters`, all of the system's; none where no slot holds in any lane.
    pub(crate) fn new(system: &'a System, parameters: &[[f64; L]]) -> Option<Self> {
        let sticks = system.sticks()?;
        let count = sticks.states.len();
        let mut bounds = sticks.bounds.registers::<L>();
        bounds[..parameters.len()].copy_from_slice(parameters);
        sticks.bounds.evaluate(&mut bounds);
        let width: Vec<[f64; L]> = (0..count).map(|k| sticks.bounds.output(&bounds, 2 * k)).collect();
        let reach = (0..count).map(|k| sticks.bounds.output(&bounds, 2 * k + 1)).collect();
        if !width.iter().flatten().any(|&w| w == 0.0) {
            return None;
        }
        let first = sticks.rates.n_variables() - count;
        let mut registers = sticks.rates.registers::<L>();
        registers[first - parameters.len()..first].copy_from_slice(parameters);
        Some(Self {
            system,
            sticks,
            width,
            reach,
            modes: vec![[Mode::Smooth; L]; count],
            kept: vec![[Kept::Open; L]; count],
            registers,
            first,
            table: vec![vec![[0.0; L]; system.n_states()]; 1 + count],
            was_held: vec![[false; L]; count],
            share: vec![[0.0; L]; count],
            force: vec![[0.0; L]; count],
            held: Vec::new(),
            matrix: Vec::new(),
        })
    }

    pub(crate) fn count(&self) -> usize {
        self.sticks.states.len()
    }

    /// The state of a slot.
    pub(crate) fn state(&self, slot: usize) -> usize {
        self.sticks.states[slot]
    }

    pub(crate) fn mode(&self, slot: usize, lane: usize) -> Mode {
        self.modes[slot][lane]
    }

    /// Value of a held slot at the last evaluation, and the largest that it can have.
    pub(crate) fn force(&self, slot: usize, lane: usize) -> (f64, f64) {
        (self.force[slot][lane], self.reach[slot][lane])
    }

    pub(crate) fn kept(&self, slot: usize, lane: usize) -> Kept {
        self.kept[slot][lane]
    }

    /// Decides beforehand what a slot does once its state is at zero.
    pub(crate) fn keep(&mut self, slot: usize, lane: usize, kept: Kept) {
        self.kept[slot][lane] = kept;
    }

    /// Forgets what was decided beforehand.
    pub(crate) fn open(&mut self) {
        self.kept.fill([Kept::Open; L]);
    }

    /// Rates `dx` (n) at times `t` (s), states `x` (n) and `inputs` (controls, then inputs with a history), in the present
    /// modes; where `decides`, in those that the states and their forces ask for.
    #[inline(always)]
    pub(crate) fn rates<S: Simd>(
        &mut self,
        simd: S,
        t: [f64; L],
        x: &[[f64; L]],
        inputs: impl Iterator<Item = [f64; L]>,
        decides: bool,
        dx: &mut [[f64; L]],
    ) {
        if decides {
            self.look(x);
        }
        let n = x.len();
        self.registers[..n].copy_from_slice(x);
        for (register, input) in self.registers[n..].iter_mut().zip(inputs) {
            *register = input;
        }
        let time = self.sticks.rates.n_variables();
        self.registers[time] = t;
        for slot in 0..self.count() {
            let z = x[self.state(slot)];
            for lane in 0..L {
                self.was_held[slot][lane] = self.modes[slot][lane] == Mode::Held;
                self.registers[self.first + slot][lane] = match self.modes[slot][lane] {
                    Mode::Smooth => (z[lane] / self.width[slot][lane]).tanh(),
                    Mode::Forward => 1.0,
                    Mode::Backward | Mode::Held => -1.0,
                };
            }
        }
        self.tabulate(simd, 0);
        for (j, rate) in dx.iter_mut().enumerate() {
            *rate = self.table[0][j];
        }
        if !self.was_held.iter().flatten().any(|&held| held) {
            return;
        }
        for slot in 0..self.count() {
            if !self.was_held[slot].contains(&true) {
                continue;
            }
            let before = self.registers[self.first + slot];
            self.registers[self.first + slot] =
                std::array::from_fn(|lane| if self.was_held[slot][lane] { 1.0 } else { before[lane] });
            self.tabulate(simd, 1 + slot);
            self.registers[self.first + slot] = before;
        }
        for lane in 0..L {
            self.balance(lane, decides);
            self.combine(lane, dx);
        }
    }

    #[inline(always)]
    fn tabulate<S: Simd>(&mut self, simd: S, row: usize) {
        let tape = &self.sticks.rates;
        self.system.evaluate(simd, tape, &mut self.registers);
        for (j, rate) in self.table[row].iter_mut().enumerate() {
            *rate = tape.output(&self.registers, j);
        }
    }

    /// Modes by the states alone.
    fn look(&mut self, x: &[[f64; L]]) {
        for slot in 0..self.count() {
            for lane in 0..L {
                let z = x[self.sticks.states[slot]][lane];
                self.modes[slot][lane] = match (z, self.kept[slot][lane]) {
                    _ if self.width[slot][lane] != 0.0 => Mode::Smooth,
                    (0.0, Kept::LetGo(mode)) => mode,
                    (0.0, _) => Mode::Held,
                    (z, _) if z < 0.0 => Mode::Backward,
                    _ => Mode::Forward,
                };
            }
        }
    }

    /// By how much the rate of `state` rises when `slot` goes from its lowest to its highest.
    fn rise(&self, state: usize, slot: usize, lane: usize) -> f64 {
        self.table[1 + slot][state][lane] - self.table[0][state][lane]
    }

    /// The values that hold, and where `decides` those let go that can't.
    ///
    /// Rates are straight lines in the slots, so the held ones solve a small linear system.
    fn balance(&mut self, lane: usize, decides: bool) {
        loop {
            self.solve(lane);
            if !decides {
                return;
            }
            let excess = |&slot: &usize| self.force[slot][lane].abs() - self.reach[slot][lane];
            let free = self.held.iter().copied().filter(|&slot| self.kept[slot][lane] != Kept::Held);
            let worst = free.max_by(|a, b| excess(a).total_cmp(&excess(b))).filter(|slot| excess(slot) > 0.0);
            let Some(slot) = worst else { return };
            // Friction takes energy out: a value above its reach is a push forward that it can't hold.
            let is_forward = (self.force[slot][lane] > 0.0) == (self.rise(self.state(slot), slot, lane) <= 0.0);
            self.modes[slot][lane] = if is_forward { Mode::Forward } else { Mode::Backward };
            self.share[slot][lane] = f64::from(is_forward);
        }
    }

    /// By how much a push on each rate moves all of them in the modes of the last evaluation (n x n, row after row): what is held
    /// takes up its own, and hands on what its force does to the others.
    pub(crate) fn yielding(&self, lane: usize) -> Vec<f64> {
        let n = self.table[0].len();
        let held: Vec<usize> = (0..self.count()).filter(|&slot| self.modes[slot][lane] == Mode::Held).collect();
        let m = held.len();
        let own = DMatrix::from_fn(m, m, |a, b| self.rise(self.state(held[a]), held[b], lane));
        let all = DMatrix::from_fn(n, m, |j, b| self.rise(j, held[b], lane));
        // A slot without any force takes up nothing.
        let forces = own.try_inverse().unwrap_or_else(|| DMatrix::zeros(m, m));
        let taken = all * forces;
        let unit = |i: usize| if i / n == i % n { 1.0 } else { 0.0 };
        let mut yielding: Vec<f64> = (0..n * n).map(unit).collect();
        for j in 0..n {
            for (b, &slot) in held.iter().enumerate() {
                yielding[j * n + self.state(slot)] -= taken[(j, b)];
            }
        }
        for &slot in &held {
            yielding[self.state(slot) * n..][..n].fill(0.0);
        }
        yielding
    }

    /// The states that a lane holds at rest.
    pub(crate) fn held(&self, lane: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.count()).filter(move |&slot| self.modes[slot][lane] == Mode::Held).map(|slot| self.state(slot))
    }

    /// Solves for the shares of the held slots of a lane, by elimination with pivots.
    fn solve(&mut self, lane: usize) {
        self.held.clear();
        for slot in 0..self.count() {
            if self.modes[slot][lane] == Mode::Held {
                self.held.push(slot);
            }
        }
        let m = self.held.len();
        let width = m + 1;
        self.matrix.clear();
        for row in 0..m {
            let state = self.state(self.held[row]);
            let mut rest = self.table[0][state][lane];
            for slot in (0..self.count()).filter(|&k| self.was_held[k][lane] && self.modes[k][lane] != Mode::Held) {
                rest += self.share[slot][lane] * self.rise(state, slot, lane);
            }
            for column in 0..m {
                let rise = self.rise(state, self.held[column], lane);
                self.matrix.push(rise);
            }
            self.matrix.push(-rest);
        }
        for pivot in 0..m {
            let largest = (pivot..m)
                .max_by(|&a, &b| self.matrix[a * width + pivot].abs().total_cmp(&self.matrix[b * width + pivot].abs()));
            let best = largest.unwrap_or(pivot);
            if best != pivot {
                (0..width).for_each(|c| self.matrix.swap(pivot * width + c, best * width + c));
            }
            let head = self.matrix[pivot * width + pivot];
            if head == 0.0 {
                continue;
            }
            for row in pivot + 1..m {
                let factor = self.matrix[row * width + pivot] / head;
                if factor != 0.0 {
                    for c in pivot..width {
                        self.matrix[row * width + c] -= factor * self.matrix[pivot * width + c];
                    }
                }
            }
        }
        for row in (0..m).rev() {
            let mut right = self.matrix[row * width + m];
            for c in row + 1..m {
                right -= self.matrix[row * width + c] * self.share[self.held[c]][lane];
            }
            let (head, slot) = (self.matrix[row * width + row], self.held[row]);
            // A slot without any force holds nothing.
            let (share, force) = match (head == 0.0, right == 0.0) {
                (false, _) => (right / head, 2.0 * right / head - 1.0),
                (true, true) => (0.5, 0.0),
                (true, false) => (0.5, -f64::INFINITY.copysign(right)),
            };
            self.share[slot][lane] = share;
            self.force[slot][lane] = force;
        }
    }

    /// The rates of a lane out of the table; what is held does not move at all.
    fn combine(&self, lane: usize, dx: &mut [[f64; L]]) {
        for slot in (0..self.count()).filter(|&k| self.was_held[k][lane]) {
            for (j, rate) in dx.iter_mut().enumerate() {
                rate[lane] += self.share[slot][lane] * self.rise(j, slot, lane);
            }
        }
        for &slot in &self.held {
            dx[self.state(slot)][lane] = 0.0;
        }
    }
}
