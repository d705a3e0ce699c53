//! Integrates from break point to break point: step control, stiffness, jumps, divergence.

mod fixed;

use super::dense::DenseStep;
use super::explicit::DormandPrince;
use super::holding::{Change, first_change};
use super::rates::Rates;
use super::rosenbrock::Rosenbrock;
use super::{Method, Simulate};
use crate::error::{Error, Result};
use crate::model::sticking::Kept;

/// Step control of Hairer's DOPRI5: safety, smallest and largest change of the step.
const SAFETY: f64 = 0.9;
const SMALLEST_FACTOR: f64 = 0.2;
const LARGEST_FACTOR: f64 = 8.0;
/// `h` times the largest eigenvalue at which Dormand-Prince stops being stable, and how often it may be met in a row.
const STIFF_STEP: f64 = 3.25;
const STIFF_STEPS: usize = 15;
/// A model counts as stiff, or as chattering, only where steps are this much shorter than a sampling period.
const SHORT_STEP: f64 = 0.02;
/// A rate that jumps to and fro (dry friction at rest) is followed in steps of this share of a sampling period
/// once `CHATTER` shorter ones were made within one period.
const SHORTEST_STEP: f64 = 1e-3;
const CHATTER: usize = 300;
/// How much more than the tolerance such a step may err.
const CHATTER_ERROR: f64 = 1e5;

/// Receives every accepted step.
pub(super) type Accept<'a> = &'a mut dyn FnMut(&DenseStep);

/// What the march found out.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct March {
    pub(super) n_steps: usize,
    pub(super) n_coarse: usize,
    pub(super) stiff_from: Option<f64>,
}

/// Integrates from `start` (s) and `x` to `end` (s); `stops` are the sample times, for methods with fixed steps.
pub(super) fn march(
    settings: &Simulate,
    rates: &mut Rates<'_>,
    x: &mut [f64],
    (start, end): (f64, f64),
    stops: &[f64],
    accept: Accept<'_>,
) -> Result<March> {
    let inside = |times: &[f64]| {
        let first = times.partition_point(|&t| t <= start);
        times[first..first.max(times.partition_point(|&t| t < end))].to_vec()
    };
    let mut ends = inside(rates.excitation.breaks());
    if settings.method.has_fixed_steps() {
        ends.extend(inside(stops));
    }
    ends.push(end);
    ends.sort_by(f64::total_cmp);
    let near = 1e-10 * rates.excitation.period();
    let mut a = start;
    let mut walker = Walker::new(settings, rates, x, end - start);
    for &b in &ends {
        if b - a <= near && b < end {
            continue;
        }
        rates.enter(a, b);
        match settings.method {
            Method::RungeKutta4 { substeps } | Method::Euler { substeps } if rates.may_hold() => {
                walker.fixed_holding(rates, x, (a, b), substeps.max(1), accept)?;
            }
            Method::RungeKutta4 { substeps } | Method::Euler { substeps } => {
                walker.fixed(rates, x, (a, b), substeps.max(1), accept)?;
            }
            Method::DormandPrince | Method::Rosenbrock => walker.adaptive(rates, x, (a, b), accept)?,
        }
        a = b;
    }
    Ok(walker.march)
}

struct Walker<'a> {
    settings: &'a Simulate,
    /// Largest size of each state so far.
    scale: Vec<f64>,
    explicit: DormandPrince,
    implicit: Rosenbrock,
    dense: DenseStep,
    slope: Vec<f64>,
    /// Proposed step, s; 0 before the first.
    step: f64,
    longest: f64,
    period: f64,
    last_error: f64,
    stiff_steps: usize,
    easy_steps: usize,
    /// Short steps since this time.
    short_steps: usize,
    short_since: f64,
    march: March,
}

impl<'a> Walker<'a> {
    fn new(settings: &'a Simulate, rates: &Rates<'_>, x: &[f64], span: f64) -> Self {
        let n = x.len();
        let period = rates.excitation.period();
        Self {
            settings,
            scale: x.iter().map(|v| v.abs()).collect(),
            explicit: DormandPrince::new(n),
            implicit: Rosenbrock::new(n),
            dense: DenseStep::new(n),
            slope: vec![0.0; n],
            step: 0.0,
            // A rate that reads the time may hold an event that a long step would jump over.
            longest: if rates.read_time() { period } else { span.max(period) },
            period,
            last_error: 1e-4,
            stiff_steps: 0,
            easy_steps: 0,
            short_steps: 0,
            short_since: f64::NEG_INFINITY,
            march: March::default(),
        }
    }

