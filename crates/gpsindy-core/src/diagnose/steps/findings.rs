//! The results that steps pass on to later steps.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::forcing::CROWDED_LAW;
use crate::diagnose::limits::weigh::{CROWDED, DISTINGUISHED, TWINS};
use crate::diagnose::limits::{CERTAIN, FAR, MATERIAL, NO_REST, SUBSTITUTE};
use crate::diagnose::notes::Note;
use crate::diagnose::steps::attribution::survey::Summary;

/// Whether there is a gap.
#[derive(Debug, Clone)]
pub(crate) struct Detected {
    pub(crate) gap: bool,
    pub(crate) p_value: f64,
}

/// Structure that the winner leaves.
#[derive(Debug, Clone)]
pub(crate) struct Left {
    /// Mean squared residual (noise units) that a function without a name would still remove.
    pub(crate) energy: f64,
    /// Chance that noise alone would give as much.
    pub(crate) p_value: f64,
    /// Which of the rivals that function is, and the variables that it depends on.
    pub(crate) rival: usize,
    pub(crate) depends_on: Vec<String>,
}

/// What one effect of the winner is worth, and what else may stand in its place.
pub(crate) struct Seat {
    pub(crate) hypothesis: Hypothesis,
    /// Contestants that differ from the winner in this effect alone, the winner included; none of a function without a name.
    pub(crate) alternatives: Vec<Contestant>,
    /// Mean squared residual (noise units) that the effect removes, taken last.
    pub(crate) removed: f64,
}

/// What the contest found.
pub(crate) struct Outcome {
    pub(crate) best: Contestant,
    /// One for every effect of the winner, in its order.
    pub(crate) seats: Vec<Seat>,
    /// Where no effect convinced: single effects, best first.
    pub(crate) singles: Vec<Contestant>,
    /// What was fitted one move away from the winner.
    pub(crate) near: Vec<Contestant>,
    pub(crate) left: Option<Left>,
    /// Straight-line gain of every hypothesis at the winner.
    pub(crate) screened: Vec<Summary>,
}

impl Outcome {
    /// Whether an effect does most of what one of the winner's does, in its place: where the winner is not the whole truth, it may
    /// carry what that one carries, at a size of its own.
    pub(crate) fn may_carry(&self, hypothesis: &Hypothesis) -> bool {
        let is_it = |h: &Hypothesis| h.id() == hypothesis.id() && h.state == hypothesis.state;
        let carries = |seat: &Seat, fit: &Contestant| {
            let is_swap = !fit.hypotheses.contains(&seat.hypothesis) && fit.hypotheses.iter().any(is_it);
            is_swap && fit.evidence.misfit() < self.best.evidence.misfit() + SUBSTITUTE * seat.removed
        };
        let fits = |seat: &Seat| self.near.iter().chain(&seat.alternatives).any(|fit| carries(seat, fit));
        self.seats.iter().any(fits)
    }
}

impl Seat {
    /// Whether `fit`, one of the alternatives, can't be distinguished from the best of them, where a share `alone` of the values counts.
    pub(crate) fn is_twin(&self, fit: &Contestant, alone: f64) -> bool {
        let bic = |fit: &Contestant| -2.0 * fit.evidence.score_of(alone);
        let best = self.alternatives.iter().map(bic).fold(f64::INFINITY, f64::min);
        bic(fit) - best < TWINS || self.is_distinguished_by_the_engine_alone(fit)
    }

    /// Whether two numbers of a simulator that steps explain the logs alike, but for less than counts: its integrator may treat the one
    /// implicitly and the other not, as MuJoCo does the damping of a joint and `kv` of its servo, and a machine has no integrator.
    fn is_distinguished_by_the_engine_alone(&self, fit: &Contestant) -> bool {
        let winner = self.alternatives.iter().find(|one| one.hypotheses.contains(&self.hypothesis));
        let Some(winner) = winner.filter(|one| one.system.engine().is_some() && self.hypothesis.frees().is_some())
        else {
            return false;
        };
        let is_new = |h: &&Hypothesis| !winner.hypotheses.contains(h);
        let is_number = fit.hypotheses.iter().find(is_new).is_some_and(|h| h.frees().is_some());
        let (other, own) = (fit.evidence.misfit(), winner.evidence.misfit());
        is_number && other - own < (MATERIAL * own.min(1.0)).max(DISTINGUISHED * self.removed)
    }
}

