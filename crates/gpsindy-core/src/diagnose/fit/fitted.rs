//! A model with hypotheses in it, fitted to the training logs: one contestant.

use crate::diagnose::catalogue::hypothesis::{Added, Applied, Hypothesis};
use crate::diagnose::fit::evidence::{Colour, colours, log_likelihood};
use crate::diagnose::fit::lagging::with_lagging;
use crate::error::Result;
use crate::model::{Model, System};
use crate::refine::{Experiment, Free, Jacobian, Past, Point, Refine, Refined, Starts, Window, costs, prior_cost};

/// Mean squared residual (noise units) that no sensor's noise has, however coloured: innovations of one, a coefficient of 0.975.
const FAR: f64 = 20.0;

/// Samples that tell where a window starts.
const FIRST: usize = 2;

/// A contestant: the nominal model with some hypotheses, and what its fit left over.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Parameters that each hypothesis brought: index in the model, and what is known of them.
    pub(crate) added: Vec<Vec<(usize, Added)>>,
    pub(crate) system: System,
    pub(crate) experiment: Experiment,
    /// Tolerated parameters first, then those of the hypotheses.
    pub(crate) free: Vec<Free>,
    pub(crate) refined: Refined,
    pub(crate) jacobian: Jacobian,
    pub(crate) colours: Vec<Colour>,
    /// Mean squared structure (noise units) that the model owes to its own making and not to the machine.
    pub(crate) model_error: f64,
    /// How many starts were tried in the search that found the last hypotheses.
    pub(crate) tried: usize,
}

