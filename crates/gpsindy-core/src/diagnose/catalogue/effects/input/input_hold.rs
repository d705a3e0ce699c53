//! The control acts in steps of the controller's own period.

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
    name: "input hold",
    meaning: "The actuator takes a command once per period of its own and holds it until the next.",
    family: Family::InputDynamic,
    form: "u becomes sample_hold(u, T, phase)",
    symbols: &["u"],
    parameters: "T: period, s, phase: a time at which it takes a command, s",
    signature: "the machine follows a smooth command in steps, half a period late on average",
    places: &[Place::Control],
    sense: &[],
    twins: &[
        (Effect::InputDelay, "a fast chirp, logged at ten times the rate of the controller"),
        (Effect::InputLag, "a fast chirp, logged at ten times the rate of the controller"),
        (Effect::SensorHold, "log an echo of the command or a second sensor"),
    ],
    traits: Traits { imitated_by_hold: true, ..Traits::PLAIN },
    write,
    plant,
    reported: as_fitted,
    example: Example::of(example::CART, Drive::Sine(3.0, 1.0), 10.0, "v", &[("v", "2*sample_hold(u, 0.8, 0) - 0.8*v")]),
    in_mjcf: None,
    about: "Period and phase are found by trial, because what is held changes in jumps when they move; where the jitter of a hold shows in what a model leaves, by all logs together, the trials begin there. The other parameters are then fitted as always. All runs share the clock of the log: runs that each begin at 0 s are taken to begin alike. A period of two samples of the log is the shortest that is tried. Jitter of the period is not modelled.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let drive = writer.drive()?;
    let (period, phase) = writer.add_sampling();
    writer.replace(&drive.name, &Expression::Call(Function::SampleHold, vec![drive.u, period, phase]));
    Ok(writer.samplings())
}

fn plant(planting: &mut Planting<'_>) -> Result<Option<Size>> {
    planting.drive("sample_hold(u, T, 0)", "T")?;
    Ok(Some(planting.late().called("T")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::slider_model;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::sampled_at;
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    const STEP: f64 = 0.02;
    const FINE: usize = 20;

    /// Logs of a spring under a smooth drive that is held with this period and phase, beside a periodic push; four runs on one clock.
    fn logs(period: f64, phase: f64) -> Dataset {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let drive = |t: f64| 2.0 * (1.7 * t).sin() + 1.5 * (3.1 * t + 1.0).sin() + (5.3 * t).cos();
        let runs = (0..4).map(|run| {
            let time: Vec<f64> = (0..700).map(|i| STEP * f64::from(i + 730 * run)).collect();
            let (mut x, mut v, mut values) = (0.0, 0.0, Mat::zeros(time.len(), 3));
            for (i, &t) in time.iter().enumerate() {
                let read = [x + 0.02 * normal(&mut random), v + 0.04 * normal(&mut random), drive(t)];
                read.iter().enumerate().for_each(|(c, value)| values[(i, c)] = *value);
                let h = STEP / FINE as f64;
                for k in 0..FINE {
                    let middle = t + (k as f64 + 0.5) * h;
                    let taken = sampled_at(middle, phase, period).max(time[0]);
                    // The log's command is held between its samples.
                    let command = drive(STEP * (taken / STEP + 1e-6).floor());
                    let push = 0.4 * (1.3 * middle + 0.5).sin();
                    let rate = |x: f64, v: f64| command + push - 2.0 * x - v;
                    let (half_x, half_v) = (x + 0.5 * h * v, v + 0.5 * h * rate(x, v));
                    x += h * half_v;
                    v += h * rate(half_x, half_v);
                }
            }
            Run { name: format!("run {run}"), time, values }
        });
        Dataset::new(["x", "v", "u"].map(Channel::new).into(), runs.collect()).unwrap()
    }

    #[test]
    fn a_weak_hold_is_found_beside_another_cause_in_its_equation() {
        let (train, holdout) = hold_out(&logs(0.187, 0.03)).unwrap();
        let found = Diagnose::default().run(&slider_model("u - 2*x - v"), &train, &holdout, &Silent).unwrap().diagnosis;
        let mut causes: Vec<(&str, f64)> =
            found.included().map(|cause| (cause.effect.as_str(), cause.parameters[0].value)).collect();
        causes.sort_by(|a, b| a.0.cmp(b.0));
        let names: Vec<&str> = causes.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["input_hold", "periodic_disturbance"], "{causes:?}");
        // Over 44 s the moments are right within a third of a period.
        assert!((causes[0].1 - 0.187).abs() * 44.0 / 0.187 < 0.06, "{causes:?}");
    }
}
