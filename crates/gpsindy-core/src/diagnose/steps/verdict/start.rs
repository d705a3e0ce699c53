//! The initial state of a held-out rollout, from the first samples of the log.
//!
//! The prior is a parabola through as many first samples as it fits to within the noise. The model then refines the initial
//! state on the beginning of the rollout, where its residual is weighted by its own size and colour. A correct model thus
//! finds its initial state to a fraction of the noise; a wrong one cannot shift it to hide its errors.

use crate::diagnose::fit::colours::colour::colours;
use crate::diagnose::fit::fitter::{above_noise, standing_out};
use crate::diagnose::fit::lagging::with_lagging;
use crate::diagnose::fit::tried::breakaway::rested;
use crate::diagnose::limits::Budget;
use crate::diagnose::limits::start::{
    BEGINNING, FEWEST_SAMPLES, LONGER_PARABOLA, PARABOLA_OFF, PARABOLA_ROUGH, SHORTEST_PARABOLA, START_ROUNDS,
    START_STEPS, UNTOLD,
};
use crate::model::System;
use crate::refine::{
    Experiment, Jacobian, Log, Point, Window, chained_starts, drawn_around, drawn_starts, draws_of_readings,
    guess_initial, guess_starts, nearer_starts,
};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// What the first samples say of one window's start.
struct Belief {
    /// By logged column.
    readings: Vec<Option<Reading>>,
    /// By state: mean and deviation.
    states: Vec<(f64, f64)>,
}

/// The first reading of a column, as its neighbours give it.
struct Reading {
    /// The sample that it is of.
    sample: usize,
    /// By how much it is more than what was measured there.
    more: f64,
    deviation: f64,
}

/// Starts of all windows of `experiment` with every parameter fixed; the same rule for every model.
pub(crate) fn starts(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    nominal_states: usize,
) -> Vec<Vec<f64>> {
    let beginning = Experiment { windows: beginnings(experiment), ..experiment.clone() };
    let beliefs = beliefs(system, &beginning, nominal_states);
    let believed: Vec<Vec<f64>> = beliefs.iter().map(|b| b.states.iter().map(|s| s.0).collect()).collect();
    let believed = rested(system, &beginning, parameters, &believed);
    let settings = Budget::Usual.refine();
    // Rollouts that stop at the nearest saturation are followed from their first samples on.
    let followed = system.engine().and_then(|_| guess_starts(system, &beginning, parameters).ok());
    let from = followed.map(|guess| with_lagging(system, &beginning, guess, nominal_states));
    let free = settings.fit(system, &beginning, parameters, &[], Some(from.as_ref().unwrap_or(&believed)));
    let mut initial = free.map_or_else(|_| believed.clone(), |fit| fit.initial);
    if system.engine().is_some() {
        initial = beyond_events(system, (&beginning, &experiment.windows), parameters, initial);
    }
    for _ in 0..START_ROUNDS {
        initial = rested(system, &beginning, parameters, &initial);
        initial = refined(system, &beginning, parameters, &beliefs, initial, &believed);
    }
    if system.engine().is_some() {
        let drawn = redrawn(system, &beginning, parameters, &beliefs, initial.clone());
        if drawn != initial {
            // Their fits may have moved them further than what is known of them allows.
            initial = refined(system, &beginning, parameters, &beliefs, drawn, &believed);
        }
    }
    rested(system, &beginning, parameters, &initial)
}

