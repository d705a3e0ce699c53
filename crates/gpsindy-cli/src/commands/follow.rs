//! `gpsindy identify --follow`: identification from a growing log.

use super::identify::{self, Identify, as_json, rounded, summary_of};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::stop;
use crate::text::{count, short};
use clap::Args;
use gpsindy_core::gp::Kernel;
use gpsindy_core::regress::Selection;
use gpsindy_core::{Channel, Choice, Delay, Identification, Identify as Settings, Online, OnlineSettings, Target};
use gpsindy_files::{Logs, Sample, Stream, model_to_toml, write_model};
use serde_json::json;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

#[derive(Debug, Args)]
#[command(next_help_heading = "Following a growing log")]
pub(crate) struct FollowOptions {
    /// Follow one log sample by sample, from standard input (`-`) or a growing file; --out always holds the newest model, Ctrl-C ends normally
    #[arg(long)]
    pub(crate) follow: bool,
    /// Report the model every N samples [default: whenever its terms change]
    #[arg(long, value_name = "N", requires = "follow")]
    every: Option<NonZeroUsize>,
    /// Forgetting time: after it the weight of a sample has fallen to 1/e [default: no forgetting]
    #[arg(long, value_name = "SECONDS", requires = "follow", allow_negative_numbers = true)]
    memory: Option<f64>,
    /// Samples kept for the hyperparameters and for smoothing the newest ones, at least 64
    #[arg(long, value_name = "N", requires = "follow", default_value_t = 1000)]
    window: usize,
    /// Stop after a file has not grown for this time; standard input ends on its own
    #[arg(long, value_name = "SECONDS", requires = "follow", default_value_t = 10.0, allow_negative_numbers = true)]
    idle: f64,
}

/// How often a file is looked at, and Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Lines that are read ahead.
const AHEAD: usize = 1024;

/// What the reading thread has to say.
enum News {
    Line(Vec<u8>),
    Failed(std::io::Error),
    End,
}

/// A model under way.
struct Following<'a> {
    online: Online,
    states: Vec<String>,
    controls: Vec<String>,
    /// Time of the newest sample, s.
    time: f64,
    /// Terms when the model was last printed, and the samples it had.
    printed: (Vec<Vec<String>>, usize),
    every: Option<NonZeroUsize>,
    /// Where the model goes.
    out: Option<&'a Path>,
    screen: &'a Screen,
}

pub(crate) fn run(command: &Identify, screen: &Screen) -> Outcome {
    let options = &command.follow;
    let [path] = command.logs.as_slice() else {
        return Err(Failure::input(format!("--follow takes one log, found {}", command.logs.len())));
    };
    if options.idle.is_nan() || options.idle <= 0.0 {
        return Err(Failure::input(format!("--idle must be above 0, found {}", options.idle)));
    }
    let file = if path.as_os_str() == "-" { "stdin".to_string() } else { path.display().to_string() };
    let stop = stop::requested().map_err(|e| Failure::Work(format!("cannot listen to Ctrl-C: {e}")))?;
    let lines = lines_of(path, options.idle)?;
    let mut stream = Stream::new(&file, command.columns.options()?);
    let mut following: Option<Following<'_>> = None;
    while let Some(line) = next(&lines, &stop, &file)? {
        let Some(sample) = stream.push(&line)? else { continue };
        let following = match &mut following {
            Some(following) => following,
            none => none.insert(Following::new(command, &stream, &sample, screen)?),
        };
        following.take(&stream, &sample)?;
    }
    let Some(following) = following else {
        return Err(Failure::input(format!("{file}: no sample; expected a header row and then one sample per row")));
    };
    following.end()
}

