//! The events of `randomization.py` in the real mjlab, in an environment of its own: mjlab needs another MuJoCo than the package, and
//! more than 6 GB from the index. Only where it is asked for by name.

use crate::shell;
use crate::{python, wheel};

pub(crate) fn run() -> Result<(), String> {
    let with_gpsindy = python::environment("release", &[])?;
    let with_mjlab = wheel::bare(&shell::root().join("target/mjlab"), &["mjlab>=1.6,<2"])?;
    let test = "crates/gpsindy-py/tests/simulators/test_randomization.py::test_the_real_mjlab_takes_the_events";
    let there = [("GPSINDY_MJLAB_PYTHON", &*with_mjlab.to_string_lossy())];
    shell::run(with_gpsindy, ["-m", "pytest", "-q", "-rs", test], &there)
}
