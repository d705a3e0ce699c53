//! Notes of an identification, as data; surfaces add the names of their own options.

use crate::gp::Weakness;
use crate::identify::limits::outlook::SHOWN;
use crate::identify::outlook::Exchange;
use std::fmt;

/// A remark about an identification.
///
/// `Display` says it in a sentence without the name of any option.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// The logs are longer than an identification needs.
    Excerpt {
        /// Samples of the training part.
        samples: usize,
        /// Samples that were learnt from.
        used: usize,
        /// Windows that were learnt from.
        windows: usize,
        /// Windows of the same length in the training part.
        of: usize,
    },
    /// The smoothing of a column is weak.
    WeakSmoothing {
        /// The column.
        column: String,
        /// Why.
        reasons: Vec<Weakness>,
    },
    /// The second Gaussian process of a state was fitted to a part of its points.
    ThinnedSecondStage {
        /// The state.
        state: String,
    },
    /// A velocity that no log carries was taken from the slope of a position.
    UnloggedVelocity {
        /// The velocity.
        velocity: String,
        /// Its position.
        position: String,
    },
    /// A state that no log carries was taken from the given equation of another.
    Hidden {
        /// The state.
        state: String,
        /// The state whose equation it was.
        from: String,
    },
    /// A column stays at its largest or smallest value.
    AtItsEnd {
        /// The column.
        column: String,
        /// The value.
        value: f64,
        /// Whether it is the largest one.
        largest: bool,
        /// Share of the samples, from 0 to 1.
        share: f64,
    },
    /// A free number ended at a bound of its range.
    AtBound {
        /// The number.
        number: String,
        /// Its value.
        value: f64,
    },
    /// A state is a straight line of time.
    LineOfTime {
        /// The state.
        state: String,
    },
    /// The terms are those of the regression: the terms of the best evidence predict whole runs less well.
    TermsKept {
        /// Highest degree of the library that they came from, where it is below the one asked for.
        degree: Option<usize>,
        /// Whether their coefficients are those of the regression, too.
        unrefined: bool,
    },
    /// The equations are those of the regression, since the refinement could not run.
    NotRefined {
        /// Why.
        reason: String,
    },
    /// Terms of a larger library than asked for, since those asked for left more than the noise.
    Grown {
        /// The further terms that the equations hold.
        terms: Vec<String>,
    },
    /// The refinement stopped before it came to rest.
    Restless,
    /// Equations were chosen by their long rollouts and by agreement, not by the evidence alone.
    Consensus {
        /// Number of sets of equations that were compared.
        members: usize,
    },
    /// Small differences outgrow everything within this time.
    Unpredictable {
        /// The time, s.
        within: f64,
    },
    /// Fitted to the first part of the logs, the equations do not foretell the last part, whose states are new.
    Beyond,
    /// Other equations explain the logs about as well, and predict something else from other starts.
    Open {
        /// Share of the predictions, from 0 to 1.
        share: f64,
        /// Terms that could take each other's place.
        exchangeable: Vec<Exchange>,
    },
    /// The equations diverge from starts in and around what was logged.
    Diverging {
        /// Share of the starts, from 0 to 1.
        share: f64,
    },
    /// A difference of the size of the noise outgrows the motion.
    Unstable {
        /// Share of the starts, from 0 to 1.
        share: f64,
    },
    /// The controls look interpolated between samples.
    Interpolated,
}

/// Percents of a whole. Exact.
const PERCENTS: f64 = 100.0;

fn percent(share: f64) -> String {
    format!("{:.0} %", PERCENTS * share)
}

/// A value with three significant digits.
fn significant(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Excerpt { samples, used, windows, of } => write!(
                f,
                "of {samples} samples, {used} were learnt from: {windows} of {of} windows, half of them spread over the logs, half the most exciting ones"
            ),
            Self::WeakSmoothing { column, reasons } => {
                let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
                write!(f, "smoothing of `{column}`: {}", reasons.join("; "))
            }
            Self::ThinnedSecondStage { state } => {
                write!(f, "second Gaussian process of `{state}`: {}", Weakness::Thinned)
            }
            Self::UnloggedVelocity { velocity, position } => write!(
                f,
                "`{velocity}` is not in the logs; the regression uses the slope of `{position}` for it, and the refinement compares `{position}` only"
            ),
            Self::Hidden { state, from } => write!(
                f,
                "`{state}` is not in the logs; its start values are those with which the given equation of `{from}` holds, and the refinement compares `{from}` only"
            ),
            Self::AtItsEnd { column, value, largest, share } => write!(
                f,
                "`{column}` stays at its {} value, {value}, in {} of the samples: if its sensor ends there, give its range",
                if *largest { "largest" } else { "smallest" },
                percent(*share)
            ),
            Self::AtBound { number, value } => write!(
                f,
                "`{number}` ended at a bound of its range, {}: these logs do not give its value, they only bound it; log what shows it, or name another range",
                significant(*value)
            ),
            Self::LineOfTime { state } => {
                write!(
                    f,
                    "`{state}` is a linear function of time; a clock or a row number is not a state, so leave it out"
                )
            }
            Self::TermsKept { degree, unrefined } => {
                let what = if *unrefined { "the equations" } else { "the terms" };
                match degree {
                    Some(degree) => write!(
                        f,
                        "{what} are those of a regression with degree {degree}; they predict whole runs better than those of the larger library"
                    ),
                    None => write!(
                        f,
                        "{what} are those of the regression; those with the best evidence in short rollouts predict whole runs less well"
                    ),
                }
            }
            Self::NotRefined { reason } => write!(f, "no refinement by simulation: {reason}"),
            Self::Grown { terms } => write!(
                f,
                "a larger library explains the logs better than the terms asked for, with {}",
                if terms.is_empty() { "fewer terms".into() } else { terms.join(", ") }
            ),
            Self::Restless => f.write_str("the refinement stopped before it converged"),
            Self::Consensus { members } => write!(
                f,
                "the equations are an approximation: of {members} candidates, these predict long rollouts best and agree most with the others; the evidence of short rollouts alone would select another candidate"
            ),
            Self::Unpredictable { within } => write!(
                f,
                "small differences grow a million times within {within:.3} s: the motion is unstable or chaotic, so rollouts over whole logs are a poor test of the equations"
            ),
            Self::Beyond => f.write_str(
                "fitted to the first three quarters of the logs, the equations predict the last quarter, whose states are new, worse than its mean; use them within the logged range only",
            ),
            Self::Open { share, exchangeable } => {
                write!(
                    f,
                    "equations that explain the logs as well predict something else in {} of the runs that start in or around what was logged; log runs from other starts",
                    percent(*share)
                )?;
                let shown = exchangeable.iter().take(SHOWN);
                let pairs: Vec<String> =
                    shown.map(|e| format!("`{}` for `{}` in {}'", e.other, e.term, e.state)).collect();
                if pairs.is_empty() { Ok(()) } else { write!(f, " (it may be {})", pairs.join(", ")) }
            }
            Self::Diverging { share } => write!(
                f,
                "the equations diverge from {} of the starts in and around what was logged; use them near the logged motion only, or log runs from other starts",
                percent(*share)
            ),
            Self::Unstable { share } => write!(
                f,
                "differences of the size of the noise outgrow the motion from {} of the starts in and around what was logged: the motion is unstable or chaotic there, so no equations predict whole runs",
                percent(*share)
            ),
            Self::Interpolated => f.write_str("the controls look interpolated between samples, not held"),
        }
    }
}
