//! A linear coupling with another axis.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "coupling",
    meaning: "Another axis or input acts on this one.",
    family: Family::Coupling,
    form: "c*z",
    symbols: &["z"],
    parameters: "c: gain from z",
    signature: "this axis moves when only the other one is driven",
    places: &[Place::Other],
    sense: &[],
    twins: &[],
    traits: Traits { has_many_places: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::RIG, Drive::Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.5*z")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size) = (writer.rate(), writer.size(0));
    let unit = writer.unit_per(&[(0, 1)]);
    let c = writer.add("c", 0.0, rate / size, FREE, &unit);
    writer.add_term(c.times(z));
    Ok(vec![amplitude(&[writer.small() / size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("c*z", &[])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 1)]), planting.rate() / planting.size_of(0))))
}
