//! A disturbance that is periodic in time.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{FREE, RIPPLES, Writer, sinusoid};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use std::f64::consts::{PI, TAU};

pub(super) static DEFINITION: Definition = Definition {
    name: "periodic disturbance",
    meaning: "An external disturbance that is periodic in time.",
    family: Family::Time,
    form: "c*sin(omega*t + phase)",
    symbols: &[],
    parameters: "c: size, omega: rad/s, phase",
    signature: "a spectral line that no command contains",
    places: &[Place::Time],
    sense: &[],
    twins: &[
        (Effect::Bias, experiment::THE_SAME_AGAIN),
        (Effect::Drift, experiment::THE_SAME_AGAIN),
        (Effect::StepDisturbance, experiment::THE_SAME_AGAIN),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 1.5*sin(4*t)")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, unit) = (writer.rate(), writer.small(), writer.unit_of_rate());
    let slowest = RIPPLES * TAU / writer.span().2;
    let Scene { duration, period, peaks, .. } = writer.scene;
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    let omega = writer.add_scale("omega", 1.0, TAU / duration, (slowest, PI / period), "rad/s");
    let phase = writer.add_phase();
    let angle = Expression::Binary(Operator::Multiply, omega.into(), Expression::Time.into());
    writer.add_term(c.times(angle.plus(phase).apply(Function::Sin)));
    Ok(peaks.iter().filter(|&&omega| omega >= slowest).map(|&omega| sinusoid(&[small, omega, 0.0])).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let omega = (7.3 * TAU / planting.scene.duration).min(0.4 * PI / planting.scene.period);
    let shapes = [("omega", Expression::Number(omega)), ("phase", Expression::Number(0.5))];
    planting.add("c*sin(omega*t + phase)", &shapes)?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
