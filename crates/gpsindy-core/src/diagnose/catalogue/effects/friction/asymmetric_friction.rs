//! Dry friction with one level per direction.

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
    name: "asymmetric friction",
    meaning: "Dry friction that differs between the two directions.",
    family: Family::Friction,
    form: "-c_plus*max(sign(z), 0) - c_minus*min(sign(z), 0)",
    symbols: &["z"],
    parameters: "c_plus: level for z above 0, c_minus: level for z below 0, w: speed within which the sign is smoothed; 0 where it holds at rest",
    signature: "the rate jumps at every reversal, and decay differs between the two directions",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0)],
    twins: &[
        (Effect::CoulombFriction, "equal slow strokes in both directions"),
        (Effect::Bias, "turn the rig around, or equal slow strokes in both directions"),
    ],
    traits: Traits { contains: &[Effect::CoulombFriction], ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Sine(3.0, 1.0),
        10.0,
        "v",
        &[("v", "2*u - 0.8*v - 0.9*max(tanh(v/0.02), 0) - 0.1*min(tanh(v/0.02), 0)")],
    ),
    in_mjcf: None,
    about: "With equal levels it is Coulomb friction, which has one parameter less and is then preferred. Coulomb friction together with a bias is the same force.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, size, unit) = (writer.rate(), writer.small(), writer.size(0), writer.unit_of_rate());
    let plus = writer.add("c_plus", 0.0, rate, POSITIVE, &unit);
    let minus = writer.add("c_minus", 0.0, rate, POSITIVE, &unit);
    let w = writer.add_corner("w");
    let form = "-(c_plus*max(stick(z, w), 0) + c_minus*min(stick(z, w), 0))";
    writer.add_term(writer.form(form, &[("c_plus", plus), ("c_minus", minus), ("w", w)])?);
    Ok(vec![Start {
        columns: vec![vec![small, 0.0, CORNER * size], vec![0.0, small, CORNER * size]],
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
        is_pointed: false,
    }])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let z = Expression::variable(planting.name(0));
    let term = planting.written("-0.4*c*sign(z) - 0.6*c*max(sign(z), 0)", "c", &[("z", z)])?;
    planting.add_term(planting.with_corners(term));
    Ok(Some(Size::added(planting.rate_unit(), planting.rate()).called("c_plus")))
}
