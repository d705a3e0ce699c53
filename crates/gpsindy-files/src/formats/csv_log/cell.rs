//! One line of a CSV file, and its cells as numbers.

use csv::StringRecord;

/// Cells of one line, which begins at line number `line`; in a pass over a file at byte `line`.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) line: u64,
    pub(crate) cells: StringRecord,
}

pub(super) fn cell(row: &Row, index: usize) -> &str {
    row.cells.get(index).unwrap_or_default()
}

/// A cell as a number: missing is NaN, an overflow is infinite, other text is `Err`.
pub(super) fn number(text: &str) -> std::result::Result<f64, ()> {
    if matches!(text, "" | "NA") {
        return Ok(f64::NAN);
    }
    text.parse().map_err(|_| ())
}

/// A cell in quotes, cut where it is long.
pub(super) fn shown(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    format!("{short:?}")
}