impl<'a> Following<'a> {
    fn new(command: &'a Identify, stream: &Stream, first: &Sample, screen: &'a Screen) -> Outcome<Self> {
        let Some(header) = stream.header() else { return Err(Failure::input("the log has no header")) };
        let logs = Logs::of(header.clone());
        let settings = identify::settings(command, &logs, 0)?;
        let mut states = settings.states.clone();
        if states.is_empty() {
            states = stream.numeric_columns(first);
            states.retain(|name| !settings.controls.contains(name));
            screen.note(&format!("states: {} (all numeric columns; choose with --state)", states.join(", ")));
        }
        let controls = settings.controls.clone();
        let used: Vec<&String> = states.iter().chain(&controls).collect();
        let ignored = logs.ignored(&used);
        if !ignored.is_empty() {
            screen.note(&format!("columns ignored: {}", ignored.join(", ")));
        }
        for warning in logs.warnings() {
            screen.warn(&warning);
        }
        let channels = |names: &[String]| -> Vec<Channel> {
            let unit = |name: &String| header.column(name).map(|h| h.unit.clone()).unwrap_or_default();
            names.iter().map(|name| Channel::new(name).with_unit(unit(name))).collect()
        };
        let angles = command.columns.angle.iter().map(|angle| Ok(logs.resolve(angle)?)).collect::<Outcome<_>>()?;
        let settings = OnlineSettings {
            states: channels(&states),
            controls: channels(&controls),
            angles,
            delays: delays(command, &logs)?,
            memory: command.follow.memory,
            window: command.follow.window,
            ..online(command, settings)?
        };
        let printed = (Vec::new(), 0);
        let online = Online::new(settings)?;
        let (every, out) = (command.follow.every, command.output.out.as_deref());
        Ok(Self { online, states, controls, time: first.time(), printed, every, out, screen })
    }

    fn take(&mut self, stream: &Stream, sample: &Sample) -> Outcome {
        let states = stream.values(sample, &self.states)?;
        let controls = stream.values(sample, &self.controls)?;
        if sample.begins() && self.online.n_samples() > 0 {
            self.online.begin_run()?;
        }
        let news = self.online.update(sample.time(), &states, &controls)?;
        self.time = sample.time();
        let due = match self.every {
            Some(every) => self.online.n_samples() >= self.printed.1 + every.get(),
            None => news,
        };
        // The first samples are too few for any model.
        if due && let Ok(found) = self.online.identification() {
            self.print(&found)?;
        }
        Ok(())
    }

    /// Prints and writes the model where its terms have changed, or in any case with --every.
    fn print(&mut self, found: &Identification) -> Outcome {
        let terms: Vec<Vec<String>> = found.states.iter().map(|s| s.terms.clone()).collect();
        if self.every.is_none() && terms == self.printed.0 {
            return Ok(());
        }
        self.printed = (terms, self.online.n_samples());
        if let Some(path) = self.out {
            write_model(path, &found.model)?;
        }
        if self.screen.json() {
            return self.screen.out(&format!("{}\n", self.line(found, false)));
        }
        let equations = found.model.states.iter().map(|state| format!("{}' = {}", state.name, rounded(found, state)));
        let equations = equations.collect::<Vec<_>>().join("; ");
        self.screen.note(&format!(
            "t = {}, {}: {equations}",
            short(self.time),
            count(self.online.n_samples(), "sample")
        ));
        Ok(())
    }

    fn line(&self, found: &Identification, last: bool) -> serde_json::Value {
        let mut line = as_json(found, None);
        line["t"] = json!(self.time);
        line["samples"] = json!(self.online.n_samples());
        line["final"] = json!(last);
        line
    }

    /// The last word: the model of all samples, to the file and to the screen.
    fn end(self) -> Outcome {
        let found = self.online.identification()?;
        for note in &found.notes {
            self.screen.warn(&note.to_string());
        }
        if let Some(path) = self.out {
            write_model(path, &found.model)?;
        }
        let summary = summary_of(&count(self.online.n_samples(), "sample"), &found, None);
        match self.out {
            _ if self.screen.json() => self.screen.out(&format!("{}\n", self.line(&found, true))),
            Some(path) => self.screen.out(&format!("{summary}\nmodel: {}\n", path.display())),
            None => {
                self.screen.note(&summary);
                self.screen.out(&model_to_toml(&found.model)?)
            }
        }
    }
}

