//! The clock of a column is shifted or runs at another rate.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::Expression;

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
    traits: Traits { only_if_asked: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "delay(x, 0.5)"),
    in_mjcf: None,
    about: "The state at the other time is approximated by its value plus its rate times the difference, which holds for differences that are short compared with the motion. It is tested only on request: an offset of half a sample absorbs the timing errors of any other effect.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = &writer.model.states[writer.hypothesis.state];
    let (name, rate) = (state.name.clone(), state.equation.clone());
    let (period, span) = (writer.scene.period, writer.span().2);
    let e = writer.add("e", 0.0, period / span, (-0.2, 0.2), "");
    let longest = 0.1 * writer.scene.duration;
    let tau = writer.add("tau", 0.0, period, (-longest, longest), "s");
    let ahead = e.times(Expression::Time).plus(tau);
    let seen = Expression::variable(name.clone()).plus(ahead.times(rate));
    writer.read_as(writer.reads().substitute(&name, &seen));
    Ok(vec![Start {
        columns: vec![vec![1e-2 * period / span, 0.0], vec![0.0, 1e-2 * period]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
    }])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let state = &planting.model.states[planting.hypothesis.state];
    let (name, reads) = (state.name.clone(), state.measured.clone());
    let symbols = [("x", Expression::variable(name.clone())), ("rate", state.equation.clone())];
    let seen = planting.written("x + e*t*rate", "e", &symbols)?;
    let measured = reads.map_or(seen.clone(), |reads| reads.substitute(&name, &seen));
    planting.model.states[planting.hypothesis.state].measured = Some(measured);
    let (period, span) = (planting.scene.period, planting.span());
    let size =
        Size::within("e", String::new(), (period / span, 0.2), "beyond that no straight line describes the clock");
    Ok(Some(size))
}
