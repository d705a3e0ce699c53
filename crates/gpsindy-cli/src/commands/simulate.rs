//! `gpsindy simulate`: a rollout of a model under the controls of a log or under constant ones, as CSV.

use crate::args::{Columns, Output, values};
use crate::commands::given::nominal::Nominal;
use crate::commands::given::setup::SetupOptions;
use crate::commands::{Session, check_out, check_states, columns_of, dataset, deliver, opened};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::{Args, ValueEnum};
use gpsindy_core::{
    Channel, Dataset, Excitation, Hold, Model, Rollout, Run, Simulate as Settings, StateReader, System,
};
use gpsindy_files::{Table, Task};
use serde_json::json;
use std::path::PathBuf;

/// Simulate a model: a rollout as CSV with `t` and every state
///
/// With a log, the rollout uses its controls and starts from its first sample. Without one, it uses constant controls and
/// the given initial state. A state with a `measured` expression is written as that expression gives it.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy simulate model.toml --data run_1.csv --out rollout.csv\n         \
                         gpsindy simulate model.toml --initial x=1,v=0 --control u=0.5 --duration 10")]
pub(crate) struct Simulate {
    /// The model (TOML or JSON); `-` is standard input
    model: PathBuf,
    /// The log with the controls and the first state; `-` is standard input
    #[arg(long, value_name = "LOG")]
    data: Option<PathBuf>,
    /// Start at the first sample from this time on, s; delays use the log before it [default: the log's first, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Stop at the last sample up to this time, s
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Stop this long after the start, s
    #[arg(long, value_name = "S", conflicts_with = "to")]
    duration: Option<f64>,
    /// Initial state, such as x=0.1,v=0 [default: the log's, else the model's `[initial]`]
    #[arg(long, value_name = "STATE=VALUE", value_parser = values)]
    initial: Vec<Vec<(String, f64)>>,
    /// Hold a control at a value, such as u=0.5, instead of that of the log
    #[arg(long, value_name = "CONTROL=VALUE", value_parser = values)]
    control: Vec<Vec<(String, f64)>>,
    /// Time between the rows, s, if no control comes from a log [default: the log's samples, else a thousandth of the whole]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    period: Option<f64>,
    /// How a control behaves between its samples [default: as the model was identified, else zero]
    #[arg(long, value_enum)]
    hold: Option<Between>,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    setup: SetupOptions,
    #[command(flatten)]
    output: Output,
}

/// What a control does between its samples.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Between {
    /// Zero-order hold: the control keeps the value of the last sample
    Zero,
    /// First-order hold: linear interpolation to the next sample
    Linear,
}

impl From<Between> for Hold {
    fn from(between: Between) -> Self {
        match between {
            Between::Zero => Self::Zero,
            Between::Linear => Self::Linear,
        }
    }
}

pub(crate) fn run(command: &Simulate, session: &Session<'_>) -> Outcome {
    let inputs = std::iter::once(&command.model).chain(&command.data).chain(command.columns.files());
    check_out(command.output.out.as_deref(), inputs)?;
    let nominal = Nominal::open(&command.model, &command.setup.setup(), session)?;
    nominal.run(|| simulate(command, &nominal, &session.screen))
}

fn simulate(command: &Simulate, nominal: &Nominal, screen: &Screen) -> Outcome {
    let mut model = nominal.model.clone();
    let given: Vec<(String, f64)> = command.initial.iter().flatten().cloned().collect();
    for (name, value) in &given {
        if model.state_index(name).is_none() {
            let known: Vec<&str> = model.states.iter().map(|s| s.name.as_str()).collect();
            return Err(Failure::input(format!("--initial: no state `{name}`; the model has: {}", known.join(", "))));
        }
        // States that the log lacks start from the model's own initial values.
        model.initial.insert(name.clone(), *value);
    }
    let system = nominal.system(&model)?;
    let settings = Settings { hold: command.hold.map_or_else(|| model.hold(), Into::into), ..Settings::default() };
    let kept = kept_controls(&model, command)?;
    let (rollouts, time_unit) = match &command.data {
        None => (vec![(model.name.clone(), without_log(command, &system, &settings, &kept)?)], "s".to_string()),
        Some(log) => {
            let logs = opened(std::slice::from_ref(log), &command.columns, screen)?;
            let (controls, states) = columns_of(&model);
            let needed: Vec<String> =
                controls.into_iter().zip(&kept).filter(|(_, value)| value.is_none()).map(|(name, _)| name).collect();
            if states.iter().any(|state| !model.initial.contains_key(state)) {
                check_states(&logs.files()[0], &states)?;
            }
            let task = Task { needed: needed.clone(), optional: states, controls: needed, hold: settings.hold };
            let data = dataset(&logs, &task, &command.columns, screen)?;
            let rollout = |run: &Run| {
                let excitation = excitation(&system, run, &data, &kept, &settings)?;
                let range = samples(run, command)?;
                let mut initial = StateReader::new(&system, run, data.channels(), &excitation)?.at(range.start)?;
                override_initial(&model, &given, &mut initial);
                let rollout = match command.period {
                    None => settings.rollout_range(&system, &excitation, &initial, range)?,
                    Some(period) => {
                        let span = (run.time[range.start], run.time[range.end - 1]);
                        on_grid(&system, &settings, period, span, &initial, &kept)?
                    }
                };
                Ok((run.name.clone(), rollout))
            };
            let rollouts = data.runs().iter().map(rollout).collect::<Outcome<Vec<_>>>()?;
            (rollouts, logs.time_unit().to_string())
        }
    };
    let table = table(&model, &rollouts, &time_unit);
    if screen.json() {
        let result = json!({"model": model.name, "columns": table.to_json()});
        return deliver(&command.output, &format!("{result}\n"), screen);
    }
    deliver(&command.output, &table.to_csv(), screen)
}

