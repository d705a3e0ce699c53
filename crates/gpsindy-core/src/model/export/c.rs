//! C99.

use super::dialect::{Dialect, number};
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
    format!("    const double {name} = {list}[{place}];\n")
}

fn expression(program: &Program<'_>, expression: &Expression, in_signal: bool) -> Result<String> {
    let history = |i: usize| if in_signal { format!("history_{i}(record, t)") } else { format!("history[{i}]") };
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
    let (n, m) = (model.states.len(), model.controls.len());
    let mut text = String::from("/*\n");
    for line in program.legend(0) {
        text += &format!(" * {line}\n");
    }
    text += " */\n#include <math.h>\n#include <stddef.h>\n\n";
    text += &format!("enum {{ N_STATES = {n}, N_CONTROLS = {m}, N_HISTORY = {} }};\n\n", program.history.len());
    let values: Vec<String> = model.parameters.iter().map(|p| number(p.value)).collect();
    let names: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
    if !values.is_empty() {
        text += &format!("/* {} */\n", names.join(", "));
        text += &format!("static const double parameters[] = {{{}}};\n", values.join(", "));
    }
    let initial: Vec<String> = program.initial().into_iter().map(number).collect();
    text += &format!("const double initial_state[N_STATES] = {{{}}};\n\n", initial.join(", "));
    for (function, helper) in HELPERS {
        if program.calls(function) {
            text += helper;
        }
    }
    text += "/* Samples of a run: times in s, and N_CONTROLS controls a sample, row by row. */\n";
    text += "typedef struct { size_t n; const double *time; const double *control; } record_t;\n\n";
    if !program.history.is_empty() {
        text += "/* The sample that holds at time t. */\n\
            static size_t sample_at(const record_t *record, double t) {\n    size_t k = 0;\n    \
            while (k + 1 < record->n && record->time[k + 1] <= t) k++;\n    return k;\n}\n\n";
    }
    for (i, history) in program.history.iter().enumerate() {
        text += &write_history(&program, i, history)?;
    }
    text += &write_list(&program, "rates", &program.rates, "dx")?;
    if let Some(outputs) = &program.outputs {
        text += "/* What the columns of a log read. */\n";
        text += &write_list(&program, "outputs", outputs, "y")?;
    }
    text += &simulate(&program);
    Ok(text)
}

fn write_history(program: &Program<'_>, i: usize, history: &History) -> Result<String> {
    let mut text = format!("static double signal_{i}(const record_t *record, double t) {{\n");
    let bindings = program.bindings(&[&history.signal], &bind);
    if bindings.contains("control[") {
        text += "    const double *control = record->control + N_CONTROLS*sample_at(record, t);\n";
    }
    text += &bindings;
    text += &format!("    (void)record; (void)t;\n    return {};\n}}\n", expression(program, &history.signal, true)?);
    text += &format!("static double history_{i}(const record_t *record, double t) {{\n");
    text += &program.bindings(&[&history.amount], &bind);
    let amount = expression(program, &history.amount, true)?;
    text += &match history.kind {
        InputKind::Delay => format!(
            "    const double earlier = t - ({amount});\n    \
             return signal_{i}(record, earlier > record->time[0] ? earlier : record->time[0]);\n}}\n\n"
        ),
        InputKind::Play => format!(
            "    const double half = 0.5*fmax({amount}, 0.0);\n    const size_t last = sample_at(record, t);\n    \
             double output = signal_{i}(record, record->time[0]);\n    for (size_t k = 1; k <= last; k++) {{\n        \
             const double pushed = signal_{i}(record, record->time[k]);\n        \
             output = fmin(fmax(output, pushed - half), pushed + half);\n    }}\n    return output;\n}}\n\n"
        ),
    };
    Ok(text)
}

fn write_list(program: &Program<'_>, name: &str, list: &[Expression], result: &str) -> Result<String> {
    let late = if name == "outputs" { "const double *late, " } else { "" };
    let mut text = format!(
        "void {name}(double t, const double *state, const double *control, const double *history, {late}double *{result}) {{\n"
    );
    text += &program.bindings(&list.iter().collect::<Vec<_>>(), &bind);
    text += "    (void)t; (void)state; (void)control; (void)history;\n";
    if name == "outputs" {
        text += "    (void)late;\n";
    }
    for (j, item) in list.iter().enumerate() {
        text += &format!("    {result}[{j}] = {};\n", expression(program, item, false)?);
    }
    Ok(text + "}\n\n")
}

fn simulate(program: &Program<'_>) -> String {
    let mut update = String::new();
    for i in 0..program.history.len() {
        update += &format!("            history[{i}] = history_{i}(record, middle);\n");
    }
    let size = program.history.len().max(1);
    format!(
        "\
/* Classical fourth-order Runge-Kutta with `substeps` steps between samples under held controls.
 * states: record->n rows of N_STATES; the first row is read, the others are written. */
void simulate(const record_t *record, size_t substeps, double *states) {{
    double history[{size}] = {{0}}, k[4][N_STATES], x[N_STATES];
    static const double node[4] = {{0.0, 0.5, 0.5, 1.0}};
    for (size_t i = 0; i + 1 < record->n; i++) {{
        const double *from = states + N_STATES*i;
        double *to = states + N_STATES*(i + 1);
        const double *control = record->control + N_CONTROLS*i;
        const double h = (record->time[i + 1] - record->time[i])/(double)substeps;
        for (size_t j = 0; j < N_STATES; j++) to[j] = from[j];
        for (size_t s = 0; s < substeps; s++) {{
            const double t = record->time[i] + h*(double)s, middle = t + 0.5*h;
            (void)middle;
{update}            for (int stage = 0; stage < 4; stage++) {{
                for (size_t j = 0; j < N_STATES; j++)
                    x[j] = to[j] + (stage ? h*node[stage]*k[stage - 1][j] : 0.0);
                rates(t + node[stage]*h, x, control, history, k[stage]);
            }}
            for (size_t j = 0; j < N_STATES; j++)
                to[j] += h/6.0*(k[0][j] + 2.0*k[1][j] + 2.0*k[2][j] + k[3][j]);
        }}
    }}
}}
"
    )
}