    /// Goes over to another mode at the time `t` (s) and the states `x` (n), after a step or, where it is at once, none.
    fn change(&mut self, rates: &mut Rates<'_>, t: f64, x: &mut [f64], change: Change, is_at_once: bool) {
        x[rates.held_state(change.slot)] = 0.0;
        // A state that leaves zero the wrong way did not leave it.
        let kept = change.let_go.map_or(if is_at_once { Kept::Held } else { Kept::Open }, Kept::LetGo);
        rates.keep(change.slot, kept);
        rates.begin(t, x, &mut self.slope);
    }

    /// The step that was tried from `x` at `t` over `h`, made to end at the first change of mode inside it, and its length.
    fn cut(&mut self, rates: &mut Rates<'_>, stiff: bool, (t, h): (f64, f64), x: &[f64]) -> Option<(Change, f64)> {
        /// Corrections of the length, each of which doubles the digits.
        const CORRECTIONS: usize = 3;
        if stiff {
            let mut end_slope = vec![0.0; x.len()];
            rates.rate(t + h, &self.implicit.end, &mut end_slope);
            self.dense.set_cubic(t, h, x, &self.implicit.end, &self.slope, &end_slope);
        } else {
            self.explicit.dense(t, h, x, &mut self.dense);
        }
        let change = first_change(rates, &self.dense, x, &self.slope)?;
        let mut length = change.at - t;
        let state = rates.held_state(change.slot);
        for _ in 0..=CORRECTIONS {
            if length <= 0.0 {
                return Some((change, 0.0));
            }
            if stiff {
                self.try_implicit(rates, t, length, x)
            } else {
                self.try_explicit(rates, t, length, x)
            };
            let value = if stiff { self.implicit.end[state] } else { self.explicit.end[state] };
            if stiff || change.let_go.is_some() || value.abs() <= 1e-14 * self.scale[state] {
                break;
            }
            let corrected = length - value / self.explicit.stages[6][state];
            if !(corrected > 0.0 && (corrected - length).abs() <= 1e-3 * h) {
                break;
            }
            length = corrected.min(h);
        }
        Some((change, length))
    }

