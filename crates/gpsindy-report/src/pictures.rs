//! What an effect looks like in a log: the simulator and a machine with the effect in it, moved in the same way.

use crate::chart::{Chart, Mark};
use gpsindy_core::diagnose::{Effect, Example};
use gpsindy_core::{Control, Error, Excitation, Expression, Hold, Model, Simulate, State};
use std::fmt::Write;

/// Samples of a picture: a line of them looks smooth, and the file stays small.
const SAMPLES: usize = 240;

/// The style of a picture on its own: it is on white, whatever the page's colours are.
const STYLE: &str = "text{fill:#1b1f24;font:12px system-ui,-apple-system,\"Segoe UI\",Roboto,\"DejaVu Sans\",sans-serif}\
    .label{fill:#57606a}.grid{stroke:#d0d7de;stroke-width:.6}.frame{fill:none;stroke:#57606a}.zero{stroke:#57606a}\
    path{fill:none;stroke-linejoin:round;stroke-width:2}.before{stroke:#c04a00;stroke-dasharray:6 3.5}.after{stroke:#0067a8}";

/// A picture of an effect, and the words under it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EffectPicture {
    /// A whole SVG file.
    pub svg: String,
    /// What was simulated, in Markdown.
    pub caption: String,
}

/// The picture of an effect: the same motion of a simulator and of a machine that has the effect.
///
/// # Errors
/// What the simulation says.
pub fn effect_picture(effect: Effect) -> Result<EffectPicture, Error> {
    let example = effect.example();
    let time: Vec<f64> = (0..SAMPLES).map(|i| example.until * i as f64 / (SAMPLES - 1) as f64).collect();
    let before = rollout(example, false, &time)?;
    let after = rollout(example, true, &time)?;
    let all = || before.iter().chain(&after).copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let margin = 0.06 * (high - low);
    let present = |values: Vec<f64>| values.into_iter().map(Some).collect();
    let chart = Chart {
        title: format!("What {} looks like in a log", effect.name()),
        description: format!(
            "Dashed: {} in the simulator. Solid: in a machine with {}. {}.",
            example.column,
            effect.name(),
            effect.signature()
        ),
        x_label: "t (s)".into(),
        y_label: example.column.into(),
        marks: vec![Mark::Line("before", &time, present(before)), Mark::Line("after", &time, present(after))],
        shades: Vec::new(),
        y_range: (low - margin, high + margin),
    };
    Ok(EffectPicture { svg: alone(&chart.draw(0).into_string(), effect.name()), caption: caption(example) })
}

/// The column over time; in the machine with what the effect changes.
fn rollout(example: &Example, machine: bool, time: &[f64]) -> Result<Vec<f64>, Error> {
    let mut model = Model { controls: vec![Control::new("u")], ..Model::default() };
    let mut initial = Vec::new();
    for &(name, start, equation) in example.simulator {
        model.states.push(State::new(name, Expression::parse(equation)?));
        initial.push(start);
    }
    if machine {
        for &(name, equation) in example.machine {
            let equation = Expression::parse(equation)?;
            match model.states.iter_mut().find(|state| state.name == name) {
                Some(state) => state.equation = equation,
                None => {
                    initial.push(example.own_start);
                    model.states.push(State::new(name, equation));
                }
            }
        }
    }
    let column = model.state_index(example.column).ok_or_else(|| unknown("state", example.column))?;
    if machine && !example.reads.is_empty() {
        model.states[column].measured = Some(Expression::parse(example.reads)?);
    }
    let system = model.compile()?;
    let controls = gpsindy_core::faer::Mat::from_fn(time.len(), 1, |i, _| example.drive.at(time[i], example.until));
    let excitation = Excitation::new(&system, time, controls.as_ref(), Hold::Zero)?;
    let rollout = Simulate::default().rollout(&system, &excitation, &initial)?;
    Ok((0..time.len()).map(|i| rollout.outputs[(i, column)]).collect())
}

fn unknown(kind: &str, name: &str) -> Error {
    Error::UnknownName { kind: kind.into(), name: name.into(), known: Vec::new() }
}

/// The chart as a file of its own, with its style and a legend.
fn alone(chart: &str, effect: &str) -> String {
    let open = chart.find('>').map_or(0, |at| at + 1);
    let (start, rest) = chart.split_at(open);
    let start = start.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1);
    let legend = format!(
        "<path class=\"before\" d=\"M60 10h24\"/><text class=\"label\" x=\"88\" y=\"14\">simulator</text>\
         <path class=\"after\" d=\"M160 10h24\"/><text class=\"label\" x=\"188\" y=\"14\">machine with {effect}</text>"
    );
    format!("{start}<style>{STYLE}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>{legend}{rest}\n")
}

/// What was simulated, in Markdown.
fn caption(example: &Example) -> String {
    let mut words = format!("The same machine twice, {}. Simulator: ", example.drive.words());
    let equations: Vec<String> = example.simulator.iter().map(|(name, _, f)| format!("`{name}' = {f}`")).collect();
    let changed = example.machine.iter().map(|(name, f)| format!("`{name}' = {f}`"));
    let reads =
        (!example.reads.is_empty()).then(|| format!("the column `{}` reads `{}`", example.column, example.reads));
    let changed: Vec<String> = changed.chain(reads).collect();
    // Writing to a String can't fail.
    let _ = write!(words, "{}. Machine: {}.", equations.join(", "), changed.join(", "));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_a_picture_in_which_it_shows() {
        let mut hidden = Vec::new();
        for &effect in Effect::ALL {
            let picture = effect_picture(effect).unwrap_or_else(|e| panic!("{}: {e}", effect.id()));
            let example = effect.example();
            let time: Vec<f64> = (0..120).map(|i| example.until * f64::from(i) / 119.0).collect();
            let [before, after] = [false, true].map(|machine| rollout(example, machine, &time).unwrap());
            let span = |values: &[f64]| {
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                    - values.iter().copied().fold(f64::INFINITY, f64::min)
            };
            let apart = before.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // A tenth of the range is a line's breadth ten times over on the page.
            if !(apart > 0.1 * span(&before)) {
                hidden.push(format!("{}: {apart} of {}", effect.id(), span(&before)));
            }
            assert!(picture.svg.starts_with("<svg xmlns=") && picture.svg.len() < 12_000, "{}", effect.id());
            assert!(picture.caption.contains("Machine: `") || !example.reads.is_empty(), "{}", effect.id());
        }
        assert!(hidden.is_empty(), "{hidden:?}");
    }
}
