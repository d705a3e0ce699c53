//! Plain Python: it needs only the `math` module; the rates suit SciPy's `solve_ivp`.

use super::dialect::{Dialect, number};
use super::names::{line_comment, python_string};
use super::program::{History, Program};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{InputKind, Model};

fn call(function: Function, arguments: &[String]) -> String {
    let name = match function {
        Function::Abs | Function::Min | Function::Max => function.name(),
        Function::Sign | Function::Step | Function::Clamp | Function::DeadZone => function.name(),
        other => return format!("math.{}({})", other.name(), arguments.join(", ")),
    };
    format!("{name}({})", arguments.join(", "))
}

const HELPERS: [(Function, &str); 4] = [
    (Function::Sign, "def sign(z):\n    return float((z > 0) - (z < 0))\n\n\n"),
    (Function::Step, "def step(z):\n    return 1.0 if z > 0 else 0.0\n\n\n"),
    (Function::Clamp, "def clamp(z, low, high):\n    return min(max(z, low), high)\n\n\n"),
    (Function::DeadZone, "def dead_zone(z, width):\n    return z - min(max(z, -width), width)\n\n\n"),
];

fn bind(list: &str, place: usize, name: &str) -> String {
    if list == "parameters" {
        return format!("    {name} = PARAMETERS[\"{name}\"]\n");
    }
    format!("    {name} = {list}[{place}]\n")
}

fn expression(program: &Program<'_>, expression: &Expression, in_signal: bool) -> Result<String> {
    let history = |i: usize| if in_signal { format!("history_{i}(time, record, t)") } else { format!("history[{i}]") };
    let name = |name: &str| program.name(name, &history, &|i| format!("late[{i}]"));
    let dialect =
        Dialect { name: &name, call, power: |a, b| format!("math.pow({a}, {b})"), number, pi: "math.pi", time: "t" };
    dialect.write(expression)
}

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    let mut text = String::from("\"\"\"");
    for line in program.legend(0) {
        text += &format!("{}\n", python_string(&line));
    }
    text += "\nWith SciPy: solve_ivp(lambda t, x: rates(t, x, control_at(t)), (0.0, 10.0), INITIAL_STATE)\n\"\"\"\n\n";
    let body = body(model, &program)?;
    // Units are in comments after two spaces, and are no use of a module.
    let uses = |module: &str| body.lines().any(|l| l.split("  # ").next().is_some_and(|code| code.contains(module)));
    for module in ["bisect", "math"].into_iter().filter(|module| uses(&format!("{module}."))) {
        text += &format!("import {module}\n");
    }
    Ok(text.trim_end().to_string() + "\n\n" + &body)
}

/// Everything behind the imports.
fn body(model: &Model, program: &Program<'_>) -> Result<String> {
    let mut text = String::new();
    let list = |names: Vec<&str>| names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ");
    text += &format!("STATES = [{}]\n", list(model.states.iter().map(|s| s.name.as_str()).collect()));
    text += &format!("CONTROLS = [{}]\n", list(model.controls.iter().map(|c| c.name.as_str()).collect()));
    text += "PARAMETERS = {\n";
    for p in &model.parameters {
        let unit = if p.unit.is_empty() { String::new() } else { format!("  # {}", line_comment(&p.unit)) };
        text += &format!("    \"{}\": {},{unit}\n", program.identifier(&p.name), number(p.value));
    }
    let initial: Vec<String> = program.initial().into_iter().map(number).collect();
    text += &format!("}}\nINITIAL_STATE = [{}]\n\n\n", initial.join(", "));
    for (function, helper) in HELPERS {
        if program.calls(function) {
            text += helper;
        }
    }
    if !program.history.is_empty() {
        text += "def sample_at(time, t):\n    \"\"\"The sample that holds at time t.\"\"\"\n    \
            return max(bisect.bisect_right(time, t) - 1, 0)\n\n\n";
    }
    for (i, history) in program.history.iter().enumerate() {
        text += &write_history(program, i, history)?;
    }
    let what = "Rates of the states, in their units per second.";
    text += &write_list(program, "rates", what, &program.rates)?;
    if let Some(outputs) = &program.outputs {
        text += &write_list(program, "outputs", "What the columns of a log read.", outputs)?;
    }
    text += &simulate(program);
    Ok(text)
}

