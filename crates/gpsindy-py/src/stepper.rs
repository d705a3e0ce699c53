//! What a simulator that steps is made of, as Python hands it over.

use crate::convert::error;
use gpsindy_core::expression::Function;
use gpsindy_core::{Control, Error, Expression, Model, Parameter, Port, State};
use pyo3::prelude::*;

/// (name, variable, unit, position, [(effect, parameter of the simulator)])
type PortParts = (String, String, String, Option<String>, Vec<(String, String)>);

/// (name, value, unit, tolerance, range, scale)
type ParameterParts = (String, f64, String, Option<f64>, Option<(f64, f64)>, Option<f64>);

/// What a simulator that steps is made of, handed over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Stepper {
    states: Vec<(String, String)>,
    controls: Vec<(String, String)>,
    kinematic: Vec<(String, String)>,
    ports: Vec<PortParts>,
    parameters: Vec<ParameterParts>,
    /// (control, name, s, scale, tolerance): a control that reaches the simulator late by a parameter that is not the simulator's.
    delays: Vec<(String, String, f64, f64, Option<f64>)>,
    initial: Vec<(String, f64)>,
    /// State, and what its column reads as an expression.
    measured: Vec<(String, String)>,
}

impl Stepper {
    /// Number of states and of controls.
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.states.len(), self.controls.len())
    }

    /// Values of the simulator's own parameters.
    pub(crate) fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.1).collect()
    }

    /// The model that calls the simulator.
    pub(crate) fn model(self, name: String) -> PyResult<Model> {
        let Stepper { states, controls, kinematic, ports, parameters, delays, initial, measured } = self;
        let index = |name: &str| {
            let found = states.iter().position(|(known, ..)| known == name);
            found.ok_or_else(|| error(Error::unknown("state", name, states.iter().map(|s| &s.0))))
        };
        let kinematic =
            kinematic.iter().map(|(x, v)| Ok((index(x)?, index(v)?))).collect::<PyResult<Vec<(usize, usize)>>>()?;
        let state = |(name, unit): &(String, String)| State { unit: unit.clone(), ..State::new(name, Expression::Pi) };
        let port = |(name, variable, unit, position, carried): &PortParts| Port {
            unit: unit.clone(),
            position: position.clone(),
            carried: carried.clone(),
            ..Port::new(name, variable)
        };
        let parameter = |(name, value, unit, tolerance, range, scale): &ParameterParts| Parameter {
            unit: unit.clone(),
            tolerance: *tolerance,
            range: *range,
            scale: *scale,
            ..Parameter::new(name, *value)
        };
        let mut model = Model {
            name,
            states: states.iter().map(state).collect(),
            controls: controls.iter().map(|(name, unit)| Control { name: name.clone(), unit: unit.clone() }).collect(),
            ports: ports.iter().map(port).collect(),
            parameters: parameters.iter().map(parameter).collect(),
            initial: initial.into_iter().collect(),
            ..Model::default()
        };
        for (state, reads) in &measured {
            model.states[index(state)?].measured = Some(Expression::parse(reads).map_err(error)?);
        }
        model.call_simulator(&kinematic);
        for (control, name, late, scale, tolerance) in delays {
            let amounts = vec![Expression::variable(&control), Expression::variable(&name)];
            let late_control = Expression::Call(Function::Delay, amounts);
            for state in &mut model.states {
                state.equation = state.equation.substitute(&control, &late_control);
            }
            let (range, scale) = (Some((0.0, f64::INFINITY)), Some(scale));
            model.parameters.push(Parameter {
                unit: "s".into(),
                range,
                scale,
                tolerance,
                ..Parameter::new(name, late)
            });
        }
        model.check().map_err(error)?;
        Ok(model)
    }
}
