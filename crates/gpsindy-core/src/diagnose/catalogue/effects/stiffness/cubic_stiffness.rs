//! A spring that hardens away from the middle.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "cubic stiffness",
    meaning: "A spring that hardens (or softens) with its deflection.",
    family: Family::Stiffness,
    form: "-c*z^3",
    symbols: &["z"],
    parameters: "c: hardening",
    signature: "the resonance frequency depends on the amplitude",
    places: &[Place::Own, Place::Position],
    sense: &[],
    twins: &[(Effect::GravityLoad, experiment::LARGER), (Effect::LinearStiffness, experiment::LARGER)],
    traits: Traits { marks_a_place: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("v", "-4*x - 0.2*v + 3*u - 5*x^3")]),
    in_mjcf: None,
    about: "Where no rate depends on the place, as on a rail, it is tested once no single effect leaves only noise.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size) = (writer.rate(), writer.size(0));
    let unit = writer.unit_per(&[(0, 3)]);
    let c = writer.add("c", 0.0, rate / size.powi(3), FREE, &unit);
    writer.add_term(c.times(z.power(number(3.0))).negated());
    Ok(vec![amplitude(&[writer.small() / size.powi(3)])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("-c*z^3", &[])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 3)]), planting.rate() / planting.size_of(0).powi(3))))
}
