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

pub(super) static DEFINITION: Definition = Definition {
    name: "gear play",
    meaning: "Play between two moving parts: one moves some way without the other.",
    family: Family::Memory,
    form: "p - q becomes dead_zone(p - q, c)",
    symbols: &["p", "q"],
    parameters: "c: half width of the play",
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
    about: "It is tested if an equation contains the difference of two positions, such as that of a spring between two masses.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let range = |index: usize| writer.excursion(index).map_or(1.0, Excursion::range);
    let travel = range(0).min(range(1));
    let unit = writer.unit_of(0);
    let c = writer.add("c", 0.0, 0.01 * travel, (0.0, travel), &unit);
    let [p, q] = [writer.variable(0)?, writer.variable(1)?];
    let loose = |a: &Expression, b: &Expression| {
        Expression::Call(Function::DeadZone, vec![a.clone().minus(b.clone()), c.clone()])
    };
    let (pq, qp) = (p.clone().minus(q.clone()), q.clone().minus(p.clone()));
    for state in &mut writer.model.states {
        state.equation = state.equation.map(&|part| match part {
            part if part == pq => loose(&p, &q),
            part if part == qp => loose(&q, &p),
            part => part,
        });
    }
    Ok([0.002, 0.005, 0.015, 0.04, 0.1, 0.25].map(|part| keep(&[part * travel])).into())
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
