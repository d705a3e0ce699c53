//! The contest of suspects.

/// How many suspects are fitted in the place of one or two effects, and of each effect at least.
///
/// Like the counts below, and those of [`super::sampling`] and [`super::forcing`], it trades time for the chance of passing the truth by. Twice
/// as many of [`FINALISTS`], [`SHORTLIST`] and [`TOGETHER`] brought nothing: of 54 cases with effects (development seeds 5000 to
/// 5135) 49 had the same causes. In the other five the causes were wrong with either, but for one where Stribeck friction was named
/// and Coulomb friction is now. Data: development seeds 5000 to 5135.
pub(crate) const SWAPPED: usize = 8;
pub(crate) const OF_PLACE: usize = 2;

/// From how many suspects pairs are made in every view, and how many of these are fitted. Convention.
pub(crate) const PAIRED: usize = 16;
pub(crate) const PAIRS: usize = 3;

/// Views up to which pairs are also made in the place of two effects: those of three effects. Convention.
pub(crate) const VIEWS: usize = 7;

/// Share of what leaving an effect out costs that a suspect must promise to bring back, in order to be fitted in its place: a straight
/// line underrates a curved effect by half. Argument.
pub(crate) const SUBSTITUTE: f64 = 0.5;

/// How many fits of a round, by score and by squares, go on after their first step. Convention.
pub(crate) const RACED: usize = 7;

/// How many fits with one more effect go on after a first step that fell short of a large promise. Convention.
pub(crate) const HELD_BACK: usize = 2;

/// How many contestants of a round are fitted to the end at least. Data: see [`SWAPPED`].
pub(crate) const FINALISTS: usize = 3;

/// Nats behind the best within which a contestant may still win after a longer fit. Convention.
pub(crate) const IN_SIGHT: f64 = 30.0;

/// Readings on which all suspects are screened first, and how many of them by each noise model are then screened on all readings: on
/// a quarter of 40,000 a gain of 100 is off by 40, and the shortlist ends far above. Argument.
pub(crate) const SKETCHED: usize = 10_000;
pub(crate) const SCREENED: usize = 32;

/// How many hypotheses are refitted at a contestant. Data: see [`SWAPPED`].
pub(crate) const SHORTLIST: usize = 7;

/// Share of the largest gain from which the best of every family is refitted, too. Convention.
pub(crate) const OF_FAMILY: f64 = 0.2;

/// How many sets of effects that promise more together than any of them alone are refitted at a contestant. Data: see [`SWAPPED`].
pub(crate) const TOGETHER: usize = 2;

/// From how many starts a hypothesis is fitted. Convention.
pub(crate) const STARTS: usize = 2;

/// Multiples of its value at which a number of a simulator that steps is tried, in how many windows, and how many of such numbers are fitted. A straight
/// line and its finite steps reach what is off by less than three times, and a fit goes on from ten to thirty. Argument.
pub(crate) const GROSS: [f64; 4] = [0.1, 0.3, 3.0, 10.0];
pub(crate) const LOOKED: usize = 8;
pub(crate) const GROSSEST: usize = 2;

/// Levels of dry friction that are tried in equations, in typical rates of their row: what is less hardly ever holds a machine, and a straight line
/// reaches it; what is more never lets go of it. Argument.
pub(crate) const HOLDING: [f64; 4] = [0.25, 0.5, 1.0, 2.0];

/// Most effects in one equation: more of them fit any curve. Convention.
pub(crate) const MOST_PER_EQUATION: usize = 4;

/// Mean squared residual (in noise units) that one more effect must remove to be worth a name.
///
/// An effect below a fifth of the sensor's noise changes no decision, and the smoothed corners of
/// Coulomb friction, or a coarse integration, can feign one of that size in a long log. Convention.
pub(crate) const MATERIAL: f64 = 0.04;

/// Share of [`MATERIAL`] that a straight line must promise: it underrates a curved effect by half. Argument.
pub(crate) const PROMISING: f64 = 0.5;

/// Mean squared rest (noise units) beyond the noise from which a leader may imitate what waits: twice what the noise of a column is known to
/// within. Argument.
pub(crate) const LEFT_OVER: f64 = 0.1;

/// Evidence (nats beyond BIC) that one more effect must bring: odds of 150, "very strong" to Kass and Raftery 1995. Convention.
pub(crate) const CONVINCING: f64 = 5.0;

/// Nats by which an effect of time is less expected beforehand: twenty to one that no machine knows when its log was begun, and one that moves
/// alike everywhere not where it is. Argument.
pub(crate) const CLOCK: f64 = 3.0;

/// The same where a variable shows the time, so that a function of time may be one of that variable: only their shapes part the two, and
/// what else the model lacks bends these. Time is then the last to be named: it must say three times what
/// [`TWINS`](crate::diagnose::limits::weigh::TWINS) takes for a difference. Argument.
pub(crate) const SHOWN_CLOCK: f64 = 9.0;

/// Chance that noise gives a gain anywhere in a search, above which the gain is none. Convention.
pub(crate) const CHANCE: f64 = 0.05;

/// Shares of a finite step that a straight line may take: half of it to twice, because it is no straight line. Convention.
pub(crate) const STEP: (f64, f64) = (0.5, 2.0);

/// Most parameters at the end of their tolerance that a screening lets back: all 3^4 choices of them are tried. Convention.
pub(crate) const MOST_STRAINED: usize = 4;

/// Nats by which a size that differs between recordings is less expected beforehand: twenty to one that a machine keeps it. Argument.
pub(crate) const OWN_SIZES: f64 = 3.0;

/// Rounds by which sizes of their own are found: a straight line leaves a fiftieth of a size that differs by a seventh, and two more of them
/// nothing. Argument.
pub(crate) const OWN_ROUNDS: usize = 3;
