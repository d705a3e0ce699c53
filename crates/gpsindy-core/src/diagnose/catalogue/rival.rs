//! Non-parametric rivals: generic smooth functions of some variables.
//!
//! They answer two questions that a comparison of effects cannot: whether structure remains that no effect of the
//! catalogue covers, and on which variables it depends.

use crate::diagnose::catalogue::applied::{Added, Applied, Combine, Role, Start};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::limits::catalogue::{CORNER, MOST_RIPPLES};
use crate::expression::{Expression, Function};
use crate::model::{Model, Parameter, unit};
use std::f64::consts::TAU;

/// A family of functions without a name, added to the equation of a state.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rival {
    pub(crate) state: usize,
    /// What it depends on; `t` is time.
    pub(crate) variables: Vec<String>,
    basis: Vec<Expression>,
}

/// Hat functions over a range: corners `count`, value one at a corner and zero at the next.
fn hats(z: &Expression, low: f64, high: f64, count: usize) -> Vec<Expression> {
    let width = (high - low) / (count - 1) as f64;
    (0..count)
        .map(|k| {
            let centre = Expression::Number(low + width * k as f64);
            let distance = z.clone().minus(centre).over(Expression::Number(width)).apply(Function::Abs);
            let hat = Expression::Number(1.0).minus(distance);
            Expression::Call(Function::Max, vec![Expression::Number(0.0), hat])
        })
        .collect()
}

/// Products of two families.
fn products(a: &[Expression], b: &[Expression]) -> Vec<Expression> {
    a.iter().flat_map(|x| b.iter().map(|y| x.clone().times(y.clone()))).collect()
}

/// Ripples along a position, by sines and cosines: over its range, or over a turn of what turns more than twice.
fn ripples(z: &Expression, range: f64, unit: &str) -> Vec<Expression> {
    let base = TAU / unit::turn(unit).filter(|turn| range > 2.0 * turn).unwrap_or(range);
    let wave = |k: usize, function| Expression::Number(base * k as f64).times(z.clone()).apply(function);
    (1..=MOST_RIPPLES).flat_map(|k| [Function::Sin, Function::Cos].map(|function| wave(k, function))).collect()
}

/// Every rival of a model: functions of one variable, of two, of time, and of each control's past; and of one variable times the sign of the
/// row's own state, as a dry friction is that differs from place to place or with the load.
pub(crate) fn enumerate(model: &Model, scene: &Scene, n_nominal: usize) -> Vec<Rival> {
    let states = (0..n_nominal).map(|j| (model.states[j].name.as_str(), &scene.states[j]));
    let controls = model.controls.iter().zip(&scene.controls).map(|(c, e)| (c.name.as_str(), e));
    let moving: Vec<(&str, f64, f64)> =
        states.chain(controls).filter(|(_, e)| e.range() > 0.0).map(|(n, e)| (n, e.low, e.high)).collect();
    let (first, last) = scene.times;
    let mut all = Vec::new();
    for j in (0..n_nominal).filter(|&j| !model.is_kinematic(j)) {
        let mut push = |variables: &[&str], basis: Vec<Expression>| {
            let variables = variables.iter().map(|v| (*v).to_string()).collect();
            all.push(Rival { state: j, variables, basis });
        };
        for (i, &(name, low, high)) in moving.iter().enumerate() {
            let z = Expression::variable(name);
            push(&[name], hats(&z, low, high, 8));
            for &(other, other_low, other_high) in &moving[i + 1..] {
                let second = hats(&Expression::variable(other), other_low, other_high, 4);
                push(&[name, other], products(&hats(&z, low, high, 4), &second));
            }
        }
        let own = &model.states[j].name;
        if let Some((_, low, high)) =
            moving.iter().find(|(name, ..)| name == own).filter(|(_, low, high)| *low < 0.0 && *high > 0.0)
        {
            let speed = Expression::variable(own.clone()).over(Expression::Number(CORNER * (high - low)));
            let sign = [speed.apply(Function::Tanh)];
            for &(name, low, high) in moving.iter().filter(|(name, ..)| name != own) {
                push(&[name, own], products(&hats(&Expression::variable(name), low, high, 8), &sign));
            }
        }
        push(&["t"], hats(&Expression::Time, first, last, 16));
        for (control, excursion) in model.controls.iter().zip(&scene.controls).filter(|(_, e)| e.range() > 0.0) {
            let u = || Expression::variable(control.name.clone());
            let late = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0]
                .map(|k| Expression::Call(Function::Delay, vec![u(), Expression::Number(k * scene.period)]));
            let dragged = [0.1, 0.3, 0.6]
                .map(|w| Expression::Call(Function::Play, vec![u(), Expression::Number(w * excursion.range())]));
            push(&[&control.name, "history"], late.into_iter().chain(dragged).collect());
        }
    }
    all
}

