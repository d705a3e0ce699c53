//! Augment: the nominal model with the included causes written into it, in readable form.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::joint;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::report::EquationFigure;
use crate::error::Result;
use crate::model::Model;

/// The winner's model for readers: sizes positive, phases within a turn, edges as steps.
pub(crate) fn augment(best: &Contestant) -> Model {
    let mut model = best.model();
    for (hypothesis, added) in best.hypotheses.iter().zip(&best.added) {
        for (index, parameter) in added {
            let value = &mut model.parameters[*index].value;
            *value = parameter.stated(*value);
        }
        hypothesis.tell(&mut model);
    }
    model
}

/// The winner's model without the effect at `place`, everything else as it was fitted.
///
/// # Errors
/// Effects that do not apply without it.
pub(crate) fn without(best: &Contestant, nominal: &Contestant, place: usize, scene: &Scene) -> Result<Model> {
    let others: Vec<usize> = (0..best.hypotheses.len()).filter(|&other| other != place).collect();
    let hypotheses: Vec<&Hypothesis> = others.iter().map(|&other| &best.hypotheses[other]).collect();
    let applied = joint::apply(&hypotheses, nominal.system.model(), scene)?;
    let mut model = applied.model;
    for free in best.free.iter().filter(|f| f.prior.is_some()) {
        model.parameters[free.parameter].value = best.refined.parameters[free.parameter];
    }
    let fitted = others.iter().flat_map(|&other| &best.added[other]);
    for ((index, added), (own, _)) in applied.fitted.iter().zip(fitted) {
        model.parameters[*index].value = added.stated(best.refined.parameters[*own]);
    }
    hypotheses.iter().for_each(|hypothesis| hypothesis.tell(&mut model));
    Ok(model)
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
