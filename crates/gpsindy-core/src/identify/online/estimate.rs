//! The estimate of a state.

/// Where a state is, by all samples so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value without noise, in the state's unit.
    pub value: f64,
    /// Its standard deviation.
    pub value_std: f64,
    /// Rate, in the state's unit per second.
    pub rate: f64,
    /// Its standard deviation.
    pub rate_std: f64,
}
