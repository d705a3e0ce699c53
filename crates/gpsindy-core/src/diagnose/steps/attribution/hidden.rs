//! Hidden: how far another number of the simulator, wrong as well, could hide that one is wrong.
//!
//! The damping of a joint and the gain of its servo act alike. Logs that show either alone to a thousandth show nothing of the two where
//! one is too large by what the other is too small.

use crate::diagnose::fit::colours::noise::Noise;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::linear::basis::Basis;
use crate::diagnose::fit::linear::responses::responses;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::survey::Screened;
use nalgebra::DVector;

/// States of every suspect that is a wrong parameter which share of its response, squared, one of the others can take back; what the
/// present fit leaves free is taken out of all of them.
pub(crate) fn find(contest: &Contest<'_>, suspects: &mut [Option<Screened>], at: &Linearised<'_>) {
    let is_number = |s: &Screened| s.members.len() == 1 && contest.hypotheses[s.members[0]].frees().is_some();
    let (mut places, mut columns) = (Vec::new(), Vec::new());
    for (place, screened) in suspects.iter().enumerate() {
        let Some(screened) = screened.as_ref().filter(|s| is_number(s)) else { continue };
        let straight = screened.applied.starts.iter().find(|start| !start.amplitudes.is_empty());
        let found = straight.and_then(|start| responses(&screened.applied, at, &[start.columns.first()?])?.pop());
        if let Some(column) = found.filter(|column| column.iter().flatten().all(|value| value.is_finite())) {
            places.push(place);
            columns.push(column);
        }
    }
    if places.len() < 2 || contest.run.is_out_of_time() {
        return;
    }
    let before: Vec<f64> =
        columns.iter().map(|c: &Vec<DVector<f64>>| c.iter().map(DVector::norm_squared).sum()).collect();
    let Some((gram, _)) = Basis::new(at, Noise::Coloured, &[]).products(&mut columns).into_iter().next() else {
        return;
    };
    // What is left of a column after the projection must not be rounding error.
    let is_there = |i: usize| gram[(i, i)] > 1e-9 * before[i];
    for (i, &place) in places.iter().enumerate().filter(|(i, _)| is_there(*i)) {
        let others = (0..places.len()).filter(|&j| j != i && is_there(j));
        let shared = others.map(|j| gram[(i, j)].powi(2) / (gram[(i, i)] * gram[(j, j)])).fold(0.0, f64::max);
        if let Some(screened) = suspects[place].as_mut() {
            screened.hidden = shared.min(1.0);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::fixture::drive;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::Parameter;
    use crate::progress::Silent;

    /// Parameters of the drive with this equation whose errors are excluded above some size, by logs of the machine that it describes.
    fn excluded(equation: &str, parameters: &[(&str, f64)]) -> Vec<String> {
        let (mut model, data) = drive(None, |x| x, 0.01, (3, 300));
        model.states[0].equation = Expression::parse(equation).unwrap();
        model.parameters = parameters.iter().map(|&(name, value)| Parameter::new(name, value)).collect();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        assert_eq!(found.verdict, Verdict::NoGap);
        let errors = found.excluded.iter().filter(|e| e.effect == "parameter_error");
        errors.map(|e| e.variables[0].clone()).collect()
    }

    #[test]
    fn an_error_that_another_one_can_cancel_is_not_excluded() {
        assert_eq!(excluded("u - k*x", &[("k", 1.0)]), ["k"]);
        assert_eq!(excluded("g*u - (a + b)*x", &[("g", 1.0), ("a", 0.6), ("b", 0.4)]), ["g"]);
    }
}
