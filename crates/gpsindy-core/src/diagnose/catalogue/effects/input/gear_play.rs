//! Play between two places.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::State;

pub(super) static DEFINITION: Definition = Definition {
    name: "gear play",
    meaning: "Play between two moving parts: one moves some way without the other.",
    family: Family::Memory,
    form: "p - q becomes dead_zone(p - q, c), and within the play 1 - l of the difference of their speeds is left",
    symbols: &["p", "q"],
    parameters: "c: half width of the play, l: share of the damping between the parts that acts only in contact",
    signature: "after a reversal, one part first moves alone",
    places: &[Place::Gap],
    sense: &[],
    twins: &[
        (Effect::Backlash, "log both sides of the gear, or reverse under a light load"),
        (Effect::ParameterError, "small and large loads"),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::GEARS,
        Drive::Steps,
        8.0,
        "b",
        &[("a", "4*u - a - 20*dead_zone(p - q, 0.3)"), ("b", "20*dead_zone(p - q, 0.3) - 0.6*b")],
    ),
    in_mjcf: None,
    about: "It is tested if an equation contains the difference of two positions, such as that of a spring between two masses. Where one also contains the difference of their speeds, that damper may act in contact only. Of a position servo without a speed of its own, `q' = (u - q)/tau`, it is the error within which the joint does not move: its dead band, or dry friction, look the same.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let range = |index: usize| writer.excursion(index).map_or(1.0, Excursion::range);
    let travel = range(0).min(range(1));
    // A shaft turns many times while it is twisted by a hundredth of a turn.
    let twist = writer.range_between(0, 1).unwrap_or(travel).clamp(1e-6 * travel, travel);
    let unit = writer.unit_of(0);
    let c = writer.add("c", 0.0, (0.01 * travel).min(0.5 * twist), (0.0, travel), &unit);
    let [p, q] = [writer.variable(0)?, writer.variable(1)?];
    let gap = [p.clone().minus(q.clone()), q.minus(p)];
    let loose = |gap: &Expression| Expression::Call(Function::DeadZone, vec![gap.clone(), c.clone()]);
    let damper = speeds(writer).filter(|damper| {
        let stands = |state: &State| damper.iter().any(|difference| has(&state.equation, difference));
        writer.model.states.iter().any(stands)
    });
    let free = match damper.is_some() {
        true => {
            let l = writer.add("l", 0.0, 0.1, (0.0, 1.0), "");
            let inside = writer.form("1 - step(abs(p - q) - c)", &[("c", c.clone())])?;
            Some(writer.form("1 - l*inside", &[("l", l), ("inside", inside)])?)
        }
        false => None,
    };
    for state in &mut writer.model.states {
        state.equation = state.equation.map(&|part| match (&free, &damper) {
            _ if gap.contains(&part) => loose(&part),
            (Some(free), Some(damper)) if damper.contains(&part) => part.times(free.clone()),
            _ => part,
        });
    }
    let smallest = (0.002 * travel).min(0.05 * twist);
    let sizes = std::iter::successors(Some(smallest), |size| Some(2.7 * size)).take_while(|size| *size < 0.3 * travel);
    Ok(match damper {
        Some(_) => sizes.flat_map(|c| [keep(&[c, 0.0]), keep(&[c, 1.0])]).collect(),
        None => sizes.map(|c| keep(&[c])).collect(),
    })
}

/// The difference of the speeds of the two parts, either way round; none where the model has no speeds for them.
fn speeds(writer: &Writer<'_>) -> Option<[Expression; 2]> {
    let speed = |index: usize| {
        let place = writer.model.state_index(writer.hypothesis.variables.get(index)?)?;
        let rate = &writer.model.states[place].equation;
        matches!(rate, Expression::Variable(name) if writer.model.state_index(name).is_some()).then(|| rate.clone())
    };
    let (p, q) = (speed(0)?, speed(1)?);
    Some([p.clone().minus(q.clone()), q.minus(p)])
}

/// Whether an expression has another one as a part.
fn has(expression: &Expression, wanted: &Expression) -> bool {
    let mut found = false;
    expression.visit(&mut |part| found |= part == wanted);
    found
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let (one, other) = (Expression::variable(planting.name(0)), Expression::variable(planting.name(1)));
    let size = planting.size.clone();
    for state in &mut planting.model.states {
        state.equation = state.equation.map(&|part| match &part {
            Expression::Binary(Operator::Subtract, a, b)
                if [&one, &other].contains(&&**a) && [&one, &other].contains(&&**b) =>
            {
                let kept = Expression::Call(Function::Clamp, vec![part.clone(), size.clone().negated(), size.clone()]);
                part.clone().minus(kept)
            }
            _ => part,
        });
    }
    let travel = planting.excursion(0).map_or(1.0, Excursion::range);
    Ok(Some(Size::within("c", planting.unit_of(0), (1e-3 * travel, 0.5 * travel), "half of the travel")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::model_of;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::{Control, Parameter};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A joint that goes to its command within 60 ms and stops `dead` short of it; 50 Hz.
    fn joint(run: u64, dead: f64) -> Run {
        const FINE: f64 = 0.02 / 20.0;
        let mut random = ChaCha8Rng::seed_from_u64(run);
        let time: Vec<f64> = (0..500).map(|i| 0.02 * f64::from(i)).collect();
        let (mut q, mut values) = (0.0_f64, Mat::zeros(time.len(), 2));
        for (i, &t) in time.iter().enumerate() {
            let u = 0.4 * (1.3 * t + run as f64).sin() + if ((t / 1.7) as u64).is_multiple_of(2) { 0.2 } else { -0.1 };
            (values[(i, 0)], values[(i, 1)]) = (q + 0.001 * normal(&mut random), u);
            for _ in 0..20 {
                let error = u - q;
                q += (1.0 - (-FINE / 0.06).exp()) * (error - error.clamp(-dead, dead));
            }
        }
        Run { name: format!("{run}"), time, values }
    }

    #[test]
    fn the_dead_band_of_a_servo_without_a_speed_is_play_and_no_friction_of_its_place() {
        let mut model = model_of(&[("q", "rad", "(u - q)/tau")]);
        model.controls = vec![Control { unit: "rad".into(), ..Control::new("u") }];
        model.parameters = vec![Parameter::new("tau", 0.06)];
        let found = |dead: f64| {
            let runs = (0..4).map(|run| joint(run, dead)).collect();
            let data = Dataset::new(["q", "u"].map(Channel::new).into(), runs).unwrap();
            let (train, holdout) = hold_out(&data).unwrap();
            let settings = Diagnose { hold: Some(crate::refine::Hold::Zero), ..Diagnose::default() };
            settings.run(&model, &train, &holdout, &Silent).unwrap().diagnosis
        };
        let loose = found(0.02);
        let causes: Vec<_> = loose.included().map(|c| (c.effect.as_str(), c.parameters[0].value)).collect();
        assert!(matches!(causes[..], [("gear_play", c)] if (c - 0.02).abs() < 0.001), "{causes:?}");
        assert!(loose.causes.iter().all(|cause| !cause.effect.ends_with("_friction")), "{:?}", loose.causes);
        assert_eq!(found(0.0).verdict, Verdict::NoGap);
    }
}