    fn adaptive(&mut self, rates: &mut Rates<'_>, x: &mut [f64], (a, b): (f64, f64), accept: Accept<'_>) -> Result<()> {
        let mut t = a;
        rates.begin(t, x, &mut self.slope);
        if self.slope.iter().any(|f| !f.is_finite()) {
            return Err(self.no_rate(rates, t));
        }
        self.update_scale(x);
        if self.step == 0.0 {
            self.step = self.first_step(rates, t, b, x);
        }
        let mut rejected = false;
        while t < b {
            let remaining = b - t;
            // What holds now may let go within a sampling period.
            let longest = if rates.holds() { self.longest.min(self.period) } else { self.longest };
            let wanted = self.step.min(longest);
            // The last step of a segment ends exactly there, and no crumb is left for one after it.
            let last = wanted * 1.000_001 >= remaining;
            let h = match last {
                true => remaining,
                false if 2.0 * wanted > remaining => 0.5 * remaining,
                false => wanted,
            };
            if h < 32.0 * f64::EPSILON * t.abs().max(self.period) && !last {
                return Err(self.too_small(rates, t));
            }
            if self.march.n_steps >= self.settings.max_steps {
                return Err(Error::NotConverged {
                    what: format!("integration of model `{}`", rates.system.model().name),
                    why: format!(
                        "more than {} steps are needed, t = {t} s is reached; loosen the tolerance or use a fixed step",
                        self.settings.max_steps
                    ),
                });
            }
            self.march.n_steps += 1;
            let stiff = self.settings.method == Method::Rosenbrock || self.march.stiff_from.is_some();
            let (error, unstable) =
                if stiff { self.try_implicit(rates, t, h, x) } else { self.try_explicit(rates, t, h, x) };
            let coarse = self.chatters(t) && h <= SHORTEST_STEP * self.period * 1.01 && error <= CHATTER_ERROR;
            if error <= 1.0 || coarse {
                let end: &[f64] = if stiff { &self.implicit.end } else { &self.explicit.end };
                self.check_bound(rates, t + h, end)?;
                let cut = if rates.may_hold() { self.cut(rates, stiff, (t, h), x) } else { None };
                let (h, last) = cut.map_or((h, last), |(_, length)| (length, false));
                if let Some((change, 0.0)) = cut {
                    self.change(rates, t, x, change, true);
                    continue;
                }
                if stiff {
                    let end = self.implicit.end.clone();
                    let mut end_slope = vec![0.0; x.len()];
                    rates.rate(t + h, &end, &mut end_slope);
                    self.dense.set_cubic(t, h, x, &end, &self.slope, &end_slope);
                    self.slope = end_slope;
                    x.copy_from_slice(&end);
                } else {
                    self.explicit.dense(t, h, x, &mut self.dense);
                    self.slope.copy_from_slice(&self.explicit.stages[6]);
                    x.copy_from_slice(&self.explicit.end);
                    self.watch_stiffness(unstable, t, h);
                }
                if error > 1.0 {
                    self.march.n_coarse += 1;
                }
                self.update_scale(x);
                accept(&self.dense);
                if let Some((change, _)) = cut {
                    t += h;
                    self.change(rates, t, x, change, false);
                    rejected = false;
                    continue;
                }
                rates.open();
                self.count_short(t, h);
                t = if last { b } else { t + h };
                let order = if stiff { 0.25 } else { 0.2 };
                let factor = SAFETY * error.max(1e-10).powf(-0.75 * order) * self.last_error.powf(0.2 * order);
                let limit = if rejected { 1.0 } else { LARGEST_FACTOR };
                let next = h * factor.clamp(SMALLEST_FACTOR, limit);
                // A step that a break point cut short says nothing against the longer one.
                self.step = if last { next.max(self.step) } else { next };
                if self.chatters(t) {
                    self.step = self.step.max(SHORTEST_STEP * self.period);
                }
                self.last_error = error.clamp(1e-4, 1.0);
                rejected = false;
            } else {
                let order = if stiff { 0.25 } else { 0.2 };
                let factor = if error.is_finite() { SAFETY * error.powf(-order) } else { 0.1 };
                self.step = h * factor.clamp(0.1, 0.9);
                if self.chatters(t) && error <= CHATTER_ERROR {
                    self.step = self.step.max(SHORTEST_STEP * self.period);
                }
                rejected = true;
            }
        }
        Ok(())
    }

    fn try_explicit(&mut self, rates: &mut Rates<'_>, t: f64, h: f64, x: &[f64]) -> (f64, f64) {
        self.explicit.stages[0].copy_from_slice(&self.slope);
        let unstable = self.explicit.attempt(rates, t, h, x);
        (self.norm(x, &self.explicit.end, &self.explicit.error), unstable)
    }

    fn try_implicit(&mut self, rates: &mut Rates<'_>, t: f64, h: f64, x: &[f64]) -> (f64, f64) {
        self.implicit.linearise(rates, t, h, x, &self.slope, &self.scale);
        if !self.implicit.attempt(rates, t, h, x, &self.slope) {
            return (f64::NAN, 0.0);
        }
        (self.norm(x, &self.implicit.end, &self.implicit.error), 0.0)
    }

    /// Error in units of the tolerance, root mean square over the states; NaN where anything is.
    fn norm(&self, x: &[f64], end: &[f64], error: &[f64]) -> f64 {
        let largest = self.scale.iter().copied().fold(0.0, f64::max);
        let mut sum = 0.0;
        for j in 0..x.len() {
            let size = self.scale[j].max(x[j].abs()).max(end[j].abs());
            // Rounding alone can move a state that is zero by this much.
            let weight = (self.settings.tolerance * size).max(1e-14 * largest).max(f64::MIN_POSITIVE);
            sum += (error[j] / weight).powi(2);
        }
        if end.iter().any(|v| !v.is_finite()) { f64::NAN } else { (sum / x.len() as f64).sqrt() }
    }

