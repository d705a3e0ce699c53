//! What the logs exclude, and the power study.

/// Deviations from which a size shows 19 times in 20: the one-sided 5 % point and the 95 % power point of a normal variable.
/// Argument.
pub(crate) const SHOWN: f64 = 1.645 + 1.645;

/// Share of the typical size of an effect below which none is excluded: a thousandth of a motion's amplitude is what integrators and the digits of
/// a log agree to. Argument.
pub(crate) const FINEST: f64 = 1e-3;

/// A rollout further from its log than this many ranges of the column has left it: the run is then cut into pieces. Convention.
pub(crate) const LEFT_LOG: f64 = 2.0;

/// How near the gap of a planted effect must come to the one asked for: no finding depends on a tenth. Convention.
pub(crate) const CLOSE: f64 = 0.1;

/// Gaps that are planted, in noise deviations: one that is hardly seen, one that is, and one that is plain. Convention.
pub(crate) const GAPS: [f64; 3] = [1.0, 3.0, 10.0];

/// Error of an integration step of the copies, relative: far below the noise that is put on them. Convention.
pub(crate) const COPIED: f64 = 1e-7;

/// Deviations of a column's noise that its range has at least. Convention.
pub(crate) const RANGE: f64 = 10.0;

/// Least and largest factor from one trial of a strength to the next, up and down, and the one where the gap has no end. Convention.
pub(crate) const STRONGER: (f64, f64) = (1.02, 30.0);
pub(crate) const WEAKER: (f64, f64) = (1.0 / 30.0, 0.98);
pub(crate) const FAR_WEAKER: f64 = 0.1;

/// Number that stands for no row where seeds are made: the largest of its 24 bits. Argument.
pub(crate) const NO_ROW: u64 = (1 << 24) - 1;
