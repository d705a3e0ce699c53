//! Rust, without dependencies.

use super::dialect::{Dialect, number};
use super::names::line_comment;
use super::program::{History, Program};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{InputKind, Model};

fn call(function: Function, arguments: &[String]) -> String {
    let name = match function {
        Function::Sign => "sign",
        Function::Step => "step",
        Function::Clamp => "clamp",
        Function::DeadZone => "dead_zone",
        Function::Log => "f64::ln",
        other => return format!("f64::{}({})", other.name(), arguments.join(", ")),
    };
    format!("{name}({})", arguments.join(", "))
}

const HELPERS: [(Function, &str); 4] = [
    (
        Function::Sign,
        "fn sign(z: f64) -> f64 {\n    if z > 0.0 {\n        1.0\n    } else if z < 0.0 {\n        -1.0\n    } else {\n        z\n    }\n}\n\n",
    ),
    (Function::Step, "fn step(z: f64) -> f64 {\n    f64::from(z > 0.0)\n}\n\n"),
    (Function::Clamp, "fn clamp(z: f64, low: f64, high: f64) -> f64 {\n    z.max(low).min(high)\n}\n\n"),
    (Function::DeadZone, "fn dead_zone(z: f64, width: f64) -> f64 {\n    z - z.max(-width).min(width)\n}\n\n"),
];

fn bind(list: &str, place: usize, name: &str) -> String {
    let list = if list == "parameters" { "PARAMETERS" } else { list };
    format!("    let {name} = {list}[{place}];\n")
}

fn expression(program: &Program<'_>, expression: &Expression, in_signal: bool) -> Result<String> {
    let history = |i: usize| if in_signal { format!("history_{i}(record, t)") } else { format!("history[{i}]") };
    let name = |name: &str| program.name(name, &history, &|i| format!("late[{i}]"));
    let dialect = Dialect {
        name: &name,
        call,
        power: |a, b| format!("f64::powf({a}, {b})"),
        number,
        pi: "std::f64::consts::PI",
        time: "t",
    };
    dialect.write(expression)
}

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    let (n, m, h) = (model.states.len(), model.controls.len(), program.history.len());
    let mut text = String::new();
    for line in program.legend(0) {
        // No documentation comment: rustdoc would run code in it.
        text += &format!("// {}\n", line_comment(&line));
    }
    text += "#![allow(dead_code, unused_variables, non_snake_case, clippy::all)]\n\n";
    text += &format!("pub const N_STATES: usize = {n};\npub const N_CONTROLS: usize = {m};\n");
    text += &format!("pub const N_HISTORY: usize = {h};\npub const N_LATE: usize = {};\n\n", program.late.len());
    let names: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
    let values: Vec<String> = model.parameters.iter().map(|p| number(p.value)).collect();
    if !values.is_empty() {
        text += &format!("/// {}\n", names.join(", "));
        text += &format!("pub const PARAMETERS: [f64; {}] = [{}];\n", values.len(), values.join(", "));
    }
    let initial: Vec<String> = program.initial().into_iter().map(number).collect();
    text += &format!("pub const INITIAL_STATE: [f64; N_STATES] = [{}];\n\n", initial.join(", "));
    text += "/// Samples of a run: times in s and the controls at each.\n\
        pub struct Record<'a> {\n    pub time: &'a [f64],\n    pub control: &'a [[f64; N_CONTROLS]],\n}\n\n";
    for (function, helper) in HELPERS {
        if program.calls(function) {
            text += helper;
        }
    }
    if h > 0 {
        text += "/// The sample that holds at time t.\nfn sample_at(record: &Record<'_>, t: f64) -> usize {\n    \
            record.time.partition_point(|&sample| sample <= t).max(1) - 1\n}\n\n";
    }
    for (i, history) in program.history.iter().enumerate() {
        text += &write_history(&program, i, history)?;
    }
    text += "/// Rates of the states, in their units per second.\n";
    text += &write_list(&program, "rates", &program.rates)?;
    if let Some(outputs) = &program.outputs {
        text += "/// What the columns of a log read.\n";
        text += &write_list(&program, "outputs", outputs)?;
    }
    text += &simulate(&program);
    Ok(text)
}

