//! Dry friction that grows with another force.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer};
use crate::diagnose::limits::catalogue::CORNER;
use crate::error::Result;
use crate::expression::Expression;

pub(super) static DEFINITION: Definition = Definition {
    name: "load friction",
    meaning: "Dry friction that increases with the load on gears or bearings.",
    family: Family::Friction,
    form: "-(c + k*abs(w))*sign(z)",
    symbols: &["z", "w"],
    parameters: "c: level without load, k: increase per unit of load, corner: speed within which the sign is smoothed; 0 where it holds at rest",
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
    about: "The load is a control of the equation, or the position that it depends on. Source: the friction models M3 to M6 of BAM (Duclusaud et al. 2024) increase with the torque that the gears carry.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, size, load) = (writer.rate(), writer.small(), writer.size(0), writer.size(1));
    let (unit, per_load) = (writer.unit_of_rate(), writer.unit_per(&[(1, 1)]));
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let k = writer.add("k", 0.0, rate / load, POSITIVE, &per_load);
    let corner = writer.add_corner("corner");
    let form = "-(c + k*abs(w))*stick(z, corner)";
    writer.add_term(writer.form(form, &[("c", c), ("k", k), ("corner", corner)])?);
    Ok(vec![Start {
        columns: vec![vec![small, 0.0, CORNER * size], vec![0.0, small / load, CORNER * size]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
    }])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let symbols = [("z", Expression::variable(planting.name(0))), ("w", Expression::variable(planting.name(1)))];
    let term = planting.written("-k*abs(w)*sign(z)", "k", &symbols)?;
    planting.add_term(planting.with_corners(term));
    Ok(Some(Size::added(planting.unit_per(&[(1, 1)]), planting.rate() / planting.size_of(1)).called("k")))
}
