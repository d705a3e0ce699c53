//! Invariance: a machine that moves alike everywhere has no effect that depends on its place.

use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::model::{Model, State};

/// The variables that say where the machine is, or which way it faces, and that no rate depends on.
///
/// A place is a length that stands in no equation. A heading is an angle that stands in those of places alone. Without units
/// nothing can be inferred from a reading that may well matter.
pub(crate) fn places(model: &Model) -> Vec<&str> {
    let readers = |name: &str| -> Vec<&State> { model.states.iter().filter(|s| s.equation.contains(name)).collect() };
    let is_place = |state: &State| is_length(&state.unit) && readers(&state.name).is_empty();
    let is_heading = |state: &State| {
        let readers = readers(&state.name);
        is_angle(&state.unit) && !readers.is_empty() && readers.into_iter().all(is_place)
    };
    model.states.iter().filter(|s| is_place(s) || is_heading(s)).map(|s| s.name.as_str()).collect()
}

/// The place that `hypothesis` depends on, of those that no rate does.
pub(crate) fn broken<'a>(hypothesis: &'a Hypothesis, places: &[impl AsRef<str>]) -> Option<&'a str> {
    match hypothesis.kind {
        Kind::Catalogue(_) => hypothesis
            .variables
            .iter()
            .map(String::as_str)
            .find(|name| places.iter().any(|place| place.as_ref() == *name)),
        Kind::Custom(_) | Kind::Nameless(_) => None,
    }
}

fn is_length(unit: &str) -> bool {
    matches!(unit, "m" | "mm" | "cm" | "km" | "um" | "µm" | "in" | "ft" | "yd" | "mi")
}

fn is_angle(unit: &str) -> bool {
    matches!(unit, "rad" | "deg" | "°")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::model_of;

    #[test]
    fn a_fall_has_no_place_and_a_spring_has_one() {
        assert_eq!(places(&model_of(&[("h", "m", "v"), ("v", "m/s", "-9.81")])), ["h"]);
        assert!(places(&model_of(&[("x", "m", "v"), ("v", "m/s", "-4*x")])).is_empty());
    }

    #[test]
    fn a_car_has_a_heading_and_a_shaft_or_a_pendulum_none() {
        let car = [("x", "m", "v*cos(th)"), ("y", "m", "v*sin(th)"), ("th", "rad", "v"), ("v", "m/s", "-v")];
        assert_eq!(places(&model_of(&car)), ["x", "y", "th"]);
        assert!(places(&model_of(&[("phi", "rad", "w"), ("w", "rad/s", "-w")])).is_empty());
        assert!(places(&model_of(&[("phi", "rad", "w"), ("w", "rad/s", "-sin(phi)")])).is_empty());
    }

    #[test]
    fn without_units_nothing_is_ruled_out() {
        assert!(places(&model_of(&[("h", "", "v"), ("v", "", "-9.81")])).is_empty());
    }
}
