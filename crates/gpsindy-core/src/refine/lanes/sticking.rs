//! Rollouts in which dry friction holds states at rest: steps that end where a mode changes, in every lane its own.
//!
//! Within a step no mode changes, so outputs are smooth in the parameters between two changes, and a finite difference
//! across lanes goes through a change as the exact derivative does.

use super::{Lanes, Node, Roll, sums};
use crate::model::sticking::{Kept, Mode, Slots};
use crate::refine::history::Stages;

/// Most changes of mode within one step of one lane; beyond, the step is finished as it is.
const MOST_CHANGES: usize = 8;

/// Classical Runge-Kutta: how far each stage looks ahead, and its weight in the sum.
const STAGES: [(f64, f64); 4] = [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)];

/// One step of every lane, of lengths of their own.
pub(super) struct Trial<const L: usize> {
    end: Vec<[f64; L]>,
    stage: Vec<[f64; L]>,
    sum: Vec<[f64; L]>,
    rate: Vec<[f64; L]>,
    /// Rates at the start and at the last stage.
    start_rate: Vec<[f64; L]>,
    /// Value of every slot at the start, the middle and the end, where it is held.
    forces: Vec<Stages<L>>,
}

/// Where a mode changes within a step: the share of the step, the slot, and what it becomes where it was held.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Change {
    share: f64,
    slot: usize,
    let_go: Option<Mode>,
}

impl<const L: usize> Trial<L> {
    pub(super) fn new(slots: &Slots<'_, L>, n: usize) -> Self {
        let zeros = || vec![[0.0; L]; n];
        Self {
            end: zeros(),
            stage: zeros(),
            sum: zeros(),
            rate: zeros(),
            start_rate: zeros(),
            forces: vec![[[0.0; L]; 3]; slots.count()],
        }
    }
}

/// One step of every lane from `a` over `step`, s, in modes that nothing decided beforehand.
#[inline(always)]
pub(super) fn step<S: pulp::Simd, const L: usize>(
    simd: S,
    slots: &mut Slots<'_, L>,
    (a, step): (f64, f64),
    x: &mut [[f64; L]],
    inputs: &[Stages<L>],
    trial: &mut Trial<L>,
) {
    slots.open();
    begin(simd, slots, [a; L], x, inputs, [0.0; L], trial);
    across(simd, slots, (a, step), x, inputs, trial);
}

impl<const L: usize> Lanes<'_, L> {
    /// As [`Lanes::integrate`], with slots that hold.
    #[inline(always)]
    pub(super) fn integrate_holding<S: pulp::Simd>(
        &mut self,
        simd: S,
        slots: &mut Slots<'_, L>,
        roll: Roll<'_, L>,
        inputs: &mut [Stages<L>],
    ) {
        let Roll { span: (first, last), initial, substeps, columns, receive } = roll;
        let log = self.log;
        let mut x = initial.to_vec();
        let mut trial = Trial::new(slots, x.len());
        let mut nodes: Vec<Node<L>> = Vec::new();
        for sample in first..=last {
            let t = log.time[sample];
            let is_last = sample == last;
            let step = self.step_behind(sample) / substeps as f64;
            for part in 0..if is_last { 1 } else { substeps } {
                let a = t + step * part as f64;
                self.load_inputs(inputs, sample, a, a + step);
                slots.open();
                begin(simd, slots, [a; L], &x, inputs, [0.0; L], &mut trial);
                if !self.late.is_empty() {
                    let dx = trial.start_rate.clone();
                    nodes.push(Node { t: a, x: x.clone(), dx, dx_end: Vec::new() });
                }
                if part == 0 {
                    self.show(simd, columns, sample, t, &x, inputs, &nodes, receive);
                }
                if is_last {
                    return;
                }
                across(simd, slots, (a, step), &mut x, inputs, &mut trial);
                if let Some(node) = nodes.last_mut() {
                    node.dx_end.clone_from(&trial.rate);
                }
            }
        }
    }
}

/// Rates at the start of a step, in the modes that hold from there on.
#[inline(always)]
fn begin<S: pulp::Simd, const L: usize>(
    simd: S,
    slots: &mut Slots<'_, L>,
    t: [f64; L],
    x: &[[f64; L]],
    inputs: &[Stages<L>],
    share: [f64; L],
    trial: &mut Trial<L>,
) {
    slots.rates(simd, t, x, inputs.iter().map(|stages| between(stages, share)), true, &mut trial.start_rate);
    for (slot, forces) in trial.forces.iter_mut().enumerate() {
        forces[0] = std::array::from_fn(|lane| slots.force(slot, lane).0);
    }
}

