//! The map of a whole project: where each column comes from, its unit, and the clocks, in one TOML file.

use crate::error::{Error, Result};
use crate::options::{LogOptions, Offset, Stamp};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapFile {
    #[serde(default)]
    map: BTreeMap<String, String>,
    #[serde(default)]
    unit: BTreeMap<String, String>,
    #[serde(default)]
    offset: BTreeMap<String, Shift>,
    stamp: Option<Clock>,
}

/// Seconds, or `"auto"`.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number of seconds or \"auto\"")]
enum Shift {
    Seconds(f64),
    Word(Auto),
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Auto {
    Auto,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Clock {
    Header,
    Log,
}

impl LogOptions {
    /// Adds what a map file says; what the options say already stays.
    ///
    /// ```toml
    /// stamp = "log"
    /// [map]
    /// q = "/joint_states.position[elbow]"
    /// [unit]
    /// q = "rad"
    /// [offset]
    /// "/joint_states" = 0.004    # or "auto"
    /// ```
    ///
    /// # Errors
    /// A file that can't be read or understood.
    pub fn add_map_file(&mut self, path: &Path) -> Result<()> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| Error::Read { file: file.clone(), source })?;
        let read: MapFile = toml::from_str(&text).map_err(|e| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count() as u64);
            Error::line(&file, line, None, e.message().to_string())
        })?;
        for (name, place) in read.map {
            if !self.map.iter().any(|(n, _)| *n == name) {
                self.map.push((name, place));
            }
        }
        self.unit.extend(read.unit);
        for (topic, shift) in read.offset {
            if !self.offset.iter().any(|(t, _)| *t == topic) {
                let offset = match shift {
                    Shift::Seconds(seconds) => Offset::Seconds(seconds),
                    Shift::Word(Auto::Auto) => Offset::Auto,
                };
                self.offset.push((topic, offset));
            }
        }
        if self.stamp == Stamp::Auto {
            self.stamp = match read.stamp {
                None => Stamp::Auto,
                Some(Clock::Header) => Stamp::Header,
                Some(Clock::Log) => Stamp::Log,
            };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<LogOptions> {
        let path = std::env::temp_dir().join(format!("gpsindy-map-{}-{}.toml", std::process::id(), text.len()));
        std::fs::write(&path, text).unwrap();
        let mut options = LogOptions { map: vec![("q".into(), "/mine.q".into())], ..LogOptions::default() };
        let done = options.add_map_file(&path);
        std::fs::remove_file(&path).unwrap();
        done.map(|()| options)
    }

    #[test]
    fn a_map_file_adds_to_the_options_and_never_overrules_them() {
        let text = "stamp = \"log\"\n[map]\nq = \"/a.q\"\nu = \"/b.data[0]\"\n[unit]\nu = \"N\"\n[offset]\n\"/b\" = 0.5\n\"/c\" = \"auto\"\n";
        let options = read(text).unwrap();
        assert_eq!(options.map, [("q".to_string(), "/mine.q".to_string()), ("u".into(), "/b.data[0]".into())]);
        assert_eq!(options.offset, [("/b".to_string(), Offset::Seconds(0.5)), ("/c".into(), Offset::Auto)]);
        assert_eq!((options.stamp, options.unit), (Stamp::Log, vec![("u".to_string(), "N".to_string())]));
    }

    #[test]
    fn a_wrong_key_names_its_line() {
        let error = read("stamp = \"log\"\n[maps]\nq = \"/a\"\n").err().unwrap().to_string();
        assert!(error.contains(".toml:2: unknown field `maps`"), "{error}");
        assert!(
            read("[offset]\nx = \"later\"\n")
                .err()
                .unwrap()
                .to_string()
                .contains(":2: expected a number of seconds or \"auto\"")
        );
    }
}
