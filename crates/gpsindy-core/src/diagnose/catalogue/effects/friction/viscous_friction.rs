//! Friction in proportion to the speed.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;

pub(super) static DEFINITION: Definition = Definition {
    name: "viscous friction",
    meaning: "Friction in proportion to the speed.",
    family: Family::Friction,
    form: "-c*z",
    symbols: &["z"],
    parameters: "c: damping rate",
    signature: "oscillations decay faster, and the steady speed is lower by a constant factor",
    places: &[Place::Own],
    sense: &[],
    twins: &[(Effect::QuadraticDrag, "steady motion at three or more speeds, or a coast-down")],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::COASTING, Drive::Released, 6.0, "v", &[("v", "-0.4*v - 0.5*v")]),
    in_mjcf: Some("`damping` of the joint"),
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size) = (writer.rate(), writer.size(0));
    let unit = writer.unit_per(&[(0, 1)]);
    let c = writer.add("c", 0.0, rate / size, POSITIVE, &unit);
    writer.add_term(c.times(z).negated());
    Ok(vec![amplitude(&[writer.small() / size])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("-c*z", &[])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 1)]), planting.rate() / planting.size_of(0))))
}
