//! `gpsindy diagnose`: where a simulator is wrong, why, and how much a correction helps.

mod files;
mod provenance;
mod simulated;
mod timings;

pub(crate) use files::{report_json, write};

use crate::args::{AutoHold, Columns};
use crate::commands::given::nominal::Nominal;
use crate::commands::given::setup::{PartOptions, SetupOptions};
use crate::commands::given::{measured, targets};
use crate::commands::{Session, model_dataset, opened};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use files::Augmented;
use gpsindy_core::diagnose::report::Verdict;
use gpsindy_core::diagnose::{Diagnose as Settings, Diagnosed, Diagnosis, Part, PartKind, Power, hold_out};
use gpsindy_core::{Dataset, Hold, Model};
use gpsindy_files::{TopicOffset, model_to_toml, read_effects};
use gpsindy_report::Provenance;
use provenance::{facts, provenance};
use simulated::{SimulatorOptions, paired};
use std::path::{Path, PathBuf};

/// Diagnose the gap between a simulator and logs of the machine
///
/// Writes report.json, report.html (one page that opens offline) and the corrected simulator into --out, and a summary to stdout. The corrected
/// simulator is augmented.toml with open.json (what `gpsindy design` reads) for equations, augmented.xml with randomization.py (ranges for
/// training) for a MuJoCo model, and augmented.ssv (parameters) for an FMU. All files are replaced together or not at all. Held-out logs are used for validation only, never for a fit or a
/// selection. Without --holdout, the last quarter of the runs is held out; of a single run, its last quarter in time.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy diagnose simulator.toml run_1.csv run_2.csv --holdout run_3.csv --out diagnosis\n         \
                   gpsindy diagnose robot.xml run_*.csv --out diagnosis"
)]
pub(crate) struct Diagnose {
    /// The nominal model (TOML or JSON; from the Python package's command also MJCF, URDF or an FMU); with --simulated, the first log of the machine
    model: PathBuf,
    /// Logs of the machine
    #[arg(required_unless_present = "simulated", value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Logs for validation only
    #[arg(long, num_args = 1.., value_name = "LOG")]
    holdout: Vec<PathBuf>,
    /// Folder for the report; created if it does not exist
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite files in DIR even if gpsindy did not write them
    #[arg(long)]
    force: bool,
    /// Exit with status 3 if there is a gap (gap), or only if no effect explains it (unexplained); for CI
    #[arg(long, value_enum, value_name = "VERDICT")]
    fail_if: Option<FailIf>,
    /// Print what each stage did with the logs and how long it took, on stderr
    #[arg(long)]
    timings: bool,
    /// Also study which effects these logs could reveal and from what size, by adding each to simulated copies of the logs (takes minutes, regardless of --time-limit)
    #[arg(long)]
    power: bool,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    parts: PartOptions,
    #[command(flatten)]
    setup: SetupOptions,
    #[command(flatten)]
    simulator: SimulatorOptions,
}

impl Diagnose {
    /// Every file that it reads.
    fn inputs(&self) -> Vec<&PathBuf> {
        let logs = self.logs.iter().chain(&self.holdout).chain(&self.simulator.simulated);
        logs.chain([&self.model]).chain(&self.options.effects_file).chain(self.columns.files()).collect()
    }
}

/// Verdicts that end the command with status 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FailIf {
    /// Any verdict but no_gap
    Gap,
    /// Only unexplained
    Unexplained,
}

impl FailIf {
    fn is_met(self, verdict: Verdict) -> bool {
        match self {
            Self::Gap => verdict != Verdict::NoGap,
            Self::Unexplained => verdict == Verdict::Unexplained,
        }
    }
}

/// How a diagnosis is made.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Diagnosis")]
pub(crate) struct Options {
    /// Test only these effects (ids separated by commas), or, with '!' before each, all but these
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    effects: Vec<String>,
    /// Custom effects: a TOML file with `[[effect]]` entries
    #[arg(long, value_name = "FILE")]
    effects_file: Option<PathBuf>,
    /// Let effects depend on the position or heading of the machine even if no rate of the model does
    #[arg(long)]
    allow_place: bool,
    /// Test every effect everywhere, even where units or positions rule it out
    #[arg(long)]
    all_suspects: bool,
    /// Confidence level of the intervals; no test and no verdict depends on it
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    confidence: f64,
    /// Largest number of effects in one explanation, 1 to 6; never more than four in one equation
    #[arg(long, value_name = "N", default_value_t = 6)]
    most_effects: usize,
    /// Share of the motion of each column, 0 to 0.5, below which a gap counts as none: 0.01 is a hundredth
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_negative_numbers = true)]
    material: f64,
    /// Add the part that no effect explains to the augmented model, as a fitted function
    #[arg(long)]
    keep_function: bool,
    /// How a control behaves between its samples
    #[arg(long, value_enum, default_value_t = AutoHold::Auto)]
    hold: AutoHold,
    /// Stop the search after so many seconds, keep the best result so far and say so; 0: no limit. The first Ctrl-C or SIGTERM does the same. Of logs that
    /// a MuJoCo model or an FMU can't pass through in time only the most exciting windows are used
    // Ten minutes: what one waits for at a desk. Most diagnoses take seconds.
    #[arg(long, value_name = "S", default_value_t = 600.0, allow_negative_numbers = true)]
    time_limit: f64,
}

