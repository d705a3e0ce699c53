//! Dry friction that holds at rest with more than it has in motion.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::diagnose::limits::MOST_AT_REST;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "stiction",
    meaning: "Dry friction that holds at rest with more than it has in motion: nothing moves until the force exceeds a level, and then it slides at once.",
    family: Family::Friction,
    form: "-c*breakaway(z, s/c)",
    symbols: &["z"],
    parameters: "c: level in motion, s: level at rest",
    signature: "rest under a force, then a sudden start",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0), Sense::Modes],
    twins: &[
        (Effect::StribeckFriction, experiment::SLOW_REVERSALS),
        (Effect::CoulombFriction, experiment::SLOW_REVERSALS),
        (Effect::Hysteresis, "reversals of several lengths: stiction lets go at once"),
    ],
    traits: Traits {
        contains: &[Effect::CoulombFriction],
        only_if_asked: true,
        behind: &[Effect::CoulombFriction, Effect::StribeckFriction, Effect::AsymmetricFriction, Effect::Hysteresis],
        ..Traits::PLAIN
    },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Sine(2.0, 0.7),
        10.0,
        "v",
        &[("v", "2*u - 0.8*v - (0.4 + 0.6*exp(-(v/0.1)^2))*d/0.01"), ("d", "v - abs(v)*d/0.01")],
    ),
    in_mjcf: None,
    about: "At rest the force has whatever value up to s keeps the axis there; the rollouts change their mode where the axis stops and where it lets go. The logs change in jumps when the level at rest moves: ratios of the two levels are tried on short rollouts, and the best on ever finer lattices around it. With equal levels it is Coulomb friction, which has one parameter less and is then preferred. It is tested where a friction that imitates it leads, or on request, and not in a simulator that steps, which has no modes.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, unit) = (writer.rate(), writer.small(), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let s = writer.add_level_at_rest("s", rate, &unit);
    let [one, most] = [1.0, MOST_AT_REST].map(Expression::Number);
    let ratio = Expression::Call(Function::Clamp, vec![s.over(c.clone()), one, most]);
    writer.add_term(writer.form("-c*breakaway(z, ratio)", &[("c", c), ("ratio", ratio)])?);
    Ok(vec![amplitude(&[small, 0.0])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let z = Expression::variable(planting.name(0));
    let force = planting.written("-c*breakaway(z, 1.8)", "c", &[("z", z)])?;
    planting.add_term(force);
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
