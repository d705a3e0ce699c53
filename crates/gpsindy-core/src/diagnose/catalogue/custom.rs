//! Custom effects.

use crate::expression::Expression;

/// An effect of the user's own, added to the right side of an equation.
#[derive(Debug, Clone, PartialEq)]
pub struct CustomEffect {
    /// Its id in the report.
    pub id: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// What is added, in the names of the model and of its own parameters.
    pub form: Expression,
    /// Names and ranges of its parameters; the first one that is free of sign scales the effect.
    pub parameters: Vec<CustomParameter>,
}

/// A parameter of a [`CustomEffect`].
#[derive(Debug, Clone, PartialEq)]
pub struct CustomParameter {
    /// Its name inside the form.
    pub name: String,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Unit as text, may be empty.
    pub unit: String,
}
