//! The control has a rate limit.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "input rate limit",
    meaning: "The actuator cannot change faster than a limit.",
    family: Family::InputDynamic,
    form: "u becomes slew(u, r)",
    symbols: &["u"],
    parameters: "r: largest rate",
    signature: "large steps become ramps, small steps pass",
    places: &[Place::Control],
    sense: &[],
    twins: &[
        (Effect::InputLag, "steps of two sizes: at a rate limit the larger one takes longer"),
        (Effect::InputDelay, "steps of two sizes: at a rate limit the larger one takes longer"),
        (Effect::InputSaturation, experiment::AMPLITUDES),
    ],
    traits: Traits { is_a_limit: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Steps,
        10.0,
        "v",
        &[("v", "2*w - 0.8*v"), ("w", "clamp(20*(u - w), -0.9, 0.9)")],
    ),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (range, period) = (drive.excursion.range(), writer.scene.period);
    let unit = if drive.unit.is_empty() { String::new() } else { format!("{}/s", drive.unit) };
    let fastest = range / period;
    let r = writer.add("r", fastest, 0.1 * fastest, (1e-4 * fastest, 2.0 * fastest), &unit);
    writer.replace(&drive.name, &Expression::Call(Function::Slew, vec![drive.u, r]));
    Ok([0.7, 0.4, 0.2, 0.1, 0.05, 0.02, 0.008, 0.003].map(|part| keep(&[part * fastest])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (stroke, period) = (planting.excursion(0).map_or(0.0, Excursion::range), planting.scene.period);
    planting.drive("slew(u, r)", "r")?;
    let fastest = stroke / period;
    Ok(Some(Size::limit(
        "r",
        format!("{}/s", planting.control_unit()),
        1.2 * fastest,
        (0.6 * fastest, 1.199 * fastest),
    )))
}
