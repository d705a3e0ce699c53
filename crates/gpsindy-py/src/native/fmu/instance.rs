//! One instance of an FMU, with parameters of its own, that makes steps, each from a state of its own.

use super::co_simulation::CoSimulation;
use super::component::Component;
use super::exchange::Exchange;
use super::failure::Failure;
use super::unit::{References, Unit};
use pyo3::prelude::*;
use std::sync::Arc;

/// An instance that was initialised.
pub(super) struct Instance {
    unit: Unit,
    kind: Kind,
}

/// How an FMU is stepped.
enum Kind {
    ModelExchange(Exchange),
    CoSimulation(CoSimulation),
}

impl Instance {
    /// With a number of event indicators as model exchange, else as co-simulation.
    pub(super) fn new(
        component: Component,
        references: &Arc<References>,
        parameters: &[f64],
        indicators: Option<usize>,
    ) -> Result<Self, Failure> {
        let mut unit = Unit { component, references: references.clone(), parameters: parameters.to_vec() };
        let kind = match indicators {
            Some(count) => Kind::ModelExchange(Exchange::begin(&mut unit, count)?),
            None => Kind::CoSimulation(CoSimulation::begin(&unit)),
        };
        Ok(Self { unit, kind })
    }

    /// Takes the states `x` over `dt` s, the inputs held.
    pub(super) fn step(&mut self, x: &mut [f64], inputs: &[f64], dt: f64) -> Result<(), Failure> {
        match &mut self.kind {
            Kind::ModelExchange(exchange) => exchange.step(&mut self.unit, x, inputs, dt),
            Kind::CoSimulation(slave) => slave.step(&mut self.unit, x, inputs, dt),
        }
    }

    /// Goes on with other parameters.
    pub(super) fn reset(&mut self, parameters: &[f64]) -> Result<(), Failure> {
        self.unit.parameters.copy_from_slice(parameters);
        match &self.kind {
            Kind::ModelExchange(_) => Exchange::reset(&mut self.unit),
            // Every step does it.
            Kind::CoSimulation(_) => Ok(()),
        }
    }

    pub(super) fn free(self, py: Python<'_>) -> PyResult<()> {
        self.unit.component.free(py)
    }
}
