//! `gpsindy identify`: a model from logs.

mod author;
mod choices;
mod result;

pub(crate) use result::{Fit, On, as_json, rounded, summary, summary_of};

use crate::args::{AutoHold, Columns, Output, pair};
use crate::commands::follow::{self, FollowOptions};
use crate::commands::{check_folder_of, chosen, chosen_with, dataset, dataset_and_offsets, smooth};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use choices::{Preset, Smoothing, named};
use clap::Args;
use gpsindy_core::library::{Constraints, Fixed, Forbidden, Kept, LibrarySettings, Signed};
use gpsindy_core::regress::Selection;
use gpsindy_core::{Choice, Delay, Identify as Settings, Regression, Target};
use gpsindy_core::{Dataset, Expression, Identification, Progress, Run, Scoring, Simulate, Smoother, score};
use gpsindy_files::{Logs, Task, TopicOffset, model_to_toml, write_model};
use std::path::PathBuf;

/// Identify a model from logs: equations with standard errors
///
/// Writes the model to --out and a summary to stdout; without --out, the model to stdout and the summary to stderr.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy identify run_1.csv run_2.csv --state x,v --control u --out model.toml\n         \
                   gpsindy identify car_*.csv --state x,y,v,phi --control u --angle phi --term 'v*cos(phi)' --delay u=auto\n         \
                   tail -f -n +1 robot.csv | gpsindy identify - --follow --state x,v --control u --json"
)]
pub(crate) struct Identify {
    /// One or more logs: CSV, MCAP, Parquet, ULog or the folder of a data set; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    pub(super) logs: Vec<PathBuf>,
    /// Logs for scoring only, not for training
    #[arg(long, num_args = 1.., value_name = "LOG")]
    holdout: Vec<PathBuf>,
    /// Columns that are states, separated by commas [default: every numeric column that no other option names]
    #[arg(long, value_name = "COLUMN")]
    state: Vec<String>,
    /// Columns that are controls, separated by commas
    #[arg(long, value_name = "COLUMN")]
    control: Vec<String>,
    /// The column that carries a state's time derivative
    #[arg(long, value_name = "STATE=COLUMN", value_parser = pair)]
    derivative: Vec<(String, String)>,
    #[command(flatten)]
    pub(super) columns: Columns,
    #[command(flatten)]
    library: LibraryOptions,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    pub(super) follow: FollowOptions,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Identify {
    /// Whether the refinement was asked for by name.
    pub(super) fn refines(&self) -> bool {
        self.method.refine
    }

    /// Whether a kernel was named.
    pub(super) fn names_kernel(&self) -> bool {
        self.method.kernel != "auto"
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Candidate terms")]
pub(crate) struct LibraryOptions {
    /// Highest polynomial degree, 0 to 9
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = degree, allow_hyphen_values = true)]
    degree: usize,
    /// Add sine and cosine of every state and control
    #[arg(long)]
    trig: bool,
    /// Add products of sine and cosine with polynomials of degree 1 and 2
    #[arg(long)]
    products: bool,
    /// Add a term, such as 'v*abs(v)'
    #[arg(long, value_name = "EXPR")]
    term: Vec<String>,
    /// Fix a known equation, such as "x' = v"; v need not be in the logs then
    #[arg(long, value_name = "EQUATION")]
    fix: Vec<String>,
    /// Exclude a term from an equation, such as v:x^2
    #[arg(long, value_name = "STATE:TERM")]
    forbid: Vec<String>,
    /// Always keep a term in an equation, such as v:u; its coefficient is estimated
    #[arg(long, value_name = "STATE:TERM")]
    keep: Vec<String>,
    /// Constrain the sign of a coefficient, such as v:v=-
    #[arg(long, value_name = "STATE:TERM=SIGN", allow_hyphen_values = true)]
    sign: Vec<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
struct MethodOptions {
    /// The set of defaults that the other options change
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    preset: Preset,
    /// How a control behaves between its samples
    #[arg(long, value_enum, default_value_t = AutoHold::Auto)]
    hold: AutoHold,
    /// Smoother of the states [default: gp]
    #[arg(long, value_enum)]
    smoother: Option<Smoothing>,
    /// Kernel of the Gaussian process: auto, se, matern12, matern32, matern52, periodic, rq, or a sum or product such as se+periodic
    #[arg(long, default_value = "auto")]
    kernel: String,
    /// Target of the regression [default: weak; given, if --derivative names columns]
    #[arg(long, value_name = "METHOD", value_parser = named::<Target>(Target::NAMES))]
    derivative_method: Option<Target>,
    /// The sparse regression [default: subset]
    #[arg(long, value_parser = named::<Regression>(Regression::NAMES))]
    regressor: Option<Regression>,
    /// Tuning parameter of the regression: auto, or a number (lambda, a threshold or a number of terms)
    #[arg(long, default_value = "auto", allow_negative_numbers = true)]
    lambda: String,
    /// Criterion by which auto selects the tuning parameter [default: cv]
    #[arg(long, value_parser = named::<Choice>(Choice::NAMES))]
    select: Option<Choice>,
    /// Delay of a control in s, or auto to estimate it (auto:0.5: between 0 and 0.5 s)
    #[arg(long, value_name = "CONTROL=auto|SECONDS", value_parser = pair)]
    delay: Vec<(String, String)>,
    /// Scale columns and target to unit size before the regression
    #[arg(long)]
    standardize: bool,
    /// Train on this first fraction of each run, above 0 and at most 1 [default: 1; preset author: 0.7]
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true)]
    train_fraction: Option<f64>,
    /// Preset author only: inputs of the second Gaussian process of a state, such as v=throttle [default: all states]
    #[arg(long, value_name = "STATE=COLUMN", value_parser = pair)]
    gp_input: Vec<(String, String)>,
    /// Above 0: report inclusion probabilities, from the evidence or, with --no-refine, from N bootstraps of the regression
    #[arg(long, value_name = "N", default_value_t = 0)]
    ensemble: usize,
    /// Refine coefficients and terms by simulation against the raw samples [default: yes, except for the preset paper]
    #[arg(long, overrides_with = "no_refine")]
    refine: bool,
    /// Skip the refinement; some terms may then only compensate for errors of the smoother
    #[arg(long)]
    no_refine: bool,
    /// For approximate models of controlled motion: search for several models and select by agreement, in about five times the time
    #[arg(long)]
    consensus: bool,
    /// Exit with status 0 even if the model predicts the logs no better than the mean or a constant state
    #[arg(long)]
    accept_poor: bool,
}

