//! Dry friction: a constant force against the motion.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::diagnose::limits::catalogue::CORNER;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "Coulomb friction",
    meaning: "Dry friction: a constant force against the motion, whatever its speed.",
    family: Family::Friction,
    form: "-c*sign(z)",
    symbols: &["z"],
    parameters: "c: friction level, w: speed within which the sign is smoothed; 0 where it holds at rest",
    signature: "linear decay of oscillations, sticking at rest, a jump of the rate at every reversal",
    places: &[Place::Own],
    sense: &[Sense::Moving],
    twins: &[
        (Effect::ViscousFriction, experiment::SLOW_REVERSALS),
        (Effect::StribeckFriction, experiment::SLOW_REVERSALS),
        (Effect::QuadraticDrag, experiment::SLOW_REVERSALS),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::COASTING, Drive::Released, 6.0, "v", &[("v", "-0.4*v - 0.5*tanh(v/0.02)")]),
    in_mjcf: Some("`frictionloss` of the joint"),
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size, unit) = (writer.rate(), writer.size(0), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let w = writer.add_corner("w");
    writer.add_term(c.times(Expression::Call(Function::Stick, vec![z, w])).negated());
    Ok(vec![amplitude(&[writer.small(), CORNER * size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let z = Expression::variable(planting.name(0));
    let term = planting.written("-c*sign(z)", "c", &[("z", z)])?;
    planting.add_term(planting.with_corners(term));
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
