//! The control acts through a first-order lag.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{Model, State};

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
    about: "Beside a rate limit of the same control it follows what that lets pass.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let period = writer.scene.period;
    let tau = writer.add_scale("tau", period, period, (0.05 * period, 0.5 * writer.scene.duration), "s");
    let lagged = writer.model.free_name(&format!("{}_lag", drive.name));
    // What lags follows the command as a rate limit lets it pass: only a control has a rate limit.
    let (own, limited) = (Expression::variable(lagged.clone()), limited(&writer.model, &drive.u));
    match &limited {
        Some(limited) => writer.replace_part(limited, &own),
        None => writer.replace(&drive.name, &own),
    }
    let follows = limited.unwrap_or(drive.u).minus(own).over(tau);
    writer.model.states.push(State { unit: drive.unit, ..State::new(lagged, follows) });
    Ok(writer.times(1.5, 14))
}

/// The control behind a rate limit, where the model has one.
fn limited(model: &Model, u: &Expression) -> Option<Expression> {
    let mut found = None;
    let texts = model.states.iter().flat_map(|s| std::iter::once(&s.equation).chain(&s.measured));
    texts.for_each(|text| {
        text.visit(&mut |part| {
            let is_it = matches!(part, Expression::Call(Function::Slew, arguments) if arguments.first() == Some(u));
            if is_it && found.is_none() {
                found = Some(part.clone());
            }
        });
    });
    found
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
