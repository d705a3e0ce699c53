//! Small commands do nothing.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "input dead zone",
    meaning: "The actuator does nothing for small commands.",
    family: Family::InputStatic,
    form: "u becomes dead_zone(u, c)",
    symbols: &["u"],
    parameters: "c: half width",
    signature: "no response to small commands",
    places: &[Place::Control],
    sense: &[],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*dead_zone(u, 0.3) - 0.8*v")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (size, largest) = (drive.excursion.size(), drive.excursion.size_quantile(1.0));
    let c = writer.add("c", 0.0, size, (0.0, 0.95 * largest), &drive.unit);
    writer.replace(&drive.name, &Expression::Call(Function::DeadZone, vec![drive.u, c]));
    Ok([0.02, 0.05, 0.1, 0.2, 0.35, 0.5].map(|part| keep(&[part * size])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let largest = planting.largest();
    planting.drive("dead_zone(u, c)", "c")?;
    let range = (0.02 * largest, 0.95 * largest);
    Ok(Some(Size::within("c", planting.control_unit(), range, "it would leave nothing of the control")))
}