fn write_history(program: &Program<'_>, i: usize, history: &History) -> Result<String> {
    let mut text = format!("def signal_{i}(time, record, t):\n");
    let bindings = program.bindings(&[&history.signal], &bind);
    if bindings.contains("control[") {
        text += "    control = record[sample_at(time, t)]\n";
    }
    text += &bindings;
    text += &format!("    return {}\n\n\n", expression(program, &history.signal, true)?);
    text += &format!(
        "def history_{i}(time, record, t):\n    \"\"\"{}; record: a list of controls at each time.\"\"\"\n",
        history.text
    );
    text += &program.bindings(&[&history.amount, &history.phase], &bind);
    let amount = expression(program, &history.amount, true)?;
    let phase = expression(program, &history.phase, true)?;
    text += &match history.kind {
        InputKind::Delay => format!("    return signal_{i}(time, record, max(t - ({amount}), time[0]))\n\n\n"),
        InputKind::SampleHold => format!(
            "    phase = {phase}\n    \
             passed = math.floor((t - phase)/({amount}) + 1e-6)\n    \
             return signal_{i}(time, record, max(phase + ({amount})*(passed + 1e-6), time[0]))\n\n\n"
        ),
        InputKind::Slew => format!(
            "    rate = abs({amount})\n    output = signal_{i}(time, record, time[0])\n    \
             last = sample_at(time, t)\n    for k in range(last + 1):\n        \
             most = rate*max((time[k + 1] if k < last else t) - time[k], 0.0)\n        \
             output += min(max(signal_{i}(time, record, time[k]) - output, -most), most)\n    return output\n\n\n"
        ),
        InputKind::Play => format!(
            "    half = 0.5*max({amount}, 0.0)\n    output = signal_{i}(time, record, time[0])\n    \
             for k in range(1, sample_at(time, t) + 1):\n        pushed = signal_{i}(time, record, time[k])\n        \
             output = min(max(output, pushed - half), pushed + half)\n    return output\n\n\n"
        ),
    };
    Ok(text)
}

fn write_list(program: &Program<'_>, name: &str, what: &str, list: &[Expression]) -> Result<String> {
    let mut arguments = String::from("t, state, control=()");
    if !program.history.is_empty() {
        arguments += ", history=()";
    }
    if name == "outputs" && !program.late.is_empty() {
        arguments += ", late=()";
    }
    let mut text = format!("def {name}({arguments}):\n    \"\"\"{what}\"\"\"\n");
    text += &program.bindings(&list.iter().collect::<Vec<_>>(), &bind);
    text += "    return [\n";
    for item in list {
        text += &format!("        {},\n", expression(program, item, false)?);
    }
    Ok(text + "    ]\n\n\n")
}

fn simulate(program: &Program<'_>) -> String {
    let (mut history, mut argument) = (String::new(), "");
    if !program.history.is_empty() {
        let calls: Vec<String> =
            (0..program.history.len()).map(|i| format!("history_{i}(time, record, middle)")).collect();
        history = format!("            middle = t + 0.5*h\n            history = [{}]\n", calls.join(", "));
        argument = ", history";
    }
    format!(
        "\
def simulate(time, record, initial=INITIAL_STATE, substeps=10):
    \"\"\"Classical fourth-order Runge-Kutta under held controls: the states at each time.

    record: a list of controls at each time.
    \"\"\"
    x = list(initial)
    states = [list(x)]
    for i in range(1, len(time)):
        control = record[i - 1]
        h = (time[i] - time[i - 1])/substeps
        for s in range(substeps):
            t = time[i - 1] + h*s
{history}            slope = [0.0]*len(x)
            total = [0.0]*len(x)
            for node, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                trial = [a + h*node*b for a, b in zip(x, slope)]
                slope = rates(t + node*h, trial, control{argument})
                total = [a + weight*b for a, b in zip(total, slope)]
            x = [a + h/6.0*b for a, b in zip(x, total)]
        states.append(list(x))
    return states
"
    )
}
