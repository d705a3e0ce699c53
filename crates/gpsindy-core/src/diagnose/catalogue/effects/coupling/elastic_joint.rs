//! A load behind an elastic joint.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{Writer, amplitude, keep};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::{Model, State};
use std::f64::consts::{PI, TAU};

pub(super) static DEFINITION: Definition = Definition {
    name: "elastic joint",
    meaning: "The drive and its load are joined by a spring that the model assumes to be rigid.",
    family: Family::Coupling,
    form: "m*(omega^2*s + 2*zeta*omega*r), with two states of its own: the twist s and its rate r; and 1 + l*m times all else; or the same without what z does, which acts at the spring's other end",
    symbols: &["z"],
    parameters: "m: inertia of the load as a share of the drive's, or the drive's as one of the load's, omega: rad/s, zeta: damping, l: share of the load's inertia that the model has already, as part of its own",
    signature: "a resonance after each jump of the force, and no effect at slow motion",
    places: &[Place::Own, Place::OtherEnd],
    sense: &[Sense::Speed],
    twins: &[(Effect::InputLag, "a chirp beyond the resonance"), (Effect::Inertia, "a chirp beyond the resonance")],
    traits: Traits { added_states: 2, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Steps,
        10.0,
        "v",
        &[("v", "2*u - 0.8*v + 0.6*(36*s + 1.2*r)"), ("s", "r"), ("r", "-36*s - 1.2*r - (2*u - 0.8*v)")],
    ),
    in_mjcf: None,
    about: "The twist is the position of the load relative to the drive. In the limit of a very stiff spring it is additional inertia, unless the model has that of the load already. Where the state is that of the load, a control acts at the hidden other end, and where a drive carries a weight or a spring, what depends on the place does: the model is then the rigid one of both, and a very stiff spring changes nothing.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    if let Some(z) = at_other_end(writer.hypothesis, &writer.model) {
        return write_two_ends(writer, &z);
    }
    let state = writer.hypothesis.state;
    let (slowest, fastest) = swings(writer);
    let m = writer.add("m", 0.0, 1.0, (0.0, 10.0), "");
    let spring = spring(writer);
    // A rigid model has the inertia of both, or of the drive alone. The rate of a simulator that steps is its own.
    let is_equation = writer.hypothesis.site.is_none() && !writer.model.calls_simulator();
    let both = is_equation.then(|| writer.add("l", 0.0, 1.0, (0.0, 1.0), ""));
    if let Some(l) = &both {
        let rate = writer.model.states[state].equation.clone();
        writer.model.states[state].equation = rate.times(Expression::Number(1.0).plus(l.clone().times(m.clone())));
    }
    let Twist { twist, unwinding, pull } = Twist::of(writer, spring)?;
    writer.add_term(m.times(pull.clone()));
    let whole = writer.model.states[state].equation.clone();
    writer.set_rate(&twist, unwinding.clone());
    writer.set_rate(&unwinding, pull.negated().minus(whole));
    let ratio = (fastest / slowest).max(1.0);
    let shares = if both.is_some() { vec![vec![0.0], vec![1.0]] } else { vec![Vec::new()] };
    let start = |k: i32, share: &Vec<f64>| {
        let joint = [1e-3, slowest * ratio.powf(f64::from(k) / 6.0), 0.05];
        amplitude(&[&joint[..], share].concat())
    };
    Ok((0..7).flat_map(|k| shares.iter().map(move |share| start(k, share))).collect())
}

/// What acts at the other end of the spring: a control, where the state is the load's, or what depends on the place, where it is the drive's.
fn at_other_end(hypothesis: &Hypothesis, model: &Model) -> Option<String> {
    hypothesis.variables.first().filter(|z| **z != model.states[hypothesis.state].name).cloned()
}

/// The equation of one end where what `z` does acts at the other one, which is hidden, and the model has the inertia of both.
///
/// The twist is in units of the logged motion by the other end's share `m`, so that an end without inertia is the limit in which the
/// spring passes the force on, late.
fn write_two_ends(writer: &mut Writer<'_>, z: &str) -> Result<Vec<Start>> {
    let state = writer.hypothesis.state;
    let (slowest, fastest) = swings(writer);
    let place = writer.model.state_index(z);
    let is_place = place.is_some();
    // An end without inertia is at no place of its own.
    let m = writer.add("m", 1.0, 1.0, (if is_place { 0.05 } else { 0.0 }, 20.0), "");
    let spring = spring(writer);
    let rigid = writer.model.states[state].equation.clone();
    let (own, other) = ends(&rigid, z);
    let both = Expression::Number(1.0).plus(m.clone());
    let Twist { twist, unwinding, pull } = Twist::of(writer, spring)?;
    let other = place.map_or(other.clone(), |place| {
        let per = Expression::Number(writer.model.per_rate(place));
        other.substitute(z, &Expression::variable(z).plus(per.times(twist.clone()).over(m.clone())))
    });
    let rate = both.clone().times(own).plus(pull.clone());
    writer.model.states[state].equation = rate.clone();
    writer.set_rate(&twist, unwinding.clone());
    writer.set_rate(&unwinding, both.times(other).minus(pull).minus(m.times(rate)));
    let ratio = (fastest / slowest).max(1.0);
    let start = |k: i32| keep(&[1.0, slowest * ratio.powf(f64::from(k) / 9.0), 0.1]);
    Ok((0..10).map(start).collect())
}

