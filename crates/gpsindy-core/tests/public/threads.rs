//! The bits of an answer do not depend on the number of threads.

#![allow(clippy::unwrap_used)]

use faer::Mat;
use gpsindy_core::diagnose::Diagnose;
use gpsindy_core::systems::{SensorNoise, lotka_volterra};
use gpsindy_core::{Channel, Dataset, Expression, Identify, Model, Parameter, Run, Silent, Smoother, State};

/// What `work` answers with one, two and five threads, written out: as text every bit of a number shows.
fn with_threads<T: std::fmt::Debug + Send>(work: impl Fn() -> T + Sync) -> [String; 3] {
    [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        format!("{:?}", pool.install(&work))
    })
}

fn assert_same([one, two, five]: &[String; 3]) {
    assert!(one == two && one == five);
    assert!(one.len() > 100, "{one}");
}

fn hares() -> Dataset {
    let system = lotka_volterra();
    let times: Vec<f64> = (0..150).map(|i| 0.1 * f64::from(i)).collect();
    system.sample(&times, &system.initial(), SensorNoise::Absolute(0.05), 3).unwrap()
}

#[test]
fn smoothing_gives_the_same_bits() {
    let (data, smoother) = (hares(), Smoother { covariance: true, ..Smoother::default() });
    assert_same(&with_threads(|| smoother.smooth(&data, &[0, 1], &Silent).unwrap()));
}

#[test]
fn identification_gives_the_same_bits() {
    let data = hares();
    let states = ["x1", "x2"].map(String::from).to_vec();
    let ours = Identify { states: states.clone(), ensemble: 10, ..Identify::default() };
    let paper = Identify { states, ..Identify::paper() };
    assert_same(&with_threads(|| ours.fit(&data, &Silent).unwrap()));
    assert_same(&with_threads(|| paper.fit(&data, &Silent).unwrap()));
}

/// A slider that coasts down with a drag that the simulator lacks.
fn coast(start: f64) -> Run {
    let time: Vec<f64> = (0..80).map(|i| 0.05 * f64::from(i)).collect();
    let value = |i: usize| {
        let decay = (-0.2 * time[i]).exp();
        start * decay / (1.0 + start * 0.3 / 0.2 * (1.0 - decay)) + 0.004 * ((i * i) as f64 * 1.7 + start).sin()
    };
    Run { name: format!("from {start}"), values: Mat::from_fn(80, 1, |i, _| value(i)), time }
}

#[test]
fn a_diagnosis_gives_the_same_bits() {
    let model = Model {
        name: "slider".into(),
        states: vec![State::new("v", Expression::parse("-b*v").unwrap())],
        parameters: vec![Parameter::new("b", 0.2)],
        ..Model::default()
    };
    let logs = |starts: &[f64]| {
        Dataset::new(vec![Channel::new("v")], starts.iter().map(|&start| coast(start)).collect()).unwrap()
    };
    let (train, holdout) = (logs(&[1.5, 2.5, 3.0]), logs(&[2.0]));
    let effects = ["quadratic_drag", "coulomb_friction", "bias"].map(String::from).to_vec();
    let diagnose = Diagnose { effects, ..Diagnose::default() };
    assert_same(&with_threads(|| diagnose.run(&model, &train, &holdout, &Silent).unwrap()));
}
