//! Every threshold of the diagnosis: its value, what it decides, and why it has that value.
//!
//! "Development seeds" are those of the generator of random systems in `tests/suite`, 0 to 9,999. Guards against rounding
//! and exact mathematics stand where they are used.

pub(crate) mod forcing;
pub(crate) mod verify;
pub(crate) mod weigh;

use crate::refine::Refine;

// Fits.

/// How long a fit may search: a step of Gauss-Newton doubles the digits near the end, so that few are enough to rank, and
/// a fit that has not come to rest after sixty is held up by a bound or an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Budget {
    /// One step: tells whether a hypothesis is worth a rough fit, where even that is dear.
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
        match self {
            Self::Glance => Refine { max_iterations: 1, tolerance: 1e-5 },
            Self::Rough => Refine { max_iterations: 4, tolerance: 1e-5 },
            Self::Usual => Refine { max_iterations: 15, tolerance: 1e-5 },
            Self::Thorough => Refine { max_iterations: 60, tolerance: 1e-6 },
        }
    }
}

/// Mean squared residual (noise units) that no sensor's noise has, however coloured.
///
/// First-order noise with innovations of one, as differences of samples see them, and a coefficient of 0.975 has
/// `1/(1 - 0.975^2) = 20`; a sensor that remembers for longer than 40 samples is a slow state and no noise.
pub(crate) const FAR: f64 = 20.0;

/// First samples of a window that count more where the rest is no noise: two tell a place and a rate.
pub(crate) const START_SAMPLES: usize = 2;

/// Mean squared residual (noise units) from which a fit tries the logs' own starts once more: twice the noise's variance.
pub(crate) const POOR: f64 = 2.0;

/// By how many times a window's mean squared residual must exceed the middle window's for its start to be doubted: chance does not
/// double the mean of a hundred squares.
pub(crate) const DOUBTED: f64 = 2.0;

/// Standard deviations of a tolerance beyond which a value is no longer tolerated: it is an error, and must win as one.
///
/// Three is the usual end of what a belief covers. The belief's tails would not hold it: thousands of residuals that are
/// structure and not noise outweigh any of them, and a viscous friction of twice its value then hides a dry one before
/// that has a name.
pub(crate) const BELIEVED: f64 = 3.0;

/// Tolerances within which a parameter's move is what the user expects: 19 in 20 of those that are right to within one.
pub(crate) const EXPECTED: f64 = 2.0;

// Noise.

/// Highest order of a column's noise model: what a filter of order four in a sensor and its thinning leave. BIC takes less
/// where less will do.
pub(crate) const MAX_ORDER: usize = 6;

/// Variance of the innovations (noise units) up to which they can be noise: differences of samples see those of a random
/// walk, the slowest noise there is, as 3.6.
pub(crate) const ROUGH: f64 = 4.0;

/// Residual variance (noise units) up to which the winner's residual counts as noise, with its colour: an effect of half
/// the noise's variance would have been material.
pub(crate) const NOISE: f64 = 1.5;

/// Frequencies at which the residual's spectrum is looked at, and lines of it that a periodic effect starts from: the
/// first harmonics of one disturbance.
pub(crate) const FREQUENCIES: usize = 400;
pub(crate) const LINES: usize = 5;

// Logs.

/// Share of a spike by which its neighbours' bends may differ from half of it: a corner's differ by all.
pub(crate) const SPIKE_LIKE: f64 = 0.4;

/// Logs are dense where a straight line over a stride misses them by no more than this many noise deviations (noise alone
/// bends by `sqrt(1 + 2/4)` = 1.2 of itself), or by a hundredth of the column's spread.
pub(crate) const DENSE_NOISE: f64 = 2.5;
pub(crate) const DENSE_SPREAD: f64 = 0.01;

/// Stretches of long logs that are looked at, at least, so that every part of them is seen.
pub(crate) const STRETCHES: f64 = 40.0;

/// A spike this many robust standard deviations above its neighbours is taken out: none of 1e15 normal values is.
pub(crate) const OUTLIER: f64 = 8.0;

/// Fewest samples of a window: three for each of the eight values that a small model's start and colours take.
pub(crate) const SHORTEST: usize = 24;

/// Share of a column's spread beyond which a rollout is off course: windows are then halved.
///
/// Beyond half of the spread the model is nearer to the column's mean than to the log, and derivatives along its path say
/// nothing of the machine's.
pub(crate) const OFF_COURSE: f64 = 0.5;

/// The same in noise deviations, where noise is most of a column.
pub(crate) const OFF_COURSE_NOISE: f64 = 3.0;

