//! Dry friction that holds at rest with more than it has in motion.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;
use crate::expression::Expression;

pub(super) static DEFINITION: Definition = Definition {
    name: "stiction",
    meaning: "Dry friction that holds at rest: nothing moves until the force exceeds a level, above that in motion.",
    family: Family::Friction,
    form: "-c*breakaway(z, s/c)",
    symbols: &["z"],
    parameters: "c: level in motion, s: level at rest, s_over_c: the level at rest by that in motion",
    signature: "rest under a force, then a sudden start",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0), Sense::Modes],
    twins: &[
        (Effect::StribeckFriction, experiment::SLOW_REVERSALS),
        (Effect::CoulombFriction, experiment::SLOW_REVERSALS),
        (Effect::Hysteresis, "reversals of several lengths: stiction lets go at once"),
    ],
    traits: Traits { contains: &[Effect::CoulombFriction], only_if_asked: true, ..Traits::PLAIN },
    write,
    plant,
    told: as_fitted,
    about: "At rest the force has whatever value up to s keeps the axis there; the rollouts change their mode where the axis stops and where it is let go. With equal levels it is Coulomb friction that holds, which has one parameter less and is then preferred. It is tested only on request.",
};

/// How many times as strong it may be at rest as in motion: more is no bearing and no gear.
const MOST: f64 = 4.0;

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, unit) = (writer.rate(), writer.small(), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let ratio = writer.add("s_over_c", 1.0, 1.0, (1.0, MOST), "");
    writer.add_term(writer.form("-c*breakaway(z, ratio)", &[("c", c), ("ratio", ratio)])?);
    // Where it never lets go nothing tells when it would: from below.
    Ok([1.1, 1.5].map(|ratio| amplitude(&[small, ratio])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let z = Expression::variable(planting.name(0));
    let force = planting.written("-c*breakaway(z, 1.8)", "c", &[("z", z)])?;
    planting.add_term(force);
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
