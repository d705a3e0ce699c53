//! Sums: squared errors of held-out rollouts in blocks, and what they come to by column and over all.

use crate::diagnose::limits::verify::{GROWN, QUIET};

/// Squared errors of one block of a run, in units of the noise: sums and counts by column.
#[derive(Clone)]
pub(super) struct Block {
    pub(super) before: Vec<f64>,
    pub(super) after: Vec<f64>,
    pub(super) count: Vec<f64>,
}

/// Root mean square of what `pick` sums up, over all columns.
pub(super) fn overall(blocks: &[Block], pick: impl Fn(&Block) -> &Vec<f64>) -> f64 {
    let sum: f64 = blocks.iter().flat_map(|b| pick(b).iter()).sum();
    let count: f64 = blocks.iter().flat_map(|b| b.count.iter()).sum();
    (sum / count).sqrt()
}

/// The floor, of a column whose rollouts come out below it no more than they leave: it is carried along straight lines from the starts, which
/// overrate what friction and stops take away again.
pub(super) fn reached(blocks: &[Block], floor: Vec<f64>) -> Vec<f64> {
    let one = |(c, floor): (usize, f64)| {
        let (before, after) = (rms(blocks, c, |b| b.before[c]), rms(blocks, c, |b| b.after[c]));
        if before > floor && after < floor { after } else { floor }
    };
    floor.into_iter().enumerate().map(one).collect()
}

/// Root mean square of what `pick` sums up for column `c`.
pub(super) fn rms(blocks: &[Block], c: usize, pick: impl Fn(&Block) -> f64) -> f64 {
    let count: f64 = blocks.iter().map(|b| b.count[c]).sum();
    (blocks.iter().map(pick).sum::<f64>() / count).sqrt()
}

/// The floor over all columns, each as often as it was measured.
pub(super) fn floor_of_all(blocks: &[Block], floor: &[f64]) -> f64 {
    let squares: f64 = blocks.iter().flat_map(|b| b.count.iter().zip(floor)).map(|(n, f)| n * f * f).sum();
    let count: f64 = blocks.iter().flat_map(|b| b.count.iter()).sum();
    (squares / count).sqrt()
}

/// Whether an error before is that of noise, of which the floor was computed or seen.
pub(super) fn is_quiet((before, floor): (f64, f64), is_computed: bool) -> bool {
    let is_floor = floor <= GROWN || !is_computed;
    before < (1.0 + QUIET) * floor && is_floor
}
