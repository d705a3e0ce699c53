//! The gain of a control scales with its supply.

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
    name: "supply",
    meaning: "The gain of the control varies with its supply: a voltage or a pressure.",
    family: Family::InputStatic,
    form: "u becomes u*(w/w0)",
    symbols: &["u", "w"],
    parameters: "w0: supply at which the gain is that of the model",
    signature: "the same command has more effect while the supply is high",
    places: &[Place::Supply],
    sense: &[Sense::Moves(1), Sense::NotNegative(1)],
    twins: &[
        (Effect::Drift, "the same run with a high and with a low supply"),
        (Effect::InputGain, "the same run with a high and with a low supply"),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example {
        own_start: 12.0,
        ..Example::of(
            example::CART,
            Drive::Steps,
            10.0,
            "v",
            &[("v", "2*u*(w/12) - 0.8*v"), ("w", "0.8*(12 - 5*abs(u) - w)")],
        )
    },
    in_mjcf: None,
    about: "It is tested only if the model declares a logged control that none of its equations uses, or a voltage or pressure that the equations of the control do not use: the column of the supply. A supply that is a state may lose to the control in its own equation.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let usual = writer.excursion(1).map_or(1.0, |e| 0.5 * (e.low + e.high));
    let unit = writer.unit_of(1);
    let w0 = writer.add("w0", usual, usual, (0.1 * usual, 10.0 * usual), &unit);
    let scaled = writer.form("u*(w/w0)", &[("w0", w0)])?;
    writer.replace(&drive.name, &scaled);
    Ok([1.0, 0.8, 1.25].map(|part| keep(&[part * usual])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let usual = planting.excursion(1).map_or(1.0, |e| 0.5 * (e.low + e.high));
    let swing = Expression::variable(planting.name(1)).over(Expression::Number(usual)).minus(Expression::Number(1.0));
    let symbols = [("u", Expression::variable(planting.name(0))), ("swing", swing)];
    let scaled = planting.written("u + c*swing*u", "c", &symbols)?;
    planting.replace(&planting.name(0), &scaled);
    Ok(Some(Size::within("c", String::new(), (0.05, 1.0), "the control follows the whole swing of its supply")))
}
