//! The next experiment: of drawn pairs of effects that random runs leave open, one designed run parts what it says it parts.
#![allow(clippy::unwrap_used)]

use faer::Mat;
use gpsindy_beside::random::Random;
use gpsindy_core::diagnose::{Candidate, Design, Diagnose, Diagnosed, Open};
use gpsindy_core::{
    Channel, Control, Dataset, Error, Excitation, Expression, Hold, Model, Parameter, Progress, Run, Silent, Simulate,
    State,
};
use std::sync::atomic::{AtomicUsize, Ordering};

const SAMPLES: usize = 201;
const PERIOD: f64 = 0.05;
const LIMIT: f64 = 2.0;
const NOISE: [f64; 2] = [0.01, 0.03];

/// Effects that small or slow motions cannot distinguish, and what each adds to the speed's row in place of `u`'s.
const PAIRS: [[(&str, &str); 2]; 6] = [
    [("viscous_friction", "u - c*v"), ("quadratic_drag", "u - c*v*abs(v)")],
    [("linear_stiffness", "u - c*x"), ("cubic_stiffness", "u - c*x^3")],
    [("viscous_friction", "u - c*v"), ("coulomb_friction", "u - c*tanh(v/0.01)")],
    [("input_gain", "(1 + c)*u"), ("input_bias", "u + c")],
    [("input_dead_zone", "dead_zone(u, c)"), ("coulomb_friction", "u - c*tanh(v/0.01)")],
    [("linear_stiffness", "u - c*x"), ("bias", "u - c")],
];

/// A mass on a spring with a damper, driven by `force`.
fn cart(stiffness: f64, damping: f64, force: &str, size: f64) -> Model {
    let equation = format!("{force} - k*x - b*v");
    Model {
        name: "cart".into(),
        states: vec![
            State::new("x", Expression::parse("v").unwrap()),
            State::new("v", Expression::parse(&equation).unwrap()),
        ],
        controls: vec![Control::new("u")],
        parameters: vec![Parameter::new("k", stiffness), Parameter::new("b", damping), Parameter::new("c", size)],
        ..Model::default()
    }
}

fn time() -> Vec<f64> {
    (0..SAMPLES).map(|i| PERIOD * i as f64).collect()
}

/// A run of `machine` from rest under `u`, with noise.
fn recorded(machine: &Model, name: &str, u: &[f64], random: &mut Random) -> Run {
    let system = machine.compile().unwrap();
    let controls = Mat::from_fn(SAMPLES, 1, |i, _| u[i]);
    let excitation = Excitation::new(&system, &time(), controls.as_ref(), Hold::Zero).unwrap();
    let settings = Simulate { tolerance: 1e-6, ..Simulate::default() };
    let states = settings.rollout(&system, &excitation, &[0.0, 0.0]).unwrap().states;
    let value = |i, j: usize| if j == 2 { u[i] } else { states[(i, j)] + NOISE[j] * random.normal() };
    let mut value = value;
    let mut values = Mat::zeros(SAMPLES, 3);
    for i in 0..SAMPLES {
        for j in 0..3 {
            values[(i, j)] = value(i, j);
        }
    }
    Run { name: name.into(), time: time(), values }
}

/// Random steps of one amplitude.
fn steps(random: &mut Random, amplitude: f64) -> Vec<f64> {
    let (mut level, mut left) = (0.0, 0);
    let next = |_| {
        if left == 0 {
            level = random.uniform(-amplitude, amplitude);
            left = 8 + (random.uniform(0.0, 32.0) as usize);
        }
        left -= 1;
        level
    };
    (0..SAMPLES).map(next).collect()
}

fn dataset(runs: &[&Run]) -> Dataset {
    let channels = ["x", "v", "u"].map(Channel::new).to_vec();
    Dataset::new(channels, runs.iter().map(|&run| run.clone()).collect()).unwrap()
}

