//! The summary of a diagnosis for a terminal: one screenful, readable without a manual.

use crate::numbers::{number, number_or, p_value, percent, span, with_deviation, with_unit};
use crate::provenance::Provenance;
use crate::sets::set_sentence;
use crate::words::{
    between_sentence, cause_name, cause_place, closure_sentence, equivalents, excluded_name, interval, is_random,
    left_sentence, listed, parameter_meaning, stability_sentence, verdict_name, verdict_sentence,
};
use gpsindy_core::diagnose::report::{Cause, Diagnosis, Verdict};

/// Width of the column of headings.
const INDENT: usize = 9;
/// Rows of a list before it is cut; the page and the JSON carry all.
const ROWS: usize = 4;

/// Share of a residual from which noise is as large.
const AS_LARGE: f64 = 0.9;

/// The diagnosis as a screenful of text, `width` characters wide (at least 40), in colour on request.
///
/// Ends with a newline. Colour marks the verdict and the headings only; the words say everything.
pub fn summary(report: &Diagnosis, width: usize, colour: bool) -> String {
    summary_with(report, &Provenance::default(), width, colour)
}

/// As [`summary`], with times in the unit of the logs.
pub fn summary_with(report: &Diagnosis, provenance: &Provenance, width: usize, colour: bool) -> String {
    let time_unit = provenance.time_unit();
    let mut text = Text { lines: Vec::new(), width: width.max(40), colour };
    verdict(report, &mut text);
    place(report, time_unit, &mut text);
    which(report, &mut text);
    if let Some(set) = set_sentence(report) {
        text.say("Set", &set);
    }
    text.list("By joint", &report.by_part.iter().map(|row| format!("{}: {}", row.part, row.says)).collect::<Vec<_>>());
    excluded(report, &mut text);
    closure(report, time_unit, &mut text);
    checks(report, &mut text);
    next(report, &mut text);
    if let Some(power) = &report.power {
        for (i, line) in crate::power::lines(power).iter().enumerate() {
            text.hang(if i == 0 { "Power" } else { "" }, line);
        }
    }
    (text.lines.join("\n") + "\n").replace('\u{a0}', " ")
}

fn verdict(report: &Diagnosis, text: &mut Text) {
    let code = match report.verdict {
        Verdict::NoGap | Verdict::Explained => "1;32",
        Verdict::PartlyExplained => "1;33",
        _ => "1;31",
    };
    let name = verdict_name(report.verdict).to_uppercase();
    let line = format!("{name}  {}", text.painted(&report.model, "2"));
    text.lines.push(text.painted(&name, code) + &line[name.len()..]);
    for line in wrap(&verdict_sentence(report), text.width) {
        text.lines.push(line);
    }
    text.lines.push(String::new());
}

fn place(report: &Diagnosis, time_unit: &str, text: &mut Text) {
    let gap = &report.gap;
    if report.is_undecided() {
        text.say("Gap", "not decided: the search ended too early");
    } else {
        let found = if gap.detected { "found" } else { "none found" };
        text.say("Gap", &format!("{found} ({} under noise alone)", p_value(gap.p_value)));
    }
    let mut rows: Vec<String> = Vec::new();
    for row in gap.by_state.iter().filter(|_| gap.detected).take(ROWS) {
        let residual = with_unit(&number(row.residual_rms), &row.unit);
        // Two equal numbers would look like a gap of nothing: the gap is elsewhere than in a function of this row's variables.
        let noise = match row.noise_rms > AS_LARGE * row.residual_rms {
            true => "no larger than noise gives".into(),
            false => format!("noise {}", number(row.noise_rms)),
        };
        rows.push(format!(
            "{:>6}  {}  {}': residual {residual}, {noise}",
            percent(row.share),
            bar(row.share),
            row.state,
        ));
    }
    for row in largest(&gap.by_region, |r| r.share).into_iter().filter(|_| gap.detected) {
        let (from, to) = span(row.from, row.to);
        rows.push(format!("{:>6}  {}  {} from {from} to {to}", percent(row.share), bar(row.share), row.variable));
    }
    for row in largest(&gap.by_window, |w| w.share).into_iter().filter(|_| gap.detected) {
        let (from, to) = span(row.from, row.to);
        rows.push(format!("{:>6}  {}  {}, {from} to {to} {time_unit}", percent(row.share), bar(row.share), row.run));
    }
    text.list("Where", &rows);
}

