use super::*;
use crate::expression::Expression;
use crate::model::{Control, Model, State, System};

#[test]
fn a_play_drags_its_output_along_once_the_gap_is_used_up() {
    let signal = [0.0, 0.4, 1.0, 0.8, 0.1, 0.5];
    let mut path: Vec<[f64; 1]> = Vec::new();
    for value in signal {
        path.push(played(path.last(), &[value], &[1.0]));
    }
    // Half a unit behind, on either side.
    assert_eq!(path.concat(), [0.0, 0.0, 0.5, 0.5, 0.5, 0.5]);
    assert_eq!(played(Some(&[0.5]), &[-0.2], &[1.0]), [0.3]);
}

#[test]
fn a_rate_limit_ramps_to_a_held_signal_and_waits_there() {
    let (system, log) = (system("slew(u, 2)"), log(vec![0.0, 1.0, 2.0, 3.0, 4.0], vec![0.0, 3.0, 3.0, 2.5, 2.5]));
    let mut slewed = Histories::<1>::new(system.inputs(), &log, Hold::Zero, &[]);
    slewed.rewind(0);
    let mut step = |sample: usize| {
        let mut stages = [[[f64::NAN]; 3]];
        slewed.step(sample, log.time[sample], log.time[sample + 1], &mut stages);
        stages[0].concat()
    };
    assert_eq!([step(0), step(1)].concat(), [0.0, 0.0, 0.0, 0.0, 1.0, 2.0]);
    // Halfway it has caught up: 2.5 in the first half on average, then 3; later a quarter of the way, 2.75 and then 2.5.
    for (sample, mean) in [(2, 2.75), (3, 2.5625)] {
        let [begin, middle, end] = step(sample)[..] else { unreachable!() };
        assert!(((begin + 4.0 * middle + end) / 6.0 - mean).abs() < 1e-12, "{mean}");
    }
}

#[test]
fn what_is_behind_a_rate_limit_sees_its_ramps() {
    let (system, log) = (system("slew(delay(u, 0.5), 2)"), log(vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 0.0, 4.0, 4.0]));
    let mut late = Histories::<1>::new(system.inputs(), &log, Hold::Zero, &[]);
    late.rewind(2);
    let mut stages = [[[f64::NAN]; 3]; 2];
    late.step(2, 2.0, 3.0, &mut stages);
    // The ramp from 0 at 2 s begins half a second later, and its corner is on the way.
    let [begin, middle, end] = stages[1].map(|[value]| value);
    assert!(begin.abs() < 1e-12 && middle.abs() < 1e-12 && (end - 1.0).abs() < 1e-12, "{:?}", stages[1]);
}

fn system(rate: &str) -> System {
    Model {
        states: vec![State::new("x", Expression::parse(rate).unwrap())],
        controls: vec![Control::new("u")],
        ..Model::default()
    }
    .compile()
    .unwrap()
}

fn log(time: Vec<f64>, u: Vec<f64>) -> Log {
    Log { name: "log".into(), time, controls: vec![u], measured: Vec::new(), ..Log::default() }
}

#[test]
fn a_late_held_input_enters_a_step_by_its_mean() {
    let (system, log) = (system("delay(u, 0.25)"), log(vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 4.0, 4.0, 4.0]));
    let mut late = Histories::<1>::new(system.inputs(), &log, Hold::Zero, &[]);
    late.rewind(1);
    let mut step = |sample: usize| {
        let mut stages = [[[0.0]; 3]];
        late.step(sample, log.time[sample], log.time[sample + 1], &mut stages);
        stages[0]
    };
    // From 0.75 to 1.75 the input is at 4 for three quarters.
    assert_eq!(step(1), [[3.0]; 3]);
    assert_eq!(step(2), [[4.0]; 3]);
}

/// A rollout from within a log, in spans of any length, reads what one of the whole log reads; and little of it is in memory.
#[test]
fn a_part_of_a_long_log_gives_what_the_whole_gives() {
    let count = 5 * BLOCKS.1 / 2;
    let time: Vec<f64> = (0..count).map(|i| 0.01 * i as f64 + 0.002 * (0.3 * i as f64).sin()).collect();
    let u: Vec<f64> = (0..count).map(|i| (0.013 * i as f64).sin() + 0.5 * (0.0071 * i as f64).cos()).collect();
    let log = log(time.clone(), u);
    for rate in [
        "delay(u, 0.137)",
        "delay(u, -0.05)",
        "play(u, 0.4)",
        "sample_hold(u, 0.33, 0.1)",
        "delay(play(u, 0.4), 0.137)",
        "play(delay(u, 2.5), 0.4)",
        "slew(u, 0.3)",
        "slew(delay(u, 2.5), 0.3)",
        "play(slew(u, 0.3), 0.1)",
        "sample_hold(delay(u, 0.3), 0.07, 0.01)",
        "delay(sample_hold(u, 0.7, 0), 0.3)",
    ] {
        let system = system(rate);
        let inputs = system.inputs().len();
        for hold in [Hold::Zero, Hold::Linear] {
            let values = |histories: &mut Histories<'_, 1>, span: Range<usize>| {
                histories.rewind(span.start);
                let mut all = Vec::new();
                for k in span {
                    let mut stages = vec![[[f64::NAN]; 3]; inputs];
                    histories.step(k, time[k], time[k + 1], &mut stages);
                    all.push(stages[inputs - 1]);
                }
                all
            };
            let fresh = || Histories::<1>::new(system.inputs(), &log, hold, &[]);
            let mut whole = fresh();
            let reference = values(&mut whole, 0..count - 1);
            // One that looks ahead is in memory as a whole.
            let most = if whole.is_ahead { count } else { BLOCKS.1 + 600 };
            assert!(whole.kept.len() <= most, "{rate}: {:?}", whole.kept);
            let mut some = fresh();
            // Forwards, backwards, and one step after the other.
            for span in [
                3 * BLOCKS.1 / 2..3 * BLOCKS.1 / 2 + 900,
                70..140,
                2 * BLOCKS.1..2 * BLOCKS.1 + 1,
                2 * BLOCKS.1 + 1..2 * BLOCKS.1 + 2,
            ] {
                let part = values(&mut some, span.clone());
                for (k, (found, expected)) in span.clone().zip(part.iter().zip(&reference[span])) {
                    let far = (0..3).map(|i| (found[i][0] - expected[i][0]).abs()).fold(0.0, f64::max);
                    assert!(far < 1e-9, "{rate}, {hold:?}, {k}: {found:?} {expected:?}");
                }
            }
        }
    }
}