/// A degree as text.
fn degree(text: &str) -> Result<usize, String> {
    let degree = text.parse::<usize>().ok().filter(|degree| *degree <= 9);
    degree.ok_or_else(|| "expected a whole number from 0 to 9".into())
}

pub(crate) fn run(command: &Identify, seed: u64, screen: &Screen) -> Outcome {
    if command.method.preset == Preset::Author {
        if command.follow.follow {
            return Err(Failure::input("--preset author does not go with --follow: it needs the whole log"));
        }
        return author::run(command, screen);
    }
    if !command.method.gp_input.is_empty() {
        return Err(Failure::input("--gp-input is for --preset author alone; remove it"));
    }
    check_folder_of(command.output.out.as_deref())?;
    if command.follow.follow {
        return follow::run(command, screen);
    }
    if let Some(twice) = command.logs.iter().find(|log| command.holdout.contains(log)) {
        return Err(Failure::input(format!("{} is named both for training and in --holdout", twice.display())));
    }
    let logs = Logs::read(&command.logs, &command.columns.options()?)?;
    let mut settings = settings(command, &logs, seed)?;
    let by_default = settings.states.is_empty();
    let rates: Vec<String> = settings.derivatives.iter().map(|(_, column)| column.clone()).collect();
    if by_default {
        settings.states = all_states(&logs, &[&settings.controls[..], &rates[..]].concat(), screen);
        settings.states.extend(unlogged(&settings.constraints, &logs));
    }
    let needed: Vec<String> = [&settings.states[..], &settings.controls[..], &rates[..]].concat();
    if let Some(twice) = needed.iter().enumerate().find(|(i, name)| needed[..*i].contains(name)) {
        return Err(Failure::input(format!("column `{}` has two roles; name it in one option", twice.1)));
    }
    let unlogged = unlogged(&settings.constraints, &logs);
    let needed: Vec<String> = needed.into_iter().filter(|name| !unlogged.contains(name)).collect();
    let task = Task {
        needed,
        controls: settings.controls.clone(),
        hold: settings.hold.unwrap_or_default(),
        ..Task::default()
    };
    let (data, offsets) = dataset_and_offsets(&logs, &task, &command.columns, screen)?;
    if by_default {
        leave_clocks_out(&mut settings.states, &data, screen);
    }
    settings.delays = delays(command, &logs)?;
    let scored_on = Scored::new(command, &settings, &task, &data, screen)?;
    let progress = screen.progress();
    let found = settings.fit(&data, &progress)?;
    let fit = scored_on.score(&found, &progress)?;
    drop(progress);
    for note in &found.notes {
        screen.warn(&note.to_string());
    }
    if let Some(path) = &command.output.out {
        write_model(path, &found.model)?;
    }
    let summary = summary(&data, &found, Some(&fit));
    match &command.output.out {
        _ if screen.json() => {
            let mut value = as_json(&found, Some(&fit));
            if !offsets.is_empty() {
                value["clock_offsets"] = offsets.iter().map(TopicOffset::json).collect();
            }
            screen.out(&format!("{value}\n"))?;
        }
        Some(path) => screen.out(&format!("{summary}\nmodel: {}\n", path.display()))?,
        None => {
            screen.note(&summary);
            screen.out(&model_to_toml(&found.model)?)?;
        }
    }
    match result::poor(&found) {
        Some(how) if !command.method.accept_poor => {
            Err(Failure::Work(format!("{how}; --accept-poor exits with status 0 nevertheless")))
        }
        _ => Ok(()),
    }
}

