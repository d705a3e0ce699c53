//! Dry friction that holds at rest.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{POSITIVE, Writer};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::{State, unit};

pub(super) static DEFINITION: Definition = Definition {
    name: "stiction",
    meaning: "Dry friction that holds at rest: nothing moves until the force exceeds a level.",
    family: Family::Friction,
    form: "-(c + (s - c)*exp(-(z/w)^2))*d/delta with d a state of its own, d(0) = 0, and the rate of d z - abs(z)*d/delta",
    symbols: &["z"],
    parameters: "c: level in motion, s: level at rest, s_minus_c: difference of the two levels, w: speed that separates them, delta: elastic deflection before it slides",
    signature: "rest under a force, then a sudden start",
    places: &[Place::Own],
    sense: &[Sense::Speed, Sense::EitherSign(0)],
    twins: &[
        (Effect::StribeckFriction, experiment::SLOW_REVERSALS),
        (Effect::CoulombFriction, experiment::SLOW_REVERSALS),
        (Effect::Hysteresis, "reversals of several lengths: stiction lets go at once"),
    ],
    traits: Traits { added_states: 1, only_if_asked: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Sine(2.0, 0.7),
        10.0,
        "v",
        &[("v", "2*u - 0.8*v - (0.4 + 0.6*exp(-(v/0.1)^2))*d/0.01"), ("d", "v - abs(v)*d/0.01")],
    ),
    in_mjcf: None,
    about: "The bristle of the LuGre model (Canudas de Wit et al. 1995) without its damping: while it bends, the axis is held. The bristle deflects by about the distance that the axis covers in a sample: a fit does not find its way to two levels where the axis is held and let go at once (`breakaway` in models). It is tested only on request, because Coulomb and Stribeck friction of a sticking machine would be mistaken for it.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (rate, small, size, unit) = (writer.rate(), writer.small(), writer.size(0), writer.unit_of_rate());
    // What the axis covers in one sample: shorter bristles would need shorter steps.
    let step = size * writer.scene.period;
    let c = writer.add("c", 0.0, rate, POSITIVE, &unit);
    let more = writer.add("s_minus_c", 0.0, rate, POSITIVE, &unit);
    let speed = writer.unit_of(0);
    let way = unit::product(&[(&speed, 1), ("s", 1)]);
    let w = writer.add_scale("w", 0.2 * size, size, (0.02 * size, 2.0 * size), &speed);
    let delta = writer.add("delta", step, step, (0.3 * step, 30.0 * step), &way);
    let name = format!("{}_bristle", writer.model.states[writer.hypothesis.state].name);
    let d = writer.add_state(&name, Some(0.0));
    let symbols = [("c", c), ("more", more), ("w", w), ("delta", delta), ("d", d.clone())];
    writer.add_term(writer.form("-(c + more*exp(-(z/w)^2))*d/delta", &symbols)?);
    writer.set_rate(&d, writer.form("z - abs(z)*d/delta", &symbols)?);
    let start = |w: f64, delta: f64| Start {
        columns: [[small, 0.0], [0.0, small]].map(|[c, more]| vec![c, more, w * size, delta * step]).into(),
        combine: Combine::Amplitude,
        amplitudes: vec![(0, 0.0), (1, 0.0)],
    };
    Ok(vec![start(0.1, 1.0), start(0.3, 1.0), start(0.1, 4.0), start(0.3, 4.0)])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (size, period) = (planting.size_of(0), planting.scene.period);
    let bristle = planting.model.free_name("bristle");
    let own = Expression::variable(bristle.clone());
    let symbols = [
        ("z", Expression::variable(planting.name(0))),
        ("e", own.over(Expression::Number(0.5 * size * period))),
        ("fast", Expression::Number(0.15 * size)),
    ];
    let force = planting.written("-c*e*(1 + 0.8*exp(-z*z/(fast*fast)))", "c", &symbols)?;
    planting.add_term(force);
    let rate = planting.written("z*(1 - sign(z)*e)", "c", &symbols)?;
    planting.model.states.push(State::new(bristle.clone(), rate));
    planting.model.initial.insert(bristle, 0.0);
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}
