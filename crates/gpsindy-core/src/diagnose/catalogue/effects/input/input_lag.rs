//! The control acts through a first-order lag.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::Expression;
use crate::model::State;

pub(super) static DEFINITION: Definition = Definition {
    name: "input lag",
    meaning: "The actuator follows its command with a first-order lag.",
    family: Family::InputDynamic,
    form: "u becomes a state that follows u with time constant tau",
    symbols: &["u"],
    parameters: "tau: time constant, s",
    signature: "fast commands are smoothed, slow ones pass",
    places: &[Place::Control],
    sense: &[],
    twins: &[],
    traits: Traits { added_states: 1, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*w - 0.8*v"), ("w", "(u - w)/0.5")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let period = writer.scene.period;
    let tau = writer.add_scale("tau", period, period, (0.05 * period, 0.5 * writer.scene.duration), "s");
    let lagged = writer.model.free_name(&format!("{}_lag", drive.name));
    writer.replace(&drive.name, &Expression::variable(lagged.clone()));
    let follows = drive.u.minus(Expression::variable(lagged.clone())).over(tau);
    writer.model.states.push(State { unit: drive.unit, ..State::new(lagged, follows) });
    Ok(writer.times(1.5, 14))
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let control = planting.name(0);
    let follower = planting.model.free_name(&format!("{control}_follows"));
    let own = Expression::variable(follower.clone());
    planting.replace(&control, &own);
    let rate = Expression::variable(control).minus(own).over(planting.size.clone());
    planting.model.states.push(State::new(follower, rate));
    Ok(Some(planting.late()))
}
