//! Custom effects.

pub(super) mod starts;

use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::report::FUNCTION;
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

impl CustomEffect {
    /// Whether an id has a meaning already: an effect of the catalogue, or the function without a name.
    ///
    /// ```
    /// use gpsindy_core::diagnose::CustomEffect;
    /// assert!(CustomEffect::is_reserved("function") && CustomEffect::is_reserved("bias"));
    /// assert!(!CustomEffect::is_reserved("wake"));
    /// ```
    pub fn is_reserved(id: &str) -> bool {
        id == FUNCTION || Effect::from_id(id).is_some()
    }
}
