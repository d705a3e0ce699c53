//! Functions without a name along the states that a filter found.

use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::filter::{Acts, Course, Filtered};
use crate::error::Result;
use crate::expression::Expression;
use crate::model::{State, System};
use crate::refine::lanes::Lanes;

/// Every member of `rival` at every sample of the stretches of `found`.
///
/// # Errors
/// A function that can't be written into the model.
pub(crate) fn courses(rival: &Rival, acts: Acts, fit: &Contestant, found: &Filtered) -> Result<Vec<Course>> {
    let mut model = fit.system.model().clone();
    let n = model.states.len();
    for (k, member) in rival.members().iter().enumerate() {
        // A reading of a state of its own, because readings may look at the past of the controls.
        let mut state = State::new(format!("member__{k}"), Expression::Number(0.0));
        state.measured = Some(member.clone());
        model.states.push(state);
    }
    let system = System::new(&model)?;
    let columns: Vec<usize> = (n..model.states.len()).collect();
    let parameters: Vec<[f64; 1]> = fit.refined.parameters.iter().map(|&v| [v]).collect();
    let experiment = &fit.experiment;
    let mut all: Vec<Course> = vec![Vec::new(); columns.len()];
    for (log, path) in found.path(acts) {
        let mut lanes =
            Lanes::<1>::new(&system, &experiment.logs[log], (experiment.hold, experiment.past), &parameters);
        let mut stretch: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        for (number, state) in path {
            let mut start: Vec<[f64; 1]> = state[..n].iter().map(|&v| [v]).collect();
            start.resize(model.states.len(), [0.0]);
            lanes.roll((number, number), &start, &columns, 1, |_, c, value| stretch[c].push(value[0]));
        }
        for (course, stretch) in all.iter_mut().zip(stretch) {
            course.push(stretch);
        }
    }
    Ok(all)
}
