//! Responses: by how much the outputs of a fit change where a hypothesis is switched on.

use crate::diagnose::catalogue::hypothesis::Applied;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::lagging::with_lagging;
use crate::expression::Expression;
use crate::model::change::Change;
use crate::model::{Model, System};
use crate::refine::tally::Purpose;
use crate::refine::{Block, Experiment, Job, Log, Path, lanes::Lanes, roll_together};
use nalgebra::DVector;

/// Columns that are rolled out at once: the width of the widest vector registers in doubles. Exact.
pub(crate) const LANES: usize = 8;

/// Change of the noise-scaled outputs for every column; zero where nothing was measured. `None` for a model that can't be made.
pub(crate) fn responses(
    applied: &Applied,
    at: &Linearised<'_>,
    columns: &[&Vec<f64>],
) -> Option<Vec<Vec<DVector<f64>>>> {
    let own = &at.contestant.refined.parameters;
    let mut values: Vec<f64> = applied.model.parameters.iter().map(|p| p.value).collect();
    values[..own.len()].copy_from_slice(own);
    let set = |column: &&Vec<f64>| {
        let mut values = values.clone();
        applied.fitted.iter().zip(column.iter()).for_each(|((index, _), value)| values[*index] = *value);
        values
    };
    let sets: Vec<Vec<f64>> = columns.iter().map(set).collect();
    let moved: Vec<usize> = applied.fitted.iter().map(|(index, _)| *index).filter(|index| *index < own.len()).collect();
    changes(at, &applied.model, &moved, &sets)
}

/// The same for each of several `terms` of the rate of a row, taken `size` times; `None` where there is no path to draw them along.
pub(crate) fn responses_to_terms(
    at: &Linearised<'_>,
    row: usize,
    terms: &[Expression],
    size: f64,
) -> Option<Vec<Vec<DVector<f64>>>> {
    let (path, fitted) = (at.path.as_ref()?, at.contestant);
    let terms = Change::terms(&fitted.system, row, terms).ok()??;
    let count = terms.entries.len();
    fitted.experiment.tally.columns(count);
    fitted.experiment.tally.pass(Purpose::Responses, (count * fitted.experiment.n_samples()).div_ceil(LANES));
    let along = (fitted.refined.parameters.as_slice(), size);
    let found = path.responses_to_terms(&fitted.system, &fitted.experiment, &terms, along);
    Some(found.into_iter().map(|values| scaled(at, values)).collect())
}

/// By how much the noise-scaled outputs of `model` differ from those of the fit, for each set of its parameters; `moved` are the
/// fit's parameters that it has with other values, or not at all.
pub(crate) fn changes(
    at: &Linearised<'_>,
    model: &Model,
    moved: &[usize],
    sets: &[Vec<f64>],
) -> Option<Vec<Vec<DVector<f64>>>> {
    let fitted = at.contestant;
    let experiment = &fitted.experiment;
    experiment.tally.columns(sets.len());
    if let Some(found) = at.path.as_ref().and_then(|path| along(path, at, model, moved, sets)) {
        return Some(found);
    }
    let experiment = &numbered_in(model, at, moved);
    let system = System::with_simulator(model, fitted.system.simulator().cloned()).ok()?;
    let system = system.with_followers(fitted.nominal_states()).ok()?;
    // States that only the fit has are left out, those that only the model has start where it has them.
    let known = system.n_states().min(fitted.system.n_states());
    let known = (0..known).take_while(|&j| model.states[j].name == fitted.system.model().states[j].name).count();
    let own = fitted.refined.initial.iter().map(|start| start[..known].to_vec()).collect();
    let initial = with_lagging(&system, experiment, own, known);
    if system.engine().is_some() {
        return Some(stepped(&system, (at, experiment), &initial, sets));
    }
    let rolled = |part: &[Vec<f64>]| {
        experiment.tally.pass(Purpose::Responses, experiment.n_samples());
        rolled(&system, (at, experiment), &initial, part)
    };
    Some(sets.chunks(LANES).flat_map(rolled).collect())
}

/// The logs of the fit, sizes that its runs have of their own numbered as in `model`; those that are `moved` it does not have.
fn numbered_in(model: &Model, at: &Linearised<'_>, moved: &[usize]) -> Experiment {
    renumbered(at, &|own| {
        let name = &at.contestant.system.model().parameters[own].name;
        if moved.contains(&own) { None } else { model.parameter_index(name) }
    })
}

