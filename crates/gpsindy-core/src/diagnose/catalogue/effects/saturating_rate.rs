//! A rate that levels off.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
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
    meaning: "A rate that levels off as there is more of something, as uptake and enzymes do.",
    family: Family::Coupling,
    form: "p becomes p/(1 + h*z)",
    symbols: &["p", "z"],
    parameters: "h: how soon the rate levels off, one over the half amount",
    signature: "large amounts react slower than in proportion, small ones as they should",
    places: &[Place::Rate],
    sense: &[Sense::Balance, Sense::NotNegative(1), Sense::Moves(1)],
    twins: &[
        (Effect::ParameterError, "the same at amounts of several sizes"),
        (Effect::ProductCoupling, "the same at amounts of several sizes"),
        (Effect::QuadraticDrag, "the same at amounts of several sizes"),
    ],
    traits: Traits { has_many_places: true, ..Traits::PLAIN },
    write,
    plant,
    told: as_fitted,
    about: "Monod, Holling and Michaelis-Menten, written at the parameter that sets the rate, so that every equation in which that rate stands feels it.",
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
