//! Weak-Wolfe bracketing line search for argmin's L-BFGS.
//!
//! The line searches that come with argmin loop forever or stop silently where the cost is not a
//! number, as a Gaussian process likelihood is where the covariance stops being positive definite.
//! This one doubles or bisects, treats anything that is not clearly lower as too far, never moves
//! further than a stated distance, and ends after a stated number of trials.
//! Source: Lewis & Overton 2013, Nonsmooth optimization via quasi-Newton methods, algorithm 2.6.

use argmin::core::{
    CostFunction, Error, Gradient, IterState, KV, LineSearch, Problem, Solver, State, TerminationReason,
};

/// Share of the linear decrease that a step must reach.
const ARMIJO: f64 = 1e-4;
/// Share of the initial slope that may remain after a step.
const CURVATURE: f64 = 0.9;
const MAX_TRIALS: usize = 40;

/// Line search that can't hang; see the module.
#[derive(Debug, Clone)]
pub(crate) struct WeakWolfe {
    /// No coordinate moves further than this in one step.
    pub(crate) longest_move: f64,
    /// A step whose expected decrease is below this is not worth a trial: rounding hides it.
    pub(crate) negligible: f64,
    direction: Vec<f64>,
    first: f64,
}

impl WeakWolfe {
    /// A search whose steps move no coordinate further than `longest_move` and expect at least `negligible`.
    pub(crate) fn new(longest_move: f64, negligible: f64) -> Self {
        Self { longest_move, negligible, direction: Vec::new(), first: 1.0 }
    }
}

impl LineSearch<Vec<f64>, f64> for WeakWolfe {
    fn search_direction(&mut self, direction: Vec<f64>) {
        self.direction = direction;
    }

    fn initial_step_length(&mut self, step: f64) -> Result<(), Error> {
        self.first = step;
        Ok(())
    }
}

type Iterate = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

impl<O> Solver<O, Iterate> for WeakWolfe
where
    O: CostFunction<Param = Vec<f64>, Output = f64> + Gradient<Param = Vec<f64>, Gradient = Vec<f64>>,
{
    fn name(&self) -> &str {
        "weak-Wolfe bisection"
    }

    #[allow(clippy::neg_cmp_op_on_partial_ord)]
    fn next_iter(&mut self, problem: &mut Problem<O>, mut state: Iterate) -> Result<(Iterate, Option<KV>), Error> {
        let (Some(origin), Some(gradient)) = (state.take_param(), state.take_gradient()) else {
            return Err(Error::msg("line search without a point"));
        };
        let cost = state.get_cost();
        let slope: f64 = gradient.iter().zip(&self.direction).map(|(g, d)| g * d).sum();
        let longest = self.direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        // Negated tests, so that what is not a number fails them too.
        if !(slope < 0.0) || !(longest > 0.0) || !longest.is_finite() || !cost.is_finite() {
            return Err(Error::msg("no direction of descent"));
        }
        let cap = self.longest_move / longest;
        let (mut low, mut high, mut step) = (0.0, f64::INFINITY, self.first.min(cap));
        let mut best: Option<(f64, Vec<f64>)> = None;
        for _ in 0..MAX_TRIALS {
            let point: Vec<f64> = origin.iter().zip(&self.direction).map(|(x, d)| x + step * d).collect();
            let value = problem.cost(&point)?;
            if !(value <= cost + ARMIJO * step * slope) {
                high = step;
            } else {
                let new_gradient = problem.gradient(&point)?;
                let new_slope: f64 = new_gradient.iter().zip(&self.direction).map(|(g, d)| g * d).sum();
                let steep = !(new_slope >= CURVATURE * slope);
                if best.as_ref().is_none_or(|(b, _)| value < *b) {
                    best = Some((value, point));
                }
                if !steep || step >= cap {
                    break;
                }
                low = step;
            }
            if high.is_finite() && -slope * (low + high) < 2.0 * self.negligible {
                break;
            }
            step = if high.is_finite() { 0.5 * (low + high) } else { (2.0 * step).min(cap) };
        }
        let Some((value, point)) = best else {
            return Err(Error::msg("no lower point along the direction"));
        };
        Ok((state.param(point).cost(value).terminate_with(TerminationReason::SolverConverged), None))
    }
}
