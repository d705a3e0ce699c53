//! The names of regressions, targets and choices: every surface reads them here.

use crate::differentiate::{Differentiation, SecondStage};
use crate::error::{Error, Result};
use crate::identify::settings::{Choice, Target};
use crate::regress::{Lasso, LeastSquares, Regressor, Selection, SqrtLasso, Ssr, Stlsq, Subset};
use std::str::FromStr;
use std::sync::Arc;

/// A sparse regression with its default settings, by name.
///
/// ```
/// use gpsindy_core::Regression;
/// assert_eq!("stlsq".parse::<Regression>()?, Regression::Stlsq);
/// assert!("lars".parse::<Regression>().unwrap_err().to_string().contains("known: subset"));
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Regression {
    /// [`Subset`].
    Subset,
    /// [`Lasso`].
    Lasso,
    /// [`SqrtLasso`].
    SqrtLasso,
    /// [`Stlsq`].
    Stlsq,
    /// [`Ssr::by_coefficient`].
    SsrCoefficient,
    /// [`Ssr::by_residual`].
    SsrResidual,
    /// [`LeastSquares`].
    LeastSquares,
}

impl Regression {
    /// Every name with its meaning.
    pub const NAMES: &'static [(&'static str, &'static str)] = &[
        ("subset", "Best subset with exchanges"),
        ("lasso", "LASSO by ADMM"),
        ("sqrt-lasso", "LASSO with an unsquared norm, as printed in the paper"),
        ("stlsq", "Sequentially thresholded least squares (SINDy)"),
        ("ssr-coefficient", "Stepwise sparse regression, smallest coefficient first"),
        ("ssr-residual", "Stepwise sparse regression, smallest increase of the residual first"),
        ("least-squares", "Least squares with all terms"),
    ];

    /// The regression.
    pub fn regressor(self) -> Arc<dyn Regressor> {
        match self {
            Self::Subset => Arc::new(Subset::default()),
            Self::Lasso => Arc::new(Lasso::default()),
            Self::SqrtLasso => Arc::new(SqrtLasso::default()),
            Self::Stlsq => Arc::new(Stlsq::default()),
            Self::SsrCoefficient => Arc::new(Ssr::by_coefficient()),
            Self::SsrResidual => Arc::new(Ssr::by_residual()),
            Self::LeastSquares => Arc::new(LeastSquares),
        }
    }
}

impl FromStr for Regression {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Ok(match name {
            "subset" => Self::Subset,
            "lasso" => Self::Lasso,
            "sqrt-lasso" => Self::SqrtLasso,
            "stlsq" => Self::Stlsq,
            "ssr-coefficient" => Self::SsrCoefficient,
            "ssr-residual" => Self::SsrResidual,
            "least-squares" => Self::LeastSquares,
            other => return Err(unknown("regressor", other, Self::NAMES)),
        })
    }
}

impl Target {
    /// Every name with its meaning.
    pub const NAMES: &'static [(&'static str, &'static str)] = &[
        ("weak", "Weak form: integrals of the terms, no derivatives"),
        ("gp-state", "Derivative of a Gaussian process over the smoothed states (the paper's second stage)"),
        ("gp-control", "As gp-state, over the controls"),
        ("gp-time", "Derivative of the Gaussian process over time, with its covariance"),
        ("difference", "Central differences on any grid"),
        ("given", "Only the derivatives in the logs"),
    ];
}

impl FromStr for Target {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Ok(match name {
            "weak" => Self::Weak,
            "gp-state" => Self::Derivative(Differentiation::GpState(SecondStage::default())),
            "gp-control" => Self::Derivative(Differentiation::GpControl(SecondStage::default())),
            "gp-time" => Self::Derivative(Differentiation::GpTime),
            "difference" => Self::Derivative(Differentiation::Central),
            "given" => Self::Derivative(Differentiation::Given(Vec::new())),
            other => return Err(unknown("derivative_method", other, Self::NAMES)),
        })
    }
}

impl Choice {
    /// Every name with its meaning.
    pub const NAMES: &'static [(&'static str, &'static str)] = &[
        ("cv", "Cross-validation with the one-standard-error rule"),
        ("cv-best", "Cross-validation, smallest error"),
        ("bic", "Bayesian information criterion"),
        ("rollout", "Rollout error"),
    ];
}

impl FromStr for Choice {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Ok(match name {
            "cv" => Self::Rows(Selection::default()),
            "cv-best" => Self::Rows(Selection::CrossValidation { one_standard_error: false }),
            "bic" => Self::Rows(Selection::Bic { noise: None }),
            "rollout" => Self::Rollout,
            other => return Err(unknown("select", other, Self::NAMES)),
        })
    }
}

fn unknown(kind: &str, name: &str, known: &[(&str, &str)]) -> Error {
    Error::unknown(kind, name, known.iter().map(|(name, _)| name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_that_is_told_can_be_read_and_no_other() {
        assert!(Regression::NAMES.iter().all(|(name, _)| name.parse::<Regression>().is_ok()));
        assert!(Target::NAMES.iter().all(|(name, _)| name.parse::<Target>().is_ok()));
        assert!(Choice::NAMES.iter().all(|(name, _)| name.parse::<Choice>().is_ok()));
        for error in ["x".parse::<Regression>().err(), "x".parse::<Target>().err(), "x".parse::<Choice>().err()] {
            assert!(error.unwrap().to_string().contains("`x` is unknown"));
        }
    }
}