/// The options of `identify` that a stream can heed; the others are refused by name.
fn online(command: &Identify, settings: Settings) -> Outcome<OnlineSettings> {
    let refused = |option: &str, why: &str| Err(Failure::input(format!("{option} does not go with --follow: {why}")));
    if !settings.derivatives.is_empty() {
        return refused("--derivative", "only states are read");
    }
    if !matches!(settings.target, Target::Weak) {
        return refused("--derivative-method or --preset", "only the weak form can be accumulated");
    }
    if settings.smoother.is_none() {
        return refused("--smoother none", "the newest samples are smoothed");
    }
    if settings.standardize {
        return refused("--standardize", "the scales are not known in advance");
    }
    if settings.train_fraction != 1.0 {
        return refused("--train-fraction", "the length of the log is not known");
    }
    if settings.ensemble > 0 {
        return refused("--ensemble", "past rows are not kept");
    }
    if command.refines() {
        return refused("--refine", "it needs the whole log; run identify again when the log is complete");
    }
    let selection = match settings.choice {
        Choice::Rows(selection) => selection,
        Choice::Rollout => return refused("--select rollout", "past rows are not kept"),
    };
    let mut online = OnlineSettings {
        library: settings.library,
        constraints: settings.constraints,
        regressor: settings.regressor,
        hold: settings.hold.unwrap_or_default(),
        selection: match selection {
            Selection::Bic { .. } => Selection::Bic { noise: None },
            other => other,
        },
        ..OnlineSettings::default()
    };
    if command.names_kernel() {
        online.kernels = settings.smoother.map(|s| s.kernels).unwrap_or_default();
        if let Some(kernel) = online.kernels.iter().find(|k| !matches!(k, Kernel::Matern32 | Kernel::Matern52)) {
            return refused(&format!("--kernel {kernel}"), "take matern32 or matern52");
        }
    }
    Ok(online)
}

fn delays(command: &Identify, logs: &Logs) -> Outcome<Vec<(String, f64)>> {
    let known = |(control, delay): (String, Delay)| match delay {
        Delay::Fixed(value) => Ok((control, value)),
        Delay::Auto(_) => Err(Failure::input(format!(
            "--delay {control}=auto does not go with --follow: it needs the whole log; hand in seconds"
        ))),
    };
    identify::delays(command, logs)?.into_iter().map(known).collect()
}

/// The next line; `None` at the end of the log and after Ctrl-C.
fn next(lines: &Receiver<News>, stop: &AtomicBool, file: &str) -> Outcome<Option<Vec<u8>>> {
    while !stop.load(Ordering::Relaxed) {
        match lines.recv_timeout(LOOK) {
            Ok(News::Line(line)) => return Ok(Some(line)),
            Ok(News::Failed(source)) => {
                return Err(gpsindy_files::Error::Read { file: file.into(), source }.into());
            }
            Ok(News::End) | Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
    Ok(None)
}

/// Starts to read lines; a file is waited for at its end for `idle` seconds.
fn lines_of(path: &Path, idle: f64) -> Outcome<Receiver<News>> {
    let (sender, receiver) = sync_channel(AHEAD);
    if path.as_os_str() == "-" {
        thread::spawn(move || read(std::io::stdin(), None, &sender));
        return Ok(receiver);
    }
    let failed = |source| gpsindy_files::Error::Read { file: path.display().to_string(), source };
    let file = File::open(path).map_err(failed)?;
    // Beyond a thousand years there is nothing to distinguish.
    let patience = Duration::from_secs_f64(idle.min(3e10));
    thread::spawn(move || read(file, Some(patience), &sender));
    Ok(receiver)
}

/// Sends whole lines until the end, or until nobody listens; what follows the last line end comes at the end.
fn read(source: impl Read, patience: Option<Duration>, sender: &SyncSender<News>) {
    let mut reader = BufReader::new(source);
    let mut line = Vec::new();
    let mut grown = Instant::now();
    loop {
        let news = match reader.read_until(b'\n', &mut line) {
            Ok(0) if patience.is_some_and(|patience| grown.elapsed() < patience) => {
                thread::sleep(LOOK);
                continue;
            }
            Ok(0) => break,
            Ok(_) if line.ends_with(b"\n") => News::Line(std::mem::take(&mut line)),
            // A line that is still being written.
            Ok(_) => continue,
            Err(error) => News::Failed(error),
        };
        grown = Instant::now();
        if sender.send(news).is_err() {
            return;
        }
    }
    if !line.is_empty() {
        let _ = sender.send(News::Line(line));
    }
    let _ = sender.send(News::End);
}
