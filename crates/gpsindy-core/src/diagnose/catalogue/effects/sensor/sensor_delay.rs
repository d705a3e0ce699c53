//! The column reads late.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor delay",
    meaning: "The reading of the sensor is delayed.",
    family: Family::Sensor,
    form: "the column reads the state tau earlier",
    symbols: &[],
    parameters: "tau: delay, s",
    signature: "one column lags behind the others by a constant time",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[],
    traits: Traits { reads_the_past: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "delay(x, 0.3)"),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let name = writer.model.states[writer.hypothesis.state].name.clone();
    let longest = 0.3 * writer.scene.duration;
    let tau = writer.add("tau", 0.0, writer.scene.period, (0.0, longest), "s");
    let late = Expression::Call(Function::Delay, vec![Expression::variable(name.clone()), tau]);
    writer.read_as(writer.reads().substitute(&name, &late));
    Ok(writer.times(1.7, 10))
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.see_as("delay(x, tau)", "tau")?;
    Ok(Some(planting.late()))
}
