//! Where the gap lies.

/// Parts into which a variable's range and a run's time are cut: as many as a reader takes in at a glance. Convention.
pub(crate) const BINS: usize = 8;

/// Factor of the mean square within which neighbouring parts are one: what 30 samples of noise differ by. Argument.
pub(crate) const ONE_PART: f64 = 1.5;

/// Most rows of a list: one screen. Convention.
pub(crate) const MOST_ROWS: usize = 12;

/// Share of the gap from which a state is in the list. Convention.
pub(crate) const LISTED: f64 = 0.005;

/// Mean square that a named effect has at least, so that its row is listed at all. Convention.
pub(crate) const LISTED_AT_ALL: f64 = 1e-9;

/// Part of what an unnamed function gains that is its row's, where nothing has a name: it orders the rows and weighs nothing else.
/// Convention.
pub(crate) const ORDERS: f64 = 1e-3;
