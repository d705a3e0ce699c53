//! Two variables act by their product.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "product coupling",
    meaning: "The product of two variables acts on this equation.",
    family: Family::Coupling,
    form: "c*z*w",
    symbols: &["z", "w"],
    parameters: "c: gain of the product",
    signature: "an effect only when two motions occur together",
    places: &[Place::Pair],
    sense: &[],
    twins: &[],
    traits: Traits { has_many_places: true, has_no_single_size: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::RIG, Drive::Steps, 10.0, "v", &[("v", "2*u - 0.8*v - 0.5*v*z")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (z, w) = (writer.variable(0)?, writer.variable(1)?);
    let (rate, both) = (writer.rate(), writer.size(0) * writer.size(1));
    let unit = writer.unit_per(&[(0, 1), (1, 1)]);
    let c = writer.add("c", 0.0, rate / both, FREE, &unit);
    let product = if z == w { z.power(number(2.0)) } else { z.times(w) };
    writer.add_term(c.times(product));
    Ok(vec![amplitude(&[writer.small() / both])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("c*z*w", &[])?;
    let both = planting.size_of(0) * planting.size_of(1);
    Ok(Some(Size::added(planting.unit_per(&[(0, 1), (1, 1)]), planting.rate() / both)))
}
