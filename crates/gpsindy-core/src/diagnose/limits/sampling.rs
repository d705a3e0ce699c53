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

/// Share of a sample by which the last moment of a log may move from one trial to the next: moments of a period that is a whole number of
/// tenths of a sample fall on stamps now and then, and just behind one they are a sample late. Argument.
pub(crate) const FINE: f64 = 0.0625;

/// Distances of neighbours on a lattice within which two trials have the same one: more than half, so that none falls between.
/// Argument.
pub(crate) const BESIDE: f64 = 0.75;

/// Share by which a period of whole samples may pass the ends of its range: rounding. Argument.
pub(crate) const PAST_END: f64 = 1e-3;

/// Least changes of a column that show a length of its repeats: a fifth of them may be off and sixteen agree. A count like
/// [`super::SWAPPED`]. Convention.
pub(crate) const FEWEST_CHANGES: usize = 20;

/// Values between two changes of a column that repeats its readings: two, the shortest period that is tried. Argument.
pub(crate) const SHORTEST_REPEAT: usize = 2;

/// One of so many repeats may be shorter than the sensor's period: a stamp that was lost. Of values that change by chance as many end
/// after one. Convention.
pub(crate) const IRREGULAR: usize = 20;

/// By which share three quarters of the repeats may be longer than the shortest, beside one sample for a period that is no whole number of
/// them: a jitter of an eighth to either side. What changes by chance repeats itself for lengths that differ tenfold. Argument.
pub(crate) const LONGER: f64 = 0.25;

/// Share of the changes that a sensor's clock must foresee, and by what share of a sample it may miss their stamps: stamps have a jitter
/// of their own. Convention.
pub(crate) const FITTING: f64 = 0.95;
pub(crate) const OFF_STAMP: f64 = 0.25;

/// Steps, or periods, below which there is one and not two. Argument.
pub(crate) const ONE_NOT_TWO: f64 = 1.5;

/// Share of the longest run in the longest period whose jitter is looked for: ten of them, as where it is tried. Convention.
pub(crate) const OF_RUN: f64 = 0.1;

/// Ratio of the periods at which the jitter of a held control is rolled out: a sixteenth to either side of one, its size is within an eighth
/// of that of its neighbours. Argument.
pub(crate) const NEAR: f64 = 1.125;

/// Samples of the log in the longest period whose jitter is looked for: as of those that are tried. Convention.
pub(crate) const LONGEST_SEEN: f64 = 40.0;

/// Parts of a turn by which the phase at the end of the logs moves from one period to the next, and how many periods are tried near one at
/// most. Convention.
pub(crate) const TURN_OF: f64 = 4.0;
pub(crate) const MOST_TURNS: usize = 4096;

/// Periods of a held control that a fit goes on from by its jitter. A count like [`super::SWAPPED`]. Convention.
pub(crate) const SEEN: usize = 2;
