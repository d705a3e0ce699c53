//! Level at rest of dry friction, by trial.
//!
//! A control that is held changes its force in steps, so that a machine at rest lets go with one of them or with another: how the logs are
//! missed changes in jumps when the level at rest moves, and a fit that follows derivatives leaves it where it is. And a machine that lets go
//! at another step is elsewhere from then on. So ratios of the two levels are tried between starts of their own (multiple shooting, Bock
//! 1983), about a fit in which the levels are one; the best, if it is worth it, is fitted and goes on to the whole rollouts on ever finer lattices.

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{
    Budget, CHAIN_GAIN, CONVINCING, NARROWED, OF_A_HIT, POOR, RATIO_AT_REST, RATIOS_AT_REST, STEPS_AT_REST,
    WIDEST_AT_REST,
};
use crate::error::{Result, unless_refused};
use crate::model::System;
use crate::refine::{Experiment, Free, Point, Profile, guess_initial, misses};

/// Puts the level at rest among those `fitted`, and what is `free` beside it, in `point` where the logs are missed by less. A fit that only
/// ranks looks for it widely, any other one about where it is.
pub(crate) fn settle(
    system: &System,
    experiment: &Experiment,
    (fitted, free): (&[(usize, Added)], &[Free]),
    (point, budget): (&mut Point, Budget),
) -> Result<()> {
    let Some((level, rest)) = levels(fitted).filter(|_| system.engine().is_none()) else { return Ok(()) };
    let mut widths = if budget.only_ranks() { &NARROWED[..] } else { &NARROWED[2..] };
    if point.parameters[rest] <= point.parameters[level] {
        let Some(parameters) = begun(system, experiment, (level, rest), free, point)? else { return Ok(()) };
        point.parameters = parameters;
        widths = &NARROWED[1..];
    }
    point.initial = rested(system, experiment, &point.parameters, &point.initial);
    narrow(system, experiment, (level, rest), (free, widths), point)
}

/// The levels in motion and at rest among those that are fitted.
fn levels(fitted: &[(usize, Added)]) -> Option<(usize, usize)> {
    fitted.windows(2).find(|pair| pair[1].1.role == Role::AtRest).map(|pair| (pair[0].0, pair[1].0))
}

/// The parameters with the best of many ratios of the levels on short rollouts; none where no ratio is convincing, or can be followed.
fn begun(
    system: &System,
    experiment: &Experiment,
    (level, rest): (usize, usize),
    free: &[Free],
    point: &Point,
) -> Result<Option<Vec<f64>>> {
    let short = experiment.clone().with_windows_of(OF_A_HIT * experiment.longest_window());
    // Some of the windows stand for all of a long log.
    let short = if short.n_samples() > experiment.n_samples() { experiment.clone() } else { short };
    let fitted = |mut point: Point| -> Result<Option<Point>> {
        point.initial = rested(system, &short, &point.parameters, &point.initial);
        let at = (&point.parameters[..], free);
        let found = unless_refused(Budget::Rough.refine().fit_on(system, &short, at, &point.initial, None))?;
        Ok(found.map(|found| Point { parameters: found.parameters, initial: found.initial }))
    };
    let start = Point { parameters: point.parameters.clone(), initial: guess_initial(system, &short) };
    let Some(equal) = fitted(start)? else { return Ok(None) };
    let Some(costs) = unless_refused(costs_apart(system, &short, (level, rest), (free, &equal)))? else {
        return Ok(None);
    };
    let Some((apart, least)) = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(None) };
    // Most machines never rest. Where more than noise is left, what is gained must pay for a level and for the ratios, and values repeat each
    // other: as many count alone as there is noise. Far above it they say little, and the squares must fall by what is worth a fit.
    let count = short.n_values() as f64;
    let gain = 0.5 * count * (count / least).min(1.0) * (costs[0].1 / least).ln();
    let price = if *least > POOR * count { 0.5 * count.ln() + (costs.len() as f64).ln() } else { 0.0 };
    let is_convincing = gain > CONVINCING + price;
    if !(is_convincing || *least < (1.0 - CHAIN_GAIN) * costs[0].1) {
        return Ok(None);
    }
    let Some(mut point) = fitted(apart.clone())? else { return Ok(None) };
    narrow(system, &short, (level, rest), (free, &NARROWED[..1]), &mut point)?;
    Ok(Some(point.parameters))
}

