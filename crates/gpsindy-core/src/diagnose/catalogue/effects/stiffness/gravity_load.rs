//! A weight on an arm.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{FREE, Writer, sinusoid};
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "gravity load",
    meaning: "A weight on an arm: its moment depends on the angle.",
    family: Family::Stiffness,
    form: "c*sin(z + phase)",
    symbols: &["z"],
    parameters: "c: largest load, phase: where it vanishes",
    signature: "a load that depends on the angle",
    places: &[Place::Position],
    sense: &[Sense::Placed(0), Sense::Angle(0)],
    twins: &[],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::TURNING, Drive::Ramp, 9.0, "v", &[("v", "2*u - 0.8*v + 1.2*sin(q)")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, unit) = (writer.rate(), writer.unit_of_rate());
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    let phase = writer.add_phase();
    writer.add_term(c.times(z.plus(phase).apply(Function::Sin)));
    Ok(vec![sinusoid(&[writer.small(), 0.0])])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.add("c*sin(z + phase)", &[("phase", Expression::Number(0.4))])?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
