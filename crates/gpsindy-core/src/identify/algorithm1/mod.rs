//! The lines of the paper's Algorithm 1: smooth, rows, one sparse regression a state; and how the controls act.

pub(crate) mod regress;
pub(crate) mod rows;
pub(crate) mod second_opinion;
pub(crate) mod smooth;
pub(crate) mod timing;
pub(crate) mod track;
