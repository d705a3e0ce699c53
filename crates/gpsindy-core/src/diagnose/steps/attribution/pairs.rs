//! Pairs: two suspects together, by products of their columns alone.
//!
//! Two effects that only help together are passed by where one is added at a time. With the columns of those that promise most at hand,
//! what every two of them explain is a system of two to four equations.

use crate::diagnose::catalogue::hypothesis::{Added, Start};
use crate::diagnose::fit::colours::noise::{ByNoise, Noise};
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::linear::basis::Basis;
use crate::diagnose::fit::linear::gains::{Gain, are_finite};
use crate::diagnose::fit::linear::responses::responses;
use crate::diagnose::limits::{CONVINCING, PAIRED, PAIRS, VIEWS};
use crate::diagnose::steps::attribution::survey::{Looked, Pair, Screened};
use crate::refine::dots::squares;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A suspect with the columns of its best start among those of all.
struct Candidate<'s> {
    screened: &'s Screened,
    start: usize,
    columns: Range<usize>,
}

impl Candidate<'_> {
    fn start(&self) -> (&Start, &[(usize, Added)]) {
        let applied = &self.screened.applied;
        (&applied.starts[self.start], &applied.fitted)
    }
}

/// The pairs that promise most by the noise model of `basis`, beside the effects that are there and in the place of each.
pub(crate) fn pairs(suspects: &[Option<Screened>], basis: &Basis, looked: &[Looked], at: &Linearised<'_>) -> Vec<Pair> {
    let (candidates, mut columns) = candidates(suspects, basis.noise, looked.len(), at);
    if candidates.len() < 2 {
        return Vec::new();
    }
    let before: Vec<f64> = columns.iter().map(|column| squares(column)).collect();
    let products = basis.products(&mut columns);
    let mut all = Vec::new();
    // In the place of two only where these are few: the number of pairs of places grows with the square.
    let most = if looked.len() <= VIEWS { 2 } else { 1 };
    for (view, (looked, products)) in looked.iter().zip(&products).enumerate() {
        if looked.places.len() > most {
            continue;
        }
        let alone = |c: &Candidate<'_>| c.screened.best_in(basis.noise, view);
        let mut own: Vec<Pair> = Vec::new();
        for (i, one) in candidates.iter().enumerate() {
            for other in &candidates[i + 1..] {
                let Some(pair) = together(basis, (one, other), (&before, products), &looked.places) else { continue };
                if pair.gain > alone(one).max(alone(other)) + 2.0 * CONVINCING {
                    own.push(pair);
                }
            }
        }
        own.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        own.truncate(PAIRS);
        all.extend(own);
    }
    all
}

/// The suspects with the largest gains in any view, by their best starts, and the columns of these.
fn candidates<'s>(
    suspects: &'s [Option<Screened>],
    noise: Noise,
    views: usize,
    at: &Linearised<'_>,
) -> (Vec<Candidate<'s>>, Vec<Vec<DVector<f64>>>) {
    let alone = || suspects.iter().flatten().filter(|s| s.members.len() == 1);
    let mut wanted: Vec<(&Screened, usize)> = Vec::new();
    for view in 0..views {
        let mut order: Vec<(&Screened, f64)> = alone().map(|s| (s, s.best_in(noise, view))).collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (screened, gain) in order.into_iter().take(PAIRED).filter(|o| o.1 > 0.0) {
            let has_it = |gains: &ByNoise<Vec<Gain>>| gains.of(noise).is_some_and(|gains| gains[view].gain >= gain);
            let start = screened.gains.iter().position(has_it).unwrap_or(0);
            if !wanted.iter().any(|(known, _)| known.members == screened.members) {
                wanted.push((screened, start));
            }
        }
    }
    let (mut candidates, mut columns) = (Vec::new(), Vec::new());
    for (screened, start) in wanted {
        let own: Vec<&Vec<f64>> = screened.applied.starts[start].columns.iter().collect();
        let Some(found) = responses(&screened.applied, at, &own) else { continue };
        if are_finite(&found) {
            candidates.push(Candidate { screened, start, columns: columns.len()..columns.len() + found.len() });
            columns.extend(found);
        }
    }
    (candidates, columns)
}

/// What two suspects explain together; nothing where one of them is none of the projected columns.
fn together(
    basis: &Basis,
    (one, other): (&Candidate<'_>, &Candidate<'_>),
    (before, (gram, slope)): (&[f64], &(DMatrix<f64>, DVector<f64>)),
    places: &[usize],
) -> Option<Pair> {
    let behind = before.len()..gram.nrows();
    let columns: Vec<usize> = one.columns.clone().chain(other.columns.clone()).chain(behind).collect();
    let own = DMatrix::from_fn(columns.len(), columns.len(), |i, j| gram[(columns[i], columns[j])]);
    let slope = DVector::from_iterator(columns.len(), columns.iter().map(|&i| slope[i]));
    let norms: Vec<f64> = one.columns.clone().chain(other.columns.clone()).map(|i| before[i]).collect();
    let (gain, values) = basis.gain_together(&[one.start(), other.start()], &norms, (own, slope))?;
    Some(Pair { members: [one.screened.members[0], other.screened.members[0]], places: places.to_vec(), values, gain })
}