fn renumbered(at: &Linearised<'_>, number: &dyn Fn(usize) -> Option<usize>) -> Experiment {
    let experiment = &at.contestant.experiment;
    if experiment.logs.iter().all(|log| log.own.is_empty()) {
        return experiment.clone();
    }
    let own = |log: &Log| log.own.iter().filter_map(|&(own, more)| Some((number(own)?, more))).collect();
    let logs: Vec<Log> = experiment.logs.iter().map(|log| Log { own: own(log), ..log.clone() }).collect();
    Experiment { logs: logs.into(), ..experiment.clone() }
}

/// By straight lines from the path of the fit; `None` where the model has other states or reads late.
fn along(
    path: &Path,
    at: &Linearised<'_>,
    model: &Model,
    moved: &[usize],
    sets: &[Vec<f64>],
) -> Option<Vec<Vec<DVector<f64>>>> {
    let Linearised { contestant: fitted, .. } = at;
    let (system, experiment, own) = (&fitted.system, &fitted.experiment, &fitted.refined.parameters);
    let change = Change::between(system, model, moved).ok()??;
    let with_own = |set: &Vec<f64>| set.iter().copied().chain(moved.iter().map(|&index| own[index])).collect();
    let sets: Vec<Vec<f64>> = sets.iter().map(with_own).collect();
    experiment.tally.pass(Purpose::Responses, (sets.len() * experiment.n_samples()).div_ceil(LANES));
    // The fit's own values of what is moved stand behind those of the model.
    let count = model.parameters.len();
    let experiment = &renumbered(at, &|own| match moved.iter().position(|&index| index == own) {
        Some(place) => Some(count + place),
        None => model.parameter_index(&system.model().parameters[own].name),
    });
    Some(path.responses(system, experiment, &change, &sets).into_iter().map(|values| scaled(at, values)).collect())
}

/// Readings of every window in units of their noise; zero where nothing was measured.
fn scaled(at: &Linearised<'_>, values: Vec<Vec<f64>>) -> Vec<DVector<f64>> {
    let noise = &at.contestant.experiment.noise;
    let window = |(mut values, block): (Vec<f64>, &Block)| {
        for (sample, present) in values.chunks_exact_mut(noise.len()).zip(block.present.chunks_exact(noise.len())) {
            for ((value, &is_there), noise) in sample.iter_mut().zip(present).zip(noise) {
                *value = if is_there { *value / noise } else { 0.0 };
            }
        }
        DVector::from_vec(values)
    };
    values.into_iter().zip(&at.jacobian.blocks).map(window).collect()
}

