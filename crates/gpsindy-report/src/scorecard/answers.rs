//! The answers of a suite, `answers.toml`: the true effects of each case.

use gpsindy_core::{Error, Result};
use serde::Deserialize;

/// A suite's answers.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Suite {
    /// One entry a case.
    #[serde(rename = "case", default)]
    pub cases: Vec<Answer>,
}

/// The truth about one case. Keys that the score does not need are ignored.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Answer {
    /// The case's folder.
    pub id: String,
    /// What was put in; empty in a null case.
    #[serde(default)]
    pub effects: Vec<TrueEffect>,
    /// Names under which an effect counts as found, besides its own.
    #[serde(default)]
    pub accept: Vec<Accepted>,
    /// Outside the catalogue: effects of it that honestly cover a part.
    #[serde(default)]
    pub partial: Vec<Accepted>,
    /// States that count as the right place; empty: those of the effects.
    #[serde(default)]
    pub localise: Vec<String>,
    /// The catalogue holds the effects.
    #[serde(default = "yes")]
    pub in_catalogue: bool,
    /// What a fit of the true structure reaches.
    #[serde(default)]
    pub oracle: Oracle,
}

/// An effect that was put in.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct TrueEffect {
    /// Id.
    pub effect: String,
    /// The state in whose equation, or whose column, it acts.
    #[serde(default)]
    pub state: String,
    /// What it depends on, in any order.
    #[serde(default)]
    pub variables: Vec<String>,
}

/// Another name of an effect.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Accepted {
    /// The name.
    #[serde(flatten)]
    pub name: TrueEffect,
    /// Index of the effect that it names.
    #[serde(default)]
    pub of: usize,
}

/// What a fit of the true structure reaches on the held-out logs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
pub struct Oracle {
    /// Gap of noise-free rollouts in units of the noise.
    pub snr: Option<f64>,
    /// Part of the gap that it closes.
    pub closure_oracle: Option<f64>,
}

fn yes() -> bool {
    true
}

/// What a case asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing was put in.
    Null,
    /// One effect of the catalogue.
    Single,
    /// Two effects of the catalogue or more.
    Several,
    /// An effect that the catalogue lacks.
    Outside,
}

impl Answer {
    /// What the case asks, by what was put in.
    pub fn kind(&self) -> Kind {
        match self.effects.len() {
            0 => Kind::Null,
            _ if !self.in_catalogue => Kind::Outside,
            1 => Kind::Single,
            _ => Kind::Several,
        }
    }

    /// States that count as the right place.
    pub fn places(&self) -> Vec<&str> {
        if self.localise.is_empty() {
            self.effects.iter().map(|e| e.state.as_str()).collect()
        } else {
            self.localise.iter().map(String::as_str).collect()
        }
    }
}

impl Suite {
    /// Reads the text of `answers.toml`.
    ///
    /// # Errors
    /// [`Error::File`] for text that is no such file, an id that appears twice, or an `of` without its effect.
    pub fn from_toml(text: &str) -> Result<Self> {
        let suite: Self = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(0, |span| text[..span.start].matches('\n').count() + 1);
            Error::file(format!("answers.toml:{line}: {}", error.message().replace('\n', " ")))
        })?;
        for (i, case) in suite.cases.iter().enumerate() {
            if suite.cases[..i].iter().any(|other| other.id == case.id) {
                return Err(Error::Duplicate { kind: "case".into(), name: case.id.clone() });
            }
            if let Some(wrong) = case.accept.iter().find(|a| a.of >= case.effects.len()) {
                let (id, of, n) = (&case.id, wrong.of, case.effects.len());
                return Err(Error::file(format!(
                    "answers.toml: case `{id}` accepts a name for effect {of}, but has {n} effects; `of` counts from 0"
                )));
            }
        }
        Ok(suite)
    }
}
