//! A nominal parameter has another value.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Added, Role, Start};
use crate::diagnose::catalogue::joint::dissipative_bounds;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, keep};
use crate::error::{Error, Result};

pub(super) static DEFINITION: Definition = Definition {
    name: "wrong parameter",
    meaning: "A parameter of the nominal model has another value.",
    family: Family::Parameter,
    form: "value of a nominal parameter",
    symbols: &[],
    parameters: "value: the value in the logs",
    signature: "the whole term that the parameter scales is too large or too small",
    places: &[Place::Parameter],
    sense: &[],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("v", "-5*x - 0.2*v + 3*u")]),
    in_mjcf: Some("the field: `kp`, `kv`, `mass` ..."),
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let name = writer.hypothesis.variables[0].clone();
    let Some(index) = writer.model.parameter_index(&name) else {
        return Err(Error::unknown("parameter", &name, writer.model.parameters.iter().map(|p| &p.name)));
    };
    let own = writer.model.parameters[index].range;
    let (lower, upper) = dissipative_bounds(&writer.model, &name).or(own).unwrap_or(FREE);
    let parameter = &mut writer.model.parameters[index];
    parameter.tolerance = None;
    let size = parameter.typical();
    let unit = parameter.unit.clone();
    let added = Added { symbol: "value".into(), name, unit, scale: size, lower, upper, role: Role::Plain };
    // A straight line near the nominal value, then finite steps for what is none.
    let value = parameter.value;
    writer.fitted.push((index, added));
    let near = Start { amplitudes: vec![(0, value)], ..amplitude(&[value + 1e-3 * size]) };
    let steps = [1.3, 0.75].map(|f| keep(&[if value == 0.0 { (f - 1.0) * size } else { value * f }]));
    Ok(std::iter::once(near).chain(steps).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let parameter = planting.model.parameter_index(&planting.name(0));
    Ok(parameter.map(|index| Size::of_parameter(index, &planting.model)))
}