/// Points about one where the levels are `equal`, the level at rest ever higher from there on, and their costs once what else is `free` has
/// taken a step.
fn costs_apart(
    system: &System,
    experiment: &Experiment,
    (level, rest): (usize, usize),
    (free, equal): (&[Free], &Point),
) -> Result<Vec<(Point, f64)>> {
    let others: Vec<Free> = free.iter().filter(|f| ![level, rest].contains(&f.parameter)).cloned().collect();
    let profile = Profile::new(system, experiment, (equal, &others), None, None)?;
    let at = |step: usize| {
        let mut parameters = equal.parameters.clone();
        parameters[rest] = parameters[level] * RATIO_AT_REST.powi(step as i32);
        let initial = rested(system, experiment, &parameters, &equal.initial);
        Point { parameters, initial }
    };
    let points: Vec<Point> = (0..=RATIOS_AT_REST).map(at).collect();
    let costs = profile.costs(&points);
    Ok(points.into_iter().zip(costs).collect())
}

/// Moves either level to the best of ever finer lattices around it, of these `widths`, and what is free with it. Where the machine stops for a moment decides as
/// suddenly as where it starts.
fn narrow(
    system: &System,
    experiment: &Experiment,
    (level, rest): (usize, usize),
    (free, widths): (&[Free], &[f64]),
    point: &mut Point,
) -> Result<()> {
    for (width, parameter) in widths.iter().flat_map(|&width| [(width, rest), (width, level)]) {
        let around = costs_around(system, experiment, (parameter, free), point, width);
        let Some(costs) = unless_refused(around)? else { return Ok(()) };
        let here = costs[costs.len() / 2].1;
        let Some(&(value, least)) = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if !(least < here) {
            continue;
        }
        let mut moved = point.clone();
        moved.parameters[parameter] = value;
        moved.initial = rested(system, experiment, &moved.parameters, &moved.initial);
        let at = (&moved.parameters[..], free);
        let fit = Budget::Rough.refine().fit_on(system, experiment, at, &moved.initial, None);
        // The lattice reckons what else is free along straight lines.
        if let Some(found) = unless_refused(fit)?.filter(|found| found.cost < here) {
            *point = Point { parameters: found.parameters, initial: found.initial };
        }
    }
    Ok(())
}

/// Values of a level around that of `point`, which is the middle one, to a share `width` of it, and the costs of each, what else is `free` having
/// taken a step.
fn costs_around(
    system: &System,
    experiment: &Experiment,
    (level, free): (usize, &[Free]),
    point: &Point,
    width: f64,
) -> Result<Vec<(f64, f64)>> {
    let others: Vec<Free> = free.iter().filter(|f| f.parameter != level).cloned().collect();
    let profile = Profile::new(system, experiment, (point, &others), None, None)?;
    let half = STEPS_AT_REST as f64 / 2.0;
    let factor = |i: usize| (width * (i as f64 - half) / half).exp();
    let values: Vec<f64> = (0..=STEPS_AT_REST).map(|i| point.parameters[level] * factor(i)).collect();
    let at = |&value: &f64| {
        let mut trial = point.clone();
        trial.parameters[level] = value;
        trial
    };
    let costs = profile.costs(&values.iter().map(at).collect::<Vec<_>>());
    Ok(values.into_iter().zip(costs).collect())
}

/// How far the level at rest that is the parameter `rest` may be off before the squares of the logs (noise units) are greater by `least`.
pub(crate) fn least_distinguished(fit: &Contestant, (rest, added): &(usize, Added), least: f64) -> Option<f64> {
    if added.role != Role::AtRest {
        return None;
    }
    let point = Point { parameters: fit.refined.parameters.clone(), initial: fit.refined.initial.clone() };
    let costs = costs_around(&fit.system, &fit.experiment, (*rest, &fit.free), &point, WIDEST_AT_REST).ok()?;
    let middle = costs.len() / 2;
    let is_worse = |&(_, cost): &(f64, f64)| cost > costs[middle].1 + least;
    let above = costs[middle..].iter().find(|c| is_worse(c))?.0;
    let below = costs[..middle].iter().rfind(|c| is_worse(c))?.0;
    Some((above - costs[middle].0).max(costs[middle].0 - below))
}

