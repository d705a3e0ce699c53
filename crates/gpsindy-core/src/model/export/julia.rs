//! Julia; the rates are written in place, as DifferentialEquations.jl calls them.

use super::dialect::{Dialect, number};
use super::names::line_comment;
use super::program::{History, Program};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{InputKind, Model};

fn call(function: Function, arguments: &[String]) -> String {
    let name = match function {
        Function::Atan2 => "atan",
        Function::Step => "unit_step",
        // `Base.clamp` refuses bounds in the wrong order where ours takes the upper one.
        Function::Clamp => "clamp_between",
        other => other.name(),
    };
    format!("{name}({})", arguments.join(", "))
}

const HELPERS: [(Function, &str); 3] = [
    (Function::Step, "unit_step(z) = z > 0 ? 1.0 : 0.0\n"),
    (Function::Clamp, "clamp_between(z, low, high) = min(max(z, low), high)\n"),
    (Function::DeadZone, "dead_zone(z, width) = z - min(max(z, -width), width)\n"),
];

fn bind(list: &str, place: usize, name: &str) -> String {
    format!("    {name} = {list}[{}]\n", place + 1)
}

fn expression(program: &Program<'_>, expression: &Expression, in_signal: bool) -> Result<String> {
    let history =
        |i: usize| if in_signal { format!("history_{}(record, t)", i + 1) } else { format!("history[{}]", i + 1) };
    let name = |name: &str| program.name(name, &history, &|i| format!("late[{}]", i + 1));
    let dialect = Dialect { name: &name, call, power: |a, b| format!("{a}^{b}"), number, pi: "pi", time: "t" };
    dialect.write(expression)
}

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    let mut text = String::new();
    for line in program.legend(1) {
        text += &format!("# {}\n", line_comment(&line));
    }
    text += "# With DifferentialEquations.jl: ODEProblem((dx, x, p, t) -> rates!(dx, x, control_at(t), t), initial_state, (0.0, 10.0))\n\n";
    let names: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
    let values: Vec<String> = model.parameters.iter().map(|p| number(p.value)).collect();
    if !values.is_empty() {
        text += &format!("# {}\nconst parameters = [{}]\n", names.join(", "), values.join(", "));
    }
    let initial: Vec<String> = program.initial().into_iter().map(number).collect();
    text += &format!("const initial_state = [{}]\n\n", initial.join(", "));
    for (function, helper) in HELPERS {
        if program.calls(function) {
            text += helper;
        }
    }
    text += "\n\"Samples of a run: times in s, and a vector of controls at each.\"\n\
        struct Record\n    time::Vector{Float64}\n    control::Vector{Vector{Float64}}\nend\n\n";
    if !program.history.is_empty() {
        text +=
            "\"The sample that holds at time t.\"\nsample_at(record, t) = max(searchsortedlast(record.time, t), 1)\n\n";
    }
    for (i, history) in program.history.iter().enumerate() {
        text += &write_history(&program, i, history)?;
    }
    text += &write_list(&program, "rates!", "dx", &program.rates)?;
    if let Some(outputs) = &program.outputs {
        text += "\"What the columns of a log read.\"\n";
        text += &write_list(&program, "outputs!", "y", outputs)?;
    }
    text += &simulate(&program);
    Ok(text)
}

fn write_history(program: &Program<'_>, index: usize, history: &History) -> Result<String> {
    let i = index + 1;
    let mut text = format!("function signal_{i}(record, t)\n");
    let bindings = program.bindings(&[&history.signal], &bind);
    if bindings.contains("control[") {
        text += "    control = record.control[sample_at(record, t)]\n";
    }
    text += &bindings;
    text += &format!("    return {}\nend\n\n", expression(program, &history.signal, true)?);
    text += &format!("function history_{i}(record, t)\n");
    text += &program.bindings(&[&history.amount, &history.phase], &bind);
    let amount = expression(program, &history.amount, true)?;
    let phase = expression(program, &history.phase, true)?;
    text += &match history.kind {
        InputKind::Delay => format!("    return signal_{i}(record, max(t - ({amount}), record.time[1]))\nend\n\n"),
        InputKind::SampleHold => format!(
            "    phase = {phase}\n    \
             passed = floor((t - phase)/({amount}) + 1e-6)\n    \
             return signal_{i}(record, max(phase + ({amount})*(passed + 1e-6), record.time[1]))\nend\n\n"
        ),
        InputKind::Slew => format!(
            "    rate = abs({amount})\n    output = signal_{i}(record, record.time[1])\n    \
             last = sample_at(record, t)\n    for k in 1:last\n        \
             till = k < last ? record.time[k + 1] : t\n        \
             most = rate*max(till - record.time[k], 0.0)\n        \
             output += clamp(signal_{i}(record, record.time[k]) - output, -most, most)\n    end\n    return output\nend\n\n"
        ),
        InputKind::Play => format!(
            "    half = 0.5*max({amount}, 0.0)\n    output = signal_{i}(record, record.time[1])\n    \
             for k in 2:sample_at(record, t)\n        pushed = signal_{i}(record, record.time[k])\n        \
             output = min(max(output, pushed - half), pushed + half)\n    end\n    return output\nend\n\n"
        ),
    };
    Ok(text)
}

fn write_list(program: &Program<'_>, name: &str, result: &str, list: &[Expression]) -> Result<String> {
    let mut arguments = format!("{result}, state, control, t");
    if !program.history.is_empty() {
        arguments += ", history";
    }
    if name == "outputs!" && !program.late.is_empty() {
        arguments += ", late";
    }
    let mut text = format!("function {name}({arguments})\n");
    text += &program.bindings(&list.iter().collect::<Vec<_>>(), &bind);
    for (j, item) in list.iter().enumerate() {
        text += &format!("    {result}[{}] = {}\n", j + 1, expression(program, item, false)?);
    }
    Ok(text + "    return nothing\nend\n\n")
}

fn simulate(program: &Program<'_>) -> String {
    let (mut history, mut argument) = (String::new(), "");
    if !program.history.is_empty() {
        let calls: Vec<String> =
            (1..=program.history.len()).map(|i| format!("history_{i}(record, t + 0.5*h)")).collect();
        history = format!("            history = [{}]\n", calls.join(", "));
        argument = ", history";
    }
    format!(
        "\
\"Classical fourth-order Runge-Kutta with `substeps` steps between samples under held controls.\"
function simulate(record, initial = initial_state, substeps = 10)
    x = copy(initial)
    states = [copy(x)]
    for i in 2:length(record.time)
        h = (record.time[i] - record.time[i - 1])/substeps
        for s in 0:substeps-1
            t = record.time[i - 1] + h*s
{history}            slope = zero(x)
            total = zero(x)
            for (node, weight) in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0))
                trial = x .+ h*node .* slope
                rates!(slope, trial, record.control[i - 1], t + node*h{argument})
                total .+= weight .* slope
            end
            x .+= h/6.0 .* total
        end
        push!(states, copy(x))
    end
    return states
end
"
    )
}