fn write_history(program: &Program<'_>, i: usize, history: &History) -> Result<String> {
    let mut text = format!("fn signal_{i}(record: &Record<'_>, t: f64) -> f64 {{\n");
    let bindings = program.bindings(&[&history.signal], &bind);
    if bindings.contains("control[") {
        text += "    let control = &record.control[sample_at(record, t)];\n";
    }
    text += &bindings;
    text += &format!("    {}\n}}\n\n", expression(program, &history.signal, true)?);
    text += &format!("fn history_{i}(record: &Record<'_>, t: f64) -> f64 {{\n");
    text += &program.bindings(&[&history.amount, &history.phase], &bind);
    let amount = expression(program, &history.amount, true)?;
    let phase = expression(program, &history.phase, true)?;
    text += &match history.kind {
        InputKind::Delay => format!("    signal_{i}(record, f64::max(t - ({amount}), record.time[0]))\n}}\n\n"),
        InputKind::SampleHold => format!(
            "    let phase = {phase};\n    \
             let passed = ((t - phase)/({amount}) + 1e-6).floor();\n    \
             signal_{i}(record, f64::max(phase + ({amount})*(passed + 1e-6), record.time[0]))\n}}\n\n"
        ),
        InputKind::Slew => format!(
            "    let rate = f64::abs({amount});\n    let mut output = signal_{i}(record, record.time[0]);\n    \
             let last = sample_at(record, t);\n    for k in 0..=last {{\n        \
             let till = if k < last {{ record.time[k + 1] }} else {{ t }};\n        \
             let most = rate*f64::max(till - record.time[k], 0.0);\n        \
             output += (signal_{i}(record, record.time[k]) - output).max(-most).min(most);\n    }}\n    output\n}}\n\n"
        ),
        InputKind::Play => format!(
            "    let half = 0.5*f64::max({amount}, 0.0);\n    let mut output = signal_{i}(record, record.time[0]);\n    \
             for k in 1..=sample_at(record, t) {{\n        let pushed = signal_{i}(record, record.time[k]);\n        \
             output = output.max(pushed - half).min(pushed + half);\n    }}\n    output\n}}\n\n"
        ),
    };
    Ok(text)
}

fn write_list(program: &Program<'_>, name: &str, list: &[Expression]) -> Result<String> {
    let late = if name == "outputs" { ", late: &[f64; N_LATE]" } else { "" };
    let mut text = format!(
        "pub fn {name}(t: f64, state: &[f64; N_STATES], control: &[f64; N_CONTROLS], history: &[f64; N_HISTORY]{late}) -> [f64; N_STATES] {{\n"
    );
    text += &program.bindings(&list.iter().collect::<Vec<_>>(), &bind);
    text += "    [\n";
    for item in list {
        text += &format!("        {},\n", expression(program, item, false)?);
    }
    Ok(text + "    ]\n}\n\n")
}

fn simulate(program: &Program<'_>) -> String {
    let history: Vec<String> = (0..program.history.len()).map(|i| format!("history_{i}(record, middle)")).collect();
    format!(
        "\
/// Classical fourth-order Runge-Kutta with `substeps` steps between samples under held controls.
pub fn simulate(record: &Record<'_>, initial: [f64; N_STATES], substeps: usize) -> Vec<[f64; N_STATES]> {{
    let mut states = vec![initial];
    let mut x = initial;
    for i in 1..record.time.len() {{
        let h = (record.time[i] - record.time[i - 1])/substeps as f64;
        for s in 0..substeps {{
            let t = record.time[i - 1] + h*s as f64;
            let middle = t + 0.5*h;
            let history: [f64; N_HISTORY] = [{}];
            let mut slope = [0.0; N_STATES];
            let mut sum = [0.0; N_STATES];
            for (node, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {{
                let mut trial = x;
                for j in 0..N_STATES {{
                    trial[j] += h*node*slope[j];
                }}
                slope = rates(t + node*h, &trial, &record.control[i - 1], &history);
                for j in 0..N_STATES {{
                    sum[j] += weight*slope[j];
                }}
            }}
            for j in 0..N_STATES {{
                x[j] += h/6.0*sum[j];
            }}
        }}
        states.push(x);
    }}
    states
}}
",
        history.join(", ")
    )
}
