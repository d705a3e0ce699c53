//! Fits that were made to smoothed logs. Searches over libraries that share terms come to the same equations again, and a fit from the
//! same start ends where it ended before.

use crate::error::Result;
use crate::refine::Point;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Where a fit ended.
#[derive(Debug, Clone)]
pub(crate) struct Ended {
    pub(crate) point: Point,
    /// Sum of squares and number of values of each column, in the column's unit.
    pub(crate) squares: Vec<f64>,
    pub(crate) counts: Vec<f64>,
    /// Share of the values that count as independent.
    pub(crate) share: f64,
    /// Standard error of everything that was free.
    pub(crate) errors: Vec<f64>,
    pub(crate) converged: bool,
}

/// The fits that were made, by all that they depend on besides the logs.
#[derive(Debug, Default)]
pub(crate) struct Made(Mutex<HashMap<Vec<u8>, Ended>>);

impl Made {
    /// The fit of this key, made where it is not there.
    pub(crate) fn get(&self, key: Vec<u8>, make: impl FnOnce() -> Result<Ended>) -> Result<Ended> {
        let known = |made: &Self| made.0.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(ended) = known(self) {
            return Ok(ended);
        }
        let ended = make()?;
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(key, ended.clone());
        Ok(ended)
    }

    /// How many there are.
    #[cfg(test)]
    pub(crate) fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }
}
