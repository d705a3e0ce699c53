//! What the options of `gpsindy identify` choose between.

use clap::ValueEnum;

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Preset {
    /// Our best
    Default,
    /// Algorithm 1 of the paper as it is stated, without a second fit
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

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum DerivativeMethod {
    /// Derivative of a Gaussian process over the smoothed states (the paper's second stage)
    GpState,
    /// The same over the controls
    GpControl,
    /// Derivative of the Gaussian process over time, with its covariance
    GpTime,
    /// Integrals of the terms; nothing is differentiated
    Weak,
    /// Central differences, any grid
    Difference,
    /// The columns of --derivative alone
    Given,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Regression {
    /// Best subset with exchanges
    Subset,
    /// LASSO by ADMM
    Lasso,
    /// LASSO with the unsquared norm that the paper prints
    SqrtLasso,
    /// Sequentially thresholded least squares (SINDy)
    Stlsq,
    /// Stepwise sparse regression, smallest coefficient first
    SsrCoefficient,
    /// Stepwise sparse regression, smallest increase of the residual first
    SsrResidual,
    /// Least squares with all terms
    LeastSquares,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Select {
    /// Cross-validation with the one-standard-error rule
    Cv,
    /// Bayesian information criterion
    Bic,
    /// Error of rollouts
    Rollout,
}
