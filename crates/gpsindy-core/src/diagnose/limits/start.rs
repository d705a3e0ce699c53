//! Starts of rollouts of held-out logs.

/// Share of a held-out rollout that may refine its start: three quarters are left to judge by. Convention.
pub(crate) const BEGINNING: f64 = 0.25;

/// Fewest samples of a beginning: two for each of the values of a two-state model's start, twice over. Argument.
pub(crate) const FEWEST_SAMPLES: usize = 8;

/// Fewest samples of a parabola, and by how much more the next one takes: twice its three values, and then lengths
/// whose errors differ by half. Argument.
pub(crate) const SHORTEST_PARABOLA: usize = 6;
pub(crate) const LONGER_PARABOLA: f64 = 1.5;

/// Deviations of its sampling error by which a parabola's residual may exceed the noise: 19 in 20 stay within. Argument.
pub(crate) const PARABOLA_OFF: f64 = 2.0;

/// Uncertainty of a belief beyond what the noise gives: as much again for what a parabola does not follow. Convention.
pub(crate) const PARABOLA_ROUGH: f64 = 2.0;

/// How far a start that no sample shows may be from its guess, in typical sizes: no bound in practice, but an end to a
/// search that nothing holds. Convention.
pub(crate) const UNTOLD: f64 = 30.0;

/// Steps of a start's fit, and how often its weights are taken anew: Gauss-Newton doubles its digits each step. Argument.
pub(crate) const START_STEPS: usize = 6;
pub(crate) const START_ROUNDS: usize = 2;
