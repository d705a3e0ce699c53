//! LeRobot data sets: a folder whose `meta/info.json` names the elements of vectors; an episode is a run.
//!
//! Source: LeRobotDataset v3, docs/source/lerobot-dataset-v3.mdx of huggingface/lerobot. Folders of version 2, with a file
//! an episode, have the same columns and are read too. What the data set says of its episodes is compared with the data.

use super::episodes::{Episodes, parquet_files};
use super::{Elements, ParquetLog};
use crate::error::{Error, Result};
use crate::input::Input;
use crate::options::LogOptions;
use serde_json::Value;
use std::path::Path;

/// Whether a folder is such a data set.
pub(crate) fn is(folder: &Path) -> bool {
    folder.join("meta/info.json").is_file()
}

/// Opens a data set: time is `timestamp`, runs are `episode_index`, unless the options say otherwise.
///
/// # Errors
/// A description that can't be read, no data, and what [`ParquetLog::open`] refuses.
pub(crate) fn open(folder: &Path, options: &LogOptions) -> Result<ParquetLog> {
    let info = folder.join("meta/info.json");
    let file = info.display().to_string();
    let text = std::fs::read_to_string(&info).map_err(|source| Error::Read { file: file.clone(), source })?;
    let info: Value = serde_json::from_str(&text).map_err(|e| Error::file(&file, format!("not JSON: {e}")))?;
    let mut files = Vec::new();
    if folder.join("data").is_dir() {
        parquet_files(&folder.join("data"), &mut files)?;
    }
    files.sort();
    if files.is_empty() {
        let place = folder.join("data").display().to_string();
        return Err(Error::file(&place, "no .parquet file is there; was the data set downloaded whole?"));
    }
    let mut elements = Elements::new();
    for (feature, description) in info.get("features").and_then(Value::as_object).into_iter().flatten() {
        if let Some(names) = description.get("names").and_then(element_names) {
            elements.insert(feature.clone(), names);
        }
    }
    let mut options = options.clone();
    options.time.get_or_insert_with(|| "timestamp".into());
    options.run.get_or_insert_with(|| "episode_index".into());
    let by_episode = options.run.as_deref() == Some("episode_index");
    let inputs = files.iter().map(|path| Input::of_path(path)).collect();
    let log = ParquetLog::open(inputs, &folder.display().to_string(), &options, &elements)?;
    // Runs by another column say nothing of episodes.
    let log = if by_episode { log.with_episodes(Episodes::of(folder, &info)?) } else { log };
    let rate = info.get("fps").and_then(Value::as_f64).filter(|fps| *fps > 0.0);
    Ok(match rate {
        Some(rate) if options.time.as_deref() == Some("timestamp") => log.with_frames(rate, "frame_index"),
        None if options.time.as_deref() == Some("timestamp") => log.without_rate(),
        _ => log,
    })
}

/// Names as a list, or as lists by their kind: `{"motors": ["shoulder", "elbow"]}`.
fn element_names(names: &Value) -> Option<Vec<String>> {
    let list = match names {
        Value::Array(list) => list.clone(),
        Value::Object(kinds) => kinds.values().filter_map(Value::as_array).flatten().cloned().collect(),
        _ => return None,
    };
    list.iter().map(|name| name.as_str().map(Into::into)).collect()
}
