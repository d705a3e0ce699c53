//! The fit of one kernel: hyperparameters, and whether it predicts what is left out.

use super::cost::Cost;
use super::search::{polish, search};
use super::settings::FitSettings;
use super::start::Bounds;
use crate::gp::kernel::Kernel;
use crate::gp::likelihood::{Evaluation, Workspace};
use crate::gp::points::Points;
use crate::optimise::Minimum;

/// Jitter ladder, relative to the diagonal; tried only where the one before fails.
pub(super) const JITTER: [f64; 4] = [0.0, 1e-10, 1e-8, 1e-6];
/// A fit that leaves more than this share of the variance unpredicted ...
const UNPREDICTED: f64 = 0.25;
/// ... while it calls less than this share of the leave-one-out error noise, interpolates.
const NOISE_SHARE: f64 = 0.1;

/// One kernel fitted.
pub(super) struct OneFit {
    /// Standardised log hyperparameters, the log noise last.
    pub(super) hyper: Vec<f64>,
    pub(super) nll: f64,
    pub(super) jitter: f64,
    pub(super) converged: bool,
    pub(super) at_bound: bool,
    pub(super) leave_one_out: f64,
    pub(super) predicts: bool,
    pub(super) evaluations: usize,
}

/// The fit of one kernel to all runs; `None` where the cost is undefined everywhere.
pub(super) fn fit_one(kernel: &Kernel, runs: &[Points], bounds: &Bounds, settings: &FitSettings) -> Option<OneFit> {
    JITTER.iter().find_map(|&jitter| fit_with_jitter(kernel, runs, bounds, settings, jitter))
}

fn fit_with_jitter(
    kernel: &Kernel,
    runs: &[Points],
    bounds: &Bounds,
    settings: &FitSettings,
    jitter: f64,
) -> Option<OneFit> {
    let cost = Cost::new(kernel, runs, bounds, settings, jitter);
    let mut workspace = Workspace::default();
    let minimum = search(&cost, settings, &mut workspace)?;
    judged(&cost, minimum, &mut workspace)
}

/// The optimum of all points near that of a part of them.
pub(super) fn polished(
    kernel: &Kernel,
    runs: &[Points],
    bounds: &Bounds,
    settings: &FitSettings,
    found: &OneFit,
) -> Option<OneFit> {
    let cost = Cost::new(kernel, runs, bounds, settings, found.jitter);
    let mut workspace = Workspace::default();
    let minimum = polish(&cost, &found.hyper, &mut workspace)?;
    judged(&cost, minimum, &mut workspace)
}

/// A minimum of the cost with how well it predicts what is left out.
fn judged(cost: &Cost, minimum: Minimum, workspace: &mut Workspace) -> Option<OneFit> {
    let (kernel, runs, jitter) = (cost.kernel, cost.runs, cost.jitter);
    let (hyper, evaluations) = (cost.expand(&minimum.point), minimum.evaluations);
    let evaluation = Evaluation { kernel, hyper: &hyper, jitter };
    let nll = cost.likelihood(minimum.cost, &minimum.point);
    let (leave_one_out, share) = left_out(&evaluation, runs, workspace)?;
    let predicts = leave_one_out.powi(2) <= UNPREDICTED || share >= NOISE_SHARE;
    let at_bound = cost.at_bound(&minimum.point);
    Some(OneFit { nll, jitter, converged: minimum.converged, at_bound, leave_one_out, predicts, evaluations, hyper })
}

/// Root-mean-square leave-one-out error, and the share of its square that the noise accounts for.
fn left_out(evaluation: &Evaluation, runs: &[Points], workspace: &mut Workspace) -> Option<(f64, f64)> {
    let (mut sum, mut noise, mut count) = (0.0, 0.0, 0.0);
    let noise2 = (2.0 * evaluation.hyper.last()?).exp();
    for run in runs.iter().filter(|r| !r.is_empty()) {
        let out = evaluation.leave_one_out(run, workspace)?;
        for i in 0..run.len() {
            sum += (out.weights[i] / out.diagonal[i]).powi(2);
            noise += noise2 * run.noise_weight(i);
            count += 1.0;
        }
    }
    let rms = (sum / count).sqrt();
    rms.is_finite().then_some((rms, if sum > 0.0 { noise / sum } else { 1.0 }))
}
