//! Dry friction in right sides that know no modes: `stick` and `breakaway` become `sign` and `tanh`.

use super::super::Model;
use super::Language;
use crate::error::Result;
use crate::expression::{Expression, Function, Tape};

/// What a reader of such a right side must know.
const NOTE: [&str; 3] = [
    "Dry friction: at rest sign(z) is the force that holds z there, which may have any value",
    "in its range. A right side alone can't hold: take an integrator that stops where",
    "z crosses zero, or short steps.",
];

/// The model without `stick` and `breakaway`, and whether a sign means a force that holds.
pub(super) fn without_stick(model: &Model) -> Result<(Model, bool)> {
    let names: Vec<String> = model.parameters.iter().map(|p| p.name.clone()).collect();
    let values: Vec<f64> = model.parameters.iter().map(|p| p.value).collect();
    let is_zero = |width: &Expression| -> Result<bool> {
        Ok(Tape::new(std::slice::from_ref(width), &names)?.evaluate_once(&values, 0.0)[0] == 0.0)
    };
    let holds = std::cell::Cell::new(false);
    let replaced = |expression: &Expression| {
        expression.map(&|part| match part {
            Expression::Call(Function::Stick, mut arguments) => {
                let width = arguments.swap_remove(1);
                let state = arguments.swap_remove(0);
                // A width was checked to be made of parameters.
                if is_zero(&width).unwrap_or(true) {
                    holds.set(true);
                    return state.apply(Function::Sign);
                }
                state.over(width).apply(Function::Tanh)
            }
            Expression::Call(Function::Breakaway, mut arguments) => {
                holds.set(true);
                arguments.swap_remove(0).apply(Function::Sign)
            }
            other => other,
        })
    };
    let mut written = model.clone();
    for state in &mut written.states {
        state.equation = replaced(&state.equation);
        state.measured = state.measured.as_ref().map(replaced);
    }
    Ok((written, holds.get()))
}

/// The note as a comment.
pub(super) fn note(language: Language) -> String {
    let mark = match language {
        Language::Latex => "%",
        Language::Sympy | Language::Python | Language::Julia => "#",
        Language::C | Language::Rust | Language::Modelica => "//",
    };
    NOTE.iter().map(|line| format!("{mark} {line}\n")).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::{Export, Language};
    use crate::expression::Expression;
    use crate::model::{Model, Parameter, State};

    fn written(language: Language, width: f64) -> String {
        let rate = "-c*stick(v, w) - 0.2*breakaway(v, 1.5)";
        let model = Model {
            states: vec![State::new("v", Expression::parse(rate).unwrap())],
            parameters: vec![Parameter::new("c", 1.5), Parameter::new("w", width)],
            ..Model::default()
        };
        Export::default().write(&model, language).unwrap()
    }

    #[test]
    fn a_right_side_has_a_sign_and_says_that_it_does_not_hold() {
        for language in Language::ALL {
            let (holding, corner) = (written(language, 0.0), written(language, 0.1));
            for text in [&holding, &corner] {
                assert!(text.contains("Dry friction: at rest sign(z)"), "{language:?}: {text}");
                assert!(!text.contains("stick(") && !text.contains("breakaway"), "{language:?}: {text}");
            }
            assert!(!holding.contains("tanh"), "{language:?}: {holding}");
            assert!(corner.contains("tanh"), "{language:?}: {corner}");
        }
    }
}