/// A drawn machine, three random runs of which leave two effects open.
struct Drawn {
    nominal: Model,
    machine: Model,
    truth: &'static str,
    effects: [&'static str; 2],
    runs: Vec<Run>,
    found: Diagnosed,
    random: Random,
}

impl Drawn {
    fn diagnose(&self, train: &[&Run], holdout: &[&Run]) -> Diagnosed {
        diagnose(&self.nominal, self.effects, train, holdout)
    }
}

fn diagnose(nominal: &Model, effects: [&str; 2], train: &[&Run], holdout: &[&Run]) -> Diagnosed {
    let effects = effects.map(String::from).to_vec();
    let settings = Diagnose { effects, most_effects: 1, hold: Some(Hold::Zero), ..Diagnose::default() };
    settings.run(nominal, &dataset(train), &dataset(holdout), &Silent).unwrap()
}

/// Pairs of number `first`, `first + 1` and so on whose random runs leave them open, `count` of them.
fn drawn(first: u64, count: usize) -> Vec<Drawn> {
    let mut all = Vec::new();
    for seed in first.. {
        if all.len() == count {
            break;
        }
        let mut random = Random::new(seed);
        let pair = PAIRS[seed as usize % PAIRS.len()];
        let (truth, force) = pair[(random.bits() % 2) as usize];
        let (stiffness, damping) = (random.uniform(1.0, 6.0), random.uniform(0.3, 1.5));
        let size = random.uniform(0.05, 0.5);
        // From whispers to half of what the rig can do.
        let amplitude = LIMIT * 0.5 * random.uniform(0.1, 1.0).powi(2);
        let machine = cart(stiffness, damping, force, size);
        let mut nominal = cart(stiffness, damping, "u", 0.0);
        nominal.parameters.pop();
        let runs: Vec<Run> = (0..3)
            .map(|i| {
                let u = steps(&mut random, amplitude);
                recorded(&machine, &format!("run {i}"), &u, &mut random)
            })
            .collect();
        let effects = [pair[0].0, pair[1].0];
        let found = diagnose(&nominal, effects, &[&runs[0], &runs[1]], &[&runs[2]]);
        if found.diagnosis.included().next().is_some() && !found.open.is_empty() {
            all.push(Drawn { nominal, machine, truth, effects, runs, found, random });
        }
    }
    all
}

fn limits() -> Design {
    Design {
        limits: vec![("u".into(), -LIMIT, LIMIT)],
        rate_limits: vec![("u".into(), 40.0)],
        duration: PERIOD * (SAMPLES - 1) as f64,
        rate: 1.0 / PERIOD,
        ..Design::default()
    }
}

/// Whether the runs with one more, under `u`, name the true effect and no other.
fn is_distinguished(case: &mut Drawn, u: &[f64]) -> bool {
    let more = recorded(&case.machine, "one more", u, &mut case.random);
    let found = case.diagnose(&[&case.runs[0], &case.runs[1], &more], &[&case.runs[2]]);
    let named = found.diagnosis.included().next();
    found.open.is_empty() && named.is_some_and(|cause| cause.effect == case.truth && cause.equivalent.is_empty())
}

/// How many of the pairs a designed run parts, and how many one more random run like the others.
fn distinguished(cases: Vec<Drawn>) -> (usize, usize) {
    let (mut designed, mut random) = (0, 0);
    for mut case in cases {
        let signal = limits().run(&case.found.open, None, &Silent).unwrap();
        assert!(signal.values[0].iter().all(|u| u.abs() <= LIMIT));
        assert!(signal.values[0].windows(2).all(|w| (w[1] - w[0]).abs() <= 40.0 * PERIOD + 1e-12));
        designed += usize::from(is_distinguished(&mut case, &signal.values[0]));
        let largest = case.runs[0].column(2).iter().fold(0.0, |a: f64, u| a.max(u.abs()));
        let like_the_others = steps(&mut case.random, largest);
        random += usize::from(is_distinguished(&mut case, &like_the_others));
    }
    (designed, random)
}

#[test]
fn one_designed_run_parts_pairs_that_random_runs_leave_open() {
    let (designed, _) = distinguished(drawn(0, 4));
    assert!(designed >= 3, "{designed} of 4");
}

/// `cargo xtask long design`, which keeps the count.
#[test]
#[ignore = "takes minutes"]
fn of_24_drawn_pairs_nine_in_ten_are_distinguished() {
    let (designed, random) = distinguished(drawn(1000, 24));
    let counted = format!(
        "Of 24 drawn pairs (the first from seed 1000 on that three random runs leave open) one designed run distinguishes {designed}, \
         one more random run {random}.\n"
    );
    if let Some(record) = std::env::var_os("GPSINDY_RECORD") {
        std::fs::write(record, &counted).unwrap();
    }
    print!("{counted}");
    assert!(designed >= 22, "{designed} of 24");
}

fn open() -> Open {
    let model = |force: &str, size: f64| cart(4.0, 0.8, force, size);
    let candidate = |label: &str, model: Model| Candidate { label: label.into(), ..Candidate::of_model(model) };
    let candidates =
        vec![candidate("drag", model("u - c*v*abs(v)", 0.3)), candidate("friction", model("u - c*v", 0.15))];
    let noise = vec![("x".into(), NOISE[0]), ("v".into(), NOISE[1])];
    Open { candidates, pairs: Vec::new(), noise, start: Vec::new(), linear: false }.separating_all()
}

/// With every size known, the separation is the plain sum of squares of what the two read, less what starts take up.
#[test]
fn the_separation_that_is_told_is_the_one_that_shows() {
    let open = open();
    let signal = limits().run(&open, None, &Silent).unwrap();
    let states = |model: &Model| {
        let system = model.compile().unwrap();
        let u = Mat::from_fn(SAMPLES, 1, |i, _| signal.values[0][i]);
        let excitation = Excitation::new(&system, &time(), u.as_ref(), Hold::Zero).unwrap();
        Simulate::default().rollout(&system, &excitation, &[0.0, 0.0]).unwrap().states
    };
    let (one, other) = (states(&open.candidates[0].model), states(&open.candidates[1].model));
    let squares = |i: usize| (0..2).map(|j| ((one[(i, j)] - other[(i, j)]) / NOISE[j]).powi(2)).sum::<f64>();
    let plain = 0.5 * (0..SAMPLES).map(squares).sum::<f64>();
    // A start that is free takes up a part of it: some percent over ten seconds of a damped cart.
    let stated = signal.pairs[0].nats;
    assert!(stated <= plain * 1.001 && stated > 0.8 * plain, "{stated} of {plain}");
    assert!(signal.pairs[0].seconds.is_some_and(|s| s < 10.0));
}

#[test]
fn states_stay_within_their_bounds() {
    let free = limits().run(&open(), None, &Silent).unwrap();
    let bound = Design { bounds: vec![("x".into(), -0.2, 0.2)], ..limits() }.run(&open(), None, &Silent).unwrap();
    assert!(bound.pairs[0].nats < free.pairs[0].nats);
    for candidate in open().candidates {
        let system = candidate.model.compile().unwrap();
        let u = Mat::from_fn(SAMPLES, 1, |i, _| bound.values[0][i]);
        let excitation = Excitation::new(&system, &time(), u.as_ref(), Hold::Zero).unwrap();
        let states = Simulate::default().rollout(&system, &excitation, &[0.0, 0.0]).unwrap().states;
        // The design integrates in coarser steps.
        assert!((0..SAMPLES).all(|i| states[(i, 0)].abs() < 0.201));
    }
}

/// A listener whose clock goes on by a second at every look.
#[derive(Default)]
struct Clock(AtomicUsize);

impl Progress for Clock {
    fn report(&self, _stage: &str, _done: usize, _total: usize) -> bool {
        true
    }

