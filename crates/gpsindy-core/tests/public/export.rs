//! Exported programs are compiled and run, and must give the numbers of our own evaluation.
#![allow(clippy::unwrap_used)]

use faer::Mat;
use gpsindy_core::{Control, Excitation, Expression, Hold, Language, Method, Model, Parameter, Simulate, State};
use std::path::PathBuf;
use std::process::Command;

const TIMES: usize = 41;
const PERIOD: f64 = 0.05;

/// Every function of the language but the rate limit ([`limited`]), a delay, a play, a sample-and-hold, a name that is a keyword.
fn everything() -> Model {
    let equations = [
        ("x", "v"),
        (
            "v",
            "(delay(u, tau) - lambda*x^3 - 0.3*v*abs(v))/m + sin(x)*cos(v) - tanh(2*v) + 0.1*atan2(x, 1 + v^2) \
             - dead_zone(x, 0.2) + clamp(3*x, -1, 0.5) + min(x, v) - max(x, 0.1) + 0.2*sign(v - 100) + step(u - 0.5)",
        ),
        (
            "z",
            "play(u, 0.3) - z + exp(-z^2) + log(2 + sqrt(abs(x) + 1)) - (x - (v - z)) - x/(v^2 + 2)/3 + 2^-x + 0.1*t \
             + asin(x/50) + acos(x/50) + atan(x) + sinh(x/9) - cosh(x/9) + tan(x/50) + pi + delay(play(clamp(u, -0.8, 0.8)*w, 0.1), 0.1) \
             + 0.3*sample_hold(w, every, 0.05)",
        ),
    ];
    let mut model = Model {
        name: "everything".into(),
        states: equations.iter().map(|(name, f)| State::new(*name, Expression::parse(f).unwrap())).collect(),
        controls: vec![Control::new("u"), Control::new("w")],
        parameters: vec![
            Parameter::new("m", 1.7),
            Parameter::new("lambda", 0.8),
            Parameter::new("tau", 0.15),
            Parameter::new("every", 0.25),
        ],
        ..Model::default()
    };
    model.states[0].measured = Some(Expression::parse("1.02*x + 0.1*u").unwrap());
    model.initial = [("x".to_string(), 0.4), ("v".to_string(), -0.2)].into();
    model
}

fn plain() -> Model {
    Model {
        name: "plain".into(),
        states: vec![
            State::new("x", Expression::parse("v").unwrap()),
            State::new("v", Expression::parse("-2*x - 0.1*v").unwrap()),
        ],
        initial: [("x".to_string(), 1.0)].into(),
        ..Model::default()
    }
}

/// Rate limits, whose corners lie within the steps of an exported program.
fn limited() -> Model {
    Model {
        name: "limited".into(),
        states: vec![State::new("x", Expression::parse("slew(u, 0.6) + delay(slew(w, 0.3), 0.1) - x").unwrap())],
        controls: vec![Control::new("u"), Control::new("w")],
        ..Model::default()
    }
}

fn controls(model: &Model, i: usize) -> Vec<f64> {
    let t = PERIOD * i as f64;
    [(3.0 * t).sin(), 0.5 + t.cos()][..model.controls.len()].to_vec()
}

/// The states at the end of an RK4 rollout with 10 steps a sample, and the rates at a point with no history.
fn expected(model: &Model) -> Vec<f64> {
    let system = model.compile().unwrap();
    let time: Vec<f64> = (0..TIMES).map(|i| PERIOD * i as f64).collect();
    let values = Mat::from_fn(TIMES, model.controls.len(), |i, j| controls(model, i)[j]);
    let excitation = Excitation::new(&system, &time, values.as_ref(), Hold::Zero).unwrap();
    let initial: Vec<f64> = model.states.iter().map(|s| model.initial.get(&s.name).copied().unwrap_or(0.0)).collect();
    let settings = Simulate { method: Method::RungeKutta4 { substeps: 10 }, ..Simulate::default() };
    let rollout = settings.rollout(&system, &excitation, &initial).unwrap();
    let mut wanted: Vec<f64> = (0..initial.len()).map(|j| rollout.states[(TIMES - 1, j)]).collect();
    wanted.extend(rates_without_history(model));
    wanted
}

