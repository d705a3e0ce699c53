//! The optimum of a LASSO from that of a neighbouring lambda, by walking from support to support.
//!
//! On a support S with signs s the objective is a quadratic, whose minimum solves `A_S'A_S x = A_S'b - lambda s`. The
//! walk goes straight there; a coefficient that reaches zero on the way leaves S; a term outside whose correlation with
//! the residual exceeds lambda enters. Each move lowers the objective, so no support with its signs is met twice.
//!
//! Source: Lee, Battle, Raina & Ng 2006, Efficient sparse coding algorithms, section 3 (with the first zero crossing in
//! place of the best one); Osborne, Presnell & Turlach 2000, A new approach to variable selection in least squares problems.

use super::super::dense::{residual, transposed_times};
use super::Admm;

/// Excess of a correlation over lambda, relative, that rounding may leave.
const ROUNDING: f64 = 1e-11;
/// A pivot below this share of a column's square stops the walk: the columns depend on each other.
const DEPENDENT: f64 = 1e-12;

/// Terms that are in, with what belongs to them.
#[derive(Default)]
struct Support {
    terms: Vec<usize>,
    signs: Vec<f64>,
    /// Lower Cholesky factor of the Gram matrix, row by row.
    factor: Vec<f64>,
    /// Where the quadratic is least.
    goal: Vec<f64>,
}

impl Support {
    /// `false` where the columns depend on each other.
    fn factorise(&mut self, admm: &Admm<'_>) -> bool {
        let k = self.terms.len();
        self.factor.resize(k * k, 0.0);
        for i in 0..k {
            for j in 0..=i {
                let (above, below) = self.factor.split_at_mut(i * k);
                let row = if j == i { &below[..j] } else { &above[j * k..j * k + j] };
                let known: f64 = row.iter().zip(&below[..j]).map(|(a, b)| a * b).sum();
                let left = admm.gram[(self.terms[i], self.terms[j])] - known;
                if j < i {
                    below[j] = left / above[j * k + j];
                } else if left > DEPENDENT * admm.gram[(self.terms[i], self.terms[i])] {
                    below[i] = left.sqrt();
                } else {
                    return false;
                }
            }
        }
        true
    }

    fn solve(&mut self) {
        let k = self.terms.len();
        for i in 0..k {
            let known: f64 = (0..i).map(|j| self.factor[i * k + j] * self.goal[j]).sum();
            self.goal[i] = (self.goal[i] - known) / self.factor[i * k + i];
        }
        for i in (0..k).rev() {
            let known: f64 = (i + 1..k).map(|j| self.factor[j * k + i] * self.goal[j]).sum();
            self.goal[i] = (self.goal[i] - known) / self.factor[i * k + i];
        }
    }
}

/// Walks to the optimum for `lambda`, in place; the number of moves, or `None` (and z as it was) where rounding is in
/// the way and the iteration has to find it.
pub(super) fn walk(admm: &mut Admm<'_>, lambda: f64) -> Option<usize> {
    let before = admm.z.clone();
    let moves = walk_on(admm, lambda);
    if moves.is_none() {
        admm.z = before;
    }
    moves
}

fn walk_on(admm: &mut Admm<'_>, lambda: f64) -> Option<usize> {
    let p = admm.z.len();
    let mut support = Support::default();
    for j in (0..p).filter(|&j| admm.z[j] != 0.0) {
        support.terms.push(j);
        support.signs.push(admm.z[j].signum());
    }
    let mut entered = None;
    for moves in 1..=10 * p + 20 {
        if !support.terms.is_empty() {
            if !support.factorise(admm) {
                return None;
            }
            let slope = |(&j, s): (&usize, &f64)| admm.correlations[j] - lambda * admm.weights[j] * s;
            support.goal = support.terms.iter().zip(&support.signs).map(slope).collect();
            support.solve();
            if let Some((place, share)) = crossing(&support, &admm.z) {
                if entered == Some(support.terms[place]) {
                    // It would go out as it came in.
                    return None;
                }
                for (&j, goal) in support.terms.iter().zip(&support.goal) {
                    admm.z[j] += share * (goal - admm.z[j]);
                }
                admm.z[support.terms[place]] = 0.0;
                support.terms.remove(place);
                support.signs.remove(place);
                continue;
            }
            support.terms.iter().zip(&support.goal).for_each(|(&j, goal)| admm.z[j] = *goal);
        }
        let Some((j, sign)) = entering(admm, &support, lambda) else {
            refine(admm, &mut support, lambda);
            return Some(moves);
        };
        entered = Some(j);
        support.terms.push(j);
        support.signs.push(sign);
    }
    None
}

/// The coefficient that reaches zero first on the way to the goal, by its place, and the share of the way.
fn crossing(support: &Support, z: &[f64]) -> Option<(usize, f64)> {
    let mut first: Option<(usize, f64)> = None;
    for (place, (&j, &goal)) in support.terms.iter().zip(&support.goal).enumerate() {
        if goal * support.signs[place] <= 0.0 {
            let share = if z[j] == goal { 0.0 } else { z[j] / (z[j] - goal) };
            if first.is_none_or(|(_, other)| share < other) {
                first = Some((place, share));
            }
        }
    }
    first
}

/// The term outside whose correlation with the residual exceeds its charge by most, with its sign.
fn entering(admm: &Admm<'_>, support: &Support, lambda: f64) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    let mut largest = lambda * (1.0 + ROUNDING);
    for j in (0..admm.z.len()).filter(|j| !support.terms.contains(j)) {
        let explained: f64 = support.terms.iter().map(|&k| admm.gram[(k, j)] * admm.z[k]).sum();
        let slope = admm.correlations[j] - explained;
        if slope.abs() > largest * admm.weights[j] {
            largest = slope.abs() / admm.weights[j];
            best = Some((j, slope.signum()));
        }
    }
    best
}

/// One step of iterative refinement with the columns themselves: their Gram matrix has the squared condition number.
fn refine(admm: &mut Admm<'_>, support: &mut Support, lambda: f64) {
    let slopes = transposed_times(&admm.a, &residual(&admm.a, &admm.b, &admm.z));
    let left = |(&j, s): (&usize, &f64)| slopes[j] - lambda * admm.weights[j] * s;
    support.goal = support.terms.iter().zip(&support.signs).map(left).collect();
    support.solve();
    for (&j, change) in support.terms.iter().zip(&support.goal) {
        let better = admm.z[j] + change;
        if better * admm.z[j] > 0.0 {
            admm.z[j] = better;
        }
    }
}