/// A rate without what a variable adds to it, and what that is.
fn ends(rate: &Expression, z: &str) -> (Expression, Expression) {
    let without = rate.substitute(z, &Expression::Number(0.0));
    (without.clone(), rate.clone().minus(without))
}

/// The slowest and the fastest swing of a joint that is looked for, rad/s. Three swings between two starts: a slower one with a start of its own
/// would fit any slow force.
fn swings(writer: &Writer<'_>) -> (f64, f64) {
    (3.0 * TAU / writer.scene.window, 0.6 * PI / writer.scene.period)
}

/// Frequency and damping of the spring.
fn spring(writer: &mut Writer<'_>) -> [Expression; 2] {
    let slowest = swings(writer).0;
    let omega = writer.add_scale("omega", slowest, slowest, (slowest, PI / writer.scene.period), "rad/s");
    [omega, writer.add("zeta", 0.05, 0.05, (1e-3, 1.0), "")]
}

/// The hidden twist of a spring, its rate, and the pull that comes of both.
struct Twist {
    twist: Expression,
    unwinding: Expression,
    pull: Expression,
}

impl Twist {
    /// Both as states of the model, at rest where a log begins.
    fn of(writer: &mut Writer<'_>, [omega, zeta]: [Expression; 2]) -> Result<Self> {
        let name = writer.model.states[writer.hypothesis.state].name.clone();
        let twist = writer.add_state(&format!("{name}_twist"), Some(0.0));
        let unwinding = writer.add_state(&format!("{name}_twist_rate"), Some(0.0));
        let symbols = [("s", twist.clone()), ("r", unwinding.clone()), ("omega", omega), ("zeta", zeta)];
        let pull = writer.form("omega^2*s + 2*zeta*omega*r", &symbols)?;
        Ok(Self { twist, unwinding, pull })
    }
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let state = planting.hypothesis.state;
    if let Some(z) = at_other_end(planting.hypothesis, &planting.model) {
        return plant_two_ends(planting, &z).map(Some);
    }
    let omega = 0.12 * PI / planting.scene.period;
    let (stretch, slip) = (planting.model.free_name("stretch"), planting.model.free_name("slip"));
    let own = |name: &str| Expression::variable(name.to_string());
    let symbols = [
        ("x", own(&stretch)),
        ("v", own(&slip)),
        ("stiff", Expression::Number(omega * omega)),
        ("lossy", Expression::Number(0.1 * omega)),
    ];
    let back = planting.written("c*stiff*x + c*lossy*v", "c", &symbols)?;
    planting.add_term(back);
    let mine = planting.written("stiff*x + lossy*v", "c", &symbols)?;
    let rate = mine.plus(planting.model.states[state].equation.clone()).negated();
    planting.model.states.push(State::new(stretch.clone(), own(&slip)));
    planting.model.states.push(State::new(slip.clone(), rate));
    planting.model.initial.extend([(stretch, 0.0), (slip, 0.0)]);
    Ok(Some(Size::within("m", String::new(), (0.02, 8.0), "")))
}

/// Two bodies of the same inertia, of which the spring's is the period.
fn plant_two_ends(planting: &mut Planting<'_>, z: &str) -> Result<Size> {
    let state = planting.hypothesis.state;
    let rigid = planting.model.states[state].equation.clone();
    let (load, driven) = ends(&rigid, z);
    let (stretch, slip) = (planting.model.free_name("stretch"), planting.model.free_name("slip"));
    let own = |name: &str| Expression::variable(name.to_string());
    let driven = match planting.model.state_index(z) {
        Some(_) => driven.substitute(z, &own(z).plus(own(&stretch))),
        None => driven,
    };
    let symbols = [("x", own(&stretch)), ("v", own(&slip)), ("load", load), ("driven", driven)];
    let rate = planting.written("2*load + x/c^2 + 0.2*v/c", "c", &symbols)?;
    let unwinds = planting.written("2*driven - 2*load - 2*x/c^2 - 0.4*v/c", "c", &symbols)?;
    planting.model.states[state].equation = rate;
    planting.model.states.push(State::new(stretch.clone(), own(&slip)));
    planting.model.states.push(State::new(slip.clone(), unwinds));
    planting.model.initial.extend([(stretch, 0.0), (slip, 0.0)]);
    Ok(planting.late())
}
