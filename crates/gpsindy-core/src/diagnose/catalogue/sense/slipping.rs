//! What slips at a contact: the difference of speeds that a parameter multiplies, as in `C*(delta - (vy + a*r)/vx)` or `c*(R*w - v)`.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::sense;
use crate::expression::{Expression, Operator, Tape};
use crate::model::Model;

/// Whether these are the variables of an effect on a difference: its parameter, and at least two that move.
pub(crate) fn is_of_a_difference(variables: &[String]) -> bool {
    variables.len() > 2
}

/// The sum or difference that `parameter` multiplies, over what moves and divides it, in the first equation where it has one of several
/// variables, of which each state is a speed; and the names of these.
pub(crate) fn slip<'m>(model: &'m Model, parameter: &str) -> Option<(Expression, Vec<&'m str>)> {
    let mut found = None;
    for state in &model.states {
        state.equation.visit(&mut |part| {
            if found.is_none() {
                found = multiplied(model, part, parameter).and_then(|slip| {
                    let names = speeds(model, &slip)?;
                    Some((slip, names))
                });
            }
        });
    }
    found
}

/// The sum among the factors of a product that has `parameter` as another one, over the divisors that move: `C*(vy - b*r)/vx` slips by an angle.
fn multiplied(model: &Model, product: &Expression, parameter: &str) -> Option<Expression> {
    let (mut all, mut divisors) = (Vec::new(), Vec::new());
    factors(product, &mut all, &mut divisors);
    let is_parameter = |factor: &&Expression| matches!(factor, Expression::Variable(name) if name == parameter);
    let is_sum = |factor: &&&Expression| matches!(factor, Expression::Binary(Operator::Add | Operator::Subtract, ..));
    let sum = all.iter().find(is_sum).filter(|_| all.iter().any(is_parameter))?;
    let moving = |name: &str| model.state_index(name).is_some() || model.control_index(name).is_some();
    let moves = |divisor: &&&Expression| divisor.variables().iter().any(|name| moving(name));
    Some(divisors.iter().filter(moves).fold((*sum).clone(), |slip, &divisor| slip.over(divisor.clone())))
}

/// The factors of a product, and what divides it.
fn factors<'e>(product: &'e Expression, all: &mut Vec<&'e Expression>, divisors: &mut Vec<&'e Expression>) {
    match product {
        Expression::Binary(Operator::Multiply, a, b) => {
            factors(a, all, divisors);
            factors(b, all, divisors);
        }
        Expression::Binary(Operator::Divide, a, b) => {
            factors(a, all, divisors);
            divisors.push(b);
        }
        Expression::Negate(a) => factors(a, all, divisors),
        other => all.push(other),
    }
}

/// The states and controls of a sum, of which at least two move and each state is a speed.
fn speeds<'m>(model: &'m Model, sum: &Expression) -> Option<Vec<&'m str>> {
    let states: Vec<usize> = (0..model.states.len()).filter(|&j| sum.contains(&model.states[j].name)).collect();
    let controls = model.controls.iter().map(|c| c.name.as_str()).filter(|name| sum.contains(name));
    let are_speeds = !states.is_empty() && states.iter().all(|&j| sense::may_be_speed(model, j));
    let all: Vec<&str> = states.iter().map(|&j| model.states[j].name.as_str()).chain(controls).collect();
    (are_speeds && all.len() > 1).then_some(all)
}

