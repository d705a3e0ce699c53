//! A force that saturates with the slip.

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
    name: "slip",
    meaning: "A contact force that saturates, like that of a tyre at its limit.",
    family: Family::Coupling,
    form: "p becomes p/sqrt(1 + q*z^2)",
    symbols: &["p", "z"],
    parameters: "q: one over the square of the slip at which the force saturates",
    signature: "gentle motion fits, hard manoeuvres have less effect than modelled",
    places: &[Place::Rate],
    sense: &[Sense::Speed, Sense::EitherSign(1), Sense::Moves(1)],
    twins: &[
        (Effect::ParameterError, "gentle and hard manoeuvres of one kind"),
        (Effect::CubicStiffness, "gentle and hard manoeuvres of one kind"),
        (Effect::InputSaturation, "gentle and hard manoeuvres of one kind"),
    ],
    traits: Traits {
        has_many_places: true,
        only_if_asked: true,
        behind: &[Effect::ParameterError, Effect::CubicStiffness, Effect::InputSaturation],
        ..Traits::PLAIN
    },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(&[("r", 0.0, "4*u - 2*r")], Drive::Ramp, 6.0, "r", &[("r", "4*u/sqrt(1 + 0.6*r^2) - 2*r")]),
    in_mjcf: None,
    about: "The force saturates with the slip, without the decrease beyond the peak that the magic formula of Pacejka has. It could act at every parameter of every equation of a speed, so it is tested where a wrong parameter of that name, a cubic stiffness or a saturation of the same equation is one of the best effects, where no single effect leaves only noise, and on request.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let square = writer.size(1).powi(2);
    let unit = unit::product(&[(&writer.unit_of(1), -2)]);
    let q = writer.add("q", 0.0, 1.0 / square, POSITIVE, &unit);
    let name = writer.hypothesis.variables[0].clone();
    let limited = writer.form("p/sqrt(1 + q*z^2)", &[("q", q)])?;
    writer.replace(&name, &limited);
    Ok(vec![amplitude(&[1e-3 / square])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let square = planting.size_of(1).powi(2);
    let name = planting.name(0);
    let symbols = [("p", Expression::variable(name.clone())), ("z", Expression::variable(planting.name(1)))];
    let limited = planting.written("p*(1 + c*z*z)^(-0.5)", "c", &symbols)?;
    planting.replace(&name, &limited);
    Ok(Some(Size::within("q", unit::product(&[(&planting.unit_of(1), -2)]), (0.02 / square, 100.0 / square), "")))
}
