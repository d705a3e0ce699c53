//! The control acts with another gain.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "input gain",
    meaning: "The actuator does more or less than commanded, by a constant factor.",
    family: Family::InputStatic,
    form: "u becomes (1 + c)*u",
    symbols: &["u"],
    parameters: "c: relative gain error",
    signature: "every response to the control is scaled",
    places: &[Place::Control],
    sense: &[],
    twins: &[(Effect::ParameterError, experiment::KNOWN_LOAD), (Effect::SensorScale, experiment::KNOWN_LOAD)],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*(1.3*u) - 0.8*v")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let c = writer.add("c", 0.0, 1.0, FREE, "");
    writer.replace(&drive.name, &number(1.0).plus(c).times(drive.u));
    Ok(vec![amplitude(&[1e-3])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.drive("(1 + c)*u", "c")?;
    Ok(Some(Size::within("c", String::new(), (0.02, 3.0), "")))
}
