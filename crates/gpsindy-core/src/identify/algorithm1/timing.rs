//! What the controls do between samples and how late they act, by what all allowed terms together leave.

use crate::error::Result;
use crate::identify::Identify;
use crate::identify::prepare::Plan;
use crate::identify::support::equations::{DelayValue, Equations};
use crate::identify::support::search::independent_share;
use crate::progress::{Progress, step};
use crate::refine::Hold;
use crate::regress::Reduced;
use faer::Mat;

/// Rows at most in the regression that compares delays.
const DELAY_ROWS: usize = 3000;

/// What the controls do between samples, and when they act.
#[derive(Debug, Clone)]
pub(crate) struct Timing {
    pub(crate) hold: Hold,
    /// One a control.
    pub(crate) delays: Vec<DelayValue>,
    misfit: Misfit,
    /// Whether the rows speak decidedly against it. Smoothing rounds what a held control does, so it is not yet out.
    pub(crate) unlikely: bool,
}

/// What a regression leaves.
#[derive(Debug, Clone, Copy)]
struct Misfit {
    /// Twice the negative logarithm of the likelihood, but for a constant.
    value: f64,
    /// Share of the values that count as independent.
    share: f64,
}

/// Twice the logarithm of a likelihood ratio that decides between held and interpolated controls before any term is chosen:
/// odds of 20,000.
const DECIDED: f64 = 20.0;

impl Plan {
    /// What the controls may do between samples, with the delays that belong to it, best first: what leaves the smallest
    /// residual of the whole library. The first is what the rows then take.
    pub(crate) fn find_timings(
        &mut self,
        settings: &Identify,
        equations: &mut Equations,
        progress: &dyn Progress,
    ) -> Result<Vec<Timing>> {
        let holds = match settings.hold {
            Some(hold) => vec![hold],
            None if settings.controls.is_empty() => vec![Hold::Zero],
            None => vec![Hold::Zero, Hold::Linear],
        };
        let open = holds.len() > 1;
        let mut timings = Vec::with_capacity(holds.len());
        for hold in holds {
            self.tracks.iter_mut().for_each(|track| track.hold = hold);
            self.find_delays(settings, equations, progress)?;
            let misfit = if open { self.misfit(settings, equations)? } else { Misfit { value: 0.0, share: 1.0 } };
            timings.push(Timing { hold, delays: equations.delays.clone(), misfit, unlikely: false });
        }
        timings.sort_by(|x, y| x.misfit.value.total_cmp(&y.misfit.value));
        let best = timings[0].misfit;
        for other in &mut timings {
            other.unlikely = best.share * (other.misfit.value - best.value) > DECIDED;
        }
        self.tracks.iter_mut().for_each(|track| track.hold = timings[0].hold);
        equations.delays.clone_from(&timings[0].delays);
        Ok(timings)
    }

    /// Delays at which the whole library leaves the smallest residual, one control after the other, twice.
    fn find_delays(&self, settings: &Identify, equations: &mut Equations, progress: &dyn Progress) -> Result<()> {
        let free: Vec<(usize, f64)> = equations.free_delays().map(|(k, delay)| (k, delay.most)).collect();
        let rounds = if free.len() > 1 { 2 } else { 1 };
        for round in 0..rounds {
            for &(k, most) in &free {
                step(progress, "find delays", round, rounds)?;
                let count = ((most / self.period).round() as usize).clamp(4, 40);
                let grid: Vec<f64> = (0..=count).map(|i| most * i as f64 / count as f64).collect();
                let mut misfit_at = |value: f64| {
                    equations.delays[k].value = value;
                    self.misfit(settings, equations).map(|misfit| misfit.value)
                };
                let misfits = grid.iter().map(|&value| misfit_at(value)).collect::<Result<Vec<_>>>()?;
                let best = (0..grid.len()).min_by(|&a, &b| misfits[a].total_cmp(&misfits[b])).unwrap_or(0);
                equations.delays[k].value = vertex(&grid, &misfits, best);
            }
        }
        Ok(())
    }

    /// What all allowed terms leave: the sum over the states of `n ln(rss)`.
    fn misfit(&self, settings: &Identify, equations: &Equations) -> Result<Misfit> {
        let (mut sum, mut left) = (0.0, Vec::new());
        for (s, rows) in self.rows(settings, equations)?.iter().enumerate() {
            let Some(rows) = rows else { continue };
            let step = rows.target.len().div_ceil(DELAY_ROWS);
            let kept: Vec<usize> = (0..rows.target.len()).step_by(step).collect();
            let allowed = &equations.allowed[s];
            let theta = Mat::from_fn(kept.len(), allowed.len(), |i, j| rows.theta[(kept[i], allowed[j])]);
            let target: Vec<f64> = kept.iter().map(|&i| rows.target[i]).collect();
            let problem = Reduced::new(theta.as_ref(), &target)?;
            let all: Vec<usize> = (0..allowed.len()).collect();
            let fit = problem.refit(&all);
            sum += kept.len() as f64 * fit.residual.max(f64::MIN_POSITIVE).ln();
            let explained = |i: usize| (0..allowed.len()).map(|j| theta[(i, j)] * fit.coefficients[j]).sum::<f64>();
            let size = (fit.residual / kept.len() as f64).sqrt().max(f64::MIN_POSITIVE);
            left.push((0..kept.len()).map(|i| (target[i] - explained(i)) / size).collect());
        }
        Ok(Misfit { value: sum, share: independent_share(&left, 1) })
    }
}

/// The minimum of the parabola through the best point and its neighbours.
fn vertex(grid: &[f64], values: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 == grid.len() {
        return grid[best];
    }
    let (left, middle, right) = (values[best - 1], values[best], values[best + 1]);
    let bend = left - 2.0 * middle + right;
    let shift = if bend > 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
    grid[best] + shift.clamp(-1.0, 1.0) * (grid[best + 1] - grid[best])
}
