//! The clock of a column is shifted or runs at another rate.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function};

/// Largest relative error of a rate that is still a clock's.
const LARGEST: f64 = 0.2;

pub(super) static DEFINITION: Definition = Definition {
    name: "clock",
    meaning: "The clock of one column is offset, or runs fast or slow.",
    family: Family::Sensor,
    form: "the column reads the state at the time (1 + e)*t + tau",
    symbols: &[],
    parameters: "e: relative error of the rate, tau: offset, s",
    signature: "one column drifts in time against the others, whatever the motion",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[
        (
            Effect::SensorDelay,
            "a run ten times as long, or one event that all columns see at its beginning and its end",
        ),
        (Effect::SensorFilter, "a run ten times as long"),
    ],
    traits: Traits {
        only_if_asked: true,
        reads_the_past: true,
        behind: &[Effect::SensorDelay, Effect::SensorFilter],
        ..Traits::PLAIN
    },
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "delay(x, 0.5)"),
    in_mjcf: None,
    about: "It is tested where a delay or a filter of the same column is one of the best effects or one of the causes found, where no single effect leaves only noise, and on request: an offset of half a sample absorbs the timing errors of any other effect. Time is that of the log's stamps. A slow clock is exact. A fast one shows what is still to come; its fits take the tangent of the motion that led there, which holds for differences that are short compared with the motion, and shows nothing of a control that was set by this very reading.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let name = writer.model.states[writer.hypothesis.state].name.clone();
    let (period, span) = (writer.scene.period, writer.span().2);
    let e = writer.add("e", 0.0, period / span, (-LARGEST, LARGEST), "");
    let longest = 0.1 * writer.scene.duration;
    let tau = writer.add("tau", 0.0, period, (-longest, longest), "s");
    let late = e.times(Expression::Time).plus(tau).negated();
    let seen = Expression::Call(Function::Delay, vec![Expression::variable(name.clone()), late]);
    writer.read_as(writer.reads().substitute(&name, &seen));
    // From half a sample at the end of the logs on.
    let sizes = std::iter::successors(Some(0.5 * period / span), |e| Some(2.0 * e)).take_while(|&e| e <= 0.5 * LARGEST);
    let rates = sizes.flat_map(|e| [keep(&[-e, 0.0]), keep(&[e, 0.0])]);
    // What is late is a delay; nothing else is early.
    let early = std::iter::successors(Some(0.5 * period), |tau| Some(2.0 * tau)).take_while(|&tau| tau <= longest);
    Ok(rates.chain(early.map(|tau| keep(&[0.0, tau]))).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.see_as("delay(x, -e*t)", "e")?;
    let (period, span) = (planting.scene.period, planting.span());
    // Slow, so that what it shows has happened.
    let end = "a clock that is further off is no clock";
    Ok(Some(Size::within("e", String::new(), (period / span, LARGEST), end).downward()))
}
