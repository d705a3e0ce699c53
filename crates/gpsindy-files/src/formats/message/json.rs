//! Messages in JSON: the same paths, found in each message anew.

use crate::formats::message::cdr::Leaf;
use crate::formats::message::path::Step;
use crate::formats::message::want::LISTS;
use serde_json::Value;

/// Elements of an array that are shown one by one.
const SHOWN: usize = 32;

/// The number at a path; `None` where the message has none there.
pub(crate) fn number(message: &Value, path: &[Step]) -> Option<f64> {
    // Lists of names on the way, the innermost last.
    let mut names: Vec<&Vec<Value>> = Vec::new();
    let mut value = message;
    for step in path {
        names.extend(LISTS.iter().filter_map(|list| value.get(list).and_then(Value::as_array)).take(1));
        value = match step {
            Step::Field(name) => value.get(name)?,
            Step::Item(item) => match item.parse::<usize>() {
                Ok(index) => value.get(index)?,
                Err(_) => match value.get(item) {
                    Some(below) => below,
                    None => {
                        let index = names.last()?.iter().position(|n| n.as_str() == Some(item))?;
                        value.get(index)?
                    }
                },
            },
        };
    }
    match value {
        Value::Bool(flag) => Some(f64::from(u8::from(*flag))),
        Value::Number(number) => number.as_f64(),
        // How some writers put what JSON has no number for: missing here.
        Value::String(text) if text.eq_ignore_ascii_case("nan") => Some(f64::NAN),
        _ => None,
    }
}

/// The fields of a message, as in [`crate::formats::message::cdr::leaves`].
pub(crate) fn leaves(message: &Value) -> Vec<Leaf> {
    let mut found = Vec::new();
    walk(message, &mut Vec::new(), &[], &mut found);
    found
}

fn walk(value: &Value, path: &mut Vec<Step>, names: &[String], found: &mut Vec<Leaf>) {
    let type_name = match value {
        Value::Null => "null",
        Value::Bool(_) => "bool",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(items) => {
            let by_name = items.len() == names.len();
            if items.len() <= SHOWN {
                for (i, item) in items.iter().enumerate() {
                    path.push(Step::Item(if by_name { names[i].clone() } else { i.to_string() }));
                    walk(item, path, names, found);
                    path.pop();
                }
                return;
            }
            "array"
        }
        Value::Object(fields) => {
            let list = LISTS.iter().find_map(|list| fields.get(*list).and_then(Value::as_array));
            let own: Vec<String> = list.into_iter().flatten().filter_map(|n| n.as_str().map(Into::into)).collect();
            for (name, below) in fields {
                path.push(Step::Field(name.clone()));
                walk(below, path, if own.is_empty() { names } else { &own }, found);
                path.pop();
            }
            return;
        }
    };
    found.push(Leaf {
        path: path.clone(),
        type_name: type_name.into(),
        number: matches!(value, Value::Bool(_) | Value::Number(_)),
    });
}