/// All lanes from `a` over `step` (s), through every change of mode; the rates at the start are there.
#[inline(always)]
fn across<S: pulp::Simd, const L: usize>(
    simd: S,
    slots: &mut Slots<'_, L>,
    (a, step): (f64, f64),
    x: &mut [[f64; L]],
    inputs: &[Stages<L>],
    trial: &mut Trial<L>,
) {
    let mut done = [0.0; L];
    for round in 0..=MOST_CHANGES {
        let left: [f64; L] = std::array::from_fn(|lane| step - done[lane]);
        if round > 0 {
            let t = std::array::from_fn(|lane| a + done[lane]);
            begin(simd, slots, t, x, inputs, done.map(|d| d / step), trial);
        }
        attempt(simd, slots, (a, step), (done, left), x, inputs, trial);
        let mut changes = [None; L];
        for lane in 0..L {
            if left[lane] > 0.0 && round < MOST_CHANGES {
                changes[lane] = first_change(slots, lane, left[lane], x, trial);
            }
        }
        if changes.iter().all(Option::is_none) {
            finish(slots, x, trial, [true; L]);
            return;
        }
        let length = std::array::from_fn(|lane| changes[lane].map_or(left[lane], |c: Change| c.share * left[lane]));
        attempt(simd, slots, (a, step), (done, length), x, inputs, trial);
        for lane in 0..L {
            let before = done[lane];
            done[lane] = if changes[lane].is_some() { before + length[lane] } else { step };
        }
        // Those without a change have come to the end of the step.
        let stayed: [bool; L] = std::array::from_fn(|lane| changes[lane].is_none());
        finish(slots, x, trial, stayed);
        for (lane, change) in changes.iter().enumerate() {
            let Some(change) = change else { continue };
            let state = slots.state(change.slot);
            // A state that leaves zero the wrong way did not leave it.
            let turns_back = x[state][lane] == 0.0 && change.let_go.is_none() && change.share == 0.0;
            let kept = match change.let_go {
                Some(mode) => Kept::LetGo(mode),
                None if turns_back => Kept::Held,
                None => Kept::Open,
            };
            for (value, end) in x.iter_mut().zip(&trial.end) {
                value[lane] = end[lane];
            }
            if change.let_go.is_none() {
                x[state][lane] = 0.0;
            }
            slots.keep(change.slot, lane, kept);
        }
    }
}

/// A Runge-Kutta step of `length` from where every lane has `done` its part of the step from `a` over `step`.
#[inline(always)]
fn attempt<S: pulp::Simd, const L: usize>(
    simd: S,
    slots: &mut Slots<'_, L>,
    (a, step): (f64, f64),
    (done, length): ([f64; L], [f64; L]),
    x: &[[f64; L]],
    inputs: &[Stages<L>],
    trial: &mut Trial<L>,
) {
    let Trial { end, stage, sum, rate, start_rate, forces } = trial;
    rate.copy_from_slice(start_rate);
    sum.copy_from_slice(start_rate);
    for (number, (ahead, weight)) in STAGES.into_iter().enumerate().skip(1) {
        sums::ahead(simd, x, (&length.map(|l| ahead * l), rate), stage);
        let t = std::array::from_fn(|lane| a + done[lane] + ahead * length[lane]);
        let share = std::array::from_fn(|lane| (done[lane] + ahead * length[lane]) / step);
        slots.rates(simd, t, stage, inputs.iter().map(|stages| between(stages, share)), false, rate);
        sums::add(simd, sum, &[weight; L], rate);
        for (slot, forces) in forces.iter_mut().enumerate() {
            for lane in 0..L {
                let force = slots.force(slot, lane).0;
                match number {
                    1 => forces[1][lane] = 0.5 * force,
                    2 => forces[1][lane] += 0.5 * force,
                    _ => forces[2][lane] = force,
                }
            }
        }
    }
    sums::ahead(simd, x, (&length.map(|l| l / 6.0), sum), end);
}

/// Value of an input at a share of the step, by straight lines through what it is at the start, the middle and the end.
fn between<const L: usize>(stages: &Stages<L>, share: [f64; L]) -> [f64; L] {
    std::array::from_fn(|lane| {
        let [start, middle, end] = stages.map(|stage| stage[lane]);
        let twice = 2.0 * share[lane];
        if twice < 1.0 { start + twice * (middle - start) } else { middle + (twice - 1.0) * (end - middle) }
    })
}

/// The lanes that `stayed` in their modes at the end of their step.
fn finish<const L: usize>(slots: &Slots<'_, L>, x: &mut [[f64; L]], trial: &Trial<L>, stayed: [bool; L]) {
    for (value, end) in x.iter_mut().zip(&trial.end) {
        for lane in (0..L).filter(|&lane| stayed[lane]) {
            value[lane] = end[lane];
        }
    }
    // Where no more changes were looked for, none may be left behind.
    for slot in 0..slots.count() {
        let state = slots.state(slot);
        for lane in (0..L).filter(|&lane| stayed[lane]) {
            let is_beyond = match slots.mode(slot, lane) {
                Mode::Forward => x[state][lane] < 0.0,
                Mode::Backward => x[state][lane] > 0.0,
                Mode::Smooth | Mode::Held => false,
            };
            if is_beyond {
                x[state][lane] = 0.0;
            }
        }
    }
}

