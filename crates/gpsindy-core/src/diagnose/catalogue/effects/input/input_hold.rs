//! The control acts in steps of the controller's own period.

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
    name: "input hold",
    meaning: "The actuator takes a command once per period of its own and holds it until the next.",
    family: Family::InputDynamic,
    form: "u becomes sample_hold(u, T, phase)",
    symbols: &["u"],
    parameters: "T: period, s, phase: a time at which it takes a command, s",
    signature: "the machine follows a smooth command in steps, half a period late on average",
    places: &[Place::Control],
    sense: &[],
    twins: &[
        (Effect::InputDelay, "a fast chirp, logged at ten times the rate of the controller"),
        (Effect::InputLag, "a fast chirp, logged at ten times the rate of the controller"),
        (Effect::SensorHold, "log an echo of the command or a second sensor"),
    ],
    traits: Traits { imitated_by_hold: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*sample_hold(u, 0.8, 0) - 0.8*v")]),
    in_mjcf: None,
    about: "Period and phase are found by trial, because what is held changes in jumps when they move; the other parameters are then fitted as always. All runs share the clock of the log: runs that each begin at 0 s are taken to begin alike. A period of two samples of the log is the shortest that is tried. Jitter of the period is not modelled.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (period, phase) = writer.add_sampling();
    writer.replace(&drive.name, &Expression::Call(Function::SampleHold, vec![drive.u, period, phase]));
    Ok(writer.samplings())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.drive("sample_hold(u, T, 0)", "T")?;
    Ok(Some(planting.late().called("T")))
}
