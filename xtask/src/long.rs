//! Tasks that take too long for every change.

mod faults;

/// A task by its name.
type Task = (&'static str, fn() -> Result<(), String>);

const TASKS: &[Task] = &[
    ("faults", faults::run),
    ("features", crate::tools::features),
    ("package", crate::package::check),
    ("wheel", crate::wheel::check),
    ("site", || crate::site::build(None)),
];

/// Runs one task, or all of them; the first that fails ends it.
pub(crate) fn run(name: Option<&str>) -> Result<(), String> {
    let chosen: Vec<&Task> = TASKS.iter().filter(|(task, _)| name.is_none_or(|name| name == *task)).collect();
    if chosen.is_empty() {
        let known: Vec<&str> = TASKS.iter().map(|(task, _)| *task).collect();
        return Err(format!("unknown long task `{}`; known: {}", name.unwrap_or_default(), known.join(", ")));
    }
    chosen.into_iter().try_for_each(|(_, task)| task())
}
