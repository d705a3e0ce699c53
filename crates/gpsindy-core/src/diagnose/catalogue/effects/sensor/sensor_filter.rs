//! The column reads a low pass of the state.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::Expression;
use crate::model::State;

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor filter",
    meaning: "The sensor low-pass filters the state.",
    family: Family::Sensor,
    form: "the column reads a low pass of the state with time constant tau",
    symbols: &[],
    parameters: "tau: time constant, s",
    signature: "fast motion appears smaller and later in one column than in the others",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[
        (Effect::SensorDelay, "a step, or a chirp beyond 1/(2 pi tau)"),
        (Effect::InputLag, "log an echo of the command or a second sensor, or close the loop over it"),
        (Effect::InputDelay, "log an echo of the command or a second sensor, or close the loop over it"),
        (Effect::SensorScale, "slow and fast motion of the same size"),
    ],
    traits: Traits { added_states: 1, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example {
        reads: "y",
        own_start: 1.0,
        ..Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("y", "(x - y)/0.4")])
    },
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = &writer.model.states[writer.hypothesis.state];
    let (name, period) = (state.name.clone(), writer.scene.period);
    let own = Expression::variable(name.clone());
    let tau = writer.add_scale("tau", period, period, (0.05 * period, 0.3 * writer.scene.duration), "s");
    let smooth = writer.add_state(&format!("{name}_filtered"), None);
    writer.set_rate(&smooth, own.minus(smooth.clone()).over(tau));
    writer.read_as(writer.reads().substitute(&name, &smooth));
    Ok(writer.times(1.7, 10))
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let state = &planting.model.states[planting.hypothesis.state];
    let (name, reads) = (state.name.clone(), state.measured.clone());
    let filtered = planting.model.free_name(&format!("{name}_smoothed"));
    let symbols = [("x", Expression::variable(name.clone())), ("y", Expression::variable(filtered.clone()))];
    let rate = planting.written("x/tau - y/tau", "tau", &symbols)?;
    let reads = reads.unwrap_or_else(|| Expression::variable(name.clone()));
    let seen = reads.substitute(&name, &Expression::variable(filtered.clone()));
    planting.model.states[planting.hypothesis.state].measured = Some(seen);
    planting.model.states.push(State::new(filtered, rate));
    Ok(Some(planting.late()))
}
