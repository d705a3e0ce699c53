//! Models as source code: LaTeX, SymPy, Python, C, Rust, Julia, Modelica.

mod c;
mod dialect;
mod julia;
mod latex;
mod modelica;
mod names;
mod program;
mod python;
mod rust;
mod stick;
mod sympy;

use super::Model;
use crate::error::{Error, Result};
use crate::expression::Expression;

/// A language that a model can be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
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

/// How a model is written as source.
///
/// | name | default | range | meaning |
/// |---|---|---|---|
/// | `full_digits` | `false` | | LaTeX: numbers with all their digits, not six; programs always have all |
///
/// ```
/// use gpsindy_core::{Export, Expression, Language, Model, State};
/// let decay = Model { states: vec![State::new("x", Expression::parse("-x/3")?)], ..Model::default() };
/// let source = Export { full_digits: true }.write(&decay, Language::Latex)?;
/// assert!(source.contains("\\dot{x} &= \\frac{-x}{3}"));
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Export {
    /// In LaTeX, numbers with all their digits; without it six. Programs always have all.
    pub full_digits: bool,
}

impl Export {
    /// The model as source in `language`.
    ///
    /// Ports are left out: they are zero.
    ///
    /// A right side has no modes: `stick` and `breakaway` become `tanh(z/w)`, or a `sign` that does not hold at rest, which a
    /// comment then says.
    ///
    /// A delay or a play becomes a function of the log's samples (C, Julia, Python, Rust), a shifted time
    /// (LaTeX, SymPy) or the language's own `delay` (Modelica). Names and units are free text of whoever wrote the
    /// model; they are in comments and strings, and nothing of them leaves those.
    ///
    /// # Errors
    /// As [`Model::check`]; [`Error::NotFinite`] for a number in an equation; [`Error::NotExportable`] for a play of
    /// something delayed that can't be put the other way round, a play in Modelica, and equations that call the
    /// user's own simulator.
    pub fn write(&self, model: &Model, language: Language) -> Result<String> {
        model.check()?;
        let (model, holds) = &stick::without_stick(&model.closed())?;
        check_numbers(model)?;
        let text = match language {
            Language::Latex => latex::write(model, self.full_digits),
            Language::Sympy => sympy::write(model),
            Language::Python => python::write(model),
            Language::C => c::write(model),
            Language::Rust => rust::write(model),
            Language::Julia => julia::write(model),
            Language::Modelica => modelica::write(model),
        }?;
        Ok(if *holds { stick::note(language) + &text } else { text })
    }
}

impl Model {
    /// The model as source in `language`, with the defaults of [`Export`].
    ///
    /// # Errors
    /// As [`Export::write`].
    pub fn export(&self, language: Language) -> Result<String> {
        Export::default().write(self, language)
    }
}

/// No language has a literal for an infinite number that all its compilers take.
fn check_numbers(model: &Model) -> Result<()> {
    for state in &model.states {
        for expression in std::iter::once(&state.equation).chain(&state.measured) {
            let mut is_finite = true;
            expression.visit(&mut |part| is_finite &= !matches!(part, Expression::Number(v) if !v.is_finite()));
            if !is_finite {
                return Err(Error::NotFinite { what: format!("a number in `{expression}` of state `{}`", state.name) });
            }
        }
    }
    Ok(())
}
