//! By how much another model's rates and readings differ from a system's, at the same states: a suspect without its plant.

use super::engine::{beside, call};
use super::inputs::{Extraction, Input, LateState, late_name};
use super::{Model, System};
use crate::error::Result;
use crate::expression::{Expression, Operator, Tape};

/// Where a signal enters a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Entry {
    /// The rate of a state; of a simulator that steps, beside it.
    Rate(usize),
    /// What goes to a simulator that steps: its commands, then its forces, then its parameters.
    Argument(usize),
}

/// What a model adds to the rates and readings of another one, and to what goes to its simulator if that steps.
///
/// The tapes' variables are states (n), controls (m), inputs with a history (h), the changed model's parameters, and then the base
/// model's own values of the parameters that the change moves; of the readings, behind them the states that are read late.
pub(crate) struct Change {
    pub(crate) inputs: Vec<Input>,
    /// Where it adds something, and how much.
    pub(crate) entries: Vec<Entry>,
    pub(crate) added: Tape,
    /// The states whose readings differ, and by how much.
    pub(crate) shown: Vec<usize>,
    pub(crate) readings: Tape,
    pub(crate) late: Vec<LateState>,
}

impl Change {
    /// From `base` to `changed`, which has the parameters of `base` first and moves those of number `moved`.
    ///
    /// `None` where the two don't have the same states, or a rate is late.
    ///
    /// # Errors
    /// As [`System::new`]; a change of what a simulator that steps answers.
    pub(crate) fn between(base: &System, changed: &Model, moved: &[usize]) -> Result<Option<Self>> {
        let n = base.n_states();
        if changed.states.len() != n || changed.states.iter().zip(&base.model().states).any(|(a, b)| a.name != b.name) {
            return Ok(None);
        }
        let (before, after) = (base.model().closed(), changed.closed());
        // The base model's own value of a parameter that moves, under a name that no parameter has.
        let own = |p: usize| format!("value of {}", before.parameters[p].name);
        let still = |e: &Expression| {
            moved
                .iter()
                .fold(e.clone(), |e, &p| e.substitute(&before.parameters[p].name, &Expression::variable(own(p))))
        };
        let mut extraction = Extraction { model: changed, inputs: Vec::new(), late: Vec::new() };
        let difference = |a: &Expression, b: &Expression| {
            let found = difference(b, &still(a));
            (found != Expression::Number(0.0)).then_some(found)
        };
        let mut extracted = |differences: Vec<Option<Expression>>| {
            let there = differences.into_iter().enumerate().filter_map(|(place, found)| Some((place, found?)));
            there.map(|(place, found)| (place, extraction.extract(&found))).unzip()
        };
        let steps = base.engine().is_some();
        let n_outputs = base.simulator().map_or(0, |s| s.n_states());
        let mut all = Vec::new();
        if steps {
            let arguments = |model: &Model| {
                let all = model.states.iter().find_map(|s| call(&s.equation)).unwrap_or_default();
                all.get(n_outputs..).unwrap_or_default().to_vec()
            };
            let differences =
                arguments(&before).iter().zip(arguments(&after)).map(|(a, b)| difference(a, &b)).collect();
            let (places, differences): (Vec<usize>, Vec<Expression>) = extracted(differences);
            all.extend(places.into_iter().map(Entry::Argument).zip(differences));
        }
        let rate = |equation: &Expression| if steps { beside(equation) } else { equation.clone() };
        let each = before.states.iter().zip(&after.states);
        let rates = each.clone().map(|(a, b)| difference(&rate(&a.equation), &rate(&b.equation))).collect();
        let (places, rates): (Vec<usize>, Vec<Expression>) = extracted(rates);
        all.extend(places.into_iter().map(Entry::Rate).zip(rates));
        let (entries, added): (Vec<Entry>, Vec<Expression>) = all.into_iter().unzip();
        let read =
            |state: &super::State| state.measured.clone().unwrap_or_else(|| Expression::variable(state.name.clone()));
        let (shown, readings): (Vec<usize>, Vec<Expression>) =
            extracted(each.map(|(a, b)| difference(&read(a), &read(b))).collect());
        let parameters: Vec<String> =
            changed.parameters.iter().map(|p| p.name.clone()).chain(moved.iter().map(|&p| own(p))).collect();
        let (inputs, variables) = extraction.compiled(&parameters)?;
        let late = extraction.late_states(&parameters)?;
        // What a simulator that steps answers is nothing to calculate with.
        let n_outputs = if steps { 0 } else { n_outputs };
        let with_late: Vec<String> = variables.iter().cloned().chain((0..late.len()).map(late_name)).collect();
        Ok(Some(Self {
            inputs,
            entries,
            added: Tape::with_simulator(&added, &variables, n_outputs)?,
            shown,
            readings: Tape::with_simulator(&readings, &with_late, n_outputs)?,
            late,
        }))
    }