    fn seconds(&self) -> Option<f64> {
        Some(self.0.fetch_add(1, Ordering::Relaxed) as f64)
    }
}

#[test]
fn a_time_limit_leaves_the_best_signal_so_far() {
    let whole = Design { duration: 2.0, ..limits() };
    let found = whole.run(&open(), None, &Clock::default()).unwrap();
    let cut = Design { time_limit: Some(2.0), ..whole }.run(&open(), None, &Clock::default()).unwrap();
    assert!(found.is_complete && !cut.is_complete);
    assert!(cut.values[0].len() == found.values[0].len() && cut.pairs[0].nats > 0.0);
    assert!(cut.pairs[0].nats <= found.pairs[0].nats, "{:?} {:?}", cut.pairs, found.pairs);
}

#[test]
fn the_same_seed_gives_the_same_signal_and_wrong_settings_are_stated() {
    let short = Design { duration: 2.0, ..limits() };
    assert_eq!(short.run(&open(), None, &Silent).unwrap(), short.run(&open(), None, &Silent).unwrap());
    for (wrong, words) in [
        (Design { limits: Vec::new(), ..limits() }, "control `u` has no limit"),
        (Design { duration: 0.0, ..limits() }, "duration"),
        (Design { time_limit: Some(0.0), ..limits() }, "time limit"),
        (Design { bounds: vec![("z".into(), 0.0, 1.0)], ..limits() }, "`z`"),
        (Design { bounds: vec![("x".into(), 1.0, 2.0)], ..limits() }, "within its bounds"),
    ] {
        let stated = wrong.run(&open(), None, &Silent).unwrap_err().to_string();
        assert!(stated.contains(words), "{stated}");
    }
    let nothing = Open { pairs: Vec::new(), ..open() };
    assert!(matches!(limits().run(&nothing, None, &Silent), Err(Error::Settings { .. })));
}
