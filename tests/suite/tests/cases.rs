//! Whole cases: sizes, bytes, nulls, twins.

#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_suite::case::{Kind, draw_case, draw_named};
use gpsindy_suite::effect::Variable;
use gpsindy_suite::emit::{answer, files};

#[test]
fn a_seed_keeps_its_bytes() {
    for seed in [3, 4] {
        let (one, two) = (draw_case(seed, None).unwrap(), draw_case(seed, None).unwrap());
        assert_eq!(files(&one), files(&two));
        let text = |case| toml::to_string(&answer(case, "case")).unwrap();
        assert_eq!(text(&one), text(&two));
    }
    assert_ne!(files(&draw_case(3, None).unwrap()), files(&draw_case(4, None).unwrap()));
}

#[test]
fn singles_reach_gaps_between_one_and_thirty() {
    let mut wide = (f64::INFINITY, 0.0f64);
    for seed in 0..8 {
        let case = draw_case(seed, Some(Kind::Single)).unwrap();
        assert_eq!(case.effects.len(), 1);
        // The size is found to a third of the wanted gap.
        assert!((0.7..42.0).contains(&case.gap.snr), "seed {seed}: {}", case.gap.snr);
        wide = (wide.0.min(case.gap.snr), wide.1.max(case.gap.snr));
    }
    assert!(wide.0 < 3.0 && wide.1 > 8.0, "{wide:?}");
}

#[test]
fn nulls_have_no_gap_and_the_noise_they_state() {
    for seed in 0..12 {
        let case = draw_case(seed, Some(Kind::Null)).unwrap();
        let entry = answer(&case, "case");
        assert!(entry.effects.is_empty() && entry.accept.is_empty());
        let trapped = ["interpolated", "tolerance"].iter().any(|t| case.trap.contains(t));
        // The rollout differs from the run by the tolerance of the integrator only.
        assert!(trapped || case.gap.snr < 1e-3, "seed {seed}: {}", case.gap.snr);
        // Thousands of samples: two to ten per cent; outliers add to it.
        let room = if case.trap.contains("outliers") || case.trap.contains("coloured") { 1.0 } else { 0.1 };
        assert!((entry.oracle.noise_floor - 1.0).abs() < room, "seed {seed}: {}", entry.oracle.noise_floor);
    }
}

#[test]
fn runs_have_the_sizes_that_are_promised() {
    for seed in 20..25 {
        let case = draw_case(seed, None).unwrap();
        assert!((3..=6).contains(&case.given) && case.runs.len() == case.given + 2);
        for run in &case.runs {
            assert!((200..=3000).contains(&run.log.len()));
            assert!(run.setup.times.windows(2).all(|t| t[1] > t[0]));
        }
    }
}

#[test]
fn what_saturates_multiplies_and_divides_nothing() {
    for (seed, id) in [(12101, "slip"), (12104, "slip")] {
        let case = draw_named(seed, Some(Kind::Second), Some(id)).unwrap();
        let (effect, plant) = (&case.effects[0], &case.plant);
        let Variable::Parameter(index) = effect.variables[0] else { panic!("{id} of no parameter") };
        let (x, u) = &case.survey.points[0];
        let rate = |factor: f64| {
            let (mut parameters, mut rates) = (plant.values(), vec![0.0; plant.states.len()]);
            parameters[index] *= factor;
            (plant.flow)(&parameters, x, u, 0.0, &mut rates);
            rates[effect.state]
        };
        let (more, less) = (rate(2.0) - rate(1.0), rate(1.0) - rate(0.0));
        assert!((more - less).abs() <= 1e-9 * less.abs().max(1e-9), "{seed}: {} divides", plant.parameters[index].name);
    }
}