    /// Terms of the rate of a state of `base`, each a change of its own: the tape has one result for each.
    ///
    /// `None` where a term is late.
    ///
    /// # Errors
    /// As [`System::new`].
    pub(crate) fn terms(base: &System, row: usize, terms: &[Expression]) -> Result<Option<Self>> {
        let model = base.model();
        let mut extraction = Extraction { model, inputs: Vec::new(), late: Vec::new() };
        let added: Vec<Expression> = terms.iter().map(|term| extraction.extract(term)).collect();
        if !extraction.late.is_empty() {
            return Ok(None);
        }
        let parameters: Vec<String> = model.parameters.iter().map(|p| p.name.clone()).collect();
        let (inputs, variables) = extraction.compiled(&parameters)?;
        let n_outputs = base.simulator().map_or(0, |s| s.n_states());
        let added = Tape::with_simulator(&added, &variables, n_outputs)?;
        let readings = Tape::with_simulator(&[], &variables, n_outputs)?;
        let entries = vec![Entry::Rate(row); terms.len()];
        Ok(Some(Self { inputs, entries, added, shown: Vec::new(), readings, late: Vec::new() }))
    }
}

/// `after - before`; where terms were added to `before`, these alone.
fn difference(after: &Expression, before: &Expression) -> Expression {
    added(after, before).unwrap_or_else(|| after.clone().minus(before.clone()))
}

