//! The inspection for people.

use super::{ColumnReport, Inspection, TopicReport};

/// Fields of a topic that are shown; the JSON has them all.
const FIELDS: usize = 24;

/// Findings that are shown.
const FINDINGS: usize = 30;

pub(crate) fn of(inspection: &Inspection, width: usize) -> String {
    let mut text = format!("{}: {}", inspection.file, inspection.format);
    if inspection.topics.iter().any(|t| !t.topic.is_empty()) {
        text += &format!(", {}", count(inspection.topics.len(), "topic"));
    }
    text += "\n";
    for topic in &inspection.topics {
        text += "\n";
        text += &of_topic(topic);
    }
    text += "\n";
    text += &findings(inspection, width);
    for note in &inspection.notes {
        text += &wrapped(&format!("note: {note}"), "", width);
    }
    text
}

fn of_topic(topic: &TopicReport) -> String {
    let mut text = String::new();
    if !topic.topic.is_empty() {
        text += &format!("{}  {}\n", topic.topic, topic.kind);
    }
    let clock = &topic.clock;
    text += &format!("  {}", count(topic.count, "sample"));
    if topic.runs > 1 {
        text += &format!(" in {} runs", topic.runs);
    }
    if let (Some(rate), Some(period)) = (clock.rate, clock.period) {
        text += &format!(", {} Hz (every {} s)", short(rate), short(period));
    }
    if let Some(jitter) = clock.jitter {
        text += &format!(", jitter {} %", short(100.0 * jitter));
    }
    text += &match clock.gaps {
        0 => ", no gaps".to_string(),
        n => format!(", {}, the longest {} s", count(n, "gap"), short(clock.longest.unwrap_or(0.0))),
    };
    text += "\n";
    if let (Some(first), Some(last)) = (clock.first, clock.last) {
        let of = match clock.clock.as_str() {
            "header" => "stamps of the headers".to_string(),
            "log" => "times of recording".to_string(),
            column => format!("time `{column}`"),
        };
        text += &format!("  {of}: {} s to {} s", stamp(first), stamp(last));
        if let Some(latency) = clock.latency {
            text += &format!("; recorded {} ms later (median)", short(1e3 * latency));
        }
        text += "\n";
    }
    let mut rows =
        vec![["field", "type", "unit", "min", "max", "missing", "step", "repeats"].map(String::from).to_vec()];
    rows.extend(topic.columns.iter().take(FIELDS).map(|column| row(column, topic)));
    if rows.len() > 1 {
        text += &aligned(&rows);
    }
    if topic.columns.len() > FIELDS {
        text += &format!("  and {} more fields, in --json\n", topic.columns.len() - FIELDS);
    }
    text
}

fn row(column: &ColumnReport, topic: &TopicReport) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or(String::new(), short);
    let share = |value: f64| if value == 0.0 { String::new() } else { format!("{} %", short(100.0 * value)) };
    // A table names a column by its name, a topic a field by its path.
    let name = if topic.topic.is_empty() { &column.column } else { &column.name };
    vec![
        name.clone(),
        column.kind.clone(),
        column.unit.clone(),
        number(column.min),
        number(column.max),
        if column.numeric { share(column.missing) } else { String::new() },
        number(column.step),
        if column.constant { "constant".into() } else { share(column.repeated) },
    ]
}

fn findings(inspection: &Inspection, width: usize) -> String {
    if inspection.findings.is_empty() {
        return "no flaw found that would harm an identification\n".into();
    }
    let mut text = String::from("flaws that would harm an identification:\n");
    for finding in inspection.findings.iter().take(FINDINGS) {
        let place = match (&finding.topic, &finding.column) {
            (topic, None) if topic.is_empty() => "stamps".to_string(),
            (topic, None) => topic.clone(),
            (topic, Some(column)) if topic.is_empty() => column.clone(),
            (topic, Some(column)) => format!("{topic}.{column}"),
        };
        text += &wrapped(&format!("{place}: {}", finding.text), "  ", width);
    }
    if inspection.findings.len() > FINDINGS {
        text += &format!("  and {} more, in --json\n", inspection.findings.len() - FINDINGS);
    }
    text
}

/// Lines of at most `width` characters, later ones further in.
fn wrapped(text: &str, indent: &str, width: usize) -> String {
    let mut lines = vec![indent.to_string()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if lines[last].chars().count() + word.chars().count() >= width && !lines[last].trim().is_empty() {
            lines.push(format!("{indent}  {word}"));
        } else {
            let gap = if lines[last].trim().is_empty() { "" } else { " " };
            lines[last] += &format!("{gap}{word}");
        }
    }
    lines.join("\n") + "\n"
}

fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows[0].len();
    let used: Vec<bool> = (0..columns).map(|j| j < 2 || rows[1..].iter().any(|row| !row[j].is_empty())).collect();
    let widths: Vec<usize> =
        (0..columns).map(|j| rows.iter().map(|row| row[j].chars().count()).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::from(" ");
        for j in (0..columns).filter(|j| used[*j]) {
            let blanks = " ".repeat(widths[j] - row[j].chars().count());
            line += &if j < 3 { format!(" {}{blanks} ", row[j]) } else { format!(" {blanks}{} ", row[j]) };
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

fn count(n: usize, noun: &str) -> String {
    if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
}

/// A stamp to the millisecond.
fn stamp(seconds: f64) -> String {
    let text = format!("{seconds:.3}");
    text.strip_suffix(".000").map_or(text.clone(), Into::into)
}

/// A number with four significant digits.
pub(crate) fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&exponent) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.*}", (3 - exponent).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}