/// Rates at t = 0.3, states 0.31, -0.42, 0.53, controls 0.7, 1.1, histories 0.25, 0.35, ...
fn rates_without_history(model: &Model) -> Vec<f64> {
    let mut flat = model.clone();
    let mut seen: Vec<String> = Vec::new();
    for state in &mut flat.states {
        state.measured = None;
        // Histories are numbered in the order in which they are met, the inner ones first.
        state.equation = replaced(&state.equation, &mut seen);
    }
    let system = flat.compile().unwrap();
    let mut dx = vec![0.0; flat.states.len()];
    let x = [0.31, -0.42, 0.53];
    gpsindy_core::Dynamics::derivative(&system, 0.3, &x[..dx.len()], &[0.7, 1.1][..flat.controls.len()], &mut dx)
        .unwrap();
    dx
}

fn replaced(equation: &Expression, seen: &mut Vec<String>) -> Expression {
    let mut text = equation.to_string();
    for history in [
        "delay(u, tau)",
        "play(u, 0.3)",
        "play(clamp(u, -0.8, 0.8)*w, 0.1)",
        "delay(0.45, 0.1)",
        "sample_hold(w, every, 0.05)",
        "slew(u, 0.6)",
        "slew(w, 0.3)",
        "delay(0.35, 0.1)",
    ] {
        if text.contains(history) {
            if !seen.contains(&history.to_string()) {
                seen.push(history.into());
            }
            let place = seen.iter().position(|s| s == history).unwrap();
            text = text.replace(history, &format!("{}", 0.25 + 0.1 * place as f64));
        }
    }
    Expression::parse(&text).unwrap()
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("gpsindy_export_{name}_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs a program and compares the numbers it prints, one a line.
fn compare(mut program: Command, wanted: &[f64], n_states: usize, rollout: f64) {
    let output = program.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let found: Vec<f64> = text.lines().map(|line| line.trim().parse().unwrap()).collect();
    assert_eq!(found.len(), wanted.len(), "{text}");
    for (i, (f, w)) in found.iter().zip(wanted).enumerate() {
        // Rollouts gather rounding over 400 steps, or pass over corners; rates differ by the order of additions alone.
        let tolerance = if i < n_states { rollout } else { 1e-12 };
        assert!((f - w).abs() < tolerance * (1.0 + w.abs()), "number {i}: {f} is not {w}");
    }
}

fn available(name: &str) -> bool {
    gpsindy_beside::program(name, &["--version"])
}

#[test]
fn exported_python_gives_our_numbers() {
    if !available("python3") {
        return;
    }
    for (model, rollout) in [(everything(), 1e-8), (plain(), 1e-8), (limited(), 1e-5)] {
        let folder = folder(&format!("python_{}", model.name));
        std::fs::write(folder.join("exported.py"), model.export(Language::Python).unwrap()).unwrap();
        let (n, m) = (model.states.len(), model.controls.len());
        let history = if m > 0 { ", [0.25, 0.35, 0.45, 0.55, 0.65]" } else { "" };
        let script = format!(
            "import math, exported\ntime = [{PERIOD}*i for i in range({TIMES})]\n\
             record = [[math.sin(3*t), 0.5 + math.cos(t)][:{m}] for t in time]\n\
             for v in exported.simulate(time, record)[-1] + exported.rates(0.3, [0.31, -0.42, 0.53][:{n}], [0.7, 1.1]{history}): print(repr(v))\n"
        );
        std::fs::write(folder.join("run.py"), script).unwrap();
        let mut python = Command::new("python3");
        python.arg("-B").arg(folder.join("run.py")).current_dir(&folder);
        compare(python, &expected(&model), n, rollout);
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn exported_c_gives_our_numbers() {
    if !available("cc") {
        return;
    }
    for (model, rollout) in [(everything(), 1e-8), (plain(), 1e-8), (limited(), 1e-5)] {
        let folder = folder(&format!("c_{}", model.name));
        let (n, m, name) = (model.states.len(), model.controls.len(), &model.name);
        let nominal = if model.parameters.is_empty() { String::new() } else { format!("&{name}_nominal, ") };
        let program = format!(
            "{}\n#include <stdio.h>\nint main(void) {{\n    static double time[{TIMES}], control[{}], states[{}];\n    \
             for (int i = 0; i < {TIMES}; i++) {{\n        const double t = {PERIOD}*i, u[2] = {{sin(3*t), 0.5 + cos(t)}};\n        \
             time[i] = t;\n        for (int j = 0; j < {m}; j++) control[{m}*i + j] = u[j];\n    }}\n    \
             const {name}_record_t record = {{{TIMES}, time, control}};\n    \
             for (int j = 0; j < {n}; j++) states[j] = {name}_initial_state[j];\n    {name}_simulate({nominal}&record, 10, states);\n    \
             for (int j = 0; j < {n}; j++) printf(\"%.17g\\n\", states[{n}*{} + j]);\n    \
             const double x[] = {{0.31, -0.42, 0.53}}, u[] = {{0.7, 1.1}}, h[] = {{0.25, 0.35, 0.45, 0.55, 0.65}};\n    double dx[{n}];\n    \
             {name}_rates({nominal}0.3, x, u, h, dx);\n    for (int j = 0; j < {n}; j++) printf(\"%.17g\\n\", dx[j]);\n    return 0;\n}}\n",
            model.export(Language::C).unwrap(),
            (TIMES * m).max(1),
            TIMES * n,
            TIMES - 1,
        );
        std::fs::write(folder.join("run.c"), program).unwrap();
        let mut compiler = Command::new("cc");
        compiler
            .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "run.c", "-lm", "-o", "run"])
            .current_dir(&folder);
        let output = compiler.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        compare(Command::new(folder.join("run")), &expected(&model), n, rollout);
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn two_exported_c_models_link_together_and_take_other_parameters() {
    if !available("cc") {
        return;
    }
    let folder = folder("c_two");
    std::fs::write(folder.join("one.c"), everything().export(Language::C).unwrap()).unwrap();
    std::fs::write(folder.join("two.c"), plain().export(Language::C).unwrap()).unwrap();
    let mut decay = plain();
    decay.name = "decay & more".into();
    decay.states.pop();
    decay.states[0].equation = Expression::parse("-k*x").unwrap();
    decay.parameters = vec![Parameter { unit: "1/s".into(), ..Parameter::new("k", 2.0) }];
    let main = decay.export(Language::C).unwrap()
        + "#include <stdio.h>\nint main(void) {\n    decay_more_parameters_t other = decay_more_nominal;\n    other.k = 3.0;\n    \
           const double x[1] = {0.5};\n    double dx[1];\n    decay_more_rates(&decay_more_nominal, 0.0, x, 0, 0, dx);\n    \
           printf(\"%.17g\\n\", dx[0]);\n    decay_more_rates(&other, 0.0, x, 0, 0, dx);\n    printf(\"%.17g\\n\", dx[0]);\n    return 0;\n}\n";
    std::fs::write(folder.join("main.c"), main).unwrap();
    let mut compiler = Command::new("cc");
    compiler
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "one.c", "two.c", "main.c", "-lm", "-o", "run"])
        .current_dir(&folder);
    let output = compiler.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    compare(Command::new(folder.join("run")), &[-1.0, -1.5], 0, 0.0);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn exported_python_imports_what_it_uses() {
    let text = plain().export(Language::Python).unwrap();
    assert!(!text.contains("import"), "{text}");
    let text = everything().export(Language::Python).unwrap();
    assert!(text.contains("import bisect\nimport math\n\nSTATES"), "{text}");
}

#[test]
fn exported_rust_gives_our_numbers() {
    if !available("rustc") {
        return;
    }
    for (model, rollout) in [(everything(), 1e-8), (plain(), 1e-8), (limited(), 1e-5)] {
        let folder = folder(&format!("rust_{}", model.name));
        let (n, m, h) = (model.states.len(), model.controls.len(), model.compile().unwrap().inputs().len());
        std::fs::write(folder.join("exported.rs"), model.export(Language::Rust).unwrap()).unwrap();
        let cut = |values: &str, k: usize| values.split(", ").take(k).collect::<Vec<_>>().join(", ");
        let program = format!(
            "mod exported;\nfn main() {{\n    let time: Vec<f64> = (0..{TIMES}).map(|i| {PERIOD:?} * i as f64).collect();\n    \
             let control: Vec<[f64; {m}]> = time.iter().map(|t| [{}]).collect();\n    \
             let record = exported::Record {{ time: &time, control: &control }};\n    \
             let states = exported::simulate(&record, exported::INITIAL_STATE, 10);\n    \
             for v in states[states.len() - 1] {{ println!(\"{{v:?}}\"); }}\n    \
             for v in exported::rates(0.3, &[{}], &[{}], &[{}]) {{ println!(\"{{v:?}}\"); }}\n}}\n",
            cut("(3.0*t).sin(), 0.5 + t.cos()", m),
            cut("0.31, -0.42, 0.53", n),
            cut("0.7, 1.1", m),
            cut("0.25, 0.35, 0.45, 0.55, 0.65", h),
        );
        std::fs::write(folder.join("run.rs"), program).unwrap();
        let mut compiler = Command::new("rustc");
        compiler.args(["--edition", "2021", "-o", "run", "run.rs"]).current_dir(&folder);
        let output = compiler.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        compare(Command::new(folder.join("run")), &expected(&model), n, rollout);
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn exported_sympy_gives_our_numbers() {
    let source = everything().export(Language::Sympy).unwrap();
    assert!(source.contains("lambda_v = sp.Symbol(\"lambda\", real=True)"));
    assert!(source.contains("play = sp.Function(\"play\")"));
    if !gpsindy_beside::program("python3", &["-c", "import sympy"]) {
        return;
    }
    let mut model = everything();
    // Without a history, so that every symbol gets a number.
    let mut seen = Vec::new();
    model.states.iter_mut().for_each(|s| s.equation = replaced(&s.equation, &mut seen));
    let folder = folder("sympy");
    std::fs::write(folder.join("exported.py"), model.export(Language::Sympy).unwrap()).unwrap();
    let script = "from exported import *\npoint = {**values, x: 0.31, v: -0.42, z: 0.53, u: 0.7, w: 1.1, t: 0.3}\n\
                  for rate in rates: print(repr(float(rate.subs(point))))\nassert len(equations) == 3\n";
    std::fs::write(folder.join("run.py"), script).unwrap();
    let mut python = Command::new("python3");
    python.arg("-B").arg(folder.join("run.py")).current_dir(&folder);
    compare(python, &rates_without_history(&everything()), 0, 0.0);
    std::fs::remove_dir_all(folder).unwrap();
}

fn balanced(text: &str) -> bool {
    let mut open = Vec::new();
    for character in text.chars() {
        match character {
            '(' | '[' | '{' => open.push(character),
            ')' if open.pop() != Some('(') => return false,
            ']' if open.pop() != Some('[') => return false,
            '}' if open.pop() != Some('{') => return false,
            _ => {}
        }
    }
    open.is_empty()
}

#[test]
fn exported_julia_is_whole() {
    let text = everything().export(Language::Julia).unwrap();
    for text in [&text, &limited().export(Language::Julia).unwrap()] {
        assert!(balanced(text), "{text}");
        let words = |word: &str| {
            text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '!').filter(|w| *w == word).count()
        };
        let opened = ["function", "for", "struct"].into_iter().map(words).sum::<usize>();
        assert_eq!(opened, words("end"), "{text}");
    }
    for part in ["dx[2] = (history[1] - lambda_v*x^3.0", "control[1]", "tau = parameters[3]", "y[1] = 1.02*x + 0.1*u"] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    assert!(plain().export(Language::Julia).unwrap().contains("dx[2] = -2.0*x - 0.1*v"));
}

#[test]
fn exported_modelica_is_whole_and_refuses_a_play() {
    let error = everything().export(Language::Modelica).unwrap_err().to_string();
    assert!(error.contains("Modelica has no play"), "{error}");
    let text = limited().export(Language::Modelica).unwrap();
    for part in [
        "  der(x) = slew_2 + delay(slew, 0.1) - x;",
        "initial equation\n  slew = w;\n  slew_2 = u;\nequation",
        "  Real slew;\n",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let mut model = everything();
    model.states.pop();
    model.states[0].unit = "m".into();
    let text = model.export(Language::Modelica).unwrap();
    assert!(balanced(&text));
    for part in [
        "model everything ",
        "  parameter Real m = 1.7;",
        "  Real x(unit=\"m\", start=0.4, fixed=true);",
        "  input Real u;",
        "  der(x) = v;",
        "delay(u, tau)",
        "(if u - 0.5 > 0.0 then 1.0 else 0.0)",
        "  x_measured = 1.02*x + 0.1*u;",
        "end everything;",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn exported_latex_is_whole() {
    let text = everything().export(Language::Latex).unwrap();
    assert!(balanced(&text));
    assert_eq!(text.matches("\\begin{align*}").count(), text.matches("\\end{align*}").count());
    assert_eq!(text.matches("\\left").count(), text.matches("\\right").count());
    for part in
        ["\\dot{x} &= v \\\\", "u\\left(t - \\tau\\right)", "\\lambda &= 0.8", "y_{x} &= 1.02 \\, x + 0.1 \\, u"]
    {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn a_play_of_a_delayed_control_becomes_the_delayed_play() {
    let model = |equation: &str| Model {
        states: vec![State::new("x", Expression::parse(equation).unwrap())],
        controls: vec![Control::new("u")],
        ..Model::default()
    };
    let text = model("play(delay(u, 0.1), 0.2)").export(Language::Python).unwrap();
    assert!(text.contains("delay(play(u, 0.2), 0.1)"), "{text}");
    let error = model("play(delay(u, 0.1) + u, 0.2)").export(Language::C).unwrap_err().to_string();
    assert!(error.contains("can't be exported"), "{error}");
    assert!(Language::parse("fortran").unwrap_err().to_string().contains("known: latex, sympy"));
}
