//! The evidence of a contestant: the likelihood of its residuals, the priors of its parameters, and the significance of gains.

use crate::diagnose::fit::colours::colour::{Colour, colours};
use crate::diagnose::fit::tolerance;
use crate::diagnose::limits::verify::BAND_95;
use crate::diagnose::limits::{FAR, NEARLY_ALL, NEGLIGIBLE, NOISE};
use crate::refine::{Experiment, Free, Refined, prior_cost};

/// What the logs say of one contestant, in numbers.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    /// The noise that each column would need.
    pub(crate) colours: Vec<Colour>,
    /// Mean squared structure (noise units) that the model owes to its own making and not to the machine.
    pub(crate) model_error: f64,
    /// Mean squared change of the outputs (noise units) that the tolerated parameters make together.
    pub(crate) strain: f64,
    /// Squared distances of the tolerated parameters from what is believed of them, in their deviations.
    beliefs: f64,
    complexity: usize,
    /// How many of them are starts of states that hypotheses brought, and the values of a window, of which each is known.
    starts: (usize, f64),
    spent: usize,
    effective: f64,
    /// How often a reading is repeated in the column that does so most: the fit's own covariance takes every value for one.
    repeated: f64,
}

impl Evidence {
    /// The evidence of a fit in which hypotheses brought so many parameters of the machine, and in each window so many starts.
    pub(crate) fn of(
        experiment: &Experiment,
        refined: &Refined,
        free: &[Free],
        (parameters, started): (usize, usize),
        model_error: f64,
    ) -> Self {
        let repeats: Vec<Vec<bool>> = experiment.windows.iter().map(|window| experiment.repeats(window)).collect();
        let colours = colours(&refined.residuals, experiment.columns.len(), &repeats);
        let initial = refined.initial.iter().map(Vec::len).sum::<usize>();
        let spent = initial + free.len() + colours.iter().map(|c| c.coefficients.len() + 1).sum::<usize>();
        let beliefs = prior_cost(&refined.parameters, free);
        let longest = experiment.windows.iter().map(|w| w.last - w.first + 1).max().unwrap_or(1);
        let effective = colours.iter().map(|c| effective_count(c, longest)).sum::<f64>().max(2.0);
        let windows = experiment.windows.len();
        let complexity = parameters + started * windows;
        let values = colours.iter().map(|c| c.count).sum::<usize>() as f64 / windows.max(1) as f64;
        let starts = (started * windows, values);
        let repeated = experiment.news.iter().copied().fold(1.0, f64::min).recip();
        let mut evidence =
            Self { repeated, colours, model_error, strain: 0.0, beliefs, complexity, starts, spent, effective };
        evidence.strain = tolerance::strain(refined, free, evidence.count());
        evidence
    }

    /// Number of values that were compared.
    pub(crate) fn count(&self) -> usize {
        self.colours.iter().map(|c| c.count).sum()
    }

    /// Number of values that were fitted already: initial states, free parameters, noise models.
    pub(crate) fn spent(&self) -> usize {
        self.spent
    }

    /// Number of parameters that the hypotheses brought.
    pub(crate) fn complexity(&self) -> usize {
        self.complexity
    }

    /// Mean squared residual in noise units.
    pub(crate) fn misfit(&self) -> f64 {
        let sum: f64 = self.colours.iter().map(|c| c.variance() * c.count as f64).sum();
        sum / self.count().max(1) as f64
    }

    /// Whether more than the noise of the sensors is left.
    pub(crate) fn leaves_a_rest(&self) -> bool {
        self.rest() > (NOISE - 1.0) * self.count() as f64
    }

    /// Sum of the squared residuals (noise units) beyond the noise of the sensors, whatever its colour.
    pub(crate) fn rest(&self) -> f64 {
        let variance = |c: &Colour| if c.is_of_a_sensor() { c.variance().min(1.0) } else { c.variance() };
        self.colours.iter().map(|c| (variance(c) - 1.0) * c.count as f64).sum()
    }

    /// Mean squared structure (noise units) that no test calls a gap.
    pub(crate) fn negligible(&self) -> f64 {
        NEGLIGIBLE + self.model_error
    }

    /// Sum of the squared residuals (noise units), every sample counting alike, and of the beliefs' terms.
    pub(crate) fn squares(&self) -> f64 {
        self.misfit() * self.count() as f64 + self.beliefs
    }

    /// Log likelihood with beliefs.
    pub(crate) fn likelihood(&self) -> f64 {
        log_likelihood(&self.colours) - 0.5 * self.beliefs
    }

    /// Log likelihood with beliefs, less half the logarithm of the sample size for every parameter (BIC/-2).
    pub(crate) fn score(&self) -> f64 {
        self.score_of(1.0)
    }