/// Takes columns that are a straight line of time out of the states, unless nothing else is left.
fn leave_clocks_out(states: &mut Vec<String>, data: &Dataset, screen: &Screen) {
    let is_clock = |name: &String| {
        let column = data.index_of(name).ok();
        column.is_some_and(|c| data.runs().iter().all(|run| run.is_line_of_time(c)))
    };
    let (clocks, moving): (Vec<String>, Vec<String>) = states.iter().cloned().partition(is_clock);
    if !clocks.is_empty() && !moving.is_empty() {
        let names = clocks.join(", ");
        screen.note(&format!(
            "not used as a state, because it is a linear function of time: {names} (name it with --state to keep it)"
        ));
        *states = moving;
    }
}

/// What a model is scored on.
enum Scored {
    /// The logs of --holdout.
    Holdout(Dataset),
    /// What --train-fraction left of the logs.
    Rest(Dataset),
    /// The very logs that were learnt from.
    Training(Dataset),
}

impl Scored {
    fn new(command: &Identify, settings: &Settings, task: &Task, data: &Dataset, screen: &Screen) -> Outcome<Self> {
        if !command.holdout.is_empty() {
            let logs = Logs::read(&command.holdout, &command.columns.options()?)?;
            return Ok(Self::Holdout(dataset(&logs, task, &command.columns, &screen.quietly())?));
        }
        if settings.train_fraction >= 1.0 {
            return Ok(Self::Training(data.clone()));
        }
        let runs = data.runs().iter().map(|run| {
            let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
            let first = run.time.partition_point(|&t| t <= from + settings.train_fraction * (to - from));
            Run {
                name: run.name.clone(),
                time: run.time[first..].to_vec(),
                values: run.values.subrows(first, run.n_samples() - first).to_owned(),
            }
        });
        let runs: Vec<Run> = runs.filter(|run| run.n_samples() > 1).collect();
        match runs.is_empty() {
            true => Ok(Self::Training(data.clone())),
            false => Ok(Self::Rest(Dataset::new(data.channels().to_vec(), runs)?)),
        }
    }

    fn score(&self, found: &Identification, progress: &dyn Progress) -> Outcome<Fit> {
        let (data, on) = match self {
            Self::Holdout(data) => (data, On::Holdout),
            Self::Rest(data) => (data, On::Rest),
            Self::Training(data) => (data, On::Training),
        };
        let simulate = Simulate { hold: found.hold, ..Simulate::default() };
        let scoring = Scoring { simulate, window: None };
        let score = score(&found.model.compile()?, data, &scoring, progress)?;
        Ok(Fit { score, on })
    }
}

const UNLOGGED_VELOCITY: &str =
    "; a velocity that is not logged needs the equation that says whose it is, such as --fix \"x' = v\"";

/// Right sides of the equations like `x' = v` whose name no log carries.
fn unlogged(constraints: &Constraints, logs: &Logs) -> Vec<String> {
    let velocities = constraints.fixed.iter().filter_map(|fixed| match &fixed.equation {
        Expression::Variable(velocity) => Some(velocity.clone()),
        _ => None,
    });
    velocities.filter(|name| logs.files().iter().all(|log| log.column(name).is_none())).collect()
}

/// Every column of numbers but those `taken`.
pub(crate) fn all_states(logs: &Logs, taken: &[String], screen: &Screen) -> Vec<String> {
    let states: Vec<String> = logs.numeric_columns().into_iter().filter(|name| !taken.contains(name)).collect();
    screen.note(&format!("states: {} (all numeric columns; choose with --state)", states.join(", ")));
    states
}

