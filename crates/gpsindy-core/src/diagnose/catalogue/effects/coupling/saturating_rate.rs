//! A rate that levels off.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::unit;

pub(super) static DEFINITION: Definition = Definition {
    name: "saturating rate",
    meaning: "A rate that saturates as an amount grows, as with uptake and enzymes.",
    family: Family::Coupling,
    form: "p becomes p/(1 + h*z)",
    symbols: &["p", "z"],
    parameters: "h: one over the amount at which the rate is halved",
    signature: "large amounts react less than in proportion, small ones as modelled",
    places: &[Place::Rate],
    sense: &[Sense::Balance, Sense::NotNegative(1), Sense::Moves(1)],
    twins: &[
        (Effect::ParameterError, "the same experiment at several amounts"),
        (Effect::ProductCoupling, "the same experiment at several amounts"),
        (Effect::QuadraticDrag, "the same experiment at several amounts"),
    ],
    traits: Traits { has_many_places: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(&[("s", 8.0, "-0.5*s")], Drive::Released, 8.0, "s", &[("s", "-0.5*s/(1 + 0.25*s)")]),
    in_mjcf: None,
    about: "Monod, Holling and Michaelis-Menten kinetics, applied to the parameter that sets the rate, so that every equation with this rate changes.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let size = writer.size(1);
    let unit = unit::product(&[(&writer.unit_of(1), -1)]);
    let h = writer.add("h", 0.0, 1.0 / size, POSITIVE, &unit);
    let name = writer.hypothesis.variables[0].clone();
    let limited = writer.form("p/(1 + h*z)", &[("h", h)])?;
    writer.replace(&name, &limited);
    Ok(vec![amplitude(&[1e-3 / size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let size = planting.size_of(1);
    let name = planting.name(0);
    let symbols = [("p", Expression::variable(name.clone())), ("z", Expression::variable(planting.name(1)))];
    let limited = planting.written("p - p*c*z/(1 + c*z)", "c", &symbols)?;
    planting.replace(&name, &limited);
    Ok(Some(Size::within("h", unit::product(&[(&planting.unit_of(1), -1)]), (0.02 / size, 50.0 / size), "")))
}
