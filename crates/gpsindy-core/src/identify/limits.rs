//! Every threshold of an identification: what it is, its value, and why this value.
//!
//! Evidence is twice the natural logarithm of odds everywhere in this folder: 2 ln 20 = 6 means odds of 20 to 1.
//!
//! "Argument" means that the value follows from what is written next to it. "Convention" means that any value near it would do,
//! and that no data set was looked at to find it. Where data were looked at, they are named.

use crate::refine::Refine;

/// Most samples that an identification learns from. Coefficients are then hundreds of their standard errors at a noise as large as
/// the motion; more samples change no term, only the time and the memory. Convention.
pub(crate) const MOST_SAMPLES: usize = 50_000;

/// Samples that terms are looked for in, where the logs have more: the coefficients are then fitted to all of them. A search makes
/// hundreds of fits; the standard errors of ten thousand samples are those of fifty thousand twice over. Convention.
pub(crate) const SEARCHED: usize = 10_000;

/// Samples of a window of longer logs: so many that a sampling a thousand times faster than the motion still shows some of it. Convention.
pub(crate) const WINDOW: usize = 5_000;

/// Evidence, 2 ln odds, by which the explanation with interpolated controls must lead the one with held controls, and the other
/// way round once it does. 2 ln 20 = 6: a computer that steers holds what it has sent, so the odds must be clear. Argument.
pub(crate) const INTERPOLATED: f64 = 6.0;

/// The same decision before any term is chosen: evidence, 2 ln odds, beyond which the rows alone rule one of the two out. Far
/// beyond [`INTERPOLATED`], since smoothing rounds off the corners that a held control makes. 2 ln 22,000 = 20. Convention.
pub(crate) const RULED_OUT: f64 = 20.0;

/// Evidence, 2 ln odds, by which a support must lead to replace another: above the optimiser's own scatter. Argument.
pub(crate) const LEAST_LEAD: f64 = 0.01;

/// Evidence, 2 ln odds, by which the end of a later start must lead that of an earlier one: less is a tie. 2 ln e = 2: Kass and
/// Raftery 1995 call less than 2 "not worth more than a bare mention". Convention.
pub(crate) const TIE: f64 = 2.0;

/// Evidence, 2 ln odds, by which equations must be worse to have no weight in the standard errors: odds of 1000, 2 ln 1000 = 14.
/// What is left out adds less than a thousandth to a probability. Argument.
pub(crate) const NO_WEIGHT: f64 = 14.0;

/// Change of the linear problem's evidence that counts as one: above rounding. Argument.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Share of a column's spread below which residuals count as none: what is left is the integrator's. Its steps are chosen for
/// errors of 1e-6 of the state a pace, and most of it is common to both sides. Argument.
pub(crate) const FLOOR: f64 = 1e-7;

/// Share of a column's spread below which residuals are compared with what the integration errs by; it never errs by more.
/// Argument.
pub(crate) const NEAR_CLEAN: f64 = 0.01;

/// Share of a column's spread within which rollouts are exact: a term without which they still are is not in the equations.
/// Solvers are run to relative tolerances of 1e-3 to 1e-6, converters have 10 to 16 bits: what is smaller is theirs. Argument.
pub(crate) const EXACT: f64 = 1e-4;

/// Periods of sampling that the longest delay spans which is looked for where none is named: half a second at 50 Hz. Convention.
pub(crate) const DELAYED_PERIODS: f64 = 25.0;

/// Share of the samples at one end of a column, which it runs into and stays at, from which that end is remarked on: one in a
/// hundred. Convention.
pub(crate) const STUCK: f64 = 0.01;

/// Shares of the shortest run: that much of it is looked through where sampling is fine, and no more of it however coarse it is.
/// Convention.
pub(crate) const DELAYED_SHARES: (f64, f64) = (0.01, 0.1);

/// Share of a state's typical size by which it is moved for a derivative of the rollout: the cube root of the rounding, 6e-6, would
/// be best for differences of both sides, the square root, 1e-8, for one. Argument.
pub(crate) const MOVED: f64 = 1e-6;

/// Share of a run that the authors' pipeline learns from, as in their code. Convention.
pub(crate) const AUTHORS_TRAIN: f64 = 0.7;

