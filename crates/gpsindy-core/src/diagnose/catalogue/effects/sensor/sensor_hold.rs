//! The column repeats its last value until the sensor's next sample.

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
    name: "sensor hold",
    meaning: "The column repeats the last value of a sensor that is slower than the log.",
    family: Family::Sensor,
    form: "the column reads sample_hold(state, T, phase)",
    symbols: &[],
    parameters: "T: period of the sensor, s, phase: a time at which it samples, s",
    signature: "one column moves in steps of one length in time, half a period late on average",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[
        (Effect::SensorDelay, "fast motion, logged at ten times the rate of the sensor"),
        (Effect::SensorFilter, "fast motion, logged at ten times the rate of the sensor"),
    ],
    traits: Traits { reads_the_past: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "sample_hold(x, 0.4, 0)"),
    in_mjcf: None,
    about: "Period and phase are found by trial, because the values that are shown change in jumps when they move; the other parameters are then fitted as always. All runs share the clock of the log: runs that each begin at 0 s are taken to begin alike. A period of two samples of the log is the shortest that is tried. A log that leaves cells empty until the sensor's next sample needs no such effect.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let name = writer.model.states[writer.hypothesis.state].name.clone();
    let (period, phase) = writer.add_sampling();
    let held = Expression::Call(Function::SampleHold, vec![Expression::variable(name.clone()), period, phase]);
    writer.read_as(writer.reads().substitute(&name, &held));
    Ok(writer.samplings())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.see_as("sample_hold(x, T, 0)", "T")?;
    Ok(Some(planting.late().called("T")))
}
