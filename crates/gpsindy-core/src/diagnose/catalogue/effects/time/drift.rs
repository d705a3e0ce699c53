//! A parameter or a bias that changes slowly with time.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::unit;

pub(super) static DEFINITION: Definition = Definition {
    name: "drift",
    meaning: "A parameter of the plant changes slowly with time.",
    family: Family::Time,
    form: "a parameter or bias changes slowly with time: c*t",
    symbols: &[],
    parameters: "c: change per second",
    signature: "the model fits the beginning of a log but not its end",
    places: &[Place::Time, Place::Parameter],
    sense: &[],
    twins: &[(Effect::Bias, experiment::THE_SAME_AGAIN), (Effect::StepDisturbance, experiment::THE_SAME_AGAIN)],
    traits: Traits { has_many_places: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(4.0, 1.0), 12.0, "v", &[("v", "2*u - 0.8*v + 0.08*t")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let span = writer.span().2;
    let Some(name) = writer.hypothesis.variables.first().cloned() else {
        let unit = unit::product(&[(&writer.unit_of_rate(), 1), ("s", -1)]);
        let c = writer.add("c", 0.0, writer.rate() / span, FREE, &unit);
        writer.add_term(c.times(Expression::Time));
        return Ok(vec![amplitude(&[writer.small() / span])]);
    };
    let c = writer.add("c", 0.0, 1.0 / span, FREE, "1/s");
    let changed = number(1.0).plus(c.times(Expression::Time)).times(Expression::variable(name.clone()));
    writer.replace(&name, &changed);
    Ok(vec![amplitude(&[1e-3 / span])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let span = planting.span();
    let name = planting.name(0);
    if name.is_empty() {
        planting.add("c*t", &[])?;
        return Ok(Some(Size::added(unit::product(&[(&planting.rate_unit(), 1), ("s", -1)]), planting.rate() / span)));
    }
    let changed = planting.written("1 + c*t", "c", &[])?;
    planting.replace(&name, &changed.times(Expression::variable(name.clone())));
    Ok(Some(Size::within("c", "1/s".into(), (0.02 / span, 3.0 / span), "")))
}
