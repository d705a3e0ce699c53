//! A gap or none.

/// Structure (mean square, noise units) that no test calls a gap: a fourteenth of the noise's standard deviation.
///
/// A coarse integration, a rounded column or a control logged with few digits leave as much, and in a long
/// log a test of exactly nothing would find them. Convention.
pub(crate) const NEGLIGIBLE: f64 = 0.005;

/// Chance below which a gap is certain, and no further search is made for it: no model of the noise is right so far out. Argument.
pub(crate) const CERTAIN: f64 = 1e-12;

/// Mean squared change of the outputs (noise units) that a parameter may make within its tolerance and be no cause.
///
/// Half the noise's standard deviation: the user expects the parameter to be off by as much, and does not see it. Convention.
pub(crate) const TOLERABLE: f64 = 0.25;

/// Chance below which what is left is no noise: one null log in a hundred gets a function beside its causes. Convention.
pub(crate) const STRUCTURED: f64 = 0.01;

/// Frequencies of ripples that are tried from one of the first to the next: half a ripple over the range apart, an eighth of one is left. Argument.
pub(crate) const BETWEEN: usize = 4;