    /// Log likelihood and BIC's price where only a share `alone` of the values counts: a quasi-likelihood, its overdispersion that of
    /// the rest (Burnham and Anderson 2002, Model Selection and Multimodel Inference, section 2.5).
    ///
    /// A parameter is known from all values, a start from those of its window, and each pays for its own (Berger, Bayarri and Pericchi
    /// 2014, Econometric Reviews 33, "The effective sample size").
    pub(crate) fn score_of(&self, alone: f64) -> f64 {
        let price = |parameters: usize, values: f64| 0.5 * parameters as f64 * (alone * values).max(2.0).ln();
        let (starts, of_window) = self.starts;
        let parameters = price(self.complexity - starts, self.count() as f64);
        alone * self.likelihood() - parameters - price(starts, of_window)
    }

    /// Values that count alone: fewer than there are where what is left is larger than the noise and lasts.
    ///
    /// What a fit leaves is noise and a rest, and the rest is a process of its own size and correlation: its values repeat each
    /// other.
    pub(crate) fn effective_count(&self) -> f64 {
        self.effective
    }

    /// The share of the values that count alone.
    pub(crate) fn alone(&self) -> f64 {
        (self.effective_count() / self.count().max(1) as f64).min(1.0)
    }

    /// Whether what is left in a column is no noise, however coloured: beside many good ones a mean hides it.
    pub(crate) fn is_structured(&self) -> bool {
        self.colours.iter().any(|c| c.variance() > FAR)
    }

    /// Whether the residual's own past predicts nearly all of it, and it is far above the noise: a swing that is left
    /// over and no sensor's noise, however coloured.
    pub(crate) fn is_predictable(&self) -> bool {
        let innovation: f64 = self.colours.iter().map(|c| c.innovation * c.count as f64).sum();
        self.misfit() > FAR && self.misfit() * self.count() as f64 > FAR * innovation
    }

    /// By how much coloured or large residuals carry less than their number.
    pub(crate) fn inflation(&self) -> f64 {
        // A slow quantity averages the noise, so the spectrum at zero frequency counts.
        self.repeated * self.colours.iter().map(Colour::spectrum).fold(0.0, f64::max).max(self.misfit())
    }
}

/// Values of one column that count alone, in windows of so many samples at most.
fn effective_count(colour: &Colour, longest: usize) -> f64 {
    // Coloured noise is in the likelihood already; only what is beyond the noise counts here.
    let rest = (1.0 - 1.0 / colour.variance().max(1.0)).max(0.0);
    colour.count as f64 * (1.0 - rest + rest / colour.repetition(longest))
}

/// Log likelihood of the innovations, their variances at their best, up to a constant; the coefficients
/// of the noise models are charged as BIC does.
pub(crate) fn log_likelihood(colours: &[Colour]) -> f64 {
    let one = |c: &Colour| {
        let count = c.count.max(2) as f64;
        count * c.noise_like().max(1e-12).ln() + c.coefficients.len() as f64 * count.ln()
    };
    -0.5 * colours.iter().map(one).sum::<f64>()
}

/// Chance that noise alone lowers the residual as much as a gain of twice the log likelihood says, when `degrees`
/// parameters were added and `spent` others had been fitted to `count` values: an F test, honest in short logs.
pub(crate) fn gain_tail(gain: f64, degrees: usize, count: usize, spent: usize) -> f64 {
    use statrs::distribution::{ContinuousCDF, FisherSnedecor};
    let rest = count as f64 - (spent + degrees) as f64;
    if !(gain > 0.0) || rest < 1.0 {
        return 1.0;
    }
    let ratio = (gain / count as f64).exp_m1() * rest / degrees.max(1) as f64;
    if !ratio.is_finite() {
        return 0.0;
    }
    FisherSnedecor::new(degrees.max(1) as f64, rest).map_or(1.0, |d| d.sf(ratio))
}

/// A gain under a fixed noise level as one with the level fitted: `-N log(1 - gain/N)`.
pub(crate) fn with_fitted_level(gain: f64, count: usize) -> f64 {
    let count = count.max(1) as f64;
    -count * (-(gain / count).min(NEARLY_ALL)).ln_1p()
}

/// Chance that a chi-squared variable with `degrees` degrees of freedom exceeds `value`.
pub(crate) fn chi_squared_tail(value: f64, degrees: usize) -> f64 {
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    if !(value > 0.0) {
        return 1.0;
    }
    ChiSquared::new(degrees.max(1) as f64).map_or(1.0, |d| d.sf(value))
}

/// The value below which a normal variable lies with the probability `p`.
pub(crate) fn normal_quantile(p: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    Normal::new(0.0, 1.0).map_or(BAND_95, |n| n.inverse_cdf(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_smooth_rest_far_above_the_noise_does_not_beat_a_small_rough_one() {
        let rest = |variance: f64, innovation: f64| {
            let (coefficients, covariance) = (vec![0.9], vec![variance]);
            log_likelihood(&[Colour { coefficients, innovation, error: innovation, covariance, count: 1000 }])
        };
        assert!(rest(1e4, 5e2) > rest(1e6, 1e2));
        // Slow noise of a sensor keeps its innovations, which differences of samples see.
        assert!(rest(60.0, 1.0) > rest(30.0, 2.0));
    }
}
