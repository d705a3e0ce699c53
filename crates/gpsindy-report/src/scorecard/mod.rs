//! The score card of an exam: compares diagnoses with the true answers.
//!
//! A cause is a hit if effect, state and variables are those of a true effect or of a name that the suite accepts for it,
//! or if its `equivalent` holds the id of the effect. A case without a diagnosis counts as a miss in every rate.

mod answers;
mod foreign;
mod handed;
mod judge;
mod left_out;
mod rate;
mod sets;
mod text;

pub use answers::{Accepted, Answer, Kind, Oracle, Suite, TrueEffect};
pub use foreign::read_report;
pub use handed::{FamilyRank, HandedOver};
pub use judge::Judged;
pub use left_out::{LeftOut, LeftOutCase};
pub use rate::{Bin, Calibration, Rate};
pub use sets::{CalibrationCase, CalibrationGroup, PredictionSets};

use gpsindy_core::diagnose::report::{Diagnosis, Verdict};
use rate::{mean, quantile};
use serde::Serialize;
use std::collections::BTreeMap;

/// The schema that [`ScoreCard::schema`] names.
pub const SCHEMA: &str = "gpsindy.scorecard/1";

/// Lower ends of the strata of the gap in units of the noise.
const STRATA: [f64; 4] = [0.0, 1.0, 3.0, 10.0];

/// The rates of an exam and the cases behind them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreCard {
    /// Always [`SCHEMA`].
    pub schema: &'static str,
    /// Numbers of cases.
    pub counts: Counts,
    /// Gaps found at 5 %, where the gap is at least the noise or its size is not known.
    pub detected: Rate,
    /// The same by the size of the gap.
    pub detected_by_snr: Vec<Stratum>,
    /// Null cases with p < 0.05.
    pub false_alarms: Rate,
    /// Null cases with an included cause.
    pub false_causes: Rate,
    /// One effect, gap at least 3 times the noise or not known: the equation with the largest share is right.
    pub right_state: Rate,
    /// One effect, any size: the best cause acts at the right place.
    pub right_cause_state: Rate,
    /// Outside the catalogue: the equation with the largest share is right.
    pub right_state_outside: Rate,
    /// One effect: the best cause hits.
    pub top_1: Rate,
    /// The same by the size of the gap.
    pub top_1_by_snr: Vec<Stratum>,
    /// One effect: one of the best three causes hits.
    pub top_3: Rate,
    /// One effect: the best cause hits by its own name, not only by its group.
    pub named: Rate,
    /// One effect: mean size of the best cause's group.
    pub mean_group_size: Option<f64>,
    /// Several effects: the best cause hits one of them.
    pub several_top_1: Rate,
    /// Several effects: each has an included cause of its own.
    pub several_found: Rate,
    /// Several effects: the same, and nothing else is included.
    pub several_exact: Rate,
    /// Effects outside the catalogue that were called explained.
    pub wrongly_explained: Rate,
    /// Effects of the catalogue that were called unexplained.
    pub needlessly_unexplained: Rate,
    /// Effects of the catalogue that were called partly explained.
    pub needlessly_partly: Rate,
    /// Verdicts that are right, all cases.
    pub right_verdict: Rate,
    /// Stated probabilities of all causes against what was right.
    pub calibration: Calibration,
    /// The same, where what covers a part of an effect outside the catalogue is wrong.
    pub strict_calibration: Calibration,
    /// Sets of causes with a stated coverage; absent for reports of another tool.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prediction_sets: Option<PredictionSets>,
    /// Closed part of the gap over the oracle's, cases of the catalogue.
    pub closure: ClosureScore,
    /// What was said with one effect left out of the catalogue; absent where none was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
    /// What the searches fitted; absent for reports of another tool.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub handed: Option<HandedOver>,
    /// Every case, in the suite's order.
    pub cases: Vec<Judged>,
}

/// Numbers of cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// All.
    pub cases: usize,
    /// Without an effect.
    pub null: usize,
    /// With one effect of the catalogue.
    pub single: usize,
    /// With several.
    pub several: usize,
    /// With an effect that the catalogue lacks.
    pub outside: usize,
    /// Without a diagnosis.
    pub failed: usize,
}

/// A rate among the cases whose gap lies in `from..to`, in units of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stratum {
    /// Lower end.
    pub from: f64,
    /// Upper end; absent in the last stratum.
    pub to: Option<f64>,
    /// The rate.
    pub rate: Rate,
}

/// Closed part of the gap over what a fit of the true structure closes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClosureScore {
    /// Cases.
    pub of: usize,
    /// Median; absent without cases.
    pub median: Option<f64>,
    /// A tenth of the cases lie below; absent without cases.
    pub percentile_10: Option<f64>,
}

