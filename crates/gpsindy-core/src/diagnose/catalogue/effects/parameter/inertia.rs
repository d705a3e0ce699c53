//! An inertia that differs from the model.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted, experiment};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{Writer, amplitude, number};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::model::{Model, unit};

/// Least and most of an inertia that the model lacks, in multiples of its own.
const LEAST: f64 = -0.5;
const MOST: f64 = 20.0;

pub(super) static DEFINITION: Definition = Definition {
    name: "inertia",
    meaning: "The moved inertia exceeds that of the model: armature, payload or added mass.",
    family: Family::Parameter,
    form: "the right side of the equation is divided by (1 + c); at a port or control, -c times the rate there",
    symbols: &[],
    parameters: "c: missing inertia, relative to that of the model; at a port or control, in units of its own",
    signature: "every force accelerates this axis less, by the same factor",
    places: &[Place::Row],
    sense: &[Sense::Speed, Sense::NoScale],
    twins: &[(Effect::InputGain, experiment::KNOWN_LOAD), (Effect::ParameterError, experiment::KNOWN_LOAD)],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::SPRING, Drive::Released, 8.0, "x", &[("v", "(-4*x - 0.2*v + 3*u)/1.4")]),
    in_mjcf: Some("`armature` of the joint"),
    about: "If a parameter of the model scales this whole equation and stands in no other, such as its mass, that parameter is tested instead. At a port, or at a control that moves several axes, it is what one axis of a mechanism has more, as an armature: the other axes feel it, too. Negative values down to half of the inertia are allowed.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let Some(site) = writer.hypothesis.site.clone() else {
        let c = writer.add("c", 0.0, 1.0, (LEAST, MOST), "");
        let equation = &mut writer.model.states[writer.hypothesis.state].equation;
        *equation = equation.clone().over(number(1.0).plus(c));
        return Ok(vec![amplitude(&[1e-3])]);
    };
    // What holds back a rate of one as much as the machine itself does.
    let own = 1.0 / site.gain;
    let c = writer.add("c", 0.0, own, (LEAST * own, MOST * own), &unit(&writer.model, writer.hypothesis));
    let held = held_back(&writer.model, writer.hypothesis.state, &site.name, c)?;
    writer.replace(&site.name, &held);
    Ok(vec![amplitude(&[1e-3 * own])])
}

/// What acts at the port or control `name` once `c` times the rate of `state` is taken off: that rate is one in which it acts itself,
/// `w' = e(p - c w')`, so that it is solved for, `w' = e(p)/(1 + c de/dp)`. The rows of other axes that `p` moves follow: an armature that one
/// joint lacks changes the coupling of all.
fn held_back(model: &Model, state: usize, name: &str, c: Expression) -> Result<Expression> {
    let equation = model.states[state].equation.clone();
    let slope = equation.derivative(name)?;
    if slope.contains(name) {
        return Err(Error::model(format!("the equation of `{}` is not linear in `{name}`", model.states[state].name)));
    }
    let rate = equation.over(number(1.0).plus(c.clone().times(slope)));
    Ok(Expression::variable(name).minus(c.times(rate)))
}

/// Unit of an inertia at a port or control: that of its force by that of the rate.
fn unit(model: &Model, hypothesis: &Hypothesis) -> String {
    unit::product(&[(&hypothesis.unit_of_rate(model), 1), (&model.states[hypothesis.state].rate_unit(), -1)])
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    if let Some(site) = planting.hypothesis.site.clone() {
        let held = held_back(&planting.model, planting.hypothesis.state, &site.name, planting.size.clone())?;
        planting.replace(&site.name, &held);
        let (own, unit) = (1.0 / site.gain, unit(&planting.model, planting.hypothesis));
        return Ok(Some(Size::within("c", unit, (0.02 * own, 10.0 * own), "")));
    }
    let factor = planting.written("1/(1 + c)", "c", &[])?;
    let equation = &mut planting.model.states[planting.hypothesis.state].equation;
    *equation = factor.times(equation.clone());
    Ok(Some(Size::within("c", String::new(), (0.02, 10.0), "")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::model_of;
    use crate::expression::Tape;
    use crate::model::Control;

    #[test]
    fn an_armature_that_one_joint_lacks_changes_the_coupling_of_both() {
        // Two joints by their inertias: M w' = u with M = [[3, 1], [1, 2]], and an armature of 0.5 more at the second.
        let mut arm = model_of(&[("a", "rad/s", "(2*u - v)/5"), ("b", "rad/s", "(3*v - u)/5")]);
        arm.controls.extend(["u", "v"].map(Control::new));
        let held = held_back(&arm, 1, "v", number(0.5)).unwrap();
        arm.replace("v", &held, None);
        let rate = |row: usize, u: f64, v: f64| {
            let equation = arm.states[row].equation.substitute("u", &number(u)).substitute("v", &number(v));
            Tape::new(&[equation], &[]).unwrap().evaluate_once(&[], 0.0)[0]
        };
        // The inverse of [[3, 1], [1, 2.5]].
        for (u, v) in [(1.0, 0.0), (0.0, 1.0), (0.7, -2.0)] {
            let (a, b) = ((2.5 * u - v) / 6.5, (3.0 * v - u) / 6.5);
            assert!((rate(0, u, v) - a).abs() < 1e-12 && (rate(1, u, v) - b).abs() < 1e-12);
        }
        // What acts by its square can't be solved for.
        let mut drag = model_of(&[("a", "m/s", "u^2 - a")]);
        drag.controls.push(Control::new("u"));
        assert!(held_back(&drag, 0, "u", number(0.5)).is_err());
    }
}
