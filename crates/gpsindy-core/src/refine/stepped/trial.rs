//! A step that is tried: what it makes of every window, and what is taken of it.

use super::slopes::{Scene, Slopes};
use super::{DAMPING, LEAST, LESS, MORE, MOST, Search};
use crate::refine::Job;
use crate::refine::blocks::squares;
use crate::refine::jacobian::{Block, Point, prior_cost};
use crate::refine::tally::Purpose;
use nalgebra::DVector;

/// Share of a step that a window tries where the whole one does not help.
const SHORT: f64 = 0.3;

/// A window's rollout from one start, with the parameters of the step.
struct Rollout {
    start: Vec<f64>,
    residual: DVector<f64>,
    squares: f64,
}

/// What was tried of a window: the whole step, and where that did not help a short one and none.
#[derive(Default)]
pub(super) struct Tried {
    rollouts: Vec<Rollout>,
}

impl Tried {
    /// Number of the rollout with the smallest sum of squares.
    fn best(&self) -> Option<usize> {
        (0..self.rollouts.len()).min_by(|&a, &b| self.rollouts[a].squares.total_cmp(&self.rollouts[b].squares))
    }
}

impl Search<'_> {
    /// Rollouts of the windows that move, by window.
    pub(super) fn tried(&self, aim: &Point, moving: &[usize]) -> Vec<Tried> {
        let mut tried: Vec<Tried> = self.windows.iter().map(|_| Tried::default()).collect();
        let whole = moving.iter().map(|&w| (w, aim.initial[w].clone())).collect();
        self.roll(aim, whole, &mut tried);
        let is_worse = |w: &usize| tried[*w].rollouts.iter().all(|r| r.squares >= self.windows[*w].squares);
        let worse = moving.iter().copied().filter(is_worse);
        let mut more = Vec::new();
        for w in worse {
            let old = &self.point.initial[w];
            more.push((w, old.iter().zip(&aim.initial[w]).map(|(old, new)| old + SHORT * (new - old)).collect()));
            // Without parameters it is known what no step makes of it.
            if !self.scene.free.is_empty() {
                more.push((w, old.clone()));
            }
        }
        self.roll(aim, more, &mut tried);
        tried
    }

    fn roll(&self, aim: &Point, starts: Vec<(usize, Vec<f64>)>, tried: &mut [Tried]) {
        let job = |(window, start): &(usize, Vec<f64>)| Job {
            window: *window,
            parameters: aim.parameters.clone(),
            initial: start.clone(),
        };
        let residuals = self.scene.residuals(Purpose::Trials, &starts.iter().map(job).collect::<Vec<Job>>());
        for ((window, start), residual) in starts.into_iter().zip(residuals) {
            let squares = squares(self.scene.experiment, &residual);
            tried[window].rollouts.push(Rollout { start, residual, squares });
        }
    }

    /// Takes the step of a part where that lowers its cost, and learns from it in any case; its cost before, and the gain.
    pub(super) fn take(&mut self, windows: &[usize], aim: &Point, tried: &[Tried], was_verified: bool) -> (f64, f64) {
        let free = self.scene.free;
        let best: Vec<Option<usize>> = windows.iter().map(|&w| tried[w].best()).collect();
        let chosen = |place: usize| best[place].map(|best| &tried[windows[place]].rollouts[best]);
        let before =
            windows.iter().map(|&w| self.windows[w].squares).sum::<f64>() + prior_cost(&self.point.parameters, free);
        let after = (0..windows.len()).map(|place| chosen(place).map_or(f64::INFINITY, |r| r.squares)).sum::<f64>()
            + prior_cost(&aim.parameters, free);
        let is_better = after < before;
        for (place, &w) in windows.iter().enumerate() {
            let state = &mut self.windows[w];
            let helps = best[place] == Some(0) && is_better;
            state.failures = if best[place] == Some(0) { 0 } else { state.failures + 1 };
            state.damping = (state.damping * if helps { LESS } else { MORE }).clamp(LEAST, MOST);
            // Fresh derivatives know better than the secant of a step that fails.
            if !is_better && was_verified {
                continue;
            }
            for rollout in &tried[w].rollouts {
                let moved = moved(self.scene, &self.point, (w, &rollout.start), aim);
                update(&mut self.jacobian.blocks[w], &rollout.residual, &moved);
            }
            if let Some(rollout) = chosen(place).filter(|_| is_better) {
                self.point.initial[w].clone_from(&rollout.start);
                self.jacobian.blocks[w].residual.clone_from(&rollout.residual);
                state.squares = rollout.squares;
            }
            state.is_fresh = false;
        }
        if !free.is_empty() {
            self.damping = (self.damping * if is_better { LESS } else { MORE }).clamp(LEAST, MOST);
        }
        if is_better {
            self.point.parameters.clone_from(&aim.parameters);
        }
        (before, if is_better { before - after } else { 0.0 })
    }

    /// Shorter steps all over.
    pub(super) fn dampen(&mut self) {
        self.damping = (self.damping * MORE).min(MOST);
        for window in &mut self.windows {
            window.damping = (window.damping * MORE).min(MOST);
            window.failures += 1;
        }
        for part in &mut self.parts {
            part.failures += 1;
        }
    }

    /// Makes the derivatives of these windows anew, where they are.
    pub(super) fn renew(&mut self, windows: &[(usize, Slopes)]) {
        for slopes in [Slopes::Coarse, Slopes::Fine] {
            let of: Vec<usize> = windows.iter().filter(|(_, wanted)| *wanted == slopes).map(|(w, _)| *w).collect();
            let wanted = self.scene.all_of(of.iter().copied());
            self.scene.differentiate(&self.point, slopes, &wanted, &mut self.jacobian.blocks);
            for w in of {
                let state = &mut self.windows[w];
                (state.slopes, state.is_fresh, state.failures) = (slopes, true, 0);
                state.damping = state.damping.min(DAMPING);
            }
        }
    }
}

