//! Models as source: LaTeX, SymPy, Python, C, Rust, Julia, Modelica.

mod c;
mod dialect;
mod julia;
mod latex;
mod modelica;
mod program;
mod python;
mod rust;
mod sympy;

use super::Model;
use crate::error::{Error, Result};

/// A language that a model can be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Language {
    /// The equations as an `align*` environment.
    Latex,
    /// SymPy symbols and equations.
    Sympy,
    /// Plain Python: rates for an integrator such as SciPy's, and a small simulator.
    Python,
    /// C99: rates, outputs and a small simulator.
    C,
    /// Rust without dependencies: rates, outputs and a small simulator.
    Rust,
    /// Julia: rates as DifferentialEquations.jl calls them, and a small simulator.
    Julia,
    /// A Modelica model.
    Modelica,
}

impl Language {
    /// Every target there is.
    pub const ALL: [Self; 7] =
        [Self::Latex, Self::Sympy, Self::Python, Self::C, Self::Rust, Self::Julia, Self::Modelica];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Latex => "latex",
            Self::Sympy => "sympy",
            Self::Python => "python",
            Self::C => "c",
            Self::Rust => "rust",
            Self::Julia => "julia",
            Self::Modelica => "modelica",
        }
    }

    /// The usual ending of a file's name, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Latex => "tex",
            Self::Sympy | Self::Python => "py",
            Self::C => "c",
            Self::Rust => "rs",
            Self::Julia => "jl",
            Self::Modelica => "mo",
        }
    }

    /// The target called `name`.
    ///
    /// # Errors
    /// [`Error::UnknownName`] that lists the targets.
    pub fn parse(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|t| t.name() == name.to_lowercase());
        found.ok_or_else(|| Error::unknown("target", name, Self::ALL.map(Self::name)))
    }
}

impl Model {
    /// The model as source in `target`.
    ///
    /// Ports are left out: they are zero.
    ///
    /// A delay or a play becomes a function of the log's samples (C, Julia, Python, Rust), a shifted time
    /// (LaTeX, SymPy) or the language's own `delay` (Modelica).
    ///
    /// # Errors
    /// As [`Model::check`]; a play of something delayed that can't be put the other way round; a play in
    /// Modelica; equations that call the user's own simulator.
    pub fn export(&self, target: Language) -> Result<String> {
        self.check()?;
        let closed = &self.closed();
        match target {
            Language::Latex => latex::write(closed),
            Language::Sympy => sympy::write(closed),
            Language::Python => python::write(closed),
            Language::C => c::write(closed),
            Language::Rust => rust::write(closed),
            Language::Julia => julia::write(closed),
            Language::Modelica => modelica::write(closed),
        }
    }
}