/// Rounds of dropping, adding and exchanging terms. Searches end long before. Convention.
pub(crate) const ROUNDS: usize = 25;

/// Exchanges of one term that are weighed in the linear problem, the most promising first. Convention.
pub(crate) const EXCHANGES: usize = 4;

/// Moves that are tried in full each round, the most promising first. Convention.
pub(crate) const MOVES: usize = 5;

/// Share of the least price of a term by which the linear problem may hold a move for worse, and the move is tried in full yet:
/// the linear problem errs by less than its own gains. Convention.
pub(crate) const WORTH_A_TRY: f64 = 0.5;

/// Starts whose supports are improved, those of the best evidence after their first fit. Two, so that one poor start of the
/// regression does not decide. Convention.
pub(crate) const LOOKS: usize = 2;

/// Largest number of terms of an equation in the sparser starts. Longer equations are reached by adding terms. Convention.
pub(crate) const SPARSE: usize = 5;

/// Growth of the residual up to which longer rollouts count as being on course: noise estimates of two halves of a log differ by
/// less than this from 30 samples on (1 + 2 / sqrt(2 * 30) = 1.26). Argument.
pub(crate) const ON_COURSE: f64 = 1.3;

/// Growth of the residual up to which longer rollouts add nothing new about the terms. Convention.
pub(crate) const UNCHANGED: f64 = 1.01;

/// Largest growth of a small difference along a rollout. Derivatives are taken over a millionth of a state's size: what grows
/// by more leaves the straight part, and the fit stops far from the optimum, with small standard errors. Argument.
pub(crate) const GROWTH: f64 = 1e6;

/// Change of the noise, as a share, below which a fit and its noise agree: 0.15 changes no weight by more than a third. Argument.
pub(crate) const NOISE_SETTLED: f64 = 0.15;

/// Fits of one support with the noise estimated anew in between. Convention.
pub(crate) const NOISE_ROUNDS: usize = 3;

/// Coefficient with which a term enters a fit, as a share of its typical size: not 0, where a bound on its sign would hold it,
/// and too small to move a rollout. Argument.
pub(crate) const BARELY_IN: f64 = 1e-9;

/// Largest lag-one correlation of residuals, and smallest share of them that counts as independent: keeps a ratio finite. At
/// 0.96 the share is 0.02; more is a wrong model, whatever its number. Convention.
pub(crate) const CORRELATED: f64 = 0.99;
/// See [`CORRELATED`]. Convention.
pub(crate) const LEAST_SHARE: f64 = 0.02;

/// Shortest rollouts, in paces (times in which the fastest state changes by its spread). Three of them show a turn. Convention.
pub(crate) const WINDOW_PACES: f64 = 3.0;

/// Shortest rollouts in samples: fewer leave little besides the free start. Convention.
pub(crate) const WINDOW_SAMPLES: f64 = 10.0;

/// Runge-Kutta steps in a pace: one of a twelfth of the pace errs by about (1/12)^5 / 120 * 2 pi, 1e-6 of the state. Argument.
pub(crate) const STEPS_PER_PACE: f64 = 12.0;

/// Most Runge-Kutta steps between two samples. Convention.
pub(crate) const MOST_STEPS: f64 = 10.0;

/// Share of a covariance's mean variance that is added in every direction. A smooth process is sure of directions in which the
/// equation errs a little; a hundredth keeps them from ruling the fit. Convention.
pub(crate) const SURE: f64 = 0.01;

/// Samples of a run, or rows of a regression, that it takes at least: one more than a parabola has parameters. Argument.
pub(crate) const FEWEST: usize = 4;

/// Share of a smoother's noise below which a recursion contradicts it: its own estimate scatters by far less. Convention.
pub(crate) const CONTRADICTED: f64 = 0.5;

/// Samples that a column is foretold from: two for each of four frequencies. Convention.
pub(crate) const RECURSION: usize = 8;

/// Share of the logs' variance that rollouts of whole runs may miss for the motion to count as foretold by equations: half of
/// it. Noise and chaos miss all of it and more. Convention.
pub(crate) const FORETOLD: f64 = 0.5;

/// Share of the logs' variance that whole-run rollouts may miss before smaller libraries are tried, too. A tenth: an R2 of 0.9 is
/// where ODEBench (d'Ascoli et al. 2024) calls a system reconstructed. Convention.
pub(crate) const CLOSE: f64 = 0.1;