/// Starts of a simulator that steps, which may lie beyond saturations and stops that no fit passes: where the rollouts before them arrive, and
/// drawn ones where a window still stands out.
fn beyond_events(
    system: &System,
    (beginning, windows): (&Experiment, &[Window]),
    parameters: &[f64],
    starts: Vec<Vec<f64>>,
) -> Vec<Vec<f64>> {
    let fitted = |starts: Vec<Vec<f64>>| {
        let fit = Budget::Usual.refine().fit(system, beginning, parameters, &[], Some(&starts));
        fit.map_or((starts, Vec::new()), |fit| (fit.initial, standing_out(&fit.residuals)))
    };
    let (mut starts, doubted) = fitted(chained_starts(system, (beginning, windows), parameters, &starts));
    if doubted.is_empty() {
        return starts;
    }
    let mut draw = draws_of_readings(system, beginning);
    let Ok(drawn) = drawn_starts(system, beginning, parameters, &doubted, &mut draw) else { return starts };
    let mut other = starts.clone();
    doubted.into_iter().zip(drawn).for_each(|(w, start)| other[w] = start);
    starts = nearer_starts(system, beginning, parameters, [&starts, &other]);
    fitted(chained_starts(system, (beginning, windows), parameters, &starts)).0
}

/// Starts of a simulator that steps where what is left stands out: the best of those that are as likely as they are by what is known of them.
/// A servo may swing to one side or to the other by a hundredth of the noise, and no slope leads from one to the other.
fn redrawn(
    system: &System,
    beginning: &Experiment,
    parameters: &[f64],
    beliefs: &[Belief],
    mut initial: Vec<Vec<f64>>,
) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    for _ in 0..START_ROUNDS {
        let point = Point { parameters: parameters.to_vec(), initial: initial.clone() };
        let Ok(jacobian) = Jacobian::new(system, beginning, &point, &[]) else { break };
        let doubted = above_noise(&jacobian.residuals());
        if doubted.is_empty() {
            break;
        }
        let even = vec![1.0; beginning.columns.len()];
        let known = |w: usize| {
            let first = beginning.windows[w].first;
            Posterior::new(&jacobian, w, &initial[w], &beliefs[w], &even, &beginning.noise, first).curvature.cholesky()
        };
        let known: Vec<Option<Cholesky<f64, Dyn>>> = (0..initial.len()).map(known).collect();
        let mut draw = |w: usize| {
            let start = &initial[w];
            known[w].as_ref().map_or_else(|| start.clone(), |known| drawn_around(start, known, &mut random).0)
        };
        let Ok(drawn) = drawn_starts(system, beginning, parameters, &doubted, &mut draw) else { break };
        let mut other = initial.clone();
        doubted.into_iter().zip(drawn).for_each(|(w, start)| other[w] = start);
        let nearer = nearer_starts(system, beginning, parameters, [&initial, &other]);
        if nearer == initial {
            break;
        }
        initial = nearer;
    }
    initial
}

/// The windows' beginnings, on which their starts are refined.
pub(crate) fn beginnings(experiment: &Experiment) -> Vec<Window> {
    let fewest = FEWEST_SAMPLES * experiment.rows_a_value();
    let of = |w: &Window| {
        let samples = (BEGINNING * (w.last - w.first) as f64) as usize;
        Window { last: w.last.min(w.first + samples.max(fewest)), ..*w }
    };
    experiment.windows.iter().map(of).collect()
}

/// What the first samples of every window say of its start.
fn beliefs(system: &System, beginning: &Experiment, nominal_states: usize) -> Vec<Belief> {
    let guess = with_lagging(system, beginning, guess_initial(system, beginning), nominal_states);
    let model = system.model();
    let one = |(window, guess): (&Window, Vec<f64>)| {
        let log = &beginning.logs[window.log];
        let of_column = |c: usize| {
            let is_held = model.states[beginning.columns[c]].is_held();
            line(log, c, window, beginning.noise[c], is_held)
        };
        let lines: Vec<Option<Line>> = (0..beginning.columns.len()).map(of_column).collect();
        let state = |j: usize| {
            let place = model.integral_of(j).and_then(|i| Some((i, beginning.column_of(i)?)));
            let rate = place.and_then(|(place, c)| {
                let ((slope, deviation), per) = (lines[c].as_ref()?.slope, model.per_rate(place));
                Some((slope / per, deviation / per.abs()))
            });
            match rate.filter(|_| beginning.column_of(j).is_none()) {
                Some((slope, deviation)) => (slope, deviation.min(UNTOLD * beginning.scale[j])),
                None => (guess[j], UNTOLD * beginning.scale[j]),
            }
        };
        let reading = |(c, line): (usize, &Option<Line>)| {
            let line = line.as_ref()?;
            let more = line.value.0 - log.measured[c][line.sample];
            Some(Reading { sample: line.sample, more, deviation: line.value.1 })
        };
        let readings = lines.iter().enumerate().map(reading).collect();
        Belief { readings, states: (0..guess.len()).map(state).collect() }
    };
    beginning.windows.iter().zip(guess).map(one).collect()
}

