//! Machines whose command or second sensor has a clock of its own, off by a known time.

use super::*;
use crate::progress::Silent;
use gpsindy_beside::{at_most, draws};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

struct Draw(ChaCha8Rng);

impl Draw {
    fn uniform(&mut self) -> f64 {
        crate::random::uniform(&mut self.0)
    }

    fn normal(&mut self) -> f64 {
        crate::random::normal(&mut self.0)
    }
}

/// Columns and their stamps on the machine's own clock.
struct Log {
    state: Vec<f64>,
    angle: Vec<f64>,
    rate: Vec<f64>,
    command: Vec<f64>,
    torque: Vec<f64>,
    gyro: Vec<f64>,
}

/// A pendulum with dry and viscous friction under random torques: angle and rate at 100 Hz, torques at 50 Hz from an odd
/// moment on, a gyro at 200 Hz. Stamps jitter by a tenth of a period.
fn pendulum(seed: u64, seconds: f64) -> Log {
    const STEP: f64 = 1e-4;
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed));
    let stamps = |period: f64, begin: f64, draw: &mut Draw| -> Vec<f64> {
        let count = (seconds / period) as usize;
        (0..count).map(|i| begin + period * (i as f64 + 0.1 * draw.uniform())).collect()
    };
    let state = stamps(0.01, 0.0, &mut draw);
    let command = stamps(0.02, 0.0037, &mut draw);
    let fast = stamps(0.005, 0.0, &mut draw);
    let mut torque = Vec::new();
    let (mut level, mut hold) = (0.0, 0);
    for _ in 0..command.len() {
        if hold == 0 {
            (level, hold) = (2.0 * draw.normal(), 3 + (20.0 * draw.uniform()) as usize);
        }
        hold -= 1;
        torque.push(level);
    }
    let (mut phi, mut omega, mut k) = (draw.normal(), 0.0, 0);
    let (mut angle, mut rate, mut gyro) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..(seconds / STEP) as usize {
        let t = i as f64 * STEP;
        while k + 1 < command.len() && command[k + 1] <= t {
            k += 1;
        }
        if angle.len() < state.len() && state[angle.len()] <= t {
            angle.push(phi + 0.002 * draw.normal());
            rate.push(omega + 0.02 * draw.normal());
        }
        if gyro.len() < fast.len() && fast[gyro.len()] <= t {
            gyro.push(1.1 * omega + 0.3 + 0.05 * draw.normal());
        }
        let u = if command[0] <= t { torque[k] } else { torque[0] };
        let pull = -9.81 * f64::sin(phi) - 0.2 * omega - 0.3 * f64::tanh(omega / 0.05) + 2.0 * u;
        // By the mean of both rates: else angle and rate would lie half a step apart.
        phi += STEP * (omega + 0.5 * STEP * pull);
        omega += STEP * pull;
    }
    Log { state: state[..angle.len()].to_vec(), angle, rate, command, torque, gyro }
}

fn signal<'a>(name: &'a str, times: &'a [f64], values: &'a [f64], control: bool) -> Signal<'a> {
    Signal {
        name,
        times: &times[..values.len().min(times.len())],
        values: &values[..times.len().min(values.len())],
        control,
    }
}

const LEVEL: f64 = 0.95;

/// Whether so many of `count` intervals at [`LEVEL`] may hold the truth.
fn is_at_level(held: u64, count: u64) -> bool {
    (count - held) as usize <= at_most(1.0 - LEVEL, count)
}