/// By how much a window's start and the free parameters moved.
fn moved(scene: Scene<'_>, from: &Point, (window, start): (usize, &[f64]), to: &Point) -> DVector<f64> {
    let starts = start.iter().zip(&from.initial[window]).map(|(now, then)| now - then);
    let parameters = scene.free.iter().map(|f| to.parameters[f.parameter] - from.parameters[f.parameter]);
    DVector::from_vec(starts.chain(parameters).collect())
}

/// Broyden's update: the derivative that reproduces what this step did and is otherwise nearest to the old one, where every column
/// counts by its own size.
fn update(block: &mut Block, residual: &DVector<f64>, moved: &DVector<f64>) {
    let Block { residual: old, derivative, .. } = block;
    let weighted = DVector::from_fn(moved.len(), |j, _| derivative.column(j).norm_squared() * moved[j]);
    let length = weighted.dot(moved);
    let missed = &*old - residual - &*derivative * moved;
    if length > 0.0 && length.is_finite() && missed.iter().all(|v| v.is_finite()) {
        derivative.ger(1.0 / length, &missed, &weighted, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn the_updated_derivative_tells_what_the_step_did() {
        let derivative = DMatrix::from_row_slice(3, 2, &[1.0, 0.5, 0.0, 2.0, -1.0, 0.1]);
        let old = DVector::from_vec(vec![1.0, -2.0, 0.5]);
        let mut block = Block { residual: old.clone(), derivative, present: vec![true; 3] };
        let (moved, new) = (DVector::from_vec(vec![0.1, -0.2]), DVector::from_vec(vec![0.7, -1.0, 0.4]));
        update(&mut block, &new, &moved);
        let stated = &block.derivative * &moved;
        assert!((stated - (old - &new)).amax() < 1e-12);
        // A step without a length, or one that left all bounds, carries no information.
        let before = block.derivative.clone();
        update(&mut block, &new, &DVector::zeros(2));
        update(&mut block, &DVector::from_element(3, f64::NAN), &moved);
        assert!(block.derivative == before);
    }
}
