//! Starts of a simulator that steps, drawn about what is known of them.

use crate::error::{Error, Result};
use crate::model::System;
use crate::random::normal;
use crate::refine::stepped::beginnings::{LONGEST, as_read, squares};
use crate::refine::{Experiment, Refine, Window};
use nalgebra::{Cholesky, DVector, Dyn};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// Draws of a start whose fit is doubted, and how many of them are fitted. An arm of six joints whose wrist's servo leaves its limit within the
/// window: of 2000 draws one in a hundred came within 2.7 times the noise's variance, from which a fit reaches the true start.
const DRAWS: usize = 256;
const FITTED: usize = 4;

/// Initial states of some `windows`, each the best of several that `draw` makes of the window's number. Rollouts choose among them, not fits:
/// those along ever longer beginnings would all end where the first of them did.
///
/// # Errors
/// A computation that was asked to stop.
pub(crate) fn drawn_starts(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    windows: &[usize],
    draw: &mut dyn FnMut(usize) -> Vec<f64>,
) -> Result<Vec<Vec<f64>>> {
    let beginning = |w: usize| {
        let window = experiment.windows[w];
        Window { last: window.last.min(window.first + LONGEST - 1), ..window }
    };
    let repeated = |times: usize| Experiment {
        windows: windows.iter().flat_map(|&w| std::iter::repeat_n(beginning(w), times)).collect(),
        ..experiment.clone()
    };
    let many = repeated(DRAWS);
    let starts: Vec<Vec<f64>> = windows.iter().flat_map(|&w| std::iter::repeat_n(w, DRAWS)).map(draw).collect();
    let costs = squares(system, &many, parameters, &starts);
    let few = repeated(FITTED);
    let nearest = (0..windows.len()).flat_map(|k| {
        let mut own: Vec<usize> = (k * DRAWS..(k + 1) * DRAWS).collect();
        own.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
        own.into_iter().take(FITTED)
    });
    let starts: Vec<Vec<f64>> = nearest.map(|i| starts[i].clone()).collect();
    let starts = match Refine::default().fit(system, &few, parameters, &[], Some(&starts)) {
        Ok(fit) => fit.initial,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(_) => starts,
    };
    let costs = squares(system, &few, parameters, &starts);
    let best = |k: usize| (k * FITTED..(k + 1) * FITTED).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    Ok((0..windows.len()).filter_map(|k| Some(starts[best(k)?].clone())).collect())
}

/// Draws of a window's start that differ from its first readings by as much as the noise does.
pub(crate) fn draws_of_readings(system: &System, experiment: &Experiment) -> impl FnMut(usize) -> Vec<f64> + use<> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let starts = as_read(system, experiment);
    let (columns, noise) = (experiment.columns.clone(), experiment.noise.clone());
    move |w| {
        let mut start = starts[w].clone();
        columns.iter().zip(&noise).for_each(|(&state, noise)| start[state] += noise * normal(&mut random));
        start
    }
}

/// A start about a fitted one, as far from it as the values that it was fitted to leave open, and that distance squared in deviations;
/// `known`: the Cholesky factor of what they say of it, in squares of the noise.
pub(crate) fn drawn_around(start: &[f64], known: &Cholesky<f64, Dyn>, random: &mut ChaCha8Rng) -> (Vec<f64>, f64) {
    let noise = DVector::from_fn(start.len(), |_, _| normal(random));
    let error = known.l_dirty().tr_solve_lower_triangular(&noise).unwrap_or_else(|| noise.map(|_| 0.0));
    (start.iter().zip(&error).map(|(value, error)| value + error).collect(), noise.norm_squared())
}
