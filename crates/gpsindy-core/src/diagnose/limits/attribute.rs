//! Moves from one set of effects to a better one.

/// Moves from one set of effects to another, at most: each of six effects changed twice. It ends a search that would go
/// round in a circle, as leaving an effect out and putting several in its place can. Convention.
pub(crate) const MOST_MOVES: usize = 12;

/// Evidence (nats) by which another effect in a place must beat the winner: less is within what two fits that came to rest
/// at different digits differ by. Argument.
pub(crate) const SWAP: f64 = 0.5;

/// Share of the mean squared residual that moves must leave for longer rollouts to be tried before the next one: a tenth of it is what a better model could
/// pile up in rollouts of several times the length. Convention.
pub(crate) const MENDED: f64 = 0.1;

/// Share of the gap below which an effect has no name while structure without one is left.
///
/// Where the whole is not explained, its residual is no noise, and evidence that counts it as noise finds a use for
/// any flexible effect. Convention.
pub(crate) const NAMED: f64 = 0.01;

/// Share of the gap that counts: a rest below it is none, and an effect that removes less is no cause of the gap. Convention.
pub(crate) const REST: f64 = 0.002;

/// Mean squared structure (in noise units) above which a rest counts as more than the model's own roughness. Convention.
pub(crate) const STRUCTURE: f64 = 0.1;

/// Evidence (nats) by which one hold of the controls must beat the other with the causes in place: odds of 20,000, far
/// beyond what chance gives one binary choice. Argument.
pub(crate) const HOLD: f64 = 10.0;
