//! The control has a limit.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "input saturation",
    meaning: "The actuator saturates at a limit.",
    family: Family::InputStatic,
    form: "u becomes clamp(u, -c, c)",
    symbols: &["u"],
    parameters: "c: limit",
    signature: "large commands have no more effect than medium ones",
    places: &[Place::Control],
    sense: &[],
    twins: &[(Effect::InputLag, experiment::AMPLITUDES), (Effect::InputGain, experiment::AMPLITUDES)],
    traits: Traits { is_a_limit: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*clamp(u, -0.5, 0.5) - 0.8*v")]),
    in_mjcf: Some("`ctrlrange` of the actuator, if symmetric"),
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (size, largest) = (drive.excursion.size(), drive.excursion.size_quantile(1.0));
    let c = writer.add("c", largest, size, (0.02 * largest, largest), &drive.unit);
    let clamped = Expression::Call(Function::Clamp, vec![drive.u, c.clone().negated(), c]);
    writer.replace(&drive.name, &clamped);
    let at = |part: f64| keep(&[0.5 * (part * largest + drive.excursion.size_quantile(part))]);
    Ok([0.97, 0.92, 0.85, 0.75, 0.6, 0.45, 0.3].map(at).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let largest = planting.largest();
    planting.drive("clamp(u, -c, c)", "c")?;
    Ok(Some(Size::limit("c", planting.control_unit(), largest, (0.1 * largest, 0.98 * largest))))
}
