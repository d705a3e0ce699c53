//! The settings of an online identification and their ranges.

use crate::data::Channel;
use crate::error::{Error, Result};
use crate::gp::Kernel;
use crate::library::{Constraints, LibrarySettings};
use crate::refine::Hold;
use crate::regress::{Regressor, Selection, Subset};
use std::sync::Arc;

/// Settings of an online identification.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `states`, `controls` | | | channels of a sample, in order |
/// | `angles` | none | | channels that are wrapped angles (rad); their jumps are removed |
/// | `library` | degree 3 | | candidate terms |
/// | `constraints` | none | | equations given, terms forbidden, signs |
/// | `kernels` | `matern52`, `matern32` | these two | tried on every state |
/// | `regressor` | best subset | | any [`Regressor`] |
/// | `selection` | cross-validation, one standard error | | how its tuning value is chosen; BIC until there are five stretches of time |
/// | `delays` | none | at least 0, s | (control, delay) pairs |
/// | `hold` | zero | | what controls do between samples |
/// | `memory` | `None` | above 0, s | time in which the weight of a row falls by 1/e; `None` forgets nothing |
/// | `window` | 1000 | at least 64 | samples that are kept: for hyperparameters, and to smooth the newest |
#[derive(Debug, Clone)]
pub struct OnlineSettings {
    /// States, in the order of a sample.
    pub states: Vec<Channel>,
    /// Controls, in the order of a sample.
    pub controls: Vec<Channel>,
    /// Names of the states and controls that are wrapped angles, rad.
    pub angles: Vec<String>,
    /// Candidate terms.
    pub library: LibrarySettings,
    /// What is known beforehand.
    pub constraints: Constraints,
    /// Kernels to try on every state.
    pub kernels: Vec<Kernel>,
    /// The sparse regression.
    pub regressor: Arc<dyn Regressor>,
    /// How its tuning value is chosen.
    pub selection: Selection,
    /// Control and its delay, s.
    pub delays: Vec<(String, f64)>,
    /// What controls do between samples.
    pub hold: Hold,
    /// Time in which the weight of a row falls by 1/e, s.
    pub memory: Option<f64>,
    /// Samples that are kept.
    pub window: usize,
}

impl Default for OnlineSettings {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            controls: Vec::new(),
            angles: Vec::new(),
            library: LibrarySettings::default(),
            constraints: Constraints::default(),
            kernels: vec![Kernel::Matern52, Kernel::Matern32],
            regressor: Arc::new(Subset::default()),
            selection: Selection::default(),
            delays: Vec::new(),
            hold: Hold::Zero,
            memory: None,
            window: 1000,
        }
    }
}

impl OnlineSettings {
    /// Delay of every control, s.
    pub(super) fn delay_values(&self) -> Vec<f64> {
        let of = |name: &str| self.delays.iter().find(|(c, _)| c == name).map_or(0.0, |(_, delay)| *delay);
        self.controls.iter().map(|c| of(&c.name)).collect()
    }

    /// Refuses what is out of range or contradicts itself.
    pub(super) fn check(&self) -> Result<()> {
        if self.states.is_empty() {
            return Err(Error::settings("no state named; say which columns are states"));
        }
        let names = || self.states.iter().chain(&self.controls).map(|c| c.name.as_str());
        for (i, name) in names().enumerate() {
            if names().take(i).any(|other| other == name) {
                return Err(Error::Duplicate { kind: "column".into(), name: name.into() });
            }
        }
        if let Some(angle) = self.angles.iter().find(|a| !names().any(|n| n == *a)) {
            return Err(Error::unknown("angle", angle, names()));
        }
        for (control, delay) in &self.delays {
            if !self.controls.iter().any(|c| c.name == *control) {
                return Err(Error::unknown("control", control, self.controls.iter().map(|c| &c.name)));
            }
            if !(*delay >= 0.0 && delay.is_finite()) {
                return Err(Error::range("delay", "at least 0 and finite, in s", delay));
            }
        }
        if let Some(kernel) = self.kernels.iter().find(|k| !matches!(k, Kernel::Matern32 | Kernel::Matern52)) {
            return Err(Error::range("kernel", "matern32 or matern52 where samples come one by one", kernel));
        }
        if let Some(memory) = self.memory.filter(|m| !(*m > 0.0 && m.is_finite())) {
            return Err(Error::range("memory", "above 0 and finite, in s", memory));
        }
        if self.window < 64 {
            return Err(Error::range("window", "at least 64 samples", self.window));
        }
        Ok(())
    }
}
