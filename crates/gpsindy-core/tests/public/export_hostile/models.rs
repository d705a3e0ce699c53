//! Models whose names and units try to run, and harmless twins of them.

use gpsindy_beside::random::Random;
use gpsindy_core::{Control, Expression, Model, Parameter, State};

/// Pieces that end a comment or a string somewhere, or begin a command; what runs would leave a file `ran` behind.
const PIECES: &str = r##""""|'''|"|'|`|```|*/|/*|//|/|*|#|#=|=#|##|\|\\|??/|??'|%|$|$(open("ran", "w"))|${ran}|&|&&|~|{|}|}}|{{|\}
[|]|(|)|;|<|>|>>> |>>> open('ran', 'w')|...|\input{/etc/passwd}|\write18{touch ran}|^^5cinput{ran}|\end{align*}|\end{document}
\N{BELL}|\x|\u12|\U0001|\r|\n|\0|open('ran', 'w')|import os|__import__('os').system('touch ran')|exec(1)
-*- coding: utf-7 -*-|coding: utf-16|+AAo-|#include <ran.h>|#error ran|#define double int
__attribute__((constructor)) void ran(void) {}|fn ran() {}|compile_error!("ran");|!doctest|    ran()|end|equation
annotation(__ran=true)|der(x) = 1;|unit="|run(`touch ran`)|é|°|μ|𝕏|א|　|m/s^2|N*s|%| |  |a|2|_|-|?|math.pi|bisect.bisect|<script>|noqa"##;

/// Characters that do not show, which a model may not have at all.
pub(crate) const HIDDEN: [char; 14] = [
    '\n', '\r', '\t', '\0', '\u{b}', '\u{c}', '\u{1a}', '\u{1b}', '\u{7f}', '\u{85}', '\u{2028}', '\u{2029}',
    '\u{202e}', '\u{2066}',
];

/// Names of states and others, of which each needs another identifier somewhere.
const NAMES: [&str; 16] = [
    "x",
    "lambda",
    "signal_0",
    "u00e9",
    "é",
    "θ",
    "linux",
    "None",
    "class",
    "history_1",
    "_",
    "e",
    "end",
    "Some",
    "model",
    "N_STATES",
];

pub(crate) fn below(random: &mut Random, n: usize) -> usize {
    (random.bits() % n as u64) as usize
}

pub(crate) fn text(random: &mut Random) -> String {
    let pieces: Vec<&str> = PIECES.split(['|', '\n']).collect();
    (0..below(random, 5)).map(|_| pieces[below(random, pieces.len())]).collect()
}

/// A model with hostile texts; half of them with a delay.
pub(crate) fn hostile(random: &mut Random) -> Model {
    let mut names: Vec<&str> = NAMES.to_vec();
    let mut name = |random: &mut Random| names.swap_remove(below(random, names.len())).to_string();
    let [x, v, u, k] = [name(random), name(random), name(random), name(random)];
    let signal = if below(random, 2) == 0 { format!("delay({u}, {k})") } else { u.clone() };
    let mut position = State::new(&x, Expression::variable(&v));
    position.unit = text(random);
    let mut speed = State::new(&v, Expression::parse(&format!("{signal} - {k}*sin({x}) + clamp({v}, -1, 1)")).unwrap());
    speed.unit = text(random);
    if below(random, 2) == 0 {
        speed.measured = Some(Expression::parse(&format!("delay({v}, {k}) + 1")).unwrap());
    }
    Model {
        name: text(random),
        states: vec![position, speed],
        controls: vec![Control { name: u, unit: text(random) }],
        parameters: vec![Parameter { unit: text(random), ..Parameter::new(k, 0.25) }],
        ..Model::default()
    }
}

/// The same model with harmless texts; a text that is empty stays so.
pub(crate) fn twin(model: &Model) -> Model {
    let mut twin = model.clone();
    let units = twin.states.iter_mut().map(|s| &mut s.unit).chain(twin.controls.iter_mut().map(|c| &mut c.unit));
    for unit in units.chain(twin.parameters.iter_mut().map(|p| &mut p.unit)).filter(|unit| !unit.trim().is_empty()) {
        *unit = "u".into();
    }
    if !twin.name.is_empty() {
        twin.name = "twin".into();
    }
    twin
}

/// So many hostile models of a seed.
pub(crate) fn models(seed: u64, count: usize) -> Vec<Model> {
    let mut random = Random::new(seed);
    (0..count).map(|_| hostile(&mut random)).collect()
}
