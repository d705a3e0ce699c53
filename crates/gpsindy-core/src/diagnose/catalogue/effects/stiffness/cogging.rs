//! A force that repeats along the position.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, RIPPLES, Writer, sinusoid};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::unit;
use std::f64::consts::{PI, TAU};

pub(super) static DEFINITION: Definition = Definition {
    name: "cogging",
    meaning: "A force that is periodic in the position.",
    family: Family::Stiffness,
    form: "c*sin(n*z + phase)",
    symbols: &["z"],
    parameters: "c: size, n: spatial frequency, phase",
    signature: "a ripple that is periodic in the position",
    places: &[Place::Position],
    sense: &[],
    twins: &[(Effect::PeriodicDisturbance, "the same motion at two speeds")],
    traits: Traits::PLAIN,
    write,
    plant,
    told: as_fitted,
    example: Example::of(example::TURNING, Drive::Ramp, 9.0, "v", &[("v", "2*u - 0.8*v + 1.2*sin(6*q)")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, unit) = (writer.rate(), writer.unit_of_rate());
    let range = writer.excursion(0).map_or(0.0, Excursion::range);
    if range <= 0.0 {
        return Ok(Vec::new());
    }
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    let per_turn = unit::product(&[("rad", 1), (&writer.unit_of(0), -1)]);
    let n = writer.add("n", 1.0, TAU / range, (RIPPLES * TAU / range, f64::INFINITY), &per_turn);
    let phase = writer.add_phase();
    let angle = Expression::Binary(Operator::Multiply, n.into(), z.into());
    writer.add_term(c.times(angle.plus(phase).apply(Function::Sin)));
    let small = writer.small();
    // Up to sixty ripples over the range; steps of half a ripple, so that no line is missed.
    Ok((3..120).map(|k| sinusoid(&[small, PI * f64::from(k) / range, 0.0])).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let range = planting.excursion(0).map_or(0.0, Excursion::range);
    let n = Expression::Number(6.3 * TAU / range.max(f64::MIN_POSITIVE));
    planting.add("c*sin(n*z + phase)", &[("n", n), ("phase", Expression::Number(0.7))])?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