/// A parabola through first samples: the first sample that is there, value and slope at it with their deviations.
struct Line {
    sample: usize,
    value: (f64, f64),
    slope: (f64, f64),
}

/// The parabola through as many first samples of column `c` as it follows to within the noise.
///
/// What a sensor holds moves in steps, which no parabola follows: there the first sample is taken as it is.
fn line(log: &Log, c: usize, window: &Window, noise: f64, is_held: bool) -> Option<Line> {
    let there: Vec<usize> = (window.first..=window.last).filter(|&i| log.measured[c][i].is_finite()).collect();
    let sample = *there.first()?;
    let points: Vec<(f64, f64)> = there.iter().map(|&i| (log.time[i] - log.time[sample], log.measured[c][i])).collect();
    let mut found = None;
    let mut count = SHORTEST_PARABOLA;
    while count <= points.len() && !is_held {
        let Some((line, excess)) = parabola(&points[..count], noise, sample) else { break };
        if excess > PARABOLA_OFF * (2.0 / (count - 3) as f64).sqrt() {
            break;
        }
        found = Some(line);
        count = ((count as f64 * LONGER_PARABOLA) as usize).max(count + 1);
    }
    let first = || {
        let end = points.get(2).or(points.last()).filter(|p| p.0 > 0.0);
        let slope = end.map(|p| {
            ((p.1 - points[0].1) / p.0, PARABOLA_ROUGH * (2f64.sqrt() * noise).max((p.1 - points[0].1).abs()) / p.0)
        });
        Line { sample, value: (points[0].1, PARABOLA_ROUGH * noise), slope: slope.unwrap_or((0.0, f64::INFINITY)) }
    };
    Some(found.unwrap_or_else(first))
}

/// The parabola through points, and by how much its residual exceeds the noise (in variances).
fn parabola(points: &[(f64, f64)], noise: f64, sample: usize) -> Option<(Line, f64)> {
    let span = points.last().map(|p| p.0).filter(|s| *s > 0.0)?;
    let row = |t: f64| Vector3::new(1.0, t / span, (t / span).powi(2));
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(t, v) in points {
        gram += row(t) * row(t).transpose();
        right += row(t) * v;
    }
    let inverse = gram.try_inverse()?;
    let found = inverse * right;
    let squares: f64 = points.iter().map(|&(t, v)| (v - row(t).dot(&found)).powi(2)).sum();
    let excess = squares / ((points.len() - 3) as f64 * noise * noise) - 1.0;
    let deviation = |i: usize| PARABOLA_ROUGH * noise * inverse[(i, i)].max(0.0).sqrt();
    let slope = (found[1] / span, deviation(1) / span);
    Some((Line { sample, value: (found[0], deviation(0)), slope }, excess))
}

