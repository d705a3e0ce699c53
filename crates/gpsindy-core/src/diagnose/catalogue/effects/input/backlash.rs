//! The control passes a play.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "backlash",
    meaning: "Play: after a reversal, part of the travel has no effect.",
    family: Family::Memory,
    form: "u becomes play(u, c)",
    symbols: &["u"],
    parameters: "c: total width",
    signature: "no response for some time after every reversal of the command",
    places: &[Place::Control],
    sense: &[],
    twins: &[
        (Effect::InputDeadZone, experiment::TRIANGLES),
        (Effect::InputLag, experiment::TRIANGLES),
        (Effect::InputDelay, experiment::TRIANGLES),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*play(u, 0.7) - 0.8*v")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (size, range) = (drive.excursion.size(), drive.excursion.range());
    let c = writer.add("c", 0.0, size, (0.0, 0.9 * range), &drive.unit);
    writer.replace(&drive.name, &Expression::Call(Function::Play, vec![drive.u, c]));
    Ok([0.01, 0.03, 0.06, 0.12, 0.25, 0.4].map(|part| keep(&[part * range])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let stroke = planting.excursion(0).map_or(0.0, Excursion::range);
    planting.drive("play(u, c)", "c")?;
    let range = (0.02 * stroke, 0.9 * stroke);
    Ok(Some(Size::within("c", planting.control_unit(), range, "the control never reverses further")))
}
