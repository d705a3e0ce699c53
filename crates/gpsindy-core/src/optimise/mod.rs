//! Minimiser of a smooth cost with gradient: argmin's L-BFGS with our line search, restarted from
//! the best point where it stops early. It can't hang, and it says whether it converged.

mod line_search;

use argmin::core::{CostFunction, Error, Executor, Gradient, State, TerminationReason, TerminationStatus};
use argmin::solver::quasinewton::LBFGS;
use line_search::WeakWolfe;
use std::cell::RefCell;

/// Settings of the minimiser.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `tolerance_gradient` | 1e-5 | norm of the gradient at which it stops |
/// | `tolerance_cost` | 1e-8 | change of the cost between iterations at which it stops |
/// | `max_iterations` | 100 | of each of the at most five L-BFGS runs |
/// | `settled` | 1e-2 | norm of the gradient up to which an end without further descent counts as an optimum |
/// | `leave_plateaus` | false | whether an end that is flat in a coordinate is left where lower ground lies along it |
/// | `longest_move` | 2 | largest change of a coordinate in one step (a factor e^2 of a hyperparameter) |
#[derive(Debug, Clone, Copy)]
pub(crate) struct Optimiser {
    pub(crate) tolerance_gradient: f64,
    pub(crate) tolerance_cost: f64,
    pub(crate) max_iterations: u64,
    pub(crate) settled: f64,
    pub(crate) leave_plateaus: bool,
    pub(crate) longest_move: f64,
}

impl Default for Optimiser {
    fn default() -> Self {
        Self {
            tolerance_gradient: 1e-5,
            tolerance_cost: 1e-8,
            max_iterations: 100,
            settled: 1e-2,
            leave_plateaus: false,
            longest_move: 2.0,
        }
    }
}

/// Where a minimisation ended.
#[derive(Debug, Clone)]
pub(crate) struct Minimum {
    pub(crate) point: Vec<f64>,
    pub(crate) cost: f64,
    /// A tolerance was reached; otherwise the iterations ran out or no descent was left above them.
    pub(crate) converged: bool,
    pub(crate) evaluations: usize,
}

/// L-BFGS runs after the first, each from the best point so far with an empty memory.
const RESTARTS: usize = 4;
/// A change of the cost that is none, for a coordinate that moves by one.
const FLAT: f64 = 1e-3;
/// Farthest look along a flat coordinate.
const FARTHEST: i32 = 10;
/// Pairs of steps that L-BFGS remembers; hyperparameters are few.
const MEMORY: usize = 10;

impl Optimiser {
    /// Minimises `cost`, which returns the value and fills the gradient, or `None` where it is undefined.
    /// `None` where it is undefined at `start`.
    pub(crate) fn minimise(
        &self,
        start: &[f64],
        cost: impl FnMut(&[f64], &mut [f64]) -> Option<f64>,
    ) -> Option<Minimum> {
        let objective = Objective(RefCell::new(Memo {
            cost,
            point: Vec::new(),
            value: f64::NAN,
            gradient: vec![0.0; start.len()],
            best: (f64::INFINITY, Vec::new(), f64::INFINITY),
            evaluations: 0,
        }));
        objective.evaluate(start);
        if !objective.0.borrow().best.0.is_finite() {
            return None;
        }
        let mut converged = false;
        for _ in 0..=RESTARTS {
            let (before, from) = {
                let memo = objective.0.borrow();
                (memo.best.0, memo.best.1.clone())
            };
            converged = self.descend(&objective, from);
            if self.leave_plateaus && converged && self.look_along(&objective) {
                continue;
            }
            let after = objective.0.borrow().best.0;
            if converged || before - after <= self.tolerance_cost {
                break;
            }
        }
        let memo = objective.0.into_inner();
        let (cost, point, slope) = memo.best;
        // An optimum where rounding hides any further descent is an optimum.
        let converged = converged || slope <= self.settled;
        Some(Minimum { point, cost, converged, evaluations: memo.evaluations })
    }

