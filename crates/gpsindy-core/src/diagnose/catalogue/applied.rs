//! A model with hypotheses written into it: what they brought, and where a fit of it starts.

use crate::diagnose::limits::AT_END;
use crate::diagnose::limits::catalogue::FAR_OFF;
use crate::model::Model;

/// A parameter that a hypothesis adds to the model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Added {
    /// Its name in the catalogue's form.
    pub(crate) symbol: String,
    /// Its name in the model.
    pub(crate) name: String,
    pub(crate) unit: String,
    /// Size of a finite difference's typical value.
    pub(crate) scale: f64,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) role: Role,
}

/// How a parameter is fitted and reported other than by its plain value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// Nothing.
    Plain,
    /// An angle, which a reader has within a turn.
    Angle,
    /// The period of a sample-and-hold: the outputs jump when it moves, so it is found by trial. Its phase follows it.
    Period,
    /// The phase of a sample-and-hold.
    Phase,
    /// The speed within which dry friction turns around: beyond its lower end, where no fit can walk to, it is zero.
    Corner,
    /// The level of dry friction at rest, behind that in motion: the outputs jump when it moves, so it is found by trial.
    AtRest,
    /// When something happens, s: an extremum of its own in every rollout, so it is also looked for by trial.
    Instant,
    /// Delay of a command that a simulator holds over its own steps: the outputs jump from one step to the next, so it is found by trial.
    Late,
    /// How long something takes, or at what speed or frequency it happens. At an end of its range, which is that of what logs can show, its effect
    /// is another one that has no such scale, or none.
    Scale,
    /// An end of the travel, or a limit of a drive, above or below: one that the logs never reach stands at the end of their range, and is anywhere beyond.
    Above,
    Below,
}

impl Added {
    /// A value beyond one of its ends that no fit can walk to, and that is tried besides what a fit finds: dry friction without a corner, and
    /// an end of a travel that nothing reaches.
    pub(crate) fn beyond(&self) -> Option<f64> {
        let far = FAR_OFF * (self.upper - self.lower);
        match self.role {
            Role::Corner => Some(0.0),
            Role::Above => Some(self.upper + far),
            Role::Below => Some(self.lower - far),
            Role::Plain
            | Role::Angle
            | Role::Period
            | Role::Phase
            | Role::AtRest
            | Role::Instant
            | Role::Late
            | Role::Scale => None,
        }
    }

    /// Whether logs that lead to `value` do not measure it: a scale at an end of its range, or the corner of dry friction as wide as the motion.
    pub(crate) fn is_unmeasured(&self, value: f64) -> bool {
        let is_at = |end: f64| (value - end).abs() <= (1.0 - AT_END) * end.abs();
        match self.role {
            Role::Scale => is_at(self.lower) || is_at(self.upper),
            Role::Corner => is_at(self.upper),
            _ => false,
        }
    }

    /// Whether it is found by trial, and the fit leaves it where it is.
    pub(crate) fn is_tried(&self) -> bool {
        matches!(self.role, Role::Period | Role::Phase | Role::AtRest | Role::Late)
    }

    /// Whether a trial may find it where no fit can walk to.
    pub(crate) fn is_sought(&self) -> bool {
        self.is_tried() || matches!(self.role, Role::Above | Role::Below | Role::Instant) || self.beyond().is_some()
    }

    /// Where the end of a travel is that the logs never reached, which leaves it at `value`: far beyond them, so that a rollout of other
    /// logs does not meet it where only these logs end.
    pub(crate) fn out_of_reach(&self, value: f64) -> Option<f64> {
        let inside = (1.0 - AT_END) * (self.upper - self.lower);
        let is_out = match self.role {
            Role::Above => value >= self.upper - inside,
            Role::Below => value <= self.lower + inside,
            _ => false,
        };
        if is_out { self.beyond() } else { None }
    }

    /// A value as a reader should have it.
    pub(crate) fn stated(&self, value: f64) -> f64 {
        if self.role == Role::Angle { value.rem_euclid(std::f64::consts::TAU) } else { value }
    }
}

/// How the coefficients of a screening become start values of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Combine {
    /// Columns that are each proportional to the size of one parameter.
    Amplitude,
    /// Two columns, at phase zero and at a quarter turn: size and phase (first and last parameter).
    Sinusoid,
    /// Any number of columns, each proportional to a parameter of its own.
    Span,
    /// The column is no straight line in any parameter: start where it was made.
    Keep,
}

/// Start values of the added parameters: one or two columns of a screening.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Start {
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) combine: Combine,
    /// For [`Combine::Amplitude`]: which parameter each column moves, and at which value it does nothing.
    pub(crate) amplitudes: Vec<(usize, f64)>,
    /// Whether what a fit leaves points to it most: it is then fitted whatever its straight line promises.
    pub(crate) is_pointed: bool,
}

/// A model with a hypothesis written into it.
#[derive(Debug, Clone)]
pub(crate) struct Applied {
    pub(crate) model: Model,
    /// Parameters that are to be fitted: index in the model, and what is known of them.
    pub(crate) fitted: Vec<(usize, Added)>,
    /// How many of them each hypothesis brought.
    pub(crate) parts: Vec<usize>,
    pub(crate) starts: Vec<Start>,
}

impl Applied {
    /// The parameters that each hypothesis brought.
    pub(crate) fn each(&self) -> impl Iterator<Item = &[(usize, Added)]> {
        let mut rest = &self.fitted[..];
        self.parts.iter().map(move |&count| {
            let (own, later) = rest.split_at(count.min(rest.len()));
            rest = later;
            own
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_that_the_logs_never_reached_is_far_beyond_them_and_another_stays() {
        let end = |role| Added {
            symbol: "high".into(),
            name: "high".into(),
            unit: "m".into(),
            scale: 0.1,
            lower: 1.0,
            upper: 2.0,
            role,
        };
        assert_eq!(end(Role::Above).out_of_reach(2.0), Some(12.0));
        assert_eq!(end(Role::Below).out_of_reach(1.0), Some(-9.0));
        // What is far beyond stays there, and what was reached is where it is.
        assert_eq!(end(Role::Above).out_of_reach(12.0), Some(12.0));
        assert_eq!(end(Role::Above).out_of_reach(1.8), None);
        assert_eq!(end(Role::Below).out_of_reach(2.0), None);
        assert_eq!(end(Role::Plain).out_of_reach(2.0), None);
    }

    #[test]
    fn a_scale_at_an_end_of_its_range_is_not_measured() {
        let scale = |role| Added {
            symbol: "tau".into(),
            name: "tau".into(),
            unit: "s".into(),
            scale: 0.1,
            lower: 0.01,
            upper: 10.0,
            role,
        };
        let is_unmeasured = |role, value| scale(role).is_unmeasured(value);
        assert!(is_unmeasured(Role::Scale, 10.0) && is_unmeasured(Role::Scale, 0.01));
        assert!(!is_unmeasured(Role::Scale, 9.5) && !is_unmeasured(Role::Scale, 0.0105));
        // The sharpest corner is dry friction itself.
        assert!(is_unmeasured(Role::Corner, 10.0) && !is_unmeasured(Role::Corner, 0.01));
        assert!(!is_unmeasured(Role::Plain, 10.0));
    }
}
