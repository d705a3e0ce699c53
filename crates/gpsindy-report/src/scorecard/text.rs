//! The score card as text.

use super::{CalibrationGroup, HandedOver, Judged, Kind, LeftOut, PredictionSets, Rate, ScoreCard, Stratum};
use crate::numbers::{fixed, number};
use crate::words::verdict_name;
use gpsindy_core::diagnose::report::Verdict;
use std::fmt::Write;

pub(super) fn text(card: &ScoreCard) -> String {
    let mut text = String::new();
    let n = card.counts;
    line(
        &mut text,
        &format!(
            "{} cases: {} null, {} with one effect, {} with several, {} outside the catalogue; {} without a diagnosis",
            n.cases, n.null, n.single, n.several, n.outside, n.failed
        ),
    );
    line(&mut text, "");
    line(&mut text, &format!("{:<52} {:>9} {:>7}   95 % interval", "", "hit / of", "rate"));
    rate(&mut text, "gap found, gap at least the noise", card.detected);
    strata(&mut text, &card.detected_by_snr);
    rate(&mut text, "null: false alarm, p < 0.05", card.false_alarms);
    rate(&mut text, "null: a cause included", card.false_causes);
    rate(&mut text, "one effect: right equation, gap at least 3 x noise", card.right_state);
    rate(&mut text, "one effect: best cause at the right place", card.right_cause_state);
    rate(&mut text, "one effect: best cause right", card.top_1);
    strata(&mut text, &card.top_1_by_snr);
    rate(&mut text, "one effect: right one among the best three", card.top_3);
    rate(&mut text, "one effect: best cause right by its own name", card.named);
    rate(&mut text, "several effects: best cause right", card.several_top_1);
    rate(&mut text, "several effects: all right", card.several_found);
    rate(&mut text, "several effects: all right and no other", card.several_exact);
    rate(&mut text, "outside the catalogue: right equation", card.right_state_outside);
    rate(&mut text, "outside the catalogue: wrongly explained", card.wrongly_explained);
    rate(&mut text, "in the catalogue: needlessly unexplained", card.needlessly_unexplained);
    rate(&mut text, "in the catalogue: needlessly partly explained", card.needlessly_partly);
    rate(&mut text, "verdict right", card.right_verdict);
    rate(&mut text, "causes stated with 0.9 or more: right", card.calibration.stated_090);
    if let Some(sets) = &card.prediction_sets {
        rate(&mut text, "prediction set: holds every missing effect", sets.covered);
        rate(&mut text, "  with an effect that the report does not list", sets.none_of_these);
    }
    if let Some(left_out) = &card.left_out {
        rate(&mut text, "effect left out of the catalogue: explained", left_out.explained);
        rate(&mut text, "  by what was not called equivalent to it", left_out.wrongly_explained);
        rate(&mut text, "  and misses the held-out logs by more than it", left_out.visibly_wrong);
    }
    if let Some(handed) = &card.handed {
        rate(&mut text, "in the catalogue: the right set was fitted", handed.right_set);
        rate(&mut text, "fits at rest that gain 0.5 to 2 times their promise", handed.kept);
    }
    line(&mut text, "");
    figure(&mut text, "mean size of the group of the best cause", card.mean_group_size);
    if let Some(sets) = &card.prediction_sets {
        figure(&mut text, "mean number of effects in a prediction set", sets.mean_size);
    }
    figure(&mut text, "Brier score of all causes", card.calibration.brier);
    figure(&mut text, "expected calibration error", card.calibration.expected_error);
    figure(&mut text, "  where a part of an effect outside is no hit", card.strict_calibration.expected_error);
    figure(&mut text, "closure relative to the oracle, median", card.closure.median);
    figure(&mut text, "closure relative to the oracle, 10th percentile", card.closure.percentile_10);
    if let Some(handed) = &card.handed {
        ranks(&mut text, handed);
    }
    reliability(&mut text, card);
    if let Some(sets) = &card.prediction_sets {
        calibration(&mut text, sets);
    }
    cases(&mut text, card);
    if let Some(left_out) = &card.left_out {
        without(&mut text, left_out);
    }
    text
}

fn line(text: &mut String, words: &str) {
    text.push_str(words.trim_end());
    text.push('\n');
}

fn rate(text: &mut String, name: &str, rate: Rate) {
    let counts = format!("{} / {}", rate.hits, rate.of);
    let Rate { rate: Some(share), low: Some(low), high: Some(high), .. } = rate else {
        line(text, &format!("{name:<52} {counts:>9} {:>7}", "-"));
        return;
    };
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let (share, low, high) = (percent(share), percent(low), percent(high));
    line(text, &format!("{name:<52} {counts:>9} {share:>7}   {low} to {high}"));
}

fn strata(text: &mut String, strata: &[Stratum]) {
    for stratum in strata.iter().filter(|s| s.rate.of > 0) {
        let name = match stratum.to {
            Some(to) => format!("  gap {} to {} x noise", fixed(stratum.from, 1), fixed(to, 1)),
            None => format!("  gap {} x noise and more", fixed(stratum.from, 1)),
        };
        rate(text, &name, stratum.rate);
    }
}

