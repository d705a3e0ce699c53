//! Random forces.

/// Correlation times and standard deviations that are tried first: factors of about four between neighbours, which the
/// likelihood, a hill as wide as that in both, does not fall between.
pub(crate) const DURATIONS: usize = 6;
pub(crate) const LEVELS: usize = 6;

/// Steps from the best of them to the top at most: a descent by slopes takes ten, and as many again around a corner.
pub(crate) const STEPS: u64 = 20;

/// Nats that the last step of a climb brings: a seventh of an interval's half width from the top.
pub(crate) const REST: f64 = 0.01;

/// Longest correlation time, as a share of all logs together: a force that changed fewer than five times was not seen to be
/// random, and takes the place of any function of the motion.
pub(crate) const LONGEST: f64 = 0.2;

/// Readings after which no further stretch is filtered: a function that explains a hundredth of what is left gains 60 in twice the log likelihood by
/// then. A count like [`super::SWAPPED`].
pub(crate) const MOST_READINGS: usize = 6000;

/// The same where only the neighbourhood of the top is looked for: on a fourth of the readings it moves by twice the width of
/// an interval, less than the starts lie apart.
pub(crate) const SKETCHED: usize = 1500;

/// Chance of a function's gain beside the forces of a sketch below which what is left follows a law: one random force in a thousand
/// is then passed by.
pub(crate) const LAWFUL: f64 = 1e-3;

/// Places that are climbed, those with the highest sketches first: these see a part of the logs, which may exchange the first two.
pub(crate) const CLIMBED: usize = 2;

/// Paths about which a climb goes, one after the other, and the nats below which a climb brought nothing that asks for the next
/// path: far below [`super::CONVINCING`].
pub(crate) const MOST_PATHS: usize = 2;
pub(crate) const SAME: f64 = 0.5;

/// Share of a row's typical rate below which a random force is not looked for.
pub(crate) const UNSEEN: f64 = 1e-3;
