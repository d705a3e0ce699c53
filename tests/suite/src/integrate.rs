//! Adaptive Runge-Kutta of order 5(4) with one located event.
//!
//! Source: Dormand and Prince 1980, A family of embedded Runge-Kutta formulae. The event is found by repeating the last
//! step with a bisected length, so that the landing point has the accuracy of the step itself.

/// Most numbers that a plant and its hidden parts hold.
pub const WIDTH: usize = 12;

/// The values of a plant and of its hidden parts; the unused ones stay zero.
pub type Values = [f64; WIDTH];

/// A function of time and values whose fall to zero is an event.
pub type Event<'a> = dyn Fn(f64, &Values) -> f64 + 'a;

/// Why an integration went no further.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The end of the interval was reached.
    End,
    /// The event function fell to zero or below at this time.
    Event(f64),
    /// The values grew without bound, or the step became too small.
    Diverged,
}

/// The integrator: tolerances and the step that worked last.
#[derive(Debug, Clone)]
pub struct Integrator {
    /// Relative tolerance of a step.
    pub relative: f64,
    /// Absolute tolerance of a step by value.
    pub absolute: Values,
    /// How many values are in use.
    pub n: usize,
    step: f64,
}

const A: [[f64; 6]; 6] = [
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const C: [f64; 6] = [1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

impl Integrator {
    /// An integrator for `n` values whose usual sizes are `scale`.
    pub fn new(n: usize, relative: f64, scale: &[f64]) -> Self {
        let mut absolute = [relative * 1e-3; WIDTH];
        for (a, s) in absolute.iter_mut().zip(scale) {
            *a = relative * s.abs().max(1e-9);
        }
        Self { relative, absolute, n, step: f64::INFINITY }
    }

    /// One step of length `h`; returns the new values and the error in units of the tolerance.
    fn trial(
        &self,
        flow: &impl Fn(f64, &Values, &mut Values),
        t: f64,
        x: &Values,
        k0: &Values,
        h: f64,
    ) -> (Values, f64) {
        let mut k = [[0.0; WIDTH]; 7];
        k[0] = *k0;
        let mut y = *x;
        for stage in 0..6 {
            for i in 0..self.n {
                let mut sum = 0.0;
                for (j, kj) in k.iter().enumerate().take(stage + 1) {
                    sum += A[stage][j] * kj[i];
                }
                y[i] = x[i] + h * sum;
            }
            let mut slope = [0.0; WIDTH];
            flow(t + C[stage] * h, &y, &mut slope);
            k[stage + 1] = slope;
        }
        let mut worst: f64 = 0.0;
        for i in 0..self.n {
            let error: f64 = h * (0..7).map(|j| E[j] * k[j][i]).sum::<f64>();
            let size = self.absolute[i] + self.relative * x[i].abs().max(y[i].abs());
            let ratio = (error / size).abs();
            worst = if ratio.is_finite() { worst.max(ratio) } else { f64::INFINITY };
        }
        (y, worst)
    }

    /// Integrates `x` in place from `from` to `to`, or to the first time at which `event` is no longer positive.
    ///
    /// An event function that starts at or below zero counts as positive until the end of the first step.
    pub fn advance(
        &mut self,
        flow: &impl Fn(f64, &Values, &mut Values),
        event: Option<&Event>,
        from: f64,
        to: f64,
        x: &mut Values,
    ) -> Stop {
        let mut t = from;
        let mut rejected = 0;
        let mut accepted = 0;
        while t < to {
            let rest = to - t;
            let h = self.step.min(rest);
            let mut k0 = [0.0; WIDTH];
            flow(t, x, &mut k0);
            let (y, error) = self.trial(flow, t, x, &k0, h);
            let factor = (0.9 * error.max(1e-8).powf(-0.2)).clamp(0.2, 4.0);
            if error > 1.0 || !error.is_finite() {
                self.step = h * if error.is_finite() { factor.min(0.9) } else { 0.1 };
                rejected += 1;
                if rejected > 200 || self.step < 1e-12 * (1.0 + t.abs()) {
                    return Stop::Diverged;
                }
                continue;
            }
            if let Some(event) = event
                && event(t + h, &y) <= 0.0
            {
                let (mut low, mut high, mut landed) = (0.0, h, y);
                for _ in 0..60 {
                    if high - low <= 1e-13 * (1.0 + t.abs()) {
                        break;
                    }
                    let middle = 0.5 * (low + high);
                    let (z, _) = self.trial(flow, t, x, &k0, middle);
                    if event(t + middle, &z) <= 0.0 {
                        (high, landed) = (middle, z);
                    } else {
                        low = middle;
                    }
                }
                *x = landed;
                return Stop::Event(t + high);
            }
            // A step cut by the end of the interval says little about the next one.
            if h >= rest {
                self.step = self.step.max(h * factor);
                if self.step == f64::INFINITY {
                    self.step = h * factor;
                }
                t = to;
            } else {
                self.step = h * factor;
                t += h;
            }
            *x = y;
            if x[..self.n].iter().any(|v| !v.is_finite() || v.abs() > 1e12) {
                return Stop::Diverged;
            }
            accepted += 1;
            if accepted > 200_000 {
                return Stop::Diverged;
            }
        }
        Stop::End
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_keeps_its_analytic_solution() {
        let flow = |_: f64, x: &Values, d: &mut Values| {
            d[0] = x[1];
            d[1] = -4.0 * x[0];
        };
        let mut integrator = Integrator::new(2, 1e-9, &[1.0, 2.0]);
        let mut x = [0.0; WIDTH];
        x[0] = 1.0;
        assert_eq!(integrator.advance(&flow, None, 0.0, 10.0, &mut x), Stop::End);
        // About a hundred steps of tolerance 1e-9.
        assert!((x[0] - 20f64.cos()).abs() < 1e-6);
        assert!((x[1] + 2.0 * 20f64.sin()).abs() < 1e-6);
    }

    #[test]
    fn an_event_is_met_at_its_analytic_time() {
        // A stone that falls 5 m with g = 10 lands after 1 s.
        let flow = |_: f64, x: &Values, d: &mut Values| {
            d[0] = x[1];
            d[1] = -10.0;
        };
        let height = |_: f64, x: &Values| x[0];
        let mut integrator = Integrator::new(2, 1e-9, &[1.0, 1.0]);
        let mut x = [0.0; WIDTH];
        x[0] = 5.0;
        let Stop::Event(t) = integrator.advance(&flow, Some(&height), 0.0, 9.0, &mut x) else { panic!("no event") };
        assert!((t - 1.0).abs() < 1e-9 && (x[1] + 10.0).abs() < 1e-8);
    }

    #[test]
    fn growth_without_bound_is_reported() {
        let flow = |_: f64, x: &Values, d: &mut Values| d[0] = x[0] * x[0];
        let mut integrator = Integrator::new(1, 1e-8, &[1.0]);
        let mut x = [0.0; WIDTH];
        x[0] = 1.0;
        assert_eq!(integrator.advance(&flow, None, 0.0, 2.0, &mut x), Stop::Diverged);
    }
}
