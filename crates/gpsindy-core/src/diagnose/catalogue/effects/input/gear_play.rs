//! Play between two places.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::State;

pub(super) static DEFINITION: Definition = Definition {
    name: "gear play",
    meaning: "Play between two moving parts: one moves some way without the other.",
    family: Family::Memory,
    form: "p - q becomes dead_zone(p - q, c), and within the play 1 - l of the difference of their speeds is left",
    symbols: &["p", "q"],
    parameters: "c: half width of the play, l: share of the damping between the parts that acts only in contact",
    signature: "after a reversal, one part first moves alone",
    places: &[Place::Gap],
    sense: &[],
    twins: &[
        (Effect::Backlash, "log both sides of the gear, or reverse under a light load"),
        (Effect::ParameterError, "small and large loads"),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::GEARS,
        Drive::Steps,
        8.0,
        "b",
        &[("a", "4*u - a - 20*dead_zone(p - q, 0.3)"), ("b", "20*dead_zone(p - q, 0.3) - 0.6*b")],
    ),
    in_mjcf: None,
    about: "It is tested if an equation contains the difference of two positions, such as that of a spring between two masses. Where one also contains the difference of their speeds, that damper may act in contact only.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let range = |index: usize| writer.excursion(index).map_or(1.0, Excursion::range);
    let travel = range(0).min(range(1));
    // A shaft turns many times while it is twisted by a hundredth of a turn.
    let twist = writer.range_between(0, 1).unwrap_or(travel).clamp(1e-6 * travel, travel);
    let unit = writer.unit_of(0);
    let c = writer.add("c", 0.0, (0.01 * travel).min(0.5 * twist), (0.0, travel), &unit);
    let [p, q] = [writer.variable(0)?, writer.variable(1)?];
    let gap = [p.clone().minus(q.clone()), q.minus(p)];
    let loose = |gap: &Expression| Expression::Call(Function::DeadZone, vec![gap.clone(), c.clone()]);
    let damper = speeds(writer).filter(|damper| {
        let stands = |state: &State| damper.iter().any(|difference| has(&state.equation, difference));
        writer.model.states.iter().any(stands)
    });
    let free = match damper.is_some() {
        true => {
            let l = writer.add("l", 0.0, 0.1, (0.0, 1.0), "");
            let inside = writer.form("1 - step(abs(p - q) - c)", &[("c", c.clone())])?;
            Some(writer.form("1 - l*inside", &[("l", l), ("inside", inside)])?)
        }
        false => None,
    };
    for state in &mut writer.model.states {
        state.equation = state.equation.map(&|part| match (&free, &damper) {
            _ if gap.contains(&part) => loose(&part),
            (Some(free), Some(damper)) if damper.contains(&part) => part.times(free.clone()),
            _ => part,
        });
    }
    let smallest = (0.002 * travel).min(0.05 * twist);
    let sizes = std::iter::successors(Some(smallest), |size| Some(2.7 * size)).take_while(|size| *size < 0.3 * travel);
    Ok(match damper {
        Some(_) => sizes.flat_map(|c| [keep(&[c, 0.0]), keep(&[c, 1.0])]).collect(),
        None => sizes.map(|c| keep(&[c])).collect(),
    })
}

/// The difference of the speeds of the two parts, either way round; none where the model has no speeds for them.
fn speeds(writer: &Writer<'_>) -> Option<[Expression; 2]> {
    let speed = |index: usize| {
        let place = writer.model.state_index(writer.hypothesis.variables.get(index)?)?;
        let rate = &writer.model.states[place].equation;
        matches!(rate, Expression::Variable(name) if writer.model.state_index(name).is_some()).then(|| rate.clone())
    };
    let (p, q) = (speed(0)?, speed(1)?);
    Some([p.clone().minus(q.clone()), q.minus(p)])
}

/// Whether an expression has another one as a part.
fn has(expression: &Expression, wanted: &Expression) -> bool {
    let mut found = false;
    expression.visit(&mut |part| found |= part == wanted);
    found
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (one, other) = (Expression::variable(planting.name(0)), Expression::variable(planting.name(1)));
    let size = planting.size.clone();
    for state in &mut planting.model.states {
        state.equation = state.equation.map(&|part| match &part {
            Expression::Binary(Operator::Subtract, a, b)
                if [&one, &other].contains(&&**a) && [&one, &other].contains(&&**b) =>
            {
                let kept = Expression::Call(Function::Clamp, vec![part.clone(), size.clone().negated(), size.clone()]);
                part.clone().minus(kept)
            }
            _ => part,
        });
    }
    let travel = planting.excursion(0).map_or(1.0, Excursion::range);
    Ok(Some(Size::within("c", planting.unit_of(0), (1e-3 * travel, 0.5 * travel), "half of the travel")))
}