/// The value that each control of the model is kept at, where `--control` says one.
fn kept_controls(model: &Model, command: &Simulate) -> Outcome<Vec<Option<f64>>> {
    let mut kept = vec![None; model.controls.len()];
    for (name, value) in command.control.iter().flatten() {
        let Some(place) = model.controls.iter().position(|c| c.name == *name) else {
            let known: Vec<&str> = model.controls.iter().map(|c| c.name.as_str()).collect();
            let has = if known.is_empty() { "none".into() } else { known.join(", ") };
            return Err(Failure::input(format!("--control: no control `{name}`; the model has: {has}")));
        };
        kept[place] = Some(*value);
    }
    Ok(kept)
}

/// The controls of a run, those that are kept at a value aside.
fn excitation(
    system: &System,
    run: &Run,
    data: &Dataset,
    kept: &[Option<f64>],
    settings: &Settings,
) -> Outcome<Excitation> {
    let names = system.model().controls.iter().map(|c| &c.name);
    let columns: Vec<usize> = names
        .zip(kept)
        .map(|(name, value)| if value.is_some() { Ok(0) } else { data.index_of(name) })
        .collect::<Result<_, _>>()?;
    let value = |i, j: usize| kept[j].unwrap_or_else(|| run.values[(i, columns[j])]);
    let controls = faer::Mat::from_fn(run.n_samples(), kept.len(), value);
    Ok(Excitation::new(system, &run.time, controls.as_ref(), settings.hold)?)
}

/// A rollout from the model's own initial state.
fn without_log(command: &Simulate, system: &System, settings: &Settings, kept: &[Option<f64>]) -> Outcome<Rollout> {
    let model = system.model();
    let from = command.from.unwrap_or(0.0);
    let Some(to) = command.to.or(command.duration.map(|duration| from + duration)) else {
        let message =
            "without a log the end of the rollout is needed; give it with --duration or --to, or a log with --data";
        return Err(Failure::input(message));
    };
    let initial = model.states.iter().map(|state| {
        let found = model.initial.get(&state.name).copied();
        found.ok_or_else(|| {
            Failure::input(format!("state `{0}` has no initial value; give it with --initial {0}=...", state.name))
        })
    });
    let initial = initial.collect::<Outcome<Vec<f64>>>()?;
    on_grid(system, settings, command.period.unwrap_or((to - from) / ROWS), (from, to), &initial, kept)
}

/// Rows, less one, of a rollout without a log whose period is not given.
const ROWS: f64 = 1000.0;

/// A rollout under constant controls at equally spaced times.
fn on_grid(
    system: &System,
    settings: &Settings,
    period: f64,
    (from, to): (f64, f64),
    initial: &[f64],
    kept: &[Option<f64>],
) -> Outcome<Rollout> {
    let controls = &system.model().controls;
    if let Some((control, _)) = controls.iter().zip(kept).find(|(_, value)| value.is_none()) {
        let message = format!(
            "the model has the control `{0}`; keep it at a value with --control {0}=0, or hand in a log with --data and leave --period out",
            control.name
        );
        return Err(Failure::input(message));
    }
    if !(period > 0.0 && to > from && (to - from) / period <= 1e8) {
        return Err(Failure::input(format!(
            "--period must be above 0 and the end after the start, found {period} s and {from} to {to} s"
        )));
    }
    let n_steps = ((to - from) / period * (1.0 + 1e-12)).floor() as usize;
    let time: Vec<f64> = (0..=n_steps).map(|i| from + i as f64 * period).collect();
    let constant = faer::Mat::from_fn(time.len(), kept.len(), |_, j| kept[j].unwrap_or_default());
    let excitation = Excitation::new(system, &time, constant.as_ref(), settings.hold)?;
    Ok(settings.rollout(system, &excitation, initial)?)
}

/// The samples of a run between start and end, both included.
fn samples(run: &Run, command: &Simulate) -> Outcome<std::ops::Range<usize>> {
    let start = command.from.map_or(0, |from| run.time.partition_point(|t| *t < from));
    let after = |duration: f64| run.time.get(start).map_or(f64::INFINITY, |first| first + duration);
    let to = command.to.or(command.duration.map(after));
    let end = to.map_or(run.time.len(), |to| run.time.partition_point(|t| *t <= to));
    if start >= end {
        let (first, last) = (run.time[0], run.time[run.time.len() - 1]);
        return Err(Failure::input(format!(
            "{}: no sample between start and end; the log runs from {first} to {last} s",
            run.name
        )));
    }
    Ok(start..end)
}

fn override_initial(model: &Model, given: &[(String, f64)], initial: &mut [f64]) {
    for (name, value) in given {
        if let Some(index) = model.state_index(name) {
            initial[index] = *value;
        }
    }
}

/// One row a sample: the run where there are several, the time, what each state's column reads.
fn table(model: &Model, rollouts: &[(String, Rollout)], time_unit: &str) -> Table {
    let mut table = Table::new();
    if rollouts.len() > 1 {
        table =
            table.with_text("run", rollouts.iter().flat_map(|(name, r)| vec![name.clone(); r.time.len()]).collect());
    }
    let time = rollouts.iter().flat_map(|(_, r)| r.time.clone()).collect();
    table = table.with(&Channel::new("t").with_unit(time_unit), time);
    for (j, state) in model.states.iter().enumerate() {
        let channel = Channel::new(&state.name).with_unit(&state.unit);
        table = table.with(&channel, rollouts.iter().flat_map(|(_, r)| r.outputs.col_as_slice(j).to_vec()).collect());
    }
    table
}
