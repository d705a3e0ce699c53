//! Handed over: the sets of effects that straight lines chose, what each promised, and what its fit achieved.

/// One effect of a set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Id of the effect.
    pub effect: String,
    /// The state whose equation or sensor it changes.
    pub state: String,
    /// What it depends on.
    pub variables: Vec<String>,
}

/// A set of effects that a screening handed over to a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Handed {
    /// Its effects: the ones that stay first, then the ones that are new.
    pub members: Vec<Member>,
    /// Family of the last of the new ones.
    pub family: String,
    /// By how much the straight line would lower the sum of squares (squared noise units) of the set that it was one move away from.
    /// Of a simulator that steps, that of the innovations.
    pub promised: f64,
    /// By how much the fit lowered the sum of squares of the rollouts, as far as it was carried on.
    pub achieved: f64,
    /// Whether the fit came to rest: one that lost the race did not.
    pub at_rest: bool,
}
