//! Options of the candidate terms, and of what is known of the equations beforehand.

use crate::failure::{Failure, Outcome};
use clap::{Args, ValueEnum};
use gpsindy_core::SensorRange;
use gpsindy_core::library::{Constraints, Fixed, Forbidden, FreeNumber, Kept, LibrarySettings, Signed};

#[derive(Debug, Args)]
#[command(next_help_heading = "Candidate terms")]
pub(crate) struct LibraryOptions {
    /// Whether more candidate terms are tried where these leave more than the noise [default: auto; given, if --trig, --products or --term
    /// names terms]
    #[arg(long, value_name = "LIBRARY")]
    pub(super) library: Option<LibraryChoice>,
    /// Highest polynomial degree, 0 to 9
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = degree, allow_hyphen_values = true)]
    pub(super) degree: usize,
    /// Add sine and cosine of every state and control
    #[arg(long)]
    pub(super) trig: bool,
    /// Add products of sine and cosine with polynomials of degree 1 and 2
    #[arg(long)]
    pub(super) products: bool,
    /// Add a term, such as 'v*abs(v)'
    #[arg(long, value_name = "EXPR")]
    pub(super) term: Vec<String>,
    /// Estimate a number in a --term or --fix, such as h in 'x/(h + x)'; the search begins at START, or at several values and stays between LOW
    /// and HIGH [default: where the logs can show it, by what it is compared with; else begins between 0.01 and 100, ends anywhere]
    #[arg(long, value_name = "NAME[=START|=LOW:HIGH]", value_delimiter = ',', allow_hyphen_values = true)]
    pub(super) free: Vec<String>,
    /// The values that a state's sensor can show, such as y=0:10 or y=:10; at an end the state is there or beyond
    #[arg(long, value_name = "STATE=LOW:HIGH")]
    pub(super) range: Vec<String>,
    /// Fix a known equation, such as "x' = v" or "y' = sqrt(h) - b*sqrt(y)"; v and h need not be in the logs then
    #[arg(long, value_name = "EQUATION")]
    pub(super) fix: Vec<String>,
    /// Exclude a term from an equation, such as v:x^2
    #[arg(long, value_name = "STATE:TERM")]
    pub(super) forbid: Vec<String>,
    /// Always keep a term in an equation, such as v:u; its coefficient is estimated
    #[arg(long, value_name = "STATE:TERM")]
    pub(super) keep: Vec<String>,
    /// Constrain the sign of a coefficient, such as v:v=-
    #[arg(long, value_name = "STATE:TERM=SIGN", allow_hyphen_values = true)]
    pub(super) sign: Vec<String>,
}

/// Which candidate terms there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LibraryChoice {
    /// Also sine, cosine, sign, v*abs(v), log, sqrt, 1/v and x/(h + x), where the evidence for them leaves no doubt
    Auto,
    /// Only the terms that the other options name
    Given,
}

impl LibraryOptions {
    /// Whether more terms may be tried.
    pub(crate) fn may_grow(&self) -> bool {
        let names_terms = self.trig || self.products || !self.term.is_empty();
        self.library.map_or(!names_terms, |choice| choice == LibraryChoice::Auto)
    }

    /// The ranges of sensors.
    pub(super) fn ranges(&self) -> Outcome<Vec<SensorRange>> {
        let parse = |text: &String| SensorRange::parse(text).map_err(|e| Failure::input(format!("--range: {e}")));
        self.range.iter().map(parse).collect()
    }

    /// Candidate terms, and what is known of the equations beforehand.
    pub(crate) fn settings(&self) -> Outcome<(LibrarySettings, Constraints)> {
        let parse = |text: &String| FreeNumber::parse(text).map_err(|e| Failure::input(format!("--free: {e}")));
        let library = LibrarySettings {
            degree: self.degree,
            trig: self.trig,
            products: self.products,
            extra: self.term.clone(),
            numbers: self.free.iter().map(parse).collect::<Outcome<_>>()?,
            ..LibrarySettings::default()
        };
        let mut constraints = Constraints::default();
        for text in &self.fix {
            constraints.fixed.push(Fixed::parse(text).map_err(|e| Failure::input(format!("--fix: {e}")))?);
        }
        for text in &self.forbid {
            constraints.forbidden.push(Forbidden::parse(text).map_err(|e| Failure::input(format!("--forbid: {e}")))?);
        }
        for text in &self.keep {
            constraints.kept.push(Kept::parse(text).map_err(|e| Failure::input(format!("--keep: {e}")))?);
        }
        for text in &self.sign {
            constraints.signed.push(Signed::parse(text).map_err(|e| Failure::input(format!("--sign: {e}")))?);
        }
        Ok((library, constraints))
    }
}

/// A degree as text.
fn degree(text: &str) -> Result<usize, String> {
    let degree = text.parse::<usize>().ok().filter(|degree| *degree <= 9);
    degree.ok_or_else(|| "expected a whole number from 0 to 9".into())
}
