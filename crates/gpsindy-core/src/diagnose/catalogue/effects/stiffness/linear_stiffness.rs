//! A spring.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "linear stiffness",
    meaning: "A spring force in proportion to the deflection.",
    family: Family::Stiffness,
    form: "-c*z",
    symbols: &["z"],
    parameters: "c: stiffness",
    signature: "a shifted resonance, and a force towards the rest position",
    places: &[Place::Position],
    sense: &[],
    twins: &[],
    traits: Traits { marks_a_place: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*u - 0.8*v - 1.5*x")]),
    in_mjcf: Some("`stiffness` of the joint"),
    about: "Where no rate depends on the place, as on a rail, it is tested once no single effect leaves only noise.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size) = (writer.rate(), writer.size(0));
    let unit = writer.unit_per(&[(0, 1)]);
    let c = writer.add("c", 0.0, rate / size, FREE, &unit);
    writer.add_term(c.times(z).negated());
    Ok(vec![amplitude(&[writer.small() / size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("-c*z", &[])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 1)]), planting.rate() / planting.size_of(0))))
}
