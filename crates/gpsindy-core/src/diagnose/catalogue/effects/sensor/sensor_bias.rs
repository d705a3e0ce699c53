//! The column has a constant offset.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor bias",
    meaning: "The sensor has a constant offset.",
    family: Family::Sensor,
    form: "the column reads state + c",
    symbols: &[],
    parameters: "c: offset",
    signature: "a constant difference, whatever the motion",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "x + 0.3"),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = writer.hypothesis.state;
    let (size, unit) = (writer.scene.states[state].size(), writer.model.states[state].unit.clone());
    let c = writer.add("c", 0.0, size, FREE, &unit);
    writer.read_as(writer.reads().plus(c));
    Ok(vec![amplitude(&[1e-3 * size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.read_as("reads + c")?;
    let state = planting.hypothesis.state;
    let unit = planting.model.states[state].unit.clone();
    Ok(Some(Size::added(unit, planting.scene.states[state].size())))
}
