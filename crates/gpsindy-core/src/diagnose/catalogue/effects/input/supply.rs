//! The gain of a control scales with its supply.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::{Writer, keep};
use crate::error::Result;
use crate::expression::Expression;

pub(super) static DEFINITION: Definition = Definition {
    name: "supply",
    meaning: "The gain of the control varies with its supply: a voltage or a pressure.",
    family: Family::InputStatic,
    form: "u becomes u*(w/w0)",
    symbols: &["u", "w"],
    parameters: "w0: supply at which the gain is that of the model",
    signature: "the same command has more effect while the supply is high",
    places: &[Place::Supply],
    sense: &[Sense::Moves(1), Sense::NotNegative(1)],
    twins: &[
        (Effect::Drift, "the same run with a high and with a low supply"),
        (Effect::InputGain, "the same run with a high and with a low supply"),
    ],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example {
        own_start: 12.0,
        ..Example::of(
            example::CART,
            Drive::Steps,
            10.0,
            "v",
            &[("v", "2*u*(w/12) - 0.8*v"), ("w", "0.8*(12 - 5*abs(u) - w)")],
        )
    },
    in_mjcf: None,
    about: "It is tested only if the model declares a logged control that none of its equations uses, or a voltage or pressure that the equations of the control do not use: the column of the supply. The equation of a supply that is a state keeps the control as it is.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let usual = writer.excursion(1).map_or(1.0, |e| 0.5 * (e.low + e.high));
    let unit = writer.unit_of(1);
    let w0 = writer.add("w0", usual, usual, (0.1 * usual, 10.0 * usual), &unit);
    let scaled = writer.form("u*(w/w0)", &[("w0", w0)])?;
    // What draws on a supply that is a state is the model's own.
    writer.replace_beside(1, &drive.name, &scaled);
    Ok([1.0, 0.8, 1.25].map(|part| keep(&[part * usual])).into())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    let usual = planting.excursion(1).map_or(1.0, |e| 0.5 * (e.low + e.high));
    let swing = Expression::variable(planting.name(1)).over(Expression::Number(usual)).minus(Expression::Number(1.0));
    let symbols = [("u", Expression::variable(planting.name(0))), ("swing", swing)];
    let scaled = planting.written("u + c*swing*u", "c", &symbols)?;
    planting.replace_beside(1, &planting.name(0), &scaled);
    Ok(Some(Size::within("c", String::new(), (0.05, 1.0), "the control follows the whole swing of its supply")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::model_of;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::Control;
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A ram whose force goes with the pressure `p`, which the valve `u` draws down alike at every pressure; 50 Hz.
    fn ram(run: u64) -> Run {
        const FINE: f64 = 0.02 / 20.0;
        let mut random = ChaCha8Rng::seed_from_u64(run);
        let time: Vec<f64> = (0..600).map(|i| 0.02 * f64::from(i)).collect();
        let (mut v, mut p, mut values) = (0.0, 90.0, Mat::zeros(time.len(), 3));
        for i in 0..time.len() {
            let u = ((i as u64 / 40 * 7 + 3 * run) % 9) as f64 / 4.0 - 1.0;
            values[(i, 0)] = v + 0.01 * normal(&mut random);
            values[(i, 1)] = p + 0.1 * normal(&mut random);
            values[(i, 2)] = u;
            for _ in 0..20 {
                v += FINE * (4.0 * u * p / 80.0 - v);
                p += FINE * (0.5 * (100.0 - p) - 25.0 * u * u);
            }
        }
        Run { name: format!("{run}"), time, values }
    }

    #[test]
    fn a_supply_that_is_a_state_is_named_alone_and_its_own_equation_keeps_the_control() {
        let rates = [("v", "m/s", "4*u - v"), ("p", "bar", "0.5*(100 - p) - 25*u^2")];
        let mut model = model_of(&rates);
        model.controls = vec![Control::new("u")];
        let data = Dataset::new(["v", "p", "u"].map(Channel::new).into(), (0..4).map(ram).collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let causes: Vec<_> = found.included().map(|c| (c.effect.as_str(), c.parameters[0].value)).collect();
        assert!(matches!(causes[..], [("supply", w0)] if (w0 - 80.0).abs() < 1.0), "{causes:?}");
    }
}