/// The initial states with what friction holds at rest where it is, in the windows that are missed by less then: a reading that is off by its
/// noise would let go what takes more to start than to go on.
pub(crate) fn rested(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let held = system.sticks().map_or_else(Vec::new, |sticks| sticks.firmly_held(parameters));
    if held.is_empty() {
        return initial.to_vec();
    }
    let at_rest = |start: &Vec<f64>| {
        let mut start = start.clone();
        held.iter().for_each(|&state| start[state] = 0.0);
        start
    };
    let other: Vec<Vec<f64>> = initial.iter().map(at_rest).collect();
    let points = [initial, &other].map(|i| Point { parameters: parameters.to_vec(), initial: i.to_vec() });
    let mut squares = [vec![0.0; initial.len()], vec![0.0; initial.len()]];
    misses(system, experiment, &points, None, |point, window, _, missed| squares[point][window] += missed * missed);
    let nearer = |w: usize| if squares[1][w] < squares[0][w] { other[w].clone() } else { initial[w].clone() };
    (0..initial.len()).map(nearer).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::slider_model;
    use crate::diagnose::report::{Parameter, Verdict};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// Four logs of `x' = v`, `v' = u - 4 x - 0.8 v` beside dry friction of 0.5 that holds with `rest`, under steps of force.
    fn sticking(rest: f64) -> Dataset {
        const STEP: f64 = 0.02;
        const FINE: f64 = STEP / 40.0;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let runs = (0..4).map(|run| {
            let time: Vec<f64> = (0..300).map(|i| STEP * f64::from(i)).collect();
            let (mut x, mut v, mut values) = (0.0_f64, 0.0_f64, Mat::zeros(300, 3));
            for (i, t) in time.iter().enumerate() {
                let level = f64::from(((i as i32 / 37 + run) * 7) % 5 - 2);
                let u = 1.5 * (0.8 * t + f64::from(run)).sin() + 0.4 * level;
                values[(i, 0)] = x + 1e-3 * normal(&mut random);
                values[(i, 1)] = v + 4e-3 * normal(&mut random);
                values[(i, 2)] = u;
                for _ in 0..40 {
                    let force = u - 4.0 * x - 0.8 * v;
                    let next = match v == 0.0 {
                        true if force.abs() <= rest => 0.0,
                        true => FINE * (force - 0.5 * force.signum()),
                        false => v + FINE * (force - 0.5 * v.signum()),
                    };
                    // Where it turns it stops.
                    let next = if next * v < 0.0 { 0.0 } else { next };
                    x += 0.5 * FINE * (v + next);
                    v = next;
                }
            }
            Run { name: format!("{run}"), time, values }
        });
        Dataset::new(["x", "v", "u"].map(Channel::new).into(), runs.collect()).unwrap()
    }

    /// What is named, and its sizes.
    fn named(rest: f64) -> (Verdict, Vec<String>, Vec<Parameter>) {
        let (train, holdout) = hold_out(&sticking(rest)).unwrap();
        let model = slider_model("u - 4*x - 0.8*v");
        let frictions = ["coulomb_friction", "stribeck_friction", "stiction", "viscous_friction"];
        let diagnose = Diagnose { effects: frictions.map(String::from).into(), ..Diagnose::default() };
        let found = diagnose.run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let sizes = found.included().flat_map(|cause| cause.parameters.clone()).collect();
        (found.verdict, found.included().map(|cause| cause.effect.clone()).collect(), sizes)
    }

    #[test]
    fn a_slider_that_lets_go_at_twice_the_level_in_motion_has_stiction_with_both_levels() {
        let (verdict, names, sizes) = named(1.0);
        assert_eq!((verdict, names), (Verdict::Explained, vec!["stiction".to_string()]), "{sizes:?}");
        for (size, (name, truth)) in sizes.into_iter().zip([("c", 0.5), ("s", 1.0)]) {
            let Parameter { name: symbol, value, low, high, .. } = size;
            assert_eq!(symbol, name);
            assert!((value / truth - 1.0).abs() < 0.05, "{symbol} = {value}");
            // Which of the forces let it go leaves the level at rest between two of them.
            assert!(low.unwrap() < value && value < high.unwrap(), "{symbol}: {low:?} to {high:?}");
            assert!((low.unwrap() - 0.05 * truth..high.unwrap() + 0.05 * truth).contains(&truth), "{symbol}");
        }
    }

    #[test]
    fn a_slider_that_holds_with_the_level_in_motion_has_coulomb_friction() {
        let (verdict, names, _) = named(0.5);
        assert_eq!((verdict, names), (Verdict::Explained, vec!["coulomb_friction".to_string()]));
    }
}