fn figure(text: &mut String, name: &str, value: Option<f64>) {
    line(text, &format!("{name:<52} {:>9}", value.map_or("-".into(), |v| format!("{v:.3}"))));
}

/// How far each family keeps the order that straight lines promise.
fn ranks(text: &mut String, handed: &HandedOver) {
    line(text, "");
    line(text, "promised and achieved gain  at rest   rank correlation");
    for family in &handed.families {
        let correlation = family.correlation.map_or("-".into(), |c| format!("{c:.3}"));
        line(text, &format!("{:<28} {:>6} {correlation:>18}", family.family, family.of));
    }
    if !handed.missed.is_empty() {
        line(text, &format!("the right set was not fitted: {}", handed.missed.join(", ")));
    }
}

fn reliability(text: &mut String, card: &ScoreCard) {
    if card.calibration.brier.is_none() {
        return;
    }
    let bins = card.calibration.bins.iter().filter(|bin| bin.right.of > 0);
    line(text, "");
    line(text, "stated probability   causes   mean stated   right");
    for bin in bins {
        let (Some(stated), Some(right)) = (bin.stated, bin.right.rate) else { continue };
        line(text, &format!("{:.1} to {:.1} {:>18} {stated:>13.3} {right:>7.3}", bin.from, bin.to, bin.right.of));
    }
}

/// The table that these cases would calibrate, with what it gives to each of them when that is left out.
fn calibration(text: &mut String, sets: &PredictionSets) {
    line(text, "");
    if sets.abstained + sets.undetected > 0 {
        line(text, &format!("without a prediction set: {} unlike, {} without a gap", sets.abstained, sets.undetected));
    }
    let (least, most) = sets.gaps;
    line(text, &format!("gaps of {least:.3} to {most:.3} times the noise, rests up to {:.4} of the gap", sets.rest));
    line(text, "prediction sets       cases   least credit to calibrate   covered   size   unlisted");
    for row in &sets.calibration {
        let CalibrationGroup { group, cases, covered, none_of_these, .. } = row;
        let least = row.least.map_or("-".into(), |least| format!("{least:e}"));
        let size = row.mean_size.map_or("-".into(), |size| format!("{size:.2}"));
        let counts = format!("{} / {}", covered.hits, covered.of);
        line(
            text,
            &format!("{group:<18} {cases:>8}   {least:>24}   {counts:>11} {size:>6} {:>10}", none_of_these.hits),
        );
    }
}

fn cases(text: &mut String, card: &ScoreCard) {
    let longest = |get: fn(&Judged) -> usize, least: usize| card.cases.iter().map(get).max().unwrap_or(0).max(least);
    let id = longest(|c| c.id.chars().count(), 4);
    let truth = longest(|c| c.truth.chars().count(), 5).min(48);
    line(text, "");
    line(
        text,
        &format!("{:<id$}  {:<truth$}  {:>6}  {:<16}  {:<2}  best cause", "case", "truth", "gap", "verdict", "ok"),
    );
    for case in &card.cases {
        let snr = case.snr.map_or("-".into(), |snr| format!("{snr:.1}"));
        let verdict = case.verdict.map_or("no diagnosis", verdict_name);
        let kind = if case.kind == Kind::Null { "none" } else { &case.truth };
        let mut row = String::new();
        // Writing to a String can't fail.
        let _ = write!(row, "{:<id$}  {kind:<truth$}  {snr:>6}  {verdict:<16}  {:<2}", case.id, mark(case));
        if let (Some(best), Some(probability)) = (&case.best, case.probability) {
            let _ = write!(row, "  {best} ({})", number(probability));
        }
        line(text, &row);
    }
}

/// What was said with an effect left out, where that was no honest rest.
fn without(text: &mut String, left_out: &LeftOut) {
    line(text, "");
    line(
        text,
        "explained with an effect left out (= called equivalent to it, ~ follows the held-out logs as well as it)",
    );
    for case in left_out.cases.iter().filter(|c| c.verdict == Some(Verdict::Explained)) {
        let mark = match (case.equivalent, case.follows) {
            (true, _) => "=",
            (false, true) => "~",
            (false, false) => "-",
        };
        line(text, &format!("{}  without {}  {mark}  {}", case.id, case.left_out, case.named.join(", ")));
    }
}

/// `+` where verdict and causes are right, `~` where one of the two is, `-` where neither is or nothing came.
fn mark(case: &Judged) -> &'static str {
    if case.verdict.is_none() {
        return "-";
    }
    let causes = match case.kind {
        Kind::Null => !case.any_included,
        Kind::Single => case.top_1 == Some(true),
        Kind::Several => case.all_found == Some(true),
        Kind::Outside => case.right_state == Some(true),
    };
    match (case.right_verdict, causes) {
        (true, true) => "+",
        (false, false) => "-",
        _ => "~",
    }
}
