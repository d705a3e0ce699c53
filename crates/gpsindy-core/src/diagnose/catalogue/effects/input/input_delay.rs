//! The control acts later.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "input delay",
    meaning: "The actuator acts later than commanded.",
    family: Family::InputDynamic,
    form: "u becomes delay(u, tau)",
    symbols: &["u"],
    parameters: "tau: delay, s",
    signature: "every response is late by the same time",
    places: &[Place::Control],
    sense: &[],
    twins: &[
        (Effect::InputLag, "a step, or a chirp beyond 1/(2 pi tau), sampled faster"),
        (Effect::SensorDelay, "log an echo of the command or a second sensor, or close the loop over it"),
    ],
    traits: Traits { imitated_by_hold: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*delay(u, 0.35) - 0.8*v")]),
    in_mjcf: Some("`delay` of the actuator, in whole steps"),
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let longest = 0.3 * writer.scene.duration;
    let tau = writer.add_delay("tau", longest);
    writer.replace(&drive.name, &Expression::Call(Function::Delay, vec![drive.u, tau]));
    Ok(writer.times(1.5, 14))
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.drive("delay(u, tau)", "tau")?;
    Ok(Some(planting.late()))
}
