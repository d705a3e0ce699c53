//! Columns that no log has, because what they stand for did not change.

use crate::error::{Error, Result};
use crate::header::Header;
use crate::options::{LogOptions, plain};
use crate::topic::{Reading, Source, Topic};
use gpsindy_core::Progress;
use std::collections::HashMap;
use std::sync::Arc;

/// A log with columns of one value each behind its own.
#[derive(Debug)]
struct WithConstants {
    log: Arc<dyn Source>,
    columns: Vec<Header>,
    values: Vec<f64>,
}

/// The log with the constants of its options, or itself where there are none.
///
/// # Errors
/// A name that hides something or appears twice, a column that the log has already.
pub(crate) fn with_constants(file: &str, log: Arc<dyn Source>, options: &LogOptions) -> Result<Arc<dyn Source>> {
    if options.constant.is_empty() {
        return Ok(log);
    }
    let mut columns = log.columns().to_vec();
    for (name, _) in &options.constant {
        plain(file, "--constant", name)?;
        if columns.iter().any(|column| column.answers_to(name)) {
            let message = format!("--constant {name}: the log has a column `{name}` already; remove the option");
            return Err(Error::file(file, message));
        }
        columns.push(Header::parse(name));
    }
    let values = options.constant.iter().map(|(_, value)| *value).collect();
    Ok(Arc::new(WithConstants { log, columns, values }))
}

impl WithConstants {
    /// The value of a column that the log itself lacks.
    fn value(&self, column: usize) -> Option<f64> {
        column.checked_sub(self.log.columns().len()).map(|i| self.values[i])
    }
}

impl Source for WithConstants {
    fn columns(&self) -> &[Header] {
        &self.columns
    }

    fn is_numeric(&self, column: usize) -> bool {
        self.value(column).is_some() || self.log.is_numeric(column)
    }

    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        let (mut own, mut places, mut constants) = (Vec::new(), Vec::new(), Vec::new());
        for (place, &column) in columns.iter().enumerate() {
            match self.value(column) {
                Some(value) => constants.push((place, value)),
                None => {
                    own.push(column);
                    places.push(place);
                }
            }
        }
        let mut reading = self.log.read(&own, progress)?;
        for (column, _) in reading.topics.iter_mut().flat_map(|topic| &mut topic.columns) {
            *column = places[*column];
        }
        // A constant goes with every stamp: once in each run it stands in the topic that begins first.
        let begins = |topic: &Topic| topic.stamps.first().copied().unwrap_or(f64::INFINITY);
        let mut first: HashMap<&str, usize> = HashMap::new();
        for (at, topic) in reading.topics.iter().enumerate() {
            let known = first.entry(&topic.run).or_insert(at);
            if begins(topic) < begins(&reading.topics[*known]) {
                *known = at;
            }
        }
        let first: Vec<usize> = first.into_values().collect();
        for at in first {
            let Topic { stamps, columns, .. } = &mut reading.topics[at];
            columns.extend(constants.iter().map(|&(place, value)| (place, vec![value; stamps.len()])));
        }
        Ok(reading)
    }

    fn lacks(&self, name: &str) -> Error {
        self.log.lacks(name)
    }

    fn time_header(&self) -> Option<&Header> {
        self.log.time_header()
    }
}

#[cfg(test)]
mod tests {
    use crate::{LogOptions, Logs};

    fn options(constant: &[(&str, f64)]) -> LogOptions {
        let constant = constant.iter().map(|(name, value)| (name.to_string(), *value)).collect();
        LogOptions { run: Some("run".into()), constant, ..LogOptions::default() }
    }

    #[test]
    fn a_constant_is_a_column_of_every_run() {
        let text = b"run,t,x\na,0,1\na,1,2\nb,0,3\nb,1,4\n";
        let logs = Logs::parse("a.csv", text, &options(&[("u", 0.5), ("w", -1.0)])).unwrap();
        assert_eq!(logs.columns(), ["x", "u", "w"]);
        let data = logs.dataset(&["w", "x", "u"], &[]).unwrap();
        let columns: Vec<_> = data.runs().iter().map(|run| [0, 1, 2].map(|j| run.column(j).to_vec())).collect();
        assert_eq!(columns[0], [vec![-1.0, -1.0], vec![1.0, 2.0], vec![0.5, 0.5]]);
        assert_eq!(columns[1], [vec![-1.0, -1.0], vec![3.0, 4.0], vec![0.5, 0.5]]);
    }

    #[test]
    fn a_column_that_the_log_has_is_no_constant() {
        let text = b"run,t,x\na,0,1\na,1,2\n";
        let error = Logs::parse("a.csv", text, &options(&[("x", 0.5)])).unwrap_err();
        assert_eq!(error.to_string(), "a.csv: --constant x: the log has a column `x` already; remove the option");
        let error = Logs::parse("a.csv", text, &options(&[("u", 0.5), ("u", 1.0)])).unwrap_err();
        assert!(error.to_string().contains("--constant u"), "{error}");
    }
}
