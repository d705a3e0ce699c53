//! `gpsindy identify`: logs to a model.

mod author;

use crate::args::{AutoHold, Columns, Output, pair};
use crate::commands::follow::{self, FollowOptions};
use crate::commands::{check_folder_of, chosen, dataset, smooth};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::text::{aligned, count, short};
use clap::{Args, ValueEnum};
use gpsindy_core::library::{Constraints, Fixed, Forbidden, Kept, LibrarySettings, Signed};
use gpsindy_core::regress::{Lasso, LeastSquares, Regressor, Selection, SqrtLasso, Ssr, Stlsq, Subset};
use gpsindy_core::{Choice, Delay, Identification, Identify as Settings, Target};
use gpsindy_core::{Dataset, Differentiation, Hold, Score, Scoring, SecondStage, Simulate, Smoother, score};
use gpsindy_files::{Logs, model_to_toml, write_model};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// Logs to a model: equations with standard errors
///
/// The model is written to --out with a summary on stdout; without --out the model goes to stdout and the summary to stderr.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy identify run_1.csv run_2.csv --state x,v --control u --out model.toml\n         \
                   gpsindy identify car_*.csv --state x,y,v,phi --control u --angle phi --term 'v*cos(phi)' --delay u=auto\n         \
                   tail -f -n +1 robot.csv | gpsindy identify - --follow --state x,v --control u --json"
)]
pub(crate) struct Identify {
    /// The logs (CSV), one or more; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    pub(super) logs: Vec<PathBuf>,
    /// Columns that are states, separated by commas [default: every column of numbers that no other option names]
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
    /// Whether the second fit was asked for by name.
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
    /// Highest degree of the polynomials, 0 to 9
    #[arg(long, value_name = "N", default_value_t = 3)]
    degree: usize,
    /// Sine and cosine of every state and control
    #[arg(long)]
    trig: bool,
    /// Polynomials of degree 1 and 2 times sine and cosine
    #[arg(long)]
    products: bool,
    /// A further term, such as 'v*abs(v)'
    #[arg(long, value_name = "EXPR")]
    term: Vec<String>,
    /// An equation that is known, such as "x' = v"
    #[arg(long, value_name = "EQUATION")]
    fix: Vec<String>,
    /// A term that an equation must not have, such as v:x^2
    #[arg(long, value_name = "STATE:TERM")]
    forbid: Vec<String>,
    /// A term that an equation has for certain, such as v:u; its coefficient is learnt
    #[arg(long, value_name = "STATE:TERM")]
    keep: Vec<String>,
    /// The sign of a coefficient, such as v:v=-
    #[arg(long, value_name = "STATE:TERM=SIGN", allow_hyphen_values = true)]
    sign: Vec<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
struct MethodOptions {
    /// Where the settings start from, before the other options
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    preset: Preset,
    /// What a control does between its samples
    #[arg(long, value_enum, default_value_t = AutoHold::Auto)]
    hold: AutoHold,
    /// How the states are smoothed [default: gp]
    #[arg(long, value_enum)]
    smoother: Option<Smoothing>,
    /// Kernel of the smoother: auto, se, matern12, matern32, matern52, periodic, rq, or a sum or product such as se+periodic
    #[arg(long, default_value = "auto")]
    kernel: String,
    /// What the regression compares [default: weak, with the derivatives of --derivative where there are some]
    #[arg(long, value_enum, value_name = "METHOD")]
    derivative_method: Option<DerivativeMethod>,
    /// The sparse regression [default: subset]
    #[arg(long, value_enum)]
    regressor: Option<Regression>,
    /// Its tuning value: auto, or a number (lambda, a threshold or a number of terms)
    #[arg(long, default_value = "auto", allow_negative_numbers = true)]
    lambda: String,
    /// How auto chooses the tuning value [default: cv]
    #[arg(long, value_enum)]
    select: Option<Select>,
    /// Delay of a control in s, or auto to estimate it (auto:0.5 between 0 and 0.5 s)
    #[arg(long, value_name = "CONTROL=auto|SECONDS", value_parser = pair)]
    delay: Vec<(String, String)>,
    /// Bring columns and target to unit size before the regression
    #[arg(long)]
    standardize: bool,
    /// First part of each run that is learnt from, above 0 and at most 1 [default: 1, with the preset author 0.7]
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true)]
    train_fraction: Option<f64>,
    /// With the preset author: inputs of the second Gaussian process of a state, such as v=throttle [default: all states]
    #[arg(long, value_name = "STATE=COLUMN", value_parser = pair)]
    gp_input: Vec<(String, String)>,
    /// Bootstraps for inclusion probabilities, 0 for none
    #[arg(long, value_name = "N", default_value_t = 0)]
    ensemble: usize,
    /// Fit once more through the integrator, on the raw measurements [default: unless the preset is paper]
    #[arg(long, overrides_with = "no_refine")]
    refine: bool,
    /// Leave the second fit out
    #[arg(long)]
    no_refine: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Preset {
    /// Our best
    Default,
    /// Algorithm 1 of the paper as it is stated, without a second fit
    Paper,
    /// The pipeline behind the paper's tables as its authors ran it, slips included, on one log; --smoother none is their SINDy
    Author,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Smoothing {
    /// Gaussian process over time
    Gp,
    /// Samples as they are
    None,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum DerivativeMethod {
    /// Derivative of a Gaussian process over the smoothed states (the paper's second stage)
    GpState,
    /// The same over the controls
    GpControl,
    /// Derivative of the Gaussian process over time, with its covariance
    GpTime,
    /// Integrals of the terms; nothing is differentiated
    Weak,
    /// Central differences, any grid
    Difference,
    /// The columns of --derivative alone
    Given,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Regression {
    /// Best subset with exchanges
    Subset,
    /// LASSO by ADMM
    Lasso,
    /// LASSO with the unsquared norm that the paper prints
    SqrtLasso,
    /// Sequentially thresholded least squares (SINDy)
    Stlsq,
    /// Stepwise sparse regression, smallest coefficient first
    SsrCoefficient,
    /// Stepwise sparse regression, smallest increase of the residual first
    SsrResidual,
    /// Least squares with all terms
    LeastSquares,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Select {
    /// Cross-validation with the one-standard-error rule
    Cv,
    /// Bayesian information criterion
    Bic,
    /// Error of rollouts
    Rollout,
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
    let logs = Logs::read(&command.logs, &command.columns.options())?;
    let mut settings = settings(command, &logs, seed)?;
    let rates: Vec<String> = settings.derivatives.iter().map(|(_, column)| column.clone()).collect();
    if settings.states.is_empty() {
        settings.states = all_states(&logs, &[&settings.controls[..], &rates[..]].concat(), screen);
    }
    let needed: Vec<String> = [&settings.states[..], &settings.controls[..], &rates[..]].concat();
    if let Some(twice) = needed.iter().enumerate().find(|(i, name)| needed[..*i].contains(name)) {
        return Err(Failure::input(format!("column `{}` has two roles; name it in one option", twice.1)));
    }
    let data = dataset(&logs, &needed, &[], &command.columns, screen)?;
    settings.delays = delays(command, &logs, sensible_delay(&data))?;
    let progress = screen.progress();
    let found = settings.fit(&data, &progress)?;
    let simulate = Simulate { hold: found.hold, ..Simulate::default() };
    let scoring = Scoring { simulate, window: None };
    let fit = found.model.compile().and_then(|system| score(&system, &data, &scoring, &progress)).ok();
    drop(progress);
    for note in &found.notes {
        screen.warn(note);
    }
    if let Some(path) = &command.output.out {
        write_model(path, &found.model)?;
    }
    let summary = summary(&data, &found, fit.as_ref());
    match &command.output.out {
        _ if screen.json() => screen.out(&format!("{}\n", as_json(&found, fit.as_ref()))),
        Some(path) => screen.out(&format!("{summary}\nmodel: {}\n", path.display())),
        None => {
            screen.note(&summary);
            screen.out(&model_to_toml(&found.model)?)
        }
    }
}

/// Every column of numbers but those `taken`.
pub(crate) fn all_states(logs: &Logs, taken: &[String], screen: &Screen) -> Vec<String> {
    let states: Vec<String> = logs.numeric_columns().into_iter().filter(|name| !taken.contains(name)).collect();
    screen.note(&format!("states: {} (all columns of numbers; choose with --state)", states.join(", ")));
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

/// The settings that the options ask for; states are left empty where no option names them.
pub(super) fn settings(command: &Identify, logs: &Logs, seed: u64) -> Outcome<Settings> {
    let (library, method) = (&command.library, &command.method);
    let start = match method.preset {
        Preset::Paper => Settings::paper(),
        Preset::Default | Preset::Author => Settings::default(),
    };
    let mut settings = Settings { seed, hold: method.hold.into(), ..start };
    settings.states = chosen(logs, &command.state)?;
    settings.controls = chosen(logs, &command.control)?;
    for (state, column) in &command.derivative {
        settings.derivatives.push((logs.resolve(state)?, logs.resolve(column)?));
    }
    (settings.library, settings.constraints) = library.settings()?;
    match method.smoother {
        Some(Smoothing::None) => settings.smoother = None,
        Some(Smoothing::Gp) => settings.smoother = Some(Smoother::default()),
        None => {}
    }
    if let Some(smoother) = &mut settings.smoother {
        smoother.kernels = smooth::kernels(&method.kernel, smoother.kernels.clone())?;
    }
    if let Some(derivative) = method.derivative_method {
        settings.target = match derivative {
            DerivativeMethod::Weak => Target::Weak,
            DerivativeMethod::GpState => Target::Derivative(Differentiation::GpState(SecondStage::default())),
            DerivativeMethod::GpControl => Target::Derivative(Differentiation::GpControl(SecondStage::default())),
            DerivativeMethod::GpTime => Target::Derivative(Differentiation::GpTime),
            DerivativeMethod::Difference => Target::Derivative(Differentiation::Central),
            DerivativeMethod::Given => Target::Derivative(Differentiation::Given(Vec::new())),
        };
    }
    if let Some(regression) = method.regressor {
        settings.regressor = regressor(regression);
    }
    match method.select {
        Some(Select::Cv) => settings.choice = Choice::Rows(Selection::default()),
        Some(Select::Bic) => settings.choice = Choice::Rows(Selection::Bic { noise: None }),
        Some(Select::Rollout) => settings.choice = Choice::Rollout,
        None => {}
    }
    if method.lambda != "auto" {
        settings.choice = Choice::Rows(Selection::Fixed(level(&method.lambda)?));
    }
    settings.standardize |= method.standardize;
    settings.train_fraction = method.train_fraction.unwrap_or(settings.train_fraction);
    settings.ensemble = method.ensemble;
    settings.refine = method.refine || (settings.refine && !method.no_refine);
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

fn regressor(regression: Regression) -> Arc<dyn Regressor> {
    match regression {
        Regression::Subset => Arc::new(Subset::default()),
        Regression::Lasso => Arc::new(Lasso::default()),
        Regression::SqrtLasso => Arc::new(SqrtLasso::default()),
        Regression::Stlsq => Arc::new(Stlsq::default()),
        Regression::SsrCoefficient => Arc::new(Ssr::by_coefficient()),
        Regression::SsrResidual => Arc::new(Ssr::by_residual()),
        Regression::LeastSquares => Arc::new(LeastSquares),
    }
}

/// As far as is sensible for the sampling and the length of the runs, s.
fn sensible_delay(data: &Dataset) -> f64 {
    let length = |run: &gpsindy_core::Run| run.time[run.time.len() - 1] - run.time[0];
    let shortest = data.runs().iter().map(length).fold(f64::INFINITY, f64::min);
    let period = data.runs().iter().map(gpsindy_core::Run::period).fold(0.0, f64::max);
    (25.0 * period).max(shortest / 100.0).min(shortest / 10.0)
}

/// The delays asked for; `auto` looks up to `sensible` seconds.
pub(super) fn delays(command: &Identify, logs: &Logs, sensible: f64) -> Outcome<Vec<(String, Delay)>> {
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
            None if text == "auto" => Delay::Auto(sensible),
            None => Delay::Fixed(number(text)?),
            Some(("auto", most)) => Delay::Auto(number(most)?),
            Some(_) => return Err(wrong(control, text)),
        };
        delays.push((logs.resolve(control)?, delay));
    }
    Ok(delays)
}

/// The equations, how sure each coefficient is, and how well rollouts follow the logs.
pub(crate) fn summary(data: &Dataset, found: &Identification, fit: Option<&Score>) -> String {
    let runs = format!("{}, {}", count(data.runs().len(), "run"), count(data.n_samples(), "sample"));
    summary_of(&runs, found, fit)
}

/// The same of `logs`, told in words.
pub(super) fn summary_of(logs: &str, found: &Identification, fit: Option<&Score>) -> String {
    let mut text = format!("equations from {logs}:\n\n");
    for state in &found.model.states {
        text += &format!("  {}' = {}\n", state.name, rounded(found, state));
    }
    let Some(record) = &found.model.identification else { return text };
    let with_inclusion = !record.inclusion_probabilities.is_empty();
    let mut rows = vec![vec!["  coefficient".to_string(), "value".into(), "std error".into()]];
    if with_inclusion {
        rows[0].push("inclusion".into());
    }
    for (s, state) in found.model.states.iter().enumerate() {
        for (j, term) in record.terms.iter().enumerate() {
            let value = record.coefficients[s][j];
            if value == 0.0 {
                continue;
            }
            let error = record.standard_errors.get(s).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN);
            let mut row = vec![format!("  {}': {term}", state.name), short(value), short(error)];
            if with_inclusion {
                row.push(format!("{:.2}", record.inclusion_probabilities[s][j]));
            }
            rows.push(row);
        }
    }
    if rows.len() > 1 {
        text += &format!("\n{}", aligned(&rows));
    }
    for (control, delay, error) in &found.delays {
        text += &format!("  delay of {control}: {} s, std error {}\n", short(*delay), short(*error));
    }
    let mut rows = vec![vec!["  state".to_string(), "noise".into(), "rollout rmse".into(), "relative".into()]];
    for (s, state) in found.states.iter().enumerate() {
        let error = fit.and_then(|f| f.rollout.by_state.iter().find(|e| e.state == state.state));
        let unit = &found.model.states[s].unit;
        let with_unit = |v: f64| if unit.is_empty() { short(v) } else { format!("{} {unit}", short(v)) };
        rows.push(vec![
            format!("  {}", state.state),
            with_unit(state.noise),
            error.map_or("-".into(), |e| with_unit(e.rmse)),
            error.map_or("-".into(), |e| short(e.normalised)),
        ]);
    }
    text += &format!("\n{}", aligned(&rows));
    if let Some(fit) = fit.filter(|f| f.rollout.n_diverged > 0) {
        text += &format!("  {} of {} rollouts diverged\n", fit.rollout.n_diverged, fit.rollout.n_started);
    }
    text
}

/// The right side of an equation with four significant digits.
pub(super) fn rounded(found: &Identification, state: &gpsindy_core::State) -> String {
    let Some(record) = &found.model.identification else { return state.equation.to_string() };
    let s = found.model.state_index(&state.name).unwrap_or(0);
    let kept = record.terms.iter().zip(&record.coefficients[s]).filter(|(_, value)| **value != 0.0);
    let mut text = String::new();
    for (term, value) in kept {
        text += match (text.is_empty(), *value < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += &short(value.abs());
        if term != "1" {
            text += &format!("*{term}");
        }
    }
    // An equation that was given, or one without a term.
    if text.is_empty() { state.equation.to_string() } else { text }
}

pub(crate) fn as_json(found: &Identification, fit: Option<&Score>) -> serde_json::Value {
    let states = found.states.iter().map(|s| {
        json!({"state": s.state, "terms": s.terms, "level": s.level, "score": s.score, "residual": s.residual, "noise": s.noise, "kernel": s.kernel})
    });
    let delays =
        found.delays.iter().map(|(c, value, error)| json!({"control": c, "value": value, "standard_error": error}));
    let rollout = fit.map(|fit| super::score::as_json(&fit.rollout));
    json!({
        "model": found.model,
        "states": states.collect::<Vec<_>>(),
        "delays": delays.collect::<Vec<_>>(),
        "hold": if found.hold == Hold::Zero { "zero" } else { "linear" },
        "rollout": rollout,
        "notes": found.notes,
    })
}