/// How much likelier a chance is of what crowds near zero, as those of imitations and of structure do, than of what is spread
/// evenly.
pub(crate) fn crowding(chance: f64) -> f64 {
    crowded(chance, CROWDED)
}

/// The same where the chance of what crowds is distributed as its `power`.
fn crowded(chance: f64, power: f64) -> f64 {
    power * chance.clamp(1e-12, 1.0).powf(power - 1.0)
}

/// A random process as a report states it: of a force in a state's row, or of an error of its sensor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StatedProcess {
    pub(crate) state: usize,
    /// In the unit of the row or the column, and s.
    pub(crate) deviation: f64,
    pub(crate) time: f64,
    /// Covariance of the logarithms of its standard deviation and its correlation time.
    pub(crate) covariance: [[f64; 2]; 2],
}

/// Random processes that are all that is left.
#[derive(Debug, Clone)]
pub(crate) struct Forcing {
    pub(crate) forces: Vec<StatedProcess>,
    /// Coloured noise of sensors.
    pub(crate) errors: Vec<StatedProcess>,
    /// Chance that the best function without a name gains as much beside them by noise.
    pub(crate) p_value: f64,
}

impl Forcing {
    /// Probability that what is left is random: then the chance is spread evenly; that of structure crowds near zero, as the
    /// disagreement of imitations does.
    pub(crate) fn probability(&self) -> f64 {
        probability_of_random(self.p_value)
    }

    /// Whether the likelihood has a peak at every force. Along an unstable motion a filter without forces loses the logs by its own straight lines,
    /// and next to any force keeps them.
    pub(crate) fn is_determined(&self) -> bool {
        self.forces.iter().all(|force| force.covariance.iter().flatten().all(|value| value.is_finite()))
    }
}

/// The same, from the chance of as large a function besides the forces.
pub(crate) fn probability_of_random(p_value: f64) -> f64 {
    1.0 / (1.0 + crowded(p_value, CROWDED_LAW))
}

/// A nominal model, whether it has a gap, and what causes it.
pub(crate) struct Judged {
    /// The model that the winner is compared with: on the same windows, with the same parameters tolerated.
    pub(crate) nominal: Contestant,
    pub(crate) detected: Detected,
    /// Gain and degrees of freedom of every function without a name at the nominal model.
    pub(crate) nameless: Vec<(f64, usize)>,
    pub(crate) outcome: Outcome,
    /// Random forces that are all that the winner leaves.
    pub(crate) forcing: Option<Forcing>,
    /// Whether it was asked for them.
    pub(crate) was_asked_for_forces: bool,
    /// Columns of which the winner leaves an error of the sensor that lasts longer than differences of samples show.
    pub(crate) sensors: Vec<usize>,
    /// What the user should know of the way to it.
    pub(crate) notes: Vec<Note>,
}

impl Judged {
    /// The same where what the nominal model misses counts as none, and the reason.
    pub(crate) fn without_gap(mut self, reason: Note) -> Self {
        self.detected.gap = false;
        self.outcome.best = self.nominal.clone();
        self.outcome.seats.clear();
        self.outcome.left = None;
        self.forcing = None;
        self.notes.push(reason);
        self
    }

    /// With a gap where the nominal model leaves what no sensor's noise does, however coloured, whether or not anything explains it.
    pub(crate) fn with_structure(mut self) -> Self {
        let is_material = gap_size(&self.nominal, &self.nominal) > self.nominal.evidence.model_error;
        if self.forcing.is_none() && is_material && self.nominal.evidence.is_structured() {
            self.detected = Detected { gap: true, p_value: self.detected.p_value.min(CERTAIN) };
        }
        self
    }
}

