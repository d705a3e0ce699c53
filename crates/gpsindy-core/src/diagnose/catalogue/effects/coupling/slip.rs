//! A force that saturates with the slip.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{Drive, Example};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::form::written;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::sense::slipping::{size, slip};
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::diagnose::limits::catalogue::{SHAPE, SUDDEN};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::model::{Model, unit};

pub(super) static DEFINITION: Definition = Definition {
    name: "slip",
    meaning: "A contact force that saturates, like that of a tyre at its limit.",
    family: Family::Coupling,
    form: "p becomes p*sin(shape*asin(f))/(shape*e) with e = sqrt(q)*z/shape and f = e/(1 + abs(e)^n)^(1/n)",
    symbols: &["p", "z"],
    parameters: "q: one over the square of the slip z at which the force saturates, n: how suddenly (2: by degrees, 20: at once), shape: 1 where the force stays, 1.3 where it falls by a tenth beyond its peak",
    signature: "gentle motion fits, hard manoeuvres have less effect than modelled",
    places: &[Place::Rate, Place::Contact],
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
    about: "The force saturates with the slip, by degrees as on a tyre or at once as where dry friction takes over, and may fall beyond its peak. With n = 2 it is the magic formula of Pacejka (2012, Tire and Vehicle Dynamics, eq. 4.6) without its curvature factor E: a force D*sin(C*atan(B*z)) with q = (B*C)^2. The slip is a speed, or the difference of speeds that the parameter multiplies, as in `C*(delta - (vy + a*r)/vx)`. It could act with one speed at every parameter of every equation of a speed, so that is tested where a wrong parameter of that name, a cubic stiffness or a saturation of the same equation is one of the best effects or one of the causes found, where no single effect leaves only noise, and on request.",
};

/// What slips: the second variable of the hypothesis, or the difference that the parameter multiplies where it depends on more; and its typical
/// size and unit.
///
/// # Errors
/// A parameter in whose place another effect has put something: it multiplies no difference any more.
fn slipping(hypothesis: &Hypothesis, model: &Model, scene: &Scene) -> Result<(Expression, f64, String)> {
    let parameter = &hypothesis.variables[0];
    let slip = match hypothesis.is_of_a_difference() {
        true => slip(model, parameter).map(|(slip, _)| slip),
        false => Some(Expression::variable(hypothesis.variables[1].clone())),
    };
    let Some(slip) = slip else {
        return Err(Error::model(format!("`{parameter}` multiplies no difference of speeds that may slip")));
    };
    let units: Vec<String> = (1..hypothesis.variables.len()).map(|i| hypothesis.unit_of(model, i)).collect();
    // A difference of unlike variables has a unit that their factors decide.
    let unit =
        if units.iter().all(|unit| *unit == units[0]) { unit::product(&[(&units[0], -2)]) } else { String::new() };
    let size = size(&slip, model, scene);
    Ok((slip, size, unit))
}

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (slip, size, unit) = slipping(writer.hypothesis, &writer.model, writer.scene)?;
    let square = size.powi(2);
    let q = writer.add("q", 0.0, 1.0 / square, POSITIVE, &unit);
    let n = writer.add("n", 2.0, 1.0, SUDDEN, "");
    let shape = writer.add("shape", 1.0, 1.0, SHAPE, "");
    let name = writer.hypothesis.variables[0].clone();
    // A power of zero has no derivative by its exponent, nor has the inverse sine of one. What becomes of `p` is even in the slip, so that its
    // size will do.
    let e = written("sqrt(q*z^2/shape^2 + 1e-12)", &[("q", q), ("z", slip), ("shape", shape.clone())])?;
    let f = written("e/(1 + e^n)^(1/n)", &[("e", e.clone()), ("n", n)])?;
    let symbols = [("p", Expression::variable(name.clone())), ("e", e), ("f", f), ("shape", shape)];
    writer.replace(&name, &written("p*sin(shape*asin(0.9999999*f))/(shape*e)", &symbols)?);
    Ok(vec![amplitude(&[1e-3 / square, 2.0, 1.0])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (slip, size, unit) = slipping(planting.hypothesis, &planting.model, planting.scene)?;
    let square = size.powi(2);
    let name = planting.name(0);
    let symbols = [("p", Expression::variable(name.clone())), ("z", slip)];
    let limited = planting.written("p*(1 + c*z*z)^(-0.5)", "c", &symbols)?;
    planting.replace(&name, &limited);
    Ok(Some(Size::within("q", unit, (0.02 / square, 100.0 / square), "")))
}
