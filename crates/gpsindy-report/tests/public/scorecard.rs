//! The score card on made-up answers and diagnoses, and on the practice suite's answers where they are.

#![allow(clippy::unwrap_used, clippy::panic)]

use crate::fixtures;

use gpsindy_core::diagnose::report::*;
use gpsindy_core::diagnose::{Handed, Member};
use gpsindy_report::scorecard::*;
use std::collections::BTreeMap;

const ANSWERS: &str = r#"
schema = "gpsindy.suite/1"

[[case]]
id = "null"
effects = []
in_catalogue = true

[[case]]
id = "single"
in_catalogue = true
localise = ["v", "x"]
oracle = { snr = 4.0, closure_oracle = 0.8, chi2_nominal = 3.0 }
effects = [{ effect = "product_coupling", state = "v", variables = ["x", "w"], parameters = { c = 1.0 } }]
accept = [{ effect = "bias", state = "x", variables = [], of = 0 }]

[[case]]
id = "pair"
oracle = { snr = 0.7 }
effects = [{ effect = "periodic_disturbance", state = "v" }, { effect = "input_gain", state = "v", variables = ["u"] }]
accept = [{ effect = "input_bias", state = "v", variables = ["u"], of = 1 }]

[[case]]
id = "outside"
in_catalogue = false
oracle = { snr = 20.0, closure_oracle = 0.9 }
effects = [{ effect = "friction_at_a_place", state = "v", variables = ["x"] }]
partial = [{ effect = "coulomb_friction", state = "v", variables = ["v"] }]
"#;

fn diagnosis(verdict: Verdict, p_value: f64, causes: Vec<Cause>) -> Diagnosis {
    let mut report = fixtures::explained();
    report.verdict = verdict;
    report.gap.p_value = p_value;
    report.causes = causes;
    report
}

fn cause(effect: &str, state: &str, variables: &[&str], probability: f64) -> Cause {
    fixtures::cause(effect, state, variables, probability, "", &[])
}

/// The card of one case with one diagnosis.
fn card(id: &str, report: Option<Diagnosis>) -> ScoreCard {
    let mut suite = Suite::from_toml(ANSWERS).unwrap();
    suite.cases.retain(|case| case.id == id);
    ScoreCard::new(&suite, &report.into_iter().map(|r| (id.to_string(), r)).collect())
}

fn hit(rate: Rate) -> (usize, usize) {
    (rate.hits, rate.of)
}

#[test]
fn a_cause_hits_by_effect_state_and_variables_in_any_order() {
    for (causes, top_1, top_3) in [
        (vec![cause("product_coupling", "v", &["w", "x"], 0.9)], 1, 1),
        (vec![cause("product_coupling", "v", &["x"], 0.9)], 0, 0),
        (vec![cause("product_coupling", "x", &["x", "w"], 0.9)], 0, 0),
        (vec![cause("bias", "x", &[], 0.9)], 1, 1),
        (vec![cause("drift", "v", &[], 0.9), cause("bias", "x", &[], 0.05)], 0, 1),
        (vec![], 0, 0),
    ] {
        let card = card("single", Some(diagnosis(Verdict::Explained, 1e-6, causes.clone())));
        assert_eq!((hit(card.top_1), hit(card.top_3)), ((top_1, 1), (top_3, 1)), "{causes:?}");
    }
}

#[test]
fn a_group_that_holds_the_truth_hits_but_not_by_name() {
    let grouped = Cause { equivalent: vec!["product_coupling".into()], ..cause("drift", "v", &[], 0.9) };
    let card = card("single", Some(diagnosis(Verdict::Explained, 1e-6, vec![grouped])));
    assert_eq!((hit(card.top_1), hit(card.named)), ((1, 1), (0, 1)));
    assert_eq!(card.mean_group_size, Some(2.0));
}

#[test]
fn a_pair_needs_a_cause_of_its_own_for_each_effect() {
    let swell = || cause("periodic_disturbance", "v", &[], 0.9);
    let gain = || cause("input_gain", "v", &["u"], 0.9);
    let group = || Cause { equivalent: vec!["periodic_disturbance".into()], ..gain() };
    let bias = || cause("input_bias", "v", &["u"], 0.9);
    for (causes, found, exact) in [
        (vec![swell(), gain()], 1, 1),
        (vec![gain(), swell(), cause("bias", "v", &[], 0.5)], 1, 0),
        (vec![group()], 0, 0),
        (vec![group(), bias()], 1, 1),
        (vec![swell(), Cause { included: false, ..gain() }], 0, 0),
    ] {
        let card = card("pair", Some(diagnosis(Verdict::Explained, 1e-6, causes.clone())));
        assert_eq!((hit(card.several_found), hit(card.several_exact)), ((found, 1), (exact, 1)), "{causes:?}");
    }
}

