//! The one place where topics become runs: the union of their stamps, states missing between theirs, controls held.

use crate::error::{Error, Result};
use crate::topic::Topic;
use faer::Mat;
use gpsindy_core::{Hold, Run};
use std::collections::HashMap;

/// The columns of a task and how they go between their stamps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Roles<'a> {
    /// One a column: whether it is a control, a function of time between its own stamps.
    pub(crate) held: &'a [bool],
    /// What a control does between its own stamps.
    pub(crate) hold: Hold,
}

/// The runs of a log in their order, under the runs' own names, and what the user should know.
///
/// A run of a task with controls, or of several topics, begins with the first stamp at which a state was measured and ends with the last:
/// before and after there is nothing to compare a model with. A table of which one row alone has a state keeps those behind it: it says
/// where a rollout starts and what drives it.
///
/// # Errors
/// Topics of one run that have no time in common.
pub(crate) fn merge(file: &str, topics: Vec<Topic>, roles: Roles<'_>) -> Result<(Vec<Run>, Vec<String>)> {
    let mut names: Vec<String> = Vec::new();
    let mut grouped: HashMap<String, Vec<Topic>> = HashMap::new();
    for topic in topics {
        if !grouped.contains_key(&topic.run) {
            names.push(topic.run.clone());
        }
        grouped.entry(topic.run.clone()).or_default().push(topic);
    }
    let (mut runs, mut notes) = (Vec::with_capacity(names.len()), Vec::new());
    for name in names {
        let parts = grouped.remove(&name).unwrap_or_default();
        runs.push(run(file, name, parts, roles, &mut notes)?);
    }
    Ok((runs, notes))
}

fn run(file: &str, name: String, mut parts: Vec<Topic>, roles: Roles<'_>, notes: &mut Vec<String>) -> Result<Run> {
    check_overlap(file, &parts)?;
    let alone = parts.len() == 1;
    let mut time = if alone { std::mem::take(&mut parts[0].stamps) } else { union(&parts) };
    let mut values = Mat::full(time.len(), roles.held.len(), f64::NAN);
    for part in &mut parts {
        let rows = if alone { Vec::new() } else { rows_of(&part.stamps, &time) };
        // A long log is not held twice.
        for (column, samples) in &mut part.columns {
            let (column, samples) = (*column, std::mem::take(samples));
            let target = values.col_as_slice_mut(column);
            if alone {
                target.copy_from_slice(&samples);
            }
            for (&row, &sample) in rows.iter().zip(&samples) {
                target[row] = sample;
            }
            if roles.held[column] {
                fill(&time, target, roles.hold);
            }
        }
    }
    let (mut first, mut last) = (0, time.len());
    if !alone || roles.held.contains(&true) {
        let measured = |i: usize| (0..roles.held.len()).any(|j| !roles.held[j] && !values[(i, j)].is_nan());
        first = (0..time.len()).find(|&i| measured(i)).unwrap_or(0);
        last = (first..time.len()).rev().find(|&i| measured(i)).map_or(time.len(), |i| i + 1);
    }
    if alone {
        last = if last == first + 1 { time.len() } else { last };
        let left_out = first + time.len() - last;
        if left_out > 0 {
            let whose = if name.is_empty() { String::new() } else { format!(" of run `{name}`") };
            notes.push(format!(
                "{file}: {left_out} rows{whose} before the first state or behind the last were left out"
            ));
        }
    } else {
        late_controls(file, &parts, roles, time[first], notes);
    }
    if (first, last) != (0, time.len()) {
        time = time[first..last].to_vec();
        values = Mat::from_fn(last - first, roles.held.len(), |i, j| values[(first + i, j)]);
    }
    Ok(Run { name, time, values })
}

/// The stamps of all topics in order, each once.
fn union(parts: &[Topic]) -> Vec<f64> {
    let mut time: Vec<f64> = parts.iter().flat_map(|p| p.stamps.iter().copied()).collect();
    time.sort_by(f64::total_cmp);
    time.dedup();
    time
}