/// Typical size of an expression of states, controls and parameters along the paths of the nominal model; one where it is zero.
pub(crate) fn size(expression: &Expression, model: &Model, scene: &Scene) -> f64 {
    let names: Vec<String> = model.names().map(str::to_string).collect();
    let Ok(tape) = Tape::new(std::slice::from_ref(expression), &names) else { return 1.0 };
    let parameters = model.parameters.iter().map(|p| p.value);
    let value = |moment: &Vec<f64>| {
        let mut values: Vec<f64> = moment.iter().copied().chain(parameters.clone()).collect();
        values.resize(names.len(), 0.0);
        tape.evaluate_once(&values, scene.times.0)[0]
    };
    let finite: Vec<f64> = scene.moments.iter().map(value).filter(|v| v.is_finite()).collect();
    let square = finite.iter().map(|v| v * v).sum::<f64>() / finite.len().max(1) as f64;
    if square > 0.0 { square.sqrt() } else { 1.0 }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::Diagnose;
    use crate::diagnose::fixture::model_of;
    use crate::diagnose::report::Verdict;
    use crate::model::{Control, Parameter};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    #[test]
    fn a_tyre_slips_by_an_angle_of_speeds_and_a_spring_does_not() {
        let of = |states: &[(&str, &str, &str)]| Model {
            controls: vec![Control::new("delta")],
            parameters: ["C", "a", "vx", "k"].map(|n| Parameter::new(n, 2.0)).into(),
            ..model_of(states)
        };
        let car = of(&[
            ("vy", "m/s", "(C*(delta - (vy + a*r)/vx))/k - vx*r"),
            ("r", "rad/s", "-(a*C*(delta - (vy + a*r)/vx)) - r"),
        ]);
        let mut rear = of(&[("vy", "m/s", "-k*(vy - a*r)/u/C"), ("r", "rad/s", "-r")]);
        rear.controls = vec![Control::new("u")];
        assert_eq!(slip(&rear, "k").unwrap().0.to_string(), "(vy - a*r)/u");
        let (found, names) = slip(&car, "C").unwrap();
        assert_eq!((found.to_string().as_str(), names), ("delta - (vy + a*r)/vx", vec!["vy", "r", "delta"]));
        assert_eq!(slip(&car, "k"), None);
        let spring = of(&[("x", "m", "v"), ("y", "m", "w"), ("v", "m/s", "k*(y - x)"), ("w", "m/s", "k*(x - y)")]);
        assert_eq!(slip(&spring, "k"), None);
    }

    /// Logs of an axle, `C (R w - v)` at its contact of `force`, driven by steps of torque.
    fn axle(seed: u64, force: impl Fn(f64) -> f64) -> Dataset {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let runs = (0..4).map(|run| {
            let (mut v, mut w) = (5.0, 10.0);
            let mut rows = Vec::new();
            for i in 0..500 {
                let drive = 2.0 * f64::from((i / 40 + run) * 7 % 5) - 3.0;
                rows.push([v + 0.01 * normal(&mut random), w + 0.01 * normal(&mut random), drive]);
                for _ in 0..20 {
                    let pull = force(0.5 * w - v);
                    v += 1e-3 * (pull - 0.1 * v);
                    w += 1e-3 * (drive - 0.5 * pull);
                }
            }
            let time = (0..500).map(|i| 0.02 * f64::from(i)).collect();
            Run { name: format!("{run}"), time, values: Mat::from_fn(500, 3, |i, c| rows[i][c]) }
        });
        Dataset::new(["v", "w", "T"].map(Channel::new).into(), runs.collect()).unwrap()
    }

    #[test]
    fn an_axle_that_spins_on_its_rail_slips_by_the_difference_of_its_speeds() {
        let mut model = model_of(&[("v", "m/s", "C*(R*w - v) - 0.1*v"), ("w", "rad/s", "T - R*C*(R*w - v)")]);
        model.controls = vec![Control::new("T")];
        model.parameters = vec![Parameter::new("C", 4.0), Parameter::new("R", 0.5)];
        let limited = |slip: f64| (4.0 * slip).clamp(-2.0, 2.0);
        let found = Diagnose::default().run(&model, &axle(1, limited), &axle(2, limited), &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!((found.verdict, named), (Verdict::Explained, vec!["slip"]), "{:?}", found.checks);
        // The force saturates at a slip of a half.
        let q = found.causes[0].parameters.iter().find(|p| p.name == "q").unwrap();
        assert!((q.value / 4.0 - 1.0).abs() < 0.1, "{q:?}");
    }

    #[test]
    fn a_tyre_whose_force_falls_beyond_its_peak_has_the_shape_of_the_magic_formula() {
        let mut model = model_of(&[("v", "m/s", "C*(R*w - v) - 0.1*v"), ("w", "rad/s", "T - R*C*(R*w - v)")]);
        model.controls = vec![Control::new("T")];
        model.parameters = vec![Parameter::new("C", 4.0), Parameter::new("R", 0.5)];
        let tyre = |slip: f64| 1.2 * (1.6 * (4.0 / (1.6 * 1.2) * slip).atan()).sin();
        let found = Diagnose::default().run(&model, &axle(1, tyre), &axle(2, tyre), &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!((found.verdict, named), (Verdict::Explained, vec!["slip"]), "{:?}", found.checks);
        let sizes = &found.causes[0].parameters;
        let shape = sizes.iter().find(|p| p.name == "shape").unwrap();
        assert!((shape.value - 1.6).abs() < 0.1, "{sizes:?}");
    }
}
