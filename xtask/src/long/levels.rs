//! The tests of a level with all of their draws: how often a fleet without wear raises an alarm, how often an interval holds the truth; and ripples
//! along a rail before the whole catalogue.

use crate::shell;

/// As in `tests/beside`.
const LEVELS: &str = "GPSINDY_LEVELS";

pub(crate) fn run() -> Result<(), String> {
    let test = "test --release -p gpsindy-core --lib -- clock:: fleet:: rival::";
    shell::run("cargo", test.split(' '), &[(LEVELS, "1")])
}
