//! Dry friction that grows with another force.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer};
use crate::diagnose::limits::catalogue::{CORNER, INSIDE_AND_ENDS, STRAIGHT_FORCE};
use crate::error::Result;
use crate::expression::{Expression, Operator, Tape};

pub(super) static DEFINITION: Definition = Definition {
    name: "load friction",
    meaning: "Dry friction that increases with the load on gears or bearings.",
    family: Family::Friction,
    form: "-(c + k*abs(load))*sign(z)",
    symbols: &["z", "w"],
    parameters: "load: the control w, or the force of the equation by the position w, c: level without load, k: increase per unit of load, corner: speed within which the sign is smoothed; 0 where it holds at rest",
    signature: "the rate jumps at reversals, more so under load",
    places: &[Place::Load],
    sense: &[Sense::Speed, Sense::EitherSign(0), Sense::Moves(1), Sense::NoTarget(1)],
    twins: &[
        (Effect::CoulombFriction, "the same motion under two loads"),
        (Effect::StribeckFriction, "the same motion under two loads"),
    ],
    traits: Traits { contains: &[Effect::CoulombFriction], ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::ARM,
        Drive::Sine(2.0, 1.0),
        10.0,
        "q",
        &[("v", "-9*q - 1.5*v + 6*u - (0.2 + 0.5*abs(6*u))*tanh(v/0.02)")],
    ),
    in_mjcf: None,
    about: "The load is a control of the equation, a logged control that no equation uses, or the force that the equation has by the position alone, as the weight of an arm; where that force goes with the position, as a spring's does, the position itself. Source: the friction models M3 to M6 of BAM (Duclusaud et al. 2024) increase with the torque that the gears carry.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, speed, unit) = (writer.rate(), writer.small(), writer.size(0), writer.unit_of_rate());
    let (w, load, per_load) = match force(writer) {
        Some((force, size)) => (force, size, String::new()),
        None => (writer.variable(1)?, writer.size(1), writer.unit_per(&[(1, 1)])),
    };
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let k = writer.add("k", 0.0, rate / load, POSITIVE, &per_load);
    let corner = writer.add_corner("corner");
    let form = "-(c + k*abs(load))*stick(z, corner)";
    writer.add_term(writer.form(form, &[("c", c), ("k", k), ("load", w), ("corner", corner)])?);
    Ok(vec![Start {
        columns: vec![vec![small, 0.0, CORNER * speed], vec![0.0, small / load, CORNER * speed]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
        is_pointed: false,
    }])
}

/// What the equation is by the position alone, as the weight of an arm, and its typical size; nothing where the load is a control, or the force goes
/// with the position as that of a spring does.
fn force(writer: &Writer<'_>) -> Option<(Expression, f64)> {
    let (model, name) = (&writer.model, &writer.hypothesis.variables[1]);
    let place = writer.excursion(1).filter(|_| model.state_index(name).is_some())?;
    let moves = |other: &str| model.state_index(other).is_some() || model.control_index(other).is_some();
    let alone = model.states[writer.hypothesis.state].equation.map(&|part| match part {
        Expression::Variable(other) if other != *name && moves(&other) => Expression::Number(0.0),
        Expression::Negate(a) => a.negated(),
        Expression::Binary(Operator::Add, a, b) => a.plus(*b),
        Expression::Binary(Operator::Subtract, a, b) => a.minus(*b),
        Expression::Binary(Operator::Multiply, a, b) => a.times(*b),
        Expression::Binary(Operator::Divide, a, b) => a.over(*b),
        part => part,
    });
    let names: Vec<String> = model.names().map(str::to_string).collect();
    let tape = Tape::new(std::slice::from_ref(&alone), &names).ok()?;
    let at = |z: f64| {
        let value = |other: &String| match model.parameter_index(other) {
            Some(p) => model.parameters[p].value,
            None => f64::from(u8::from(other == name)) * z,
        };
        tape.evaluate_once(&names.iter().map(value).collect::<Vec<f64>>(), writer.scene.times.0)[0]
    };
    let places = INSIDE_AND_ENDS.map(|part| place.low + part * place.range());
    let forces = places.map(at);
    let size = (forces.iter().map(|f| f * f).sum::<f64>() / forces.len() as f64).sqrt();
    // The slope of a spring through the same points.
    let slope = places.iter().zip(forces).map(|(z, f)| z * f).sum::<f64>() / places.iter().map(|z| z * z).sum::<f64>();
    let bent = places.iter().zip(forces).map(|(z, f)| (f - slope * z).abs()).fold(0.0, f64::max);
    (size.is_finite() && size > 0.0 && bent > STRAIGHT_FORCE * size).then_some((alone, size))
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let symbols = [("z", Expression::variable(planting.name(0))), ("w", Expression::variable(planting.name(1)))];
    let term = planting.written("-k*abs(w)*sign(z)", "k", &symbols)?;
    planting.add_term(planting.with_corners(term));
    Ok(Some(Size::added(planting.unit_per(&[(1, 1)]), planting.rate() / planting.size_of(1)).called("k")))
}
