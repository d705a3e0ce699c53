//! The manifest of a fleet: TOML or CSV, one entry per unit and period.

use crate::date;
use crate::task::Task;
use gpsindy_core::{Error as CoreError, Result as CoreResult};
use gpsindy_files::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Keys that are no covariates.
const KEYS: [&str; 5] = ["unit", "logs", "model", "holdout", "since"];

/// Which logs belong to which unit and period, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// One entry a unit and period.
    pub tasks: Vec<Task>,
    /// Names of the covariates; a text in the manifest becomes one of 0 and 1 for each of its values but the first.
    pub covariates: Vec<String>,
}

/// One entry as text: keys and values.
pub(crate) type Entry = BTreeMap<String, Vec<String>>;

/// One entry's covariates by name.
type Values = BTreeMap<String, f64>;

impl Manifest {
    /// Reads a manifest; paths in it are relative to its folder, and may hold `*`.
    ///
    /// TOML: an array of tables (of any name) with `unit`, `logs` (a path or a list), `model`, and where wanted `holdout`, `since`; further
    /// keys are covariates. A `model` at the top serves entries without one. CSV: the same as columns, lists separated by `;`.
    ///
    /// # Errors
    /// A file that can't be read, an entry that lacks a key, a path without files, a `since` that is no date and no number, a covariate
    /// that some entries lack: each in one line that names the entry.
    pub fn read(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| Error::Read { file: file.clone(), source })?;
        let is_csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        let entries = if is_csv { csv_entries(&text) } else { toml_entries(&text) };
        let named = |source: CoreError| Error::Content { file: file.clone(), source };
        let entries = entries.map_err(|message| named(CoreError::file(message)))?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self::new(&entries, folder).map_err(named)
    }

    pub(crate) fn new(entries: &[Entry], folder: &Path) -> CoreResult<Self> {
        if entries.is_empty() {
            return Err(CoreError::file("no unit; each needs `unit`, `logs` and `model`"));
        }
        let (covariates, values) = covariates(entries)?;
        let mut tasks = Vec::with_capacity(entries.len());
        for (k, (entry, covariates)) in entries.iter().zip(values).enumerate() {
            let place = |what: &str| format!("entry {} (unit `{}`): {what}", k + 1, one(entry, "unit").unwrap_or(""));
            let needed = |key: &str| one(entry, key).ok_or_else(|| CoreError::file(place(&format!("lacks `{key}`"))));
            let since = one(entry, "since").map(ToString::to_string);
            if let Some(since) = since.as_deref().filter(|s| date::days(s).is_none()) {
                let what = format!("`since` is no date (2026-01-31) and no number of days: `{since}`");
                return Err(CoreError::file(place(&what)));
            }
            let logs = files(entry, "logs", folder).map_err(|what| CoreError::file(place(&what)))?;
            if logs.is_empty() {
                return Err(CoreError::file(place("lacks `logs`")));
            }
            tasks.push(Task {
                unit: needed("unit")?.to_string(),
                since,
                model: folder.join(needed("model")?),
                logs,
                holdout: files(entry, "holdout", folder).map_err(|what| CoreError::file(place(&what)))?,
                covariates,
            });
        }
        let mut seen = BTreeSet::new();
        if let Some(twice) = tasks.iter().find(|task: &&Task| !seen.insert((&task.unit, &task.since))) {
            let what = format!("unit `{}` appears twice; give each period a `since`", twice.unit);
            return Err(CoreError::file(what));
        }
        Ok(Self { tasks, covariates })
    }
}

fn one<'a>(entry: &'a Entry, key: &str) -> Option<&'a str> {
    entry.get(key).and_then(|list| list.first()).map(String::as_str).filter(|text| !text.trim().is_empty())
}

/// The files that a key names, patterns spelled out in the order of their names.
fn files(entry: &Entry, key: &str, folder: &Path) -> std::result::Result<Vec<PathBuf>, String> {
    let mut found = Vec::new();
    for text in entry.get(key).into_iter().flatten().filter(|text| !text.trim().is_empty()) {
        let path = folder.join(text.trim());
        if !text.contains(['*', '?', '[']) {
            found.push(path);
            continue;
        }
        let matches = glob::glob(&path.to_string_lossy()).map_err(|e| format!("`{key}`: `{text}`: {e}"))?;
        let before = found.len();
        found.extend(matches.filter_map(std::result::Result::ok));
        if found.len() == before {
            return Err(format!("`{key}`: no file is named like `{text}`"));
        }
    }
    Ok(found)
}

/// Names of the covariates and each entry's values: numbers as they are, texts as one column of 0 and 1 a value but the first.
fn covariates(entries: &[Entry]) -> CoreResult<(Vec<String>, Vec<Values>)> {
    let keys: BTreeSet<&String> =
        entries.iter().flat_map(BTreeMap::keys).filter(|k| !KEYS.contains(&k.as_str())).collect();
    let mut names = Vec::new();
    let mut values = vec![Values::new(); entries.len()];
    for key in keys {
        let mut texts = Vec::with_capacity(entries.len());
        for (k, entry) in entries.iter().enumerate() {
            texts.push(one(entry, key).ok_or_else(|| {
                let unit = one(entry, "unit").unwrap_or("");
                CoreError::file(format!(
                    "entry {} (unit `{unit}`): lacks the covariate `{key}` that others have",
                    k + 1
                ))
            })?);
        }
        let numbers: Option<Vec<f64>> = texts.iter().map(|t| t.parse::<f64>().ok().filter(|v| v.is_finite())).collect();
        if let Some(numbers) = numbers {
            for (own, number) in values.iter_mut().zip(numbers) {
                own.insert(key.clone(), number);
            }
            names.push(key.clone());
            continue;
        }
        let levels: BTreeSet<&str> = texts.iter().copied().collect();
        for level in levels.iter().skip(1) {
            let name = format!("{key}={level}");
            let is = texts.iter().map(|text| f64::from(u8::from(text == level)));
            for (own, number) in values.iter_mut().zip(is) {
                own.insert(name.clone(), number);
            }
            names.push(name);
        }
    }
    Ok((names, values))
}

