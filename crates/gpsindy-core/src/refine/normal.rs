//! The normal equations of a fit and its damped steps; every window's initial state is eliminated from them.

use super::dots::products;
use super::{Block, Experiment, Free, Jacobian, Point, Starts};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// How far an initial state may sit from its guess, in typical sizes (1 sigma): only holds what the
/// logs do not determine.
const INITIAL_BELIEF: f64 = 30.0;

/// Of a window: initial x initial, initial x parameters, gradient of the initial state.
type OfWindow = (DMatrix<f64>, DMatrix<f64>, DVector<f64>);

/// The normal equations with every window's initial state kept apart.
pub(crate) struct Normal {
    windows: Vec<OfWindow>,
    parameters: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Normal {
    pub(crate) fn new(jacobian: &Jacobian, experiment: &Experiment, point: &Point, free: &[Free]) -> Self {
        let n = jacobian.n_states;
        let q = free.len();
        let Starts { more, .. } = experiment.starts;
        let mut parameters = DMatrix::zeros(q, q);
        let mut gradient = DVector::zeros(q);
        for (i, f) in free.iter().enumerate() {
            if let Some((mean, sd)) = f.prior {
                parameters[(i, i)] += 1.0 / (sd * sd);
                gradient[i] += (mean - point.parameters[f.parameter]) / (sd * sd);
            }
        }
        let windows = jacobian
            .blocks
            .iter()
            .map(|block| {
                let (mut product, mut slope) = products(&block.derivative, &block.residual);
                if more > 0.0 {
                    let derivative = block.derivative.rows(0, first_rows(experiment, block));
                    product += more * derivative.tr_mul(&derivative);
                    slope += of_first(experiment, block, &block.residual);
                }
                parameters += product.view((n, n), (q, q));
                gradient += slope.rows(n, q);
                let mut initial = product.view((0, 0), (n, n)).into_owned();
                for j in 0..n {
                    initial[(j, j)] += (INITIAL_BELIEF * experiment.scale[j]).powi(-2);
                }
                (initial, product.view((0, n), (n, q)).into_owned(), slope.rows(0, n).into_owned())
            })
            .collect();
        Self { windows, parameters, gradient }
    }

    /// The same derivatives beside other `residuals`, whatever is believed of the parameters.
    pub(crate) fn of(&self, jacobian: &Jacobian, experiment: &Experiment, residuals: &[DVector<f64>]) -> Self {
        let (n, q) = (jacobian.n_states, self.gradient.len());
        let mut gradient = DVector::zeros(q);
        let window = |((block, residual), (initial, mixed, _)): ((&Block, &DVector<f64>), &OfWindow)| {
            let mut slope = block.derivative.tr_mul(residual);
            if experiment.starts.more > 0.0 {
                slope += of_first(experiment, block, residual);
            }
            gradient += slope.rows(n, q);
            (initial.clone(), mixed.clone(), slope.rows(0, n).into_owned())
        };
        let windows = jacobian.blocks.iter().zip(residuals).zip(&self.windows).map(window).collect();
        Self { windows, parameters: self.parameters.clone(), gradient }
    }

    /// The point one damped Gauss-Newton step on, kept inside the bounds.
    pub(crate) fn step(&self, point: &Point, free: &[Free], damping: f64) -> Option<Point> {
        self.step_by_window(point, free, damping, &|_| damping)
    }

    /// The same with a damping of the parameters and one of every window's initial state.
    pub(crate) fn step_by_window(
        &self,
        point: &Point,
        free: &[Free],
        damping: f64,
        of_window: &dyn Fn(usize) -> f64,
    ) -> Option<Point> {
        let mut reduced = damped(&self.parameters, damping);
        let mut gradient = self.gradient.clone();
        let mut solved = Vec::with_capacity(self.windows.len());
        for (w, (initial, mixed, slope)) in self.windows.iter().enumerate() {
            let factor = damped(initial, of_window(w)).cholesky()?;
            let weights = factor.solve(mixed);
            let own = factor.solve(slope);
            reduced -= mixed.tr_mul(&weights);
            gradient -= mixed.tr_mul(&own);
            solved.push((weights, own));
        }
        let applied = bounded_solution(&reduced, &gradient, &point.parameters, free)?;
        let mut next = point.clone();
        for (f, change) in free.iter().zip(applied.iter()) {
            next.parameters[f.parameter] = (point.parameters[f.parameter] + change).clamp(f.lower, f.upper);
        }
        for (initial, (weights, own)) in next.initial.iter_mut().zip(&solved) {
            let move_by = own - weights * &applied;
            for (value, step) in initial.iter_mut().zip(move_by.iter()) {
                *value += step;
            }
        }
        next.parameters.iter().chain(next.initial.iter().flatten()).all(|v| v.is_finite()).then_some(next)
    }

    /// The same equations solved for residuals other than their own; nothing where they do not determine a value.
    pub(crate) fn solved(&self) -> Option<Solved> {
        let mut reduced = self.parameters.clone();
        let mut windows = Vec::with_capacity(self.windows.len());
        for (initial, mixed, _) in &self.windows {
            let factor = initial.clone().cholesky()?;
            reduced -= mixed.tr_mul(&factor.solve(mixed));
            windows.push((factor, mixed.clone()));
        }
        Some(Solved { windows, parameters: reduced.cholesky()? })
    }

    /// Covariance of the free parameters with the initial states free, infinite where they are not determined; and the windows
    /// whose equations for the initial state are not positive definite to rounding, which carry no information.
    pub(crate) fn covariance(&self) -> (DMatrix<f64>, Vec<usize>) {
        let q = self.gradient.len();
        let mut reduced = self.parameters.clone();
        let mut left_out = Vec::new();
        for (w, (initial, mixed, _)) in self.windows.iter().enumerate() {
            match initial.clone().cholesky() {
                Some(factor) => reduced -= mixed.tr_mul(&factor.solve(mixed)),
                None => left_out.push(w),
            }
        }
        let covariance = match reduced.cholesky() {
            Some(factor) => factor.inverse(),
            None => DMatrix::from_diagonal_element(q, q, f64::INFINITY),
        };
        (covariance, left_out)
    }
}

/// How many rows of a window count more, those of its first samples.
fn first_rows(experiment: &Experiment, block: &Block) -> usize {
    (experiment.starts.samples * experiment.columns.len()).min(block.residual.len())
}

/// What they add to the gradient where a window has these residuals.
fn of_first(experiment: &Experiment, block: &Block, residual: &DVector<f64>) -> DVector<f64> {
    let first = first_rows(experiment, block);
    experiment.starts.more * block.derivative.rows(0, first).tr_mul(&residual.rows(0, first))
}

/// Normal equations whose matrices are factored.
pub(crate) struct Solved {
    windows: Vec<(Cholesky<f64, Dyn>, DMatrix<f64>)>,
    parameters: Cholesky<f64, Dyn>,
}

impl Solved {
    /// By how much a step lowers the sum of squares of residuals with these `slopes` (per window: the initial state, then the
    /// free parameters) and this `belief` of the free parameters.
    pub(crate) fn gain(&self, slopes: &[DVector<f64>], belief: &DVector<f64>) -> f64 {
        let q = belief.len();
        let mut gradient = belief.clone();
        let mut gain = 0.0;
        for ((factor, mixed), slope) in self.windows.iter().zip(slopes) {
            let n = slope.len() - q;
            let own = slope.rows(0, n).into_owned();
            let step = factor.solve(&own);
            gain += own.dot(&step);
            gradient += slope.rows(n, q) - mixed.tr_mul(&step);
        }
        gain + gradient.dot(&self.parameters.solve(&gradient))
    }
}

/// Solves for the change of the free parameters; what would leave its bounds stops there, and the others are solved
/// again without it (an active set that only grows).
pub(crate) fn bounded_solution(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    at: &[f64],
    free: &[Free],
) -> Option<DVector<f64>> {
    let q = free.len();
    let mut stopped: Vec<Option<f64>> = vec![None; q];
    for _ in 0..=q {
        let mut matrix = matrix.clone();
        let mut right = gradient.clone();
        for (i, change) in stopped.iter().enumerate() {
            if let Some(change) = *change {
                right.axpy(-change, &matrix.column(i).clone_owned(), 1.0);
                matrix.fill_row(i, 0.0);
                matrix.fill_column(i, 0.0);
                matrix[(i, i)] = 1.0;
            }
        }
        for (value, change) in right.iter_mut().zip(&stopped) {
            *value = change.unwrap_or(*value);
        }
        let solution = if q > 0 { matrix.cholesky()?.solve(&right) } else { right };
        let mut all_inside = true;
        for (i, f) in free.iter().enumerate().filter(|(i, _)| solution[*i].is_finite()) {
            let old = at[f.parameter];
            let new = (old + solution[i]).clamp(f.lower, f.upper);
            if stopped[i].is_none() && new != old + solution[i] {
                stopped[i] = Some(new - old);
                all_inside = false;
            }
        }
        if all_inside {
            return Some(solution);
        }
    }
    None
}

/// The matrix with its diagonal raised by `damping` of itself (Marquardt's scaling).
fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut damped = matrix.clone();
    for i in 0..matrix.nrows() {
        damped[(i, i)] = matrix[(i, i)] * (1.0 + damping) + f64::MIN_POSITIVE;
    }
    damped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_the_covariance_leaves_out_are_named() {
        let window = |own: f64| {
            (DMatrix::from_element(1, 1, own), DMatrix::from_element(1, 1, 1.0), DVector::from_element(1, 0.0))
        };
        let normal = |own: [f64; 2]| Normal {
            windows: own.map(window).into(),
            parameters: DMatrix::from_element(1, 1, 10.0),
            gradient: DVector::from_element(1, 0.0),
        };
        // Each window takes 1/2 of the information; the second carries no information where its own is no number.
        let (covariance, left_out) = normal([2.0, 2.0]).covariance();
        assert!((covariance[(0, 0)] - 1.0 / 9.0).abs() < 1e-15 && left_out.is_empty());
        let (covariance, left_out) = normal([2.0, -2.0]).covariance();
        assert!((covariance[(0, 0)] - 1.0 / 9.5).abs() < 1e-15);
        assert_eq!(left_out, [1]);
    }
}