/// The two rows with the largest shares, in their order.
fn largest<T>(rows: &[T], share: impl Fn(&T) -> f64) -> Vec<&T> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|&a, &b| share(&rows[b]).total_cmp(&share(&rows[a])));
    order.truncate(2);
    order.sort_unstable();
    order.into_iter().map(|i| &rows[i]).collect()
}

fn which(report: &Diagnosis, text: &mut Text) {
    let included = report.included().count();
    let shown = report.causes.iter().filter(|c| c.included || c.probability >= 0.01).take(included.max(ROWS));
    let mut heading = "Which";
    for cause in shown {
        let mark = if cause.included { "*" } else { " " };
        text.say(
            heading,
            &format!("{:>6} {mark} {} {}", percent(cause.probability), cause_name(cause), cause_place(cause)),
        );
        heading = "";
        for line in details(cause) {
            text.say_at("", &line, INDENT + 9);
        }
    }
    let random = report.included().filter(|cause| is_random(cause)).count();
    if included > random {
        text.say("", "       * in the augmented model");
    }
    if random > 0 {
        text.say("", "Random forcing is a statement about the row: no equation of the augmented model changes.");
    }
    // Parameters of the nominal model that have another value now; what the causes added is next to them.
    let moved = report.parameters.iter().filter(|p| p.nominal.is_some_and(|nominal| nominal != p.value));
    let rows: Vec<String> = moved
        .map(|p| {
            let value = with_unit(&with_deviation(p.value, p.deviation), &p.unit);
            format!("{}: {} -> {value}", p.name, number_or(p.nominal, ""))
        })
        .collect();
    text.list("Values", &rows);
}

fn details(cause: &Cause) -> Vec<String> {
    let mut lines = Vec::new();
    if cause.included {
        let sizes: Vec<String> = cause
            .parameters
            .iter()
            .map(|parameter| {
                let (value, range) = interval(parameter);
                let range = range.map(|range| format!(" ({range})")).unwrap_or_default();
                let meaning = parameter_meaning(cause, parameter);
                format!("{}{meaning} = {}{range}", parameter.name, with_unit(&value, &parameter.unit))
            })
            .collect();
        lines.push(
            [cause.form.clone(), sizes.join(", ")]
                .into_iter()
                .filter(|s| !s.is_empty())
                .collect::<Vec<_>>()
                .join("   "),
        );
    }
    if let Some(stability) = cause.stability.as_ref().filter(|s| !s.disagree.is_empty()) {
        lines.push(stability_sentence(stability));
    }
    lines.extend(cause.between_runs.iter().map(between_sentence));
    let names = equivalents(cause);
    if !names.is_empty() {
        lines.push(format!("these logs cannot distinguish it from {}", listed(&names, "or")));
    }
    lines.retain(|line| !line.is_empty());
    lines
}

fn excluded(report: &Diagnosis, text: &mut Text) {
    let mut rows: Vec<String> = report
        .excluded
        .iter()
        .take(ROWS)
        .map(|row| format!("{} above {}", excluded_name(row), with_unit(&number(row.above), &row.unit)))
        .collect();
    if report.excluded.len() > ROWS {
        rows.push(format!("{} more", report.excluded.len() - ROWS));
    }
    if !rows.is_empty() {
        text.say("Excluded", &rows.join("; "));
    }
}

fn closure(report: &Diagnosis, time_unit: &str, text: &mut Text) {
    let closure = &report.closure;
    if report.verdict == Verdict::NoGap {
        return;
    }
    if closure.before.is_none() && closure.after.is_none() {
        // Not one rollout gave a number, so none is compared.
        text.say("Closure", &closure_sentence(report, time_unit));
    } else if report.included().next().is_none() {
        let before = number_or(closure.before, "diverged");
        text.say(
            "Closure",
            &format!("rollout error {before} times the noise, floor {}", number_or(closure.floor, "unknown")),
        );
        text.say("", &closure_sentence(report, time_unit));
    } else {
        let source =
            if closure.floor_source.is_empty() { String::new() } else { format!(" ({})", closure.floor_source) };
        text.say(
            "Closure",
            &format!(
                "rollout error {} -> {} times the noise, floor {}{source}",
                number_or(closure.before, "diverged"),
                number_or(closure.after, "diverged"),
                number_or(closure.floor, "unknown")
            ),
        );
        text.say("", &closure_sentence(report, time_unit));
    }
}

