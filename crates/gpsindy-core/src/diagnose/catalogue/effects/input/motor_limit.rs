//! A limit of the drive that falls with the speed.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::Expression;

pub(super) static DEFINITION: Definition = Definition {
    name: "motor limit",
    meaning: "The limit of the drive falls with its speed.",
    family: Family::InputStatic,
    form: "u becomes clamp(u, -s*(1 + z/z0), s*(1 - z/z0))",
    symbols: &["u", "z"],
    parameters: "s: limit at standstill, z0: speed at which the limit is zero",
    signature: "large commands have less effect at speed than at standstill",
    places: &[Place::DriveAndSpeed],
    sense: &[Sense::Speed],
    twins: &[
        (Effect::ViscousFriction, "large commands at several speeds"),
        (Effect::InputSaturation, "the same large command at two speeds"),
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
        &[("v", "2*clamp(u, -0.9*(1 + v/2.2), 0.9*(1 - v/2.2)) - 0.8*v")],
    ),
    in_mjcf: None,
    about: "The linear characteristic between stall torque and no-load speed of a permanent-magnet motor at a fixed voltage. A drive that never comes near its limit does not show it.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let largest = drive.excursion.size_quantile(1.0);
    let fastest = writer.excursion(1).map_or(1.0, |e| e.size_quantile(1.0));
    let s = writer.add("s", largest, largest, (0.05 * largest, 5.0 * largest), &drive.unit);
    let speed = writer.unit_of(1);
    let z0 = writer.add("z0", 2.0 * fastest, fastest, (0.3 * fastest, 50.0 * fastest), &speed);
    let limited = writer.form("clamp(u, -s*(1 + z/z0), s*(1 - z/z0))", &[("s", s), ("z0", z0)])?;
    writer.replace(&drive.name, &limited);
    let starts = [1.5, 1.0, 0.7, 0.45].map(|s| [1.0, 2.0].map(|z0| keep(&[s * largest, z0 * fastest])));
    Ok(starts.concat())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (largest, unit) = (planting.largest(), planting.control_unit());
    let fastest = planting.excursion(1).map_or(1.0, |e| e.size_quantile(1.0));
    let speed = Expression::variable(planting.name(1)).over(Expression::Number(1.3 * fastest));
    let symbols = [("u", Expression::variable(planting.name(0))), ("r", speed)];
    let limited = planting.written("min(max(u, -s - s*r), s - s*r)", "s", &symbols)?;
    planting.replace(&planting.name(0), &limited);
    Ok(Some(Size::limit("s", unit, 6.0 * largest, (3.0 * largest, 5.8 * largest))))
}
