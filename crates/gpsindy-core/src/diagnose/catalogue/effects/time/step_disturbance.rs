//! A disturbance that sets in at some time.

use crate::diagnose::catalogue::definition::{Definition, Traits, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::Model;

pub(super) static DEFINITION: Definition = Definition {
    name: "step disturbance",
    meaning: "An external disturbance that sets in at some time.",
    family: Family::Time,
    form: "c*step(t - t0)",
    symbols: &[],
    parameters: "c: size, t0: time, s",
    signature: "the model fits up to some time and not afterwards",
    places: &[Place::Time],
    sense: &[],
    twins: &[(Effect::Bias, experiment::THE_SAME_AGAIN)],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: with_edge,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.8*step(t - 5.3)")]),
    in_mjcf: None,
    about: "",
};

/// Share of the logs that must lie on either side of a step: nearer to an end it is how a run starts or stops.
const EDGE: f64 = 0.1;
/// Fewest samples before and after a step.
const LASTING: f64 = 8.0;

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, unit) = (writer.rate(), writer.small(), writer.unit_of_rate());
    let (first, last, span) = writer.span();
    let period = writer.scene.period;
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    // Less than a handful of samples next to the edge is a spike, not an event that lasts.
    let margin = (EDGE * span).max(LASTING * period).min(0.5 * span);
    let t0 = writer.add_instant("t0", 0.01 * span, (first + margin, last - margin));
    // A ramp of two samples in place of the edge, so that its time can be fitted.
    let ramp = Expression::Time.minus(t0).over(number(2.0 * period));
    let edge = Expression::Call(Function::Clamp, vec![ramp, number(0.0), number(1.0)]);
    writer.add_term(c.times(edge));
    let times = (2..31).map(|k| first + span * f64::from(k) / 32.0);
    let inside = times.filter(|t| (first + margin..=last - margin).contains(t));
    Ok(inside.map(|t| amplitude(&[small, t])).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    // Runs have clocks of their own: the middle of the longest.
    let t0 = Expression::Number(planting.scene.times.0 + 0.43 * planting.scene.duration);
    planting.add("c*step(t - t0)", &[("t0", t0)])?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}

/// Replaces the ramp that approximated the edge in the fit by the edge.
fn with_edge(model: &mut Model, _: usize) {
    let sharp = |part: Expression| match &part {
        Expression::Call(Function::Clamp, arguments) => match &arguments[0] {
            Expression::Binary(Operator::Divide, ramp, _) if is_since_an_instant(ramp) => {
                (**ramp).clone().apply(Function::Step)
            }
            _ => part,
        },
        _ => part,
    };
    // At a port it stands in every equation that the port enters.
    for state in &mut model.states {
        state.equation = state.equation.map(&sharp);
    }
}

fn is_since_an_instant(ramp: &Expression) -> bool {
    matches!(ramp, Expression::Binary(Operator::Subtract, left, _) if **left == Expression::Time)
}
