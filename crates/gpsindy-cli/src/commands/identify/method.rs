//! Options of the method, and the settings that all options of `gpsindy identify` ask for.

use super::choices::{Preset, Smoothing, named};
use super::{Identify, unlogged};
use crate::args::{AutoHold, pair};
use crate::commands::{chosen, chosen_with, smooth};
use crate::failure::{Failure, Outcome};
use clap::Args;
use gpsindy_core::regress::Selection;
use gpsindy_core::{Choice, Delay, Identify as Settings, Regression, Smoother, Target};
use gpsindy_files::Logs;

const UNLOGGED_VELOCITY: &str = "; a velocity that is not logged needs the equation that says whose it is, such as --fix \"x' = v\", and \
     another hidden state h the equation of a logged one that depends on it, such as --fix \"y' = sqrt(h) - 0.1*sqrt(y)\"";

#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
pub(super) struct MethodOptions {
    /// The set of defaults that the other options change
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    pub(super) preset: Preset,
    /// How a control behaves between its samples
    #[arg(long, value_enum, default_value_t = AutoHold::Auto)]
    pub(super) hold: AutoHold,
    /// Smoother of the states [default: gp]
    #[arg(long, value_enum)]
    pub(super) smoother: Option<Smoothing>,
    /// Kernel of the Gaussian process: auto, se, matern12, matern32, matern52, periodic, rq, or a sum or product such as se+periodic
    #[arg(long, default_value = "auto")]
    pub(super) kernel: String,
    /// Target of the regression [default: weak; given, if --derivative names columns]
    #[arg(long, value_name = "METHOD", value_parser = named::<Target>(Target::NAMES))]
    pub(super) derivative_method: Option<Target>,
    /// The sparse regression [default: subset]
    #[arg(long, value_parser = named::<Regression>(Regression::NAMES))]
    pub(super) regressor: Option<Regression>,
    /// Tuning parameter of the regression: auto, or a number (lambda, a threshold or a number of terms)
    #[arg(long, default_value = "auto", allow_negative_numbers = true)]
    pub(super) lambda: String,
    /// Criterion by which auto selects the tuning parameter [default: cv]
    #[arg(long, value_parser = named::<Choice>(Choice::NAMES))]
    pub(super) select: Option<Choice>,
    /// Delay of a control in s, or auto to estimate it (auto:0.5: between 0 and 0.5 s)
    #[arg(long, value_name = "CONTROL=auto|SECONDS", value_parser = pair)]
    pub(super) delay: Vec<(String, String)>,
    /// Scale columns and target to unit size before the regression
    #[arg(long)]
    pub(super) standardize: bool,
    /// Train on this first fraction of each run, above 0 and at most 1 [default: 1; preset author: 0.7]
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true)]
    pub(super) train_fraction: Option<f64>,
    /// Preset author only: inputs of the second Gaussian process of a state, such as v=throttle [default: all states]
    #[arg(long, value_name = "STATE=COLUMN", value_parser = pair)]
    pub(super) gp_input: Vec<(String, String)>,
    /// Above 0: report inclusion probabilities, from the evidence or, with --no-refine, from N bootstraps of the regression
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) ensemble: usize,
    /// Refine coefficients and terms by simulation against the raw samples [default: yes, except for the preset paper]
    #[arg(long, overrides_with = "no_refine")]
    pub(super) refine: bool,
    /// Skip the refinement; some terms may then only compensate for errors of the smoother
    #[arg(long)]
    pub(super) no_refine: bool,
    /// Where the equations only approximate a controlled motion, search for several models and select by long rollouts and agreement
    /// [default: yes]
    #[arg(long, overrides_with = "no_consensus")]
    pub(super) consensus: bool,
    /// Keep the equations of the best evidence even if they only approximate a controlled motion, in about a quarter of the time
    #[arg(long)]
    pub(super) no_consensus: bool,
    /// Exit with status 0 even if the model predicts the logs no better than the mean or a constant state
    #[arg(long)]
    pub(super) accept_poor: bool,
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
pub(crate) fn settings(command: &Identify, logs: &Logs, seed: u64) -> Outcome<Settings> {
    let (library, method) = (&command.library, &command.method);
    let start = match method.preset {
        Preset::Paper => Settings::paper(),
        Preset::Default | Preset::Author => Settings::default(),
    };
    let mut settings = Settings { seed, hold: method.hold.into(), ..start };
    (settings.library, settings.constraints) = library.settings()?;
    settings.grow = library.may_grow();
    settings.ranges = library.ranges()?;
    refuse_time(command)?;
    settings.states = chosen_with(logs, &command.state, &unlogged(&settings, logs))
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
    settings.consensus = method.consensus || !method.no_consensus;
    Ok(settings)
}

pub(super) fn level(text: &str) -> Outcome<f64> {
    let number = text.parse::<f64>().ok().filter(|v| v.is_finite());
    let number = number.ok_or_else(|| Failure::input(format!("--lambda must be auto or a number, found `{text}`")))?;
    if number < 0.0 {
        return Err(Failure::input(format!("--lambda must be at least 0, found {number}")));
    }
    Ok(number)
}

/// The delays asked for.
pub(crate) fn delays(command: &Identify, logs: &Logs) -> Outcome<Vec<(String, Delay)>> {
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