/// What was added to `before`, where `after` is that and terms behind it.
fn added(after: &Expression, before: &Expression) -> Option<Expression> {
    if after == before {
        return Some(Expression::Number(0.0));
    }
    match after {
        Expression::Binary(Operator::Add, a, b) => Some(added(a, before)?.plus((**b).clone())),
        Expression::Binary(Operator::Subtract, a, b) => Some(added(a, before)?.minus((**b).clone())),
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::{Control, Parameter, State};

    fn model(rate: &str) -> Model {
        Model {
            states: vec![
                State::new("x", Expression::parse("v").unwrap()),
                State::new("v", Expression::parse(rate).unwrap()),
            ],
            controls: vec![Control::new("u")],
            parameters: [("k", 4.0), ("c", 0.5)].map(|(n, v)| Parameter::new(n, v)).into(),
            ..Model::default()
        }
    }

    #[test]
    fn a_term_that_was_added_stands_alone() {
        let base = System::new(&model("u - k*x")).unwrap();
        let change = Change::between(&base, &model("u - k*x - c*sin(v)"), &[]).unwrap().unwrap();
        assert_eq!((change.entries.as_slice(), change.shown.len()), (&[Entry::Rate(1)][..], 0));
        // x, v, u, k, c.
        let found = change.added.evaluate_once(&[0.3, 0.7, 9.0, 4.0, 0.5], 0.0);
        assert_eq!(found, [-0.5 * 0.7f64.sin()]);
        // No instruction of the plant is left.
        assert!(!change.added.reads(2) && !change.added.reads(0));
    }

    #[test]
    fn a_parameter_that_moves_counts_from_the_base_models_value() {
        let base = System::new(&model("u - k*x")).unwrap();
        let change = Change::between(&base, &model("u - k*x"), &[0]).unwrap().unwrap();
        // x, v, u, k, c, and k as it was.
        let found = change.added.evaluate_once(&[0.5, 0.0, 0.2, 5.0, 0.0, 4.0], 0.0);
        assert!((found[0] + 0.5).abs() < 1e-15, "{found:?}");
    }

    #[test]
    fn a_simulator_that_steps_takes_other_arguments_and_terms_beside_it_but_no_other_answer() {
        let servo = std::sync::Arc::new(crate::model::stepping::Stepping::servo());
        let base = servo.system("q", ("inertia", 0.03));
        let change = |of: &dyn Fn(Expression) -> Expression| {
            let mut changed = base.model().clone();
            changed.parameters.push(Parameter::new("c", 0.5));
            let rate = &mut changed.states[1].equation;
            *rate = of(rate.clone());
            Change::between(&base, &changed, &[])
        };
        let entries = |of: &dyn Fn(Expression) -> Expression| change(of).unwrap().unwrap().entries;
        let more = |e: Expression| e.plus(Expression::parse("c*v").unwrap());
        assert_eq!(entries(&more), [Entry::Rate(1)]);
        assert_eq!(entries(&|e| e.substitute("u", &Expression::parse("u + c").unwrap())), [Entry::Argument(0)]);
        assert!(change(&|e| e.times(Expression::parse("1 + c").unwrap())).is_err());
    }

    #[test]
    fn a_control_that_comes_late_is_an_input_with_a_history() {
        let base = System::new(&model("u - k*x")).unwrap();
        let change = Change::between(&base, &model("delay(u, c) - k*x"), &[]).unwrap().unwrap();
        assert_eq!(change.inputs.len(), 1);
        // x, v, u, the late control, k, c.
        assert_eq!(change.added.evaluate_once(&[0.5, 0.0, 0.2, 0.7, 4.0, 0.1], 0.0), [0.5]);
    }

    #[test]
    fn terms_of_a_row_have_a_result_each() {
        let base = System::new(&model("u - k*x")).unwrap();
        let terms = ["sin(v)", "delay(u, 0.1)"].map(|term| Expression::parse(term).unwrap());
        let change = Change::terms(&base, 1, &terms).unwrap().unwrap();
        assert_eq!((change.entries.as_slice(), change.inputs.len()), (&[Entry::Rate(1); 2][..], 1));
        // x, v, u, the late control, k, c.
        assert_eq!(change.added.evaluate_once(&[0.3, 0.7, 9.0, 0.2, 4.0, 0.5], 0.0), [0.7f64.sin(), 0.2]);
    }

    #[test]
    fn another_state_is_no_change_at_the_same_states() {
        let base = System::new(&model("u - k*x")).unwrap();
        let mut more = model("u - k*x");
        more.states.push(State::new("lag", Expression::parse("u - lag").unwrap()));
        assert!(Change::between(&base, &more, &[]).unwrap().is_none());
    }

    #[test]
    fn a_reading_that_comes_late_is_the_late_state_less_the_present_one() {
        let base = System::new(&model("u - k*x")).unwrap();
        let mut late = model("u - k*x");
        late.states[0].measured = Some(Expression::parse("delay(x, c)").unwrap());
        let change = Change::between(&base, &late, &[]).unwrap().unwrap();
        assert_eq!((change.entries.len(), change.shown.as_slice(), change.late[0].state), (0, &[0][..], 0));
        // x, v, u, k, c, and x as it was.
        assert_eq!(change.readings.evaluate_once(&[0.5, 0.0, 0.2, 4.0, 0.1, 0.75], 0.0), [0.25]);
        assert_eq!(change.late[0].amounts(&[[4.0], [0.1]])[0][0], 0.1);
    }
}