impl Options {
    pub(crate) fn settings(&self) -> Outcome<Settings> {
        let (without, effects): (Vec<&String>, Vec<&String>) = self.effects.iter().partition(|e| e.starts_with('!'));
        if !without.is_empty() && !effects.is_empty() {
            return Err(Failure::input(
                "--effects: name either the effects to test or, with '!', those to leave out; not both",
            ));
        }
        let custom = self.effects_file.as_deref().map(read_effects).transpose()?.unwrap_or_default();
        Ok(Settings {
            effects: effects.into_iter().cloned().collect(),
            without: without.into_iter().map(|e| e.trim_start_matches('!').to_string()).collect(),
            custom,
            parts: Vec::new(),
            only: Vec::new(),
            allow_place: self.allow_place,
            all_suspects: self.all_suspects,
            confidence: self.confidence,
            most_effects: self.most_effects,
            hold: self.hold.into(),
            time_limit: (self.time_limit != 0.0).then_some(self.time_limit),
            power: None,
            model_error: Vec::new(),
            material: self.material,
            keep_function: self.keep_function,
        })
    }
}

pub(crate) fn run(command: &Diagnose, session: &Session<'_>) -> Outcome {
    let screen = &session.screen;
    if let Some(folder) = command.out.as_deref().filter(|folder| folder.exists() && !folder.is_dir()) {
        return Err(Failure::input(format!("--out: {} is a file; name a folder", folder.display())));
    }
    if let Some(folder) = &command.out {
        files::refuse_inputs(folder, &command.inputs())?;
        if !command.force {
            files::refuse_others(folder)?;
        }
    }
    let simulated = &command.simulator.simulated;
    let mut train: Vec<PathBuf> = command.logs.clone();
    if !simulated.is_empty() {
        train.insert(0, command.model.clone());
    }
    if let Some(twice) = train.iter().find(|log| command.holdout.contains(log)) {
        return Err(Failure::input(format!("{} is named both for training and in --holdout", twice.display())));
    }
    if let Some(twice) = train.iter().chain(&command.holdout).find(|log| simulated.contains(log)) {
        return Err(Failure::input(format!(
            "{} is named both as a log of the machine and in --simulated",
            twice.display()
        )));
    }
    let power = command.power.then(|| Power { seed: session.seed, ..Power::default() });
    let settings = Settings { power, ..command.options.settings()? };
    let mut provenance = provenance(session.line);
    if simulated.is_empty() {
        let nominal = Nominal::open(&command.model, &command.setup.setup(), session)?;
        let settings = command.parts.among(nominal.parts()?, settings)?;
        let (model, holdout) = (&nominal.model, &command.holdout);
        let Parts { train, holdout, offsets, time_unit } =
            logs(model, &settings.only, (&train, holdout), settings.hold, &command.columns, screen)?;
        provenance.time_unit.clone_from(&time_unit);
        provenance.logs = facts(&train, false).chain(facts(&holdout, true)).collect();
        let progress = screen.progress().ending_with(session.first_request.heed());
        let mut diagnosed = nominal.run(|| {
            Ok(match nominal.dynamics() {
                Some(dynamics) => settings.run_simulator(model, dynamics, &train, &holdout, &progress)?,
                None => settings.run(model, &train, &holdout, &progress)?,
            })
        })?;
        drop(progress);
        diagnosed.count_time_in(model, &time_unit);
        diagnosed.diagnosis.notes.extend(offsets.iter().map(ToString::to_string));
        let beside = command.out.as_ref().map_or(Ok(Vec::new()), |_| nominal.beside(&diagnosed))?;
        let folder = command.out.as_deref().unwrap_or(Path::new("."));
        let augmented = match nominal.corrected(&diagnosed.augmented, folder) {
            None => Augmented::Equations,
            Some(Ok(corrected)) => Augmented::File(corrected),
            Some(Err(why)) => {
                screen.warn(&format!("no corrected file of the simulator: {why}"));
                Augmented::None
            }
        };
        deliver(command, diagnosed, augmented, beside, &provenance, screen)
    } else {
        let settings = command.parts.among(Vec::new(), settings)?;
        if !command.setup.setup().is_empty() {
            return Err(Failure::input(
                "--driver, --base, --lock and --force-input: with --simulated there is no MuJoCo model or FMU; remove the option",
            ));
        }
        let (diagnosed, model) = paired(command, settings, &train, session.seed, screen)?;
        let simulator = ("simulator.toml".to_string(), gpsindy_report::simulator(&model_to_toml(&model)?));
        deliver(command, diagnosed, Augmented::Equations, vec![simulator], &provenance, screen)
    }
}

