//! The pictures of docs/, made by the program itself: hare and lynx, and the pendulum of the demo.

use crate::plot::{Axis, Plot, Series, Stroke};
use crate::shell::{root, run};
use std::path::Path;

/// Two colours that differ in lightness too.
const COLOURS: [&str; 2] = ["#b2551d", "#1d5f9e"];

/// Every picture anew.
pub(crate) fn all() -> Result<(), String> {
    hare_lynx()?;
    pendulum()
}

/// `docs/hare_lynx.svg`: counts and the rollout of the equations that `identify` finds in them.
fn hare_lynx() -> Result<(), String> {
    gpsindy("identify data/hare_lynx.csv --state hare,lynx --degree 2 --refine --out target/hare_lynx.toml")?;
    gpsindy(
        "simulate target/hare_lynx.toml --data data/hare_lynx.csv --period 0.05 --out target/hare_lynx_rollout.csv",
    )?;
    let counts = columns(&root().join("data/hare_lynx.csv"), &["t", "hare", "lynx"], None)?;
    let rollout = columns(&root().join("target/hare_lynx_rollout.csv"), &["t", "hare", "lynx"], None)?;
    let last = counts[0].iter().copied().fold(1.0, f64::max);
    let highest = counts[1..].iter().chain(&rollout[1..]).flatten().copied().fold(1.0, f64::max);
    let series = ["hare", "lynx"].iter().zip(COLOURS).enumerate().flat_map(|(j, (name, colour))| {
        [
            Series { name: Some(name), colour, stroke: Stroke::Line, x: &rollout[0], y: &rollout[j + 1] },
            Series { name: None, colour, stroke: Stroke::Dots(3.5), x: &counts[0], y: &counts[j + 1] },
        ]
    });
    let plot = Plot {
        title: "Hare and lynx pelts, 1900 to 1920: counts and the rollout of the identified equations",
        y_label: "thousand pelts",
        note: "dots: counts; lines: rollout",
        x_label: "",
        x: Axis { from: 0.0, to: last, step: 5.0, offset: 1900.0 },
        y: Axis { from: 0.0, to: (highest / 20.0).ceil() * 20.0, step: 20.0, offset: 0.0 },
        series: series.collect(),
    };
    write("docs/hare_lynx.svg", &plot.draw())
}

/// `docs/pendulum.svg`: the held-out run, the simulator and the corrected simulator, both from the first sample on.
fn pendulum() -> Result<(), String> {
    /// The run that a diagnosis holds out of these four.
    const HELD_OUT: Option<&str> = Some("4");
    gpsindy("diagnose data/pendulum.toml data/pendulum.csv --run run --out target/picture --force --quiet")?;
    let log = columns(&root().join("data/pendulum.csv"), &["t", "phi"], HELD_OUT)?;
    let mut rollouts = Vec::new();
    for (name, model) in [("simulator", "data/pendulum.toml"), ("corrected", "target/picture/augmented.toml")] {
        let out = format!("target/picture/{name}.csv");
        gpsindy(&format!("simulate {model} --data data/pendulum.csv --run run --out {out}"))?;
        rollouts.push(columns(&root().join(&out), &["t", "phi"], HELD_OUT)?);
    }
    let all = rollouts.iter().chain([&log]).flat_map(|run| &run[1]);
    let (low, high) = all.fold((0.0, 0.0), |(low, high): (f64, f64), v| (low.min(*v), high.max(*v)));
    let last = log[0].last().copied().unwrap_or_default();
    let line = |name, colour, stroke, run: usize| Series {
        name: Some(name),
        colour,
        stroke,
        x: &rollouts[run][0],
        y: &rollouts[run][1],
    };
    let plot = Plot {
        title: "Angle of a pendulum in a run that nothing was fitted to: log, simulator, corrected simulator",
        y_label: "angle, rad",
        note: "held out",
        x_label: "time, s",
        x: Axis { from: 0.0, to: last.ceil(), step: 2.0, offset: 0.0 },
        y: Axis { from: (low / 20.0).floor() * 20.0, to: (high / 20.0).ceil() * 20.0, step: 20.0, offset: 0.0 },
        series: vec![
            Series { name: Some("log"), colour: "#8a8f98", stroke: Stroke::Dots(3.0), x: &log[0], y: &log[1] },
            line("simulator", COLOURS[0], Stroke::Dashes, 0),
            line("corrected simulator", COLOURS[1], Stroke::Line, 1),
        ],
    };
    write("docs/pendulum.svg", &plot.draw())
}

fn gpsindy(arguments: &str) -> Result<(), String> {
    let start = "run --quiet --release --package gpsindy-cli --";
    run("cargo", start.split(' ').chain(arguments.split(' ')), &[])
}

fn write(path: &str, text: &str) -> Result<(), String> {
    let path = root().join(path);
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The named columns of a CSV file without quotes, of one run or of all; units are cut off the headers.
fn columns(path: &Path, names: &[&str], run: Option<&str>) -> Result<Vec<Vec<f64>>, String> {
    let wrong = |what: String| format!("{}: {what}", path.display());
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let headers: Vec<&str> =
        lines.next().unwrap_or_default().split(',').map(|h| h.split(" [").next().unwrap_or(h)).collect();
    let at = |name: &str| headers.iter().position(|h| *h == name).ok_or_else(|| wrong(format!("no column {name}")));
    let run = run.map(|run| Ok::<_, String>((at("run")?, run))).transpose()?;
    let mut found = vec![Vec::new(); names.len()];
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |at: usize| cells.get(at).copied().unwrap_or_default();
        // A rollout names a run by its file as well: `pendulum.csv:4`.
        if run.is_some_and(|(at, run)| cell(at).rsplit(':').next() != Some(run)) {
            continue;
        }
        for (name, column) in names.iter().zip(&mut found) {
            let cell = cell(at(name)?);
            column.push(cell.parse().map_err(|_| wrong(format!("not a number: {cell}")))?);
        }
    }
    Ok(found)
}