impl ScoreCard {
    /// Judges the diagnoses, by id of the case, against the suite's answers.
    pub fn new(suite: &Suite, diagnoses: &BTreeMap<String, Diagnosis>) -> Self {
        let cases: Vec<Judged> = suite.cases.iter().map(|a| judge::judge(a, diagnoses.get(&a.id))).collect();
        let of = |kind: Kind| cases.iter().filter(move |c| c.kind == kind);
        let known = || cases.iter().filter(|c| matches!(c.kind, Kind::Single | Kind::Several));
        let gaps = || cases.iter().filter(|c| c.kind != Kind::Null);
        let above = |c: &&Judged, least: f64| c.snr.is_none_or(|snr| snr >= least);
        let said = |c: &Judged, verdict: Verdict| c.verdict == Some(verdict);
        let stated: Vec<(f64, bool)> = cases.iter().flat_map(|c| c.stated.iter().copied()).collect();
        let strictly: Vec<(f64, bool)> = cases.iter().flat_map(|c| c.stated_strictly.iter().copied()).collect();
        let closures: Vec<f64> = cases.iter().filter_map(|c| c.closure).collect();
        Self {
            schema: SCHEMA,
            counts: Counts {
                cases: cases.len(),
                null: of(Kind::Null).count(),
                single: of(Kind::Single).count(),
                several: of(Kind::Several).count(),
                outside: of(Kind::Outside).count(),
                failed: cases.iter().filter(|c| c.verdict.is_none()).count(),
            },
            detected: Rate::count(gaps().filter(|c| above(c, 1.0)).map(|c| c.detected)),
            detected_by_snr: strata(gaps().map(|c| (c.snr, c.detected))),
            false_alarms: Rate::count(of(Kind::Null).map(|c| c.detected)),
            false_causes: Rate::count(of(Kind::Null).map(|c| c.any_included)),
            right_state: Rate::count(of(Kind::Single).filter(|c| above(c, 3.0)).filter_map(|c| c.right_state)),
            right_cause_state: Rate::count(of(Kind::Single).filter_map(|c| c.right_cause_state)),
            right_state_outside: Rate::count(of(Kind::Outside).filter_map(|c| c.right_state)),
            top_1: Rate::count(of(Kind::Single).filter_map(|c| c.top_1)),
            top_1_by_snr: strata(of(Kind::Single).filter_map(|c| Some((c.snr, c.top_1?)))),
            top_3: Rate::count(of(Kind::Single).filter_map(|c| c.top_3)),
            named: Rate::count(of(Kind::Single).filter_map(|c| c.named)),
            mean_group_size: mean(of(Kind::Single).filter_map(|c| c.group_size).map(|n| n as f64)),
            several_top_1: Rate::count(of(Kind::Several).filter_map(|c| c.top_1)),
            several_found: Rate::count(of(Kind::Several).filter_map(|c| c.all_found)),
            several_exact: Rate::count(of(Kind::Several).filter_map(|c| c.exact)),
            wrongly_explained: Rate::count(of(Kind::Outside).map(|c| said(c, Verdict::Explained))),
            needlessly_unexplained: Rate::count(known().map(|c| said(c, Verdict::Unexplained))),
            needlessly_partly: Rate::count(known().map(|c| said(c, Verdict::PartlyExplained))),
            right_verdict: Rate::count(cases.iter().map(|c| c.right_verdict)),
            calibration: Calibration::new(&stated),
            strict_calibration: Calibration::new(&strictly),
            prediction_sets: PredictionSets::new(suite, diagnoses),
            closure: ClosureScore {
                of: closures.len(),
                median: quantile(&closures, 0.5),
                percentile_10: quantile(&closures, 0.1),
            },
            left_out: None,
            handed: None,
            cases,
        }
    }

    /// The card as text: the rates with their intervals, then a line a case. Ends with a newline.
    pub fn text(&self) -> String {
        text::text(self)
    }
}

/// The rate in each stratum; cases of unknown size are in none.
fn strata(trials: impl Iterator<Item = (Option<f64>, bool)>) -> Vec<Stratum> {
    let trials: Vec<(Option<f64>, bool)> = trials.collect();
    STRATA
        .iter()
        .enumerate()
        .map(|(i, &from)| {
            let to = STRATA.get(i + 1).copied();
            let inside = |snr: f64| snr >= from && to.is_none_or(|to| snr < to);
            let rate = Rate::count(trials.iter().filter(|(snr, _)| snr.is_some_and(inside)).map(|(_, hit)| *hit));
            Stratum { from, to, rate }
        })
        .collect()
}
