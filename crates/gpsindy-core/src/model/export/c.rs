//! C99. Every name that other files can see begins with the model's, so that several models link together.

use super::dialect::{Dialect, number};
use super::names::{block_comment, title};
use super::program::{History, Program};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{InputKind, Model};

fn call(function: Function, arguments: &[String]) -> String {
    let name = match function {
        Function::Abs => "fabs",
        Function::Min => "fmin",
        Function::Max => "fmax",
        other => other.name(),
    };
    format!("{name}({})", arguments.join(", "))
}

const HELPERS: [(Function, &str); 4] = [
    (Function::Sign, "static double sign(double z) { return (double)((z > 0) - (z < 0)); }\n"),
    (Function::Step, "static double step(double z) { return z > 0 ? 1.0 : 0.0; }\n"),
    (Function::Clamp, "static double clamp(double z, double low, double high) { return fmin(fmax(z, low), high); }\n"),
    (
        Function::DeadZone,
        "static double dead_zone(double z, double width) { return z - fmin(fmax(z, -width), width); }\n",
    ),
];

fn bind(list: &str, place: usize, name: &str) -> String {
    match list {
        "parameters" => format!("    const double {name} = parameters->{name};\n"),
        _ => format!("    const double {name} = {list}[{place}];\n"),
    }
}

/// The model's name as the beginning of every name that other files can see, and how a function takes parameters.
struct Names {
    own: String,
    takes: String,
    gives: &'static str,
}

impl Names {
    fn new(model: &Model) -> Self {
        let own = title(&model.name);
        if model.parameters.is_empty() {
            return Self { own, takes: String::new(), gives: "" };
        }
        let takes = format!("const {own}_parameters_t *parameters, ");
        Self { own, takes, gives: "parameters, " }
    }

    /// Silences a compiler about parameters that a function does not read.
    fn unread(&self) -> &'static str {
        if self.gives.is_empty() { "" } else { "(void)parameters; " }
    }
}

fn expression(program: &Program<'_>, names: &Names, expression: &Expression, in_signal: bool) -> Result<String> {
    let history = |i: usize| match in_signal {
        true => format!("{}_history_{i}({}record, t)", names.own, names.gives),
        false => format!("history[{i}]"),
    };
    let name = |name: &str| program.name(name, &history, &|i| format!("late[{i}]"));
    let dialect = Dialect {
        name: &name,
        call,
        power: |a, b| format!("pow({a}, {b})"),
        number,
        pi: "3.141592653589793",
        time: "t",
    };
    dialect.write(expression)
}

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    let names = Names::new(model);
    let own = &names.own;
    let (n, m) = (model.states.len(), model.controls.len());
    let mut text = String::from("/*\n");
    for line in program.legend(0) {
        text += &format!(" * {}\n", block_comment(&line));
    }
    text += " */\n#include <math.h>\n#include <stddef.h>\n\n";
    text += &format!(
        "enum {{ {own}_n_states = {n}, {own}_n_controls = {m}, {own}_n_history = {} }};\n\n",
        program.history.len()
    );
    text += &write_parameters(&program, &names);
    let initial: Vec<String> = program.initial().into_iter().map(number).collect();
    text += &format!("const double {own}_initial_state[{own}_n_states] = {{{}}};\n\n", initial.join(", "));
    for (function, helper) in HELPERS {
        if program.calls(function) {
            text += helper;
        }
    }
    text += "/* Samples of a run: times in s, and the controls of a sample, row by row. */\n";
    text += &format!("typedef struct {{ size_t n; const double *time; const double *control; }} {own}_record_t;\n\n");
    if !program.history.is_empty() {
        text += &format!(
            "/* The sample that holds at time t. */\n\
             static size_t {own}_sample_at(const {own}_record_t *record, double t) {{\n    size_t k = 0;\n    \
             while (k + 1 < record->n && record->time[k + 1] <= t) k++;\n    return k;\n}}\n\n"
        );
    }
    for (i, history) in program.history.iter().enumerate() {
        text += &write_history(&program, &names, i, history)?;
    }
    text += &write_list(&program, &names, "rates", &program.rates, "dx")?;
    if let Some(outputs) = &program.outputs {
        text += "/* What the columns of a log read. */\n";
        text += &write_list(&program, &names, "outputs", outputs, "y")?;
    }
    text += &simulate(&program, &names);
    Ok(text)
}

/// A struct of the parameters and their nominal values.
fn write_parameters(program: &Program<'_>, names: &Names) -> String {
    let (model, own) = (program.model, &names.own);
    if model.parameters.is_empty() {
        return String::new();
    }
    let mut text = format!(
        "/* Parameters: copy {own}_nominal, change the copy, hand it to the functions. */\ntypedef struct {{\n"
    );
    for p in &model.parameters {
        let unit = if p.unit.is_empty() { String::new() } else { format!(" /* {} */", block_comment(&p.unit)) };
        text += &format!("    double {};{unit}\n", program.identifier(&p.name));
    }
    let values: Vec<String> = model.parameters.iter().map(|p| number(p.value)).collect();
    text + &format!("}} {own}_parameters_t;\nconst {own}_parameters_t {own}_nominal = {{{}}};\n\n", values.join(", "))
}

