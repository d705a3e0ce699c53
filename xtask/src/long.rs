//! Tasks that take too long for every change.

mod design;
mod faults;
mod levels;
mod mjlab;

/// A task by its name, and whether it is one of all; the others run only where they are named.
type Task = (&'static str, bool, fn() -> Result<(), String>);

const TASKS: &[Task] = &[
    ("design", true, design::run),
    ("faults", true, faults::run),
    ("levels", true, levels::run),
    ("features", true, crate::tools::features),
    ("mjlab", false, mjlab::run),
    ("package", true, crate::package::check),
    ("wheel", true, crate::wheel::check),
    ("site", true, || crate::site::build(None)),
];

/// Runs one task, or all that need no name; the first that fails ends it.
pub(crate) fn run(name: Option<&str>) -> Result<(), String> {
    let is_chosen = |(task, of_all, _): &&Task| name.map_or(*of_all, |name| name == *task);
    let chosen: Vec<&Task> = TASKS.iter().filter(is_chosen).collect();
    if chosen.is_empty() {
        let known: Vec<&str> = TASKS.iter().map(|(task, ..)| *task).collect();
        return Err(format!("unknown long task `{}`; known: {}", name.unwrap_or_default(), known.join(", ")));
    }
    chosen.into_iter().try_for_each(|(_, _, task)| task())
}