/// Residual in noise deviations up to which a simulator that steps follows the logs, so that longer rollouts pile nothing up: estimates
/// of the noise itself are right to a tenth or two.
pub(crate) const FOLLOWS: f64 = 1.3;

/// Growth of an initial error over a window beyond which the window is halved: two digits of a fitted start are then lost.
pub(crate) const EXPLOSION: f64 = 100.0;

/// Residual (noise units, root mean square) beyond which a longer rollout tells nothing that a shorter one does not.
///
/// So far above the noise every effect shows within the time of one motion. Longer rollouts only pile up what the model
/// lacks, until two effects that are needed together look worthless alone: a bias that dry friction does not hold at rest
/// drifts away, and dry friction without the bias creeps. Seen on drives with next to no noise.
pub(crate) const LOUD: f64 = 30.0;

/// Share of the noise, or of the residual, that the integration may add: in squares a hundredth.
pub(crate) const ROUNDING: f64 = 0.1;

/// Most integration steps between two samples: a step of a hundredth of a drive's electrical time constant at 1 kHz.
pub(crate) const MOST_SUBSTEPS: usize = 32;

/// Most samples that a search looks at: an effect of a fifth of the noise then stands 20 deviations above it, and more
/// samples change no answer, only the time.
pub(crate) const MOST_SAMPLES: usize = 12_000;

/// Samples beyond which the choice of windows would itself cost more than the search after it: each halving fits all of them.
pub(crate) const VERY_LONG: usize = 1_000_000;

/// Misses of this many spreads of a column on the shortest rollouts are no gap to explain but another model's logs.
pub(crate) const ASTRAY: f64 = 1e3;

/// Growth of the mean square from one length of rollouts to the next up to which the longer ones are taken: a constant
/// error of a force makes four times the error of a place in twice the time.
pub(crate) const STEADY: f64 = 16.0;

/// The same where structure is left: rollouts that leave more of it tell of its piling up, and pull the effects after it.
pub(crate) const PILED: f64 = 1.25;

// Detection.

/// Structure (mean square, noise units) that no test calls a gap: a fourteenth of the noise's standard deviation.
///
/// A coarse integration, a rounded column or a control logged with few digits leave as much, and in a long
/// log a test of exactly nothing would find them.
pub(crate) const NEGLIGIBLE: f64 = 0.005;

/// Mean squared change of the outputs (noise units) that a parameter may make within its tolerance and be no cause.
///
/// Half the noise's standard deviation: the user expects the parameter to be off by as much, and does not see it.
pub(crate) const TOLERABLE: f64 = 0.25;

// The contest.

/// How many suspects are fitted in the place of one or two effects, and of each effect at least.
///
/// Like the counts below, and those of [`sampling`] and [`forcing`], it trades time for the chance of passing the truth by. Twice
/// as many of [`FINALISTS`], [`SHORTLIST`] and [`TOGETHER`] brought nothing: of 54 cases with effects (development seeds 5000 to
/// 5135) 49 had the same causes. In the other five the causes were wrong with either, but for one where Stribeck friction was named
/// and Coulomb friction is now.
pub(crate) const SWAPPED: usize = 8;
pub(crate) const OF_PLACE: usize = 2;

/// From how many suspects pairs are made in every view, and how many of these are fitted.
pub(crate) const PAIRED: usize = 16;
pub(crate) const PAIRS: usize = 3;

/// Views up to which pairs are also made in the place of two effects: those of three effects.
pub(crate) const VIEWS: usize = 7;

/// Share of what leaving an effect out costs that a suspect must promise to bring back, in order to be fitted in its place: a straight
/// line underrates a curved effect by half.
pub(crate) const SUBSTITUTE: f64 = 0.5;

/// How many fits of a round, by score and by squares, go on after their first step.
pub(crate) const RACED: usize = 7;

/// How many contestants of a round are fitted to the end at least.
pub(crate) const FINALISTS: usize = 3;

/// Nats behind the best within which a contestant may still win after a longer fit.
pub(crate) const IN_SIGHT: f64 = 30.0;

/// Readings on which all suspects are screened first, and how many of them by each noise model are then screened on all readings: on
/// a quarter of 40,000 a gain of 100 is off by 40, and the shortlist ends far above.
pub(crate) const SKETCHED: usize = 10_000;
pub(crate) const SCREENED: usize = 32;

/// How many hypotheses are refitted at a contestant.
pub(crate) const SHORTLIST: usize = 7;

/// Share of the largest gain from which the best of every family is refitted, too.
pub(crate) const OF_FAMILY: f64 = 0.2;

/// How many sets of effects that promise more together than any of them alone are refitted at a contestant.
pub(crate) const TOGETHER: usize = 2;