impl LibraryOptions {
    /// Candidate terms, and what is known of the equations beforehand.
    pub(crate) fn settings(&self) -> Outcome<(LibrarySettings, Constraints)> {
        let library = LibrarySettings {
            degree: self.degree,
            trig: self.trig,
            products: self.products,
            extra: self.term.clone(),
            ..LibrarySettings::default()
        };
        let mut constraints = Constraints::default();
        for text in &self.fix {
            constraints.fixed.push(Fixed::parse(text).map_err(|e| Failure::input(format!("--fix: {e}")))?);
        }
        for text in &self.forbid {
            constraints.forbidden.push(Forbidden::parse(text).map_err(|e| Failure::input(format!("--forbid: {e}")))?);
        }
        for text in &self.keep {
            constraints.kept.push(Kept::parse(text).map_err(|e| Failure::input(format!("--keep: {e}")))?);
        }
        for text in &self.sign {
            constraints.signed.push(Signed::parse(text).map_err(|e| Failure::input(format!("--sign: {e}")))?);
        }
        Ok((library, constraints))
    }
}

/// The time column is what states move along, so it is none.
fn refuse_time(command: &Identify) -> Outcome {
    let named = command.columns.time.as_deref();
    let is_time = |name: &str| named.map_or(matches!(name, "t" | "time"), |time| time == name);
    match command.state.iter().flat_map(|names| names.split(',')).map(str::trim).find(|name| is_time(name)) {
        Some(time) => {
            Err(Failure::input(format!("--state: `{time}` is the time column and cannot be a state; leave it out")))
        }
        None => Ok(()),
    }
}

/// The settings that the options ask for; states are left empty where no option names them.
pub(super) fn settings(command: &Identify, logs: &Logs, seed: u64) -> Outcome<Settings> {
    let (library, method) = (&command.library, &command.method);
    let start = match method.preset {
        Preset::Paper => Settings::paper(),
        Preset::Default | Preset::Author => Settings::default(),
    };
    let mut settings = Settings { seed, hold: method.hold.into(), ..start };
    (settings.library, settings.constraints) = library.settings()?;
    refuse_time(command)?;
    settings.states = chosen_with(logs, &command.state, &unlogged(&settings.constraints, logs))
        .map_err(|failure| failure.with(UNLOGGED_VELOCITY))?;
    settings.controls = chosen(logs, &command.control)?;
    for (state, column) in &command.derivative {
        settings.derivatives.push((logs.resolve(state)?, logs.resolve(column)?));
    }
    match method.smoother {
        Some(Smoothing::None) => settings.smoother = None,
        Some(Smoothing::Gp) => settings.smoother = Some(Smoother::default()),
        None => {}
    }
    if let Some(smoother) = &mut settings.smoother {
        smoother.kernels = smooth::kernels(&method.kernel, smoother.kernels.clone())?;
    }
    if let Some(target) = &method.derivative_method {
        settings.target = target.clone();
    }
    if let Some(regression) = method.regressor {
        settings.regressor = regression.regressor();
    }
    if let Some(choice) = &method.select {
        settings.choice = choice.clone();
    }
    if method.lambda != "auto" {
        settings.choice = Choice::Rows(Selection::Fixed(level(&method.lambda)?));
    }
    settings.standardize |= method.standardize;
    if let Some(fraction) = method.train_fraction {
        if !(fraction > 0.0 && fraction <= 1.0) {
            return Err(Failure::input(format!("--train-fraction must be above 0 and at most 1, found {fraction}")));
        }
        settings.train_fraction = fraction;
    }
    settings.ensemble = method.ensemble;
    settings.refine = method.refine || (settings.refine && !method.no_refine);
    settings.consensus |= method.consensus;
    Ok(settings)
}

fn level(text: &str) -> Outcome<f64> {
    let number = text.parse::<f64>().ok().filter(|v| v.is_finite());
    let number = number.ok_or_else(|| Failure::input(format!("--lambda must be auto or a number, found `{text}`")))?;
    if number < 0.0 {
        return Err(Failure::input(format!("--lambda must be at least 0, found {number}")));
    }
    Ok(number)
}

/// The delays asked for.
pub(super) fn delays(command: &Identify, logs: &Logs) -> Outcome<Vec<(String, Delay)>> {
    let wrong = |control: &str, text: &str| {
        Failure::input(format!(
            "--delay {control}={text}: expected auto, auto:SECONDS or a number of seconds, at least 0"
        ))
    };
    let mut delays = Vec::new();
    for (control, text) in &command.method.delay {
        let number = |text: &str| {
            text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0).ok_or_else(|| wrong(control, text))
        };
        let delay = match text.split_once(':') {
            None if text == "auto" => Delay::Auto(None),
            None => Delay::Fixed(number(text)?),
            Some(("auto", most)) => Delay::Auto(Some(number(most)?)),
            Some(_) => return Err(wrong(control, text)),
        };
        delays.push((logs.resolve(control)?, delay));
    }
    Ok(delays)
}