/// Files and summary of a diagnosis, and the status that its verdict was asked to give.
fn deliver(
    command: &Diagnose,
    mut diagnosed: Diagnosed,
    augmented: Augmented,
    beside: Vec<(String, String)>,
    provenance: &Provenance,
    screen: &Screen,
) -> Outcome {
    augmented.tell(&mut diagnosed.diagnosis);
    if command.timings {
        screen.say(&timings::table(&diagnosed.diagnosis.work, &diagnosed.seconds));
    }
    if let Some(folder) = &command.out {
        files::write_with(folder, &diagnosed, &augmented, beside, provenance)?;
    }
    if screen.json() {
        screen.out(&report_json(&diagnosed.diagnosis)?)?;
    } else {
        screen.out(&gpsindy_report::summary_with(&diagnosed.diagnosis, provenance, screen.width(), screen.colour()))?;
        match &command.out {
            Some(folder) => screen.out(&format!("\nreport: {}\n", folder.join("report.html").display()))?,
            None => screen.note("--out DIR also writes the HTML page, the JSON report and the augmented model"),
        }
    }
    if let Some(advice) = fewer_joints(&diagnosed.diagnosis) {
        screen.note(&advice);
    }
    let verdict = diagnosed.diagnosis.verdict;
    match command.fail_if.filter(|fail_if| fail_if.is_met(verdict)) {
        Some(_) => Err(Failure::Verdict(format!("--fail-if: the verdict is {verdict}"))),
        None => Ok(()),
    }
}

/// What makes a search shorter that the clock ended, where it asked about many joints and named nothing.
fn fewer_joints(diagnosis: &Diagnosis) -> Option<String> {
    let asked = diagnosis.by_part.iter().filter(|part| part.kind == PartKind::Joint && part.asked).count();
    let is_left_open = diagnosis.is_cut() && diagnosis.included().next().is_none();
    (is_left_open && asked > 1).then(|| {
        format!(
            "{asked} joints were asked about; take few at a time: --joint asks about one alone, --lock holds others that stood still or whose motion \
             does not reach it; --time-limit 0 lets the search end"
        )
    })
}

/// The logs, by the part that they play.
pub(crate) struct Parts {
    pub(crate) train: Dataset,
    pub(crate) holdout: Dataset,
    /// Offsets of clocks that were estimated in both.
    pub(crate) offsets: Vec<TopicOffset>,
    /// Unit of the time of the logs to learn from.
    pub(crate) time_unit: String,
}

/// The logs to learn from and those to verify on; without the latter a part of the former is held out. They measure what is `asked` about.
pub(crate) fn logs(
    model: &Model,
    asked: &[Part],
    (train, holdout): (&[PathBuf], &[PathBuf]),
    hold: Option<Hold>,
    columns: &Columns,
    screen: &Screen,
) -> Outcome<Parts> {
    let hold = hold.unwrap_or_default();
    let logs = opened(train, columns, screen)?;
    let time_unit = logs.time_unit().to_string();
    measured::check_asked(&logs, asked, model)?;
    let (train, mut offsets) = model_dataset(&logs, std::slice::from_ref(model), hold, columns, screen)?;
    measured::tell(&logs, None, model, screen);
    measured::doubt_degrees(&logs, &train, model, screen);
    targets::doubt_targets(&train, model, screen);
    if holdout.is_empty() {
        let (train, holdout) = hold_out(&train)?;
        return Ok(Parts { train, holdout, offsets, time_unit });
    }
    let verifying = opened(holdout, columns, screen)?;
    let (holdout, more) = model_dataset(&verifying, std::slice::from_ref(model), hold, columns, screen)?;
    measured::tell(&verifying, Some(&logs), model, screen);
    offsets.extend(more);
    Ok(Parts { train, holdout, offsets, time_unit })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_the_clock_ended_advises_to_ask_about_fewer_joints() {
        let json = r#"{"schema": "gpsindy.diagnosis/1", "model": "dog", "runs": {"train": [], "holdout": []}, "verdict": "unexplained",
            "gap": {"detected": true, "p_value": 0, "by_state": [], "by_region": [], "by_window": []}, "causes": [], "excluded": [],
            "unexplained": {"probability": 1, "share": 1, "depends_on": []}, "interrupted": 120, "notes": [],
            "by_part": [{"kind": "joint", "part": "hip", "measured": true, "asked": true, "share": 0, "causes": [], "nothing_above": [], "says": ""},
                        {"kind": "joint", "part": "knee", "measured": true, "asked": true, "share": 0, "causes": [], "nothing_above": [], "says": ""}],
            "closure": {"metric": "rollout_rmse", "floor_source": "sensor noise", "by_state": []}}"#;
        let mut found: Diagnosis = serde_json::from_str(json).unwrap();
        assert!(fewer_joints(&found).unwrap().starts_with("2 joints were asked about"));
        found.by_part[0].asked = false;
        assert!(fewer_joints(&found).is_none());
        found.by_part[0].asked = true;
        found.interrupted = None;
        assert!(fewer_joints(&found).is_none());
    }

    #[test]
    fn a_verdict_fails_where_it_was_asked_to() {
        assert!(FailIf::Gap.is_met(Verdict::Explained) && !FailIf::Gap.is_met(Verdict::NoGap));
        assert!(
            FailIf::Unexplained.is_met(Verdict::Unexplained) && !FailIf::Unexplained.is_met(Verdict::PartlyExplained)
        );
    }
}
