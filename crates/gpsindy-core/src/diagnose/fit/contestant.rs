//! A contestant: the nominal model with some hypotheses written into it, its fit to the training logs and the residual.

use crate::diagnose::catalogue::hypothesis::{Added, Applied, Hypothesis, Role};
use crate::diagnose::fit::evidence::Evidence;
use crate::diagnose::fit::guide::Guide;
use crate::error::Result;
use crate::model::batched::batched;
use crate::model::{Dynamics, Follower, Model, System};
use crate::parallel;
use crate::refine::{Experiment, Free, Jacobian, Kept, Path, Point, Refined, Tangent, tangent};
use std::sync::Arc;

/// How many starts the search tried that an effect was chosen from: its evidence must pay for all of them (Bonferroni).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Searches(usize);

impl Searches {
    /// Nothing was chosen: one model, one test.
    pub(crate) const NONE: Self = Self(1);

    pub(crate) fn of(starts: usize) -> Self {
        Self(starts.max(1))
    }

    /// Both searches.
    pub(crate) fn and(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }

    /// A chance found by the search, paid for.
    pub(crate) fn pay(self, chance: f64) -> f64 {
        (chance * self.0 as f64).min(1.0)
    }
}

/// An effect that enters a contestant, and the search that chose it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entrant<'a> {
    pub(crate) hypothesis: &'a Hypothesis,
    pub(crate) searches: Searches,
    /// Whether a fit in a round before looked for it by trial already.
    pub(crate) is_tried: bool,
}

impl<'a> Entrant<'a> {
    /// One that is still to be looked for by trial.
    pub(crate) fn new(hypothesis: &'a Hypothesis, searches: Searches) -> Self {
        Self { hypothesis, searches, is_tried: false }
    }
}

/// The nominal model with some hypotheses, and what its fit left over. Data only: [`Fitter`] makes it, [`Evidence`]
/// judges it.
///
/// [`Fitter`]: crate::diagnose::fit::fitter::Fitter
#[derive(Clone)]
pub(crate) struct Contestant {
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// The search that chose each hypothesis.
    pub(crate) searches: Vec<Searches>,
    /// Whether what no fit can walk to was looked for by trial, for each hypothesis: ends, instants, periods and exact forms. Beside the same
    /// effect with one more they are near, and only the best of a round is worth another look.
    pub(crate) tried: Vec<bool>,
    /// Parameters that each hypothesis brought: index in the model, and what is known of them.
    pub(crate) added: Vec<Vec<(usize, Added)>>,
    pub(crate) system: System,
    pub(crate) experiment: Experiment,
    /// Tolerated parameters first, then those of the hypotheses.
    pub(crate) free: Vec<Free>,
    pub(crate) refined: Refined,
    pub(crate) evidence: Evidence,
    /// Initial states that the windows' first samples determine, from which fits with more effects may begin; none where the fit's own serve.
    pub(crate) beginnings: Option<Arc<Vec<Vec<f64>>>>,
}

/// Whether the parameters that a hypothesis `added` are still to be looked for by trial. A level at rest is beside every other effect: any of
/// them moves where it is.
pub(crate) fn is_open(is_tried: bool, added: &[(usize, Added)]) -> bool {
    !is_tried || added.iter().any(|(_, added)| added.role == Role::AtRest)
}

/// A contestant with its residuals and their derivatives at its fit: where straight lines start.
pub(crate) struct Linearised<'a> {
    pub(crate) contestant: &'a Contestant,
    pub(crate) jacobian: Jacobian,
    /// The filter whose innovations replace residuals; none where these are of rollouts.
    pub(crate) guide: Option<Guide>,
    /// The path of the fit, where suspects' responses are straight lines from it.
    pub(crate) path: Option<Path>,
}

impl Contestant {
    /// `one` of every item, in their order, side by side: fits of models of this contestant's simulator, whose calls go together where it
    /// steps and takes one call at a time.
    pub(crate) fn each<T: Send, R: Send>(
        &self,
        items: Vec<T>,
        one: impl Fn(T) -> Result<R> + Send + Sync,
    ) -> Result<Vec<R>> {
        let is_shared =
            |simulator: &&Arc<dyn Dynamics>| simulator.steps().is_some_and(|engine| !engine.is_concurrent());
        match self.system.simulator().filter(is_shared) {
            Some(simulator) => batched(simulator, self.experiment.windows.len(), items, one),
            None => parallel::try_map(items, one),
        }
    }

    /// Number of states without those that hypotheses added (lagging inputs).
    pub(crate) fn nominal_states(&self) -> usize {
        self.system.n_states() - self.hypotheses.iter().map(Hypothesis::added_states).sum::<usize>()
    }

