use super::*;
use crate::expression::Expression;
use crate::model::{Control, Model, State};

fn system(equation: &str) -> System {
    Model {
        states: vec![State::new("x", Expression::parse(equation).unwrap())],
        controls: vec![Control::new("u"), Control::new("w")],
        ..Model::default()
    }
    .compile()
    .unwrap()
}

fn excitation(system: &System, u: &[f64], hold: Hold) -> Excitation {
    let time: Vec<f64> = (0..u.len()).map(|i| i as f64).collect();
    let controls = Mat::from_fn(u.len(), 2, |i, j| if j == 0 { u[i] } else { 1.0 });
    Excitation::new(system, &time, controls.as_ref(), hold).unwrap()
}

fn input(system: &System, excitation: &Excitation, t: f64) -> f64 {
    let mut signals = Vec::new();
    excitation.signals(system, excitation.sample_moment(t), &mut signals);
    signals[2]
}

#[test]
fn a_hold_shorter_than_a_log_could_show_is_the_signal_itself() {
    for hold in [Hold::Zero, Hold::Linear] {
        for period in ["0", "0.001"] {
            let system = system(&format!("sample_hold(u, {period}, 0) - x"));
            let excitation = excitation(&system, &[0.0, 2.0, 1.0, 4.0], hold);
            let values = [0.0, 1.0, 2.0, 2.5].map(|t| input(&system, &excitation, t));
            let halfway = if hold == Hold::Zero { 1.0 } else { 2.5 };
            for (found, expected) in values.into_iter().zip([0.0, 2.0, 1.0, halfway]) {
                assert!((found - expected).abs() < 1e-9, "{hold:?} {period}: {values:?}");
            }
        }
    }
}

#[test]
fn a_delay_shows_the_past_and_the_first_sample_before_it() {
    let system = system("delay(u, 1.5)");
    let held = excitation(&system, &[5.0, 7.0, 7.0, 9.0], Hold::Zero);
    let seen: Vec<f64> = [0.0, 1.4, 2.4, 2.6, 4.4, 4.6, 99.0].map(|t| input(&system, &held, t)).into();
    assert_eq!(seen, [5.0, 5.0, 5.0, 7.0, 7.0, 9.0, 9.0]);
    assert_eq!(held.breaks(), [1.5, 2.5, 4.5]);
    let linear = excitation(&system, &[5.0, 7.0, 7.0, 9.0], Hold::Linear);
    assert_eq!(input(&system, &linear, 2.0), 6.0);
    assert_eq!(input(&system, &linear, 1.0), 5.0);
}

#[test]
fn a_rate_limit_follows_no_faster_and_bends_where_it_has_caught_up() {
    let system = system("slew(u, 2) - x");
    let held = excitation(&system, &[0.0, 3.0, 3.0, 2.5, -9.0], Hold::Zero);
    let seen: Vec<f64> = [0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 3.1, 3.25, 4.0].map(|t| input(&system, &held, t)).into();
    for (found, expected) in seen.iter().zip([0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 2.8, 2.5, 2.5]) {
        assert!((found - expected).abs() < 1e-6, "{seen:?}");
    }
    assert_eq!(held.breaks(), [0.0, 1.0, 2.5, 3.0, 3.25, 4.0]);
    // It meets a ramp on the way: 0 + 2 t against 5 - 3 t from the first second on.
    let linear = excitation(&system, &[0.0, 5.0, 2.0, 2.0], Hold::Linear);
    let seen: Vec<f64> = [0.5, 1.0, 1.4, 1.6, 1.9, 2.0, 3.0].map(|t| input(&system, &linear, t)).into();
    for (found, expected) in seen.iter().zip([1.0, 2.0, 2.8, 3.2, 2.6, 2.4, 2.0]) {
        assert!((found - expected).abs() < 1e-6, "{seen:?}");
    }
}

