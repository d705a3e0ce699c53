//! The controls of a run between its samples, passed through the delays, plays, rate limits and sample-and-holds of the model.
//!
//! A held control jumps at its samples, a delayed one `tau` later; an integrator must stop there. The
//! excitation knows these break points, and between two of them it gives smooth signals.

use crate::data::{Channel, Hold, Run};
use crate::error::{Error, Result};
use crate::model::{InputKind, ROUNDING, SHORTEST_HOLD, System, caught_after, sampled_at, slewed};
use faer::{Mat, MatRef};

/// A moment: the time that expressions see, and the time at which held signals are looked up.
///
/// Inside a segment without break points every held signal is looked up at the segment's middle, so
/// that rounding at its ends can't pick a neighbour's value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) time: f64,
    pub(super) lookup: f64,
}

impl Moment {
    /// The earlier moment, but not before `first`, where the signals begin.
    fn earlier(self, tau: f64, first: f64) -> Self {
        let moment = Self { time: self.time - tau, lookup: self.lookup - tau };
        if moment.lookup < first { Self { time: first, lookup: first } } else { moment }
    }
}

#[derive(Debug, Clone)]
struct History {
    kind: InputKind,
    /// Delay (s), width of the play, largest rate, or period (s).
    amount: f64,
    /// A moment at which a sample-and-hold samples, s.
    phase: f64,
    /// Where this input has a jump or a corner, s.
    knots: Vec<f64>,
    /// Output of the play or of the rate limit at each knot, coming from the left.
    output: Vec<f64>,
    /// What the rate limit follows just after each knot, and by how much that changes in a second.
    followed: Vec<[f64; 2]>,
}

/// The controls of one run as functions of time.
///
/// Before the first sample the first sample holds, after the last the last. A missing cell is held
/// from the last known value (a missing start from the first known one).
#[derive(Debug, Clone)]
pub struct Excitation {
    time: Vec<f64>,
    /// One list of r samples a control, without gaps.
    controls: Vec<Vec<f64>>,
    hold: Hold,
    parameters: Vec<f64>,
    histories: Vec<History>,
    breaks: Vec<f64>,
    varies: bool,
    /// Median sampling step, s; 1 for a single sample.
    period: f64,
}

impl Excitation {
    /// Prepares the controls `controls` (r x m, columns in the model's order, NaN is missing) sampled at `time` (s).
    ///
    /// # Errors
    /// Sizes that do not fit, a control without any value, a delay that is not finite.
    pub fn new(system: &System, time: &[f64], controls: MatRef<'_, f64>, hold: Hold) -> Result<Self> {
        let (r, m) = (time.len(), system.n_controls());
        if controls.nrows() != r || controls.ncols() != m || r == 0 {
            return Err(Error::shape(
                "controls",
                format!("{} x {m} (samples x controls)", r.max(1)),
                format!("{} x {}", controls.nrows(), controls.ncols()),
            ));
        }
        let mut filled = Vec::with_capacity(m);
        for (j, control) in system.model().controls.iter().enumerate() {
            let column: Vec<f64> = (0..r).map(|i| controls[(i, j)]).collect();
            filled.push(hold_missing(&column).ok_or_else(|| {
                Error::data(format!("control `{}` has no value in the whole run; log it or fix it", control.name))
            })?);
        }
        let mut excitation = Self {
            time: time.into(),
            controls: filled,
            hold,
            parameters: system.parameter_values(),
            histories: Vec::new(),
            breaks: Vec::new(),
            varies: hold == Hold::Linear && m > 0,
            period: median_step(time),
        };
        for index in 0..system.inputs().len() {
            excitation.add_history(system, index)?;
        }
        excitation.breaks = excitation.breaks_of_rates(system);
        Ok(excitation)
    }

    /// How far back, in s, the rates depend on the controls; infinite where a play or a rate limit does.
    pub(super) fn memory(&self) -> f64 {
        let of = |history: &History| match history.kind {
            InputKind::Delay | InputKind::SampleHold => history.amount.max(0.0),
            InputKind::Play | InputKind::Slew => f64::INFINITY,
        };
        // A delayed delay adds up.
        self.histories.iter().map(of).sum()
    }

    /// Takes the model's controls out of a run by their names.
    ///
    /// # Errors
    /// As [`Excitation::new`], and a control that the log does not carry.
    pub fn of_run(system: &System, run: &Run, channels: &[Channel], hold: Hold) -> Result<Self> {
        let mut columns = Vec::new();
        for control in &system.model().controls {
            let found = channels.iter().position(|c| c.name == control.name);
            columns
                .push(found.ok_or_else(|| Error::unknown("control", &control.name, channels.iter().map(|c| &c.name)))?);
        }
        let controls = Mat::from_fn(run.n_samples(), columns.len(), |i, j| run.values[(i, columns[j])]);
        Self::new(system, &run.time, controls.as_ref(), hold)
    }