#[test]
fn a_null_case_alarms_by_p_or_by_an_included_cause() {
    let quiet = card("null", Some(diagnosis(Verdict::NoGap, 0.3, vec![])));
    assert_eq!((hit(quiet.false_alarms), hit(quiet.false_causes), hit(quiet.right_verdict)), ((0, 1), (0, 1), (1, 1)));
    let loud = card("null", Some(diagnosis(Verdict::Explained, 0.01, vec![cause("bias", "v", &[], 0.8)])));
    assert_eq!((hit(loud.false_alarms), hit(loud.false_causes), hit(loud.right_verdict)), ((1, 1), (1, 1), (0, 1)));
    assert_eq!(loud.calibration.brier.map(|b| (b * 100.0).round()), Some(64.0));
}

#[test]
fn outside_the_catalogue_explained_is_the_error_and_a_partial_name_is_right() {
    let partial = || vec![cause("coulomb_friction", "v", &["v"], 0.95)];
    let wrong = card("outside", Some(diagnosis(Verdict::Explained, 1e-6, partial())));
    assert_eq!((hit(wrong.wrongly_explained), hit(wrong.right_verdict)), ((1, 1), (0, 1)));
    let right = card("outside", Some(diagnosis(Verdict::PartlyExplained, 1e-6, partial())));
    assert_eq!((hit(right.wrongly_explained), hit(right.right_verdict)), ((0, 1), (1, 1)));
    assert_eq!(hit(right.calibration.stated_090), (1, 1));
    assert_eq!(hit(right.right_state_outside), (1, 1));
    assert_eq!(right.closure.of, 0, "no oracle of the catalogue's structure");
}

#[test]
fn closure_is_relative_to_the_oracle_and_what_is_not_closed_counts_as_nothing() {
    let mut report = diagnosis(Verdict::Explained, 1e-6, vec![]);
    report.closure.closed = Some(0.6);
    assert!((card("single", Some(report.clone())).closure.median.unwrap() - 0.75).abs() < 1e-12);
    report.closure.closed = None;
    assert_eq!(card("single", Some(report)).closure.median, Some(0.0));
}

#[test]
fn a_case_without_a_diagnosis_is_missed_in_everything() {
    let suite = Suite::from_toml(ANSWERS).unwrap();
    let card = ScoreCard::new(&suite, &BTreeMap::new());
    assert_eq!(card.counts.failed, 4);
    assert_eq!(hit(card.right_verdict), (0, 4));
    assert_eq!(hit(card.detected), (0, 2), "the pair's gap is below the noise");
    assert_eq!((hit(card.top_1), hit(card.several_found)), ((0, 1), (0, 1)));
    assert_eq!(hit(card.false_alarms), (0, 1));
}

#[test]
fn gaps_are_counted_in_the_stratum_of_their_size() {
    let suite = Suite::from_toml(ANSWERS).unwrap();
    let found = suite.cases.iter().map(|c| (c.id.clone(), diagnosis(Verdict::Unexplained, 0.01, vec![]))).collect();
    let card = ScoreCard::new(&suite, &found);
    let counts: Vec<_> = card.detected_by_snr.iter().map(|s| (s.from, s.rate.hits)).collect();
    assert_eq!(counts, [(0.0, 1), (1.0, 0), (3.0, 1), (10.0, 1)]);
    assert_eq!(hit(card.needlessly_unexplained), (2, 2));
}

#[test]
fn wrong_answers_are_refused_with_the_place() {
    for (text, words) in [
        ("[[case]]\nid = 3\n", "answers.toml:2"),
        ("[[case]]\nid = \"a\"\n[[case]]\nid = \"a\"\n", "case `a` appears twice"),
        ("[[case]]\nid = \"a\"\naccept = [{ effect = \"bias\", state = \"v\", of = 1 }]\n", "has 0 effects"),
    ] {
        let message = Suite::from_toml(text).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
        assert_eq!(message.lines().count(), 1);
    }
}

