//! Reports that another tool wrote: only what the score card reads must be there.

use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_core::{Error, Result};
use serde_json::{Map, Value, json};

/// A `report.json` of any tool, for the score card: a `verdict`, and `causes` with `effect`, `state` and `variables`.
///
/// A cause counts as included unless it says otherwise, with probability 1. The gap counts as detected unless the verdict is
/// `no_gap`. What else is absent is empty, or zero, or unknown: such a report is for scoring and not for reading.
///
/// # Errors
/// [`Error::Parse`] where the text is no such report; the message says what is amiss.
pub fn read_report(text: &str) -> Result<Diagnosis> {
    let wrong = |message: String| Error::Parse { text: shortened(text), position: 1, message };
    let mut report: Map<String, Value> = serde_json::from_str(text).map_err(|e| wrong(e.to_string()))?;
    let detected = report.get("verdict").and_then(Value::as_str) != Some("no_gap");
    let defaults = json!({
        "schema": gpsindy_core::diagnose::report::SCHEMA, "model": "", "causes": [], "excluded": [], "notes": [], "augmented_model": null,
        "runs": {"train": [], "holdout": []},
        "gap": {"detected": detected, "p_value": f64::from(u8::from(!detected)), "by_state": [], "by_region": [], "by_window": []},
        "unexplained": {"probability": 0.0, "share": 0.0, "depends_on": []},
        "closure": {"metric": "rollout_rmse", "before": null, "after": null, "floor": null, "floor_source": "", "closed": null,
            "low": null, "high": null, "by_state": []},
    });
    complete(&mut report, &defaults);
    let causes = report.get_mut("causes").and_then(Value::as_array_mut).into_iter().flatten();
    for cause in causes.filter_map(Value::as_object_mut) {
        complete(
            cause,
            &json!({"state": "", "variables": [], "included": true, "probability": 1.0, "form": "", "parameters": [],
                "equivalent": [], "next_experiment": null}),
        );
    }
    complete_list(report.get_mut("gap").and_then(|gap| gap.get_mut("by_state")));
    serde_json::from_value(Value::Object(report)).map_err(|e| wrong(e.to_string()))
}

/// Adds the keys that are absent, also of the objects inside.
fn complete(object: &mut Map<String, Value>, defaults: &Value) {
    for (key, value) in defaults.as_object().into_iter().flatten() {
        match object.get_mut(key) {
            None => drop(object.insert(key.clone(), value.clone())),
            Some(Value::Object(inner)) => complete(inner, value),
            Some(_) => {}
        }
    }
}

/// Where the gap lies, in a report that only names states and shares.
fn complete_list(states: Option<&mut Value>) {
    for state in states.and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut) {
        complete(state, &json!({"share": 0.0, "p_value": 0.0, "residual_rms": 0.0, "noise_rms": 0.0, "unit": ""}));
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpsindy_core::diagnose::report::Verdict;

    #[test]
    fn a_verdict_and_a_cause_are_enough() {
        let text = r#"{"verdict": "explained", "causes": [{"effect": "bias", "state": "v"}], "gap": {"by_state": [{"state": "v"}]}}"#;
        let report = read_report(text).unwrap();
        assert_eq!(report.verdict, Verdict::Explained);
        assert!(report.gap.detected && report.gap.by_state[0].state == "v");
        let cause = &report.causes[0];
        assert!(cause.included && cause.probability == 1.0 && cause.effect == "bias" && cause.state == "v");
        assert!(!read_report(r#"{"verdict": "no_gap"}"#).unwrap().gap.detected);
    }

    #[test]
    fn a_wrong_report_is_told_with_what_is_amiss() {
        for (text, stated) in [
            ("[]", "map"),
            ("{}", "missing field `verdict`"),
            (r#"{"verdict": "maybe"}"#, "unknown variant `maybe`"),
            (r#"{"verdict": "explained", "causes": [{}]}"#, "missing field `effect`"),
        ] {
            let message = read_report(text).unwrap_err().to_string();
            assert!(message.contains(stated), "{text}: {message}");
        }
    }
}
