//! The findings of a diagnosis summed up by joint, in a roboticist's words.

use super::catalogue::list::Effect;
use super::limits::verify::{MILLI, PERCENT, PLAIN};
use super::limits::weigh::ON_JOINT;
use super::parts::{Part, PartKind};
use super::report::{Bound, Cause, Diagnosis, Parameter, PartFound, Verdict};
use crate::model::Model;

/// Effects whose bound says how small a joint's friction, load, delay or gain error is.
const TELLING: [Effect; 4] = [Effect::CoulombFriction, Effect::Bias, Effect::InputDelay, Effect::InputGain];

/// Every joint of `parts`; `measured` holds the states with a column, `only` the parts that were asked for, where not all were.
pub(crate) fn by_part(
    parts: &[Part],
    only: &[Part],
    model: &Model,
    measured: &[String],
    diagnosis: &Diagnosis,
) -> Vec<PartFound> {
    let joints = parts.iter().filter(|part| part.kind == PartKind::Joint);
    let is_asked = |part: &Part| {
        let shares = |other: &Part| other.controls.iter().any(|control| part.controls.contains(control));
        only.is_empty() || only.iter().any(|other| other == part || (other.kind == PartKind::Actuator && shares(other)))
    };
    joints.map(|part| one(part, is_asked(part), model, measured, diagnosis)).collect()
}

fn one(part: &Part, asked: bool, model: &Model, measured: &[String], diagnosis: &Diagnosis) -> PartFound {
    let causes: Vec<usize> = (0..diagnosis.causes.len())
        .filter(|&i| {
            let cause = &diagnosis.causes[i];
            cause.included && part.has(model, cause.place.as_deref(), &cause.variables, &cause.state)
        })
        .collect();
    let gap = diagnosis.gap.by_state.iter().filter(|row| part.states.contains(&row.state));
    let share = if diagnosis.gap.detected { gap.map(|row| row.share).sum() } else { 0.0 };
    let measured = part.states.iter().any(|state| measured.contains(state));
    let nothing_above = if asked { bounds(part, model, diagnosis) } else { Vec::new() };
    let mut found = PartFound {
        kind: part.kind,
        part: part.name.clone(),
        measured,
        asked,
        share,
        causes,
        nothing_above,
        says: String::new(),
    };
    found.says = says(&found, model, diagnosis);
    found
}

/// The largest bound of each unit among the telling effects.
fn bounds(part: &Part, model: &Model, diagnosis: &Diagnosis) -> Vec<Bound> {
    let mut all: Vec<Bound> = Vec::new();
    for row in &diagnosis.excluded {
        let is_friction = || row.variables.first().is_some_and(|name| attribute(name) == "frictionloss");
        let is_telling = Effect::from_id(&row.effect)
            .is_some_and(|effect| TELLING.contains(&effect) || (effect == Effect::ParameterError && is_friction()));
        if !is_telling || !part.has(model, row.place.as_deref(), &row.variables, &row.state) {
            continue;
        }
        match all.iter_mut().find(|known| known.unit == row.unit) {
            Some(known) if known.above >= row.above => {}
            Some(known) => (known.effect, known.above) = (row.effect.clone(), row.above),
            None => all.push(Bound { effect: row.effect.clone(), above: row.above, unit: row.unit.clone() }),
        }
    }
    all
}

fn says(found: &PartFound, model: &Model, diagnosis: &Diagnosis) -> String {
    if !found.asked {
        return "not asked".into();
    }
    let bounds: Vec<String> = found.nothing_above.iter().map(bound).collect();
    let unseen = if found.measured { "" } else { " (not measured)" };
    if !found.causes.is_empty() {
        let causes: Vec<String> =
            found.causes.iter().map(|&i| cause(&diagnosis.causes[i], &found.part, model)).collect();
        return causes.join(", ") + unseen;
    }
    // Of a gap that a cause in another joint makes, it has its part.
    let is_unnamed = diagnosis.verdict != Verdict::NoGap && diagnosis.included().next().is_none();
    if is_unnamed && found.share > ON_JOINT {
        return format!("{:.0} % of the gap, no cause named{unseen}", PERCENT * found.share);
    }
    match bounds.is_empty() {
        true if !found.measured => "not measured".into(),
        true if diagnosis.is_cut() && found.share > ON_JOINT => {
            format!("{:.0} % of the gap, not decided before the search ended", PERCENT * found.share)
        }
        true if diagnosis.is_cut() => "not decided before the search ended".into(),
        true => "nothing found; these logs do not bound how large it could be".into(),
        false => format!("nothing above {}{unseen}", bounds.join(", ")),
    }
}

/// A bound in words: `0.03 N m`, `4 ms of delay`, `2 % of gain`.
fn bound(bound: &Bound) -> String {
    match Effect::from_id(&bound.effect) {
        Some(Effect::InputDelay) => format!("{} of delay", milliseconds(bound.above)),
        Some(Effect::InputGain) => format!("{} % of gain", short(PERCENT * bound.above)),
        _ => with_unit(bound.above, &bound.unit),
    }
}

/// A cause in words: `friction +0.25 N m (0.248 to 0.252)`, `kp of elbow_servo 40 -> 30 (29.9 to 30.1)`.
fn cause(cause: &Cause, part: &str, model: &Model) -> String {
    let Some(size) = cause.parameters.first() else { return name(cause) };
    let range = |factor: f64| match (size.low, size.high) {
        (Some(low), Some(high)) => format!(" ({})", between(factor * low, factor * high)),
        _ => String::new(),
    };
    let changed = |what: &str, by: f64| format!("{what} {}{}", signed(by, &size.unit), range(1.0));
    match Effect::from_id(&cause.effect) {
        Some(Effect::ParameterError) => parameter(cause, size, part, model, &range(1.0)),
        Some(Effect::CoulombFriction) => changed("friction", size.value),
        Some(Effect::ViscousFriction) => changed("damping", size.value),
        Some(Effect::Bias) => changed("force", size.value),
        Some(Effect::SensorBias) => changed("sensor bias", size.value),
        Some(Effect::InputDelay) => {
            format!("command late by {}{}", milliseconds(size.value), range(MILLI))
        }
        Some(Effect::SensorDelay) => {
            format!("sensor late by {}{}", milliseconds(size.value), range(MILLI))
        }
        _ => format!("{} {} = {}{}", name(cause), size.name, with_unit(size.value, &size.unit), range(1.0)),
    }
}

