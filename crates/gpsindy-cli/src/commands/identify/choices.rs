//! Values of the options of `gpsindy identify`.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::str::FromStr;

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Preset {
    /// The default of every option
    Default,
    /// Algorithm 1 as stated in the paper, without refinement
    Paper,
    /// The pipeline behind the paper's tables as its authors ran it, including its slips, on one log; with --smoother none their SINDy
    Author,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Smoothing {
    /// Gaussian process over time
    Gp,
    /// No smoothing
    None,
}

/// Reads a value by one of these names; the second of each pair is its help.
pub(super) fn named<T>(names: &'static [(&'static str, &'static str)]) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err = gpsindy_core::Error> + Clone + Send + Sync + 'static,
{
    let values = names.iter().map(|(name, help)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<T>())
}
