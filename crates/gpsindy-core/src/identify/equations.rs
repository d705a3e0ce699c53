//! The equations under identification: which term is in which equation with which coefficient, and the resulting model.

use crate::data::Channel;
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::library::{Constraints, Library};
use crate::model::{Control, Model, Parameter, State};
use std::sync::Arc;

/// A control's delay, s.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DelayValue {
    pub(crate) value: f64,
    /// Whether it is estimated.
    pub(crate) free: bool,
    /// Sampling period, s: its typical size.
    pub(crate) period: f64,
    /// Largest value that the search may give it, s.
    pub(crate) most: f64,
}

impl DelayValue {
    /// A delay that is known.
    pub(crate) fn known(value: f64, period: f64) -> Self {
        Self { value, free: false, period, most: f64::INFINITY }
    }
}

/// The terms of each equation, in ascending order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Support(Vec<Vec<usize>>);

impl Support {
    /// `n` equations without a term.
    pub(crate) fn empty(n: usize) -> Self {
        Self(vec![Vec::new(); n])
    }

    /// Terms of the equation of state `s`.
    pub(crate) fn terms(&self, s: usize) -> &[usize] {
        &self.0[s]
    }

    pub(crate) fn contains(&self, s: usize, term: usize) -> bool {
        self.0[s].binary_search(&term).is_ok()
    }

    /// State and term, equation by equation.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        self.0.iter().enumerate().flat_map(|(s, terms)| terms.iter().map(move |&j| (s, j)))
    }

    /// Number of terms in all equations.
    pub(crate) fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }
}

/// Coefficients of all equations, and what is known beforehand of them.
#[derive(Debug, Clone)]
pub(crate) struct Equations {
    pub(crate) library: Arc<Library>,
    /// Names and units of the states, n of them.
    pub(crate) states: Vec<(String, String)>,
    /// Names and units of the controls, m of them.
    pub(crate) controls: Vec<(String, String)>,
    /// The terms that are in.
    pub(crate) support: Support,
    /// (n x p), 0 where a term is out.
    pub(crate) coefficients: Vec<Vec<f64>>,
    /// Columns that each equation may hold; none where the equation is given.
    pub(crate) allowed: Vec<Vec<usize>>,
    /// Columns that each equation holds for certain.
    pub(crate) kept: Vec<Vec<usize>>,
    /// (n x p), the sign that a coefficient must have.
    pub(crate) signs: Vec<Vec<Option<bool>>>,
    /// Equations taken as given.
    pub(crate) fixed: Vec<Option<Expression>>,
    pub(crate) delays: Vec<DelayValue>,
    /// Whether the log carries the derivative of a state.
    pub(crate) derivative_given: Vec<bool>,
    /// Values that each free number of the library keeps between.
    pub(crate) bounds: Vec<(f64, f64)>,
    /// Lowest and highest value that the sensor of each state shows; infinite where it shows all.
    pub(crate) ranges: Vec<(f64, f64)>,
}

/// Name of the column that carries the derivative of `state`, in the training data and in [`Equations::model_with_parameters`]
/// alike: by it the fit finds the one for the other. Nothing else is decided by this name.
pub(crate) fn rate_name(state: &str) -> String {
    format!("{state}_rate_as_logged")
}

fn coefficient_name(state: usize, term: usize) -> String {
    format!("coefficient_{state}_{term}")
}

/// What a sensor of this range shows of `state`; none where it shows all.
fn shown(state: &str, (low, high): (f64, f64)) -> Option<Expression> {
    let pair = |function, a, b| Expression::Call(function, vec![a, b]);
    let above = |value| if low.is_finite() { pair(Function::Max, value, Expression::Number(low)) } else { value };
    let below = |value| if high.is_finite() { pair(Function::Min, value, Expression::Number(high)) } else { value };
    (low.is_finite() || high.is_finite()).then(|| above(below(Expression::variable(state))))
}

fn delay_name(control: usize) -> String {
    format!("delay_of_control_{control}")
}

