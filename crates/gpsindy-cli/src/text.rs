//! Formats numbers and tables for the terminal.

/// A number with four significant digits; `-` where there is none.
pub(crate) fn short(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "-".into() } else { value.to_string() };
    }
    if value == 0.0 {
        return "0".into();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&exponent) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.*}", (3 - exponent).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Rows of cells in aligned columns, two blanks apart: the first column to the left, the others to the right.
pub(crate) fn aligned(rows: &[Vec<String>]) -> String {
    let n_columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |j: usize| rows.iter().filter_map(|row| row.get(j)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..n_columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (j, cell) in row.iter().enumerate() {
            let blanks = " ".repeat(widths[j] - cell.chars().count());
            line += &if j == 0 { format!("{cell}{blanks}") } else { format!("  {blanks}{cell}") };
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// Rows of cells in aligned columns, two blanks apart, all to the left.
pub(crate) fn aligned_left<const N: usize>(rows: &[[String; N]]) -> String {
    let width = |j: usize| rows.iter().map(|row| row[j].chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = row.iter().enumerate().map(|(j, cell)| format!("{cell:<w$}", w = width(j))).collect();
        text += cells.join("  ").trim_end();
        text.push('\n');
    }
    text
}

/// `1 run`, `2 runs`.
pub(crate) fn count(n: usize, noun: &str) -> String {
    if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (-0.4, "-0.4"),
            (std::f64::consts::PI, "3.142"),
            (0.000_123_456, "0.0001235"),
            (0.000_012_3, "1.230e-5"),
            (123_456.7, "123457"),
            (9.9999e9, "1.000e10"),
            (f64::NAN, "-"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn columns_line_up() {
        let rows =
            [vec!["state".into(), "rmse".into()], vec!["x".into(), "0.25".into()], vec!["heading".into(), "-".into()]];
        assert_eq!(aligned(&rows), "state    rmse\nx        0.25\nheading     -\n");
    }
}
