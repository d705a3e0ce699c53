//! How many of 24 drawn pairs of effects one designed run distinguishes, kept in `tests/records/design.txt`.

use crate::shell;

/// Where the count is kept.
const RECORD: &str = "tests/records/design.txt";

pub(crate) fn run() -> Result<(), String> {
    let record = shell::root().join(RECORD);
    let test = "test --release -p gpsindy-core --test public -- --ignored --nocapture of_24_drawn_pairs";
    shell::run("cargo", test.split(' '), &[("GPSINDY_RECORD", &*record.to_string_lossy())])?;
    let kept = std::fs::read_to_string(&record).map_err(|e| format!("{}: {e}", record.display()))?;
    shell::say(&kept);
    Ok(())
}