#[test]
fn a_wrong_damping_is_also_a_viscous_friction() {
    use gpsindy_suite::effect::{Act, Effect, Variable};
    use gpsindy_suite::gap::{Log, Ruler};
    use gpsindy_suite::simulate::Machine;
    use gpsindy_suite::twins::{accept, compete};
    let simple = ["turntable", "belt", "buoy", "cart_spring", "puck", "pendulum", "scooter"];
    let case = (0..40).find_map(|seed| draw_case(seed, Some(Kind::Null)).filter(|c| simple.contains(&c.plant.name)));
    let case = case.unwrap();
    let row = case.plant.rows.len() - 1;
    let z = Variable::State(row);
    let act = Act::Linear { z, c: -0.1 };
    let effect = Effect { id: "viscous_friction", state: row, variables: vec![z], act };
    let ruler = Ruler { plant: &case.plant, noise: &case.noise, scale: &case.survey.spread, reset: 0.0 };
    let setup = &case.runs[0].setup;
    let trace = Machine::new(&case.plant, std::slice::from_ref(&effect), &case.survey.spread, 1e-8).run(setup).unwrap();
    let outcome = compete(&ruler, &case.survey, &[Log { times: &setup.times, trace: &trace }], false, &effect, 0);
    let list = accept(&case.plant, &case.survey, &effect, 0, outcome.as_ref());
    // The puck has one damping for two axes: a wrong number would act on both.
    let expected = ["viscous_friction", "linear_stiffness", "coupling", "parameter_error"];
    for id in &expected[..if case.plant.name == "puck" { 3 } else { 4 }] {
        assert!(list.iter().any(|a| a.effect == *id), "{}: {id} is missing", case.plant.name);
    }
}

#[test]
fn a_probe_that_reads_too_high_is_also_a_wrong_room() {
    use gpsindy_suite::effect::{Act, Effect, Sensor};
    use gpsindy_suite::gap::{Log, Ruler};
    use gpsindy_suite::plants::families;
    use gpsindy_suite::random::Draw;
    use gpsindy_suite::simulate::{Commands, Machine, Setup};
    use gpsindy_suite::survey::survey;
    use gpsindy_suite::twins::{accept, compete};
    // The kettle is linear with one column: a sensor bias, a bias of the heat and another room temperature are one.
    let plant = families().into_iter().map(|f| f(&mut Draw::new(1, 1))).find(|p| p.name == "kettle").unwrap();
    let setup = Setup {
        times: (0..600).map(f64::from).collect(),
        start: vec![plant.states[0].start.0],
        commands: Commands::Open((0..600).map(|k| vec![plant.controls[0].centre * f64::from(k / 60 % 3)]).collect()),
        linear: false,
    };
    let effect =
        Effect { id: "sensor_bias", state: 0, variables: vec![], act: Act::Sensor { law: Sensor::Bias { c: 1.0 } } };
    let calm = Machine::new(&plant, &[], &[10.0], 1e-8).run(&setup).unwrap();
    let known = survey(&plant, &[calm]);
    let trace = Machine::new(&plant, std::slice::from_ref(&effect), &[10.0], 1e-8).run(&setup).unwrap();
    let ruler = Ruler { plant: &plant, noise: &[0.2], scale: &[10.0], reset: 0.0 };
    let outcome = compete(&ruler, &known, &[Log { times: &setup.times, trace: &trace }], false, &effect, 0);
    let list = accept(&plant, &known, &effect, 0, outcome.as_ref());
    for id in ["sensor_bias", "bias", "input_bias"] {
        assert!(list.iter().any(|a| a.effect == id), "{id} is missing");
    }
    let room = |a: &gpsindy_suite::twins::Accept| {
        a.effect == "parameter_error" && plant.parameters[1].name == "Te" && a.variables.len() == 1
    };
    assert!(list.iter().any(room));
    assert!(!list.iter().any(|a| ["input_gain", "input_delay", "cubic_stiffness"].contains(&a.effect)), "{list:?}");
}

#[test]
fn a_rest_stands_beside_an_effect_of_the_catalogue_and_is_the_smaller_one() {
    let case = draw_case(1, Some(Kind::Beside)).unwrap();
    let entry = answer(&case, "case");
    assert_eq!((entry.kind, entry.in_catalogue, entry.effects.len()), ("beside", false, 2));
    // The first is accepted by name, the second has but partial covers.
    assert!(entry.accept.iter().all(|a| a.of == Some(0)) && entry.partial.iter().all(|p| p.of == Some(1)));
    assert!(case.gap.snr > 2.0, "{}", case.gap.snr);
}
