//! A stop at the end of the travel.

use crate::diagnose::catalogue::applied::Role;
use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::unit;

pub(super) static DEFINITION: Definition = Definition {
    name: "end stop",
    meaning: "A stop that pushes back beyond a position and has no effect before it.",
    family: Family::Stiffness,
    form: "-max(0, (k + d*v)*(z - high) + b*v) above high, max(0, (k - d*v)*(low - z) - b*v) below low",
    symbols: &["z"],
    parameters: "k: stiffness, d: damping by the speed v that grows with the depth, b: damping from the first touch on, high and low: where the stops begin",
    signature: "free motion up to a position, and a short rebound there",
    places: &[Place::Position],
    sense: &[Sense::NotThermal],
    twins: &[(Effect::CubicStiffness, experiment::LARGER), (Effect::LinearStiffness, experiment::LARGER)],
    traits: Traits { marks_a_place: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::SPRING,
        Drive::Sine(2.0, 1.0),
        8.0,
        "x",
        &[("v", "-4*x - 0.2*v + 3*u - (200 + 20*v)*max(0, x - 0.6)")],
    ),
    in_mjcf: None,
    about: "Both stops are one effect; a stop that the logs never reach is left out of the report, and stands far beyond them in the corrected model. The damping acts only in contact: it grows with the depth (Hunt and Crossley 1975), is there from the first touch on (Kelvin and Voigt), or both. A stop pushes and never pulls. Where no rate depends on the place, as on a rail, it is tested once no single effect leaves only noise. A quantity without a speed, such as a level, is stopped without damping.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let Some(Excursion { low, high, .. }) = writer.excursion(0).filter(|e| e.range() > 0.0) else {
        return Ok(Vec::new());
    };
    let range = high - low;
    let own = writer.model.states[writer.hypothesis.state].name.clone();
    let is_own = writer.hypothesis.variables[0] == own;
    let (rate, small) = (writer.rate(), writer.small());
    let stiffness = writer.unit_per(&[(0, 1)]);
    let k = writer.add("k", 0.0, rate / range, POSITIVE, &stiffness);
    let upper = writer.add_end("high", Role::Above, 0.1 * range, (low + 0.4 * range, *high));
    let lower = writer.add_end("low", Role::Below, 0.1 * range, (*low, high - 0.4 * range));
    let mut symbols = vec![("k", k), ("high", upper), ("low", lower)];
    let form = if is_own {
        "-k*max(0, z - high) + k*max(0, low - z)"
    } else {
        let speed = writer.scene.states[writer.hypothesis.state].size();
        let damping = unit::product(&[(&stiffness, 1), (&writer.model.states[writer.hypothesis.state].unit, -1)]);
        symbols.push(("d", writer.add("d", 0.0, rate / range / speed, POSITIVE, &damping)));
        let touched = writer.unit_of_rate();
        let touched = unit::product(&[(&touched, 1), (&writer.model.states[writer.hypothesis.state].unit, -1)]);
        symbols.push(("b", writer.add("b", 0.0, rate / speed, POSITIVE, &touched)));
        symbols.push(("v", Expression::variable(own)));
        "-step(z - high)*max(0, (k + d*v)*(z - high) + b*v) + step(low - z)*max(0, (k - d*v)*(low - z) - b*v)"
    };
    writer.add_term(writer.form(form, &symbols)?);
    // One stop each, above and below; the other one stays where it does nothing.
    let start = |upper: f64, lower: f64| {
        let depth = (high - upper).max(lower - low);
        let values = [small / depth, upper, lower, 0.0, 0.0];
        amplitude(if is_own { &values[..3] } else { &values })
    };
    // A stiff buffer gives way by a fiftieth of the travel.
    let parts = [0.98, 0.95, 0.9, 0.8, 0.65, 0.5];
    let above = parts.map(|part| start(low + part * range, *low));
    let below = parts.map(|part| start(*high, high - part * range));
    Ok(above.into_iter().chain(below).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let Some(excursion) = planting.excursion(0) else { return Ok(None) };
    let (range, edge) = (excursion.range(), excursion.low + 0.7 * excursion.range());
    planting.add("-0.5*c*(z - edge + abs(z - edge))", &[("edge", Expression::Number(edge))])?;
    Ok(Some(Size::added(planting.unit_per(&[(0, 1)]), planting.rate() / range.max(f64::MIN_POSITIVE)).called("k")))
}
