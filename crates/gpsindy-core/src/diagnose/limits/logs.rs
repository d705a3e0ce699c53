//! What of the logs is looked at, in windows of what length.

/// Share of a spike by which its neighbours' bends may differ from half of it: a corner's differ by all. Convention.
pub(crate) const SPIKE_LIKE: f64 = 0.4;

/// Logs are dense where a straight line over a stride misses them by no more than this many noise deviations (noise alone
/// bends by `sqrt(1 + 2/4)` = 1.2 of itself), or by a hundredth of the column's spread. Argument.
pub(crate) const DENSE_NOISE: f64 = 2.5;
pub(crate) const DENSE_SPREAD: f64 = 0.01;

/// Stretches of long logs that are looked at, at least, so that every part of them is seen. Convention.
pub(crate) const STRETCHES: f64 = 40.0;

/// The same of a simulator that steps: only the first start of each is read, the others come along it. Convention.
pub(crate) const STEPPED_STRETCHES: f64 = 8.0;

/// A spike this many robust standard deviations above its neighbours is taken out: none of 1e15 normal values is. Argument.
pub(crate) const OUTLIER: f64 = 8.0;

/// Fewest samples of a window: three for each of the eight values that a small model's start and colours take. Argument.
pub(crate) const SHORTEST: usize = 24;

/// Share of a column's spread beyond which a rollout is off course: windows are then halved.
///
/// Beyond half of the spread the model is nearer to the column's mean than to the log, and derivatives along its path say
/// nothing of the machine's. Argument.
pub(crate) const OFF_COURSE: f64 = 0.5;

/// The same in noise deviations, where noise is most of a column. Convention.
pub(crate) const OFF_COURSE_NOISE: f64 = 3.0;

/// Residual in noise deviations up to which a simulator that steps follows the logs, so that longer rollouts pile nothing up: estimates
/// of the noise itself are right to a tenth or two. Argument.
pub(crate) const FOLLOWS: f64 = 1.3;

/// Growth of an initial error over a window beyond which the window is halved: two digits of a fitted start are then lost.
/// Convention.
pub(crate) const EXPLOSION: f64 = 100.0;

/// Residual (noise units, root mean square) beyond which a longer rollout shows nothing that a shorter one does not.
///
/// So far above the noise every effect shows within the time of one motion. Longer rollouts only pile up what the model
/// lacks, until two effects that are needed together look worthless alone: a bias that dry friction does not hold at rest
/// drifts away, and dry friction without the bias creeps. Seen on drives with next to no noise. Convention.
pub(crate) const LOUD: f64 = 30.0;

/// Share of the noise, or of the residual, that the integration may add: in squares a hundredth. Convention.
pub(crate) const INTEGRATION: f64 = 0.1;

/// Nats that an effect may gain at the end of a search by imitating what the integration adds: as many values as there are, each off by that
/// share of the noise. Argument.
pub(crate) const IMITATED: f64 = 1.0;

/// Most integration steps between two samples: a step of a hundredth of a drive's electrical time constant at 1 kHz. Convention.
pub(crate) const MOST_SUBSTEPS: usize = 32;

/// The same while a rollout gives no numbers: a reaction of a millisecond in a log at 1 Hz, which an explicit method follows with a third of
/// that. Argument.
pub(crate) const MOST_STIFF: usize = 512;

/// Most samples that a search looks at: an effect of a fifth of the noise then stands 20 deviations above it, and more
/// samples change no answer, only the time. Argument.
pub(crate) const MOST_SAMPLES: usize = 12_000;

/// Passes through the logs that a diagnosis of a simulator that steps takes, for each state: Jacobians take one for each. Nulls of six joints
/// took 550 passes, those with one or two effects 3000 to 4500. With 500, a thousand samples were left of three, and the start of a single window
/// that had stayed behind a saturation was a gap. Data: `experiments/mujoco_arm.py`.
pub(crate) const PASSES: f64 = 200.0;

/// Passes at least: one joint of two states took 2000 with a dry friction, and a real one with several wrong numbers 2400 for two rounds. Data:
/// `experiments/mujoco_one_joint.py` and a joint of a hobby arm.
pub(crate) const FEWEST_PASSES: f64 = 2400.0;

/// Share of a time limit that a search of such a simulator has; held-out rollouts of it have the rest. Convention.
pub(crate) const SEARCHED: f64 = 0.9;

/// Logs are shortened where time suffices for less than this share of their samples: the passes that a search takes are not known to a factor of
/// two, and every stretch that is cut out begins where nobody knows. Argument.
pub(crate) const AFFORDED: f64 = 0.5;

/// Samples to which no time limit shortens logs: fewer decide nothing. Convention.
pub(crate) const FEWEST_AFFORDED: usize = 400;

/// Rollouts, and samples of each, by which the pace of a simulator is measured: as many rollouts side by side as a fit of a few windows has.
/// Convention.
pub(crate) const PROBE: (usize, usize) = (64, 16);

/// Samples beyond which the choice of windows would itself cost more than the search after it: each halving fits all of them.
/// Convention.
pub(crate) const VERY_LONG: usize = 1_000_000;

/// Misses of this many spreads of a column on the shortest rollouts are no gap to explain but another model's logs. Convention.
pub(crate) const ASTRAY: f64 = 1e3;

/// Growth of the mean square from one length of rollouts to the next up to which the longer ones are taken: a constant
/// error of a force makes four times the error of a place in twice the time. Argument.
pub(crate) const STEADY: f64 = 16.0;

/// The same where structure is left: rollouts that leave more of it show of its piling up, and pull the effects after it.
/// Convention.
pub(crate) const PILED: f64 = 1.25;

/// By how much more than a turn or half a turn a column of wrapped angles may reach, and how far a jump between two samples may be
/// from a turn, in half turns: the noise of the sensor, and the motion within a sample. Convention.
pub(crate) const WRAPPED: f64 = 1.02;
pub(crate) const WRAPPED_BELOW: f64 = 0.02;
pub(crate) const TURN: f64 = 0.2;

/// Part of a single log, in time, that is not held out: the contract of the command. Convention.
pub(crate) const TRAINED: f64 = 0.75;

/// Confidence of the intervals where none is asked for, and its range. Convention.
pub(crate) const CONFIDENCE: f64 = 0.95;
pub(crate) const CONFIDENCES: (f64, f64) = (0.5, 0.999);

/// Largest share of the motion that a user may call immaterial: from half on it is the motion. Convention.
pub(crate) const MOST_MATERIAL: f64 = 0.5;

/// Seconds of a limit that is none, a century: clocks can't count much further. Argument.
pub(crate) const FOREVER: f64 = 3e9;
