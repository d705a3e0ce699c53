//! What the options of `gpsindy identify` choose between.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::str::FromStr;

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Preset {
    /// The defaults of every option
    Default,
    /// Algorithm 1 of the paper as it is stated, without refinement
    Paper,
    /// The pipeline behind the paper's tables as its authors ran it, slips included, on one log; --smoother none is their SINDy
    Author,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Smoothing {
    /// Gaussian process over time
    Gp,
    /// Samples as they are
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