/// Whether `best` removes a `share` of the gap beyond what `rest` does: of that of all values together, or of the columns' own, each
/// counting alike. A speed that misses by forty times its noise is nothing beside an angle that misses by a thousand, and yet has a cause.
pub(crate) fn counts(nominal: &Contestant, best: &Contestant, rest: &Contestant, share: f64) -> bool {
    let is_of_all = rest.evidence.misfit() - best.evidence.misfit() >= share * gap_size(nominal, best);
    is_of_all || removed_by_column(nominal, best, rest) >= share
}

/// The share of its gap that `best` removes beyond what `rest` does, a mean over the columns that miss by more than noise can.
fn removed_by_column(nominal: &Contestant, best: &Contestant, rest: &Contestant) -> f64 {
    let [nominal, best, rest] = [nominal, best, rest].map(|one| &one.evidence.colours);
    let columns = || nominal.iter().zip(best).zip(rest).filter(|((nominal, _), _)| nominal.variance() > FAR);
    let removed = columns().map(|((nominal, best), rest)| {
        let gap = nominal.variance() - best.variance().min(1.0);
        (rest.variance() - best.variance()) / gap
    });
    removed.sum::<f64>() / columns().count().max(1) as f64
}

/// Mean squared residual (noise units) that the nominal model leaves beyond noise.
pub(crate) fn gap_size(nominal: &Contestant, best: &Contestant) -> f64 {
    (nominal.evidence.misfit() - best.evidence.misfit().min(1.0)).max(NO_REST)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fixture::{drive, model_of};
    use crate::diagnose::limits::Budget;
    use crate::model::{Model, System};
    use crate::refine::Experiment;
    use faer::Mat;

    #[test]
    fn what_explains_a_column_counts_beside_one_that_misses_far_more() {
        // Two machines in one log, of which one is known a thousand times better than the other.
        let (drive, data) = drive(None, |x| x, 0.0, (2, 200));
        let twice = |run: &Run| Run {
            values: Mat::from_fn(run.n_samples(), 3, |i, c| run.values[(i, c.saturating_sub(1))]),
            ..run.clone()
        };
        let runs = data.runs().iter().map(twice).collect();
        let data = Dataset::new(["x", "v", "u"].map(Channel::new).into(), runs).unwrap();
        let fit = |first: &str, second: &str| {
            let model =
                Model { controls: drive.controls.clone(), ..model_of(&[("x", "m", first), ("v", "m", second)]) };
            let system = System::new(&model).unwrap();
            let experiment = Experiment::new(&system, &data, Some(&[1e-6, 1e-3])).unwrap();
            Fitter::default().nominal(system, experiment, Vec::new(), Budget::Rough).unwrap()
        };
        let (nominal, rest, best) = (fit("u - 1.5*x", "u - 1.5*v"), fit("u - x", "u - 1.5*v"), fit("u - x", "u - v"));
        let misfit = |one: &Contestant| one.evidence.misfit();
        assert!(misfit(&rest) - misfit(&best) < 0.01 * misfit(&nominal), "{} {}", misfit(&rest), misfit(&best));
        assert!(counts(&nominal, &best, &rest, 0.01));
        assert!(!counts(&nominal, &rest, &rest, 0.01));
    }

    #[test]
    fn a_force_at_which_the_likelihood_has_no_peak_is_not_determined() {
        let force =
            |variance: f64| StatedProcess { state: 1, deviation: 1e-3, time: 2.0, covariance: [[variance; 2]; 2] };
        let forcing = |forces| Forcing { forces, errors: vec![force(f64::NAN)], p_value: 0.5 };
        assert!(forcing(vec![force(0.2)]).is_determined());
        assert!(!forcing(vec![force(0.2), force(f64::NAN)]).is_determined());
    }
}
