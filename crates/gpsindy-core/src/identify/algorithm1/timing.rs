//! The hold and the delay of the controls, chosen by the residual of all allowed terms together.

use crate::error::Result;
use crate::identify::algorithm1::rows::rows;
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::equations::DelayValue;
use crate::identify::evidence::independent_share;
use crate::identify::limits::{DELAY_ROWS, DELAYS_TRIED, RULED_OUT};
use crate::identify::prepare::Logs;
use crate::identify::settings::Identify;
use crate::progress::{Progress, step};
use crate::refine::Hold;
use crate::regress::Reduced;
use faer::Mat;

/// What the controls do between samples, and when they act.
#[derive(Debug, Clone)]
pub(crate) struct Timing {
    pub(crate) hold: Hold,
    /// One a control.
    pub(crate) delays: Vec<DelayValue>,
    /// Whether the rows rule it out.
    pub(crate) unlikely: bool,
}

impl Timing {
    /// Delay of every control, s.
    pub(crate) fn delay_values(&self) -> Vec<f64> {
        self.delays.iter().map(|delay| delay.value).collect()
    }
}

/// What the controls may do between samples, with the delays that belong to it, likeliest first.
#[derive(Debug, Clone)]
pub(crate) struct Timings {
    /// What leaves the smallest residual of the whole library.
    pub(crate) best: Timing,
    pub(crate) others: Vec<Timing>,
}

impl Timings {
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Timing> {
        std::iter::once(&self.best).chain(&self.others)
    }
}

impl Timings {
    /// What belongs to `hold` alone; all where nothing does.
    pub(crate) fn of(&self, hold: Hold) -> Self {
        let own = self.iter().find(|timing| timing.hold == hold);
        own.map_or_else(
            || self.clone(),
            |own| Self { best: Timing { unlikely: false, ..own.clone() }, others: Vec::new() },
        )
    }
}

/// What a regression leaves.
#[derive(Debug, Clone, Copy)]
struct Misfit {
    /// Twice the negative logarithm of the likelihood, but for a constant.
    value: f64,
    /// Share of the values that count as independent.
    share: f64,
}

/// Held or interpolated controls, and how late: each with the delays at which the whole library leaves least.
pub(crate) fn time(settings: &Identify, logs: &Logs, motion: &Motion, progress: &dyn Progress) -> Result<Timings> {
    let comparison = Comparison { settings, logs, motion, progress };
    let known = |hold| Timing { hold, delays: logs.frame.delays.clone(), unlikely: false };
    let alone = |hold| {
        let best = comparison.with_delays(known(hold))?;
        Ok(Timings { best, others: Vec::new() })
    };
    match settings.hold {
        Some(hold) => alone(hold),
        None if settings.controls.is_empty() => alone(Hold::Zero),
        None => {
            let held = comparison.with_delays(known(Hold::Zero))?;
            let before = comparison.misfit(&held)?;
            // The search for delays goes on from those of the held controls.
            let interpolated = comparison.with_delays(Timing { hold: Hold::Linear, ..held.clone() })?;
            let after = comparison.misfit(&interpolated)?;
            let (mut best, mut other, gap, share) = match after.value < before.value {
                true => (interpolated, held, before.value - after.value, after.share),
                false => (held, interpolated, after.value - before.value, before.share),
            };
            other.unlikely = share * gap > RULED_OUT;
            best.unlikely = false;
            Ok(Timings { best, others: vec![other] })
        }
    }
}

struct Comparison<'a> {
    settings: &'a Identify,
    logs: &'a Logs,
    motion: &'a Motion,
    progress: &'a dyn Progress,
}

impl Comparison<'_> {
    /// Delays at which the whole library leaves the smallest residual, one control after the other; twice where there are
    /// several, since each moves with the others.
    fn with_delays(&self, mut timing: Timing) -> Result<Timing> {
        let free: Vec<usize> = (0..timing.delays.len()).filter(|&k| timing.delays[k].free).collect();
        let rounds = if free.len() > 1 { 2 } else { 1 };
        for round in 0..rounds {
            for &k in &free {
                step(self.progress, "find delays", round, rounds)?;
                let most = timing.delays[k].most;
                let count = ((most / self.motion.period).round() as usize).clamp(DELAYS_TRIED.0, DELAYS_TRIED.1);
                let grid: Vec<f64> = (0..=count).map(|i| most * i as f64 / count as f64).collect();
                let mut misfit_at = |value: f64| {
                    timing.delays[k].value = value;
                    self.misfit(&timing).map(|misfit| misfit.value)
                };
                let misfits = grid.iter().map(|&value| misfit_at(value)).collect::<Result<Vec<_>>>()?;
                let best = (0..grid.len()).min_by(|&a, &b| misfits[a].total_cmp(&misfits[b])).unwrap_or(0);
                timing.delays[k].value = vertex(&grid, &misfits, best);
            }
        }
        Ok(timing)
    }

    /// What all allowed terms leave: the sum over the states of `n ln(rss)`.
    fn misfit(&self, timing: &Timing) -> Result<Misfit> {
        let (mut sum, mut left) = (0.0, Vec::new());
        let all = rows(self.settings, self.logs, self.motion, timing.hold, &timing.delay_values())?;
        for (s, rows) in all.iter().enumerate() {
            let Some(rows) = rows else { continue };
            let step = rows.target.len().div_ceil(DELAY_ROWS);
            let kept: Vec<usize> = (0..rows.target.len()).step_by(step).collect();
            let allowed = &self.logs.frame.allowed[s];
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
