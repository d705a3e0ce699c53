//! Every threshold of the comparison, with its reason.

/// Share of the odd units, and of the changes, that may be false where nobody says otherwise. Convention.
pub(super) const FALSE_DISCOVERIES: f64 = 0.05;

/// Level at which a spread between units is there, and what lies on either side of the interval of a day. Convention.
pub(super) const TAIL: f64 = 0.05;

/// Fewest units from which a spread can be estimated: with fewer, any unit is as odd as the others. Argument.
pub(super) const FEWEST_UNITS: usize = 4;

/// Fewest periods in which a change can be distinguished from one odd period: two on either side, and one to see the scatter.
/// Argument.
pub(super) const FEWEST_PERIODS: usize = 5;

/// Rounds in which odd units are taken out of the fleet that predicts the others. Each round adds units or ends. Convention.
pub(super) const ROUNDS: usize = 10;

/// Sizes of a change that are weighed, in units of the scatter of one period: from one that only a long history shows to one that a
/// glance shows. Equal weights; a finer list moves no probability by more than a rounding. Convention.
pub(super) const SIZES: [f64; 4] = [0.5, 1.5, 4.5, 13.5];

/// Expected share of series with a change before any was seen, and how many series that belief is worth. A fleet of a few units then
/// needs clear evidence, a large one shows how often its units change. Convention.
pub(super) const PRIOR_CHANGE: (f64, f64) = (0.02, 20.0);

/// The lowest decade of a variance, of the values' own variance: below it a spread is nothing. Convention.
pub(super) const LOWEST_DECADE: f64 = -6.0;

/// Steps in which a variance is looked at, in the finest rungs, each a seventh of the one before: the first covers seven decades in
/// half-decades, so that the last is 0.05 % of the variance. Argument.
pub(super) const LADDER: [i32; 5] = [2401, 343, 49, 7, 1];

/// Decades of the finest rung. Argument.
pub(super) const FINEST: f64 = 0.5 / 2401.0;

/// Fewest different values of a covariate that can show a curve: with fewer a line and a curve cannot be distinguished from scatter.
/// Argument.
pub(super) const FEWEST_VALUES: usize = 6;

/// Scales of a curve, of the range of its covariate: the first bends within a thirtieth of it, the last over all of it, nearly as a parabola.
/// A curve between two of them is a few per cent of its size away from the nearer one, in addition to a line. Argument.
pub(super) const BENDS: [f64; 6] = [1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0];

/// Rounds in which the spread of the units' own slopes is looked for, one column after the other. The columns hardly share anything.
/// Convention.
pub(super) const SLOPE_ROUNDS: usize = 2;

/// How many steps of the ladder that spread needs: it is a weight, and a fourteenth of a decade moves no probability by much.
/// Argument.
pub(super) const SLOPE_STEPS: usize = 2;