/// The checks that fail, in words; of those that pass their number.
fn checks(report: &Diagnosis, text: &mut Text) {
    let failed: Vec<String> =
        report.checks.iter().filter(|check| !check.passed).map(|check| check.says.clone()).collect();
    match (report.checks.len(), failed.len()) {
        (0, _) => {}
        (all, 0) => text.say("Checks", &format!("all {all} pass")),
        (all, count) => {
            text.say("Checks", &format!("{count} of {all} fail"));
            failed.iter().for_each(|says| text.say("", says));
        }
    }
}

fn next(report: &Diagnosis, text: &mut Text) {
    if report.verdict != Verdict::NoGap && !report.is_undecided() {
        text.say("Left", &left_sentence(report));
    }
    let mut experiments: Vec<String> = report.causes.iter().filter_map(|c| c.next_experiment.clone()).collect();
    let mut seen = std::collections::BTreeSet::new();
    experiments.retain(|e| seen.insert(e.clone()));
    experiments.truncate(2);
    text.list("Next", &experiments);
    let mut notes: Vec<String> = report.notes.iter().take(ROWS).cloned().collect();
    if report.notes.len() > ROWS {
        notes.push(format!("{} more in the report", report.notes.len() - ROWS));
    }
    text.list("Note", &notes);
}

/// Ten characters for a share.
fn bar(share: f64) -> String {
    let full = if share.is_finite() { (share * 10.0).round().clamp(0.0, 10.0) as usize } else { 0 };
    "█".repeat(full) + &"·".repeat(10 - full)
}

struct Text {
    lines: Vec<String>,
    width: usize,
    colour: bool,
}

impl Text {
    fn painted(&self, words: &str, code: &str) -> String {
        if self.colour { format!("\x1b[{code}m{words}\x1b[0m") } else { words.into() }
    }

    fn say(&mut self, heading: &str, words: &str) {
        self.say_at(heading, words, INDENT);
    }

    /// Wrapped words, all lines `indent` deep, the heading before the first.
    fn say_at(&mut self, heading: &str, words: &str, indent: usize) {
        let head = format!("{heading:<indent$}");
        let head = if heading.is_empty() { head } else { self.painted(&head, "1") };
        for (i, line) in wrap(words.trim_end(), self.width.saturating_sub(indent)).into_iter().enumerate() {
            let lead = if i == 0 { head.clone() } else { " ".repeat(indent) };
            self.lines.push((lead + &line).trim_end().to_string());
        }
    }

    /// A row of a table: what does not fit goes on deeper.
    fn hang(&mut self, heading: &str, row: &str) {
        if !row.starts_with(' ') {
            return self.say(heading, row);
        }
        for (i, line) in wrap(row.trim(), self.width.saturating_sub(INDENT + 6)).into_iter().enumerate() {
            self.lines.push(" ".repeat(INDENT + if i == 0 { 2 } else { 6 }) + &line);
        }
    }

    fn list(&mut self, heading: &str, rows: &[String]) {
        for (i, row) in rows.iter().enumerate() {
            self.say(if i == 0 { heading } else { "" }, row);
        }
    }
}

/// Lines of at most `width` characters, broken at spaces; a longer word has a line of its own. Leading spaces stay.
fn wrap(words: &str, width: usize) -> Vec<String> {
    let lead = words.len() - words.trim_start().len();
    let mut lines = vec![words[..lead].to_string()];
    let mut empty = true;
    for word in words[lead..].split(' ') {
        let Some(line) = lines.last_mut() else { break };
        if !empty && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_string());
            continue;
        }
        if !empty {
            line.push(' ');
        }
        line.push_str(word);
        empty = false;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_wrap_at_spaces_and_a_long_word_stands_alone() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("  a-very-long-word b", 5), ["  a-very-long-word", "b"]);
        assert_eq!(wrap("", 5), [""]);
    }

    #[test]
    fn a_bar_has_ten_characters_whatever_the_share() {
        for share in [-1.0, 0.0, 0.04, 0.5, 1.0, 7.0, f64::NAN] {
            assert_eq!(bar(share).chars().count(), 10);
        }
    }
}
