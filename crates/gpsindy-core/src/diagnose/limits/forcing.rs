//! Random forces.

/// Correlation times and standard deviations that are tried first: factors of about four between neighbours, which the
/// likelihood, a hill as wide as that in both, does not fall between. Argument.
pub(crate) const DURATIONS: usize = 6;
pub(crate) const LEVELS: usize = 6;

/// Steps from the best of them to the top at most: a descent by slopes takes ten, and as many again around a corner. Convention.
pub(crate) const CLIMB_STEPS: u64 = 20;

/// Nats that the last step of a climb brings: a seventh of an interval's half width from the top. Argument.
pub(crate) const LAST_STEP: f64 = 0.01;

/// Longest correlation time, as a share of all logs together: a force that changed fewer than five times was not seen to be
/// random, and takes the place of any function of the motion. Argument.
pub(crate) const LONGEST: f64 = 0.2;

/// Readings after which no further stretch is filtered: a function that explains a hundredth of what is left gains 60 in twice the log likelihood by
/// then. A count like [`super::SWAPPED`]. Argument.
pub(crate) const MOST_READINGS: usize = 6000;

/// The same where only the neighbourhood of the top is looked for: on a fourth of the readings it moves by twice the width of
/// an interval, less than the starts lie apart. Argument.
pub(crate) const SKETCHED_READINGS: usize = 1500;

/// Chance of a function's gain beside the forces of a sketch below which what is left follows a law: one random force in a thousand
/// is then passed by. Convention.
pub(crate) const LAWFUL: f64 = 1e-3;

/// Correlation times of a force that a sketch holds where it may show a law: with fewer its variance is known to worse than a quarter
/// (`sqrt(2/30)`), and some function runs beside it by chance. Argument.
pub(crate) const CHANGES: f64 = 30.0;

/// How the chances of laws crowd near zero: one that explains a hundredth of what is left gains 60 by [`MOST_READINGS`], a chance of a
/// millionth for ten functions, and half of the laws explain more. Then `0.5 = 1e-6^0.05`. Argument.
pub(crate) const CROWDED_LAW: f64 = 0.05;

/// Places that are climbed, those with the highest sketches first: these see a part of the logs, which may exchange the first two.
/// Convention.
pub(crate) const CLIMBED: usize = 2;

/// Paths about which a climb goes, one after the other, and the nats below which a climb brought nothing that asks for the next
/// path: far below [`super::CONVINCING`]. Convention.
pub(crate) const MOST_PATHS: usize = 2;
pub(crate) const SETTLED: f64 = 0.5;

/// Share of a row's typical rate below which a random force is not looked for. Convention.
pub(crate) const UNSEEN: f64 = 1e-3;

/// Correlation times within a step up to which what a process moves is a series without differences of large numbers: its terms
/// reach e^8 = 3000, three digits of sixteen. Argument.
pub(crate) const SOON: f64 = 8.0;

/// Share of the first term below which the last one of a series has come to rest. Convention.
pub(crate) const CONVERGED: f64 = 0.1;

/// Step of a logarithm in a curvature: wide enough to see the curve beside the rounding, narrow enough to be one. Convention.
pub(crate) const CURVED: f64 = 0.1;

/// Step of a logarithm, or of a parameter in its typical size, in the slope of a cost: half of the digits of a likelihood. Argument.
pub(crate) const SLOPED: f64 = 1e-4;

/// Steps that the parameters of a machine take beside random forces: innovations are nearly linear in them, so that the second is the last that
/// matters. Convention.
pub(crate) const TUNED: usize = 4;

/// Shares of such a step that are tried. Convention.
pub(crate) const SHORTENED: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// Effects of one size that are tried beside a random force by what their straight lines promise there. Convention.
pub(crate) const BESIDE_FORCES: usize = 3;
