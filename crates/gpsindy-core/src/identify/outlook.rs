//! What the logs leave open of a learnt model, as data.

use crate::identify::limits::{CLOSE, ON_COURSE};

/// What the logs leave open.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Outlook {
    /// How the equations foretell a part of the logs that they were not fitted to; none where the logs are too short for that.
    pub left_out: Option<LeftOut>,
    /// How far rollouts from other starts can be relied on.
    pub doubt: Doubt,
    /// Terms that could take each other's place.
    pub exchangeable: Vec<Exchange>,
}

/// How the terms, their coefficients fitted to the first three quarters of every run, foretell the last quarter.
///
/// Errors are root mean squares over samples and states, each state in units of its standard deviation over all logs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LeftOut {
    /// Error of rollouts from the smoothed states; none where one diverges.
    pub error: Option<f64>,
    /// Error of the mean of that part.
    pub mean: f64,
    /// Whether no state leaves the range of the first part there.
    pub inside: bool,
}

impl LeftOut {
    /// Whether the rollouts miss that part clearly more than its mean does, and by more than a tenth of the variance of all logs.
    pub fn is_missed(&self) -> bool {
        self.error.is_none_or(|error| error > (ON_COURSE * self.mean).max(CLOSE.sqrt()))
    }

    /// Whether it is missed although the first part covers its range.
    pub fn is_poor(&self) -> bool {
        self.inside && self.is_missed()
    }
}

/// Shares, from 0 to 1, of starts in and around what was logged: a range of each state to both sides.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Doubt {
    /// Of starts from which the rollout diverges.
    pub diverging: f64,
    /// Of starts, and of equations that other noise of the same size would have led to, whose rollouts are foretold worse than by
    /// their mean.
    pub open: f64,
    /// Of starts from which a difference of the size of the noise outgrows the motion.
    pub unstable: f64,
}

/// Two terms of one equation of which the logs say hardly which it is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Exchange {
    /// The state.
    pub state: String,
    /// The term in its equation.
    pub term: String,
    /// The term that could stand there.
    pub other: String,
}
