//! The control has an offset.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "input bias",
    meaning: "The actuator adds a constant to its command.",
    family: Family::InputStatic,
    form: "u becomes u + c",
    symbols: &["u"],
    parameters: "c: offset of the control",
    signature: "the response is that of a shifted command",
    places: &[Place::Control],
    sense: &[],
    twins: &[(Effect::SensorBias, experiment::TURN_THE_RIG), (Effect::CoulombFriction, experiment::TURN_THE_RIG)],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*(u + 0.3) - 0.8*v")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let size = drive.excursion.size();
    let c = writer.add("c", 0.0, size, FREE, &drive.unit);
    writer.replace(&drive.name, &drive.u.plus(c));
    Ok(vec![amplitude(&[1e-3 * size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.drive("u + c", "c")?;
    Ok(Some(Size::added(planting.control_unit(), planting.size_of(0))))
}