/// A number of the simulator's own that has another value.
fn parameter(cause: &Cause, size: &Parameter, part: &str, model: &Model, range: &str) -> String {
    let Some(own) = cause.variables.first() else { return name(cause) };
    let element = own.rsplit_once('.').map_or("", |(element, _)| element);
    let what = match attribute(own) {
        "frictionloss" => "friction",
        other => other,
    };
    let what = if element.is_empty() || element == part { what.to_string() } else { format!("{what} of {element}") };
    let nominal = model.parameters.iter().find(|p| p.name == *own).map_or(0.0, |p| p.value);
    match nominal == 0.0 {
        true => format!("{what} {}{range}", signed(size.value, &size.unit)),
        false => format!("{what} {} -> {}{range}", short(nominal), with_unit(size.value, &size.unit)),
    }
}

fn attribute(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, attribute)| attribute)
}

fn name(cause: &Cause) -> String {
    Effect::from_id(&cause.effect).map_or_else(|| cause.effect.replace('_', " "), |effect| effect.name().to_string())
}

fn milliseconds(seconds: f64) -> String {
    format!("{} ms", short(MILLI * seconds))
}

fn signed(value: f64, unit: &str) -> String {
    let sign = if value < 0.0 { "" } else { "+" };
    format!("{sign}{}", with_unit(value, unit))
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", short(value)).trim_end().to_string()
}

/// Both ends of an interval, down to the first digit of its half width: `29.997 to 30.001`.
fn between(low: f64, high: f64) -> String {
    let (width, size) = (0.5 * (high - low), low.abs().max(high.abs()));
    if !(width > 0.0 && (PLAIN.0..PLAIN.1).contains(&size)) {
        return format!("{} to {}", short(low), short(high));
    }
    let decimals = (-width.log10().floor() as i32).clamp(0, 9) as usize;
    format!("{low:.decimals$} to {high:.decimals$}")
}

/// A number with three digits: `0.25`, `12.3`, `2.0e-6` as `2e-6`.
fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(PLAIN.0..PLAIN.1).contains(&size) {
        return format!("{value:.2e}").replace(".00e", "e");
    }
    let decimals = (2 - size.log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::error::Error;
    use crate::progress::Silent;

    fn joint(name: &str, state: &str) -> Part {
        Part {
            kind: PartKind::Joint,
            name: name.into(),
            states: vec![state.into()],
            controls: vec!["u".into()],
            ports: Vec::new(),
            parameters: Vec::new(),
        }
    }

    fn diagnosed(only: Vec<Part>, loses: impl Fn(f64) -> f64) -> crate::error::Result<Diagnosis> {
        let (model, data) = drive(None, loses, 0.01, (4, 300));
        let (train, holdout) = hold_out(&data).unwrap();
        let effects = vec!["coulomb_friction".into(), "bias".into()];
        let parts = vec![joint("axis", "x"), joint("hand", "y")];
        let settings = Diagnose { effects, parts, only, ..Diagnose::default() };
        Ok(settings.run(&model, &train, &holdout, &Silent)?.diagnosis)
    }

    #[test]
    fn a_joint_with_a_cause_says_it_and_one_without_what_would_have_been_seen() {
        let found = diagnosed(Vec::new(), |x| x + if x > 0.0 { 0.2 } else { -0.2 }).unwrap();
        let (axis, hand) = (&found.by_part[0], &found.by_part[1]);
        assert!(axis.says.starts_with("friction +0.") && axis.causes == [0], "{axis:?}");
        assert!((axis.share - 1.0).abs() < 1e-9 && axis.measured && axis.asked);
        assert!(hand.says == "not measured" && hand.causes.is_empty(), "{hand:?}");
        let null = diagnosed(Vec::new(), |x| x).unwrap();
        assert!(null.by_part[0].says.starts_with("nothing above 0.0"), "{:?}", null.by_part[0]);
    }

    #[test]
    fn effects_of_other_parts_than_those_asked_for_are_no_suspects() {
        let refused = diagnosed(vec![joint("hand", "y")], |x| x).unwrap_err();
        assert!(matches!(refused, Error::Settings { .. }), "{refused}");
        let found = diagnosed(vec![joint("axis", "x")], |x| x).unwrap();
        assert!(found.by_part[1].says == "not asked" && found.notes.iter().any(|n| n.contains("only effects in axis")));
    }

    #[test]
    fn numbers_are_short() {
        let all = [0.25, 0.2496, 12.34, 1234.0, -0.00301, 2e-6, 0.0, 1.0].map(short);
        assert_eq!(all, ["0.25", "0.25", "12.3", "1234", "-0.00301", "2e-6", "0", "1"]);
    }

    #[test]
    fn the_ends_of_a_narrow_interval_differ() {
        assert_eq!(between(29.9968, 30.0011), "29.997 to 30.001");
        assert_eq!(between(0.2481, 0.2519), "0.248 to 0.252");
        assert_eq!(between(-14.0, 9.0), "-14 to 9");
        assert_eq!(between(2e-6, 3e-6), "2e-6 to 3e-6");
    }
}
