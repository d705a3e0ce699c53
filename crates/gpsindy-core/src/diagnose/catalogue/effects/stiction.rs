//! Dry friction that holds at rest with more than it has in motion.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer};
use crate::error::Result;
use crate::expression::Expression;

pub(super) static DEFINITION: Definition = Definition {
    name: "stiction",
    meaning: "Dry friction that holds at rest: nothing moves until the force exceeds a level, above that in motion.",
    family: Family::Friction,
    form: "-c*breakaway(z, s/c)",
    symbols: &["z"],
    parameters: "c: level in motion, s: level at rest, s_minus_c: difference of the two levels",
    signature: "rest under a force, then a sudden start",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0), Sense::Modes],
    twins: &[
        (Effect::StribeckFriction, experiment::SLOW_REVERSALS),
        (Effect::CoulombFriction, experiment::SLOW_REVERSALS),
        (Effect::Hysteresis, "reversals of several lengths: stiction lets go at once"),
    ],
    traits: Traits { contains: &[Effect::CoulombFriction], ..Traits::PLAIN },
    write,
    plant,
    told: as_fitted,
    about: "At rest the force has whatever value up to s keeps the axis there; the rollouts change their mode where the axis stops and where it is let go. With equal levels it is Coulomb friction that holds, which has one parameter less and is then preferred.",
};

/// Smallest level in motion, of a typical rate: the level at rest is a multiple of it.
const LEAST: f64 = 1e-6;

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, unit) = (writer.rate(), writer.small(), writer.unit_of_rate());
    let c = writer.add("c", LEAST * rate, rate, (LEAST * rate, f64::INFINITY), &unit);
    let more = writer.add("s_minus_c", 0.0, rate, POSITIVE, &unit);
    writer.add_term(writer.form("-c*breakaway(z, 1 + more/c)", &[("c", c), ("more", more)])?);
    Ok(vec![Start {
        columns: vec![vec![small, 0.0], vec![LEAST * rate, small]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
    }])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let z = Expression::variable(planting.name(0));
    let force = planting.written("-c*breakaway(z, 1.8)", "c", &[("z", z)])?;
    planting.add_term(force);
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
