//! Fits of a simulator that steps, whose rollouts cost far more than the algebra around them.
//!
//! A Jacobian takes one rollout for every initial state and free parameter, a trial step takes one. So Jacobians are handed on from
//! fit to fit and kept up by Broyden's rank-one update, and a window whose steps fail gets its own anew. Windows know of each other
//! by the parameters only: each has a damping of its own, and takes a step of its start only where that helps.
//! Source: Broyden 1965, A class of methods for solving nonlinear simultaneous equations (Math. Comp. 19); Madsen, Nielsen and
//! Tingleff 2004, Methods for non-linear least squares problems, section 3.5 (the secant version of Levenberg-Marquardt).

mod beginnings;
mod drawn;
mod slopes;
mod trial;

pub(crate) use beginnings::{chained_starts, first_starts, guess_starts, nearer_starts};
pub(crate) use drawn::{drawn_around, drawn_starts, draws_of_readings};

use super::blocks::squares;
use super::jacobian::{Jacobian, Point, prior_cost};
use super::normal::Normal;
use super::{Experiment, Found, Free, Kept, Refine, Refined};
use crate::error::Result;
use crate::model::System;
use slopes::{Scene, Slopes};
use std::sync::Arc;

/// Steps that must be left for a Jacobian to be made anew where a fit comes to rest: it costs as much as a dozen of them.
const WORTH: usize = 5;

/// Damping at first, its factors after a step that helped and one that did not, and its limits.
const DAMPING: f64 = 1e-3;
const LESS: f64 = 0.1;
const MORE: f64 = 30.0;
const LEAST: f64 = 1e-9;
const MOST: f64 = 1e6;

/// Steps in a row that do not help, after which there is no better point: dampings have grown by 27,000 by then.
const FAILURES: usize = 3;

/// Fits the free parameters and all starts from `point`, with derivatives of an earlier fit where they are `kept`.
pub(super) fn fit(
    settings: &Refine,
    (system, experiment, free): (&System, &Experiment, &[Free]),
    point: Point,
    kept: Option<&Arc<Kept>>,
    watch: &dyn Fn(usize) -> Result<()>,
) -> Result<(Refined, Jacobian)> {
    let scene = Scene { system, experiment, free };
    let mut search = Search::new(scene, point, kept.map(Arc::as_ref))?;
    let mut iterations = 0;
    let is_over = || experiment.tally.is_over();
    while iterations < settings.max_iterations && search.parts.iter().any(|part| part.rest.is_none()) && !is_over() {
        watch(iterations)?;
        iterations += 1;
        let may_renew = settings.max_iterations - iterations >= WORTH;
        search.advance(settings.tolerance, may_renew);
    }
    // A fit that only ranks is not worth derivatives of its own.
    let ranks_only = settings.only_ranks();
    if !ranks_only && !is_over() {
        let stale = (0..search.windows.len()).filter(|&w| !search.windows[w].is_verified());
        search.renew(&stale.map(|w| (w, Slopes::Fine)).collect::<Vec<_>>());
    }
    let converged = search.parts.iter().all(|part| part.rest == Some(Rest::Verified));
    let cost = search.cost();
    let found = Found { point: search.point, jacobian: search.jacobian, cost, converged, iterations };
    let (refined, jacobian) = found.refined(experiment, free);
    let kept =
        if ranks_only { kept.cloned() } else { Some(Arc::new(Kept::new(jacobian.clone(), system, experiment, free))) };
    Ok((Refined { kept, ..refined }, jacobian))
}

