//! Simulators that step in native code.

mod copies;
pub(crate) mod fmu;
mod foreign;
pub(crate) mod length;
pub(crate) mod mujoco;
mod rows;

pub(crate) use copies::Native;
