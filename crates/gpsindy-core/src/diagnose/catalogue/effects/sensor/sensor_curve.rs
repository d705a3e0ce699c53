//! The column is bent.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;
use crate::model::unit;

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor curve",
    meaning: "The sensor is bent: its reading is no straight line of what it measures.",
    family: Family::Sensor,
    form: "the column reads state + c*state^2",
    symbols: &[],
    parameters: "c: curvature",
    signature: "errors that grow with the square of the reading, however fast it moves",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[
        (
            Effect::SensorScale,
            "static readings at a third, at two thirds and at the end of the range against a reference",
        ),
        (Effect::CubicStiffness, "static readings over the range against a reference"),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "x + 0.25*x^2"),
    in_mjcf: None,
    about: "The curve is the same in all runs. A quadratic is the start of any curve: of a camera's lens, of a photometer that saturates, of a level gauge in a tank whose walls are inclined.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = writer.hypothesis.state;
    let size = writer.scene.states[state].size();
    let unit = unit::product(&[(&writer.model.states[state].unit, -1)]);
    let c = writer.add("c", 0.0, 1.0 / size, FREE, &unit);
    let reads = writer.reads();
    writer.read_as(reads.clone().times(number(1.0).plus(c.times(reads))));
    Ok(vec![amplitude(&[1e-3 / size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.read_as("reads + c*reads^2")?;
    let state = planting.hypothesis.state;
    let size = planting.scene.states[state].size();
    let unit = unit::product(&[(&planting.model.states[state].unit, -1)]);
    Ok(Some(Size::within("c", unit, (0.02 / size, 1.0 / size), "")))
}
