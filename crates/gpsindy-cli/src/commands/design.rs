//! `gpsindy design`: the control signal of the next experiment, as a file.

use crate::args::{Output, pair, values};
use crate::commands::given::nominal::kind;
use crate::commands::{Session, check_out, deliver};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::text::{aligned, short};
use clap::Args;
use gpsindy_core::diagnose::{Candidate, Design as Settings, Designed, Open, Separation};
use gpsindy_core::{Channel, Model};
use gpsindy_files::{Table, read_model};
use serde_json::json;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file of a diagnosis' folder that says what its logs can't distinguish.
pub(crate) const OPEN: &str = "open.json";

/// Design the control signal that best distinguishes what a diagnosis left open, as CSV
///
/// Maximises the worst-case separation over all pairs of explanations, within the limits; each model may adjust its parameters within what the
/// logs allow (T-optimal design). Tries multisines, chirps, steps and free forms, and refines the best. Reports the expected separation of each
/// pair in nats (log odds), and the time after which the right one of the pair reaches 95 %. The folder must be that of a diagnosis of equations
/// (it holds open.json); for a MuJoCo model or an FMU use `diagnosis.design` in Python. Where a diagnosis left nothing
/// open, its nearest candidates are distinguished once more; one with fewer than two explanations has no pair: name the models, or diagnose
/// with more effects.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy design diagnosis --limit u=-2:2 --rate-limit u=20 --duration 10 --out next.csv\n         \
                         gpsindy design one.toml other.toml --noise x=0.01 --limit u=-2:2"
)]
pub(crate) struct Design {
    /// Folder of a diagnosis, or two models or more (TOML or JSON) of which one is right
    #[arg(required = true, value_name = "DIR|MODEL")]
    from: Vec<PathBuf>,
    /// Range of a control, in its unit; equal ends hold it still
    #[arg(long, required = true, value_name = "CONTROL=LOW:HIGH", value_parser = range, allow_hyphen_values = true)]
    limit: Vec<(String, f64, f64)>,
    /// Largest change of a control in a second
    #[arg(long, value_name = "CONTROL=R", value_parser = amount)]
    rate_limit: Vec<(String, f64)>,
    /// Range that a state must not leave
    #[arg(long, value_name = "STATE=LOW:HIGH", value_parser = range, allow_hyphen_values = true)]
    bound: Vec<(String, f64, f64)>,
    /// Length of the run, s
    #[arg(long, value_name = "S", default_value_t = 10.0, allow_negative_numbers = true)]
    duration: f64,
    /// Samples a second
    #[arg(long, value_name = "HZ", default_value_t = 50.0, allow_negative_numbers = true)]
    rate: f64,
    /// Where the run begins, as x=0.1,v=0 [default: where the logs began]
    #[arg(long, value_name = "STATE=VALUE", value_parser = values, allow_hyphen_values = true)]
    initial: Vec<Vec<(String, f64)>>,
    /// Distinguish these two effects, or models, instead of what was left open
    #[arg(long, value_name = "A,B")]
    separate: Option<String>,
    /// Stop after so many seconds with the best signal so far; 0: no limit. The first Ctrl-C or SIGTERM does the same
    #[arg(long, value_name = "S", default_value_t = 600.0, allow_negative_numbers = true)]
    time_limit: f64,
    /// Standard deviation of a column's noise, where models are given in place of a diagnosis
    #[arg(long, value_name = "STATE=SD", value_parser = amount)]
    noise: Vec<(String, f64)>,
    #[command(flatten)]
    output: Output,
}

pub(crate) fn run(command: &Design, session: &Session<'_>) -> Outcome {
    let screen = &session.screen;
    let of_diagnosis = command.from.iter().map(|from| from.join(OPEN)).collect::<Vec<_>>();
    check_out(command.output.out.as_deref(), command.from.iter().chain(&of_diagnosis))?;
    let open = open(command, screen)?;
    let settings = Settings {
        limits: command.limit.clone(),
        rate_limits: command.rate_limit.clone(),
        bounds: command.bound.clone(),
        duration: command.duration,
        rate: command.rate,
        start: command.initial.iter().flatten().cloned().collect(),
        seed: session.seed,
        time_limit: (command.time_limit != 0.0).then_some(command.time_limit),
    };
    let progress = screen.progress().ending_with(session.first_request.heed());
    let designed = settings.run(&open, None, &progress)?;
    drop(progress);
    if !designed.is_complete {
        screen
            .warn("the search ended early; this is the best signal so far, and a longer search may find a better one");
    }
    for pair in designed.pairs.iter().filter(|pair| pair.seconds.is_none()) {
        screen.warn(&format!(
            "{} and {} are not distinguished with 95 % within the run; make it longer, widen --limit, or log another column",
            pair.one, pair.other
        ));
    }
    deliver_signal(command, &designed, &open.candidates[0].model, screen)
}

