//! Checks: what must hold of included causes before they are believed, each with its own chance where they are right.

use crate::diagnose::limits::CHANCE;
use crate::diagnose::limits::stability::DISAGREES;
use crate::diagnose::limits::verify::{HARM, LEAST_PERCENT, PERCENT};
use crate::diagnose::limits::weigh::{LEAST_REST, LIKELY, TYPICAL};
use crate::diagnose::report::{Check, Closure, Unexplained};
use crate::diagnose::steps::findings::{Left, Outcome};
use crate::diagnose::steps::verdict::stability::Stability;
use crate::diagnose::steps::verdict::typicality::Typicality;
use crate::diagnose::steps::verdict::verify::Verification;

/// What the checks of one diagnosis are made from.
pub(crate) struct Checked<'a> {
    pub(crate) outcome: &'a Outcome,
    pub(crate) unexplained: &'a Unexplained,
    pub(crate) stabilities: &'a [Option<Stability>],
    pub(crate) verification: &'a Verification,
    pub(crate) typicality: Option<&'a Typicality>,
    /// Where random forces are among the causes: the chance of as large a function besides them.
    pub(crate) forced: Option<f64>,
}

impl Checked<'_> {
    /// All checks that apply, in the contract's order.
    pub(crate) fn all(&self) -> Vec<Check> {
        let mut all = Vec::new();
        // No rollout follows a random force: its spread is checked in the place of the closure, and that causes with a name do no harm.
        all.extend(if self.forced.is_none() { Some(self.closure()) } else { self.no_harm() });
        all.extend(self.constancy());
        all.push(self.lack_of_fit());
        all.extend(self.typicality());
        all.extend(self.forced.is_some().then(|| self.spread()));
        all
    }

    fn closure(&self) -> Check {
        let Verification { closure, missed, .. } = self.verification;
        let p_value = 1.0 - self.verification.missed();
        let worst = missed.iter().max_by(|a, b| a.probability.total_cmp(&b.probability));
        let passed = p_value > 1.0 - LIKELY && closure.closed.is_some();
        let says = match (passed, worst, ratio(closure)) {
            (true, _, Some(ratio)) => {
                format!(
                    "Held-out rollouts miss the logs by {ratio:.2} times what the sensors' noise leaves, as they should."
                )
            }
            (false, Some(worst), Some(ratio)) => {
                format!(
                    "Held-out rollouts miss column {} by more than noise does; all columns by {ratio:.2} times it.",
                    worst.name
                )
            }
            _ => "A held-out rollout diverges, so that nothing can be said of what the causes close.".into(),
        };
        Check { id: "closure".into(), passed, p_value: Some(p_value), says }
    }

    /// None where no cause has a name, or where the nominal model diverges itself.
    fn no_harm(&self) -> Option<Check> {
        let closure = &self.verification.closure;
        let (passed, says) = harmless(closure.before?, closure.after);
        let is_named = !self.outcome.best.hypotheses.is_empty();
        is_named.then(|| Check { id: "closure".into(), passed, p_value: None, says: says.into() })
    }

    /// None where no size can be compared between parts of the logs.
    fn constancy(&self) -> Option<Check> {
        let known: Vec<(usize, &Stability)> =
            self.stabilities.iter().enumerate().filter_map(|(place, s)| Some((place, s.as_ref()?))).collect();
        let (place, worst) = known.into_iter().min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value))?;
        let name = self.outcome.best.hypotheses[place].id();
        let passed = worst.p_value >= DISAGREES;
        let is_within = worst.within.is_some_and(|within| within >= DISAGREES);
        let says = if passed {
            format!("The sizes agree between runs, ranges and times; {name} differs most, by no more than chance.")
        } else if is_within {
            format!(
                "The size of {name} differs between runs by more than chance, and keeps its value within them: it is the machine's, or the imitation of another cause."
            )
        } else {
            // Parts may differ together where none of them does alone.
            let parts = match worst.disagree.is_empty() {
                true => String::new(),
                false => format!(" ({})", worst.disagree.join("; ")),
            };
            format!("The size of {name} differs between parts of the logs{parts}: a right cause keeps its size.")
        };
        Some(Check { id: "constancy".into(), passed, p_value: Some(worst.p_value), says })
    }

    fn lack_of_fit(&self) -> Check {
        let left: Option<&Left> = self.outcome.left.as_ref();
        let is_none = self.unexplained.depends_on.is_empty() && self.unexplained.share < LIKELY;
        // A rest that only the simulated logs see is the business of their own check.
        let passed = is_none || left.is_some_and(|left| left.p_value >= CHANCE);
        let share = share_of_gap(self.unexplained.share);
        let says = match left {
            Some(left) if !passed => format!(
                "A function of {} would still explain {share}, more than noise alone leaves.",
                left.depends_on.join(" and ")
            ),
            Some(left) if left.p_value < CHANCE => {
                format!("A function of {} would explain {share}, too little to count.", left.depends_on.join(" and "))
            }
            _ => "No function of states, controls, their past or time explains more of the training logs.".into(),
        };
        Check { id: "lack_of_fit".into(), passed, p_value: left.map(|left| left.p_value).or(self.forced), says }
    }

    fn typicality(&self) -> Option<Check> {
        let Typicality { p_value, drawn } = *self.typicality?;
        let passed = p_value >= TYPICAL || self.unexplained.share < LEAST_REST;
        let says = match (p_value >= TYPICAL, passed) {
            (true, _) => {
                format!(
                    "Of {drawn} logs simulated with these causes, enough leave a residual as large as the one seen."
                )
            }
            (false, true) => format!(
                "Hardly one of {drawn} logs simulated with these causes leaves as large a residual, but it is too small to count."
            ),
            (false, false) => {
                format!(
                    "Hardly one of {drawn} logs simulated with these causes leaves a residual as large as the one seen."
                )
            }
        };
        Some(Check { id: "typicality".into(), passed, p_value: Some(p_value), says })
    }

    fn spread(&self) -> Check {
        let spread = self.verification.spread;
        let passed = spread.is_some_and(|spread| spread.covers());
        let says = match spread {
            Some(spread) => format!(
                "The predicted 95 % band holds {:.0} % of the held-out errors{}.",
                PERCENT * spread.within,
                if passed { "" } else { ", less than chance allows" }
            ),
            None => "No band could be predicted for the held-out errors.".into(),
        };
        Check { id: "spread".into(), passed, p_value: spread.map(|spread| spread.p_value), says }
    }
}

