//! Names and units of a model file are a stranger's text: nothing of them may run, or be read, as part of an exported program.
//!
//! Every export of a hostile model is stripped of comments and strings by scanners that know nothing of the export, and
//! must then be the export of a harmless twin. Python, C and Rust are run as well, where they are at hand.
#![allow(clippy::unwrap_used, clippy::panic)]

mod models;
mod scanner;

use gpsindy_beside::random::Random;
use gpsindy_core::{Export, Language, Model};
use models::{HIDDEN, below, hostile, models, twin};
use scanner::{marks, skeleton, stripped};
use std::path::{Path, PathBuf};
use std::process::Command;

#[test]
fn no_text_of_a_model_leaves_its_comment_or_string() {
    let languages =
        [Language::Python, Language::Sympy, Language::C, Language::Rust, Language::Julia, Language::Modelica];
    let mut random = Random::new(7);
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
    let mut random = Random::new(8);
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
    let mut random = Random::new(9);
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
    let stated = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{program} {arguments:?}\n{stated}");
    assert!(!folder.join("ran").exists(), "something of a model ran");
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
