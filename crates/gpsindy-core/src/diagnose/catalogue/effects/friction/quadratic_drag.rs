//! Drag in proportion to the square of the speed.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;
use crate::expression::Function;

pub(super) static DEFINITION: Definition = Definition {
    name: "quadratic drag",
    meaning: "Drag in proportion to the square of the speed, as air or water gives.",
    family: Family::Friction,
    form: "-c*z*abs(z)",
    symbols: &["z"],
    parameters: "c: drag coefficient",
    signature: "the top speed is limited, slow motion is unaffected",
    places: &[Place::Own],
    sense: &[],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::COASTING, Drive::Released, 6.0, "v", &[("v", "-0.4*v - 0.6*v*abs(v)")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, size) = (writer.rate(), writer.size(0));
    let unit = writer.unit_per(&[(0, 2)]);
    let c = writer.add("c", 0.0, rate / (size * size), POSITIVE, &unit);
    writer.add_term(c.times(z.clone()).times(z.apply(Function::Abs)).negated());
    Ok(vec![amplitude(&[writer.small() / (size * size)])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("-c*z*abs(z)", &[])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 2)]), planting.rate() / planting.size_of(0).powi(2))))
}