/// The closed form against steps too short to matter.
#[test]
fn a_rate_limit_follows_a_line_as_short_steps_do() {
    for (from, signal, slope, rate) in [
        (0.0, 1.0, 0.5, 2.0),
        (0.0, 1.0, 3.0, 2.0),
        (1.0, 0.0, 3.0, 0.7),
        (1.0, 0.0, -0.2, 0.7),
        (0.3, 0.3, -5.0, 1.0),
        (0.0, 1.0, -4.0, 0.5),
    ] {
        let (steps, dt) = (100_000, 1.7);
        let step = dt / f64::from(steps);
        let mut output: f64 = from;
        for k in 1..=steps {
            let target = signal + slope * step * f64::from(k);
            output += (target - output).clamp(-rate * step, rate * step);
        }
        let found = slewed(from, signal, slope, rate, dt);
        assert!((found - output).abs() < 1e-3, "{from} {signal} {slope} {rate}: {found} for {output}");
    }
}

#[test]
fn a_play_starts_centred_and_follows_only_when_pushed() {
    let system = system("play(u, 2)");
    let u = [0.0, 0.5, 3.0, 2.5, 1.0, -4.0, -4.0];
    let held = excitation(&system, &u, Hold::Zero);
    let seen: Vec<f64> = (0..u.len()).map(|i| input(&system, &held, i as f64)).collect();
    assert_eq!(seen, [0.0, 0.0, 2.0, 2.0, 2.0, -3.0, -3.0]);
    let linear = excitation(&system, &u, Hold::Linear);
    // Between samples 1 and 2 the signal rises from 0.5 to 3 and begins to push at 1.
    assert!((input(&system, &linear, 1.2) - 0.0).abs() < 1e-15);
    assert!((input(&system, &linear, 1.6) - 1.0).abs() < 1e-12);
    assert!((input(&system, &linear, 4.0) - 2.0).abs() < 1e-12);
}

#[test]
fn a_delayed_play_is_the_play_delayed() {
    let nested = system("delay(play(u, 2), 2)");
    let u = [0.0, 3.0, 1.5, -4.0, 0.0, 0.0, 0.0];
    let held = excitation(&nested, &u, Hold::Zero);
    let mut signals = Vec::new();
    held.signals(&nested, held.sample_moment(3.0), &mut signals);
    assert_eq!(signals[2..], [-3.0, 2.0]);
    let other = system("play(delay(u, 2), 2)");
    let swapped = excitation(&other, &u, Hold::Zero);
    for t in [0.5, 2.5, 3.5, 4.5, 5.5, 6.5] {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        held.signals(&nested, held.sample_moment(t), &mut a);
        swapped.signals(&other, swapped.sample_moment(t), &mut b);
        assert_eq!(a[3], b[3], "at {t}");
    }
}

#[test]
fn a_sample_and_hold_shows_what_it_sampled_last_and_switches_only_then() {
    let system = system("sample_hold(u, 2, 0.5)");
    let u = [5.0, 7.0, 8.0, 9.0, 6.0, 6.0];
    let held = excitation(&system, &u, Hold::Zero);
    // Sampled at 0.5, 2.5 and 4.5 s; before that the first sample.
    let seen: Vec<f64> = [0.0, 0.6, 2.4, 2.6, 4.4, 4.6, 99.0].map(|t| input(&system, &held, t)).into();
    assert_eq!(seen, [5.0, 5.0, 5.0, 8.0, 8.0, 6.0, 6.0]);
    assert_eq!(held.breaks(), [0.5, 2.5, 4.5]);
    let linear = excitation(&system, &u, Hold::Linear);
    assert_eq!(input(&system, &linear, 1.0), 6.0);
    assert_eq!(input(&system, &linear, 2.4), 6.0);
    // A moment that meets a sample takes its new value, whatever rounding makes of it.
    let odd = super::tests::system("sample_hold(u, 0.1 + 0.2, 0)");
    let time: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
    let controls = Mat::from_fn(time.len(), 2, |i, _| i as f64);
    let met = Excitation::new(&odd, &time, controls.as_ref(), Hold::Zero).unwrap();
    for (i, &t) in time.iter().enumerate() {
        assert_eq!(input(&odd, &met, t), (i / 3 * 3) as f64, "{t}");
    }
}

#[test]
fn missing_cells_are_held_from_the_last_known_value() {
    let missing = f64::NAN;
    assert_eq!(hold_missing(&[missing, 2.0, missing, 3.0]).unwrap(), [2.0, 2.0, 2.0, 3.0]);
    assert!(hold_missing(&[missing]).is_none());
}
