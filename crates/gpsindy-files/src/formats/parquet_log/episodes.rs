//! What a LeRobot data set says of its episodes: how long each is, and which file holds it.
//!
//! Version 3 keeps them as tables below `meta/episodes`, version 2 as lines of JSON in `meta/episodes.jsonl`.

use super::leaf::Table;
use crate::error::{Error, Result};
use crate::input::Input;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Where version 3 keeps its data unless `meta/info.json` says otherwise.
const DATA_PATH: &str = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet";

/// Episodes by their number; none where the data set has no such table.
#[derive(Debug, Default)]
pub(crate) struct Episodes {
    known: BTreeMap<i64, Episode>,
}

#[derive(Debug)]
struct Episode {
    frames: i64,
    /// The file that holds it, where that is not there.
    lost: Option<String>,
}

impl Episodes {
    /// Reads what the folder of a data set says; `info` is its `meta/info.json`.
    ///
    /// # Errors
    /// A table or line that can't be read.
    pub(super) fn of(folder: &Path, info: &Value) -> Result<Self> {
        let tables = folder.join("meta/episodes");
        if tables.is_dir() {
            return Self::of_tables(folder, &tables, info);
        }
        let lines = folder.join("meta/episodes.jsonl");
        if lines.is_file() { Self::of_lines(&lines) } else { Ok(Self::default()) }
    }

    fn of_tables(folder: &Path, tables: &Path, info: &Value) -> Result<Self> {
        let mut files = Vec::new();
        parquet_files(tables, &mut files)?;
        files.sort();
        let template = info.get("data_path").and_then(Value::as_str).unwrap_or(DATA_PATH);
        let mut there: HashMap<PathBuf, bool> = HashMap::new();
        let mut known = BTreeMap::new();
        for path in files {
            let table = Table::open(&Input::of_path(&path))?;
            let leaves = table.leaves();
            let column = |name: &str| -> Result<Option<Vec<i64>>> {
                leaves.iter().find(|l| l.name == name && !l.listed).map(|leaf| table.integers(leaf)).transpose()
            };
            let (Some(numbers), Some(lengths)) = (column("episode_index")?, column("length")?) else {
                let message = "holds no columns `episode_index` and `length`; is it a table of episodes?";
                return Err(Error::file(&path.display().to_string(), message));
            };
            let places = column("data/chunk_index")?.zip(column("data/file_index")?);
            for (i, (&number, &frames)) in numbers.iter().zip(&lengths).enumerate() {
                let place = places.as_ref().and_then(|(chunks, files)| Some((*chunks.get(i)?, *files.get(i)?)));
                let file = place.map(|(chunk, file)| filled(template, &[("chunk_index", chunk), ("file_index", file)]));
                let lost = file.filter(|file| {
                    let path = folder.join(file);
                    !*there.entry(path).or_insert_with_key(|path| path.is_file())
                });
                known.insert(number, Episode { frames, lost });
            }
        }
        Ok(Self { known })
    }

    fn of_lines(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| Error::Read { file: file.clone(), source })?;
        let mut known = BTreeMap::new();
        for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let wrong = |message: String| Error::line(&file, i as u64 + 1, None, message);
            let episode: Value = serde_json::from_str(line).map_err(|e| wrong(format!("not JSON: {e}")))?;
            let whole = |key: &str| episode.get(key).and_then(Value::as_i64);
            let (Some(number), Some(frames)) = (whole("episode_index"), whole("length")) else {
                return Err(wrong("an episode without `episode_index` and `length`".into()));
            };
            known.insert(number, Episode { frames, lost: None });
        }
        Ok(Self { known })
    }

    /// What to say of episodes that are not there as the data set lists them, given the runs that were read.
    pub(super) fn missing(&self, file: &str, runs: &[(String, Vec<usize>)]) -> Vec<String> {
        let mut notes = Vec::new();
        let read: HashMap<i64, usize> =
            runs.iter().filter_map(|(name, rows)| Some((name.parse().ok()?, rows.len()))).collect();
        if self.known.is_empty() {
            return notes;
        }
        let mut lost: BTreeMap<&str, Vec<i64>> = BTreeMap::new();
        for (number, Episode { frames, lost: place }) in &self.known {
            match (read.get(number), place) {
                (None, Some(place)) => lost.entry(place).or_default().push(*number),
                (None, None) => lost.entry("").or_default().push(*number),
                (Some(found), _) if *found as i64 != *frames => notes.push(format!(
                    "{file}: episode {number} has {found} frames, where meta/episodes says {frames}; what is there was read"
                )),
                _ => {}
            }
        }
        for (place, numbers) in lost {
            let listed: Vec<String> = numbers.iter().take(8).map(ToString::to_string).collect();
            let more = if numbers.len() > 8 { format!(" and {} more", numbers.len() - 8) } else { String::new() };
            let place = if place.is_empty() { String::new() } else { format!("; {place} is not there") };
            notes.push(format!(
                "{file}: episodes that meta/episodes names and no file holds: {}{more}{place}",
                listed.join(", ")
            ));
        }
        let strange = read.keys().filter(|number| !self.known.contains_key(number)).count();
        if strange > 0 {
            notes.push(format!("{file}: meta/episodes does not name {strange} of the episodes that were read"));
        }
        notes
    }
}

/// A template with numbers in place of `{name:03d}`.
fn filled(template: &str, values: &[(&str, i64)]) -> String {
    let mut text = template.to_string();
    for (name, value) in values {
        text = text.replace(&format!("{{{name}:03d}}"), &format!("{value:03}"));
        text = text.replace(&format!("{{{name}}}"), &value.to_string());
    }
    text
}

/// The tables below a folder.
pub(super) fn parquet_files(folder: &Path, found: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |source| Error::Read { file: folder.display().to_string(), source };
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            parquet_files(&path, found)?;
        } else if path.extension().is_some_and(|e| e == "parquet") {
            found.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_names_the_file_of_an_episode() {
        let values = [("chunk_index", 2), ("file_index", 1234)];
        assert_eq!(filled(DATA_PATH, &values), "data/chunk-002/file-1234.parquet");
        assert_eq!(filled("d/{chunk_index}_{file_index}.parquet", &values), "d/2_1234.parquet");
    }
}
