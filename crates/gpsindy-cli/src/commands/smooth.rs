//! `gpsindy smooth`: smoothed states and derivatives with standard deviations, as CSV.

use crate::args::{Columns, Output};
use crate::commands::{check_out, chosen, dataset, deliver, opened};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::gp::Kernel;
use gpsindy_core::{Channel, Smoothed, Smoother, rate_unit_in};
use gpsindy_files::{Table, Task};
use serde_json::json;
use std::path::PathBuf;

/// Smooth logs: states and derivatives with standard deviations
///
/// Fits one Gaussian process over time to each column, with hyperparameters shared by all runs. For a column `x` the result has `x`, its
/// standard deviation `x_std`, the time derivative `x_dot` and its standard deviation `x_dot_std`. A process with kernel `matern12` has no
/// derivative; `x_dot` is then the mean slope between the neighbouring samples.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy smooth run_1.csv --state x,v --out smooth.csv")]
pub(crate) struct Smooth {
    /// The logs; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Columns to smooth, separated by commas [default: every numeric column]
    #[arg(long, value_name = "COLUMN")]
    state: Vec<String>,
    /// Kernel: auto, se, matern12, matern32, matern52, periodic, rq, or a sum or product such as se+periodic
    #[arg(long, default_value = "auto")]
    kernel: String,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    output: Output,
}

/// Kernels to try for `--kernel`: all of the default for `auto`.
pub(crate) fn kernels(option: &str, default: Vec<Kernel>) -> Outcome<Vec<Kernel>> {
    if option == "auto" {
        return Ok(default);
    }
    let kernel = option.parse().map_err(|e| Failure::input(format!("--kernel: {e}")))?;
    Ok(vec![kernel])
}

pub(crate) fn run(command: &Smooth, screen: &Screen) -> Outcome {
    check_out(command.output.out.as_deref(), command.logs.iter().chain(command.columns.files()))?;
    let logs = opened(&command.logs, &command.columns, screen)?;
    let states = if command.state.is_empty() { logs.numeric_columns() } else { chosen(&logs, &command.state)? };
    if states.is_empty() {
        return Err(Failure::input("the logs have no numeric column besides the time; there is nothing to smooth"));
    }
    let data = dataset(&logs, &Task { needed: states.clone(), ..Task::default() }, &command.columns, screen)?;
    let mut smoother = Smoother::default();
    smoother.kernels = kernels(&command.kernel, smoother.kernels)?;
    let progress = screen.progress();
    let channels: Vec<usize> = (0..states.len()).collect();
    let smoothed = smoother.smooth(&data, &channels, &progress)?;
    drop(progress);
    for (channel, fit) in smoothed.channels.iter().zip(&smoothed.fits) {
        screen.note(&format!("{}: kernel {}, noise {:.3e} {}", channel.name, fit.kernel, fit.noise, channel.unit));
        if !fit.kernel.differentiable() {
            screen.note(&format!(
                "{0}: kernel {1} has no derivative; {0}_dot is the mean slope over the neighbouring samples",
                channel.name, fit.kernel
            ));
        }
        for weakness in &fit.weak {
            screen.warn(&format!("{}: {weakness}", channel.name));
        }
    }
    let table = table(&smoothed, logs.time_unit());
    if !screen.json() {
        return deliver(&command.output, &table.to_csv(), screen);
    }
    let fits = smoothed.channels.iter().zip(&smoothed.fits).map(|(channel, fit)| {
        let weak: Vec<String> = fit.weak.iter().map(ToString::to_string).collect();
        json!({"name": channel.name, "unit": channel.unit, "kernel": fit.kernel.to_string(), "noise": fit.noise, "converged": fit.converged, "weak": weak})
    });
    let result = json!({"channels": fits.collect::<Vec<_>>(), "columns": table.to_json()});
    deliver(&command.output, &format!("{result}\n"), screen)
}

/// One row a sample: the run where there are several, the time, then four columns a channel.
fn table(smoothed: &Smoothed, time_unit: &str) -> Table {
    let mut table = Table::new();
    if smoothed.runs.len() > 1 {
        table = table.with_text("run", smoothed.runs.iter().flat_map(|r| vec![r.name.clone(); r.time.len()]).collect());
    }
    table = table
        .with(&Channel::new("t").with_unit(time_unit), smoothed.runs.iter().flat_map(|r| r.time.clone()).collect());
    for (j, channel) in smoothed.channels.iter().enumerate() {
        let rate = rate_unit_in(&channel.unit, time_unit);
        let column = |pick: fn(&gpsindy_core::SmoothedRun) -> &faer::Mat<f64>| {
            smoothed.runs.iter().flat_map(|r| pick(r).col_as_slice(j).to_vec()).collect::<Vec<f64>>()
        };
        let named = |suffix: &str, unit: &str| Channel::new(format!("{}{suffix}", channel.name)).with_unit(unit);
        table = table
            .with(&named("", &channel.unit), column(|r| &r.mean))
            .with(&named("_std", &channel.unit), column(|r| &r.std))
            .with(&named("_dot", &rate), column(|r| &r.derivative))
            .with(&named("_dot_std", &rate), column(|r| &r.derivative_std));
    }
    table
}
