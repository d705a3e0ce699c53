//! Dry friction that is stronger near standstill.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, number};
use crate::diagnose::limits::catalogue::CORNER;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "Stribeck friction",
    meaning: "Dry friction that is stronger near standstill than in motion.",
    family: Family::Friction,
    form: "-(c + (s - c)*exp(-(z/w)^2))*sign(z)",
    symbols: &["z"],
    parameters: "c: level at speed, s: level near zero, s_minus_c: difference of the two levels, w: speed that separates them, corner: speed within which the sign is smoothed; 0 where it holds at rest",
    signature: "stick-slip: jerky motion at low speed",
    places: &[Place::Own],
    sense: &[Sense::Moving],
    twins: &[
        (Effect::ViscousFriction, experiment::SLOW_REVERSALS),
        (Effect::QuadraticDrag, experiment::SLOW_REVERSALS),
    ],
    traits: Traits { contains: &[Effect::CoulombFriction, Effect::Stiction], ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::COASTING,
        Drive::Released,
        6.0,
        "v",
        &[("v", "-0.4*v - (0.15 + 0.85*exp(-(v/0.4)^2))*tanh(v/0.02)")],
    ),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, small, size, unit) = (writer.rate(), writer.small(), writer.size(0), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let extra = writer.add("s_minus_c", 0.0, rate, POSITIVE, &unit);
    let speed = writer.unit_of(0);
    let w = writer.add_scale("w", size, size, (0.02 * size, 2.0 * size), &speed);
    // How sharp the corner is decides how long a part that should stick creeps: fitted, as for dry friction.
    let corner = writer.add_corner("corner");
    let bump = z.clone().over(w).power(number(2.0)).negated().apply(Function::Exp);
    writer.add_term(c.plus(extra.times(bump)).times(Expression::Call(Function::Stick, vec![z, corner])).negated());
    let start = |w: f64| Start {
        columns: vec![vec![small, 0.0, w * size, CORNER * size], vec![0.0, small, w * size, CORNER * size]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
        is_pointed: false,
    };
    Ok([0.1, 0.3, 1.0].map(start).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let size = planting.size.clone();
    let shapes = [
        ("z", Expression::variable(planting.name(0))),
        ("s", Expression::Number(2.0).times(size)),
        ("w", Expression::Number(0.13 * planting.size_of(0))),
    ];
    let term = planting.written("-(c + (s - c)*exp(-(z/w)^2))*sign(z)", "c", &shapes)?;
    planting.add_term(planting.with_corners(term));
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
