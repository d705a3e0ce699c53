//! The prediction set of a report in a sentence.

use crate::words::{effect_name, with_variables};
use gpsindy_core::diagnose::report::{Diagnosis, SetCause};

/// Among which effects the missing ones are, in how many of ten machines; or why that is not stated. `None` where there is no gap.
pub(crate) fn set_sentence(report: &Diagnosis) -> Option<String> {
    if let Some(why) = &report.no_prediction_set {
        return Some(format!("No set of causes with a stated coverage: {why}."));
    }
    let set = report.prediction_set.as_ref()?;
    // Where each acts is said beside its probability: one name is enough here.
    let mut names: Vec<String> = Vec::new();
    for name in set.causes.iter().filter(|cause| !cause.is_nameless()).map(member_name) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let machines = format!("In {} of ten machines like this one, what the simulator lacks is", in_ten(set.coverage));
    let names = names.join(", ");
    Some(match (names.is_empty(), set.none_of_these) {
        (true, _) => format!("{machines} not listed here."),
        (false, true) => format!("{machines} among: {names}; or it is not listed here."),
        (false, false) => format!("{machines} among: {names}."),
    })
}

/// `nine`, where a word of that length reads better than a number.
fn in_ten(coverage: f64) -> String {
    match (10.0 * coverage * 100.0).round() as i64 {
        900 => "nine".into(),
        _ => crate::numbers::number(10.0 * coverage),
    }
}

fn member_name(cause: &SetCause) -> String {
    let name = effect_name(&cause.effect);
    let variables = cause.variables.join(", ");
    let is_plain = variables.is_empty() || variables == cause.state;
    if is_plain { name } else { with_variables(&cause.effect, &name, &variables) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use gpsindy_core::diagnose::report::{PredictionSet, SetCalibration};

    fn stated(effects: &[&str], none_of_these: bool) -> Option<String> {
        let cause = |effect: &&str| SetCause {
            effect: effect.to_string(),
            state: "v".into(),
            place: None,
            variables: vec!["v".into()],
        };
        let mut report = crate::scorecard::read_report(r#"{"verdict": "explained"}"#).unwrap();
        report.prediction_set = Some(PredictionSet {
            coverage: 0.9,
            causes: effects.iter().map(cause).collect(),
            none_of_these,
            calibration: SetCalibration { cases: 49, group: "friction".into() },
        });
        set_sentence(&report)
    }

    #[test]
    fn a_set_is_read_out_with_what_is_not_listed_last() {
        let both = stated(&["coulomb_friction", "stribeck_friction"], false).unwrap();
        assert_eq!(
            both,
            "In nine of ten machines like this one, what the simulator lacks is among: Coulomb friction, Stribeck friction."
        );
        let open = stated(&["coulomb_friction", "function"], true).unwrap();
        assert!(open.ends_with("lacks is among: Coulomb friction; or it is not listed here."), "{open}");
        assert!(stated(&["function"], true).unwrap().ends_with("what the simulator lacks is not listed here."));
    }

    #[test]
    fn where_there_is_no_set_the_reason_is_read_out() {
        let mut report = crate::scorecard::read_report(r#"{"verdict": "explained"}"#).unwrap();
        assert_eq!(set_sentence(&report), None);
        report.no_prediction_set = Some("this one steps".into());
        assert_eq!(set_sentence(&report).unwrap(), "No set of causes with a stated coverage: this one steps.");
    }
}
