//! Curves of the report.

/// Runs of either kind whose columns are drawn: all of them would make a page of many megabytes. Convention.
pub(crate) const DRAWN_RUNS: usize = 2;

/// Lags of an autocorrelation: the longest memory that noise has here, see [`super::FAR`]. Argument.
pub(crate) const LAGS: usize = 40;

/// Half width of the band that holds 99 % of a normal variable, in its deviations. Argument.
pub(crate) const BAND_99: f64 = 2.576;