/// Residuals and derivatives of every window, those of an earlier fit as far as it has them.
pub(super) fn jacobian(
    system: &System,
    experiment: &Experiment,
    point: &Point,
    free: &[Free],
    kept: Option<&Kept>,
) -> Result<Jacobian> {
    let scene = Scene { system, experiment, free };
    let mut blocks = scene.blocks(point)?;
    let mut wanted = scene.all_of(0..experiment.windows.len());
    if let Some(kept) = kept {
        let own = (system, experiment, free);
        wanted.retain(|&(window, column)| !kept.fill(own, (window, column), &mut blocks[window]));
    }
    scene.differentiate(point, Slopes::Fine, &wanted, &mut blocks);
    Ok(Jacobian { blocks, n_states: system.n_states() })
}

/// Where a fit is.
struct Search<'a> {
    scene: Scene<'a>,
    point: Point,
    jacobian: Jacobian,
    windows: Vec<State>,
    parts: Vec<Part>,
    /// Damping of the parameters' steps.
    damping: f64,
}

/// A window within a search.
#[derive(Debug, Clone, Copy)]
struct State {
    squares: f64,
    damping: f64,
    /// The slopes that its derivatives are made with.
    slopes: Slopes,
    /// Whether they were made where the window starts now.
    is_fresh: bool,
    failures: usize,
}

/// Windows that share something to fit: all of them where parameters are free, else each on its own.
struct Part {
    windows: Vec<usize>,
    failures: usize,
    rest: Option<Rest>,
}

/// How a part came to rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rest {
    /// With derivatives that were made there.
    Verified,
    /// With those of an earlier point, and no steps left that would be worth new ones.
    Likely,
}

impl<'a> Search<'a> {
    fn new(scene: Scene<'a>, point: Point, kept: Option<&Kept>) -> Result<Self> {
        let mut blocks = scene.blocks(&point)?;
        let count = blocks.len();
        let mut wanted = scene.all_of(0..count);
        let kept = kept.filter(|kept| kept.serves(scene.experiment));
        let slopes = match kept {
            Some(kept) => {
                let own = (scene.system, scene.experiment, scene.free);
                wanted.retain(|&(window, column)| !kept.fill(own, (window, column), &mut blocks[window]));
                Slopes::Fine
            }
            None => Slopes::Coarse,
        };
        scene.differentiate(&point, slopes, &wanted, &mut blocks);
        let state = |squares| State { squares, damping: DAMPING, slopes, is_fresh: kept.is_none(), failures: 0 };
        let windows = blocks.iter().map(|block| state(squares(scene.experiment, &block.residual))).collect();
        let part = |windows| Part { windows, failures: 0, rest: None };
        let parts = if scene.free.is_empty() {
            (0..count).map(|w| part(vec![w])).collect()
        } else {
            vec![part((0..count).collect())]
        };
        let jacobian = Jacobian { blocks, n_states: scene.system.n_states() };
        Ok(Self { scene, point, jacobian, windows, parts, damping: DAMPING })
    }

    /// Sum of squares with the beliefs' terms.
    fn cost(&self) -> f64 {
        self.windows.iter().map(|w| w.squares).sum::<f64>() + prior_cost(&self.point.parameters, self.scene.free)
    }

    /// One step of all parts that are not at rest.
    fn advance(&mut self, tolerance: f64, may_renew: bool) {
        let normal = Normal::new(&self.jacobian, self.scene.experiment, &self.point, self.scene.free);
        let damping = |window: usize| self.windows[window].damping;
        let Some(aim) = normal.step_by_window(&self.point, self.scene.free, self.damping, &damping) else {
            return self.dampen();
        };
        let moving = self.parts.iter().filter(|p| p.rest.is_none()).flat_map(|p| p.windows.iter().copied());
        let tried = self.tried(&aim, &moving.collect::<Vec<usize>>());
        let mut stale = Vec::new();
        for p in 0..self.parts.len() {
            if self.parts[p].rest.is_some() {
                continue;
            }
            let windows = self.parts[p].windows.clone();
            let was_verified = windows.iter().all(|&w| self.windows[w].is_verified());
            let (before, gain) = self.take(&windows, &aim, &tried, was_verified);
            let part = &mut self.parts[p];
            part.failures = if gain > 0.0 { 0 } else { part.failures + 1 };
            let is_little = gain <= tolerance * before;
            let is_spent = gain > 0.0 || part.failures >= FAILURES;
            match (is_little, was_verified) {
                (true, true) if is_spent => part.rest = Some(Rest::Verified),
                (true, false) if may_renew => stale.extend(windows.iter().map(|&w| (w, Slopes::Fine))),
                (true, false) if is_spent => part.rest = Some(Rest::Likely),
                _ => stale.extend(windows.iter().filter_map(|&w| Some((w, self.windows[w].wanted()?)))),
            }
        }
        self.renew(&stale);
    }
}

