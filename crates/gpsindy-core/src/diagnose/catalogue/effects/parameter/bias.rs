//! A constant rate.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "constant bias",
    meaning: "A constant force or rate that the model does not have.",
    family: Family::Parameter,
    form: "c",
    symbols: &[],
    parameters: "c: constant rate",
    signature: "a constant offset of the rate, whatever the motion",
    places: &[Place::Row],
    sense: &[],
    twins: &[
        (Effect::SensorBias, experiment::TURN_THE_RIG),
        (Effect::InputBias, experiment::TURN_THE_RIG),
        (Effect::CoulombFriction, experiment::TURN_THE_RIG),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("v", "-4*x - 0.2*v + 3*u + 1.2")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, unit) = (writer.rate(), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    writer.add_term(c);
    Ok(vec![amplitude(&[writer.small()])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("c", &[])?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
