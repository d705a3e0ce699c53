//! The column repeats its last value until the sensor's next sample.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::expression::{Expression, Function};

pub(super) static DEFINITION: Definition = Definition {
    name: "sensor hold",
    meaning: "The column repeats the last value of a sensor that is slower than the log.",
    family: Family::Sensor,
    form: "the column reads sample_hold(state, T, phase)",
    symbols: &[],
    parameters: "T: period of the sensor, s, phase: a time at which it samples, s",
    signature: "one column moves in steps of one length in time, half a period late on average",
    places: &[Place::Sensor],
    sense: &[],
    twins: &[
        (Effect::SensorDelay, "fast motion, logged at ten times the rate of the sensor"),
        (Effect::SensorFilter, "fast motion, logged at ten times the rate of the sensor"),
    ],
    traits: Traits { reads_the_past: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::sensor(example::SPRING, Drive::Released, 8.0, "x", "sample_hold(x, 0.4, 0)"),
    in_mjcf: None,
    about: "Where a column shows its last reading again until the next one, with its noise, period and phase begin at what the repeats show, and a reading counts once however often it is repeated. Else period and phase are found by trial, because the values that are shown change in jumps when they move. The other parameters are then fitted as always. Where the repeats show that the sensor's clock begins anew with each run, each run has a moment of its own, and the phase counts from there; else all runs share the clock of the log, and runs that each begin at 0 s are taken to begin alike. A period of two samples of the log is the shortest that is tried. A log that leaves cells empty until the sensor's next sample needs no such effect.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let name = writer.model.states[writer.hypothesis.state].name.clone();
    let (period, phase) = writer.add_sampling();
    let held = Expression::Call(Function::SampleHold, vec![Expression::variable(name.clone()), period, phase]);
    writer.read_as(writer.reads().substitute(&name, &held));
    Ok(writer.samplings())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.see_as("sample_hold(x, T, 0)", "T")?;
    Ok(Some(planting.late().called("T")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::Dataset;
    use crate::diagnose::fixture::{slider, slider_model};
    use crate::diagnose::report::{Diagnosis, Verdict};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::Model;
    use crate::progress::Silent;

    const CELL: usize = 14;

    /// Logs of `v' = u - 3 v` whose place is read at every so-many-th sample, with noise, from the third on; `later`: by how many samples
    /// later in each run than in the one before.
    fn logs(seed: u64, later: usize) -> Dataset {
        let rate = |_: f64, v: f64, u: f64| u - 3.0 * v;
        let input = |time: f64, run: f64| 5.0 * (0.9 * time + run).sin() + 3.0 * (2.3 * time + 2.0 * run).sin();
        let data = slider(seed, rate, input, [0.06, 0.02], 500);
        let mut runs = data.runs().to_vec();
        for (number, run) in runs.iter_mut().enumerate() {
            for i in 1..run.n_samples() {
                if i % CELL != (3 + later * number) % CELL {
                    run.values[(i, 0)] = run.values[(i - 1, 0)];
                }
            }
        }
        Dataset::new(data.channels().to_vec(), runs).unwrap()
    }

    fn found(model: &Model, seed: u64, later: usize) -> Diagnosis {
        let (train, holdout) = hold_out(&logs(seed, later)).unwrap();
        Diagnose::default().run(model, &train, &holdout, &Silent).unwrap().diagnosis
    }

    #[test]
    fn a_sensor_that_holds_its_readings_and_their_noise_is_all_that_a_log_shows() {
        // On one clock for all runs, and on one that begins anew with each.
        for later in [0, 4] {
            let found = found(&slider_model("u - 3*v"), 1, later);
            let names: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
            let expected = (&["sensor_hold"][..], Verdict::Explained);
            assert_eq!((names.as_slice(), found.verdict), expected, "{later} {:?}", found.checks);
            let cause = found.included().next().unwrap();
            assert!((cause.parameters[0].value - 0.02 * CELL as f64).abs() < 2e-3, "{:?}", cause.parameters);
            let is_said = found.notes.iter().any(|note| note.contains("at moments of its own in each run"));
            assert_eq!(is_said, later != 0, "{:?}", found.notes);
        }
    }

    #[test]
    fn a_model_that_knows_of_the_hold_has_no_gap() {
        let mut model = slider_model("u - 3*v");
        model.states[0].measured = Some(Expression::parse("sample_hold(x, 0.28, 0.06)").unwrap());
        let alarms = (1..=6).filter(|&seed| found(&model, seed, 0).gap.detected).count();
        // Two or more of six have a chance of 0.03 at a level of 5 %.
        assert!(alarms < 2, "{alarms}");
    }
}
