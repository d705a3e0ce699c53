//! Names and units of a model file are a stranger's text: nothing of them may run, or be read, as part of an exported program.
//!
//! Every export of a hostile model is stripped of comments and strings by scanners that know nothing of the export, and
//! must then be the export of a harmless twin. Python, C and Rust are run as well, where they are at hand.
#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_core::{Control, Export, Expression, Language, Model, Parameter, State};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Pieces that end a comment or a string somewhere, or begin a command; what runs would leave a file `ran` behind.
const PIECES: &str = r##""""|'''|"|'|`|```|*/|/*|//|/|*|#|#=|=#|##|\|\\|??/|??'|%|$|$(open("ran", "w"))|${ran}|&|&&|~|{|}|}}|{{|\}
[|]|(|)|;|<|>|>>> |>>> open('ran', 'w')|...|\input{/etc/passwd}|\write18{touch ran}|^^5cinput{ran}|\end{align*}|\end{document}
\N{BELL}|\x|\u12|\U0001|\r|\n|\0|open('ran', 'w')|import os|__import__('os').system('touch ran')|exec(1)
-*- coding: utf-7 -*-|coding: utf-16|+AAo-|#include <ran.h>|#error ran|#define double int
__attribute__((constructor)) void ran(void) {}|fn ran() {}|compile_error!("ran");|!doctest|    ran()|end|equation
annotation(__ran=true)|der(x) = 1;|unit="|run(`touch ran`)|é|°|μ|𝕏|א|　|m/s^2|N*s|%| |  |a|2|_|-|?|math.pi|bisect.bisect|<script>|noqa"##;