impl State {
    fn is_verified(&self) -> bool {
        self.is_fresh && self.slopes == Slopes::Fine
    }

    /// The slopes that a window asks for whose steps fail for want of better derivatives.
    fn wanted(&self) -> Option<Slopes> {
        match (self.failures, self.is_fresh, self.slopes) {
            (2.., false, slopes) => Some(slopes),
            (2.., true, Slopes::Coarse) => Some(Slopes::Fine),
            _ => None,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::stepping::Stepping;

    /// A spring of stiffness 4, and noise-free logs of one with 5 in 20 windows.
    fn softer_than_its_logs() -> (Arc<Stepping>, System, Experiment) {
        let spring = Arc::new(Stepping::spring());
        let system = spring.system("x", ("k", 4.0));
        let command = |i: usize| (0.02 * i as f64).sin() + f64::from((i / 70).is_multiple_of(2));
        let data = spring.log(("x", 5.0), ([0.5, 0.0], 1000), command, command, |_, x| x);
        let experiment = Experiment::new(&system, &data, Some(&[1e-3, 1e-2])).unwrap().with_windows_of(0.5);
        (spring, system, experiment)
    }

    #[test]
    fn derivatives_that_are_handed_on_save_rollouts_and_change_no_answer() {
        let (spring, system, experiment) = softer_than_its_logs();
        let free = [Free::new(0, 1.0)];
        let starts = guess_starts(&system, &experiment, &[4.0]).unwrap();
        let fit = |steps: usize, kept: Option<&Arc<Kept>>| {
            let settings = Refine { max_iterations: steps, ..Refine::default() };
            let before = spring.rows();
            let fit = settings.fit_on(&system, &experiment, (&[4.0], &free), &starts, kept).unwrap();
            (fit, spring.rows() - before)
        };
        let (first, _) = fit(60, None);
        assert!(first.converged && (first.parameters[0] - 5.0).abs() < 1e-4, "{first:?}");
        let (again, _) = fit(60, first.kept.as_ref());
        assert!(again.converged && (again.parameters[0] - 5.0).abs() < 1e-4, "{again:?}");
        // The fits that only rank are many.
        let ((alone, made), (ranked, handed_on)) = (fit(4, None), fit(4, first.kept.as_ref()));
        assert!((alone.parameters[0] - 5.0).abs() < 1e-2 && (ranked.parameters[0] - 5.0).abs() < 1e-2, "{ranked:?}");
        assert!(handed_on < made, "{handed_on} rows, {made} without");
    }

    #[test]
    fn windows_without_a_parameter_come_to_rest_one_by_one() {
        let (_, system, experiment) = softer_than_its_logs();
        let starts = guess_starts(&system, &experiment, &[5.0]).unwrap();
        let settings = Refine::default();
        let fit = settings.fit(&system, &experiment, &[5.0], &[], Some(&starts)).unwrap();
        let window = experiment.windows[7];
        let log = &experiment.logs[window.log].measured;
        assert!(fit.converged);
        assert!((fit.initial[7][0] - log[0][window.first]).abs() < 1e-5, "{:?}", fit.initial[7]);
        assert!((fit.initial[7][1] - log[1][window.first]).abs() < 1e-4, "{:?}", fit.initial[7]);
    }
}