/// Ripples of each row along its own position, alone and with each control that the row reads, as a motor's torque ripples with its current: finer
/// than any other function, they are asked before a force is called random.
pub(crate) fn along_positions(model: &Model, scene: &Scene) -> Vec<Rival> {
    let rows = (0..model.states.len()).filter_map(|j| Some((j, model.integral_of(j)?)));
    let moving = rows.filter(|&(_, i)| scene.states.get(i).is_some_and(|place| place.range() > 0.0));
    let of = |(j, i): (usize, usize)| {
        let place = &model.states[i];
        let basis = ripples(&Expression::variable(place.name.clone()), scene.states[i].range(), &place.unit);
        let read = model.states[j].equation.variables();
        let controls = model.controls.iter().map(|control| &control.name).filter(|name| read.contains(name));
        let driven: Vec<Rival> = controls
            .map(|control| Rival {
                state: j,
                variables: vec![place.name.clone(), control.clone()],
                basis: products(&basis, &[Expression::variable(control.clone())]),
            })
            .collect();
        std::iter::once(Rival { state: j, variables: vec![place.name.clone()], basis }).chain(driven)
    };
    moving.flat_map(of).collect()
}

/// Functions of each logged state, and of time, on what its column reads.
pub(crate) fn of_columns(model: &Model, scene: &Scene, columns: &[usize]) -> Vec<Rival> {
    let mut all = Vec::new();
    for &j in columns.iter().filter(|&&j| scene.states[j].range() > 0.0) {
        let (name, excursion) = (&model.states[j].name, &scene.states[j]);
        let own = hats(&Expression::variable(name.clone()), excursion.low, excursion.high, 8);
        all.push(Rival { state: j, variables: vec![name.clone()], basis: own });
        let time = hats(&Expression::Time, scene.times.0, scene.times.1, 16);
        all.push(Rival { state: j, variables: vec!["t".into()], basis: time });
    }
    all
}

impl Rival {
    /// The functions of the family.
    pub(crate) fn members(&self) -> &[Expression] {
        &self.basis
    }

    /// Writes the family into a model, every member with an amplitude of its own.
    pub(crate) fn apply(&self, model: &Model, scene: &Scene) -> Applied {
        let mut model = model.clone();
        let first = model.parameters.len();
        let mut equation = model.states[self.state].equation.clone();
        for (k, member) in self.basis.iter().enumerate() {
            let name = format!("rival_{k}");
            model.parameters.push(Parameter::new(name.clone(), 0.0));
            equation = equation.plus(Expression::variable(name).times(member.clone()));
        }
        model.states[self.state].equation = equation;
        let added = |k: usize| Added {
            symbol: format!("{k}"),
            name: format!("rival_{k}"),
            unit: String::new(),
            scale: scene.rates[self.state],
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            role: Role::Plain,
        };
        let fitted = (0..self.basis.len()).map(|k| (first + k, added(k))).collect();
        Applied { model, fitted, parts: vec![self.basis.len()], starts: vec![self.start(scene)] }
    }

    /// How much of every member a straight line takes: so little that none changes where the machine goes.
    pub(crate) fn size(&self, scene: &Scene) -> f64 {
        1e-3 * scene.rates[self.state]
    }

