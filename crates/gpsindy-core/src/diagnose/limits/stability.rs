//! Whether a cause keeps its size.

/// Share by which a size may differ between parts and count as one: corners are smoothed, steps are finite. Convention.
pub(crate) const SAME_SIZE: f64 = 0.05;

/// Chance below which a part counts as one that disagrees; the parts of one question pay for each other.
/// With three questions a cause, three right causes in a hundred are doubted. Convention.
pub(crate) const DISAGREES: f64 = 0.01;

/// Most runs that are parts of their own; neighbours share a part beyond that: as many bars as a list shows. Convention.
pub(crate) const MOST_PARTS: usize = 12;

/// Share of a column's information below which nothing of it is left beside the others: half the digits of a double. Argument.
pub(crate) const NOTHING: f64 = 1e-6;
