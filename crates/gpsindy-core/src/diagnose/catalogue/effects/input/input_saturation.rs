//! The control has a limit.

use crate::diagnose::catalogue::applied::Role;
use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Drive as Driven, Writer, keep};
use crate::diagnose::limits::catalogue::LET_THROUGH;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "input saturation",
    meaning: "The actuator saturates at a limit.",
    family: Family::InputStatic,
    form: "u becomes clamp(u, low, high)",
    symbols: &["u"],
    parameters: "low and high: limits, one of which may be absent",
    signature: "large commands have no more effect than medium ones, in one direction or in both",
    places: &[Place::Control],
    sense: &[],
    twins: &[(Effect::InputLag, experiment::AMPLITUDES), (Effect::InputGain, experiment::AMPLITUDES)],
    traits: Traits { is_a_limit: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*clamp(u, -0.5, 0.5) - 0.8*v")]),
    in_mjcf: Some("`ctrlrange` of the actuator"),
    about: "A limit that the logs never reach is left out of the report, and stands far beyond them in the corrected model.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let Driven { name, u, excursion, .. } = writer.drive()?;
    let (low, high, size) = (excursion.low, excursion.high, excursion.size());
    if excursion.range() == 0.0 {
        return Ok(Vec::new());
    }
    // A drive that pushes either way lets the smallest commands of both signs through.
    let is_two_way = low < 0.0 && high > 0.0;
    let (first, last) = if is_two_way { (0.0, 0.0) } else { (low, high) };
    let up = |part: f64| first + part * (high - first);
    let down = |part: f64| last - part * (last - low);
    let upper = writer.add_end("high", Role::Above, size, (up(LET_THROUGH), high));
    let lower = writer.add_end("low", Role::Below, size, (low, down(LET_THROUGH)));
    writer.replace(&name, &Expression::Call(Function::Clamp, vec![u, lower, upper]));
    let one = [0.95, 0.8, 0.6, 0.35].into_iter().flat_map(|part| [keep(&[up(part), low]), keep(&[high, down(part)])]);
    if !is_two_way {
        return Ok(one.collect());
    }
    let both = [0.97, 0.92, 0.85, 0.75, 0.6, 0.45, 0.3].map(|part| {
        let level = 0.5 * (part * excursion.size_quantile(1.0) + excursion.size_quantile(part));
        keep(&[level.clamp(up(LET_THROUGH), high), (-level).clamp(low, down(LET_THROUGH))])
    });
    Ok(both.into_iter().chain(one).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let largest = planting.largest();
    planting.drive("clamp(u, -high, high)", "high")?;
    Ok(Some(Size::limit("high", planting.control_unit(), largest, (0.1 * largest, 0.98 * largest))))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::Diagnose;
    use crate::diagnose::fixture::{slider, slider_model};
    use crate::diagnose::report::Verdict;
    use crate::progress::Silent;

    /// What a slider, `v' = limited(u) - 3 v`, is explained by: effects, and their limits.
    fn found(limited: impl Fn(f64) -> f64 + Copy, offset: f64) -> Vec<(String, Vec<(String, f64)>)> {
        let rate = |_: f64, v: f64, u: f64| limited(u) - 3.0 * v;
        let input =
            |time: f64, run: f64| offset + 5.0 * (0.9 * time + run).sin() + 3.0 * (2.3 * time + 2.0 * run).sin();
        let logs = |seed| slider(seed, rate, input, [0.003, 0.01], 400);
        let found = Diagnose::default().run(&slider_model("u - 3*v"), &logs(1), &logs(2), &Silent).unwrap().diagnosis;
        assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.causes);
        let sizes =
            |c: &crate::diagnose::report::Cause| c.parameters.iter().map(|p| (p.name.clone(), p.value)).collect();
        found.included().map(|cause| (cause.effect.clone(), sizes(cause))).collect()
    }

    fn is_limited(found: &[(String, Vec<(String, f64)>)], wanted: &[(&str, f64)]) -> bool {
        let [(effect, sizes)] = found else { return false };
        let is_right = |((name, value), (wanted, size)): (&(String, f64), &(&str, f64))| {
            name == wanted && (value - size).abs() < 0.1
        };
        effect == "input_saturation" && sizes.len() == wanted.len() && sizes.iter().zip(wanted).all(is_right)
    }

    #[test]
    fn a_drive_may_have_a_limit_at_either_side_or_at_one() {
        let both = found(|u| u.clamp(-4.0, 6.0), 0.0);
        assert!(is_limited(&both, &[("high", 6.0), ("low", -4.0)]), "{both:?}");
        let above = found(|u| u.min(5.0), 0.0);
        assert!(is_limited(&above, &[("high", 5.0)]), "{above:?}");
        let below = found(|u| u.max(7.0), 10.0);
        assert!(is_limited(&below, &[("low", 7.0)]), "{below:?}");
    }
}
