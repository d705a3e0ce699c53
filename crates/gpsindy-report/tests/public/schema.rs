//! `diagnosis.schema.json` and the structs of the report say the same.

#![allow(clippy::unwrap_used, clippy::panic)]

use crate::fixtures;

use serde_json::Value;

fn schema() -> Value {
    serde_json::from_str(gpsindy_report::SCHEMA).unwrap()
}

/// Checks `value` by the words of JSON Schema that the file uses; an unknown word is a failure,
/// so that nothing passes because it was not looked at.
fn check(root: &Value, schema: &Value, value: &Value, path: &str, faults: &mut Vec<String>) {
    for (word, rule) in schema.as_object().unwrap() {
        let right = match word.as_str() {
            "$schema" | "title" | "description" | "$defs" => true,
            "$ref" => {
                let target = rule.as_str().unwrap().strip_prefix('#').unwrap();
                check(root, root.pointer(target).unwrap(), value, path, faults);
                true
            }
            "const" => value == rule,
            "enum" => rule.as_array().unwrap().contains(value),
            "type" => match rule {
                Value::Array(types) => types.iter().any(|t| is_type(value, t)),
                one => is_type(value, one),
            },
            "minimum" => value.as_f64().is_none_or(|v| v >= rule.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|v| v <= rule.as_f64().unwrap()),
            "required" => rule.as_array().unwrap().iter().all(|key| value.get(key.as_str().unwrap()).is_some()),
            "properties" => {
                for (key, rule) in rule.as_object().unwrap() {
                    if let Some(inner) = value.get(key) {
                        check(root, rule, inner, &format!("{path}/{key}"), faults);
                    }
                }
                true
            }
            "items" => {
                for (i, inner) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, rule, inner, &format!("{path}/{i}"), faults);
                }
                true
            }
            unknown => panic!("the check does not know `{unknown}`"),
        };
        if !right {
            faults.push(format!("{path}: {word} {rule}, found {value}"));
        }
    }
}

fn is_type(value: &Value, name: &Value) -> bool {
    match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        unknown => panic!("the check does not know the type `{unknown}`"),
    }
}

fn faults(value: &Value) -> Vec<String> {
    let schema = schema();
    let mut faults = Vec::new();
    check(&schema, &schema, value, "", &mut faults);
    faults
}

/// Keys that reports of this schema written earlier lack.
const LATER: [&str; 19] = [
    "checks",
    "interrupted",
    "work",
    "spread",
    "figures",
    "power",
    "closed",
    "confidence",
    "parameters",
    "horizon",
    "variables",
    "stability",
    "place",
    "disagree",
    "twins",
    "between_runs",
    "by_part",
    "prediction_set",
    "no_prediction_set",
];

/// Every property that the structs write is in the schema as required, and no other does.
fn same_names(schema: &Value, value: &Value, path: &str) {
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        let required: Vec<&str> = schema["required"].as_array().unwrap().iter().map(|k| k.as_str().unwrap()).collect();
        for (key, inner) in value.as_object().unwrap() {
            assert!(properties.contains_key(key), "{path}/{key} is written and stands not in the schema");
            assert!(
                required.contains(&key.as_str()) || LATER.contains(&key.as_str()),
                "{path}/{key} is always written, yet not required"
            );
            same_names(&properties[key], inner, &format!("{path}/{key}"));
        }
        // Only what acts at a port or a control has a place, only a cause with parts to compare a stability, only a random force a
        // spread, only a search that was cut off an end, and only what has no set a reason.
        let may_lack = |key: &str| {
            ["place", "stability", "disagree", "spread", "twins", "between_runs", "interrupted", "no_prediction_set"]
                .contains(&key)
        };
        for key in properties.keys().filter(|key| !may_lack(key)) {
            assert!(value.get(key).is_some(), "{path}/{key} stands in the schema and is not written");
        }
    }
    if let Some(items) = schema.get("items") {
        let list = value.as_array().unwrap();
        assert!(!list.is_empty(), "{path}: the example must not be empty here, or its names are not compared");
        same_names(items, &list[0], path);
    }
}

#[test]
fn every_kind_of_diagnosis_keeps_the_schema() {
    for (name, report) in fixtures::all() {
        assert_eq!(faults(&serde_json::to_value(&report).unwrap()), [""; 0], "{name}");
    }
}

#[test]
fn the_schema_and_the_structs_have_the_same_names() {
    same_names(&schema(), &serde_json::to_value(fixtures::with_power()).unwrap(), "");
}

#[test]
fn a_diagnosis_survives_json_unchanged() {
    for (name, report) in fixtures::all() {
        let text = serde_json::to_string(&report).unwrap();
        assert!(serde_json::from_str::<gpsindy_core::diagnose::Diagnosis>(&text).unwrap() == report, "{name}");
    }
}

#[test]
fn the_check_finds_what_is_wrong() {
    let good = serde_json::to_value(fixtures::explained()).unwrap();
    for (pointer, wrong) in [
        ("/schema", Value::from("gpsindy.diagnosis/2")),
        ("/verdict", Value::from("Explained")),
        ("/gap/p_value", Value::from(1.5)),
        ("/causes/0/parameters/0/low", Value::from("0.29")),
        ("/closure/by_state", Value::from(3)),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(pointer).unwrap() = wrong;
        assert_eq!(faults(&bad).len(), 1, "{pointer}");
    }
    let mut bad = good;
    bad["closure"].as_object_mut().unwrap().remove("floor");
    assert_eq!(faults(&bad).len(), 1);
}

/// The contract's example, if the contract is next to the repository.
#[test]
fn the_contract_s_example_keeps_the_schema_and_is_written_back_unchanged() {
    let Some(path) = gpsindy_beside::shared("CONTRACT.md") else { return };
    let contract = std::fs::read_to_string(path).unwrap();
    let begin = contract.find("```json\n").unwrap() + 8;
    let text = &contract[begin..][..contract[begin..].find("```").unwrap()];
    let json: Value = serde_json::from_str(text).unwrap();
    assert_eq!(faults(&json), [""; 0]);
    let report: gpsindy_core::diagnose::Diagnosis = serde_json::from_str(text).unwrap();
    assert_eq!(report.included().count(), 1);
    assert_eq!(serde_json::to_value(&report).unwrap(), json);
}
