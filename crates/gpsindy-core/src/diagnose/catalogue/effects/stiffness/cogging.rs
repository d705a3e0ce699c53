//! A force that repeats along the position.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{FREE, RIPPLES, Writer, sinusoid};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::unit;
use std::f64::consts::{PI, TAU};

/// Most ripples of a turn that are tried beyond sixty over the range: motors of twelve slots and fourteen poles have 84.
const MOST_OF_TURN: i32 = 96;

pub(super) static DEFINITION: Definition = Definition {
    name: "cogging",
    meaning: "A force that is periodic in the position.",
    family: Family::Stiffness,
    form: "c*sin(n*z + phase)",
    symbols: &["z"],
    parameters: "c: size, n: spatial frequency, phase",
    signature: "a ripple that is periodic in the position",
    places: &[Place::Position],
    sense: &[Sense::Placed(0)],
    twins: &[(Effect::PeriodicDisturbance, "the same motion at two speeds")],
    traits: Traits { marks_a_place: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::TURNING, Drive::Ramp, 9.0, "v", &[("v", "2*u - 0.8*v + 1.2*sin(6*q)")]),
    in_mjcf: None,
    about: "",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let z = writer.variable(0)?;
    let (rate, unit) = (writer.rate(), writer.unit_of_rate());
    let range = writer.excursion(0).map_or(0.0, Excursion::range);
    if range <= 0.0 {
        return Ok(Vec::new());
    }
    let c = writer.add("c", 0.0, rate, FREE, &unit);
    let per_turn = unit::product(&[("rad", 1), (&writer.unit_of(0), -1)]);
    let n = writer.add("n", 1.0, TAU / range, (RIPPLES * TAU / range, f64::INFINITY), &per_turn);
    let phase = writer.add_phase();
    let angle = Expression::Binary(Operator::Multiply, n.into(), z.into());
    writer.add_term(c.times(angle.plus(phase).apply(Function::Sin)));
    let small = writer.small();
    // Up to sixty ripples over the range, in steps of half a ripple, so that no line is missed.
    let over_range = (3..120).map(|k| PI * f64::from(k) / range);
    // What turns repeats with its turns, of which a log may hold many: a whole number of ripples a turn.
    let by_turn = unit::turn(&writer.unit_of(0)).map(|turn| TAU / turn);
    let of_turns = by_turn.into_iter().flat_map(|one| (1..=MOST_OF_TURN).map(move |k| one * f64::from(k)));
    let of_turns = of_turns.filter(|n| n * range > 120.0 * PI);
    Ok(over_range.chain(of_turns).map(|n| sinusoid(&[small, n, 0.0])).collect())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let range = planting.excursion(0).map_or(0.0, Excursion::range);
    let n = Expression::Number(6.3 * TAU / range.max(f64::MIN_POSITIVE));
    planting.add("c*sin(n*z + phase)", &[("n", n), ("phase", Expression::Number(0.7))])?;
    Ok(Some(Size::added(planting.rate_unit(), planting.rate())))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, State, System};
    use crate::progress::Silent;
    use crate::refine::Hold;
    use crate::simulate::{Excitation, Simulate};
    use faer::Mat;

    fn motor(ripple: &str) -> Model {
        Model {
            states: vec![
                State { unit: "rad".into(), ..State::new("phi", Expression::parse("om").unwrap()) },
                State {
                    unit: "rad/s".into(),
                    ..State::new("om", Expression::parse(&format!("4*u - om{ripple}")).unwrap())
                },
            ],
            controls: vec![Control::new("u")],
            ..Model::default()
        }
    }

    #[test]
    fn a_motor_that_turns_many_times_has_its_ripples_by_turn() {
        let machine = System::new(&motor(" + 6*sin(11*phi)")).unwrap();
        let runs = (0..3).map(|run| {
            let time: Vec<f64> = (0..900).map(|i| 0.01 * f64::from(i)).collect();
            let drive = |i: usize| if (i / (200 + 70 * run)).is_multiple_of(2) { 0.9 } else { 0.5 };
            let controls = Mat::from_fn(time.len(), 1, |i, _| drive(i));
            let excitation = Excitation::new(&machine, &time, controls.as_ref(), Hold::Zero).unwrap();
            let states = Simulate::default().rollout(&machine, &excitation, &[0.0, 2.0]).unwrap().outputs;
            let noise = |i: usize, c: usize| 2e-3 * (1.7 * (i * i + 31 * i * (run + 1) + 7 * c) as f64).sin();
            let values =
                Mat::from_fn(time.len(), 3, |i, c| if c < 2 { states[(i, c)] + noise(i, c) } else { controls[(i, 0)] });
            Run { name: format!("run {run}"), time, values }
        });
        let data = Dataset::new(["phi", "om", "u"].map(Channel::new).into(), runs.collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&motor(""), &train, &holdout, &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["cogging"], "{:?}", found.verdict);
        let ripples = found.causes[0].parameters.iter().find(|p| p.name == "n").unwrap().value;
        assert!((ripples - 11.0).abs() < 0.01, "{ripples}");
    }
}
