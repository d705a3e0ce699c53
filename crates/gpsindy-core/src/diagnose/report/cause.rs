//! What causes the gap, what does not, and the sizes: schema `gpsindy.diagnosis/1`, `causes`, `parameters` and `excluded`.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// One candidate cause.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Cause {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation (or whose column) it acts.
    pub state: String,
    /// The port or control at which it acts, where it does not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// What it depends on: states, controls, or the name of the parameter that is wrong or warms up. The parameter whose term saturates is
    /// in the form.
    pub variables: Vec<String>,
    /// It is part of the augmented model.
    pub included: bool,
    /// Calibrated, in 0..1.
    pub probability: f64,
    /// What it adds to the equation, or becomes, with the names of `parameters`.
    pub form: String,
    /// Fitted sizes.
    pub parameters: Vec<Parameter>,
    /// Ids of effects that these logs cannot distinguish from this one.
    pub equivalent: Vec<String>,
    /// The experiment that would distinguish them; `None` where `equivalent` is empty.
    pub next_experiment: Option<String>,
    /// Whether its size agrees between parts of the logs; `None` where it was not asked or no part determines a size.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub stability: Option<Stability>,
    /// Where else, or as which other effect, these logs would have it just as well: what `equivalent` names, with place and size.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub twins: Vec<Twin>,
    /// Its sizes by run, and pooled; empty with a single run.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub between_runs: Vec<BetweenRuns>,
}

/// Id under which a report states structure without a name.
pub(crate) const FUNCTION: &str = "function";

impl Cause {
    /// A cause that is not included, of which nothing else is said.
    pub(crate) fn bare(effect: &str, state: &str, probability: f64) -> Self {
        Self {
            effect: effect.into(),
            state: state.into(),
            place: None,
            variables: Vec::new(),
            included: false,
            probability,
            form: String::new(),
            parameters: Vec::new(),
            equivalent: Vec::new(),
            next_experiment: None,
            stability: None,
            twins: Vec::new(),
            between_runs: Vec::new(),
        }
    }

    /// Whether it is structure without a name, and no effect.
    pub fn is_nameless(&self) -> bool {
        self.effect == FUNCTION
    }

    /// Units of its sizes.
    pub(crate) fn units(&mut self) -> impl Iterator<Item = &mut String> {
        let twins = self.twins.iter_mut().flat_map(|twin| &mut twin.parameters);
        let own = self.parameters.iter_mut().chain(twins).map(|parameter| &mut parameter.unit);
        own.chain(self.between_runs.iter_mut().map(|between| &mut between.unit))
    }
}

/// Another account of what a cause explains.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Twin {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation (or whose column) it acts.
    pub state: String,
    /// The port or control at which it acts, where it does not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// What it depends on: states, controls, or the name of the parameter that is wrong or warms up. The parameter whose term saturates is
    /// in the form.
    pub variables: Vec<String>,
    /// Fitted sizes.
    pub parameters: Vec<Parameter>,
}

/// A size by run: each with its interval, pooled with a spread between runs.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct BetweenRuns {
    /// Name of the size among the cause's `parameters`.
    pub parameter: String,
    /// Unit of all values.
    pub unit: String,
    /// Runs that determine it, in their order.
    pub runs: Vec<RunValue>,
    /// Mean of the machine over its runs, in `unit`.
    pub pooled: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// Standard deviation of the machine's own values from run to run, in `unit`.
    pub spread: f64,
    /// Share of the variance between the runs' values that is the machine's and not the fit's, in 0..1.
    pub share: f64,
    /// Chance of so much spread with one value for all runs, in 0..1.
    pub p_value: f64,
}

/// The size in one run.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct RunValue {
    /// Name of the run.
    pub run: String,
    /// In this run alone.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
}

/// Whether a cause keeps its size between runs, in the inner and the outer part of its range, early and late.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Stability {
    /// Parts of the logs (runs and halves) that determine a size of their own.
    pub runs: usize,
    /// How many of them agree.
    pub agree: usize,
    /// Chance of so much disagreement, in 0..1.
    pub p_value: f64,
    /// The parts that disagree, in words.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub disagree: Vec<String>,
}

/// A fitted size with its interval, at the report's confidence.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Parameter {
    /// Name in the form.
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// Lower end; `None` where the logs set no lower end.
    pub low: Option<f64>,
    /// Upper end; `None` where the logs set no upper end.
    pub high: Option<f64>,
    /// Empty where unknown or without dimension.
    pub unit: String,
}

/// A parameter of the augmented model.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ModelParameter {
    /// Its name in the model.
    pub name: String,
    /// In the nominal model; `None` where a cause brought it.
    pub nominal: Option<f64>,
    /// In the augmented model, in `unit`.
    pub value: f64,
    /// Standard deviation with the size and colour of what the fit leaves; `None` where it was not fitted.
    pub deviation: Option<f64>,
    /// Empty where unknown or without dimension.
    pub unit: String,
}

/// An effect that would have been found, with 95 % power, had it been larger than `above`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Excluded {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation it would act.
    pub state: String,
    /// What it would depend on.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub variables: Vec<String>,
    /// The port or control at which it would act, where it would not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// Size of the effect's first parameter, in `unit`.
    pub above: f64,
    /// Empty where unknown or without dimension.
    pub unit: String,
}