/// What is to be distinguished.
fn open(command: &Design, screen: &Screen) -> Outcome<Open> {
    let engine = command.from.iter().find(|from| kind(from).is_some());
    if let Some(file) = engine {
        return Err(Failure::input(format!(
            "{}: a simulator's own file (MJCF, URDF, FMU), not equations; diagnose it in Python, where diagnosis.design(...) designs with it",
            file.display()
        )));
    }
    let open = match command.from.as_slice() {
        [folder] if folder.is_dir() => {
            if !command.noise.is_empty() {
                return Err(Failure::input("--noise: the diagnosis knows the noise of its logs; remove the option"));
            }
            of_diagnosis(folder)?
        }
        [one] => {
            return Err(Failure::input(format!(
                "{}: no folder of a diagnosis; name one, or two or more models to distinguish",
                one.display()
            )));
        }
        models => of_models(models, &command.noise)?,
    };
    let Some(names) = &command.separate else {
        if open.is_empty() {
            let labels = open.candidates.iter().map(|c| c.label.as_str()).collect::<Vec<_>>().join(", ");
            screen.note(&format!(
                "the diagnosis leaves nothing open; the signal distinguishes its nearest candidates once more: {labels} (choose with --separate)"
            ));
            return Ok(open.separating_all());
        }
        return Ok(open);
    };
    let labels = open.candidates.iter().map(|c| c.label.as_str()).collect::<Vec<_>>().join(", ");
    let Some((one, other)) = names.split_once(',') else {
        return Err(Failure::input(format!("--separate: expected A,B, found `{names}`")));
    };
    let apart = open.separating(one.trim(), other.trim());
    if apart.is_empty() {
        return Err(Failure::input(format!("--separate: no pair of {one} and {other} here; there are: {labels}")));
    }
    Ok(apart)
}

fn of_diagnosis(folder: &Path) -> Outcome<Open> {
    let path = folder.join(OPEN);
    let text = std::fs::read_to_string(&path).map_err(|e| {
        if e.kind() == ErrorKind::NotFound && folder.join("augmented.toml").is_file() {
            return Failure::input(format!(
                "{}: the diagnosis has fewer than two explanations of the logs, so there is nothing to distinguish; name models instead, or diagnose with more effects",
                folder.display()
            ));
        }
        Failure::input(format!(
            "{}: {e}; a diagnosis of equations writes it, and the one of a simulator that steps designs from Python: diagnosis.design(...)",
            path.display()
        ))
    })?;
    serde_json::from_str(&text).map_err(|e| Failure::input(format!("{}: {e}; diagnose again", path.display())))
}

fn of_models(files: &[PathBuf], noise: &[(String, f64)]) -> Outcome<Open> {
    if noise.is_empty() {
        return Err(Failure::input("--noise: say the noise of at least one column that the run will log, as x=0.01"));
    }
    let mut candidates = Vec::new();
    for file in files {
        let model = read_model(file)?;
        candidates.push(Candidate { label: file.display().to_string(), ..Candidate::of_model(model) });
    }
    let open = Open { candidates, pairs: Vec::new(), noise: noise.to_vec(), start: Vec::new(), linear: false };
    Ok(open.separating_all())
}

/// The signal to its file, and what it will show to the screen.
fn deliver_signal(command: &Design, designed: &Designed, model: &Model, screen: &Screen) -> Outcome {
    let csv = csv(designed, model);
    if screen.json() {
        let pairs = designed
            .pairs
            .iter()
            .map(|p| json!({"one": p.one, "other": p.other, "nats": p.nats, "seconds_to_95_percent": p.seconds}));
        let result = json!({
            "form": designed.form,
            "duration": command.duration,
            "rate": command.rate,
            "complete": designed.is_complete,
            "pairs": pairs.collect::<Vec<_>>(),
            "controls": designed.controls,
            "columns": csv.to_json(),
        });
        return deliver(&command.output, &format!("{result}\n"), screen);
    }
    deliver(&command.output, &csv.to_csv(), screen)?;
    // Beside the signal on stdout the words would spoil it.
    match &command.output.out {
        Some(path) => screen.out(&format!("{}\nsignal: {}\n", words(designed), path.display())),
        None => {
            screen.note(words(designed).trim_end());
            Ok(())
        }
    }
}

fn csv(designed: &Designed, model: &Model) -> Table {
    let unit = |name: &String| model.controls.iter().find(|c| c.name == *name).map_or("", |c| c.unit.as_str());
    let mut table = Table::new().with(&Channel::new("t").with_unit("s"), designed.time.clone());
    for (name, values) in designed.controls.iter().zip(&designed.values) {
        table = table.with(&Channel::new(name).with_unit(unit(name)), values.clone());
    }
    table
}

/// The separation of each pair.
fn words(designed: &Designed) -> String {
    let row = |p: &Separation| {
        let after = p.seconds.map_or("not within the run".to_string(), |s| format!("{} s", short(s)));
        vec![format!("{} or {}", p.one, p.other), format!("{} nats", short(p.nats)), after]
    };
    let mut rows = vec![vec!["pair".into(), "expected separation".into(), "95 % after".into()]];
    rows.extend(designed.pairs.iter().map(row));
    format!("{}, held between samples\n\n{}", designed.form, aligned(&rows))
}

/// `NAME=LOW:HIGH`.
fn range(text: &str) -> Result<(String, f64, f64), String> {
    let (name, span) = pair(text).map_err(|_| "expected NAME=LOW:HIGH".to_string())?;
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let ends = span.split_once(':').and_then(|(low, high)| Some((number(low)?, number(high)?)));
    let (low, high) = ends.ok_or_else(|| format!("expected NAME=LOW:HIGH with two numbers, found `{text}`"))?;
    Ok((name, low, high))
}

/// `NAME=NUMBER`, above 0.
fn amount(text: &str) -> Result<(String, f64), String> {
    let (name, value) = pair(text).map_err(|_| "expected NAME=NUMBER".to_string())?;
    let number = value.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
    number.map(|v| (name, v)).ok_or_else(|| format!("`{value}` is not a number above 0"))
}