    fn first_step(&mut self, rates: &mut Rates<'_>, t: f64, b: f64, x: &[f64]) -> f64 {
        let largest = self.scale.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let mut ratio: f64 = 0.0;
        for j in 0..x.len() {
            let size = self.scale[j].max(1e-3 * largest);
            ratio = ratio.max(self.slope[j].abs() / size);
        }
        let guess = if ratio > 0.0 { 0.01 / ratio } else { f64::INFINITY };
        let guess = guess.min(0.1 * (b - t)).min(self.longest).max(1e-8 * self.period);
        let mut slope = vec![0.0; x.len()];
        let ahead: Vec<f64> = x.iter().zip(&self.slope).map(|(v, f)| v + guess * f).collect();
        rates.rate(t + guess, &ahead, &mut slope);
        let mut curvature: f64 = 0.0;
        for j in 0..x.len() {
            let size = self.scale[j].max(guess * self.slope[j].abs()).max(1e-6 * largest);
            curvature = curvature.max((slope[j] - self.slope[j]).abs() / guess / size);
        }
        let by_error = if curvature > 0.0 { (self.settings.tolerance / curvature).powf(0.4) } else { guess * 100.0 };
        if by_error.is_finite() { by_error.min(100.0 * guess).max(1e-3 * guess) } else { 1e-3 * guess }
    }

    fn update_scale(&mut self, x: &[f64]) {
        for (scale, value) in self.scale.iter_mut().zip(x) {
            *scale = scale.max(value.abs());
        }
    }

    /// Goes over to the implicit method where the explicit one is held back by stability alone.
    fn watch_stiffness(&mut self, unstable: f64, t: f64, h: f64) {
        if unstable > STIFF_STEP && h < SHORT_STEP * self.period {
            self.easy_steps = 0;
            self.stiff_steps += 1;
            if self.stiff_steps >= STIFF_STEPS {
                self.march.stiff_from = Some(t);
            }
        } else {
            self.easy_steps += 1;
            if self.easy_steps >= 6 {
                self.stiff_steps = 0;
            }
        }
    }

    fn count_short(&mut self, t: f64, h: f64) {
        if t - self.short_since > self.period {
            (self.short_since, self.short_steps) = (t, 0);
        }
        if h < SHORTEST_STEP * self.period {
            self.short_steps += 1;
        }
    }

    /// Whether the rates seem to jump to and fro here.
    fn chatters(&self, t: f64) -> bool {
        t - self.short_since <= self.period && self.short_steps > CHATTER
    }

    fn check_bound(&self, rates: &Rates<'_>, t: f64, x: &[f64]) -> Result<()> {
        match x.iter().position(|v| v.is_nan() || v.abs() > self.settings.bound) {
            None => Ok(()),
            Some(state) => Err(rates.failure().unwrap_or_else(|| diverged(rates, t, state, x[state]))),
        }
    }

    fn no_rate(&self, rates: &Rates<'_>, t: f64) -> Error {
        let state = self.slope.iter().position(|f| !f.is_finite()).unwrap_or(0);
        rates.failure().unwrap_or_else(|| diverged(rates, t, state, self.slope[state]))
    }

    fn too_small(&self, rates: &Rates<'_>, t: f64) -> Error {
        let end = if self.march.stiff_from.is_some() { &self.implicit.end } else { &self.explicit.end };
        if let Some(state) = end.iter().position(|v| !v.is_finite() || v.abs() > 1e6) {
            return rates.failure().unwrap_or_else(|| diverged(rates, t, state, end[state]));
        }
        Error::NotConverged {
            what: format!("integration of model `{}`", rates.system.model().name),
            why: format!("the step becomes too small at t = {t} s; smooth a jump in the equations or use a fixed step"),
        }
    }
}

fn diverged(rates: &Rates<'_>, time: f64, state: usize, value: f64) -> Error {
    let model = rates.system.model();
    Error::Diverged { what: format!("model `{}`", model.name), time, state: model.states[state].name.clone(), value }
}