    /// The same controls for another system that has them too.
    pub(super) fn for_system(&self, system: &System) -> Result<Self> {
        let controls = Mat::from_fn(self.time.len(), self.controls.len(), |i, j| self.controls[j][i]);
        Self::new(system, &self.time, controls.as_ref(), self.hold)
    }

    /// The controls at the first sample.
    pub(super) fn first_controls(&self) -> impl Iterator<Item = f64> {
        self.controls.iter().filter_map(|c| c.first().copied())
    }

    /// The controls at the samples, one list a control, without gaps.
    pub(super) fn controls(&self) -> &[Vec<f64>] {
        &self.controls
    }

    /// What they do between the samples.
    pub(super) fn hold(&self) -> Hold {
        self.hold
    }

    /// Sample times, s.
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Times inside the run at which the rates may jump or bend, s, increasing.
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// Whether the signals change between break points.
    pub(super) fn varies(&self) -> bool {
        self.varies
    }

    /// Median sampling step, s (1 for a single sample).
    pub(super) fn period(&self) -> f64 {
        self.period
    }

    /// A moment in the segment from `a` to `b`, which no break point divides.
    pub(super) fn moment(&self, t: f64, a: f64, b: f64) -> Moment {
        let lookup = if self.hold == Hold::Zero { 0.5 * (a + b) } else { t };
        Moment { time: t, lookup }
    }

    /// The moment of a sample: a control that switches there has its new value.
    pub(super) fn sample_moment(&self, t: f64) -> Moment {
        let nudge = if self.hold == Hold::Zero { 1e-9 * self.period() } else { 0.0 };
        Moment { time: t, lookup: t + nudge }
    }

    /// The controls (m) and the inputs with a history (h) at a moment, into the first m + h places of `signals`.
    pub(super) fn signals(&self, system: &System, moment: Moment, signals: &mut Vec<f64>) {
        signals.clear();
        signals.extend((0..self.controls.len()).map(|j| self.control(j, moment.lookup)));
        signals.extend((0..self.histories.len()).map(|index| self.value(system, index, moment)));
    }

    fn control(&self, j: usize, at: f64) -> f64 {
        let values = &self.controls[j];
        let next = self.time.partition_point(|&t| t <= at);
        if next == 0 {
            return values[0];
        }
        if self.hold == Hold::Zero || next == values.len() {
            return values[next - 1];
        }
        let (t0, t1) = (self.time[next - 1], self.time[next]);
        let share = (at - t0) / (t1 - t0);
        values[next - 1] + share * (values[next] - values[next - 1])
    }

    /// The signal that input `index` delays or plays with.
    fn signal(&self, system: &System, index: usize, moment: Moment) -> f64 {
        let tape = &system.inputs()[index].tape;
        let m = self.controls.len();
        let mut variables: Vec<f64> = (0..m).map(|j| self.control(j, moment.lookup)).collect();
        variables.extend((0..index).map(|i| if tape.reads(m + i) { self.value(system, i, moment) } else { 0.0 }));
        variables.extend_from_slice(&self.parameters);
        tape.evaluate_once(&variables, moment.time)[0]
    }

    /// The output of input `index`.
    fn value(&self, system: &System, index: usize, moment: Moment) -> f64 {
        let history = &self.histories[index];
        match history.kind {
            InputKind::Delay => self.signal(system, index, moment.earlier(history.amount, self.time[0])),
            InputKind::SampleHold => {
                let sampled = sampled_at(moment.lookup, history.phase, history.amount);
                // A control that switches at the very moment has its new value.
                let nudge = if self.hold == Hold::Zero { ROUNDING * history.amount } else { 0.0 };
                let moment = Moment { time: sampled, lookup: sampled + nudge };
                self.signal(system, index, moment.earlier(0.0, self.time[0]))
            }
            InputKind::Play => {
                let moment = moment.earlier(0.0, self.time[0]);
                let signal = self.signal(system, index, moment);
                let passed = history.knots.partition_point(|&t| t <= moment.lookup);
                let before = history.output[passed.max(1) - 1];
                play(before, signal, history.amount)
            }
            InputKind::Slew => {
                let Moment { time, lookup } = moment.earlier(0.0, self.time[0]);
                let last = history.knots.partition_point(|&t| t <= lookup).max(1) - 1;
                let [signal, slope] = history.followed[last];
                slewed(history.output[last], signal, slope, history.amount, (time - history.knots[last]).max(0.0))
            }
        }
    }

