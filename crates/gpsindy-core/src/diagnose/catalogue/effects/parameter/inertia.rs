//! An inertia that differs from the model.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{Writer, amplitude, number};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "inertia",
    meaning: "The moved inertia exceeds that of the model: armature, payload or added mass.",
    family: Family::Parameter,
    form: "the right side of the equation is divided by (1 + c)",
    symbols: &[],
    parameters: "c: missing inertia, relative to that of the model",
    signature: "every force accelerates this axis less, by the same factor",
    places: &[Place::Row],
    sense: &[Sense::Speed, Sense::NoScale],
    twins: &[(Effect::InputGain, experiment::KNOWN_LOAD), (Effect::ParameterError, experiment::KNOWN_LOAD)],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("v", "(-4*x - 0.2*v + 3*u)/1.4")]),
    in_mjcf: Some("`armature` of the joint"),
    about: "If a parameter of the model already scales the whole equation, such as its mass, that parameter is tested instead. Negative values down to half of the inertia are allowed.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let c = writer.add("c", 0.0, 1.0, (-0.5, 20.0), "");
    let equation = &mut writer.model.states[writer.hypothesis.state].equation;
    *equation = equation.clone().over(number(1.0).plus(c));
    Ok(vec![amplitude(&[1e-3])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let factor = planting.written("1/(1 + c)", "c", &[])?;
    let equation = &mut planting.model.states[planting.hypothesis.state].equation;
    *equation = factor.times(equation.clone());
    Ok(Some(Size::within("c", String::new(), (0.02, 10.0), "")))
}
