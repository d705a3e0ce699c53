//! Notes of a diagnosis: what its reader must know besides the numbers.

/// Something that a diagnosis did, or met, that its reader must know. [`std::fmt::Display`] says it in a sentence.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// The angle in this column jumped by full turns and was unwrapped.
    Unwrapped {
        /// The column.
        column: String,
    },
    /// Isolated spikes were left out.
    Outliers {
        /// How many.
        count: usize,
    },
    /// One sample in `stride` was used of logs that are far denser than their motion.
    Decimated {
        /// Every how many samples one was used.
        stride: usize,
    },
    /// The sensor of a column samples at moments of its own in each run.
    OwnClock {
        /// Name of the column.
        column: String,
    },
    /// Of logs that a simulator can't pass through within the time limit only the most exciting windows were used.
    Afforded {
        /// Samples of the logs.
        samples: usize,
        /// Samples that were used, and in how many windows.
        used: usize,
        /// Windows that were used.
        windows: usize,
    },
    /// Of long logs only the most exciting windows were used.
    Thinned {
        /// Samples of the logs.
        samples: usize,
        /// Length of a window, s.
        length: f64,
        /// Windows that the search used.
        windows: usize,
        /// Windows of the logs.
        of: usize,
    },
    /// Effects that would depend on a place, or a heading, that no rate of the model depends on: they are no suspects.
    PlaceRuledOut {
        /// The place.
        place: String,
        /// Their ids.
        effects: Vec<String>,
    },
    /// Effects that are no suspects, at some places at least, for what these lack.
    RuledOut {
        /// What they need, in words.
        needs: String,
        /// Their ids.
        effects: Vec<String>,
    },
    /// Only effects in these parts of the machine were suspects.
    OnlyParts {
        /// Their names.
        parts: Vec<String>,
    },
    /// Rollouts of the fits are shorter than the runs.
    Restarted {
        /// Their length, s.
        length: f64,
        /// Whether the model is a simulator that steps, whose rollouts grow only while it follows the logs within their noise.
        steps: bool,
    },
    /// Rollouts of the fits became longer once causes were in the model.
    Lengthened,
    /// No state moves in the held-out logs.
    StillHoldout,
    /// Where no gap was found, what is left of this column is several times the noise that samples show beside each other.
    SlowErrors {
        /// The column.
        column: String,
        /// How many times.
        times: f64,
    },
    /// A parameter with a tolerance is a cause.
    ChargedParameter {
        /// The parameter.
        name: String,
    },
    /// Every parameter is at its nominal value, because the tolerated ones together would take the gap up and none alone does.
    Pinned,
    /// The control is interpolated between its samples, not held.
    Interpolated,
    /// Held-out rollouts are shorter than the runs.
    HoldoutRestarted {
        /// Their length, s.
        length: f64,
    },
    /// These columns never move beyond their resolution in the held-out logs and those to learn from.
    Resting {
        /// The columns.
        columns: Vec<String>,
    },
    /// No effect of the catalogue explains a material part of the gap.
    NothingExplains,
    /// The size of a cause differs between parts of the logs.
    Disagreement {
        /// Its id.
        effect: String,
        /// The state that it acts on.
        state: String,
        /// The parts whose size is another one, in words.
        parts: Vec<String>,
    },
    /// The gap is as small as what an integrator leaves that steps otherwise.
    Small {
        /// Its root mean square as a share of the motion's.
        share: f64,
    },
    /// The same, where nothing explains it and no held-out rollout shows it: it counts as none.
    OfAnIntegrator {
        /// Its root mean square as a share of the motion's.
        share: f64,
    },
    /// What a cause is named for is at the end of what the logs can show.
    Unmeasured {
        /// Its id.
        effect: String,
        /// The state that it acts on.
        state: String,
        /// The parameters.
        parameters: Vec<String>,
    },
    /// The corrected model does not follow these columns in the held-out runs.
    NotFollowed {
        /// The columns.
        columns: Vec<String>,
    },
    /// A random force in a row is all that is left.
    RandomForce {
        /// State in whose equation it acts.
        state: String,
        /// Its standard deviation, in `unit`.
        deviation: f64,
        /// Unit of the state's rate.
        unit: String,
        /// Its correlation time, s.
        time: f64,
    },
    /// The errors of a sensor have a memory, and are all that is left besides random forces.
    ColouredNoise {
        /// The column.
        column: String,
        /// Standard deviation of these errors, in `unit`.
        deviation: f64,
        /// Unit of the column.
        unit: String,
        /// Their correlation time, s.
        time: f64,
    },
    /// The search ended before it was through, because time was up.
    TimeUp {
        /// The limit, s.
        seconds: f64,
    },
    /// The search ended before it was through, because somebody had waited long enough.
    Stopped {
        /// When, s.
        seconds: f64,
    },
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unwrapped { column } => write!(f, "column `{column}` jumps by full turns and was unwrapped"),
            Self::Outliers { count } => write!(f, "{count} isolated spike(s) in the logs were excluded as outliers"),
            Self::Decimated { stride } => {
                write!(f, "the sampling is far faster than the motion; the search used one sample in {stride}")
            }
            Self::OwnClock { column } => write!(
                f,
                "the sensor of column `{column}` samples at moments of its own in each run; the phase of a hold counts from there, so that the augmented model alone does not say when it samples"
            ),
            Self::Thinned { samples, length, windows, of } => write!(
                f,
                "the logs hold {samples} samples; the search used {windows} of {of} windows of {length:.3} s, half of them spread over the logs, half the most exciting ones"
            ),
            Self::Afforded { samples, used, windows } => write!(
                f,
                "the simulator is too slow for all logs within the time limit: {used} of {samples} samples were used, in {windows} windows; a longer limit uses more"
            ),
            Self::PlaceRuledOut { place, effects } => write!(
                f,
                "no rate of the model depends on `{place}`, so no effect that does was a suspect: {}",
                effects.join(", ")
            ),
            Self::RuledOut { needs, effects } => {
                write!(f, "suspected only where {needs}: {}", effects.join(", "))
            }
            Self::OnlyParts { parts } => {
                write!(f, "only effects in {} were suspects; what other parts cause is not reported", parts.join(", "))
            }
            Self::Restarted { length, steps: true } => write!(
                f,
                "the fits use rollouts of {length:.3} s; longer ones cost a simulator more, and are used while the nominal model follows the logs within their noise"
            ),
            Self::Restarted { length, steps: false } => write!(
                f,
                "the fits use rollouts of {length:.3} s; in longer ones the nominal model diverges from the logs or only accumulates its error"
            ),
            Self::Lengthened => {
                f.write_str("the corrected model follows the logs for longer, so its fit uses longer rollouts")
            }
            Self::StillHoldout => f.write_str(
                "no state moves in the held-out logs, so the closure is not informative; hold out other logs",
            ),
            Self::ChargedParameter { name } => write!(
                f,
                "the logs contradict the nominal value of parameter `{name}`; it is reported as a cause even if it stays within its tolerance"
            ),
            Self::Pinned => f.write_str("the tolerated parameters together would take the gap up, though none of them alone; causes were looked for with each of them at its nominal value"),
            Self::Interpolated => f.write_str(
                "the control looks interpolated between samples, not held, so no delay below one sample is claimed",
            ),
            Self::SlowErrors { column, times } => write!(
                f,
                "what is left of {column} is {times:.1} times the noise that its samples show beside each other, and is taken for a slow error of its sensor, because no suspect and no function explains it"
            ),
            Self::HoldoutRestarted { length } => write!(
                f,
                "held-out rollouts are {length:.3} s long; longer ones amplify any error of the initial state"
            ),
            Self::RandomForce { state, deviation, unit, time } => write!(
                f,
                "the equation of {state} is driven at random (rms {deviation:.3e} {unit}, correlation time {time:.3} s); rollouts can't follow that, and no function of states, controls or time explains it"
            ),
            Self::ColouredNoise { column, deviation, unit, time } => write!(
                f,
                "the noise of {column} is coloured (rms {deviation:.3e} {unit}, correlation time {time:.3} s): that explains what a white noise would leave, and no function of states, controls or time does better"
            ),
            Self::TimeUp { seconds } => write!(
                f,
                "the time limit of {seconds:.0} s ended the search early; the result is the best so far, and a longer search may find other causes"
            ),
            Self::Stopped { seconds } => write!(
                f,
                "the search was stopped after {seconds:.0} s; the result is the best so far, and a longer search may find other causes"
            ),
            Self::Resting { columns } => write!(
                f,
                "{}: these columns never move beyond their resolution; closure, shares and figures leave them out",
                columns.join(", ")
            ),
            Self::Disagreement { effect, state, parts } => write!(
                f,
                "the fitted size of {} in {state} differs in {} from the other parts of the logs; another effect may be the true cause",
                effect.replace('_', " "),
                parts.join(", ")
            ),
            Self::Small { share } => write!(
                f,
                "the gap is {share:.1e} of the motion, no more than an integrator with steps of a tenth of the sampling period leaves: where another simulator made the logs, its integrator may be the cause"
            ),
            Self::OfAnIntegrator { share } => write!(
                f,
                "the training logs differ from the nominal model by {share:.1e} of the motion, of the kind that integrators leave; held-out rollouts miss the logs by no more than noise does, so it counts as no gap"
            ),
            Self::Unmeasured { effect, state, parameters } => write!(
                f,
                "{} of {} in {state} is at the end of what these logs can show, so they do not distinguish it from a simpler effect",
                parameters.join(", "),
                effect.replace('_', " ")
            ),
            Self::NotFollowed { columns } => write!(
                f,
                "the corrected model does not follow {} in the held-out runs: its error is more than half of the motion",
                columns.join(", ")
            ),
            Self::NothingExplains => f.write_str("no effect of the catalogue explains a material part of the gap"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_note_names_an_option_of_a_surface() {
        let all = [
            Note::Unwrapped { column: "phi".into() },
            Note::Thinned { samples: 9, length: 1.0, windows: 1, of: 2 },
            Note::Afforded { samples: 9, used: 2, windows: 1 },
            Note::Restarted { length: 1.0, steps: true },
            Note::StillHoldout,
            Note::HoldoutRestarted { length: 1.0 },
            Note::ChargedParameter { name: "k".into() },
        ];
        assert!(all.iter().all(|note| !note.to_string().contains("--")));
    }
}