    /// Starts of states that hypotheses added, in each window: none where the log's past determines them.
    pub(crate) fn added_starts(&self) -> usize {
        self.system.n_states() - self.nominal_states() - self.system.followers().len()
    }

    /// Starts at the first samples of logs of states that hypotheses added and that follow the inputs from where the model has them, as a machine that
    /// is cold: what came before a log is not known, and they are fitted there.
    pub(crate) fn given_starts(&self) -> usize {
        let model = self.system.model();
        let is_given = |follower: &&Follower| model.initial.contains_key(&model.states[follower.state].name);
        let first = self.experiment.windows.iter().filter(|window| window.first == 0).count();
        first * self.system.followers().iter().filter(is_given).count()
    }

    /// The model with hypotheses written into it, and its parameters, those of the contestant where the fit has them.
    pub(crate) fn written(&self, applied: &Applied) -> Result<(System, Vec<f64>)> {
        let system = System::with_simulator(&applied.model, self.system.simulator().cloned())?;
        let system = system.with_followers(self.nominal_states())?;
        let (mut parameters, own) = (system.parameter_values(), &self.refined.parameters);
        parameters[..own.len()].copy_from_slice(own);
        Ok((system, parameters))
    }

    /// The model with the fitted values in place.
    pub(crate) fn model(&self) -> Model {
        let mut model = self.system.model().clone();
        for (parameter, &value) in model.parameters.iter_mut().zip(&self.refined.parameters) {
            parameter.value = value;
        }
        model
    }

    /// One of no effects with the parameters that are believed beforehand: what its rollouts made of these they made without a random force.
    pub(crate) fn believed(&self) -> Self {
        let mut believed = self.clone();
        if self.hypotheses.is_empty() {
            for (parameter, mean) in self.free.iter().filter_map(|f| Some((f.parameter, f.prior?.0))) {
                believed.refined.parameters[parameter] = mean;
            }
        }
        believed
    }

    /// Fitted values of the effect at `place`.
    pub(crate) fn values(&self, place: usize) -> Vec<f64> {
        self.added[place].iter().map(|(index, _)| self.refined.parameters[*index]).collect()
    }

    /// Names of what the effect at `place` is named for and the logs do not measure.
    pub(crate) fn unmeasured(&self, place: usize) -> Vec<String> {
        let is_unmeasured = |(index, added): &&(usize, Added)| added.is_unmeasured(self.refined.parameters[*index]);
        self.added[place].iter().filter(is_unmeasured).map(|(_, added)| added.symbol.clone()).collect()
    }

    /// The same with ends of a travel that the logs never reach far beyond them: on these logs no rollout differs.
    pub(crate) fn out_of_reach(mut self) -> Self {
        for (index, added) in self.added.iter().flatten() {
            if let Some(far) = added.out_of_reach(self.refined.parameters[*index]) {
                self.refined.parameters[*index] = far;
            }
        }
        self
    }

    /// Parameters of the hypotheses whose ends, levels and exact forms were not looked for by trial.
    pub(crate) fn untried(&self) -> impl Iterator<Item = &(usize, Added)> {
        self.added.iter().zip(&self.tried).filter(|(added, tried)| is_open(**tried, added)).flat_map(|(added, _)| added)
    }

    /// Free parameters of these that have a value beyond their lower ends, and that value.
    pub(crate) fn beyond(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let is_free = |index: usize| self.free.iter().any(|f| f.parameter == index);
        let all = self.untried().filter(move |(index, _)| is_free(*index));
        all.filter_map(|(index, added)| Some((*index, added.beyond()?)))
    }

    /// The same with all of that looked for.
    pub(crate) fn all_tried(mut self) -> Self {
        self.tried.fill(true);
        self
    }

