//! How long a fit searches, and what it stands on.

use crate::refine::Refine;

/// How long a fit may search: a step of Gauss-Newton doubles the digits near the end, so that few are enough to rank, and
/// a fit that has not come to rest after sixty is held up by a bound or an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Budget {
    /// One step: shows whether a hypothesis is worth a rough fit, where even that is dear.
    Glance,
    /// Ranks what is worth a real fit.
    Rough,
    /// Decides between contestants.
    Usual,
    /// Goes to the end: of what is reported, and of what others go on from.
    Thorough,
}

impl Budget {
    /// Whether a fit only ranks, so that another one goes on from it where it may win.
    pub(crate) fn only_ranks(self) -> bool {
        matches!(self, Self::Glance | Self::Rough)
    }

    pub(crate) fn refine(self) -> Refine {
        let (max_iterations, tolerance) = match self {
            Self::Glance => (1, 1e-5),
            Self::Rough => (4, 1e-5),
            Self::Usual => (15, 1e-5),
            Self::Thorough => (60, 1e-6),
        };
        Refine { max_iterations, tolerance, ..Refine::default() }
    }

    /// The same where only so many values count alone: the same share of the squares is fewer nats.
    pub(crate) fn refine_of(self, effective: f64) -> Refine {
        let refine = self.refine();
        Refine { tolerance: refine.tolerance * (DECIDED / effective).max(1.0), ..refine }
    }
}

/// Values that count alone in a log for which the tolerances above are made: a step of a hundred-thousandth of their squares is a hundredth
/// of a nat, on which no decision depends. Argument.
const DECIDED: f64 = 2000.0;

/// By how many times a fit's cost may exceed that of what it is compared with, once its steps lower it by less than a tenth each: fifteen
/// such steps take off four fifths, and twenty times the squares decide nothing. Argument.
pub(crate) const HOPELESS: f64 = 100.0;

/// The same where it is compared with the same effects whose corner is free, or with what stands already: the steps after two of less than a
/// tenth each take off less than that together. Argument.
pub(crate) const BEHIND: f64 = 1.1;

/// The same after one step alone, and of a round's fits after four beside the best that is known. Data: of 239 corners that won in the drawn
/// development suites none, of 397 that lost 232; and no verdict of the 156 cases turned with the rounds' fits.
pub(crate) const OUT_OF_REACH: f64 = 5.0;

/// Share of a corner's usual width from which a sharp one is fitted, where friction that holds at rest leaves something: sharper than what a fit
/// from the usual width comes down to. Argument.
pub(crate) const SHARP: f64 = 0.1;

/// Share of a rollout in which a machine hits a stop once: of ten hits each then has a start of its own. Argument.
pub(crate) const OF_A_HIT: f64 = 0.1;

/// Powers of a ratio of the level at rest to that in motion which are tried: machines have up to about three, and the lattice that follows
/// reaches from one to the next. Argument.
pub(crate) const RATIO_AT_REST: f64 = 1.1;
pub(crate) const RATIOS_AT_REST: usize = 12;

/// Largest ratio: a joint that takes more to start is jammed. Convention.
pub(crate) const MOST_AT_REST: f64 = 5.0;

/// Shares of the level to which lattices around it reach, one after the other, and their steps: each reaches beyond the neighbours of the one
/// before. Argument.
pub(crate) const NARROWED: [f64; 3] = [0.25, 0.06, 0.015];
pub(crate) const STEPS_AT_REST: usize = 16;

/// Share of the level to which its interval is looked for. Convention.
pub(crate) const WIDEST_AT_REST: f64 = 0.4;

/// Mean squared residual (noise units) that no sensor's noise has, however coloured.
///
/// First-order noise with innovations of one, as differences of samples see them, and a coefficient of 0.975 has
/// `1/(1 - 0.975^2) = 20`; a sensor that remembers for longer than 40 samples is a slow state and no noise. Argument.
pub(crate) const FAR: f64 = 20.0;

/// First samples of a window that count more where the rest is no noise: two show a place and a rate. Argument.
pub(crate) const START_SAMPLES: usize = 2;

/// Mean squared residual (noise units) from which a fit tries the logs' own starts once more: twice the noise's variance.
/// Convention.
pub(crate) const POOR: f64 = 2.0;

