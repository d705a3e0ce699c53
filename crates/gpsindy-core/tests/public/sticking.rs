//! Diagnosis of a drive whose friction truly holds it at rest, simulated by code of its own in short steps.
#![allow(clippy::unwrap_used)]

use gpsindy_beside::random::Random;
use gpsindy_core::diagnose::{Diagnose, Verdict};
use gpsindy_core::faer::Mat;
use gpsindy_core::{Channel, Control, Dataset, Expression, Model, Parameter, Run, Silent, State};

const PERIOD: f64 = 0.02;
const STEPS: usize = 40;

/// Speed and torque of `w' = 10 u - 0.5 w`, with friction of 1.5 rad/s^2 that stops it within a step where it can.
fn run(seed: u64) -> Run {
    let mut noise = Random::new(seed);
    let mut w: f64 = 0.0;
    let mut values = Mat::zeros(400, 2);
    for i in 0..400 {
        let t = PERIOD * i as f64;
        let u = 0.8 * (1.3 * t + seed as f64).sin() + 0.5 * (0.7 * t + 2.0 * seed as f64).sin().signum();
        values[(i, 0)] = w + 0.02 * noise.normal();
        values[(i, 1)] = u;
        for _ in 0..STEPS {
            let h = PERIOD / STEPS as f64;
            let free = w + h * (10.0 * u - 0.5 * w);
            w = (free.abs() - 1.5 * h).max(0.0).copysign(free);
        }
    }
    Run { name: format!("run {seed}"), time: (0..400).map(|i| PERIOD * f64::from(i)).collect(), values }
}

#[test]
fn coulomb_friction_that_holds_a_drive_is_named_with_its_level_and_without_a_corner() {
    let model = Model {
        states: vec![State { unit: "rad/s".into(), ..State::new("w", Expression::parse("k*u - d*w").unwrap()) }],
        controls: vec![Control::new("u")],
        parameters: vec![Parameter::new("k", 10.0), Parameter::new("d", 0.5)],
        ..Model::default()
    };
    let data = |seeds: std::ops::Range<u64>| {
        Dataset::new(vec![Channel::new("w"), Channel::new("u")], seeds.map(run).collect()).unwrap()
    };
    let found = Diagnose::default().run(&model, &data(1..4), &data(4..5), &Silent).unwrap();
    assert_eq!(found.diagnosis.verdict, Verdict::Explained, "{:?}", found.diagnosis.causes);
    let included: Vec<_> = found.diagnosis.causes.iter().filter(|c| c.included).collect();
    assert_eq!(included.len(), 1, "{included:?}");
    assert_eq!(included[0].effect, "coulomb_friction");
    let [level, corner] = &included[0].parameters[..] else { panic!("{included:?}") };
    let width = level.high.unwrap() - level.low.unwrap();
    // An interval of 95 % misses the truth once in 20 times; four deviations, none of 15,000.
    assert!((level.value - 1.5).abs() < width && width < 0.05, "{level:?}");
    assert_eq!(corner.value, 0.0);
}