    /// Corners of dry friction that holds at rest, as a fit would free them.
    pub(crate) fn held(&self) -> impl Iterator<Item = Free> + '_ {
        let is_free = |index: usize| self.free.iter().any(|f| f.parameter == index);
        let all = self.added.iter().flatten().filter(move |(index, added)| {
            added.role == Role::Corner && added.beyond() == Some(self.refined.parameters[*index]) && !is_free(*index)
        });
        all.map(|(index, added)| Free { lower: added.lower, upper: added.upper, ..Free::new(*index, added.scale) })
    }

    /// The effects at all places but those in `out`, with their values.
    pub(crate) fn entrants_without(&self, out: &[usize]) -> Vec<(Entrant<'_>, Vec<f64>)> {
        let kept = (0..self.hypotheses.len()).filter(|place| !out.contains(place));
        let entrant = |i: usize| Entrant::new(&self.hypotheses[i], self.searches[i]);
        kept.map(|i| (entrant(i), self.values(i))).collect()
    }

    /// Whether both have the same effects, in whatever order.
    pub(crate) fn has_effects_of(&self, other: &Self) -> bool {
        self.hypotheses.len() == other.hypotheses.len() && self.hypotheses.iter().all(|h| other.hypotheses.contains(h))
    }

    /// The largest search that chose an effect of this contestant which `simpler` lacks.
    ///
    /// Each list of starts is paid for once, where the effects that came from it are weighed; lists of earlier rounds
    /// were paid for when theirs entered.
    pub(crate) fn searches_beyond(&self, simpler: &Self) -> Searches {
        let new = self.hypotheses.iter().zip(&self.searches).filter(|(h, _)| !simpler.hypotheses.contains(h));
        new.map(|(_, &searches)| searches).max().unwrap_or(Searches::NONE)
    }

    /// The contestant that hands on derivatives at its fit, where there are any.
    pub(crate) fn with_derivatives(mut self, kept: Option<&Arc<Kept>>) -> Self {
        self.refined.kept = kept.cloned().or(self.refined.kept);
        self
    }

    /// The contestant with the derivatives of its outputs.
    ///
    /// # Errors
    /// A model that diverges at the fit.
    pub(crate) fn linearised(&self) -> Result<Linearised<'_>> {
        let point = Point { parameters: self.refined.parameters.clone(), initial: self.refined.initial.clone() };
        let jacobian = Jacobian::new(&self.system, &self.experiment, &point, &self.free)?;
        let Refined { parameters, initial, .. } = &self.refined;
        let path = Path::new(&self.system, &self.experiment, parameters, initial);
        Ok(Linearised { contestant: self, jacobian, guide: None, path })
    }
}

/// A contestant on a part of its windows, and what it shares of the whole's readings.
pub(crate) struct Sketch {
    contestant: Contestant,
    jacobian: Jacobian,
    guide: Option<Guide>,
    path: Option<Path>,
    pub(crate) share: f64,
}

impl Sketch {
    pub(crate) fn linearised(&self) -> Linearised<'_> {
        let (jacobian, guide, path) = (self.jacobian.clone(), self.guide.clone(), self.path.clone());
        Linearised { contestant: &self.contestant, jacobian, guide, path }
    }
}

impl Linearised<'_> {
    /// Derivatives along the path of a simulator that steps: along its rollouts, or a filter's; and which of their windows are those of the
    /// fit.
    pub(crate) fn lines(&self) -> Option<(Arc<Tangent>, Vec<usize>)> {
        let Contestant { system, experiment, refined: Refined { parameters, initial, .. }, .. } = self.contestant;
        match &self.guide {
            Some(Guide { tangent, .. }) => {
                Some((tangent.clone(), tangent.windows_of(experiment, parameters, initial)?))
            }
            None => tangent(system, experiment, parameters, initial),
        }
    }

    /// The same with that path, where the simulator steps.
    pub(crate) fn with_steps(mut self) -> Self {
        let Contestant { system, experiment, refined, .. } = self.contestant;
        if system.engine().is_some() {
            let point = (&refined.parameters[..], &refined.initial[..]);
            let path = |(tangent, windows): (Arc<Tangent>, Vec<usize>)| {
                Path::of_steps(system, experiment, point, (&tangent, &windows))
            };
            self.path = self.lines().and_then(path);
        }
        self
    }

    /// The same on evenly spread windows with no more than so many readings; nothing where that is no less.
    pub(crate) fn sketch(&self, readings: usize) -> Option<Sketch> {
        let Linearised { contestant, jacobian, guide, path } = self;
        let count = contestant.experiment.windows.len();
        let stride = contestant.experiment.n_values().div_ceil(readings.max(1));
        if stride < 2 || count < 2 * stride {
            return None;
        }
        let mut thin = (*contestant).clone();
        let places = || (0..count).step_by(stride);
        thin.experiment.windows = places().map(|w| contestant.experiment.windows[w]).collect();
        thin.refined.initial = places().map(|w| contestant.refined.initial[w].clone()).collect();
        thin.refined.residuals = places().map(|w| contestant.refined.residuals[w].clone()).collect();
        let blocks = places().map(|w| jacobian.blocks[w].clone()).collect();
        let share = thin.experiment.n_values() as f64 / contestant.experiment.n_values() as f64;
        let jacobian = Jacobian { blocks, n_states: jacobian.n_states };
        let guide = guide.as_ref().map(|Guide { tangent, whitening }| Guide {
            tangent: tangent.clone(),
            whitening: places().map(|w| whitening[w].clone()).collect(),
        });
        let path = path.as_ref().map(|path| path.of(places()));
        Some(Sketch { contestant: thin, jacobian, guide, path, share })
    }
}
