//! Simulators that are files of an engine and no equations: who opens them, and what is asked of them.

use gpsindy_core::diagnose::{Diagnosed, Part};
use gpsindy_core::{Dynamics, Model};
use std::path::Path;
use std::sync::Arc;

/// What kind of simulator a file is, recognised by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileKind {
    /// A MuJoCo model: MJCF or URDF.
    MuJoCo,
    /// A functional mock-up unit.
    Fmu,
}

impl FileKind {
    /// Of a file that begins with `bytes`; none where it is to be read as equations.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"PK\x03\x04") {
            return Some(Self::Fmu);
        }
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        text.starts_with(b"<").then_some(Self::MuJoCo)
    }

    /// In words, with the extra of the Python package that steps it.
    #[must_use]
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::MuJoCo => ("a MuJoCo model (MJCF or URDF)", "mujoco"),
            Self::Fmu => ("an FMU", "fmu"),
        }
    }
}

/// What a simulator's file does not say: the driver's loops around motors, what holds a free base or a joint, and which inputs are forces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Setup {
    /// PD loops, by actuator.
    pub drivers: Vec<Driver>,
    /// How a free base moves; none where the file has no free base.
    pub base: Option<Base>,
    /// Joints that do not move.
    pub locks: Vec<Lock>,
    /// Inputs of an FMU that no log has.
    pub forces: Vec<Force>,
}

impl Setup {
    /// Whether nothing is said.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// A driver's PD loop around a motor: `kp (u - q) - kd dq/dt`, on a command that arrives late.
#[derive(Debug, Clone, PartialEq)]
pub struct Driver {
    /// The actuator; `*` and `?` stand for any characters and any one.
    pub actuator: String,
    /// kp, kd and the delay in s.
    pub values: [f64; 3],
    /// Which of these are guesses that the logs correct.
    pub guessed: [bool; 3],
}

/// A joint that does not move while others are tested.
#[derive(Debug, Clone, PartialEq)]
pub struct Lock {
    /// The joint; `*` and `?` stand for any characters and any one.
    pub joint: String,
    /// Where it is held, rad or m; none: where the file places it.
    pub position: Option<f64>,
}

/// An input that no log has: a place where a force may act.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Force {
    /// The input's name.
    pub input: String,
    /// The column of the state whose rate it changes.
    pub rate: String,
    /// The column of the state whose time derivative that is, if there is one.
    pub position: Option<String>,
}

/// How a free base moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// Not at all: it is on a stand, as the file places it.
    Fixed,
    /// As logged: orientation, rates and their derivatives.
    Imu,
    /// As logged: position, velocity and acceleration, too.
    Pose,
}

impl Base {
    /// The word for it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Imu => "imu",
            Self::Pose => "pose",
        }
    }
}

/// Opens simulators.
pub trait Engines: Sync {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// What is wrong and what to do, in one line without the file's name.
    fn open(&self, kind: FileKind, path: &Path, setup: &Setup) -> Result<Box<dyn Engine>, String>;
}

/// A simulator that was opened.
pub trait Engine: Sync {
    /// Names of its states, controls, ports and parameters.
    fn model(&self) -> &Model;

    /// Its joints and actuators; empty where it does not name them.
    ///
    /// # Errors
    /// What the engine raised.
    fn parts(&self) -> Result<Vec<Part>, String>;

    /// Its steps.
    fn dynamics(&self) -> Arc<dyn Dynamics>;

    /// Runs `work`, which steps it, on the thread from which that costs least.
    fn within(&self, work: Box<dyn FnOnce() + Send + '_>);

    /// What it raised within the work, if it did.
    fn failure(&self) -> Option<String>;

    /// Its file with the corrections of `model` in it, to be written into `folder`.
    ///
    /// # Errors
    /// Why there is none.
    fn corrected(&self, model: &Model, folder: &Path) -> Result<Corrected, String>;

    /// Further files of a diagnosis of it, name and text, such as ranges for training.
    ///
    /// # Errors
    /// Why there is none.
    fn beside(&self, diagnosed: &Diagnosed) -> Result<Vec<(String, String)>, String>;
}

/// A corrected file of an engine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Corrected {
    /// Name without folder.
    pub name: String,
    /// Content.
    pub text: String,
    /// Lines that changed, as in `diff -u`.
    pub difference: Vec<String>,
}

/// No engine: the program as Rust's own package manager installs it.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoEngines;

impl Engines for NoEngines {
    fn open(&self, kind: FileKind, _path: &Path, _setup: &Setup) -> Result<Box<dyn Engine>, String> {
        let (what, extra) = kind.words();
        Err(format!("{what}, which only the command of the Python package steps; pip install 'gpsindy[{extra}]'"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_told_by_its_content() {
        for (bytes, kind) in [
            (&b"<mujoco/>"[..], Some(FileKind::MuJoCo)),
            (b"\xef\xbb\xbf\n  <?xml version='1.0'?><robot/>", Some(FileKind::MuJoCo)),
            (b"PK\x03\x04more", Some(FileKind::Fmu)),
            (b"schema = \"gpsindy.model/1\"", None),
            (b"{\"schema\": 1}", None),
            (b"", None),
        ] {
            assert_eq!(FileKind::of(bytes), kind);
        }
    }
}