    /// Looks for lower ground along every coordinate in which the best point is flat on one side: a bare likelihood has an
    /// optimum of its own where a length is endless or the noise explains everything, and no gradient leads out of it.
    /// Whether there was any, which then is the best point.
    fn look_along<F: FnMut(&[f64], &mut [f64]) -> Option<f64>>(&self, objective: &Objective<F>) -> bool {
        let (cost, origin) = {
            let memo = objective.0.borrow();
            (memo.best.0, memo.best.1.clone())
        };
        for c in 0..origin.len() {
            for side in [-1.0, 1.0] {
                for distance in 1..=FARTHEST {
                    let mut point = origin.clone();
                    point[c] += side * f64::from(distance);
                    objective.evaluate(&point);
                    let value = objective.0.borrow().value;
                    // Negated, so that what is not a number ends the look; beyond a first flat step there may be a hill.
                    if distance == 1 && !((value - cost).abs() < FLAT) {
                        break;
                    }
                }
            }
        }
        cost - objective.0.borrow().best.0 > self.tolerance_cost.max(FLAT)
    }

    fn descend<F: FnMut(&[f64], &mut [f64]) -> Option<f64>>(&self, objective: &Objective<F>, from: Vec<f64>) -> bool {
        let solver = LBFGS::new(WeakWolfe::new(self.longest_move, 0.01 * self.tolerance_cost), MEMORY)
            .with_tolerance_grad(self.tolerance_gradient)
            .and_then(|s| s.with_tolerance_cost(self.tolerance_cost));
        let Ok(solver) = solver else { return false };
        let run = Executor::new(objective, solver)
            .configure(|state| state.param(from).max_iters(self.max_iterations))
            .ctrlc(false)
            .timer(false)
            .run();
        let Ok(result) = run else { return false };
        matches!(
            result.state.get_termination_status(),
            TerminationStatus::Terminated(TerminationReason::SolverConverged | TerminationReason::TargetCostReached)
        )
    }
}

/// argmin asks for cost and gradient one after the other, and twice at an accepted point: the last point is kept.
struct Objective<F>(RefCell<Memo<F>>);

struct Memo<F> {
    cost: F,
    point: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
    /// Lowest value, where it was, and the norm of the gradient there.
    best: (f64, Vec<f64>, f64),
    evaluations: usize,
}

impl<F: FnMut(&[f64], &mut [f64]) -> Option<f64>> Objective<F> {
    fn evaluate(&self, point: &[f64]) {
        let memo = &mut *self.0.borrow_mut();
        if memo.point == point {
            return;
        }
        memo.evaluations += 1;
        memo.point = point.to_vec();
        memo.value = (memo.cost)(point, &mut memo.gradient).unwrap_or(f64::NAN);
        if memo.value < memo.best.0 {
            let slope = memo.gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
            memo.best = (memo.value, point.to_vec(), slope);
        }
    }
}

impl<F: FnMut(&[f64], &mut [f64]) -> Option<f64>> CostFunction for &Objective<F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, point: &Vec<f64>) -> Result<f64, Error> {
        self.evaluate(point);
        Ok(self.0.borrow().value)
    }
}

impl<F: FnMut(&[f64], &mut [f64]) -> Option<f64>> Gradient for &Objective<F> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, point: &Vec<f64>) -> Result<Vec<f64>, Error> {
        self.evaluate(point);
        Ok(self.0.borrow().gradient.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rosenbrock_valley_is_followed_to_its_end() {
        let optimiser = Optimiser { max_iterations: 200, tolerance_cost: 1e-14, ..Optimiser::default() };
        let minimum = optimiser
            .minimise(&[-1.2, 1.0], |x, g| {
                let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
                if let [g0, g1] = g {
                    (*g0, *g1) = (-2.0 * a - 400.0 * x[0] * b, 200.0 * b);
                }
                Some(a * a + 100.0 * b * b)
            })
            .unwrap();
        assert!(minimum.converged && (minimum.point[0] - 1.0).abs() < 1e-4, "{minimum:?}");
    }
}
