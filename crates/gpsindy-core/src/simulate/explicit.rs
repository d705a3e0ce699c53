//! Explicit Runge-Kutta steps: Dormand-Prince 5(4) with dense output, the classical fourth order, Euler.

use super::dense::DenseStep;
use super::rates::Rates;

/// Nodes, weights of the stages (lower triangle, row by row), weights of the error, weights of the dense output.
///
/// Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, table II.5.2 and section II.6.
const NODES: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const STAGES: [&[f64]; 7] = [
    &[],
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];
const DENSE: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// A trial step of Dormand-Prince.
pub(super) struct DormandPrince {
    /// Rates of the seven stages; the first is that of the start, the last that of the end.
    pub(super) stages: [Vec<f64>; 7],
    /// States at the end.
    pub(super) end: Vec<f64>,
    /// Estimated error of the states at the end.
    pub(super) error: Vec<f64>,
    trial: Vec<f64>,
}

impl DormandPrince {
    pub(super) fn new(n: usize) -> Self {
        Self {
            stages: std::array::from_fn(|_| vec![0.0; n]),
            end: vec![0.0; n],
            error: vec![0.0; n],
            trial: vec![0.0; n],
        }
    }

    /// Tries a step of `h` s from `x` at `t`; the first stage is already there.
    ///
    /// Returns an estimate of `h` times the largest eigenvalue, which detects stiffness.
    pub(super) fn attempt(&mut self, rates: &mut Rates<'_>, t: f64, h: f64, x: &[f64]) -> f64 {
        let mut last_but_one = 0.0;
        for stage in 1..7 {
            let (done, rest) = self.stages.split_at_mut(stage);
            for (j, value) in self.trial.iter_mut().enumerate() {
                let slope: f64 = STAGES[stage].iter().zip(done.iter()).map(|(a, k)| a * k[j]).sum();
                *value = x[j] + h * slope;
            }
            if stage == 5 {
                self.end.copy_from_slice(&self.trial);
            }
            rates.rate(t + NODES[stage] * h, &self.trial, &mut rest[0]);
            if stage == 6 {
                let moved: f64 = self.trial.iter().zip(&self.end).map(|(a, b)| (a - b).powi(2)).sum();
                let turned: f64 = rest[0].iter().zip(&done[5]).map(|(a, b)| (a - b).powi(2)).sum();
                last_but_one = if moved > 0.0 { h * (turned / moved).sqrt() } else { 0.0 };
            }
        }
        self.end.copy_from_slice(&self.trial);
        for (j, error) in self.error.iter_mut().enumerate() {
            *error = h * ERROR.iter().zip(&self.stages).map(|(e, k)| e * k[j]).sum::<f64>();
        }
        last_but_one
    }

    /// The solution inside the step that was tried.
    pub(super) fn dense(&self, t: f64, h: f64, x: &[f64], step: &mut DenseStep) {
        step.set_cubic(t, h, x, &self.end, &self.stages[0], &self.stages[6]);
        for (j, c) in step.coefficients[4].iter_mut().enumerate() {
            *c = h * DENSE.iter().zip(&self.stages).map(|(d, k)| d * k[j]).sum::<f64>();
        }
    }
}

/// One classical fourth-order step of `h` s from `x` at `t` with rates `f` there; the end goes into `end`.
pub(super) fn runge_kutta_4(rates: &mut Rates<'_>, t: f64, h: f64, x: &[f64], f: &[f64], end: &mut [f64]) {
    let n = x.len();
    let (mut trial, mut slope, mut sum) = (vec![0.0; n], f.to_vec(), f.to_vec());
    for (node, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        for j in 0..n {
            trial[j] = x[j] + node * h * slope[j];
        }
        rates.rate(t + node * h, &trial, &mut slope);
        for j in 0..n {
            sum[j] += weight * slope[j];
        }
    }
    for j in 0..n {
        end[j] = x[j] + h / 6.0 * sum[j];
    }
}

/// One forward Euler step.
pub(super) fn euler(h: f64, x: &[f64], f: &[f64], end: &mut [f64]) {
    for j in 0..x.len() {
        end[j] = x[j] + h * f[j];
    }
}