/// By rollouts, as many sets side by side as there are lanes.
fn rolled(
    system: &System,
    (at, experiment): (&Linearised<'_>, &Experiment),
    initial: &[Vec<f64>],
    sets: &[Vec<f64>],
) -> Vec<Vec<DVector<f64>>> {
    let jacobian = &at.jacobian;
    let n_columns = experiment.columns.len();
    let lane = |p: usize| std::array::from_fn(|lane| sets[lane.min(sets.len() - 1)][p]);
    let parameters: Vec<[f64; LANES]> = (0..system.n_parameters()).map(lane).collect();
    let mut out: Vec<Vec<DVector<f64>>> = vec![Vec::with_capacity(experiment.windows.len()); sets.len()];
    let mut lanes: Option<(usize, Lanes<'_, LANES>)> = None;
    for (w, window) in experiment.windows.iter().enumerate() {
        let log = &experiment.logs[window.log];
        let lanes = match &mut lanes {
            Some((index, lanes)) if *index == window.log => lanes,
            other => {
                &mut other
                    .insert((window.log, Lanes::new(system, log, (experiment.hold, experiment.past), &parameters)))
                    .1
            }
        };
        let block = &jacobian.blocks[w];
        let rows = block.residual.len();
        let mut results = vec![DVector::zeros(rows); sets.len()];
        let start: Vec<[f64; LANES]> = initial[w].iter().map(|&v| [v; LANES]).collect();
        lanes.roll((window.first, window.last), &start, &experiment.columns, experiment.substeps, |i, c, v| {
            let row = (i - window.first) * n_columns + c;
            if block.present[row] {
                let base = log.measured[c][i] / experiment.noise[c] - block.residual[row];
                for (lane, result) in results.iter_mut().enumerate() {
                    result[row] = v[lane] / experiment.noise[c] - base;
                }
            }
        });
        for (list, result) in out.iter_mut().zip(results) {
            list.push(result);
        }
    }
    out
}

/// The same where the simulator steps on its own: one list of changes a window for each set of `parameters`.
fn stepped(
    system: &System,
    (at, experiment): (&Linearised<'_>, &Experiment),
    initial: &[Vec<f64>],
    parameters: &[Vec<f64>],
) -> Vec<Vec<DVector<f64>>> {
    let blocks = &at.jacobian.blocks;
    let n_columns = experiment.columns.len();
    let windows = 0..experiment.windows.len();
    let job = |window: usize, parameters: &Vec<f64>| Job {
        window,
        parameters: parameters.clone(),
        initial: initial[window].clone(),
    };
    let jobs: Vec<Job> = windows.flat_map(|w| parameters.iter().map(move |p| job(w, p))).collect();
    let empty: Vec<DVector<f64>> = blocks.iter().map(|b| DVector::zeros(b.residual.len())).collect();
    let mut out = vec![empty; parameters.len()];
    let mut receive = |job: usize, sample: usize, c: usize, value: f64| {
        let (w, set) = (job / parameters.len(), job % parameters.len());
        let window = experiment.windows[w];
        let row = (sample - window.first) * n_columns + c;
        if blocks[w].present[row] {
            let measured = experiment.logs[window.log].measured[c][sample];
            let base = measured / experiment.noise[c] - blocks[w].residual[row];
            out[set][w][row] = value / experiment.noise[c] - base;
        }
    };
    // A straight line from the fitted rollout says where a suspect would take it, without a rollout of its own.
    match at.lines() {
        Some((tangent, windows)) => {
            // Along the logs a suspect's commands are large for what they change.
            let how = (&experiment.columns[..], at.guide.is_some());
            tangent.roll(system, (experiment, &windows), &jobs, how, &mut receive);
        }
        None => roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut receive),
    }
    out
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::enumerate::everything;
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fit::outputs::scene_of;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::limits::Budget;
    use crate::refine::Experiment;

    /// By every start of every suspect of a drive: how far responses by straight lines are from those by rollouts, as a share.
    fn misses(substeps: usize) -> Vec<(String, f64)> {
        let (model, data) = drive(None, |x| 1.3 * x, 1e-3, (2, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap().with_windows_of(2.0);
        let experiment = Experiment { substeps, ..experiment };
        let fitted = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let (scene, at) = (scene_of(&fitted), fitted.linearised().unwrap());
        let all = everything(&model, &scene, &fitted.experiment.columns, &[]).unwrap();
        let mut misses = Vec::new();
        for hypothesis in &all {
            let Ok(applied) = hypothesis.apply(&model, &scene) else { continue };
            // Sizes of a straight line are small; other starts are finite steps, of which the plant sees its own bend.
            let starts = applied.starts.iter().filter(|start| !start.amplitudes.is_empty());
            let columns: Vec<&Vec<f64>> = starts.flat_map(|s| &s.columns).take(LANES).collect();
            if columns.is_empty() || applied.model.states.len() > 1 {
                continue;
            }
            let by_lines = responses(&applied, &at, &columns).unwrap();
            let by_rollouts =
                responses(&applied, &Linearised { path: None, ..fitted.linearised().unwrap() }, &columns).unwrap();
            let norm = |column: &[DVector<f64>]| column.iter().map(DVector::norm_squared).sum::<f64>().sqrt();
            for (line, rolled) in by_lines.iter().zip(&by_rollouts) {
                let off: Vec<DVector<f64>> = line.iter().zip(rolled).map(|(a, b)| a - b).collect();
                misses.push((hypothesis.id().to_string(), norm(&off) / norm(rolled).max(1e-12)));
            }
        }
        misses
    }

    #[test]
    fn straight_lines_along_a_path_are_the_responses_of_small_effects() {
        let found = misses(4);
        assert!(found.len() > 40, "{}", found.len());
        // Corners within a step, and the bend of the plant over a thousandth of its rate.
        let far: Vec<&(String, f64)> = found.iter().filter(|(_, miss)| *miss > 0.03).collect();
        assert!(far.is_empty(), "{far:?}");
    }
}
