//! The column has a scale error.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor scale",
    meaning: "The sensor has a scale error.",
    family: Family::Sensor,
    form: "the column reads (1 + c)*state",
    symbols: &[],
    parameters: "c: relative error of scale",
    signature: "errors in proportion to the reading",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "1.3*x"),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let c = writer.add("c", 0.0, 1.0, FREE, "");
    writer.read_as(number(1.0).plus(c).times(writer.reads()));
    Ok(vec![amplitude(&[1e-3])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.read_as("(1 + c)*reads")?;
    Ok(Some(Size::within("c", String::new(), (0.02, 3.0), "")))
}