#[test]
fn the_interval_of_a_command_topics_offset_holds_the_truth_at_its_level() {
    let (mut held, mut widest, count) = (0, 0.0_f64, draws(12, 40));
    for seed in 0..count {
        let log = pendulum(seed, 20.0);
        let truth = 0.4 * f64::sin(seed as f64);
        let early: Vec<f64> = log.command.iter().map(|t| t - truth).collect();
        let own = [signal("u", &early, &log.torque, true)];
        let states = [signal("phi", &log.state, &log.angle, false), signal("omega", &log.state, &log.rate, false)];
        let found = clock_offset(&own, &states, LEVEL, &Silent).unwrap();
        assert!(found.driven && found.column == "u", "{found:?}");
        assert!((found.seconds - truth).abs() < 0.01, "{truth}: {found:?}");
        held += u64::from(found.low <= truth && truth <= found.high);
        widest = widest.max(found.high - found.low);
    }
    assert!(is_at_level(held, count) && widest < 0.02, "{held} {widest}");
}

#[test]
fn the_interval_of_a_second_sensors_offset_holds_the_truth_at_its_level() {
    let (mut held, mut widest, count) = (0, 0.0_f64, draws(12, 40));
    for seed in 0..count {
        let log = pendulum(100 + seed, 12.0);
        let truth = 0.5 * f64::cos(seed as f64);
        let fast: Vec<f64> = (0..log.gyro.len()).map(|i| i as f64 * 0.005).collect();
        let early: Vec<f64> = fast.iter().map(|t| t - truth).collect();
        let own = [signal("w", &early, &log.gyro, false)];
        let states = [signal("phi", &log.state, &log.angle, false)];
        let found = clock_offset(&own, &states, LEVEL, &Silent).unwrap();
        assert!(!found.driven, "{found:?}");
        // Stamps of the gyro jitter by up to 0.5 ms, on average 0.25 ms late, and are taken as regular here.
        let truth = truth + 0.000_25;
        held += u64::from(found.low <= truth && truth <= found.high);
        widest = widest.max(found.high - found.low);
    }
    assert!(is_at_level(held, count) && widest < 0.01, "{held} {widest}");
}

#[test]
fn the_offset_of_the_states_is_that_of_the_command_with_the_other_sign() {
    let log = pendulum(1, 20.0);
    let command = [signal("u", &log.command, &log.torque, true)];
    let late: Vec<f64> = log.state.iter().map(|t| t + 0.2).collect();
    let states = [signal("phi", &late, &log.angle, false), signal("omega", &late, &log.rate, false)];
    let found = clock_offset(&states, &command, LEVEL, &Silent).unwrap();
    assert!((found.seconds + 0.2).abs() < 0.005 && found.column == "omega" && found.other == "u", "{found:?}");
    let back = clock_offset(&command, &states, LEVEL, &Silent).unwrap();
    assert!((found.seconds + back.seconds).abs() < 1e-9, "{found:?} {back:?}");
}

#[test]
fn columns_that_say_nothing_of_each_other_are_refused() {
    let log = pendulum(1, 20.0);
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(9));
    let noise: Vec<f64> = log.torque.iter().map(|_| draw.normal()).collect();
    let states = [signal("phi", &log.state, &log.angle, false), signal("omega", &log.state, &log.rate, false)];
    let refused = clock_offset(&[signal("u", &log.command, &noise, true)], &states, LEVEL, &Silent).unwrap_err();
    assert!(refused.to_string().contains("give the offset in seconds"), "{refused}");
    let flat = vec![1.0; log.command.len()];
    let refused = clock_offset(&[signal("u", &log.command, &flat, true)], &states, LEVEL, &Silent).unwrap_err();
    assert!(refused.to_string().contains("no column that changes"), "{refused}");
}

#[test]
fn a_motion_that_repeats_itself_has_many_offsets() {
    let times: Vec<f64> = (0..3000).map(|i| f64::from(i) * 0.01).collect();
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(4));
    let mut wave = || times.iter().map(|t| (6.0 * t).sin() + 0.01 * draw.normal()).collect::<Vec<f64>>();
    let (a, b) = (wave(), wave());
    let (a, b) = (signal("a", &times, &a, false), signal("b", &times, &b, false));
    let refused = clock_offset(&[a], &[b], LEVEL, &Silent).unwrap_err().to_string();
    assert!(refused.contains("repeats itself"), "{refused}");
}