#[test]
fn the_card_is_readable_as_text_and_as_json() {
    let suite = Suite::from_toml(ANSWERS).unwrap();
    let reports = BTreeMap::from([
        ("null".to_string(), diagnosis(Verdict::NoGap, 0.3, vec![])),
        ("single".to_string(), diagnosis(Verdict::Explained, 1e-6, vec![cause("bias", "x", &[], 0.97)])),
    ]);
    let card = ScoreCard::new(&suite, &reports);
    let text = card.text();
    for words in ["4 cases: 1 null, 1 with one effect", "bias x (0.97)", "no diagnosis", "0.9 to 1.0"] {
        assert!(text.contains(words), "{words} is not in\n{text}");
    }
    let json = serde_json::to_value(&card).unwrap();
    assert_eq!(json["schema"], "gpsindy.scorecard/1");
    assert_eq!(json["top_1"]["hits"], 1);
    assert_eq!(json["cases"][1]["top_1"], true);
}

/// The practice suite, if it is next to the repository: correct diagnoses score full marks.
#[test]
fn true_diagnoses_of_the_practice_suite_score_full_marks() {
    let Some(path) = gpsindy_beside::shared("practice/answers.toml") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    let suite = Suite::from_toml(&text).unwrap();
    let truth = |case: &Answer| {
        let (verdict, p_value) = match case.kind() {
            Kind::Null => (Verdict::NoGap, 0.5),
            Kind::Outside => (Verdict::Unexplained, 1e-9),
            Kind::Single | Kind::Several => (Verdict::Explained, 1e-9),
        };
        let causes = if case.kind() == Kind::Outside { &[][..] } else { &case.effects[..] }.iter();
        let variables = |e: &TrueEffect| e.variables.clone();
        let causes =
            causes.map(|e| Cause { variables: variables(e), ..cause(&e.effect, &e.state, &[], 0.95) }).collect();
        let mut report = diagnosis(verdict, p_value, causes);
        report.gap.by_state[0].state = case.places().first().unwrap_or(&"v").to_string();
        report.closure.closed = case.oracle.closure_oracle;
        report
    };
    let reports: BTreeMap<_, _> = suite.cases.iter().map(|case| (case.id.clone(), truth(case))).collect();
    let card = ScoreCard::new(&suite, &reports);
    for full in [card.detected, card.right_state, card.top_1, card.top_3, card.several_exact, card.right_verdict] {
        assert_eq!(full.hits, full.of);
        assert!(full.of > 0);
    }
    for none in [card.false_alarms, card.false_causes, card.wrongly_explained, card.needlessly_unexplained] {
        assert_eq!(none.hits, 0);
        assert!(none.of > 0);
    }
    assert_eq!(card.closure.median, Some(1.0));
}

