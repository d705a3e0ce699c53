//! The paper's Algorithm 1: smoothing, regression rows, one sparse regression per state; and the timing of the controls.

pub(crate) mod regress;
pub(crate) mod rows;
pub(crate) mod second_opinion;
pub(crate) mod smooth;
pub(crate) mod timing;
pub(crate) mod track;
