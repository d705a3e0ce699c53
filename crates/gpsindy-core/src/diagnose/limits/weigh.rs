//! Probabilities and the verdict.

pub(crate) mod conformal;

/// Difference in BIC (without prior odds: what the logs say, not what was believed) below which two effects count as not
/// distinguished: odds below twenty to one. Convention.
pub(crate) const TWINS: f64 = 6.0;

/// Share of what a number of a simulator explains up to which another one may explain less and still be stated besides it: its integrator
/// distinguishes them by as much, as Euler's does the damping of a joint and `kv` of its servo. Convention.
pub(crate) const DISTINGUISHED: f64 = 0.01;

/// Odds that a cause is one of the machine's, for the whole of the gap that it removes; a tenth of it has a tenth of them.
///
/// This and the two below are a logistic regression on the logarithm of the share, whose slope is one, the probability of a rest and
/// "three or more": 524 causes of 315 drawn cases, weighted as half with one effect, three twentieths with two, a tenth of the second
/// part of the catalogue, three twentieths outside of it and a tenth of both. Data: development seeds 5000 to 5145, 6000 to 6129,
/// 2000064 to 2000079 and 7000 to 7422.
pub(crate) const REAL: f64 = 102.0;
/// By how much the odds are less where a rest is certain. Data: the same.
pub(crate) const REST_LEFT: f64 = 77.0;
/// By how much the odds are less where as many effects as [`FEW`] or more are named. Data: the same.
pub(crate) const MANY: f64 = 1.5;
pub(crate) const FEW: usize = 3;

/// Share of imitations whose disagreement between parts shows, and how fast its chance falls: as `p^(CROWDED - 1)`. In 12
/// of the 75 imitations of the same cases the chance was below a hundredth. Data: the same.
pub(crate) const CROWDING: f64 = 0.2;
pub(crate) const CROWDED: f64 = 0.15;

/// By how much the odds are less where the size differs between recordings: of imitations one in five shows such a disagreement
/// ([`CROWDING`]), of machines one in twenty ([`OWN_SIZES`](crate::diagnose::limits::OWN_SIZES)). Argument.
pub(crate) const DIFFERS: f64 = 4.0;

/// Probability of an effect whose time constant, speed or frequency is at an end of its range. There it is another effect without such a scale,
/// and the catalogue has that one, too, where it is not withheld: odds of twenty to one against. Of 18 such causes in 535 diagnoses of drawn cases
/// none was right (`single` 6000 to 6045 with an effect left out, `outside` 12300 to 12315 and 14300 to 14315, exam seeds 2000000 to 2000059).
/// Argument.
pub(crate) const UNMEASURED: f64 = 0.05;

/// Part of the way that an output goes in a sample by which an integrator may be off: half of a step that is a tenth of the sampling period.
/// Simulators of machines step at 1 or 2 ms and are logged at 100 Hz. Argument.
pub(crate) const AN_INTEGRATORS: f64 = 0.05;

/// Logs that are simulated with the named causes: enough for the mean and the deviation of what they leave, to a seventh. Argument.
pub(crate) const SIMULATED: usize = 30;

/// Chance of what is above all of them from which it may lie on the other side of [`TYPICAL`]: the deviation of 30 values is off by a fifth, and two of these take a
/// chance of 1/2000 to 1/100. And up to how many logs are simulated there: what is above all 120 is rarer than the level, whatever
/// their distribution. Argument.
pub(crate) const UNDECIDED: f64 = 0.0005;
pub(crate) const MOST_SIMULATED: usize = 120;

/// Chance of as large a rest at which one that is seen is as likely structure as noise: one right explanation in a hundred is lost to it.
/// Convention.
pub(crate) const TYPICAL: f64 = 0.01;
/// Mean squared structure (noise units) that is typical whatever simulations leave: a twentieth of the noise's deviation. The stops, holds and
/// heaters of other simulators than the catalogue's left a third to twice of that, imitations of effects that it lacks from one and a half
/// times on. Convention.
pub(crate) const TYPICAL_REST: f64 = 0.0025;
/// Share of the gap below which no rest counts however surely it is seen: a thousandth of its amplitude, to which integrators and
/// the digits of a log agree. Argument.
pub(crate) const LEAST_REST: f64 = 1e-6;

/// Share of the gap from which a cause must be credible for the gap to be explained: without it a hundredth would be left, which the
/// verdict allows. Argument.
pub(crate) const COUNTS: f64 = 0.01;

/// Share of the gap from which a joint without a cause is said to have a part of it: whole percent are printed, and two of them are no
/// rounding. Argument.
pub(crate) const ON_JOINT: f64 = 0.02;

/// Probability up to which an effect is not listed once more because it may act through another port: a report rounds it to 0 or 1 %. Convention.
pub(crate) const UNLIKELY: f64 = 0.01;

/// Probability above which a statement counts, in the verdict and in words. Argument.
pub(crate) const LIKELY: f64 = 0.5;

/// Part of the gap on held-out logs that causes must close to explain a part of it. Convention.
pub(crate) const PART: f64 = 0.5;

/// Twice the gain in nats below which an effect is quiet, so that its absence is stated: three deviations. Convention.
pub(crate) const QUIET_GAIN: f64 = 9.0;

/// Multiples of a pooled size up to which a run's own error may be for its value to be listed: beyond, the straight line from which it comes does
/// not hold. Argument.
pub(crate) const SHOWN_SIZE: f64 = 3.0;