/// From how many starts a hypothesis is fitted.
pub(crate) const STARTS: usize = 2;

/// Most effects in one equation: more of them fit any curve.
pub(crate) const MOST_PER_EQUATION: usize = 4;

/// Mean squared residual (in noise units) that one more effect must remove to be worth a name.
///
/// An effect below a fifth of the sensor's noise changes no decision, and the smoothed corners of
/// Coulomb friction, or a coarse integration, can feign one of that size in a long log.
pub(crate) const MATERIAL: f64 = 0.04;

/// Share of [`MATERIAL`] that a straight line must promise: it underrates a curved effect by half.
pub(crate) const PROMISING: f64 = 0.5;

/// Evidence (nats beyond BIC) that one more effect must bring: odds of 150, "very strong" to Kass and Raftery 1995.
pub(crate) const CONVINCING: f64 = 5.0;

/// Nats by which an effect of time is less expected beforehand: twenty to one that no machine knows when its log was begun, and in runs
/// that begin alike a function of time may be one of any state.
pub(crate) const CLOCK: f64 = 3.0;

/// Chance that noise gives a gain anywhere in a search, above which the gain is none.
pub(crate) const CHANCE: f64 = 0.05;

/// Shares of a finite step that a straight line may take: half of it to twice, because it is no straight line.
pub(crate) const STEP: (f64, f64) = (0.5, 2.0);

/// Most parameters at the end of their tolerance that a screening lets back: all 3^4 choices of them are tried.
pub(crate) const MOST_STRAINED: usize = 4;

// What the logs exclude, and the power study.

/// Deviations from which a size shows 19 times in 20: the one-sided 5 % point and the 95 % power point of a normal variable.
pub(crate) const SHOWN: f64 = 1.645 + 1.645;

/// A rollout further from its log than this many ranges of the column has left it: the run is then cut into pieces.
pub(crate) const LEFT_LOG: f64 = 2.0;

/// How near the gap of a planted effect must come to the one asked for: no finding depends on a tenth.
pub(crate) const CLOSE: f64 = 0.1;

// The next experiment.

/// Signals of each form that are drawn, rounds of refining the best one, and variations of it in a round: they trade time
/// for separation, and none was varied on its own.
pub(crate) const DRAWN_SIGNALS: usize = 40;
pub(crate) const ROUNDS: usize = 24;
pub(crate) const VARIATIONS: usize = 16;

/// Sets of sizes that a truth is drawn with beside its best ones, so that a signal does not rest on one value.
pub(crate) const SIZES: usize = 3;

/// How often a signal that leaves the bounds of a state is made smaller by a third, at most: to an eighth.
pub(crate) const SHRINKINGS: usize = 6;

/// Nats at which the right one of a pair has 95 %: the logarithm of nineteen to one.
pub(crate) const SEPARATE: f64 = 2.944;

// Attribution.

/// Moves from one set of effects to another, at most: each of six effects changed twice. It ends a search that would go
/// round in a circle, as leaving an effect out and putting several in its place can.
pub(crate) const MOST_MOVES: usize = 12;

/// Evidence (nats) by which another effect in a place must beat the winner: less is within what two fits that came to rest
/// at different digits differ by.
pub(crate) const SWAP: f64 = 0.5;

/// Share of the gap below which an effect has no name while structure without one is left.
///
/// Where the whole is not explained, its residual is no noise, and evidence that counts it as noise finds a use for
/// any flexible effect.
pub(crate) const NAMED: f64 = 0.01;

/// Share of the gap that counts: a rest below it is none, and an effect that removes less is no cause of the gap.
pub(crate) const REST: f64 = 0.002;

/// Mean squared structure (in noise units) above which a rest counts as more than the model's own roughness.
pub(crate) const STRUCTURE: f64 = 0.1;

/// Evidence (nats) by which one hold of the controls must beat the other with the causes in place: odds of 20,000, far
/// beyond what chance gives one binary choice.
pub(crate) const HOLD: f64 = 10.0;

/// The floor of every column.
pub(crate) mod floor {
    /// Share of a control's spread by which repeated commands may differ: rounding, not another command.
    /// Ten bits of a converter.
    pub(crate) const SAME: f64 = 1e-3;

    /// Share of the noise below which runs do not differ by chance: they are copies. Eight samples of noise scatter
    /// below it once in a thousand times.
    pub(crate) const LEAST: f64 = 0.3;

    /// First samples whose mean tells the start, and how many of its standard deviations two starts may differ.
    /// Five samples are a moment; of normal means none in 15,000 is four deviations away.
    pub(crate) const FIRST: usize = 5;
    pub(crate) const NEAR: f64 = 4.0;
}

