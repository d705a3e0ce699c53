//! The account of a computation: counts of what it did with its logs, a measure of its cost that needs no clock and no idle machine,
//! and when it must end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// What rollouts are made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Derivatives of a fit.
    Derivatives,
    /// Trial steps of a fit, and comparisons.
    Trials,
    /// Responses to suspects.
    Responses,
}

/// Counts so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Samples that were passed for each [`Purpose`]; lanes that pass side by side count once.
    pub(crate) samples: [u64; 3],
    /// Fits that were begun.
    pub(crate) fits: u64,
    /// Suspects' columns that were made.
    pub(crate) columns: u64,
}

impl Counts {
    /// What came after `earlier`.
    pub(crate) fn since(self, earlier: Self) -> Self {
        Self {
            samples: std::array::from_fn(|i| self.samples[i] - earlier.samples[i]),
            fits: self.fits - earlier.fits,
            columns: self.columns - earlier.columns,
        }
    }

    /// Both together.
    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            samples: std::array::from_fn(|i| self.samples[i] + other.samples[i]),
            fits: self.fits + other.fits,
            columns: self.columns + other.columns,
        }
    }
}

/// Counts that all threads of a computation share.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    samples: [AtomicU64; 3],
    fits: AtomicU64,
    columns: AtomicU64,
    end: Option<Instant>,
    enough: Option<Arc<AtomicBool>>,
}

impl Tally {
    /// A computation that ends with what it has at a moment, or as soon as somebody has waited long enough.
    pub(crate) fn until(end: Option<Instant>, enough: Option<Arc<AtomicBool>>) -> Self {
        Self { end, enough, ..Self::default() }
    }

    /// Whether somebody has waited long enough.
    pub(crate) fn is_enough(&self) -> bool {
        self.enough.as_ref().is_some_and(|enough| enough.load(Ordering::Relaxed))
    }

    /// Whether time is up: a fit then ends where it is.
    pub(crate) fn is_over(&self) -> bool {
        self.is_enough() || self.end.is_some_and(|end| Instant::now() >= end)
    }

    pub(crate) fn pass(&self, purpose: Purpose, samples: usize) {
        self.samples[purpose as usize].fetch_add(samples as u64, Ordering::Relaxed);
    }

    pub(crate) fn fit(&self) {
        self.fits.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn columns(&self, count: usize) {
        self.columns.fetch_add(count as u64, Ordering::Relaxed);
    }

    pub(crate) fn counts(&self) -> Counts {
        Counts {
            samples: std::array::from_fn(|i| self.samples[i].load(Ordering::Relaxed)),
            fits: self.fits.load(Ordering::Relaxed),
            columns: self.columns.load(Ordering::Relaxed),
        }
    }
}