    fn add_history(&mut self, system: &System, index: usize) -> Result<()> {
        let input = &system.inputs()[index];
        let m = self.controls.len();
        let mut variables = vec![0.0; m + index];
        variables.extend_from_slice(&self.parameters);
        let outputs = input.tape.evaluate_once(&variables, 0.0);
        let (mut amount, phase) = (outputs[1], outputs.get(2).copied().unwrap_or(0.0));
        if !(amount.is_finite() && phase.is_finite()) {
            let what = match input.kind {
                InputKind::Delay => "a delay",
                InputKind::Play => "the width of a play",
                InputKind::Slew => "the rate of a rate limit",
                InputKind::SampleHold => "the period or phase of a sample-and-hold",
            };
            return Err(Error::NotFinite { what: format!("{what} of model `{}`", system.model().name) });
        }
        let mut knots = vec![self.time[0]];
        for j in (0..m).filter(|&j| input.tape.reads(j)) {
            knots.extend(self.control_knots(j));
        }
        for i in (0..index).filter(|&i| input.tape.reads(m + i)) {
            knots.extend_from_slice(&self.histories[i].knots);
        }
        self.varies |= input.tape.reads(input.tape.n_variables());
        let mut knots = self.tidy(knots);
        if input.kind == InputKind::SampleHold && amount < SHORTEST_HOLD * self.period {
            if amount < 0.0 {
                return Err(Error::range("the period of a sample-and-hold", "0 or more", amount));
            }
            // The signal itself.
            amount = 0.0;
        }
        let (output, followed) = (Vec::new(), Vec::new());
        let mut history = History { kind: input.kind, amount, phase, knots: Vec::new(), output, followed };
        match input.kind {
            InputKind::Delay => knots.iter_mut().for_each(|t| *t += amount),
            InputKind::SampleHold if amount > 0.0 => {
                let (first, last) = (sampled_at(self.time[0], phase, amount), self.time[self.time.len() - 1]);
                knots = (1..).map(|k| first + amount * f64::from(k)).take_while(|&t| t <= last).collect();
            }
            InputKind::SampleHold => {}
            InputKind::Play => {
                let first = self.time[0];
                let mut output = self.signal(system, index, Moment { time: first, lookup: first });
                for (i, &knot) in knots.iter().enumerate() {
                    history.output.push(output);
                    if let Some(&next) = knots.get(i + 1) {
                        output = play(output, self.signal(system, index, self.moment(next, knot, next)), amount);
                    }
                }
            }
            InputKind::Slew => {
                // It moves between the knots of what it follows.
                self.varies = true;
                history.amount = amount.abs();
                knots = self.follow(system, index, &knots, &mut history);
            }
        }
        history.knots = knots;
        self.histories.push(history);
        Ok(())
    }

    /// Takes a rate limit along the `knots` of what it follows; the result has those where it has caught up, too.
    fn follow(&self, system: &System, index: usize, knots: &[f64], history: &mut History) -> Vec<f64> {
        let (first, last) = (self.time[0], self.time[self.time.len() - 1]);
        let mut output = self.signal(system, index, Moment { time: first, lookup: first });
        let mut bent = Vec::new();
        for (i, &knot) in knots.iter().enumerate() {
            let end = knots.get(i + 1).copied().unwrap_or(last);
            let at = |t: f64| self.signal(system, index, self.moment(t, knot, end.max(knot)));
            let signal = at(knot);
            let slope = if end > knot { (at(end) - signal) / (end - knot) } else { 0.0 };
            let mut push = |t: f64, output: f64, signal: f64| {
                bent.push(t);
                history.output.push(output);
                history.followed.push([signal, slope]);
            };
            push(knot, output, signal);
            let caught = caught_after(output, signal, slope, history.amount);
            if caught > 0.0 && knot + caught < end {
                push(knot + caught, signal + slope * caught, signal + slope * caught);
            }
            output = slewed(output, signal, slope, history.amount, end - knot);
        }
        bent
    }

    /// Samples at which control `j` jumps or bends.
    fn control_knots(&self, j: usize) -> Vec<f64> {
        let values = &self.controls[j];
        let changes = |i: usize| i > 0 && i < values.len() && values[i] != values[i - 1];
        let knot = |&i: &usize| changes(i) || (self.hold == Hold::Linear && changes(i + 1));
        (0..values.len()).filter(knot).map(|i| self.time[i]).collect()
    }

    fn breaks_of_rates(&self, system: &System) -> Vec<f64> {
        let (n, m) = (system.n_states(), self.controls.len());
        let mut breaks = Vec::new();
        for j in (0..m).filter(|&j| system.rates().reads(n + j)) {
            breaks.extend(self.control_knots(j));
        }
        for (i, history) in self.histories.iter().enumerate() {
            if system.rates().reads(n + m + i) {
                breaks.extend_from_slice(&history.knots);
            }
        }
        self.tidy(breaks)
    }

    /// Sorted, and without near copies that only rounding makes.
    fn tidy(&self, mut times: Vec<f64>) -> Vec<f64> {
        times.sort_by(f64::total_cmp);
        let near = 1e-10 * self.period();
        times.dedup_by(|later, kept| *later - *kept <= near);
        times
    }
}

/// A play of total width `width`: the output moves only when the signal pushes it.
fn play(output: f64, signal: f64, width: f64) -> f64 {
    let half = 0.5 * width.max(0.0);
    output.max(signal - half).min(signal + half)
}

fn median_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

fn hold_missing(column: &[f64]) -> Option<Vec<f64>> {
    let mut last = column.iter().copied().find(|v| !v.is_nan())?;
    Some(
        column
            .iter()
            .map(|&value| {
                if !value.is_nan() {
                    last = value;
                }
                last
            })
            .collect(),
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