fn toml_entries(text: &str) -> std::result::Result<Vec<Entry>, String> {
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        format!("line {line}: {}", e.message())
    })?;
    let mut shared = Entry::new();
    let mut entries = Vec::new();
    for (key, value) in &table {
        match value {
            toml::Value::Array(list) if list.iter().all(toml::Value::is_table) => {
                for entry in list.iter().filter_map(toml::Value::as_table) {
                    let texts = entry.iter().map(|(k, v)| Ok((k.clone(), texts(k, v)?)));
                    entries.push(texts.collect::<std::result::Result<Entry, String>>()?);
                }
            }
            _ if KEYS.contains(&key.as_str()) => drop(shared.insert(key.clone(), texts(key, value)?)),
            _ => return Err(format!("`{key}` is no key of a manifest; units are `[[unit]]` entries")),
        }
    }
    for entry in &mut entries {
        for (key, value) in &shared {
            entry.entry(key.clone()).or_insert_with(|| value.clone());
        }
    }
    Ok(entries)
}

fn texts(key: &str, value: &toml::Value) -> std::result::Result<Vec<String>, String> {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => Ok(text.clone()),
        toml::Value::Integer(_) | toml::Value::Float(_) | toml::Value::Boolean(_) | toml::Value::Datetime(_) => {
            Ok(value.to_string())
        }
        _ => Err(format!("`{key}`: expected a text, a number or a list of texts")),
    };
    match value {
        toml::Value::Array(list) => list.iter().map(text).collect(),
        other => Ok(vec![text(other)?]),
    }
}

fn csv_entries(text: &str) -> std::result::Result<Vec<Entry>, String> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|e| e.to_string())?.clone();
    let mut entries = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| e.to_string())?;
        let cells = header.iter().zip(record.iter());
        let list = |key: &str, cell: &str| match key {
            "logs" | "holdout" => cell.split(';').map(ToString::to_string).collect(),
            _ => vec![cell.to_string()],
        };
        entries.push(cells.map(|(key, cell)| (key.to_string(), list(key, cell))).collect());
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(entries: std::result::Result<Vec<Entry>, String>) -> CoreResult<Manifest> {
        Manifest::new(&entries.map_err(CoreError::file)?, Path::new("fleet"))
    }

    #[test]
    fn toml_and_csv_say_the_same() {
        let toml = "model = \"arm.toml\"\n[[unit]]\nunit = \"a\"\nlogs = [\"a1.csv\", \"a2.csv\"]\nsince = 2026-01-05\nload = 2\noperator = \"eva\"\n\
                    [[unit]]\nunit = \"b\"\nlogs = \"b1.csv\"\nsince = \"2026-01-06\"\nload = 2.5\noperator = \"kim\"\n";
        let csv = "unit,logs,model,since,load,operator\na,a1.csv;a2.csv,arm.toml,2026-01-05,2,eva\nb,b1.csv,arm.toml,2026-01-06,2.5,kim\n";
        let one = manifest(toml_entries(toml)).unwrap();
        assert_eq!(one, manifest(csv_entries(csv)).unwrap());
        assert_eq!(one.covariates, ["load", "operator=kim"]);
        assert_eq!(one.tasks[0].logs, [Path::new("fleet/a1.csv"), Path::new("fleet/a2.csv")]);
        assert_eq!(one.tasks[1].covariates["operator=kim"], 1.0);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_entry() {
        let error = |text: &str| manifest(toml_entries(text)).unwrap_err().to_string();
        assert!(error("").contains("no unit"));
        assert!(error("[[unit]]\nunit = \"a\"\nmodel = \"m\"\n").contains("entry 1 (unit `a`): lacks `logs`"));
        assert!(error("[[unit]]\nunit = \"a\"\nlogs = \"x\"\n").contains("lacks `model`"));
        let two = "[[unit]]\nunit = \"a\"\nlogs = \"x\"\nmodel = \"m\"\n";
        assert!(error(&format!("{two}{two}")).contains("appears twice"));
        assert!(error(&format!("{two}since = \"soon\"\n")).contains("no date"));
        assert!(
            error(&format!("{two}load = 1\n[[unit]]\nunit = \"b\"\nlogs = \"x\"\nmodel = \"m\"\n"))
                .contains("covariate `load`")
        );
        assert!(
            error("[[unit]]\nunit = 1\nlogs = \"no-such-*.csv\"\nmodel = \"m\"\n").contains("no file is named like")
        );
        assert!(error("unit = [").contains("line 1"));
        assert!(error("speed = 3").contains("`speed` is no key"));
    }
}
