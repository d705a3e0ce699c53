//! A parameter that follows a hidden temperature.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::sense::scaled::driven_through;
use crate::diagnose::catalogue::writer::{FREE, Writer, amplitude, number};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::State;

pub(super) static DEFINITION: Definition = Definition {
    name: "thermal",
    meaning: "A parameter of the plant changes as it warms up and returns as it cools.",
    family: Family::Time,
    form: "p becomes p*(1 + c*T), with a hidden temperature T that u^2 heats within the time tau",
    symbols: &["p", "u"],
    parameters: "c: relative change when warm, tau: time constant, s",
    signature: "the model fits at first; the plant changes under load and recovers at rest",
    places: &[Place::Heated],
    sense: &[Sense::Moves(1), Sense::Lossy(1)],
    twins: &[(Effect::Drift, "a warm-up from cold, a rest, and a second warm-up")],
    traits: Traits {
        added_states: 1,
        has_many_places: true,
        only_if_asked: true,
        behind: &[Effect::Drift],
        contains: &[Effect::ParameterError],
        ..Traits::PLAIN
    },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Sine(6.0, 1.0),
        18.0,
        "v",
        &[("v", "2*u - 0.8*(1 + 2*T)*v"), ("T", "(2*u^2 - T)/6")],
    ),
    in_mjcf: None,
    about: "The machine is assumed to be cold at the beginning of every log; a log that begins warm shifts the fitted size. The heat is the square of a control of the same equation, less what stands against it where the parameter scales both, as the speed does in a winding whose current is no state; or of a current or speed that the parameter scales: the losses of a drive, of a resistance, of a friction, which grow with the parameter itself. A parameter that scales a current of its own in each of several equations is heated by all of them: the sum of their squares. It is tested where a drift of the same equation is one of the best effects or one of the causes found, where no single effect leaves only noise, and on request: a drift and a slow lag imitate it in short logs.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let (period, span) = (writer.scene.period, writer.span().2);
    let size = (1..writer.hypothesis.variables.len()).map(|heats| writer.size(heats)).fold(0.0, f64::max);
    let c = writer.add("c", 0.0, 1.0, FREE, "");
    let tau = writer.add_scale("tau", 0.3 * span, 0.1 * span, (5.0 * period, 10.0 * span), "s");
    let [name, heats] = [0, 1].map(|index| writer.hypothesis.variables[index].clone());
    let model = &writer.model;
    let is_driven = model.control_index(&heats).is_some();
    let drives = match is_driven {
        true => driven_through(&model.states[writer.hypothesis.state].equation, model, &name, &heats),
        false => Expression::variable(heats),
    };
    let warm = writer.add_state(&format!("{name}_warmth"), Some(0.0));
    let symbols = [("tau", tau), ("size", number(size)), ("T", warm.clone()), ("c", c)];
    let changed = writer.form("p*(1 + c*T)", &symbols)?;
    writer.replace(&name, &changed);
    // Of a parameter of several equations the losses add up.
    let also = writer.hypothesis.variables[2..].iter().cloned().map(Expression::variable);
    let mut heat = writer.form("(z/size)^2", &[("z", drives), ("size", number(size))])?;
    for other in also {
        heat = heat.plus(writer.form("(w/size)^2", &[("w", other), ("size", number(size))])?);
    }
    // What a resistance or a friction loses at a current or a speed grows with itself.
    let rate = if is_driven { "(heat - T)/tau" } else { "(heat*(1 + c*T) - T)/tau" };
    writer.set_rate(&warm, writer.form(rate, &[&symbols[..], &[("heat", heat)]].concat())?);
    Ok([0.03, 0.1, 0.3, 1.0].map(|part| amplitude(&[1e-3, part * span])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let count = planting.hypothesis.variables.len();
    let (span, size) = (planting.span(), (1..count).map(|heats| planting.size_of(heats)).fold(0.0, f64::max));
    let name = planting.name(0);
    let heat = planting.model.free_name("heat");
    let square = |heats| {
        Expression::variable(planting.name(heats)).over(Expression::Number(size)).power(Expression::Number(2.0))
    };
    let power = (2..count).map(square).fold(square(1), Expression::plus);
    let symbols = [
        ("p", Expression::variable(name.clone())),
        ("q", Expression::variable(heat.clone())),
        ("power", power),
        ("tau", Expression::Number(0.2 * span)),
    ];
    let changed = planting.written("p + p*c*q", "c", &symbols)?;
    planting.replace(&name, &changed);
    let is_driven = planting.model.control_index(&planting.name(1)).is_some();
    let form = if is_driven { "power/tau - q/tau" } else { "(power + power*c*q)/tau - q/tau" };
    let rate = planting.written(form, "c", &symbols)?;
    planting.model.states.push(State::new(heat.clone(), rate));
    planting.model.initial.insert(heat, 0.0);
    Ok(Some(Size::within("c", String::new(), (0.02, 3.0), "")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    const STEP: f64 = 0.05;

    /// Logs of a winding of 0.8 ohm that doubles as it warms within 8 s, and loses the square of its current times what it has by then.
    fn logs() -> Dataset {
        const FINE: usize = 200;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let runs = (0..4).map(|run| {
            let (mut current, mut warmth, mut values) = (0.0, 0.0, Mat::zeros(600, 2));
            for i in 0..600 {
                let t = STEP * i as f64;
                let voltage = 6.0 * (0.7 * t + f64::from(run)).sin() + 5.0 * (0.23 * t + 2.0 * f64::from(run)).sin();
                (values[(i, 0)], values[(i, 1)]) = (current + 0.01 * normal(&mut random), voltage);
                for _ in 0..FINE {
                    let resistance = 0.8 * (1.0 + warmth);
                    let power = resistance / 0.8 * current * current;
                    warmth += STEP / FINE as f64 * (0.02 * power - warmth) / 8.0;
                    current += STEP / FINE as f64 * (voltage - resistance * current) / 0.5;
                }
            }
            let time = (0..600).map(|i| STEP * f64::from(i)).collect();
            Run { name: format!("run {run}"), time, values }
        });
        Dataset::new(["i", "u"].map(Channel::new).into(), runs.collect()).unwrap()
    }

    #[test]
    fn what_a_winding_loses_grows_with_its_own_resistance() {
        let parameter = |(name, value): (&str, f64)| Parameter::new(name, value);
        let model = Model {
            states: vec![State { unit: "A".into(), ..State::new("i", Expression::parse("(u - R*i)/L").unwrap()) }],
            controls: vec![Control { unit: "V".into(), ..Control::new("u") }],
            parameters: [("R", 0.8), ("L", 0.5)].map(parameter).into(),
            ..Model::default()
        };
        let (train, holdout) = hold_out(&logs()).unwrap();
        let asked = Diagnose { effects: vec!["thermal".into()], ..Diagnose::default() };
        let found = asked.run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let names: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!((names.as_slice(), found.verdict), (&["thermal"][..], Verdict::Explained), "{:?}", found.checks);
    }
}