/// Which of several sets of parameters leaves the smallest residual from the same initial states.
fn nearest(
    system: &System,
    experiment: &Experiment,
    parameters: &[Vec<f64>],
    initial: &[Vec<f64>],
    free: &[Free],
) -> usize {
    let points: Vec<Point> =
        parameters.iter().map(|p| Point { parameters: p.clone(), initial: initial.to_vec() }).collect();
    let costs = costs(system, experiment, &points, free);
    (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
}

impl Fitted {
    /// The nominal model with its initial states and the parameters in `free` fitted.
    pub(crate) fn nominal(system: System, experiment: Experiment, free: Vec<Free>, settings: &Refine) -> Result<Self> {
        let (refined, jacobian) =
            settings.fit_with_jacobian(&system, &experiment, &system.parameter_values(), &free, None)?;
        let colours = colours(&refined.residuals, experiment.columns.len());
        let nominal = Self {
            hypotheses: Vec::new(),
            added: Vec::new(),
            system,
            experiment,
            free,
            refined,
            jacobian,
            colours,
            model_error: 0.0,
            tried: 1,
        };
        Ok(if nominal.starts().more > 0.0 { nominal.again(settings) } else { nominal })
    }

    /// Whether what is left is no noise, however coloured.
    pub(crate) fn is_structured(&self) -> bool {
        self.misfit() > FAR
    }

    /// By how much the first samples of the windows count more than the others: where logs are cut into windows, every
    /// state is logged, and what is left is no noise, as much as it is larger than noise can be.
    ///
    /// A start for every short window could take up what an effect should explain. Where a state is not logged, the first
    /// samples do not tell the start.
    pub(crate) fn starts(&self) -> Starts {
        let is_cut = self.experiment.windows.len() > self.experiment.logs.len();
        if is_cut && self.experiment.columns.len() >= self.nominal_states() {
            Starts { samples: FIRST, more: (self.misfit() - FAR).max(0.0) }
        } else {
            Starts::default()
        }
    }

    /// Mean squared structure (noise units) that no test calls a gap.
    pub(crate) fn negligible(&self) -> f64 {
        crate::diagnose::steps::detect::NEGLIGIBLE + self.model_error
    }

    /// One more hypothesis, fitted from `values` of its parameters.
    pub(crate) fn with(
        &self,
        hypothesis: &Hypothesis,
        applied: &Applied,
        values: &[f64],
        settings: &Refine,
    ) -> Result<Self> {
        self.with_all(&[hypothesis], applied, &[values.to_vec()], settings)
    }

    /// More hypotheses at once, fitted from the best of several `values` of their parameters.
    pub(crate) fn with_all(
        &self,
        more: &[&Hypothesis],
        applied: &Applied,
        values: &[Vec<f64>],
        settings: &Refine,
    ) -> Result<Self> {
        let system = System::with_simulator(&applied.model, self.system.simulator().cloned())?
            .with_followers(self.nominal_states())?;
        let mut parameters = system.parameter_values();
        parameters[..self.refined.parameters.len()].copy_from_slice(&self.refined.parameters);
        let mut free = self.free.clone();
        for (index, added) in &applied.fitted {
            free.retain(|f| f.parameter != *index);
            free.push(Free { lower: added.lower, upper: added.upper, ..Free::new(*index, added.scale) });
        }
        let mut experiment = Experiment { starts: self.starts(), ..self.experiment.clone() };
        for state in &applied.model.states[experiment.scale.len()..] {
            let control = state.equation.variables().iter().find_map(|n| applied.model.control_index(n));
            let largest = control.map_or(1.0, |c| {
                let values = experiment.logs.iter().flat_map(|l| &l.controls[c]);
                values.fold(0.0, |a: f64, v| a.max(v.abs()))
            });
            experiment.scale.push(if largest > 0.0 { largest } else { 1.0 });
        }
        let initial = with_lagging(&system, &experiment, self.refined.initial.clone(), self.system.n_states());
        let starts = values.iter().map(|values| {
            let mut start = parameters.clone();
            for ((index, added), &value) in applied.fitted.iter().zip(values) {
                start[*index] = value.clamp(added.lower, added.upper);
            }
            start
        });
        let mut starts: Vec<Vec<f64>> = starts.collect();
        let chosen = if starts.len() > 1 { nearest(&system, &experiment, &starts, &initial, &free) } else { 0 };
        let parameters = if starts.is_empty() { parameters } else { starts.swap_remove(chosen) };
        let fit = |experiment: &Experiment| {
            settings.fit_with_jacobian(&system, experiment, &parameters, &free, Some(&initial))
        };
        let mut fitted = fit(&experiment)?;
        if more.iter().any(|h| h.reads_the_past()) {
            // What the late sensor saw before the log is as the logs have it.
            let other = match experiment.past {
                Past::Still => Past::Moving,
                Past::Moving => Past::Still,
            };
            let moved = Experiment { past: other, ..experiment.clone() };
            if let Some(better) = fit(&moved).ok().filter(|f| f.0.cost < fitted.0.cost) {
                (fitted, experiment) = (better, moved);
            }
        }
        let (refined, jacobian) = fitted;
        let colours = colours(&refined.residuals, experiment.columns.len());
        let mut hypotheses = self.hypotheses.clone();
        hypotheses.extend(more.iter().map(|h| (*h).clone()));
        let mut added = self.added.clone();
        let mut rest = &applied.fitted[..];
        for &count in &applied.parts {
            let (own, later) = rest.split_at(count.min(rest.len()));
            added.push(own.to_vec());
            rest = later;
        }
        let model_error = self.model_error;
        Ok(Self { hypotheses, added, system, experiment, free, refined, jacobian, colours, model_error, tried: 1 })
    }

    /// The same contestant with the tolerated parameters and the initial states of another, as starts of further fits.
    pub(crate) fn from(&self, other: &Self) -> Self {
        let mut moved = self.clone();
        for free in &self.free {
            if let Some(&value) = other.refined.parameters.get(free.parameter) {
                moved.refined.parameters[free.parameter] = value;
            }
        }
        if self.experiment.windows == other.experiment.windows {
            let n = self.system.n_states();
            for (own, theirs) in moved.refined.initial.iter_mut().zip(&other.refined.initial) {
                own.copy_from_slice(&theirs[..n.min(theirs.len())]);
            }
        }
        moved
    }

    /// The same contestant, its fit carried on.
    pub(crate) fn again(self, settings: &Refine) -> Self {
        let start = Some(self.refined.initial.as_slice());
        let experiment = Experiment { starts: self.starts(), ..self.experiment.clone() };
        let fit = settings.fit_with_jacobian(&self.system, &experiment, &self.refined.parameters, &self.free, start);
        match fit {
            Ok((refined, jacobian)) => {
                let colours = colours(&refined.residuals, experiment.columns.len());
                Self { refined, jacobian, colours, experiment, ..self }
            }
            Err(_) => self,
        }
    }

    /// The same contestant, fitted once more from the initial states that the logs show, where that is better.
    ///
    /// A poor model pulls the initial states of its windows off, and a better one that starts there may stay there.
    pub(crate) fn restarted(self, settings: &Refine) -> Self {
        const POOR: f64 = 2.0;
        if self.misfit() < POOR {
            return self;
        }
        let Ok(other) = self.on(&self.experiment, settings) else { return self };
        let is_better_in = |w: usize| {
            let cost =
                |fit: &Self| fit.refined.residuals[w].iter().filter(|e| e.is_finite()).map(|e| e * e).sum::<f64>();
            cost(&other) < cost(&self)
        };
        // Each window from the better of its two starts.
        let moved: Vec<usize> = (0..self.experiment.windows.len()).filter(|&w| is_better_in(w)).collect();
        if moved.is_empty() {
            return self;
        }
        let mut mixed = if other.squares() < self.squares() { other.clone() } else { self.clone() };
        for w in 0..mixed.refined.initial.len() {
            let from = if moved.contains(&w) { &other } else { &self };
            mixed.refined.initial[w].clone_from(&from.refined.initial[w]);
        }
        let mixed = mixed.again(settings);
        let best = if other.squares() < self.squares() { other } else { self };
        if mixed.squares() < best.squares() { mixed } else { best }
    }

    /// The same contestant without its derivatives, which take most of its memory; [`Fitted::again`] restores them.
    pub(crate) fn slim(&self) -> Self {
        Self {
            hypotheses: self.hypotheses.clone(),
            added: self.added.clone(),
            system: self.system.clone(),
            experiment: self.experiment.clone(),
            free: self.free.clone(),
            refined: self.refined.clone(),
            jacobian: Jacobian { blocks: Vec::new(), n_states: self.jacobian.n_states },
            colours: self.colours.clone(),
            model_error: self.model_error,
            tried: self.tried,
        }
    }

    /// The same contestant on other windows or with another hold, fitted again from where it stands.
    pub(crate) fn on(&self, experiment: &Experiment, settings: &Refine) -> Result<Self> {
        let mut experiment = experiment.clone();
        experiment.scale.clone_from(&self.experiment.scale);
        experiment.starts = self.starts();
        let mut moved = Self { experiment, ..self.clone() };
        let mut guess = crate::refine::guess_initial(&moved.system, &moved.experiment);
        if moved.experiment.windows != self.experiment.windows {
            // A window that starts where an earlier one did starts as that one was fitted.
            for (window, start) in moved.experiment.windows.iter().zip(&mut guess) {
                let same = |w: &Window| w.log == window.log && w.first == window.first;
                if let Some(place) = self.experiment.windows.iter().position(same) {
                    let count = start.len();
                    start.copy_from_slice(&self.refined.initial[place][..count]);
                }
            }
        }
        moved.refined.initial = with_lagging(&moved.system, &moved.experiment, guess, moved.nominal_states());
        let (refined, jacobian) = settings.fit_with_jacobian(
            &moved.system,
            &moved.experiment,
            &moved.refined.parameters,
            &moved.free,
            Some(&moved.refined.initial),
        )?;
        moved.colours = colours(&refined.residuals, moved.experiment.columns.len());
        Ok(Self { refined, jacobian, ..moved })
    }

    /// The experiment with the shorter integration steps that this contestant needs, if it needs any.
    pub(crate) fn finer(&self) -> Option<Experiment> {
        let (parameters, initial) = (&self.refined.parameters, &self.refined.initial);
        let allowed = crate::diagnose::steps::prepare::ROUNDING * self.misfit().max(1.0).sqrt();
        let finer = crate::diagnose::steps::prepare::choose_substeps(
            &self.system,
            self.experiment.clone(),
            parameters,
            initial,
            allowed,
        );
        (finer.substeps > self.experiment.substeps).then_some(finer)
    }

    /// Number of states without those that hypotheses added (lagging inputs).
    pub(crate) fn nominal_states(&self) -> usize {
        self.system.n_states() - self.hypotheses.iter().map(Hypothesis::added_states).sum::<usize>()
    }

    /// Number of values that were compared.
    pub(crate) fn count(&self) -> usize {
        self.colours.iter().map(|c| c.count).sum()
    }

    /// Number of values that were fitted already: initial states, free parameters, noise models.
    pub(crate) fn spent(&self) -> usize {
        let initial = self.experiment.windows.len() * self.system.n_states();
        initial + self.free.len() + self.colours.iter().map(|c| c.coefficients.len() + 1).sum::<usize>()
    }

    /// Number of parameters that the hypotheses brought.
    pub(crate) fn complexity(&self) -> usize {
        self.added.iter().map(Vec::len).sum()
    }

    /// Sum of the squared residuals (noise units), every sample counting alike, and of the beliefs' terms.
    fn squares(&self) -> f64 {
        self.misfit() * self.count() as f64 + prior_cost(&self.refined.parameters, &self.free)
    }

    /// Log likelihood with beliefs.
    pub(crate) fn evidence(&self) -> f64 {
        log_likelihood(&self.colours) - 0.5 * prior_cost(&self.refined.parameters, &self.free)
    }

    /// Log likelihood with beliefs, less half the logarithm of the sample size for every parameter (BIC/-2).
    pub(crate) fn score(&self) -> f64 {
        let count = self.count().max(2) as f64;
        self.evidence() - 0.5 * self.complexity() as f64 * count.ln()
    }

    /// Mean squared difference of the outputs from another contestant's, in noise units; infinite on other windows.
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        if self.experiment.windows != other.experiment.windows {
            return f64::INFINITY;
        }
        let pairs = self.refined.residuals.iter().flatten().zip(other.refined.residuals.iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).filter(|d| !d.is_nan()).sum();
        sum / self.count().max(1) as f64
    }

    /// Mean squared residual in noise units.
    pub(crate) fn misfit(&self) -> f64 {
        let sum: f64 = self.colours.iter().map(|c| c.variance() * c.count as f64).sum();
        sum / self.count().max(1) as f64
    }

    /// Whether the residual's own past predicts nearly all of it, and it is far above the noise: a swing that is left
    /// over and no sensor's noise, however coloured (a first-order one would have a coefficient of 0.975).
    pub(crate) fn is_predictable(&self) -> bool {
        let innovation: f64 = self.colours.iter().map(|c| c.innovation * c.count as f64).sum();
        self.is_structured() && self.misfit() * self.count() as f64 > FAR * innovation
    }

    /// The model with the fitted values in place.
    pub(crate) fn model(&self) -> Model {
        let mut model = self.system.model().clone();
        for (parameter, &value) in model.parameters.iter_mut().zip(&self.refined.parameters) {
            parameter.value = value;
        }
        model
    }

    /// By how much coloured or large residuals carry less than their number.
    pub(crate) fn inflation(&self) -> f64 {
        // A slow quantity averages the noise, so the spectrum at zero frequency counts.
        let spectrum = |c: &Colour| c.innovation / (1.0 - c.coefficients.iter().sum::<f64>()).powi(2).max(1e-3);
        self.colours.iter().map(spectrum).fold(0.0, f64::max).max(self.misfit())
    }

    /// Standard deviation of parameter `index` with the residual's own size and colour; NaN where it is not free.
    pub(crate) fn deviation(&self, index: usize) -> f64 {
        let Some(place) = self.free.iter().position(|f| f.parameter == index) else { return f64::NAN };
        (self.refined.covariance[place][place] * self.inflation()).sqrt()
    }
}
