//! Result tables as CSV that the log reader reads back.

use gpsindy_core::Channel;
use std::fmt::Write;

/// Named columns of equal length.
#[derive(Debug, Clone, Default)]
pub struct Table {
    headers: Vec<String>,
    columns: Vec<Cells>,
}

#[derive(Debug, Clone)]
enum Cells {
    Number(Vec<f64>),
    Text(Vec<String>),
}

impl Table {
    /// A table without columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a column of numbers; NaN is written as an empty cell.
    #[must_use]
    pub fn with(mut self, channel: &Channel, values: Vec<f64>) -> Self {
        let unit = if channel.unit.is_empty() { String::new() } else { format!(" [{}]", channel.unit) };
        self.headers.push(format!("{}{unit}", channel.name));
        self.columns.push(Cells::Number(values));
        self
    }

    /// Adds a column of text.
    #[must_use]
    pub fn with_text(mut self, name: &str, values: Vec<String>) -> Self {
        self.headers.push(name.into());
        self.columns.push(Cells::Text(values));
        self
    }

    /// The table as CSV with a header row. Numbers have as many digits as it takes to read the same number back.
    ///
    /// ```
    /// use gpsindy_core::Channel;
    /// let table = gpsindy_files::Table::new().with(&Channel::new("v").with_unit("m/s"), vec![0.1, f64::NAN]);
    /// assert_eq!(table.to_csv(), "v [m/s]\n0.1\n\"\"\n");
    /// ```
    pub fn to_csv(&self) -> String {
        let n_rows = self.columns.iter().map(Cells::len).max().unwrap_or(0);
        let mut text = self.headers.iter().map(|h| quoted(h)).collect::<Vec<_>>().join(",");
        text.push('\n');
        for row in 0..n_rows {
            for (j, column) in self.columns.iter().enumerate() {
                if j > 0 {
                    text.push(',');
                }
                match column {
                    Cells::Number(values) => push_number(&mut text, values.get(row).copied().unwrap_or(f64::NAN)),
                    Cells::Text(values) => text += &quoted(values.get(row).map_or("", String::as_str)),
                }
            }
            // A row of one empty cell would read as a blank line.
            if self.columns.len() == 1 && text.ends_with('\n') {
                text += "\"\"";
            }
            text.push('\n');
        }
        text
    }

    /// The columns as a JSON object of lists, by name without the unit; a missing value is null.
    pub fn to_json(&self) -> serde_json::Value {
        let name = |header: &str| header.split(" [").next().unwrap_or_default().to_string();
        let list = |column: &Cells| match column {
            Cells::Number(values) => serde_json::Value::from(values.clone()),
            Cells::Text(values) => serde_json::Value::from(values.clone()),
        };
        serde_json::Value::Object(self.headers.iter().map(|h| name(h)).zip(self.columns.iter().map(list)).collect())
    }
}

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Number(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }
}

fn push_number(text: &mut String, value: f64) {
    if value.is_nan() {
        return;
    }
    let size = value.abs();
    // `Display` never uses an exponent and would write 1e-300 with 300 zeros.
    let _ =
        if size == 0.0 || (1e-5..1e16).contains(&size) { write!(text, "{value}") } else { write!(text, "{value:e}") };
}

fn quoted(cell: &str) -> String {
    if cell.contains(['"', ',', '\n', '\r']) || cell.starts_with('#') {
        return format!("\"{}\"", cell.replace('"', "\"\""));
    }
    cell.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LogOptions, Logs};

    #[test]
    fn the_log_reader_reads_the_same_numbers_back() {
        let values =
            vec![0.1 + 0.2, -1.0 / 3.0, 1e-300, f64::MAX, f64::MIN_POSITIVE, 0.0, f64::NAN, 12_345_678_901_234.5];
        let time: Vec<f64> = (0..values.len()).map(|i| i as f64 * 0.1).collect();
        let names = vec!["a, b".to_string(); values.len()];
        let table = Table::new()
            .with(&Channel::new("t").with_unit("s"), time.clone())
            .with_text("run", names)
            .with(&Channel::new("x").with_unit("m/s"), values.clone());
        let options = LogOptions { run: Some("run".into()), ..LogOptions::default() };
        let data = Logs::parse("t.csv", table.to_csv().as_bytes(), &options).unwrap().dataset(&["x"], &[]).unwrap();
        assert_eq!(data.runs()[0].time, time);
        for (read, written) in data.runs()[0].column(0).iter().zip(&values) {
            assert_eq!(read.to_bits(), written.to_bits());
        }
        assert_eq!(data.channels()[0].unit, "m/s");
    }
}