/// Folds of the cross-validation, batch and online. Hastie, Tibshirani and Friedman 2009, section 7.10: five or ten. Convention.
pub(crate) const FOLDS: usize = 5;

/// Rows left out between two folds: a hundredth of the rows, at most this many. Convention.
pub(crate) const GAP: usize = 10;

/// Rows at most in the regressions that compare delays: each is repeated for every delay. Convention.
pub(crate) const DELAY_ROWS: usize = 3000;

/// Evidence, 2 ln odds, by which the equations of a larger library must lead: Kass and Raftery 1995 call more than 10 "very strong".
/// Convention.
pub(crate) const GROWN: f64 = 10.0;

/// Share of a column's spread above which residuals are worth a larger library: solvers are run to relative tolerances of 1e-3 to 1e-6,
/// and simulated logs have no other noise. Convention.
pub(crate) const WORTH_MORE: f64 = 1e-5;

/// Share of independent residuals below which they are no noise, whatever the smoother holds for it: their neighbours correlate by 0.82,
/// and four in five of them say nothing new. Convention.
pub(crate) const DEPENDENT_SHARE: f64 = 0.1;

/// Most terms of a library that was grown: a regression over more takes longer than all the rest. Convention.
pub(crate) const MOST_GROWN: usize = 150;

/// Share of its largest value above which a variable must stay for its logarithm, root and reciprocal to be tried: nearer to 0 the
/// smoothed path may cross it. Convention.
pub(crate) const POSITIVE: f64 = 0.02;

/// Fewest and most delays that are tried for one control; a sampling period apart in between. Convention.
pub(crate) const DELAYS_TRIED: (usize, usize) = (4, 40);

/// Smallest share of a column that is left after the others were taken out of it: less is rounding. Argument.
pub(crate) const DEPENDENT: f64 = 1e-10;

/// Smallest noise that second differences may show, as a share of the spread: see [`EXACT`]. Argument.
pub(crate) const LEAST_NOISE: f64 = EXACT;

/// Budget of one fit through the integrator. The search makes many; the last digits of none decide, since [`LEAST_LEAD`] is
/// far above a relative change of the cost of 1e-5. Argument.
pub(crate) const USUAL: Refine = Refine { max_iterations: 25, tolerance: 1e-5, hopeless: f64::INFINITY };

/// Ratio of a fit's cost to that of the equations it competes with above which it ends once its steps gain little: residuals of twice the
/// size. A fit that comes to rest there has lost. Convention.
pub(crate) const HOPELESS: f64 = 4.0;

/// Limits of the vote of several equations. Settled on the even recordings of one car (JetRacer); no other data set moved them.
pub(crate) mod consensus {
    /// Rollouts that other equations are looked for with, as shares of the shortest ones. Convention.
    pub(crate) const SHARES: [f64; 4] = [0.5, 0.75, 1.5, 2.0];
    /// Stretches of the logs whose states and controls are exchanged. Convention.
    pub(crate) const STRETCHES: usize = 8;
    /// Length of a stretch as a share of the longest run. Convention.
    pub(crate) const LENGTH: f64 = 0.5;
    /// Share of the first member's score that another one must stay below: the evidence counts for something, too. Convention.
    pub(crate) const LEAD: f64 = 0.75;
    /// Difference of a state, in units of its spread, beyond which two rollouts have nothing to do with each other. Convention.
    pub(crate) const APART: f64 = 3.0;
    /// Share of the spread within which long rollouts are good enough whatever the noise: a fit of 95 %. Convention.
    pub(crate) const FOLLOWED: f64 = 0.05;
    /// Root mean square distance of long rollouts from the smoothed log, in units of the noise, from which equations are
    /// approximations: the systematic part is larger than the noise. Argument.
    pub(crate) const OFF: f64 = 2.0;
}