fn write_history(program: &Program<'_>, names: &Names, i: usize, history: &History) -> Result<String> {
    let Names { own, takes, gives } = names;
    let mut text = format!("static double {own}_signal_{i}({takes}const {own}_record_t *record, double t) {{\n");
    let bindings = program.bindings(&[&history.signal], &bind);
    if bindings.contains("control[") {
        text +=
            &format!("    const double *control = record->control + {own}_n_controls*{own}_sample_at(record, t);\n");
    }
    text += &bindings;
    let signal = expression(program, names, &history.signal, true)?;
    text += &format!("    {}(void)record; (void)t;\n    return {signal};\n}}\n", names.unread());
    text += &format!("static double {own}_history_{i}({takes}const {own}_record_t *record, double t) {{\n");
    text += &program.bindings(&[&history.amount, &history.phase], &bind);
    let amount = expression(program, names, &history.amount, true)?;
    let phase = expression(program, names, &history.phase, true)?;
    text += &match history.kind {
        InputKind::Delay => format!(
            "    const double earlier = t - ({amount});\n    \
             return {own}_signal_{i}({gives}record, earlier > record->time[0] ? earlier : record->time[0]);\n}}\n\n"
        ),
        InputKind::SampleHold => format!(
            "    const double phase = {phase};\n    \
             const double passed = floor((t - phase)/({amount}) + 1e-6);\n    \
             const double sampled = phase + ({amount})*(passed + 1e-6);\n    \
             return {own}_signal_{i}({gives}record, sampled > record->time[0] ? sampled : record->time[0]);\n}}\n\n"
        ),
        InputKind::Slew => format!(
            "    const double rate = fabs({amount});\n    const size_t last = {own}_sample_at(record, t);\n    \
             double output = {own}_signal_{i}({gives}record, record->time[0]);\n    for (size_t k = 0; k <= last; k++) {{\n        \
             const double till = k < last ? record->time[k + 1] : t;\n        \
             const double most = rate*fmax(till - record->time[k], 0.0);\n        \
             output += fmin(fmax({own}_signal_{i}({gives}record, record->time[k]) - output, -most), most);\n    }}\n    return output;\n}}\n\n"
        ),
        InputKind::Play => format!(
            "    const double half = 0.5*fmax({amount}, 0.0);\n    const size_t last = {own}_sample_at(record, t);\n    \
             double output = {own}_signal_{i}({gives}record, record->time[0]);\n    for (size_t k = 1; k <= last; k++) {{\n        \
             const double pushed = {own}_signal_{i}({gives}record, record->time[k]);\n        \
             output = fmin(fmax(output, pushed - half), pushed + half);\n    }}\n    return output;\n}}\n\n"
        ),
    };
    Ok(text)
}

fn write_list(program: &Program<'_>, names: &Names, name: &str, list: &[Expression], result: &str) -> Result<String> {
    let Names { own, takes, .. } = names;
    let late = if name == "outputs" { "const double *late, " } else { "" };
    let mut text = format!(
        "void {own}_{name}({takes}double t, const double *state, const double *control, const double *history, {late}double *{result}) {{\n"
    );
    text += &program.bindings(&list.iter().collect::<Vec<_>>(), &bind);
    text += &format!("    {}(void)t; (void)state; (void)control; (void)history;\n", names.unread());
    if name == "outputs" {
        text += "    (void)late;\n";
    }
    for (j, item) in list.iter().enumerate() {
        text += &format!("    {result}[{j}] = {};\n", expression(program, names, item, false)?);
    }
    Ok(text + "}\n\n")
}

fn simulate(program: &Program<'_>, names: &Names) -> String {
    let Names { own, takes, gives } = names;
    let mut update = String::new();
    for i in 0..program.history.len() {
        update += &format!("            history[{i}] = {own}_history_{i}({gives}record, middle);\n");
    }
    let size = program.history.len().max(1);
    format!(
        "\
/* Classical fourth-order Runge-Kutta with `substeps` steps between samples under held controls.
 * states: record->n rows of {own}_n_states; the first row is read, the others are written. */
void {own}_simulate({takes}const {own}_record_t *record, size_t substeps, double *states) {{
    enum {{ n = {own}_n_states }};
    double history[{size}] = {{0}}, k[4][n], x[n];
    static const double node[4] = {{0.0, 0.5, 0.5, 1.0}};
    for (size_t i = 0; i + 1 < record->n; i++) {{
        const double *from = states + n*i;
        double *to = states + n*(i + 1);
        const double *control = record->control + {own}_n_controls*i;
        const double h = (record->time[i + 1] - record->time[i])/(double)substeps;
        for (size_t j = 0; j < n; j++) to[j] = from[j];
        for (size_t s = 0; s < substeps; s++) {{
            const double t = record->time[i] + h*(double)s, middle = t + 0.5*h;
            (void)middle;
{update}            for (int stage = 0; stage < 4; stage++) {{
                for (size_t j = 0; j < n; j++)
                    x[j] = to[j] + (stage ? h*node[stage]*k[stage - 1][j] : 0.0);
                {own}_rates({gives}t + node[stage]*h, x, control, history, k[stage]);
            }}
            for (size_t j = 0; j < n; j++)
                to[j] += h/6.0*(k[0][j] + 2.0*k[1][j] + 2.0*k[2][j] + k[3][j]);
        }}
    }}
}}
"
    )
}
