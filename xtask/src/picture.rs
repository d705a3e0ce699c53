//! The picture of docs/: hare and lynx counts beside the rollout of the equations that `identify` finds in them.

use crate::shell::{root, run};
use std::fmt::Write;
use std::path::Path;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 44.0;
/// Two colours that differ in lightness too.
const COLOURS: [&str; 2] = ["#b2551d", "#1d5f9e"];

/// Identifies, simulates and draws `docs/hare_lynx.svg`.
pub(crate) fn hare_lynx() -> Result<(), String> {
    let gpsindy = |arguments: &str| {
        let start = "run --quiet --release --package gpsindy-cli --";
        run("cargo", start.split(' ').chain(arguments.split(' ')), &[])
    };
    gpsindy("identify data/hare_lynx.csv --state hare,lynx --degree 2 --refine --out target/hare_lynx.toml")?;
    gpsindy(
        "simulate target/hare_lynx.toml --data data/hare_lynx.csv --period 0.05 --out target/hare_lynx_rollout.csv",
    )?;
    let counts = columns(&root().join("data/hare_lynx.csv"), &["t", "hare", "lynx"])?;
    let rollout = columns(&root().join("target/hare_lynx_rollout.csv"), &["t", "hare", "lynx"])?;
    let path = root().join("docs/hare_lynx.svg");
    std::fs::write(&path, draw(&counts, &rollout)).map_err(|e| format!("{}: {e}", path.display()))
}

/// The named columns of a CSV file without quotes; units are cut off the headers.
fn columns(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, String> {
    let wrong = |what: String| format!("{}: {what}", path.display());
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let headers: Vec<&str> =
        lines.next().unwrap_or_default().split(',').map(|h| h.split(" [").next().unwrap_or(h)).collect();
    let mut found = vec![Vec::new(); names.len()];
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        for (name, column) in names.iter().zip(&mut found) {
            let at = headers.iter().position(|h| h == name).ok_or_else(|| wrong(format!("no column {name}")))?;
            let cell = cells.get(at).copied().unwrap_or_default();
            column.push(cell.parse().map_err(|_| wrong(format!("not a number: {cell}")))?);
        }
    }
    Ok(found)
}

fn draw(counts: &[Vec<f64>], rollout: &[Vec<f64>]) -> String {
    let last = counts[0].iter().copied().fold(1.0, f64::max);
    let highest = counts[1..].iter().chain(&rollout[1..]).flatten().copied().fold(1.0, f64::max);
    let top = (highest / 20.0).ceil() * 20.0;
    let x = |t: f64| LEFT + (WIDTH - LEFT - RIGHT) * t / last;
    let y = |v: f64| HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * v / top;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\" role=\"img\">\n\
         <title>Hare and lynx pelts, 1900 to 1920: counts and the rollout of the identified equations</title>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>\n"
    );
    let mut value = 0.0;
    while value <= top {
        let at = y(value);
        let _ = writeln!(
            svg,
            "<line x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#dddddd\"/>",
            WIDTH - RIGHT
        );
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#333333\">{value}</text>",
            LEFT - 8.0,
            at + 4.5
        );
        value += 20.0;
    }
    let mut year = 0.0;
    while year <= last {
        let label = 1900.0 + year;
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"#333333\">{label}</text>",
            x(year),
            HEIGHT - BOTTOM + 20.0
        );
        year += 5.0;
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"20\" fill=\"#333333\">thousand pelts</text>\n\
         <text x=\"{}\" y=\"20\" text-anchor=\"end\" fill=\"#333333\">dots: counts; lines: rollout from the first year</text>",
        LEFT - 40.0,
        WIDTH - RIGHT
    );
    for (j, (name, colour)) in ["hare", "lynx"].into_iter().zip(COLOURS).enumerate() {
        let points: Vec<String> =
            rollout[0].iter().zip(&rollout[j + 1]).map(|(t, v)| format!("{:.1},{:.1}", x(*t), y(*v))).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            points.join(" ")
        );
        for (t, v) in counts[0].iter().zip(&counts[j + 1]) {
            let _ = writeln!(svg, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{colour}\"/>", x(*t), y(*v));
        }
        let at = LEFT + 110.0 + 70.0 * j as f64;
        let _ = writeln!(
            svg,
            "<circle cx=\"{at}\" cy=\"15.5\" r=\"4\" fill=\"{colour}\"/><text x=\"{}\" y=\"20\" fill=\"#333333\">{name}</text>",
            at + 9.0
        );
    }
    svg + "</svg>\n"
}
