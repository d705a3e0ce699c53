//! What of a MuJoCo model is a state, a command, a force and a parameter.

use pyo3::prelude::*;
use std::ffi::{CString, c_int};

/// The parts, handed over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Plan {
    /// Bits of `mjtState`: time, qpos, qvel, act, ctrl, qfrc_applied.
    pub(super) components: [c_int; 6],
    /// Places of the joints' positions in qpos.
    pub(super) positions: Vec<usize>,
    /// Places of their velocities in qvel.
    pub(super) velocities: Vec<usize>,
    pub(super) activations: usize,
    /// Actuators whose commands are handed in; the others have 0.
    pub(super) commands: Vec<usize>,
    pub(super) settings: Vec<Setting>,
    pub(super) drivers: Vec<Driver>,
    pub(super) base: Option<Base>,
    pub(super) locks: Vec<Lock>,
    /// How many kinds of warnings the engine counts.
    pub(super) warnings: usize,
    /// The model's own step, s.
    pub(super) timestep: f64,
}

/// A number of the model that is a parameter.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Setting {
    /// In the model.
    pub(super) value: f64,
    /// Where it is written; nowhere where it belongs to a driver.
    pub(super) writes: Vec<Write>,
    /// Whether constants of the model depend on it.
    pub(super) moves_constants: bool,
}

/// A number that follows a parameter in proportion.
#[derive(FromPyObject)]
pub(super) struct Write {
    /// Field of the model.
    #[pyo3(item("field"))]
    pub(super) field: CString,
    /// In the field.
    #[pyo3(item("place"))]
    pub(super) place: usize,
    /// The parameter at which the number has this value.
    #[pyo3(item("at"))]
    pub(super) at: f64,
    #[pyo3(item("value"))]
    pub(super) value: f64,
}

/// A PD loop around a motor: `ctrl = kp (u - q) - kd dq/dt`.
#[derive(FromPyObject)]
pub(super) struct Driver {
    #[pyo3(item("actuator"))]
    pub(super) actuator: usize,
    /// Among the commands that are handed in.
    #[pyo3(item("command"))]
    pub(super) command: usize,
    /// Of the joints that are states.
    #[pyo3(item("joint"))]
    pub(super) joint: usize,
    /// kp among the parameters; kd comes after it.
    #[pyo3(item("gain"))]
    pub(super) gain: usize,
}

/// A joint that is held in place.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Lock {
    /// In qpos.
    pub(super) position: usize,
    /// In qvel.
    pub(super) velocity: usize,
    /// Its position, rad or m.
    pub(super) at: f64,
}

/// A free base whose motion is given: orientation (4), rates (3), their derivatives (3), and position, velocity and acceleration (9).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Base {
    /// In qpos.
    pub(super) position: usize,
    /// In qvel.
    pub(super) velocity: usize,
    /// Of the file: place and orientation.
    pub(super) pose: [f64; 7],
    /// Inertia, by which accelerations become forces.
    pub(super) inertia: f64,
    /// How many columns of the logs say how it moves: 0, 10 or 19.
    pub(super) columns: usize,
}
