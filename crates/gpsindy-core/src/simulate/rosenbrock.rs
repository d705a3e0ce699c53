//! Rosenbrock steps for stiff models: RODAS, order 4(3), stiffly accurate, Jacobian by differences.
//!
//! Source: Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.7.

use super::rates::Rates;
use nalgebra::{DMatrix, DVector};

const GAMMA: f64 = 0.25;
const NODES: [f64; 4] = [0.0, 0.386, 0.21, 0.63];
const TIME_WEIGHTS: [f64; 4] = [0.25, -0.1043, 0.1035, -0.0362];
const STAGES: [&[f64]; 5] = [
    &[],
    &[1.544],
    &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
    &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
    &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
];
const COUPLINGS: [&[f64]; 6] = [
    &[],
    &[-5.6688],
    &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
    &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
    &[7.496_443_313_967_647, -10.246_804_314_641_22, -33.999_903_528_199_05, 11.708_908_932_061_6],
    &[
        8.083_246_795_921_522,
        -7.981_132_988_064_893,
        -31.521_594_328_743_71,
        16.319_305_431_231_36,
        -6.058_818_238_834_054,
    ],
];

/// A trial step of RODAS.
pub(super) struct Rosenbrock {
    /// States at the end.
    pub(super) end: Vec<f64>,
    /// Estimated error of the states at the end.
    pub(super) error: Vec<f64>,
    jacobian: DMatrix<f64>,
    by_time: Vec<f64>,
    trial: Vec<f64>,
    slope: Vec<f64>,
    solved: Vec<DVector<f64>>,
}

impl Rosenbrock {
    pub(super) fn new(n: usize) -> Self {
        Self {
            end: vec![0.0; n],
            error: vec![0.0; n],
            jacobian: DMatrix::zeros(n, n),
            by_time: vec![0.0; n],
            trial: vec![0.0; n],
            slope: vec![0.0; n],
            solved: vec![DVector::zeros(n); 6],
        }
    }

    /// Derivatives of the rates by states and time at `x`, `t`, where the rates are `f`.
    ///
    /// `scale` (n) is the size of the states; `within` bounds the difference in time, s.
    pub(super) fn linearise(
        &mut self,
        rates: &mut Rates<'_>,
        t: f64,
        within: f64,
        x: &[f64],
        f: &[f64],
        scale: &[f64],
    ) {
        let n = x.len();
        self.trial.copy_from_slice(x);
        for k in 0..n {
            let size = x[k].abs().max(1e-3 * scale[k]).max(f64::MIN_POSITIVE.sqrt());
            let moved = x[k] + f64::EPSILON.sqrt() * size;
            self.trial[k] = moved;
            rates.rate(t, &self.trial, &mut self.slope);
            for j in 0..n {
                self.jacobian[(j, k)] = (self.slope[j] - f[j]) / (moved - x[k]);
            }
            self.trial[k] = x[k];
        }
        let later = t + 1e-4 * within;
        rates.rate(later, x, &mut self.slope);
        for j in 0..n {
            self.by_time[j] = (self.slope[j] - f[j]) / (later - t);
        }
    }

    /// Tries a step of `h` s from `x` at `t`, where the rates are `f`. False where the matrix is singular.
    pub(super) fn attempt(&mut self, rates: &mut Rates<'_>, t: f64, h: f64, x: &[f64], f: &[f64]) -> bool {
        let n = x.len();
        let matrix = DMatrix::from_fn(n, n, |j, k| {
            let diagonal = if j == k { 1.0 / (GAMMA * h) } else { 0.0 };
            diagonal - self.jacobian[(j, k)]
        });
        let factors = matrix.lu();
        self.end.copy_from_slice(x);
        for stage in 0..6 {
            if stage == 0 {
                self.slope.copy_from_slice(f);
            } else {
                if stage < 5 {
                    for j in 0..n {
                        let moved: f64 = STAGES[stage].iter().zip(&self.solved).map(|(a, k)| a * k[j]).sum();
                        self.end[j] = x[j] + moved;
                    }
                } else {
                    for j in 0..n {
                        self.end[j] += self.solved[4][j];
                    }
                }
                let node = NODES.get(stage).copied().unwrap_or(1.0);
                rates.rate(t + node * h, &self.end, &mut self.slope);
            }
            let time_weight = TIME_WEIGHTS.get(stage).copied().unwrap_or(0.0);
            for j in 0..n {
                let coupled: f64 = COUPLINGS[stage].iter().zip(&self.solved).map(|(c, k)| c * k[j]).sum();
                self.trial[j] = self.slope[j] + h * time_weight * self.by_time[j] + coupled / h;
            }
            self.solved[stage].copy_from_slice(&self.trial);
            if !factors.solve_mut(&mut self.solved[stage]) {
                return false;
            }
        }
        for j in 0..n {
            self.error[j] = self.solved[5][j];
            self.end[j] += self.error[j];
        }
        true
    }
}
