use super::*;
use crate::diagnose::fixture::drive;
use crate::diagnose::{Diagnose, hold_out};
use crate::progress::Silent;
use crate::random::normal;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// A report with a gap in these causes: effect, whether it is included, probability.
fn report(causes: &[(&str, bool, f64)], structure: f64) -> Diagnosis {
    let (model, data) = drive(None, |x| x, 0.01, (2, 40));
    let mut report = Diagnose::default().run(&model, &data, &data, &Silent).unwrap().diagnosis;
    let cause = |&(effect, included, probability): &(&str, bool, f64)| Cause {
        included,
        ..Cause::bare(effect, "x", probability)
    };
    report.causes = causes.iter().map(cause).collect();
    report.gap.detected = true;
    report.unexplained.probability = structure;
    report.closure.before = Some(10.0);
    report
}

fn usual() -> Conditions {
    Conditions { has_usual_suspects: true, steps: false, states: 2, samples: 3000 }
}

#[test]
fn the_threshold_is_the_order_statistic_of_split_conformal_prediction() {
    let credits: Vec<f64> = (1..=19).map(f64::from).collect();
    // Of 19, ceil(20 * 0.9) = 18 must be at least as large: the second smallest.
    assert_eq!(threshold(&credits, 0.9), Some(2.0));
    assert_eq!(threshold(&credits[..9], 0.9), Some(1.0));
    assert_eq!(threshold(&credits[..8], 0.9), None);
    assert_eq!(threshold(&[], 0.9), None);
    // Ties are kept: the set may only grow.
    assert_eq!(threshold(&[0.0; 30], 0.9), Some(0.0));
}

#[test]
fn exchangeable_credits_keep_the_coverage_neither_less_nor_much_more() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for n in [9, 20, 53] {
        let trials = 4000;
        let mut draw = || normal(&mut random).powi(3);
        let covered = (0..trials).filter(|_| {
            let calibration: Vec<f64> = (0..n).map(|_| draw()).collect();
            threshold(&calibration, COVERAGE).is_some_and(|least| draw() >= least)
        });
        let rate = covered.count() as f64 / f64::from(trials);
        // Without ties the coverage is ceil((n + 1) * 0.9) / (n + 1); four standard errors of 4000 trials are 0.019.
        let exact = ((n + 1) as f64 * COVERAGE).ceil() / (n + 1) as f64;
        assert!((rate - exact).abs() < 0.019, "{n}: {rate} and {exact}");
    }
}

#[test]
fn tied_credits_keep_at_least_the_coverage() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut draw = || normal(&mut random).round().min(0.0);
    let covered = (0..4000).filter(|_| {
        let calibration: Vec<f64> = (0..25).map(|_| draw()).collect();
        threshold(&calibration, COVERAGE).is_some_and(|least| draw() >= least)
    });
    assert!(covered.count() as f64 > 4000.0 * (COVERAGE - 0.019));
}

#[test]
fn included_causes_and_a_likely_rest_are_always_in_the_set() {
    let explained = report(&[("bias", true, 0.3), ("drift", false, 0.2), ("backlash", false, 1e-200)], 0.01);
    assert_eq!(Credits::of(&explained), Credits { causes: vec![1.0, 0.2, 1e-200], unlisted: 0.5 });
    let names = |least: f64| {
        let (causes, none) = members(&explained, least);
        (causes.iter().map(|cause| cause.effect.clone()).collect::<Vec<_>>(), none)
    };
    assert_eq!(names(1.0), (vec!["bias".to_string()], false));
    assert_eq!(names(0.2), (vec!["bias".to_string(), "drift".to_string()], true));
    assert_eq!(names(0.0).0.len(), 3);
    let partly = report(&[("bias", true, 0.3), ("function", false, 0.9)], 0.9);
    assert_eq!(members(&partly, 1.0).0.len(), 2);
    assert!(members(&partly, 1.0).1);
}

#[test]
fn twins_are_members_with_their_places() {
    let mut explained = report(&[("bias", true, 0.99)], 0.0);
    explained.causes[0].twins = vec![crate::diagnose::report::Twin {
        effect: "input_bias".into(),
        state: "x".into(),
        place: None,
        variables: vec!["u".into()],
        parameters: Vec::new(),
    }];
    let (causes, none) = members(&explained, 1.0);
    assert_eq!(causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(), ["bias", "input_bias"]);
    assert!(!none);
}

