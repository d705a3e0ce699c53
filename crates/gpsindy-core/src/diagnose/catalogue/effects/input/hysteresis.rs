//! A force that depends on the path.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer, amplitude};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::{Model, State, unit};

pub(super) static DEFINITION: Definition = Definition {
    name: "hysteresis",
    meaning: "A force that depends on the path of the motion: a material or a valve that deforms before it slides.",
    family: Family::Memory,
    form: "-c*h with h a state of its own, h(0) = 0, and the rate of h z - b*(abs(z)*h + r*z*abs(h))",
    symbols: &["z"],
    parameters: "c: stiffness after a reversal, b: rate at which the force saturates, r: from -1 to 1, how the ways out and back differ (r*b is the g of Bouc and Wen)",
    signature: "closed loops of force over position, with rounded corners after each reversal",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0)],
    twins: &[
        (Effect::CoulombFriction, "reversals of several lengths: hysteresis deforms before it slides"),
        (Effect::LinearStiffness, "small and large strokes"),
        (Effect::StribeckFriction, "reversals of several lengths: hysteresis deforms before it slides"),
    ],
    traits: Traits { added_states: 1, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::ARM,
        Drive::Sine(2.0, 1.0),
        10.0,
        "q",
        &[("v", "-9*q - 1.5*v + 6*u - 3*h"), ("h", "6*v - 3*abs(v)*h - 3*v*abs(h)")],
    ),
    in_mjcf: None,
    about: "Source: Bouc 1967, Wen 1976, with an exponent of one. With r = 0 it is the model of Dahl 1968. r stays between -1 and 1, beyond which the force \
            would give back more energy than it took: Erlicher and Point 2004, C. R. Mecanique 332(1).",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = writer.hypothesis.state;
    let (rate, small) = (writer.rate(), writer.small());
    let travel = travel(&writer.model, writer.scene, state);
    let speed = writer.unit_of(0);
    let stiffness = unit::product(&[(&writer.unit_per(&[(0, 1)]), 1), ("s", -1)]);
    let bend = unit::product(&[(&speed, -1), ("s", -1)]);
    let c = writer.add("c", 0.0, rate / travel, POSITIVE, &stiffness);
    // Between two starts it must forget: what it keeps for longer with a start of its own would fit any constant force.
    let covered = writer.scene.states[state].size() * writer.scene.window;
    let forgets = (0.1 / travel).max(1.0 / covered).min(1e2 / travel);
    // At its ends the force is that of a spring, or of dry friction.
    let b = writer.add_scale("b", (5.0 / travel).max(forgets), 5.0 / travel, (forgets, 1e3 / travel), &bend);
    // Beyond these the force gives back more energy than it took, which no material does.
    let r = writer.add("r", 0.0, 1.0, (-1.0, 1.0), "");
    let name = format!("{}_remembered", writer.model.states[state].name);
    let h = writer.add_state(&name, Some(0.0));
    let flow = writer.form("z - b*(abs(z)*h + r*z*abs(h))", &[("b", b), ("r", r), ("h", h.clone())])?;
    writer.set_rate(&h, flow);
    writer.add_term(c.times(h).negated());
    Ok([1.5, 4.0, 10.0, 25.0].map(|b| amplitude(&[b * small / travel, (b / travel).max(forgets), 0.0])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let state = planting.hypothesis.state;
    let travel = travel(&planting.model, planting.scene, state);
    let kept = planting.model.free_name("bent");
    let own = Expression::variable(kept.clone());
    let b = Expression::Number(6.0 / travel);
    let symbols = [("z", Expression::variable(planting.name(0))), ("h", own.clone()), ("b", b)];
    let rate = planting.written("z*(1 - b*(0.7*sign(z*h) + 0.3)*abs(h))", "c", &symbols)?;
    planting.add_term(planting.size.clone().times(own).negated());
    planting.model.states.push(State::new(kept.clone(), rate));
    planting.model.initial.insert(kept, 0.0);
    Ok(Some(Size::added(unit::product(&[(&planting.unit_per(&[(0, 1)]), 1), ("s", -1)]), planting.rate() / travel)))
}

/// How far the place moves whose rate the state is; without one what its speed covers in a tenth of the longest log.
fn travel(model: &Model, scene: &Scene, state: usize) -> f64 {
    let place = model.integral_of(state).and_then(|i| Some(scene.states.get(i)?.range() / model.per_rate(i).abs()));
    place.filter(|range| *range > 0.0).unwrap_or_else(|| 0.1 * scene.duration * scene.states[state].size())
}
