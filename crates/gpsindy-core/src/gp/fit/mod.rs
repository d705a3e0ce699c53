//! Hyperparameters and kernel by marginal likelihood, without silent failure.
//!
//! Targets are standardised (each run by its own mean, all by one standard deviation); the cost
//! is the negative log marginal likelihood of all runs plus weak priors, divided by the number of
//! points; several deterministic starts; the noise never falls below a floor; the kernel of the
//! lowest cost wins unless it only interpolates (leave-one-out check). Whatever makes the answer
//! weak is reported in the result.
//! Source: Rasmussen & Williams 2006, sections 5.4.1 and 5.4.2.

mod blocks;
mod cost;
mod one;
mod result;
mod scale;
mod search;
mod settings;
mod start;

pub use result::{Candidate, Fit, Weakness};
pub use settings::FitSettings;

use crate::error::{Error, Result};
use crate::gp::kernel::{Kernel, Role};
use crate::gp::likelihood::Evaluation;
use crate::gp::points::Points;
use crate::parallel;
use one::{JITTER, OneFit, fit_one, polished};
use scale::{Scale, standardise};
use start::Bounds;

/// Fewer points than this are a reason to trust a fit less.
const FEW_POINTS: usize = 8;
/// Fits every kernel to all runs together (shared hyperparameters) and keeps the best.
///
/// Kernels are tried in parallel; the result does not depend on the number of threads.
///
/// # Errors
/// No kernel or no point; values that are not finite; a covariance that stays indefinite.
pub fn fit(kernels: &[Kernel], runs: &[Points], settings: &FitSettings) -> Result<Fit> {
    let Some(first) = kernels.first() else {
        return Err(Error::settings("no kernel to try; name at least one, for example `se`"));
    };
    let dimension = check(runs, settings)?;
    let scale = Scale::of(runs, settings)?;
    let Some(standard) = standardise(runs, &scale) else {
        return Ok(constant_fit(first, runs, dimension, &scale));
    };
    let (kernels, replaced) = affordable(&tellable(kernels, runs, dimension), runs, settings);
    let bounds = Bounds::of(&standard, &scale, settings);
    let (fits, best) = if blocks::are_needed(&kernels, &standard) {
        by_blocks(&kernels, &standard, &bounds, settings)
    } else {
        let fits = fit_all(&kernels, &standard, &bounds, settings);
        let best = best_of(&fits);
        (fits, best)
    };
    let candidates = kernels.iter().zip(&fits).map(|(kernel, fit)| candidate(kernel, fit.as_ref())).collect();
    let Some((best, kernel)) = best.and_then(|k| Some((fits.into_iter().nth(k)??, &kernels[k]))) else {
        let size = runs.iter().map(Points::len).max().unwrap_or(0);
        return Err(Error::NotPositiveDefinite { what: "covariance".into(), size, jitter: JITTER[JITTER.len() - 1] });
    };
    Ok(finish(best, kernel, &standard, &scale, dimension, replaced, candidates))
}

/// Every kernel fitted to all runs; with a length that several samples share where otherwise every kernel interpolates.
fn fit_all(kernels: &[Kernel], runs: &[Points], bounds: &Bounds, settings: &FitSettings) -> Vec<Option<OneFit>> {
    let fits: Vec<Option<OneFit>> = parallel::map(kernels, |k| fit_one(k, runs, bounds, settings));
    let predicts = |fits: &[Option<OneFit>]| fits.iter().flatten().any(|f| f.predicts);
    if predicts(&fits) {
        return fits;
    }
    let wider = bounds.wider();
    let again: Vec<Option<OneFit>> = parallel::map(kernels, |k| fit_one(k, runs, &wider, settings));
    if predicts(&again) { again } else { fits }
}

/// Place of the fit of the lowest negative log marginal likelihood among those that do not only interpolate.
fn best_of(fits: &[Option<OneFit>]) -> Option<usize> {
    let found = fits.iter().enumerate().filter_map(|(k, fit)| fit.as_ref().map(|fit| (k, fit)));
    found.min_by(|(_, a), (_, b)| b.predicts.cmp(&a.predicts).then(a.nll.total_cmp(&b.nll))).map(|(k, _)| k)
}

/// Every kernel fitted to blocks of the runs that are long compared with what the best one remembers, and the place of that one: it is
/// then fitted to all points where that is cheap, and led to the optimum of all points where it has a period, since a period
/// that is a little off is out of step at the other end of a run.
fn by_blocks(
    kernels: &[Kernel],
    runs: &[Points],
    bounds: &Bounds,
    settings: &FitSettings,
) -> (Vec<Option<OneFit>>, Option<usize>) {
    let mut stride = 1;
    let (mut fits, best) = loop {
        let fits = fit_all(kernels, &blocks::of(runs, stride), bounds, settings);
        let best = best_of(&fits);
        let short = |k: usize| fits[k].as_ref().is_some_and(|f| blocks::are_short(&kernels[k], &f.hyper, runs, stride));
        if !best.is_some_and(short) {
            break (fits, best);
        }
        stride *= 2;
    };
    if let Some(k) = best {
        let kernel = &kernels[k];
        let again = if kernel.has_state_space() {
            fit_one(kernel, runs, bounds, settings)
        } else if kernel.roles(1).contains(&Role::Period) {
            fits[k].as_ref().and_then(|found| polished(kernel, runs, bounds, settings, found))
        } else {
            None
        };
        if again.is_some() {
            fits[k] = again;
        }
    }
    (fits, best)
}

