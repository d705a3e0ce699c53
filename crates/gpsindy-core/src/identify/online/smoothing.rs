//! Smoothed states from the newest samples, and integrals of the terms along them.

use super::accumulate::Block;
use super::estimate::Estimate;
use super::reach::reach;
use super::recent::Recent;
use super::settings::OnlineSettings;
use crate::error::Result;
use crate::gp::{Conditioned, Fit, FitSettings, Posterior, Quantity, Role, fit};
use crate::identify::algorithm1::rows::simpson;
use crate::identify::algorithm1::smooth::shortest_window;
use crate::identify::algorithm1::track::Track;
use crate::identify::limits::online::{FEWEST_OF_A_PROCESS, LONGEST_STEP, UNKNOWN};
use crate::identify::limits::{FOLDS, WINDOW_SAMPLES};
use crate::library::Library;
use faer::Mat;

/// Processes of all states, and the lengths that follow from them.
#[derive(Debug, Clone)]
pub(super) struct Smoothing {
    /// One a state.
    pub(super) fits: Vec<Fit>,
    /// Samples on either side that a smoothed value depends on.
    pub(super) lag: usize,
    /// Length of the stretches of the weak form, s.
    pub(super) stretch: f64,
    /// Longest step that is integrated over, s.
    longest_step: f64,
}

/// Value and rate of every state at some samples.
struct Path {
    mean: Mat<f64>,
    slope: Mat<f64>,
    known: Vec<bool>,
}

impl Smoothing {
    /// Hyperparameters from all samples at hand; `None` where a state has too few values and no process yet.
    ///
    /// A `stretch` (s) that was found before is kept unless another of less than half or more than twice its length is due.
    pub(super) fn new(
        settings: &OnlineSettings,
        recent: &Recent,
        old: Option<&Self>,
        stretch: Option<f64>,
        most_lag: usize,
    ) -> Result<Option<Self>> {
        let period = recent.period();
        let mut fits = Vec::with_capacity(settings.states.len());
        for s in 0..settings.states.len() {
            let points = recent.points(s);
            let count: usize = points.iter().map(|p| p.len()).sum();
            fits.push(match old {
                Some(old) if count < FEWEST_OF_A_PROCESS => old.fits[s].clone(),
                None if count < FEWEST_OF_A_PROCESS => return Ok(None),
                _ => fit(&settings.kernels, &points, &FitSettings::default())?,
            });
        }
        let length = |fit: &Fit| fit.parameters().iter().find(|(r, _)| matches!(r, Role::Length(_))).map(|(_, v)| *v);
        let shortest = fits.iter().filter_map(length).fold(f64::INFINITY, f64::min);
        // Where nothing bounds it, every sample of a run depends on all others.
        let lag = if most_lag == usize::MAX { usize::MAX } else { reach(&fits, period, most_lag) };
        let mut found = Self { fits, lag, stretch: 0.0, longest_step: LONGEST_STEP * shortest };
        let pace = found.pace(recent)?;
        // As long as the rollouts that Identify begins with, twice; with a memory, a fair part of it.
        let usual = 2.0 * shortest_window(pace, period);
        let memory = settings.memory.unwrap_or(f64::INFINITY);
        let due = usual.min((memory / FOLDS as f64).max(WINDOW_SAMPLES * period));
        found.stretch = stretch.filter(|old| (0.5..=2.0).contains(&(due / old))).unwrap_or(due);
        Ok(Some(found))
    }

    /// Samples that are taken in at once.
    pub(super) fn block(&self) -> usize {
        (self.lag / 2).max(4)
    }

    /// Time in which the fastest state changes by its own spread, s.
    fn pace(&self, recent: &Recent) -> Result<f64> {
        let mut rates = vec![0.0; self.fits.len()];
        let mut from = recent.first();
        while from < recent.end() {
            let (_, to) = recent.run_of(from);
            let path = self.path(recent, (from, to), (from, to))?;
            for (s, sum) in rates.iter_mut().enumerate() {
                *sum += path.slope.col_as_slice(s).iter().map(|v| v * v).sum::<f64>();
            }
            from = to;
        }
        let pace = |(fit, sum): (&Fit, &f64)| fit.scale / (sum / recent.len() as f64).sqrt();
        Ok(self.fits.iter().zip(&rates).map(pace).filter(|v| v.is_finite()).fold(f64::INFINITY, f64::min))
    }

