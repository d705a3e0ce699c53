//! Periods and phases of sample-and-holds, which are found by trial.

/// Periods in the beginning of a log on which the search starts: enough for a quarter of a period to show, few enough
/// for a lattice of a hundred points. A count like [`super::SWAPPED`]. Convention.
pub(crate) const CELLS: f64 = 16.0;

/// Parts of a period by which the last of these moments moves from one trial to the next: half of one is an eighth, and
/// seven eighths of what is held are then right. Argument.
pub(crate) const LATTICE: f64 = 4.0;
pub(crate) const PHASES: f64 = 4.0;

/// Trials that go on to twice the length; on whole logs half as many from one lattice to the next, down to the fewest. Convention.
pub(crate) const KEPT: usize = 16;
pub(crate) const FEWEST_TRIALS: usize = 2;

/// How far from its start a period is looked for: starts are a quarter apart. Argument.
pub(crate) const REACH: f64 = 1.3;

/// Share of a sample by which the last moment of a log may move from one trial to the next. Convention.
pub(crate) const FINE: f64 = 0.25;

/// Distances of neighbours on a lattice within which two trials have the same one: more than half, so that none falls between.
/// Argument.
pub(crate) const BESIDE: f64 = 0.75;

/// Share by which a period of whole samples may pass the ends of its range: rounding. Argument.
pub(crate) const PAST_END: f64 = 1e-3;