/// Whether causes beside a random force leave held-out rollouts no worse than without them; `after` is None where they diverge.
fn harmless(before: f64, after: Option<f64>) -> (bool, &'static str) {
    match after {
        Some(after) if after <= HARM * before => (
            true,
            "Held-out rollouts follow no random force; with the other causes they miss the logs by no more than without.",
        ),
        Some(_) => {
            (false, "With the causes that have a name held-out rollouts miss the logs by more than without them.")
        }
        None => (false, "With the causes that have a name a held-out rollout diverges, and without them it does not."),
    }
}

/// A share of the gap in words; one that would be printed as zero is said to be small.
fn share_of_gap(share: f64) -> String {
    let percent = PERCENT * share;
    if percent < LEAST_PERCENT {
        format!("less than {LEAST_PERCENT} % of the gap")
    } else {
        format!("{percent:.1} % of the gap")
    }
}

/// Held-out error of the corrected model over what noise leaves.
fn ratio(closure: &Closure) -> Option<f64> {
    Some(closure.after? / closure.floor?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_beside_a_random_force_do_harm_where_rollouts_get_worse_or_diverge() {
        assert!(harmless(2.0, Some(2.05)).0);
        assert!(!harmless(2.0, Some(2.2)).0);
        assert!(!harmless(2.0, None).0);
    }

    #[test]
    fn a_share_is_never_printed_as_nothing() {
        assert_eq!(share_of_gap(0.032), "3.2 % of the gap");
        assert_eq!(share_of_gap(0.001), "0.1 % of the gap");
        assert_eq!(share_of_gap(0.0004), "less than 0.1 % of the gap");
    }
}
