//! The equations being learnt: which term stands in which equation with which coefficient, and the model that they make.

use crate::expression::{Expression, Function};
use crate::library::Library;
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

/// Coefficients of all equations, and what is known beforehand of them.
#[derive(Debug, Clone)]
pub(crate) struct Equations {
    pub(crate) library: Arc<Library>,
    /// Names and units of the states, n of them.
    pub(crate) states: Vec<(String, String)>,
    /// Names and units of the controls, m of them.
    pub(crate) controls: Vec<(String, String)>,
    /// (n x p), exactly 0 where a term is out.
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
}

/// Name of the column that carries the derivative of `state`.
pub(crate) fn rate_name(state: &str) -> String {
    format!("{state}_rate_as_logged")
}

fn coefficient_name(state: usize, term: usize) -> String {
    format!("coefficient_{state}_{term}")
}

fn delay_name(control: usize) -> String {
    format!("delay_of_control_{control}")
}

impl Equations {
    pub(crate) fn n_states(&self) -> usize {
        self.states.len()
    }

    pub(crate) fn n_terms(&self) -> usize {
        self.library.n_terms()
    }

    /// Terms of each equation.
    pub(crate) fn support(&self) -> Vec<Vec<usize>> {
        self.coefficients.iter().map(|c| (0..c.len()).filter(|&j| c[j] != 0.0).collect()).collect()
    }

    /// Number of terms that might stand in an equation.
    pub(crate) fn n_candidates(&self) -> usize {
        self.allowed.iter().map(Vec::len).sum()
    }

    /// Every delay that is estimated, with the number of its control.
    pub(crate) fn free_delays(&self) -> impl Iterator<Item = (usize, &DelayValue)> {
        self.delays.iter().enumerate().filter(|(_, d)| d.free)
    }

    /// Puts the terms number `support` of all candidates in, with these coefficients (n x p), and all others out.
    pub(crate) fn set_support(&mut self, support: &[usize], coefficients: &[Vec<f64>]) {
        let mut number = 0;
        for ((own, allowed), values) in self.coefficients.iter_mut().zip(&self.allowed).zip(coefficients) {
            own.fill(0.0);
            for &j in allowed {
                if support.contains(&number) {
                    own[j] = values[j];
                }
                number += 1;
            }
        }
    }

    /// Takes the values over from the parameters of [`Equations::model`] with the same terms.
    pub(crate) fn take(&mut self, terms: &[Vec<usize>], parameters: &[f64]) {
        let mut values = parameters.iter();
        for (s, terms) in terms.iter().enumerate() {
            for &j in terms {
                self.coefficients[s][j] = values.next().copied().unwrap_or(0.0);
            }
        }
        for delay in self.delays.iter_mut().filter(|d| d.free) {
            delay.value = values.next().copied().unwrap_or(0.0);
        }
    }

    /// The model with `terms` in its equations.
    ///
    /// `as_parameters`: coefficients and free delays are parameters, and logged derivatives are further columns; without
    /// it they are numbers.
    pub(crate) fn model(&self, terms: &[Vec<usize>], as_parameters: bool) -> Model {
        let mut model = Model {
            name: "identified".into(),
            controls: self.controls.iter().map(|(n, u)| Control { name: n.clone(), unit: u.clone() }).collect(),
            ..Model::default()
        };
        let mut rates = Vec::with_capacity(self.states.len());
        for (s, terms) in terms.iter().enumerate() {
            let equation = match (&self.fixed[s], as_parameters) {
                (Some(fixed), _) => fixed.clone(),
                (None, false) => self.library.equation(&self.coefficients[s]),
                (None, true) => {
                    let mut sum = Expression::Number(0.0);
                    for &j in terms {
                        let name = coefficient_name(s, j);
                        let part = Expression::variable(&name).times(self.library.terms()[j].expression().clone());
                        sum = sum.plus(part);
                        model.parameters.push(Parameter::new(name, self.coefficients[s][j]));
                    }
                    sum
                }
            };
            rates.push(self.delayed(&equation, as_parameters));
        }
        for (k, delay) in self.free_delays() {
            if as_parameters {
                model.parameters.push(Parameter::new(delay_name(k), delay.value));
            }
        }
        for ((name, unit), rate) in self.states.iter().zip(&rates) {
            model.states.push(State { unit: unit.clone(), ..State::new(name, rate.clone()) });
        }
        for (s, rate) in rates.into_iter().enumerate() {
            if as_parameters && self.derivative_given[s] {
                let name = rate_name(&self.states[s].0);
                model.states.push(State { measured: Some(rate), ..State::new(name, Expression::Number(0.0)) });
            }
        }
        model
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
