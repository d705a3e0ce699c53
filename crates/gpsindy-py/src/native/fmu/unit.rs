//! One instance of an FMU with its variables and with parameters of its own, however it is stepped.

use super::component::Component;
use super::failure::Failure;
use pyo3::prelude::*;
use std::ffi::c_uint;
use std::sync::Arc;

/// Value references of variables, handed over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct References {
    pub(super) states: Vec<c_uint>,
    /// Of the states, in their order.
    pub(super) derivatives: Vec<c_uint>,
    /// Controls first, then ports; and how many of them are controls.
    pub(super) inputs: Vec<c_uint>,
    pub(super) n_controls: usize,
    pub(super) parameters: Vec<c_uint>,
    /// The independent variable, where the FMU shows it.
    pub(super) time: Option<c_uint>,
}

/// An instance and what initialises it.
pub(super) struct Unit {
    pub(super) component: Component,
    pub(super) references: Arc<References>,
    /// Values, one a reference.
    pub(super) parameters: Vec<f64>,
}

impl Unit {
    /// Initialises with the parameters, and from `start`, states and inputs, where it is given.
    pub(super) fn initialize(&mut self, start: Option<(&[f64], &[f64])>) -> Result<(), Failure> {
        self.component.setup_experiment()?;
        self.component.set(&self.references.parameters, &self.parameters)?;
        if let Some((x, _)) = start {
            self.component.set(&self.references.states, x)?;
        }
        self.component.enter_initialization()?;
        if let Some((_, inputs)) = start {
            self.component.set(&self.references.inputs, inputs)?;
        }
        self.component.exit_initialization()
    }
}
