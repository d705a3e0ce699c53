//! Sets of causes with a stated coverage: the level, what calibrates it, and the range in which that holds.

/// Share of machines, at least, whose missing effects are all in the set. A threshold at this level takes nine cases of a family, and 19 at
/// 0.95, which the smallest family lacks. Convention.
pub const COVERAGE: f64 = 0.9;

/// Least credit that a cause needs for its place in the set, by the family of the leading included cause (`unexplained`: none is included), with
/// the number of cases behind it. As `gpsindy exam` prints them; docs/exam.md has the command. Data: development seeds 12000 to 12629, 13000 to
/// 13619, 14000 to 14619 and 16000 to 16619, six kinds of cases.
pub(crate) const BY_FAMILY: [(&str, usize, f64); 10] = [
    ("coupling", 38, 1.0),
    ("friction", 47, 1.0),
    ("input_dynamic", 25, 1.0),
    ("input_static", 33, 1.0),
    ("memory", 12, 1.0),
    ("parameter", 31, 1.0),
    ("sensor", 53, 1.0),
    ("stiffness", 29, 1.0),
    ("time", 38, 0.9936173531534946),
    ("unexplained", 16, 2.245108768187557e-21),
];

/// The same of all families together, for what has too few cases of its own. Data: the same.
pub(crate) const POOLED: (usize, f64) = (322, 1.0);

/// States of the drawn machines, fewest and most. Data: the same.
pub(crate) const DRAWN_STATES: (usize, usize) = (1, 6);
/// Training samples of each, fewest and most. Data: the same.
pub(crate) const DRAWN_SAMPLES: (usize, usize) = (900, 14910);
/// Held-out rollout error of their nominal models, in units of the noise, least and most. Data: the same.
pub(crate) const DRAWN_GAPS: (f64, f64) = (1.458, 984.5);
/// Most of the gap that included causes leave there. Data: the same.
pub(crate) const DRAWN_REST: f64 = 0.1843;