/// Characters that do not show, which a model may not have at all.
const HIDDEN: [char; 14] = [
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

fn below(random: &mut ChaCha8Rng, n: usize) -> usize {
    (random.next_u64() % n as u64) as usize
}

fn text(random: &mut ChaCha8Rng) -> String {
    let pieces: Vec<&str> = PIECES.split(['|', '\n']).collect();
    (0..below(random, 5)).map(|_| pieces[below(random, pieces.len())]).collect()
}

/// A model with hostile texts; half of them with a delay.
fn hostile(random: &mut ChaCha8Rng) -> Model {
    let mut names: Vec<&str> = NAMES.to_vec();
    let mut name = |random: &mut ChaCha8Rng| names.swap_remove(below(random, names.len())).to_string();
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
fn twin(model: &Model) -> Model {
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

/// Rules of a language for the scanner.
struct Marks {
    line: &'static str,
    /// Opening, closing, and whether they nest.
    block: Option<(&'static str, &'static str, bool)>,
    /// Quotes of strings, the longest first, in which `\` hides the next character.
    quotes: &'static [&'static str],
    /// Whether `$` in a string begins code.
    interpolates: bool,
}

fn marks(language: Language) -> Marks {
    match language {
        Language::Python | Language::Sympy => {
            Marks { line: "#", block: None, quotes: &["\"\"\"", "'''", "\"", "'"], interpolates: false }
        }
        Language::C => {
            Marks { line: "//", block: Some(("/*", "*/", false)), quotes: &["\"", "'"], interpolates: false }
        }
        Language::Rust => Marks { line: "//", block: Some(("/*", "*/", true)), quotes: &["\""], interpolates: false },
        Language::Julia => {
            Marks { line: "#", block: Some(("#=", "=#", true)), quotes: &["\"\"\"", "\"", "`"], interpolates: true }
        }
        Language::Modelica => {
            Marks { line: "//", block: Some(("/*", "*/", false)), quotes: &["\""], interpolates: false }
        }
        _ => panic!("{language:?} has no comments that the scanner knows"),
    }
}

/// The source without comments and without the content of strings; nothing may be left open at its end.
fn stripped(source: &str, marks: &Marks) -> Result<String, String> {
    let mut code = String::new();
    let mut rest = source;
    'next: while let Some(character) = rest.chars().next() {
        if let Some((open, close, nests)) = marks.block
            && let Some(inside) = rest.strip_prefix(open)
        {
            let (mut depth, mut at) = (1, inside);
            while depth > 0 {
                if let Some(after) = at.strip_prefix(close) {
                    (depth, at) = (depth - 1, after);
                } else if let Some(after) = at.strip_prefix(open).filter(|_| nests) {
                    (depth, at) = (depth + 1, after);
                } else {
                    let c = at.chars().next().ok_or("a comment stays open")?;
                    at = &at[c.len_utf8()..];
                }
            }
            rest = at;
            continue;
        }
        if rest.starts_with(marks.line) {
            rest = rest.find(['\n', '\r']).map_or("", |end| &rest[end..]);
            continue;
        }
        for quote in marks.quotes {
            let Some(mut at) = rest.strip_prefix(quote) else { continue };
            while !at.starts_with(quote) {
                let c = at.chars().next().ok_or("a string stays open")?;
                if c == '\n' && quote.len() == 1 {
                    return Err(format!("a string is cut by its line: {rest:.60}"));
                }
                if c == '$' && marks.interpolates {
                    return Err(format!("a string is interpolated: {rest:.60}"));
                }
                at = &at[c.len_utf8()..];
                if c == '\\' {
                    at = &at[at.chars().next().ok_or("a string ends in a backslash")?.len_utf8()..];
                }
            }
            code += "\"\"";
            rest = &at[quote.len()..];
            continue 'next;
        }
        code.push(character);
        rest = &rest[character.len_utf8()..];
    }
    // Spaces in front of a comment and lines of comments alone don't matter.
    Ok(code.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n"))
}

/// Words of a source: letters, digits and `_`.
fn words(code: &str) -> BTreeSet<&str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_').collect()
}

/// What a model calls itself in C and in Modelica is one plain identifier; `OWN` takes its place.
fn with_own_name(code: &str, language: Language) -> String {
    let own = match language {
        Language::C => code.split("_n_states").next().unwrap().rsplit(' ').next().unwrap(),
        Language::Modelica => code.split_whitespace().nth(1).unwrap(),
        _ => return code.into(),
    };
    assert!(own.starts_with(|c: char| c.is_ascii_alphabetic()), "{own}");
    assert!(own.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{own}");
    if language == Language::Modelica {
        return code.replacen(&format!("model {own}"), "model OWN", 1).replace(&format!("end {own};"), "end OWN;");
    }
    // What the program itself is made of; a state may be called as the model is.
    let parts = "n_ parameters_t nominal initial_state record_t sample_at signal_ history_ rates outputs simulate";
    let is_own = |word: &str| parts.split(' ').any(|part| word.starts_with(&format!("{own}_{part}")));
    let longest_first = words(code).into_iter().rev().filter(|word| is_own(word));
    longest_first.fold(code.to_string(), |code, word| code.replace(word, &word.replacen(own, "OWN", 1)))
}

/// What is left of a source when nothing of the user's free text is left.
fn skeleton(model: &Model, language: Language) -> String {
    let source = model.export(language).unwrap();
    let code = stripped(&source, &marks(language)).unwrap_or_else(|e| panic!("{language:?}: {e}\n{source}"));
    // Modelica has units as attributes, where it can say them.
    with_own_name(&code, language).replace("(unit=\"\")", "").replace("unit=\"\", ", "")
}

#[test]
fn no_text_of_a_model_leaves_its_comment_or_string() {
    let languages =
        [Language::Python, Language::Sympy, Language::C, Language::Rust, Language::Julia, Language::Modelica];
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..3000 {
        let model = hostile(&mut random);
        let twin = twin(&model);
        for language in languages {
            let (found, wanted) = (skeleton(&model, language), skeleton(&twin, language));
            assert_eq!(found, wanted, "{language:?}\n{model:#?}\n{}", model.export(language).unwrap());
        }
    }
}

/// Commands of LaTeX that an export may use.
const COMMANDS: [&str; 18] = [
    "dot",
    "frac",
    "mathrm",
    "begin",
    "end",
    "left",
    "right",
    "sin",
    "operatorname",
    "backslash",
    "wedge",
    "sim",
    "circ",
    "mu",
    "Omega",
    "text",
    "lambda",
    "theta",
];

/// The equations without their units, which are groups behind `\ \mathrm`; every command is one of ours.
fn latex_skeleton(source: &str) -> String {
    let mut code = String::new();
    let (mut depth, mut unit) = (0_usize, None);
    let mut rest = source;
    while let Some(character) = rest.chars().next() {
        assert!(!rest.starts_with("^^"), "a character by its code\n{source}");
        if unit.is_none() && rest.starts_with("\\ \\mathrm{") {
            unit = Some(depth);
            rest = &rest["\\ \\mathrm".len()..];
            continue;
        }
        let mut length = character.len_utf8();
        match character {
            '\\' => {
                let name: String = rest[1..].chars().take_while(char::is_ascii_alphabetic).collect();
                length = 1 + if name.is_empty() { rest[1..].chars().next().unwrap().len_utf8() } else { name.len() };
                let command = &rest[1..length];
                let is_known = COMMANDS.contains(&command) || (name.is_empty() && "%$#&_{},\\ ".contains(command));
                assert!(is_known, "command {command:?}\n{source}");
                assert!(unit.is_none() || !["begin", "end", "left", "\\"].contains(&command), "{source}");
            }
            '{' => depth += 1,
            '}' => {
                depth = depth.checked_sub(1).unwrap_or_else(|| panic!("a brace too many\n{source}"));
                if unit == Some(depth) {
                    unit = None;
                    rest = &rest[1..];
                    continue;
                }
            }
            '%' => {
                let line = rest.split('\n').next().unwrap();
                let own = ["% rates of the states", "% what the columns of a log read", "% parameters"];
                assert!(own.contains(&line), "{source}");
            }
            '$' | '#' | '~' => panic!("an active character\n{source}"),
            '&' | '\n' => assert!(unit.is_none(), "a unit leaves its cell\n{source}"),
            _ => {}
        }
        if unit.is_none() {
            code += &rest[..length];
        }
        rest = &rest[length..];
    }
    assert_eq!((depth, unit), (0, None), "{source}");
    code
}

#[test]
fn no_text_of_a_model_becomes_a_command_of_latex() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..3000 {
        let model = hostile(&mut random);
        for full_digits in [false, true] {
            let write = |model: &Model| Export { full_digits }.write(model, Language::Latex).unwrap();
            assert_eq!(latex_skeleton(&write(&model)), latex_skeleton(&write(&twin(&model))), "{model:#?}");
        }
    }
}

#[test]
fn text_that_does_not_show_is_never_exported() {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for i in 0..1000 {
        let mut model = hostile(&mut random);
        let chosen = match i % 5 {
            0 => &mut model.name,
            1 => &mut model.states[0].unit,
            2 => &mut model.controls[0].unit,
            3 => &mut model.parameters[0].unit,
            _ => &mut model.states[1].name,
        };
        let places: Vec<usize> = (0..=chosen.len()).filter(|&at| chosen.is_char_boundary(at)).collect();
        chosen.insert(places[below(&mut random, places.len())], HIDDEN[i % HIDDEN.len()]);
        for language in Language::ALL {
            let error = model.export(language).unwrap_err().to_string();
            assert!(error.contains("which does not show"), "{error}");
            assert!(!error.contains(HIDDEN), "{error:?}");
        }
    }
}

#[test]
fn the_scanners_see_what_leaves_a_comment() {
    for (language, harmless, hostile) in [
        (Language::Python, "\"\"\"a\"\"\"\nx = 1", "\"\"\"a\"\"\"; ran()\n\"\"\"\"\"\"\nx = 1"),
        (Language::C, "/* a */ int x;", "/* a */ int ran; /* */ int x;"),
        (Language::Rust, "// a\nlet x = 1;", "// a\nran();\nlet x = 1;"),
        (Language::Julia, "# a\nx = 1", "#= a =# ran()\nx = 1"),
    ] {
        let marks = marks(language);
        assert_ne!(stripped(harmless, &marks), stripped(hostile, &marks));
    }
    assert!(stripped("\"$(ran())\"", &marks(Language::Julia)).is_err());
    assert!(stripped("/* a", &marks(Language::C)).is_err());
    let refused = |source: &'static str| std::panic::catch_unwind(|| latex_skeleton(source)).is_err();
    for source in
        ["\\input{x}", "k &= 1\\ \\mathrm{m}}", "k &= 1\\ \\mathrm{m \\\\ y}", "^^5cinput", "% ran", "k &= 1$"]
    {
        assert!(refused(source), "{source}");
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("gpsindy_hostile_{name}_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs a program in `folder`; it must succeed and leave nothing called `ran` behind.
fn run(program: &str, arguments: &[&str], folder: &Path) {
    let output = Command::new(program).args(arguments).current_dir(folder).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{program} {arguments:?}\n{told}");
    assert!(!folder.join("ran").exists(), "something of a model ran");
}

fn models(seed: u64, count: usize) -> Vec<Model> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| hostile(&mut random)).collect()
}

fn available(name: &str) -> bool {
    gpsindy_beside::program(name, &["--version"])
}

#[test]
fn exported_python_of_hostile_models_runs_nothing_of_theirs() {
    if !available("python3") {
        return;
    }
    let folder = folder("python");
    for (i, model) in models(10, 300).iter().enumerate() {
        std::fs::write(folder.join(format!("model_{i}.py")), model.export(Language::Python).unwrap()).unwrap();
        std::fs::write(folder.join(format!("symbols_{i}.txt")), model.export(Language::Sympy).unwrap()).unwrap();
    }
    let script = "\
import doctest, importlib, warnings
warnings.simplefilter('error')
for i in range(300):
    module = importlib.import_module(f'model_{i}')
    assert doctest.testmod(module).attempted == 0
    history = {'history': [0.4]} if hasattr(module, 'history_0') else {}
    assert len(module.rates(0.0, [0.1, 0.2], [0.3], **history)) == 2
    compile(open(f'symbols_{i}.txt', encoding='utf-8').read(), 'symbols', 'exec')
";
    std::fs::write(folder.join("run.py"), script).unwrap();
    run("python3", &["-B", "run.py"], &folder);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn exported_c_of_hostile_models_compiles_to_nothing_of_theirs() {
    if !available("cc") {
        return;
    }
    let folder = folder("c");
    for model in models(11, 40) {
        std::fs::write(folder.join("model.c"), model.export(Language::C).unwrap()).unwrap();
        run("cc", &["-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "model.c"], &folder);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn exported_rust_of_hostile_models_compiles_to_nothing_of_theirs() {
    if !available("rustc") {
        return;
    }
    let folder = folder("rust");
    let mut all = String::new();
    for (i, model) in models(12, 40).iter().enumerate() {
        std::fs::write(folder.join(format!("model_{i}.rs")), model.export(Language::Rust).unwrap()).unwrap();
        all += &format!("mod model_{i};\n");
    }
    std::fs::write(folder.join("run.rs"), all + "fn main() {}\n").unwrap();
    run("rustc", &["--edition", "2021", "-o", "run", "run.rs"], &folder);
    std::fs::remove_dir_all(folder).unwrap();
}
