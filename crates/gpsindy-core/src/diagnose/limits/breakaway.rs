//! Levels at rest of dry friction, which are found by trial.

/// Ratios of the level at rest to that in motion from which the others are fitted: machines have up to about three, and the lattices reach from
/// one to the next. Argument.
pub(crate) const RATIOS: [f64; 4] = [1.2, 1.6, 2.2, 3.0];

/// Largest ratio: a joint that takes more to start is jammed. Convention.
pub(crate) const MOST: f64 = 5.0;

/// Shares of the level to which lattices around it reach, one after the other, and their steps: each reaches beyond the neighbours of the one
/// before. Argument.
pub(crate) const NARROWED: [f64; 3] = [0.25, 0.06, 0.015];
pub(crate) const LATTICE: usize = 16;

/// Share of the level to which its interval is looked for. Convention.
pub(crate) const WIDEST: f64 = 0.4;