/// Limits of what is said of data that were not learnt from.
pub(crate) mod outlook {
    /// Last share of every run that is left out. Convention.
    pub(crate) const LEFT_OUT: f64 = 0.25;
    /// Times that the noise is drawn anew. Convention.
    pub(crate) const REPLICATES: usize = 10;
    /// Starts that rollouts are compared from: so many that [`REMARKED`] of them is one. Convention.
    pub(crate) const STARTS: usize = 20;
    /// Length around what was visited that starts are drawn from, in units of the range: second starts of four in five published
    /// systems (ODEBench) lie within. Convention.
    pub(crate) const AROUND: f64 = 1.0;
    /// Samples of these rollouts at most. Convention.
    pub(crate) const LONGEST: usize = 1000;
    /// Share of starts, or of predictions, above which a remark is made: one in twenty, the usual level of a test. Convention.
    pub(crate) const REMARKED: f64 = 0.05;
    /// Exchangeable terms that a note names at most. Convention.
    pub(crate) const SHOWN: usize = 3;
    /// Evidence, 2 ln odds, by which another term may be worse and still be exchangeable: 2 ln 20 = 6. Convention.
    pub(crate) const EXCHANGEABLE: f64 = 6.0;
}

/// Limits of the terms that saturate.
pub(crate) mod saturating {
    /// Ratio of the spread of its variable to the half-saturation up to which that is looked for: below a tenth of the range a rate is at its end
    /// nearly everywhere. Convention.
    pub(crate) const SEEN: f64 = 10.0;
    /// Ratio of the half-saturation to the largest value of its variable up to which it is looked for: at twice that value a rate loses a third
    /// over its range. Where it loses less, squares and cubes are as good. Convention.
    pub(crate) const REACHED: f64 = 2.0;
    /// Values between which the best one of the regression is refined: a factor of about two apart. Convention.
    pub(crate) const SCANNED: usize = 6;
    /// States and controls at most: with more, a regression for each value takes longer than all the rest. Convention.
    pub(crate) const MOST_VARIABLES: usize = 4;
    /// Terms of an equation from which one that saturates may stand for some of them: three of them and its number. Convention.
    pub(crate) const LONG: usize = 5;
    /// Sets of terms that are searched in full, those of the best regressions. Convention.
    pub(crate) const KEPT: usize = 2;
    /// Smallest mean squared residual of a regression, in units of the noise, that counts: less is rounding. Argument.
    pub(crate) const LEAST: f64 = 1e-12;
}

/// Limits of the search for free numbers.
pub(crate) mod numbers {
    /// Sets of values that the search for one free number begins at; twice as many for each further one. Convention.
    pub(crate) const FIRST_STARTS: usize = 8;
    /// Sets of values at most. Convention.
    pub(crate) const MOST_STARTS: usize = 64;
    /// Sets whose rollouts are lengthened, the best ones of the short rollouts. Convention.
    pub(crate) const KEPT_STARTS: usize = 4;
    /// Ratio of a number to what it is added to, and the inverse, up to which logs can show it: a hundredth of a column is hidden by
    /// the noise of most sensors. Convention.
    pub(crate) const VISIBLE: f64 = 100.0;
    /// Share of a bound within which a number has ended there: the last step of a fit may round. Argument.
    pub(crate) const AT_A_BOUND: f64 = 1e-6;
}

/// Limits of the identification sample by sample.
pub(crate) mod online {
    /// Samples at the first fit of hyperparameters. Convention.
    pub(crate) const FIRST_FIT: usize = 16;
    /// Values of a state before its process is fitted: see [`crate::gp::Weakness::FewPoints`]. Argument.
    pub(crate) const FEWEST_OF_A_PROCESS: usize = 8;
    /// Share of its spread that a state's standard deviation may have; beyond it the state is not known. Convention.
    pub(crate) const UNKNOWN: f64 = 0.5;
    /// Steps longer than this many lengths of the smoothest process are not integrated over. Convention.
    pub(crate) const LONGEST_STEP: f64 = 2.0;
    /// Groups in which stretches take turns. Convention.
    pub(crate) const GROUPS: usize = 20;
    /// Groups that it takes to see what the errors of a stretch have in common. Convention.
    pub(crate) const ENOUGH: usize = 10;
    /// A group with a smaller share of the weight has been forgotten. Convention.
    pub(crate) const FORGOTTEN: f64 = 1e-3;
    /// Influence of a sample that counts as none. Convention.
    pub(crate) const NOTHING: f64 = 1e-6;
    /// The reach of the smoother is at most the window divided by this. Convention.
    pub(crate) const REACH: usize = 4;
}