/// Starts of rollouts of held-out logs.
pub(crate) mod start {
    /// Share of a held-out rollout that may refine its start: three quarters are left to judge by.
    pub(crate) const BEGINNING: f64 = 0.25;

    /// Fewest samples of a beginning: two for each of the values of a two-state model's start, twice over.
    pub(crate) const FEWEST: usize = 8;

    /// Fewest samples of a parabola, and by how much more the next one takes: twice its three values, and then lengths
    /// whose errors differ by half.
    pub(crate) const SHORTEST: usize = 6;
    pub(crate) const LONGER: f64 = 1.5;

    /// Deviations of its sampling error by which a parabola's residual may exceed the noise: 19 in 20 stay within.
    pub(crate) const CHANCE: f64 = 2.0;

    /// Uncertainty of a belief beyond what the noise gives: as much again for what a parabola does not follow.
    pub(crate) const ROUGH: f64 = 2.0;

    /// How far a start that no sample tells may be from its guess, in typical sizes: no bound in practice, but an end to a
    /// search that nothing holds.
    pub(crate) const UNTOLD: f64 = 30.0;

    /// Steps of a start's fit, and how often its weights are taken anew: Gauss-Newton doubles its digits each step.
    pub(crate) const STEPS: usize = 6;
    pub(crate) const ROUNDS: usize = 2;
}

/// Where the gap lies.
pub(crate) mod localise {
    /// Parts into which a variable's range and a run's time are cut: as many as a reader takes in at a glance.
    pub(crate) const BINS: usize = 8;

    /// Factor of the mean square within which neighbouring parts are one: what 30 samples of noise differ by.
    pub(crate) const ALIKE: f64 = 1.5;

    /// Most rows of a list: one screen.
    pub(crate) const MOST_ROWS: usize = 12;
}

/// Periods and phases of sample-and-holds, which are found by trial.
pub(crate) mod sampling {
    /// Periods in the beginning of a log on which the search starts: enough for a quarter of a period to show, few enough
    /// for a lattice of a hundred points. A count like [`super::SWAPPED`].
    pub(crate) const CELLS: f64 = 16.0;

    /// Parts of a period by which the last of these moments moves from one trial to the next: half of one is an eighth, and
    /// seven eighths of what is held are then right.
    pub(crate) const LATTICE: f64 = 4.0;
    pub(crate) const PHASES: f64 = 4.0;

    /// Trials that go on to twice the length; on whole logs half as many from one lattice to the next, down to the fewest.
    pub(crate) const KEPT: usize = 16;
    pub(crate) const FEWEST: usize = 2;

    /// How far from its start a period is looked for: starts are a quarter apart.
    pub(crate) const REACH: f64 = 1.3;
}

/// The filter whose innovations screen a simulator that steps.
pub(crate) mod innovations {
    /// Rounds of expectation maximisation of the pushes: each brings them nearer by a share, and a filter's memory hardly changes
    /// with a tenth of them.
    pub(crate) const ROUNDS: usize = 12;

    /// Least deviation of a push, as a share of the reading's noise: a filter that takes the model as exact over a hundred samples
    /// and more gains nothing from a longer memory, and its matrices lose their digits.
    pub(crate) const LEAST: f64 = 0.01;
}

/// Curves of the report.
pub(crate) mod curves {
    /// Runs of either kind whose columns are drawn: all of them would make a page of many megabytes.
    pub(crate) const MOST_RUNS: usize = 2;

    /// Lags of an autocorrelation: the longest memory that noise has here, see [`super::FAR`].
    pub(crate) const LAGS: usize = 40;

    /// Half width of the band that holds 99 % of a normal variable, in its deviations.
    pub(crate) const BAND: f64 = 2.576;
}

/// Functions without a name.
pub(crate) mod nameless {
    /// Chance below which what is left is no noise: one null log in a hundred gets a function beside its causes.
    pub(crate) const CHANCE: f64 = 0.01;
}

/// Whether a cause keeps its size.
pub(crate) mod stability {
    /// Share by which a size may differ between parts and count as one: corners are smoothed, steps are finite.
    pub(crate) const ALIKE: f64 = 0.05;

    /// Chance below which a part counts as one that disagrees; the parts of one question pay for each other.
    /// With three questions a cause, three right causes in a hundred are doubted.
    pub(crate) const DISAGREES: f64 = 0.01;

    /// Most runs that are parts of their own; neighbours share a part beyond that: as many bars as a list shows.
    pub(crate) const MOST_RUNS: usize = 12;

    /// Share of a column's information below which nothing of it is left beside the others: half the digits of a double.
    pub(crate) const NOTHING: f64 = 1e-6;
}