    /// One column for each member.
    pub(crate) fn start(&self, scene: &Scene) -> Start {
        let (small, count) = (self.size(scene), self.basis.len());
        let columns = (0..count).map(|k| (0..count).map(|i| if i == k { small } else { 0.0 }).collect()).collect();
        Start { columns, combine: Combine::Span, amplitudes: Vec::new(), is_pointed: false }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::Dataset;
    use crate::diagnose::Diagnose;
    use crate::diagnose::fixture::{slider, slider_model};
    use crate::diagnose::report::Verdict;
    use crate::progress::Silent;

    /// A driven slider, `v' = u - 3 v`, with a dry friction of 3 where it is worn, a quarter to each side of 0.4.
    fn worn(seed: u64) -> Dataset {
        let rate = |x: f64, v: f64, u: f64| {
            let is_worn = f64::from((x - 0.4).abs() < 0.25);
            u - 3.0 * v - 3.0 * is_worn * (v / 5e-3).tanh()
        };
        let input = |time: f64, run: f64| {
            let levels = if ((time / 0.9).floor() + run) % 3.0 == 0.0 { -6.0 } else { 6.0 };
            8.0 * (0.9 * time + run).sin() + 6.0 * (2.3 * time + 2.0 * run).sin() + levels
        };
        slider(seed, rate, input, [0.003, 0.01], 600)
    }

    #[test]
    fn a_friction_that_differs_from_place_to_place_depends_on_the_place_and_the_speed() {
        let model = slider_model("u - 3*v");
        let found = Diagnose::default().run(&model, &worn(1), &worn(2), &Silent).unwrap().diagnosis;
        assert_eq!(found.verdict, Verdict::Unexplained, "{:?}", found.causes);
        assert_eq!(found.unexplained.depends_on, ["x", "v"]);
    }

    #[test]
    fn ripples_along_a_rail_are_cogging_and_never_a_random_force() {
        let rate = |x: f64, v: f64, u: f64| u - 3.0 * v - 4.0 * (25.0 * x).sin();
        let input = |time: f64, run: f64| 8.0 * (0.9 * time + run).sin() + 6.0 * (2.3 * time + 2.0 * run).sin();
        let rail = |seed| slider(seed, rate, input, [0.003, 0.01], 400);
        let mut model = slider_model("u - 3*v");
        for (state, unit) in model.states.iter_mut().zip(["m", "m/s"]) {
            state.unit = unit.into();
        }
        let run = |settings: &Diagnose| settings.run(&model, &rail(1), &rail(2), &Silent).unwrap().diagnosis;
        let named = |settings: &Diagnose| -> Vec<String> {
            run(settings).included().map(|cause| cause.effect.clone()).collect()
        };
        // No rate of the model depends on the place; magnets along a rail are what makes one unlike another.
        let cogging = vec!["cogging".to_string()];
        assert_eq!(named(&Diagnose::default()), cogging);
        assert_eq!(named(&Diagnose { allow_place: true, ..Diagnose::default() }), cogging);
        let rivals = ["process_noise", "coulomb_friction", "stiction", "linear_stiffness", "bias", "input_gain"];
        // The whole catalogue without its name takes a minute: `cargo xtask long levels`.
        let unnamed = run(&match gpsindy_beside::draws(0, 1) {
            0 => Diagnose { effects: rivals.map(String::from).into(), ..Diagnose::default() },
            _ => Diagnose { without: cogging, ..Diagnose::default() },
        });
        assert_eq!(unnamed.verdict, Verdict::Unexplained, "{:?}", unnamed.causes);
    }

    #[test]
    fn ripples_that_grow_with_the_control_are_no_random_force() {
        let rate = |x: f64, v: f64, u: f64| u * (1.0 + 0.4 * (14.0 * x).sin()) - 3.0 * v;
        let input = |time: f64, run: f64| 8.0 * (0.9 * time + run).sin() + 6.0 * (2.3 * time + 2.0 * run).sin();
        let motor = |seed| slider(seed, rate, input, [0.003, 0.01], 300);
        let effects = ["process_noise", "coulomb_friction", "input_gain"].map(String::from);
        let diagnose = Diagnose { effects: effects.into(), ..Diagnose::default() };
        let found = diagnose.run(&slider_model("u - 3*v"), &motor(1), &motor(2), &Silent).unwrap().diagnosis;
        assert_eq!(found.verdict, Verdict::Unexplained, "{:?}", found.causes);
    }
}