/// Gauss-Newton steps of every window's start: its belief, and the beginning's residual by its own size and colour.
fn refined(
    system: &System,
    beginning: &Experiment,
    parameters: &[f64],
    beliefs: &[Belief],
    initial: Vec<Vec<f64>>,
    believed: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let at = |initial: &[Vec<f64>]| {
        let point = Point { parameters: parameters.to_vec(), initial: initial.to_vec() };
        Jacobian::new(system, beginning, &point, &[])
    };
    let (mut initial, mut jacobian) = match at(&initial) {
        Ok(jacobian) => (initial, jacobian),
        Err(_) => match at(believed) {
            Ok(jacobian) => (believed.to_vec(), jacobian),
            Err(_) => return believed.to_vec(),
        },
    };
    let n_columns = beginning.columns.len();
    let weights: Vec<Vec<f64>> = jacobian.residuals().iter().map(|r| weights(r, n_columns)).collect();
    let normal = |jacobian: &Jacobian, initial: &[Vec<f64>], w: usize| {
        Posterior::new(jacobian, w, &initial[w], &beliefs[w], &weights[w], &beginning.noise, beginning.windows[w].first)
    };
    for _ in 0..START_STEPS {
        let mut next = initial.clone();
        for (w, start) in next.iter_mut().enumerate() {
            if let Some(step) = normal(&jacobian, &initial, w).step() {
                start.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += step);
            }
        }
        let Ok(moved) = at(&next) else { break };
        // Windows don't know of each other: each takes its step where it helps.
        let helps: Vec<bool> =
            (0..next.len()).map(|w| normal(&moved, &next, w).cost < normal(&jacobian, &initial, w).cost).collect();
        if !helps.contains(&true) {
            break;
        }
        for w in (0..next.len()).filter(|&w| helps[w]) {
            initial[w].clone_from(&next[w]);
            jacobian.blocks[w].clone_from(&moved.blocks[w]);
        }
    }
    initial
}

/// By how much the residuals of each column count: one where they are noise, less where they are larger or last longer.
fn weights(residuals: &[f64], n_columns: usize) -> Vec<f64> {
    let one = |colour: &crate::diagnose::fit::colours::colour::Colour| {
        let size = colour.spectrum().max(colour.variance()).max(1.0);
        if size.is_finite() { 1.0 / size } else { 0.0 }
    };
    colours(std::slice::from_ref(&residuals.to_vec()), n_columns, &[]).iter().map(one).collect()
}

/// Cost, curvature and slope of one window's start.
struct Posterior {
    cost: f64,
    curvature: DMatrix<f64>,
    slope: DVector<f64>,
}

impl Posterior {
    fn new(
        jacobian: &Jacobian,
        window: usize,
        start: &[f64],
        belief: &Belief,
        weights: &[f64],
        noise: &[f64],
        first: usize,
    ) -> Self {
        let (block, n, n_columns) = (&jacobian.blocks[window], jacobian.n_states, weights.len());
        let mut all = Self { cost: 0.0, curvature: DMatrix::zeros(n, n), slope: DVector::zeros(n) };
        for row in 0..block.residual.len() {
            let weight = weights[row % n_columns];
            all.add(block.derivative.row(row).transpose().rows(0, n).into_owned(), block.residual[row], weight);
        }
        for (c, reading) in belief.readings.iter().enumerate() {
            let Some(Reading { sample, more, deviation }) = reading else { continue };
            let row = (sample - first) * n_columns + c;
            let missed = block.residual[row] * noise[c] + more;
            let scale = noise[c] / deviation;
            all.add(block.derivative.row(row).transpose().rows(0, n) * scale, missed / deviation, 1.0);
        }
        for (j, &(mean, deviation)) in belief.states.iter().enumerate() {
            let mut direction = DVector::zeros(n);
            direction[j] = 1.0 / deviation;
            all.add(direction, (mean - start[j]) / deviation, 1.0);
        }
        all
    }

    fn add(&mut self, direction: DVector<f64>, missed: f64, weight: f64) {
        self.cost += weight * missed * missed;
        self.curvature.ger(weight, &direction, &direction, 1.0);
        self.slope.axpy(weight * missed, &direction, 1.0);
    }

    fn step(&self) -> Option<DVector<f64>> {
        let step = self.curvature.clone().cholesky()?.solve(&self.slope);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}