/// Id, state and variables of an effect.
type Named<'a> = (&'a str, &'a str, &'a [&'a str]);

fn handed(sets: &[&[Named<'_>]]) -> HandedOver {
    let member = |(effect, state, variables): &Named<'_>| Member {
        effect: (*effect).into(),
        state: (*state).into(),
        variables: variables.iter().map(|v| (*v).into()).collect(),
    };
    let set = |(place, members): (usize, &&[Named<'_>])| Handed {
        members: members.iter().map(member).collect(),
        family: "Coupling".into(),
        promised: 10.0 * place as f64 + 10.0,
        achieved: 8.0 * place as f64 + 4.0,
        at_rest: true,
    };
    let sets = sets.iter().enumerate().map(set).collect();
    let mut suite = Suite::from_toml(ANSWERS).unwrap();
    suite.cases.retain(|case| case.id == "pair");
    HandedOver::new(&suite, &BTreeMap::from([("pair".to_string(), sets)]))
}

#[test]
fn the_right_set_was_fitted_where_each_effect_had_a_member_of_its_own() {
    const PERIODIC: Named<'_> = ("periodic_disturbance", "v", &[]);
    const BIAS: Named<'_> = ("input_bias", "v", &["u"]);
    // By the name that the suite accepts, in whatever order.
    let found = handed(&[&[PERIODIC], &[BIAS, PERIODIC]]);
    assert_eq!((hit(found.right_set), found.missed.len()), ((1, 1), 0));
    for sets in [&[&[PERIODIC][..], &[BIAS]][..], &[&[PERIODIC, PERIODIC]], &[&[PERIODIC, BIAS, BIAS]]] {
        let found = handed(sets);
        assert_eq!((hit(found.right_set), found.missed), ((0, 1), vec!["pair".to_string()]));
    }
    // 4 of 10, 12 of 20, 20 of 30: in order, and the first fell short.
    let found = handed(&[&[PERIODIC], &[BIAS], &[BIAS, PERIODIC]]);
    assert_eq!(hit(found.kept), (2, 3));
    assert_eq!(found.families[0].of, 3);
    assert!((found.families[0].correlation.unwrap() - 1.0).abs() < 1e-12);
}

/// Covered, size and "not listed" of the set that a report's numbers give.
fn set(id: &str, mut report: Diagnosis, structure: f64) -> (usize, Option<f64>, usize) {
    report.unexplained.probability = structure;
    report.prediction_set = None;
    let sets = card(id, Some(report)).prediction_sets.unwrap();
    (sets.covered.hits, sets.mean_size, sets.none_of_these.hits)
}

#[test]
fn a_prediction_set_must_hold_every_effect() {
    let swell = || cause("periodic_disturbance", "v", &[], 0.95);
    let gain = || cause("input_gain", "v", &["u"], 0.95);
    let of = |causes| diagnosis(Verdict::Explained, 1e-6, causes);
    assert_eq!(set("pair", of(vec![swell(), gain()]), 0.0), (1, Some(2.0), 0));
    assert_eq!(set("pair", of(vec![swell()]), 0.0), (0, Some(1.0), 0));
    // What is not listed is covered where the set says so, and what is listed and left out is not.
    assert_eq!(set("pair", of(vec![swell()]), 0.9), (1, Some(1.0), 1));
    let doubted = Cause { included: false, probability: 1e-9, ..gain() };
    assert_eq!(set("pair", of(vec![swell(), doubted]), 0.9), (0, Some(1.0), 1));
    let group = Cause { equivalent: vec!["input_gain".into()], ..cause("bias", "v", &[], 0.95) };
    assert_eq!(set("pair", of(vec![swell(), group]), 0.0), (1, Some(2.0), 0));
}

#[test]
fn an_effect_outside_the_catalogue_is_only_in_a_set_that_says_so() {
    let part = || diagnosis(Verdict::Explained, 1e-6, vec![cause("coulomb_friction", "v", &["v"], 0.95)]);
    assert_eq!(set("outside", part(), 0.0), (0, Some(1.0), 0));
    assert_eq!(set("outside", part(), 0.9), (1, Some(1.0), 1));
}

#[test]
fn a_null_has_no_prediction_set_and_one_that_abstains_is_not_counted() {
    assert_eq!(card("null", Some(diagnosis(Verdict::NoGap, 0.3, vec![]))).prediction_sets, None);
    let mut report = diagnosis(Verdict::Explained, 1e-6, vec![]);
    report.prediction_set = None;
    report.no_prediction_set = Some("this one steps".into());
    let sets = card("single", Some(report)).prediction_sets.unwrap();
    assert_eq!((hit(sets.covered), sets.abstained), ((0, 0), 1));
    // Another tool states no confidence, and its probabilities are not those that are calibrated.
    let foreign = read_report(r#"{"verdict": "explained", "causes": [{"effect": "bias", "state": "x"}]}"#).unwrap();
    assert_eq!(card("single", Some(foreign)).prediction_sets, None);
}

#[test]
fn structure_without_a_name_is_not_scored_as_a_cause() {
    let function = Cause { included: false, ..cause("function", "v", &["v"], 0.99) };
    let card = card("outside", Some(diagnosis(Verdict::Unexplained, 1e-6, vec![function])));
    assert_eq!(card.calibration.brier, None);
}

#[test]
fn calibration_leaves_each_case_out_and_has_a_threshold_from_nine_cases_on() {
    let answer = |i: usize| {
        let effects = vec![TrueEffect { effect: "bias".into(), state: "x".into(), variables: vec![] }];
        let text = format!("[[case]]\nid = \"c{i}\"\n");
        Answer { effects, ..Suite::from_toml(&text).unwrap().cases.remove(0) }
    };
    let found = |i: usize| {
        let right = Cause { included: false, probability: 0.1 * i as f64, ..cause("bias", "x", &[], 0.0) };
        let report = diagnosis(Verdict::Explained, 1e-6, vec![cause("drift", "x", &[], 0.9), right]);
        (format!("c{i}"), report)
    };
    let of = |n: usize| {
        let suite = Suite { cases: (0..n).map(answer).collect() };
        ScoreCard::new(&suite, &(0..n).map(found).collect()).prediction_sets.unwrap().calibration
    };
    let (few, enough) = (of(8), of(10));
    assert_eq!(few[0].least, None);
    // All but the case with the least credit are above the least of the others.
    assert_eq!((enough[0].group.as_str(), enough[0].least, hit(enough[0].covered)), ("all", Some(0.0), (9, 10)));
    assert_eq!((enough[1].group.as_str(), enough[1].cases), ("time", 10));
}