/// Where the stamps lie among the times of the run.
fn rows_of(stamps: &[f64], time: &[f64]) -> Vec<usize> {
    let mut row = 0;
    let place = |stamp: &f64| {
        while row < time.len() && time[row] < *stamp {
            row += 1;
        }
        row
    };
    stamps.iter().map(place).collect()
}

/// The values of a control at the stamps of other topics, from its own before (and, in a straight line, after).
fn fill(time: &[f64], values: &mut [f64], hold: Hold) {
    let mut before: Option<usize> = None;
    for i in 0..values.len() {
        if values[i].is_nan() {
            continue;
        }
        if let Some(b) = before {
            for k in b + 1..i {
                values[k] = match hold {
                    Hold::Linear => {
                        let part = (time[k] - time[b]) / (time[i] - time[b]);
                        values[b] + part * (values[i] - values[b])
                    }
                    _ => values[b],
                };
            }
        }
        before = Some(i);
    }
    if let Some(b) = before {
        let last = values[b];
        values[b + 1..].fill(last);
    }
}

fn check_overlap(file: &str, parts: &[Topic]) -> Result<()> {
    for (i, a) in parts.iter().enumerate() {
        for b in &parts[..i] {
            let (Some((a0, a1)), Some((b0, b1))) = (span(a), span(b)) else { continue };
            if a0 > b1 || b0 > a1 {
                let message = format!(
                    "topics `{}` ({b0} s to {b1} s) and `{}` ({a0} s to {a1} s) have no time in common; \
                     choose their clock with --stamp log or --stamp header, or shift one with --offset TOPIC=SECONDS",
                    b.name, a.name
                );
                return Err(Error::file(file, message));
            }
        }
    }
    Ok(())
}

fn span(topic: &Topic) -> Option<(f64, f64)> {
    Some((*topic.stamps.first()?, *topic.stamps.last()?))
}