impl Equations {
    /// Equations without a term yet, under these constraints; none of the states' derivatives is logged.
    pub(crate) fn new(
        states: &[Channel],
        controls: &[Channel],
        library: &Arc<Library>,
        constraints: &Constraints,
        delays: Vec<DelayValue>,
    ) -> Result<Self> {
        let (n, p) = (states.len(), library.n_terms());
        let (mut allowed, mut kept) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let (mut signs, mut fixed) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for Channel { name: state, .. } in states {
            let equation = constraints.fixed_equation(state).cloned();
            allowed.push(if equation.is_some() { vec![] } else { constraints.allowed(state, library)? });
            kept.push(constraints.kept(state, library)?);
            signs.push(constraints.signs(state, library)?);
            fixed.push(equation);
        }
        let named = |channel: &Channel| (channel.name.clone(), channel.unit.clone());
        Ok(Self {
            library: Arc::clone(library),
            states: states.iter().map(named).collect(),
            controls: controls.iter().map(named).collect(),
            support: Support::empty(n),
            coefficients: vec![vec![0.0; p]; n],
            allowed,
            kept,
            signs,
            fixed,
            delays,
            derivative_given: vec![false; n],
            bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); library.numbers().len()],
            ranges: vec![(f64::NEG_INFINITY, f64::INFINITY); n],
        })
    }

    pub(crate) fn n_states(&self) -> usize {
        self.states.len()
    }

    pub(crate) fn n_terms(&self) -> usize {
        self.library.n_terms()
    }

    /// Number of terms that an equation might have.
    pub(crate) fn n_candidates(&self) -> usize {
        self.allowed.iter().map(Vec::len).sum()
    }

    /// What distinguishes its model from others of the same states and controls, apart from the values of its parameters.
    pub(crate) fn structure(&self) -> String {
        let names = self.library.names();
        let of = |s: usize| match &self.fixed[s] {
            Some(given) => format!("= {given}"),
            None => self.support.terms(s).iter().map(|&j| names[j]).collect::<Vec<_>>().join(" "),
        };
        let rates: Vec<String> = (0..self.n_states()).map(of).collect();
        let late = |delay: &DelayValue| if delay.free { "free".into() } else { delay.value.to_string() };
        let delays: Vec<String> = self.delays.iter().map(late).collect();
        format!("{} | {}", rates.join("; "), delays.join(" "))
    }

    /// Every delay that is estimated, with the number of its control.
    pub(crate) fn free_delays(&self) -> impl Iterator<Item = (usize, &DelayValue)> {
        self.delays.iter().enumerate().filter(|(_, d)| d.free)
    }

    /// Every free number in use, by its place in the library: in a given equation or in a term that is in.
    pub(crate) fn free_numbers(&self) -> Vec<usize> {
        let names = self.library.numbers();
        let terms = || self.support.iter().map(|(_, j)| self.library.terms()[j].expression());
        let is_used = |name: &str| self.fixed.iter().flatten().chain(terms()).any(|part| part.contains(name));
        (0..names.len()).filter(|&k| is_used(&names[k].0)).collect()
    }

    /// Gives state `s` these coefficients (p); where one is 0 the term is out.
    pub(crate) fn set(&mut self, s: usize, coefficients: &[f64]) {
        self.support.0[s] = (0..coefficients.len()).filter(|&j| coefficients[j] != 0.0).collect();
        self.coefficients[s] = coefficients.to_vec();
    }

    /// The same over the library of `frame`, which has no term in; none where that lacks one, or where free numbers are in use.
    pub(crate) fn over(&self, frame: &Self) -> Option<Self> {
        let names = self.library.names();
        let mut equations = Self { delays: self.delays.clone(), ..frame.clone() };
        for s in 0..self.n_states() {
            let mut coefficients = vec![0.0; frame.n_terms()];
            for &j in self.support.terms(s) {
                coefficients[frame.library.index_of(names[j]).ok()?] = self.coefficients[s][j];
            }
            equations.set(s, &coefficients);
        }
        (self.free_numbers().is_empty() && equations.free_numbers().is_empty()).then_some(equations)
    }

    /// Puts the terms number `support` of all candidates in, with these coefficients (n x p), and all others out.
    pub(crate) fn set_support(&mut self, support: &[usize], coefficients: &[Vec<f64>]) {
        let mut number = 0;
        for (s, allowed) in self.allowed.iter().enumerate() {
            self.coefficients[s].fill(0.0);
            self.support.0[s].clear();
            for &j in allowed {
                if support.contains(&number) {
                    self.coefficients[s][j] = coefficients[s][j];
                    self.support.0[s].push(j);
                }
                number += 1;
            }
            self.support.0[s].sort_unstable();
        }
    }

    /// Takes the values over from the parameters of [`Equations::model_with_parameters`]. A term whose coefficient ended at
    /// the bound of its sign, 0, is out.
    pub(crate) fn take(&mut self, parameters: &[f64]) {
        let free = self.free_numbers();
        let mut values = parameters.iter().copied();
        for (own, terms) in self.coefficients.iter_mut().zip(&mut self.support.0) {
            for &j in terms.iter() {
                own[j] = values.next().unwrap_or(0.0);
            }
            terms.retain(|&j| own[j] != 0.0);
        }
        for delay in self.delays.iter_mut().filter(|d| d.free) {
            delay.value = values.next().unwrap_or(0.0);
        }
        self.take_numbers(&free, &values.collect::<Vec<f64>>());
    }

    /// Gives the free numbers at the places `free` of the library these values.
    fn take_numbers(&mut self, free: &[usize], found: &[f64]) {
        if free.is_empty() {
            return;
        }
        let mut numbers: Vec<f64> = self.library.numbers().iter().map(|(_, value)| *value).collect();
        free.iter().zip(found).for_each(|(&k, &value)| numbers[k] = value);
        // The names are those it was made with.
        if let Ok(library) = self.library.at(&numbers) {
            self.library = Arc::new(library);
        }
    }

    /// The model, with numbers for coefficients.
    pub(crate) fn model(&self) -> Model {
        let rate = |s: usize| self.library.equation(&self.coefficients[s]);
        let rates = (0..self.n_states()).map(|s| self.fixed[s].clone().unwrap_or_else(|| rate(s)));
        let rates = rates.map(|rate| self.delayed(&rate, false)).collect();
        Model { parameters: self.numbers().collect(), ..self.framed(rates) }
    }

    /// The free numbers in use, with their values.
    fn numbers(&self) -> impl Iterator<Item = Parameter> {
        let numbers = self.library.numbers();
        self.free_numbers().into_iter().map(|k| Parameter::new(&numbers[k].0, numbers[k].1))
    }

    /// The model with coefficients, free delays and free numbers as parameters, in the order of the support, and a column for every
    /// logged derivative.
    pub(crate) fn model_with_parameters(&self) -> Model {
        let mut parameters = Vec::with_capacity(self.support.len());
        let mut rates = Vec::with_capacity(self.n_states());
        for (s, fixed) in self.fixed.iter().enumerate() {
            let mut sum = Expression::Number(0.0);
            for &j in self.support.terms(s) {
                let name = coefficient_name(s, j);
                sum = sum.plus(Expression::variable(&name).times(self.library.terms()[j].expression().clone()));
                parameters.push(Parameter::new(name, self.coefficients[s][j]));
            }
            rates.push(self.delayed(fixed.as_ref().unwrap_or(&sum), true));
        }
        parameters.extend(self.free_delays().map(|(k, delay)| Parameter::new(delay_name(k), delay.value)));
        parameters.extend(self.numbers());
        let mut model = Model { parameters, ..self.framed(rates.clone()) };
        for (s, rate) in rates.into_iter().enumerate().filter(|(s, _)| self.derivative_given[*s]) {
            let name = rate_name(&self.states[s].0);
            model.states.push(State { measured: Some(rate), ..State::new(name, Expression::Number(0.0)) });
        }
        model
    }

    /// A model with these rates of the states.
    fn framed(&self, rates: Vec<Expression>) -> Model {
        let states = self.states.iter().zip(rates).zip(&self.ranges).map(|(((name, unit), rate), range)| State {
            unit: unit.clone(),
            measured: shown(name, *range),
            ..State::new(name, rate)
        });
        Model {
            name: "identified".into(),
            states: states.collect(),
            controls: self.controls.iter().map(|(n, u)| Control { name: n.clone(), unit: u.clone() }).collect(),
            ..Model::default()
        }
    }

    /// `equation` with each control that has a delay replaced by the late one.
    fn delayed(&self, equation: &Expression, as_parameters: bool) -> Expression {
        let late = |name: &str| {
            let k = self.controls.iter().position(|(control, _)| control == name)?;
            let delay = &self.delays[k];
            let amount = match (delay.free && as_parameters, delay.value) {
                (true, _) => Expression::variable(delay_name(k)),
                (false, 0.0) => return None,
                (false, value) => Expression::Number(value),
            };
            Some(Expression::Call(Function::Delay, vec![Expression::variable(name), amount]))
        };
        equation.map(&|part| match part {
            Expression::Variable(ref name) => late(name).unwrap_or(part),
            other => other,
        })
    }
}
