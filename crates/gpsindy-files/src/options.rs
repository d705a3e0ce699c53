//! How the columns of a log are found, and by which clock.

use crate::error::{Error, Result};
use crate::header::Header;

/// How columns of a log are found.
#[derive(Debug, Clone, Default)]
pub struct LogOptions {
    /// The time column of a table; default `t`, else `time` in any case, else `__time`.
    pub time: Option<String>,
    /// The column whose value distinguishes the runs of a file; default: a file is a run.
    pub run: Option<String>,
    /// Columns that get another name: (name or whole header, new name). A `*` in both stands for the same characters.
    pub rename: Vec<(String, String)>,
    /// Columns that no log has and that had one value throughout: (name, value).
    pub constant: Vec<(String, f64)>,
    /// Where a column comes from: (its name, topic and field, or a table's column).
    pub map: Vec<(String, String)>,
    /// Units of columns whose format has none: (name, unit).
    pub unit: Vec<(String, String)>,
    /// The clock of messages.
    pub stamp: Stamp,
    /// What is added to the stamps of a topic.
    pub offset: Vec<(String, Offset)>,
}

impl LogOptions {
    /// Refuses a name or a unit that hides something, a map that names a column twice, and an offset for a log that is one table.
    pub(crate) fn check(&self, file: &str, table: bool) -> Result<()> {
        let renames = self.rename.iter().map(|(_, name)| ("--rename", name));
        let maps = self.map.iter().map(|(name, _)| ("--map", name));
        let units = self.unit.iter().flat_map(|(name, unit)| [("[unit]", name), ("[unit]", unit)]);
        for (place, text) in renames.chain(maps).chain(units) {
            plain(file, place, text)?;
        }
        for (i, (name, _)) in self.map.iter().enumerate() {
            if self.map[..i].iter().any(|(other, _)| other == name) {
                return Err(Error::file(file, format!("--map: `{name}` is mapped twice; map each name once")));
            }
        }
        match self.offset.first() {
            Some((topic, _)) if table => {
                let message = format!("--offset {topic}: the log is a table, with one clock for all of its columns");
                Err(Error::file(file, message))
            }
            _ => Ok(()),
        }
    }

    /// The renames of a log with these columns: a pattern becomes one of every column that it fits. One that fits none stays as it is,
    /// and so does one that is a column's whole name.
    pub(crate) fn renames(&self, columns: &[Header]) -> Vec<(String, String)> {
        let mut found = Vec::new();
        for (old, new) in &self.rename {
            let is_column = columns.iter().any(|column| column.answers_to(old));
            let parts = old.split_once('*').filter(|(_, rest)| !rest.contains('*') && !is_column);
            let fitting: Vec<(String, String)> = match parts.filter(|_| new.matches('*').count() == 1) {
                Some((before, after)) => columns.iter().filter_map(|c| renamed(c, before, after, new)).collect(),
                None => Vec::new(),
            };
            found.extend(if fitting.is_empty() { vec![(old.clone(), new.clone())] } else { fitting });
        }
        found
    }

    /// The unit that the options give a column, empty where they give none.
    #[cfg(any(feature = "mcap", feature = "ulog"))]
    pub(crate) fn unit_of(&self, name: &str) -> String {
        self.unit.iter().find(|(n, _)| n == name).map(|(_, unit)| unit.clone()).unwrap_or_default()
    }
}

/// Refuses a name or a unit with a character that does not show.
pub(crate) fn plain(file: &str, place: &str, text: &str) -> Result<()> {
    match text.chars().zip(1..).find(|&(c, _)| !gpsindy_core::shows(c)) {
        Some((hidden, at)) => {
            let code = u32::from(hidden);
            let message = format!(
                "{place}: character {at} of a name or unit is U+{code:04X}, which does not show; write it without"
            );
            Err(Error::file(file, message))
        }
        None => Ok(()),
    }
}

/// The rename of a column by a pattern that it fits: what stands between `before` and `after` goes to the `*` of `new`.
fn renamed(column: &Header, before: &str, after: &str, new: &str) -> Option<(String, String)> {
    let between = |text: &str| text.strip_prefix(before)?.strip_suffix(after).map(str::to_string);
    let middle = between(&column.name).or_else(|| between(&column.text))?;
    let plain: String = middle.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' }).collect();
    Some((column.text.clone(), new.replacen('*', &plain, 1)))
}

/// What is added to the stamps of a topic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Offset {
    /// So many seconds.
    Seconds(f64),
    /// What makes its columns agree with those of the other topics best.
    Auto,
}

impl std::str::FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let seconds = text.parse().ok().filter(|s: &f64| s.is_finite());
        seconds.map(Self::Seconds).ok_or_else(|| format!("`{text}` is neither a number of seconds nor `auto`"))
    }
}

/// The clock of messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stamp {
    /// The stamp in the message's header where there is one, else the time of recording.
    #[default]
    Auto,
    /// The stamp in the message's header; a topic without one is refused.
    Header,
    /// The time of recording.
    Log,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_or_unit_that_hides_something_is_refused() {
        let one = |name: &str, other: &str| vec![(name.to_string(), other.to_string())];
        let stated = |options: LogOptions| options.check("a.csv", true).unwrap_err().to_string();
        for hidden in ['\u{feff}', '\u{ad}'] {
            let (name, code) = (format!("v{hidden}x"), u32::from(hidden));
            let wanted = |place: &str| {
                format!(
                    "a.csv: {place}: character 2 of a name or unit is U+{code:04X}, which does not show; write it without"
                )
            };
            assert_eq!(stated(LogOptions { rename: one("v", &name), ..LogOptions::default() }), wanted("--rename"));
            assert_eq!(stated(LogOptions { map: one(&name, "v"), ..LogOptions::default() }), wanted("--map"));
            assert_eq!(stated(LogOptions { unit: one(&name, "m"), ..LogOptions::default() }), wanted("[unit]"));
            assert_eq!(stated(LogOptions { unit: one("v", &name), ..LogOptions::default() }), wanted("[unit]"));
        }
        // What is looked for in a log may be as the log has it.
        let there = LogOptions { rename: one("v\u{ad}", "v"), map: one("w", "/a.w\u{ad}"), ..LogOptions::default() };
        assert!(there.check("a.csv", true).is_ok());
    }

    #[test]
    fn a_pattern_renames_every_column_that_it_fits() {
        let columns: Vec<Header> =
            ["t", "q_hip [rad]", "q_knee [rad]", "qd_knee", "state[arm.pos]"].map(Header::parse).into();
        let found = |old: &str, new: &str| {
            let options = LogOptions { rename: vec![(old.into(), new.into())], ..LogOptions::default() };
            let named = options.renames(&columns).into_iter().map(|(old, new)| format!("{old}={new}"));
            named.collect::<Vec<_>>().join(", ")
        };
        assert_eq!(found("q_*", "*_joint"), "q_hip [rad]=hip_joint, q_knee [rad]=knee_joint");
        assert_eq!(found("qd_*", "*_joint_vel"), "qd_knee=knee_joint_vel");
        assert_eq!(found("state[*.pos]", "*"), "state[arm.pos]=arm");
        // What fits nothing is an error like that of a missing column; a name without a star gets one column only.
        assert_eq!(found("x_*", "*"), "x_*=*");
        assert_eq!(found("q_*", "hip"), "q_*=hip");
        assert_eq!(found("q_hip", "*"), "q_hip=*");
    }
}
