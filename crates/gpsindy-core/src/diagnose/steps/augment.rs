//! Augment: the nominal model with the included causes written into it, in readable form.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::report::EquationFigure;
use crate::model::Model;

/// The winner's model for readers: sizes positive, phases within a turn, edges as steps.
pub(crate) fn augment(best: &Contestant) -> Model {
    let mut model = best.model();
    for (hypothesis, added) in best.hypotheses.iter().zip(&best.added) {
        for (index, parameter) in added {
            let value = &mut model.parameters[*index].value;
            *value = parameter.told(*value);
        }
        hypothesis.tell(&mut model);
    }
    model
}

/// The equations and readings that the correction changed.
pub(crate) fn equations(before: &Model, after: &Model) -> Vec<EquationFigure> {
    let mut all = Vec::new();
    for state in &after.states {
        let old = before.states.iter().find(|s| s.name == state.name);
        let right = old.map_or(String::new(), |s| s.equation.to_string());
        if right != state.equation.to_string() {
            all.push(EquationFigure {
                left: format!("{}'", state.name),
                before: right,
                after: state.equation.to_string(),
            });
        }
        let reads = |s: &crate::model::State| s.measured.as_ref().map_or(s.name.clone(), ToString::to_string);
        if let Some(old) = old.filter(|old| reads(old) != reads(state)) {
            all.push(EquationFigure { left: format!("{} reads", state.name), before: reads(old), after: reads(state) });
        }
    }
    all
}
