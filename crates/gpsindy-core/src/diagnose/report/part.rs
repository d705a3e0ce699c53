//! What was found by part of the machine: schema `gpsindy.diagnosis/1`, `by_part`.

use crate::diagnose::parts::PartKind;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A joint, what was found in it, and above which sizes nothing else is there.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PartFound {
    /// What it is.
    pub kind: PartKind,
    /// As its simulator calls it.
    pub part: String,
    /// Whether a logged column shows how it moves.
    pub measured: bool,
    /// Whether its effects were suspects.
    pub asked: bool,
    /// Share of the gap in its equations, 0 where there is no gap.
    pub share: f64,
    /// Numbers of its included causes, in the order of `causes`, from 0.
    pub causes: Vec<usize>,
    /// Sizes above which a further force, delay or gain error of it would have been found.
    pub nothing_above: Vec<Bound>,
    /// All of it in a sentence.
    pub says: String,
}

/// A size above which nothing of a kind is there, at 95 % power.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Bound {
    /// Id of the catalogue: of the effects in one unit the one with the largest bound.
    pub effect: String,
    /// In `unit`.
    pub above: f64,
    /// Unit of the size.
    pub unit: String,
}
