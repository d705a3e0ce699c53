//! The check on held-out logs.

/// Blocks of a run for the interval, and bootstrap draws: the end of a 95 % interval then scatters by a tenth of it. Argument.
pub(crate) const BLOCKS: usize = 8;
pub(crate) const DRAWS: usize = 400;

/// Draws of random forces and noise, for the band that holds their errors and for how often it does: a share of 95 % is then known to
/// a hundredth. Argument.
pub(crate) const SPREADS: usize = 200;

/// Half width of a band that holds 95 % of a normal variable, in its deviations. Argument.
pub(crate) const BAND_95: f64 = 1.96;
/// Probability below its upper end. Argument.
pub(crate) const OF_BAND_95: f64 = 0.975;

/// Chance below which errors are no longer those that the forces predict: one true force in a hundred is doubted. Convention.
pub(crate) const COVERED: f64 = 0.01;

/// Error over the noise's floor, as a share of it, within which held-out runs show no gap to close. Convention.
pub(crate) const QUIET: f64 = 0.1;

/// Share of the floor below which there is no gap to close: the floor itself is known no better: 800 samples show
/// a variance to a twentieth. Argument.
pub(crate) const NO_GAP: f64 = 0.05;

/// Times the noise that samples show beside each other from which a sensor's slow error is remarked on where no gap is found: an autoregression with
/// a coefficient of 0.87 has as much. Convention.
pub(crate) const SEVERAL: f64 = 2.0;

/// Squared error of a column beyond its floor's, as a share of it, that the noise still allows a right model: its
/// parameters and starts are fitted, and the floor is estimated. Set on development seeds 0 to 400 and 5000 to 5040. Data: as said.
pub(crate) const ALLOWED: f64 = 0.25;

/// Floor (noise units) above which held-out rollouts are halved, and below which alone they may be called quiet: three quarters of its squares are
/// then the error of the start, which the model carries on. Convention.
pub(crate) const GROWN: f64 = 2.0;

/// Odds beforehand that something is missing where a fit on the training logs shows nothing: drawn cases outside the
/// catalogue to the others, one in six of the generator's mixed suite. Data: the mix of the generator of random systems.
pub(crate) const RARELY: f64 = 0.2;

/// Part of a column's gap that may be left: what remains is then below a hundredth. Argument.
pub(crate) const LEFT: f64 = 0.01;

/// Values that differ by less than this share of their size are one: the rounding of a log's digits. Argument.
pub(crate) const LOG_DIGITS: f64 = 1e-9;

/// Part of a column's motion, in squares, and of its noise, that an error may have before the column is lost: half of what it moves,
/// and twice the noise, which alone is no motion. Convention.
pub(crate) const LOST: f64 = 0.25;
pub(crate) const LOST_NOISE: f64 = 4.0;

/// Percent in a whole. Argument.
pub(crate) const PERCENT: f64 = 100.0;
/// Milliseconds in a second. Argument.
pub(crate) const MILLI: f64 = 1000.0;

/// Percent of the gap below which a share is printed as "less than": its last digit. Convention.
pub(crate) const LEAST_PERCENT: f64 = 0.1;
/// Sizes between which a number is printed without an exponent. Convention.
pub(crate) const PLAIN: (f64, f64) = (1e-4, 1e6);

/// Multiple of the held-out error beyond which causes with a name beside random forces do harm: where they are right a force of chance makes it a
/// few percent larger. Convention.
pub(crate) const HARM: f64 = 1.05;
