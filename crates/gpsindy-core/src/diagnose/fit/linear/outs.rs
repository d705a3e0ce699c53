//! What a fit's outputs would do without one or two of its effects, everything else unchanged.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis};
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::place::Family;
use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::linear::basis::Out;
use crate::diagnose::fit::linear::responses::changes;
use nalgebra::DVector;

/// One for each effect of the fit, and one for each pair of them; those that no simulation can do without are left out.
pub(crate) fn outs(nominal: &Contestant, at: &Linearised<'_>, scene: &Scene) -> Vec<Out> {
    let count = at.contestant.hypotheses.len();
    let single = |place: usize| {
        let Rest { applied, values } = Rest::without(nominal, at.contestant, scene, place)?;
        let moved = moved(at.contestant, &applied, &values, &[]);
        let change = changes(at, &applied.model, &moved, &[values])?.pop()?;
        let is_finite = change.iter().all(|values| values.iter().all(|v| v.is_finite()));
        is_finite.then_some((place, change))
    };
    let singles: Vec<(usize, Vec<DVector<f64>>)> = (0..count).filter_map(single).collect();
    let mut all: Vec<Out> = singles.iter().map(|(place, change)| out(at, vec![*place], change.clone())).collect();
    for (i, (first, change)) in singles.iter().enumerate() {
        for (second, other) in &singles[i + 1..] {
            let both = change.iter().zip(other).map(|(a, b)| a + b).collect();
            all.push(out(at, vec![*first, *second], both));
        }
    }
    all
}

fn out(at: &Linearised<'_>, places: Vec<usize>, change: Vec<DVector<f64>>) -> Out {
    let Contestant { added, free, .. } = at.contestant;
    let own = places.iter().flat_map(|&place| &added[place]);
    let free = own.filter_map(|(index, _)| free.iter().position(|f| f.parameter == *index)).collect();
    Out { places, free, change }
}

/// Whether one of two effects acts on what the other makes of the same control or column, so that it does something else in its place
/// than besides it.
pub(crate) fn interact(one: &Hypothesis, other: &Hypothesis) -> bool {
    let of_control = |h: &Hypothesis| matches!(h.family(), Family::InputStatic | Family::InputDynamic | Family::Memory);
    let of_sensor = |h: &Hypothesis| h.family() == Family::Sensor;
    let share_control = of_control(one) && of_control(other) && one.variables.first() == other.variables.first();
    share_control || (of_sensor(one) && of_sensor(other) && one.state == other.state)
}

/// Columns of every start of `hypothesis` in the place of the effect that is left out, as differences from the fit without that one.
pub(crate) fn in_place(
    nominal: &Contestant,
    at: &Linearised<'_>,
    hypothesis: &Hypothesis,
    out: &Out,
    (scene, known): (&Scene, &Scene),
) -> Option<Vec<Vec<Vec<DVector<f64>>>>> {
    let &[place] = out.places.as_slice() else { return None };
    let Rest { applied: rest, values } = Rest::without(nominal, at.contestant, known, place)?;
    let applied = hypothesis.apply(&rest.model, scene).ok()?;
    let set = |column: &Vec<f64>| {
        let added = applied.model.parameters[values.len()..].iter().map(|p| p.value);
        let mut set: Vec<f64> = values.iter().copied().chain(added).collect();
        applied.fitted.iter().zip(column).for_each(|((index, _), value)| set[*index] = *value);
        set
    };
    let sets: Vec<Vec<f64>> = applied.starts.iter().flat_map(|start| &start.columns).map(set).collect();
    let freed: Vec<usize> = applied.fitted.iter().map(|(index, _)| *index).collect();
    let moved = moved(at.contestant, &rest, &values, &freed);
    let mut columns = changes(at, &applied.model, &moved, &sets)?.into_iter();
    let less = |column: Vec<DVector<f64>>| column.iter().zip(&out.change).map(|(a, b)| a - b).collect();
    Some(applied.starts.iter().map(|start| columns.by_ref().take(start.columns.len()).map(less).collect()).collect())
}

/// The model of a fit without one of its effects, and the values of all its parameters.
struct Rest {
    applied: Applied,
    values: Vec<f64>,
}

impl Rest {
    fn without(nominal: &Contestant, fitted: &Contestant, scene: &Scene, place: usize) -> Option<Self> {
        let others = || (0..fitted.hypotheses.len()).filter(|other| *other != place);
        let kept: Vec<&Hypothesis> = others().map(|other| &fitted.hypotheses[other]).collect();
        let applied = joint::apply(&kept, nominal.system.model(), scene).ok()?;
        let mut values: Vec<f64> = applied.model.parameters.iter().map(|p| p.value).collect();
        // What the effect had freed goes back to what it was; what is merely tolerated stays where the fit has it.
        let freed = |index: usize| fitted.added[place].iter().any(|(own, _)| *own == index);
        for (index, value) in values[..nominal.refined.parameters.len()].iter_mut().enumerate() {
            let source = if freed(index) { nominal } else { fitted };
            *value = source.refined.parameters[index];
        }
        let kept_values = others().flat_map(|other| fitted.values(other));
        applied.fitted.iter().zip(kept_values).for_each(|((index, _), value)| values[*index] = value);
        Some(Self { applied, values })
    }
}

/// The parameters of a fit that another model has with other values, or not at all; those of number `freed` it moves.
fn moved(fitted: &Contestant, other: &Applied, values: &[f64], freed: &[usize]) -> Vec<usize> {
    let own = fitted.system.model();
    let is_same = |index: &usize| {
        let found = other.model.parameter_index(&own.parameters[*index].name);
        found.is_some_and(|found| !freed.contains(&found) && values[found] == fitted.refined.parameters[*index])
    };
    (0..own.parameters.len()).filter(|index| !is_same(index)).collect()
}