    /// Law of value and rate of state `s` at samples `from..to`, from the values of samples `first..end`.
    fn law(
        &self,
        recent: &Recent,
        s: usize,
        (first, end): (usize, usize),
        (from, to): (usize, usize),
    ) -> Result<[Posterior; 2]> {
        let fit = &self.fits[s];
        let points = recent.points_between(s, first, end);
        let process = Conditioned::about(fit, &points, fit.mean)?;
        let at = [(from..to).map(|i| recent.get(i).time).collect()];
        let predict = |quantity| process.predict(&at, &[quantity], false);
        Ok([predict(Quantity::Value)?, predict(Quantity::Derivative)?])
    }

    fn path(&self, recent: &Recent, window: (usize, usize), (from, to): (usize, usize)) -> Result<Path> {
        let (r, n) = (to - from, self.fits.len());
        let mut path = Path { mean: Mat::zeros(r, n), slope: Mat::zeros(r, n), known: vec![true; r] };
        for (s, fit) in self.fits.iter().enumerate() {
            let [value, rate] = self.law(recent, s, window, (from, to))?;
            path.mean.col_as_slice_mut(s).copy_from_slice(&value.mean);
            path.slope.col_as_slice_mut(s).copy_from_slice(&rate.mean);
            for (known, variance) in path.known.iter_mut().zip(&value.variance) {
                *known &= variance.sqrt() <= UNKNOWN * fit.scale.max(fit.noise);
            }
        }
        Ok(path)
    }

    /// Where every state is at the newest sample.
    pub(super) fn newest(&self, recent: &Recent) -> Result<Vec<Estimate>> {
        let i = recent.end() - 1;
        let (start, end) = recent.run_of(i);
        let first = start.max(i.saturating_sub(self.lag));
        let one = |s: usize| {
            let [value, rate] = self.law(recent, s, (first, end), (i, end))?;
            Ok(Estimate {
                value: value.mean[0],
                value_std: value.variance[0].sqrt(),
                rate: rate.mean[0],
                rate_std: rate.variance[0].sqrt(),
            })
        };
        (0..self.fits.len()).map(one).collect()
    }

    /// The samples `from..to` of one run, smoothed by what is within the lag, with the integral of every term over the
    /// step to each.
    pub(super) fn block_of(
        &self,
        recent: &Recent,
        library: &Library,
        settings: &OnlineSettings,
        (from, to): (usize, usize),
    ) -> Result<Block> {
        let (start, end) = recent.run_of(from);
        // The sample before is where the first step begins.
        let begin = from.saturating_sub(1).max(start);
        let window = (begin.saturating_sub(self.lag).max(start), to.saturating_add(self.lag).min(end));
        let path = self.path(recent, window, (begin, to))?;
        let (n, p) = (self.fits.len(), library.n_terms());
        let mut steps = Mat::zeros(to - from, p);
        if to - begin > 1 {
            let sums = self.integrals(recent, library, settings, (start, begin, to), &path)?;
            let skip = from - begin;
            for j in 0..p {
                for i in 0..to - from {
                    // The first sample of a run has no step before it.
                    steps[(i, j)] = if i + skip > 0 { sums[(i + skip - 1, j)] } else { 0.0 };
                }
            }
        }
        let time: Vec<f64> = (from..to).map(|i| recent.get(i).time).collect();
        let near = |i: usize| i > start && recent.get(i).time - recent.get(i - 1).time <= self.longest_step;
        Ok(Block {
            joined: (from..to).map(near).collect(),
            known: path.known[from - begin..].to_vec(),
            values: Mat::from_fn(to - from, n, |i, s| recent.get(from + i).states[s]),
            time,
            steps,
        })
    }

    /// Integral of every term over each step from sample `begin` to the one before `to`, by Simpson's rule.
    fn integrals(
        &self,
        recent: &Recent,
        library: &Library,
        settings: &OnlineSettings,
        (start, begin, to): (usize, usize, usize),
        path: &Path,
    ) -> Result<Mat<f64>> {
        let delays = settings.delay_values();
        let latest = delays.iter().copied().fold(0.0, f64::max);
        // Late controls are in earlier samples, whose states nobody reads.
        let oldest = recent.at_or_before(recent.get(begin).time - latest, start.max(recent.first()));
        let before = begin - oldest;
        let state = |values: &Mat<f64>, i: usize, s: usize| if i < before { 0.0 } else { values[(i - before, s)] };
        let (r, n, m) = (to - oldest, self.fits.len(), delays.len());
        let track = Track {
            time: (oldest..to).map(|i| recent.get(i).time).collect(),
            raw: Mat::zeros(r, n),
            mean: Mat::from_fn(r, n, |i, s| state(&path.mean, i, s)),
            slope: Mat::from_fn(r, n, |i, s| state(&path.slope, i, s)),
            given: Mat::zeros(r, n),
            controls: Mat::from_fn(r, m, |i, k| recent.get(oldest + i).controls[k]),
        };
        simpson(&track, library, settings.hold, &delays, before)
    }
}