#[test]
fn a_family_without_cases_of_its_own_has_the_threshold_of_all() {
    let known = prediction_set(&report(&[("coulomb_friction", true, 0.99)], 0.0)).unwrap();
    assert_eq!(known.calibration.group, "friction");
    // An effect of the user's own has no calibration; only its group is looked at here.
    assert_eq!(group(&report(&[("wake", true, 0.99)], 0.0)), "custom");
    assert!(BY_FAMILY.iter().all(|(name, ..)| *name != "custom"));
    assert_eq!(calibration("custom"), (ALL, POOLED.0, POOLED.1));
    assert_eq!(group(&report(&[("bias", false, 0.4)], 1.0)), UNEXPLAINED);
    assert!(BY_FAMILY.iter().all(|(_, cases, _)| threshold(&vec![0.0; *cases], COVERAGE).is_some()));
    let all: usize = BY_FAMILY.iter().map(|(_, cases, _)| cases).sum();
    assert!(all <= POOLED.0);
}

#[test]
fn a_machine_unlike_the_drawn_ones_has_no_set_but_the_reason() {
    let stated = |change: &dyn Fn(&mut Diagnosis, &mut Conditions)| {
        let (mut report, mut conditions) = (report(&[("bias", true, 0.99)], 0.0), usual());
        change(&mut report, &mut conditions);
        state(&mut report, &conditions);
        assert_eq!(report.prediction_set.is_none(), report.no_prediction_set.is_some());
        report.no_prediction_set.unwrap_or_default()
    };
    assert_eq!(stated(&|_, _| {}), "");
    assert!(stated(&|_, c| c.states = 12).contains("1 to 6 states, this one 12"));
    assert!(stated(&|_, c| c.samples = 100).contains("training samples"));
    assert!(stated(&|_, c| c.steps = true).contains("steps"));
    assert!(stated(&|_, c| c.has_usual_suspects = false).contains("suspects"));
    assert!(stated(&|r, _| r.interrupted = Some(3.0)).contains("cut short"));
    assert!(stated(&|r, _| r.closure.before = Some(1e6)).contains("times the noise"));
    assert!(stated(&|r, _| r.closure.before = None).contains("diverges"));
    assert!(stated(&|r, _| r.unexplained.share = 0.4).contains("these 40 %"));
    assert!(stated(&|r, _| r.causes[0].effect = "wake".into()).contains("catalogue"));
}

#[test]
fn without_a_gap_there_is_no_set_and_with_one_there_is() {
    let (model, data) = drive(None, |x| x, 0.01, (5, 300));
    let (train, holdout) = hold_out(&data).unwrap();
    let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
    assert!(!found.gap.detected && found.prediction_set.is_none() && found.no_prediction_set.is_none());
    let (model, data) = drive(None, |x| x + 0.5 * x * x.abs(), 0.01, (5, 300));
    let (train, holdout) = hold_out(&data).unwrap();
    let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
    let set = found.prediction_set.unwrap();
    assert!(set.causes.iter().any(|cause| cause.effect == "quadratic_drag"), "{set:?}");
    assert_eq!((set.coverage, set.calibration.group.as_str()), (COVERAGE, "friction"));
}

#[test]
fn structure_without_a_name_is_listed_and_not_included() {
    let (model, data) = drive(None, |x| x + 0.15 * (8.0 * x).sin(), 0.003, (5, 300));
    let (train, holdout) = hold_out(&data).unwrap();
    let settings = Diagnose { effects: vec!["bias".into()], ..Diagnose::default() };
    let found = settings.run(&model, &train, &holdout, &Silent).unwrap();
    let function = found.diagnosis.causes.iter().find(|cause| cause.is_nameless()).unwrap();
    assert!(!function.included && function.state == "x" && function.probability > 0.5);
    assert_eq!(function.variables, found.diagnosis.unexplained.depends_on);
    assert!(found.diagnosis.no_prediction_set.is_some(), "not the whole catalogue was asked");
}