fn check(runs: &[Points], settings: &FitSettings) -> Result<usize> {
    let dimension = runs.first().map_or(0, Points::dimension);
    for run in runs {
        run.check()?;
        if run.dimension() != dimension {
            return Err(Error::shape("inputs of a run", dimension, run.dimension()));
        }
    }
    if runs.iter().all(Points::is_empty) {
        return Err(Error::TooFewSamples { what: "Gaussian process".into(), needed: 1, found: 0 });
    }
    if !(1e-6..=0.5).contains(&settings.noise_floor) {
        return Err(Error::range("noise_floor", "from 1e-6 to 0.5", settings.noise_floor));
    }
    if settings.noise.is_some_and(|n| !(n > 0.0 && n.is_finite())) {
        return Err(Error::range("noise", "above 0", settings.noise.unwrap_or(f64::NAN)));
    }
    Ok(dimension)
}

/// The kernels without those that need a period, where there are too few points to find one.
fn tellable(kernels: &[Kernel], runs: &[Points], dimension: usize) -> Vec<Kernel> {
    let plain = |k: &&Kernel| !k.roles(dimension).contains(&Role::Period);
    let kept: Vec<Kernel> = kernels.iter().filter(plain).cloned().collect();
    let few = runs.iter().map(Points::len).sum::<usize>() < FEW_POINTS;
    if few && !kept.is_empty() { kept } else { kernels.to_vec() }
}

/// The kernels whose cost is bearable, or a Matern kernel of linear cost where none is.
fn affordable(kernels: &[Kernel], runs: &[Points], settings: &FitSettings) -> (Vec<Kernel>, bool) {
    let largest = runs.iter().map(Points::len).max().unwrap_or(0);
    let total: f64 = runs.iter().map(|r| (r.len() as f64).powi(3)).sum();
    if largest <= settings.dense_limit && total <= 4.0 * (settings.dense_limit as f64).powi(3) {
        return (kernels.to_vec(), false);
    }
    let ordered = runs.iter().all(Points::ordered);
    let linear = |k: &Kernel| ordered && k.has_state_space();
    let kept: Vec<Kernel> = kernels.iter().filter(|k| linear(k)).cloned().collect();
    if !kept.is_empty() || !ordered {
        // Inputs without an order have no engine of linear cost: the caller thins or waits.
        return if kept.is_empty() { (kernels.to_vec(), false) } else { (kept, false) };
    }
    (vec![Kernel::Matern52, Kernel::Matern32], true)
}

fn candidate(kernel: &Kernel, fit: Option<&OneFit>) -> Candidate {
    Candidate {
        kernel: kernel.clone(),
        nll: fit.map_or(f64::INFINITY, |f| f.nll),
        leave_one_out: fit.map_or(f64::INFINITY, |f| f.leave_one_out),
        predicts: fit.is_some_and(|f| f.predicts),
        evaluations: fit.map_or(0, |f| f.evaluations),
    }
}

fn finish(
    best: OneFit,
    kernel: &Kernel,
    runs: &[Points],
    scale: &Scale,
    dimension: usize,
    replaced: bool,
    candidates: Vec<Candidate>,
) -> Fit {
    let evaluation = Evaluation { kernel, hyper: &best.hyper, jitter: best.jitter };
    let engine = evaluation.engine(&runs[0]);
    let mut hyper = best.hyper;
    let noise = hyper.pop().unwrap_or(f64::NAN).exp();
    kernel.rescale(dimension, &mut hyper, scale.deviation.ln());
    let n: usize = runs.iter().map(Points::len).sum();
    let weak = [
        (n < FEW_POINTS, Weakness::FewPoints),
        (noise > 0.98, Weakness::NoSignal),
        (!best.predicts, Weakness::Interpolates),
        (best.at_bound, Weakness::AtBound),
        (!best.converged, Weakness::NotConverged),
        (best.jitter > 0.0, Weakness::Jitter),
        (replaced, Weakness::KernelReplaced),
    ];
    Fit {
        kernel: kernel.clone(),
        hyper,
        dimension,
        noise: noise * scale.deviation,
        noise_floor: scale.noise_floor * scale.deviation,
        scale: scale.deviation,
        mean: scale.mean,
        nll: best.nll,
        jitter: best.jitter,
        engine,
        converged: best.converged,
        weak: weak.into_iter().filter_map(|(holds, w)| holds.then_some(w)).collect(),
        candidates,
    }
}

/// All targets are equal: a process of negligible amplitude and noise about them.
fn constant_fit(kernel: &Kernel, runs: &[Points], dimension: usize, scale: &Scale) -> Fit {
    let ordered = runs.iter().all(Points::ordered);
    let kernel = if ordered && !kernel.has_state_space() { &Kernel::Matern52 } else { kernel };
    let deviation = if scale.mean == 0.0 { 1e-12 } else { 1e-12 * scale.mean.abs() };
    let mut hyper = vec![0.0; kernel.n_hyper(dimension)];
    for (h, role) in hyper.iter_mut().zip(kernel.roles(dimension)) {
        let span = |d: usize| start::span(runs, d);
        match role {
            Role::Length(d) => *h = span(d).ln(),
            Role::Period => *h = span(0).ln(),
            _ => {}
        }
    }
    kernel.rescale(dimension, &mut hyper, deviation.ln());
    let noise = 0.1 * deviation;
    let engine = Evaluation { kernel, hyper: &hyper, jitter: 0.0 }.engine(&runs[0]);
    Fit {
        kernel: kernel.clone(),
        hyper,
        dimension,
        noise,
        noise_floor: noise,
        scale: deviation,
        mean: scale.mean,
        nll: f64::NEG_INFINITY,
        jitter: 0.0,
        engine,
        converged: true,
        weak: vec![Weakness::Constant],
        candidates: Vec::new(),
    }
}