/// The first change of mode of a lane within a step of `length` (s).
fn first_change<const L: usize>(
    slots: &Slots<'_, L>,
    lane: usize,
    length: f64,
    x: &[[f64; L]],
    trial: &Trial<L>,
) -> Option<Change> {
    let change = |slot: usize| {
        let state = slots.state(slot);
        let (share, let_go) = match slots.mode(slot, lane) {
            Mode::Smooth => return None,
            Mode::Held if slots.kept(slot, lane) == Kept::Held => return None,
            Mode::Held => {
                let reach = slots.force(slot, lane).1;
                let values = trial.forces[slot].map(|force| force[lane]);
                let (share, is_above) = leaves(values, reach)?;
                // The value that holds is beyond its reach on the side to which the state then moves.
                (share, Some(if is_above { Mode::Forward } else { Mode::Backward }))
            }
            mode => {
                let side = if mode == Mode::Forward { 1.0 } else { -1.0 };
                let ends = [side * x[state][lane], side * trial.end[state][lane]];
                let rises = [&trial.start_rate, &trial.rate].map(|rate| side * length * rate[state][lane]);
                (falls_to_zero(ends, rises)?, None)
            }
        };
        Some(Change { share, slot, let_go })
    };
    (0..slots.count()).filter_map(change).min_by(|a, b| a.share.total_cmp(&b.share))
}

/// Where a value that is within `reach` at the start of a step leaves it, by the parabola through its start, middle and
/// end; and whether it does so upwards.
fn leaves([start, middle, end]: [f64; 3], reach: f64) -> Option<(f64, bool)> {
    let (slope, bend) = (4.0 * middle - 3.0 * start - end, 2.0 * (start + end) - 4.0 * middle);
    let crossing = |bound: f64| {
        let room = start - bound;
        // Roots of room + slope s + bend s^2, without cancellation.
        let square = slope * slope - 4.0 * bend * room;
        if square < 0.0 {
            return None;
        }
        let q = -0.5 * (slope + square.sqrt().copysign(slope));
        let roots = [q / bend, room / q].into_iter().filter(|s| (0.0..=1.0).contains(s));
        roots.min_by(f64::total_cmp)
    };
    let up = (end > reach || middle > reach).then(|| crossing(reach)).flatten();
    let down = (end < -reach || middle < -reach).then(|| crossing(-reach)).flatten();
    match (up, down) {
        (Some(up), Some(down)) if down < up => Some((down, false)),
        (Some(up), _) => Some((up, true)),
        (None, down) => down.map(|share| (share, false)),
    }
}

/// Where the cubic with values `[y0, y1]` and slopes `[d0, d1]` at the ends of a step, not below zero at its start, first
/// falls to zero behind it.
fn falls_to_zero([y0, y1]: [f64; 2], [d0, d1]: [f64; 2]) -> Option<f64> {
    let rise = y1 - y0;
    let (c2, c3) = (3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise);
    // From zero itself on, the root there is left out.
    let at_rest = y0 == 0.0;
    if at_rest && d0 <= 0.0 {
        return (y1 <= 0.0).then_some(0.0);
    }
    let value = |s: f64| if at_rest { d0 + s * (c2 + s * c3) } else { y0 + s * (d0 + s * (c2 + s * c3)) };
    let slope = |s: f64| if at_rest { c2 + 2.0 * s * c3 } else { d0 + s * (2.0 * c2 + 3.0 * s * c3) };
    let end = if at_rest { y1.min(value(1.0)) } else { y1 };
    // Up to its end, or to a dip before it.
    let mut high = 1.0;
    if end > 0.0 {
        let (mut fall, mut climb) = (0.0, 1.0);
        if slope(fall) >= 0.0 || slope(climb) <= 0.0 {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (fall + climb);
            if slope(middle) < 0.0 { fall = middle } else { climb = middle }
        }
        high = climb;
        if value(high) > 0.0 {
            return None;
        }
    }
    let mut low = 0.0;
    let mut s = high;
    for _ in 0..80 {
        let next = s - value(s) / slope(s);
        let moved = if next > low && next < high { next } else { 0.5 * (low + high) };
        if value(moved) > 0.0 {
            low = moved
        } else {
            high = moved
        }
        if (moved - s).abs() <= 2.0 * f64::EPSILON {
            return Some(moved);
        }
        s = moved;
    }
    Some(high)
}