/// By how many times a window's mean squared residual must exceed the middle window's for its start to be doubted: chance does not
/// double the mean of a hundred squares. Argument.
pub(crate) const DOUBTED: f64 = 2.0;

/// The same for one column, in standard deviations of a mean of as many squares: a servo that swings to its other side leaves a few samples of one
/// joint. By chance one of a thousand means of thirty squares is as far off in one fit of thirteen. Argument.
pub(crate) const DOUBTED_COLUMN: f64 = 5.0;

/// Share of windows beyond which it is the model that lacks something, and not their starts that are wrong: of a right model's windows, followed from
/// their first samples, one in ten ends on the wrong side of a servo's limit. Argument.
pub(crate) const MOST_DOUBTED: f64 = 0.33;

/// How often the column that stands out most in a window is drawn anew: joints whose servos swing together are three at most. Convention.
pub(crate) const REDRAWN: usize = 3;

/// First rollouts of a log that say where a limited control stood as it began; places that are tried over its range, and rounds, each between the
/// neighbours of the best: a thousandth of the range at last. Convention.
pub(crate) const BEGINNINGS: usize = 4;
pub(crate) const BEGUN_PLACES: usize = 12;
pub(crate) const BEGUN_ROUNDS: usize = 3;

/// For how long such a place shows, in times that a way over the whole range takes: what it has done to the states until then lasts a while.
/// And the fewest samples of a log that are looked at. Convention.
pub(crate) const BEGUN_SHOWS: f64 = 2.0;
pub(crate) const BEGUN_SAMPLES: usize = 20;

/// Fits in a row in which starts come from the windows before them, and the share of the squares from which one more is worth it. Convention.
pub(crate) const CHAINED: usize = 5;
pub(crate) const CHAIN_GAIN: f64 = 0.05;

/// Standard deviations of a tolerance beyond which a value is no longer tolerated: it is an error, and must win as one.
///
/// Three is the usual end of what a belief covers. The belief's tails would not hold it: thousands of residuals that are
/// structure and not noise outweigh any of them, and a viscous friction of twice its value then hides a dry one before
/// that has a name. Convention.
pub(crate) const BELIEVED: f64 = 3.0;

/// Tolerances within which a parameter's move is what the user expects: 19 in 20 of those that are right to within one. Argument.
pub(crate) const EXPECTED: f64 = 2.0;

/// Share of the largest eigenvalue below which a direction of the linear problem is none: the square of [`super::innovations::STRAIGHT`].
/// Convention.
pub(crate) const FLAT: f64 = 1e-6;

/// Share of the end of a tolerance from which a value stands there: an optimiser stops short of a bound. Convention.
pub(crate) const AT_END: f64 = 0.999;

/// Share of the values that a gain may explain at most, so that its logarithm is one: a millionth of the squares is left. Convention.
pub(crate) const NEARLY_ALL: f64 = 0.999_999;

/// Mean squared residual (noise units) below which nothing is left to explain: the digits of the residuals. Argument.
pub(crate) const NO_REST: f64 = 1e-12;

/// Step of a finite difference about a filter's path, in typical sizes: the root of the rounding of a rollout. Argument.
pub(crate) const DIFFERENCE: f64 = 1e-5;

/// How far from where a fit has it an instant is looked for, in hundredths of the logs: starts are three of them apart. Argument.
pub(crate) const AROUND_INSTANT: f64 = 4.0;

/// How far from where its start has it a delay that acts in whole steps is looked for, as a share of it: the starts are half of it apart. Argument.
pub(crate) const AROUND_DELAY: f64 = 0.5;

/// At most so many values of it are tried at first, by how much finer each further lattice is, and parts of a step on the last. A machine's own delay
/// is no whole number of steps; a sixteenth of one moves a joint by less than its noise. Argument.
pub(crate) const DELAYS: f64 = 16.0;
pub(crate) const FINER_DELAYS: f64 = 4.0;
pub(crate) const PART_OF_STEP: f64 = 16.0;

/// Moments that are tried there, and then between the neighbours of the best: eighths of a thousandth of the logs, from which a fit goes on. Argument.
pub(crate) const INSTANTS: usize = 64;
pub(crate) const FINER_INSTANTS: usize = 20;
