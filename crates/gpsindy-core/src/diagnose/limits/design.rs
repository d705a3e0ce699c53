//! The next experiment.

/// Signals of each form that are drawn, rounds of refining the best one, and variations of it in a round: they trade time
/// for separation, and none was varied on its own. Convention.
pub(crate) const DRAWN_SIGNALS: usize = 40;
pub(crate) const DESIGN_ROUNDS: usize = 24;
pub(crate) const VARIATIONS: usize = 16;

/// Sets of sizes that a truth is drawn with beside its best ones, so that a signal does not rest on one value. Convention.
pub(crate) const SIZES: usize = 3;

/// How often a signal that leaves the bounds of a state is made smaller by a third, at most: to an eighth. Convention.
pub(crate) const SHRINKINGS: usize = 6;

/// Nats at which the right one of a pair has 95 %: the logarithm of nineteen to one. Argument.
pub(crate) const SEPARATE: f64 = 2.944;

/// Moments of a run at which the separation so far is stated. Convention.
pub(crate) const MOMENTS: usize = 50;

/// Most accounts of one place that are kept beside its twins: what else may be asked for by name. Convention.
pub(crate) const OTHERS: usize = 3;

/// Typical sizes of a parameter by which it may be off where the logs say nothing of it. Convention.
pub(crate) const UNKNOWN: f64 = 10.0;

/// By how much a signal that leaves the bounds is made smaller. Convention.
pub(crate) const SMALLER: f64 = 0.7;

/// Deviations of its noise that a state typically goes. Convention.
pub(crate) const TYPICAL_NOISE: f64 = 100.0;

/// Share of its value that a drawn size keeps which would change its sign. Convention.
pub(crate) const KEPT_SIGN: f64 = 0.1;

/// Sines of a multisine. Convention.
pub(crate) const SINES: usize = 6;

/// Samples that a step lasts at least, and that a period of a sine has. Convention.
pub(crate) const SHORTEST_STEP: f64 = 6.0;

/// Share of a run that a step lasts at most: four levels are seen. Convention.
pub(crate) const LONGEST_STEP: f64 = 0.25;

/// Lowest frequencies of a run within which a multisine reaches at least. Convention.
pub(crate) const OCTAVES: f64 = 4.0;

/// Share of the range that a signal has at least, the shares of a run that a variation bends, and by how much it stretches there.
/// Convention.
pub(crate) const LEAST_REACH: f64 = 0.05;
pub(crate) const BENDS: (f64, f64) = (0.02, 1.0);
pub(crate) const STRETCHES_BY: (f64, f64) = (0.5, 1.6);

/// Length of a designed run, s, and its rate, Hz, where none are asked for. Convention.
pub(crate) const DURATION: f64 = 10.0;
pub(crate) const RATE: f64 = 50.0;