/// A control whose topic begins after the states is held back from its first value: the user should know.
fn late_controls(file: &str, parts: &[Topic], roles: Roles<'_>, begin: f64, notes: &mut Vec<String>) {
    for part in parts.iter().filter(|p| p.columns.iter().any(|(column, _)| roles.held[*column])) {
        let Some((first, last)) = span(part) else { continue };
        let step = (last - first) / part.stamps.len().max(2) as f64;
        if first - begin > 2.0 * step {
            notes.push(format!(
                "{file}: the controls of `{}` begin {:.3} s after the states; until then their first values are taken",
                part.name,
                first - begin
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, column: usize, stamps: &[f64], values: &[f64]) -> Topic {
        Topic { name: name.into(), run: String::new(), stamps: stamps.into(), columns: vec![(column, values.into())] }
    }

    fn merged(topics: &[Topic], held: &[bool], hold: Hold) -> Run {
        merge("log", topics.to_vec(), Roles { held, hold }).unwrap().0.remove(0)
    }

    fn shown(values: &[f64]) -> String {
        values.iter().map(|v| if v.is_nan() { "-".into() } else { v.to_string() }).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn states_are_missing_and_controls_held_at_the_stamps_of_others() {
        let topics =
            [topic("q", 0, &[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]), topic("u", 1, &[0.5, 1.5, 3.5], &[5.0, 6.0, 7.0])];
        let run = merged(&topics, &[false, true], Hold::Zero);
        assert_eq!(run.time, [1.0, 1.5, 2.0, 3.0]);
        assert_eq!(shown(run.column(0)), "10 - 20 30");
        assert_eq!(shown(run.column(1)), "5 6 6 6");
        let run = merged(&topics, &[false, true], Hold::Linear);
        assert_eq!(shown(run.column(1)), "5.5 6 6.25 6.75");
    }

    #[test]
    fn equal_stamps_make_one_row() {
        let topics =
            [topic("q", 0, &[0.0, 0.1, 0.2], &[1.0, 2.0, 3.0]), topic("v", 1, &[0.0, 0.1, 0.2], &[4.0, 5.0, 6.0])];
        let run = merged(&topics, &[false, false], Hold::Zero);
        assert_eq!((run.time.as_slice(), shown(run.column(1)).as_str()), (&[0.0, 0.1, 0.2][..], "4 5 6"));
    }

    #[test]
    fn topics_without_a_common_time_are_refused_by_name() {
        let topics = [topic("/q", 0, &[0.0, 1.0], &[1.0, 2.0]), topic("/u", 1, &[5.0, 6.0], &[4.0, 5.0])];
        let error =
            merge("log", topics.to_vec(), Roles { held: &[false, true], hold: Hold::Zero }).unwrap_err().to_string();
        assert!(error.contains("`/q` (0 s to 1 s) and `/u` (5 s to 6 s) have no time in common"), "{error}");
    }

    #[test]
    fn runs_keep_their_order_and_their_rows() {
        let mut topics = vec![topic("", 0, &[0.0, 1.0], &[1.0, f64::NAN]), topic("", 0, &[0.0, 2.0], &[3.0, 4.0])];
        topics[0].run = "b".into();
        topics[1].run = "a".into();
        let (runs, _) = merge("log", topics, Roles { held: &[false], hold: Hold::Zero }).unwrap();
        assert_eq!(runs.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["b", "a"]);
        assert_eq!(shown(runs[0].column(0)), "1 -");
    }

    #[test]
    fn a_table_loses_the_rows_without_a_state_as_topics_do() {
        let rows = [f64::NAN, f64::NAN, 1.0, f64::NAN, 2.0, f64::NAN];
        let time = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
        let driven = [7.0, 8.0, f64::NAN, 9.0, f64::NAN, 10.0];
        let present = |values: &[f64]| -> (Vec<f64>, Vec<f64>) {
            time.iter().zip(values).filter(|(_, v)| !v.is_nan()).map(|(t, v)| (*t, *v)).unzip()
        };
        let table = Topic { columns: vec![(0, rows.into()), (1, driven.into())], ..topic("", 0, &time, &rows) };
        let ((tq, q), (tu, u)) = (present(&rows), present(&driven));
        let topics = [topic("q", 0, &tq, &q), topic("u", 1, &tu, &u)];
        for hold in [Hold::Zero, Hold::Linear] {
            let (a, b) =
                (merged(std::slice::from_ref(&table), &[false, true], hold), merged(&topics, &[false, true], hold));
            assert_eq!(
                (&a.time, shown(a.column(0)), shown(a.column(1))),
                (&b.time, shown(b.column(0)), shown(b.column(1)))
            );
        }
        let (_, notes) = merge("log", vec![table], Roles { held: &[false, true], hold: Hold::Zero }).unwrap();
        assert_eq!(notes, ["log: 3 rows before the first state or behind the last were left out"]);
        // A first state and the controls of a rollout.
        let start = Topic {
            columns: vec![(0, vec![1.0, f64::NAN, f64::NAN]), (1, vec![1.0, 2.0, 3.0])],
            ..topic("", 0, &time[..3], &[])
        };
        assert_eq!(merged(&[start], &[false, true], Hold::Zero).time, time[..3]);
    }

    #[test]
    fn a_control_that_begins_late_is_stated() {
        let topics =
            [topic("q", 0, &[0.0, 1.0, 2.0], &[1.0, 2.0, 3.0]), topic("/u", 1, &[1.5, 1.6, 1.7], &[4.0, 5.0, 6.0])];
        let (_, notes) = merge("log", topics.to_vec(), Roles { held: &[false, true], hold: Hold::Zero }).unwrap();
        assert_eq!(
            notes,
            ["log: the controls of `/u` begin 1.500 s after the states; until then their first values are taken"]
        );
    }
}
