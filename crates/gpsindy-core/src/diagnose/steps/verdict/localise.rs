//! Where the gap lies: by equation, by region of a variable, and over time.
//!
//! The gap of an equation is the difference between the rates of the corrected and of the nominal model along
//! the corrected trajectory. The corrected model is the winner, with the best generic function where that is in an equation of its own.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::fit::evidence::chi_squared_tail;
use crate::diagnose::fit::moved::deviation;
use crate::diagnose::fit::outputs::trajectories;
use crate::diagnose::limits::Budget;
use crate::diagnose::limits::localise::{BINS, LISTED, LISTED_AT_ALL, MOST_ROWS, ONE_PART, ORDERS};
use crate::diagnose::limits::verify::BAND_95;
use crate::diagnose::report::{
    Gap, GapRegion, GapState, GapWindow, ResidualCurve, ResidualFigure, ResidualTrace, thinned,
};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Judged, Outcome};
use crate::model::Dynamics;

/// What is missing in every nominal equation, along every training window.
struct Missing {
    /// One list a window, one row a nominal state.
    rates: Vec<Vec<Vec<f64>>>,
    paths: Vec<Vec<Vec<f64>>>,
}

/// The gap by place, and its pictures.
pub(crate) struct Located {
    pub(crate) gap: Gap,
    pub(crate) figures: Vec<ResidualFigure>,
}

pub(crate) fn gap(contest: &Contest<'_>, judged: &Judged, resting: &[usize]) -> Located {
    let (Judged { nominal, detected, outcome, nameless: gains, .. }, rivals) = (judged, &contest.rivals);
    let empty = |gap: Gap| Located { gap, figures: Vec::new() };
    let bare = Gap {
        detected: detected.gap,
        p_value: detected.p_value,
        by_state: Vec::new(),
        by_region: Vec::new(),
        by_window: Vec::new(),
    };
    if !detected.gap {
        return empty(bare);
    }
    let corrected = corrected(contest, outcome, rivals);
    let Some(missing) = missing(nominal, &corrected) else { return empty(bare) };
    let shares = shares(nominal, outcome, rivals, gains, resting);
    let mut located = empty(bare);
    let model = nominal.system.model();
    let mut order: Vec<usize> = (0..shares.len()).filter(|&j| shares[j] > LISTED).collect();
    order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
    for &j in &order {
        let state = &model.states[j];
        let unit = state.rate_unit();
        let rms = root_mean_square(&missing, j);
        let own = || rivals.iter().zip(gains).filter(|(r, _)| r.state == j).map(|(_, gain)| *gain);
        let tails = own().map(|(gain, degrees)| chi_squared_tail(gain, degrees));
        let p_value = (tails.fold(1.0, f64::min) * rivals.len() as f64).min(1.0);
        // The whole search can't be surer than the equation in which it found most.
        let p_value = if located.gap.by_state.is_empty() { p_value.min(detected.p_value) } else { p_value };
        let known = relative_error(&corrected, j);
        // A function without a name gains as often as it has degrees of freedom by noise alone.
        let stated =
            || own().map(|(gain, degrees)| (degrees as f64 / gain.max(degrees as f64)).sqrt()).fold(1.0, f64::min);
        located.gap.by_state.push(GapState {
            state: state.name.clone(),
            share: shares[j],
            // A sensor's fault leaves its equation right, but the state is where it shows.
            p_value: if p_value < 1.0 { p_value } else { detected.p_value },
            residual_rms: rms,
            noise_rms: rms * if known > 0.0 { known } else { stated() },
            unit: unit.clone(),
        });
        if let Some(variable) = strongest_variable(nominal, &missing, j, resting) {
            regions(nominal, &missing, j, &variable, shares[j], &mut located.gap.by_region);
            located.figures.push(figure(nominal, &missing, j, &variable, unit));
        }
    }
    if let Some(&j) = order.first() {
        windows(nominal, &missing, j, &mut located.gap.by_window);
    }
    cut(&mut located.gap.by_region, |r| r.share);
    cut(&mut located.gap.by_window, |w| w.share);
    located
}

/// Keeps the largest rows, in their order.
fn cut<T>(rows: &mut Vec<T>, share: impl Fn(&T) -> f64) {
    let mut shares: Vec<f64> = rows.iter().map(&share).collect();
    shares.sort_by(|a, b| b.total_cmp(a));
    if let Some(&least) = shares.get(MOST_ROWS - 1) {
        rows.retain(|row| share(row) >= least);
    }
}

/// The winner, and beside it the best function without a name, fitted, where what that is missing from has no effect of the winner.
fn corrected(contest: &Contest<'_>, outcome: &Outcome, rivals: &[Rival]) -> Contestant {
    let is_elsewhere = |row: usize| outcome.best.hypotheses.iter().all(|h| h.state != row);
    let Some(left) = outcome.left.as_ref().filter(|left| is_elsewhere(rivals[left.rival].state)) else {
        return outcome.best.clone();
    };
    let rival = &rivals[left.rival];
    let applied = rival.apply(outcome.best.system.model(), &contest.scene);
    let hypothesis = Hypothesis::nameless(rival);
    let start = vec![0.0; applied.fitted.len()];
    let entrant = Entrant::new(&hypothesis, Searches::NONE);
    let fitted = contest.fitter.with(&outcome.best, &[entrant], &applied, &[start], Budget::Usual);
    fitted.unwrap_or_else(|_| outcome.best.clone())
}

fn missing(nominal: &Contestant, corrected: &Contestant) -> Option<Missing> {
    let n = nominal.system.n_states();
    let paths = trajectories(
        &corrected.system,
        &corrected.experiment,
        &corrected.refined.parameters,
        &corrected.refined.initial,
    );
    let mut rates = Vec::with_capacity(paths.len());
    let mut simulated = vec![0.0; n];
    for (window, path) in corrected.experiment.windows.iter().zip(&paths) {
        let log = &corrected.experiment.logs[window.log];
        let samples = window.last - window.first;
        let mut rows = vec![Vec::with_capacity(samples); n];
        for i in 0..samples {
            let step = log.time[window.first + i + 1] - log.time[window.first + i];
            let middle: Vec<f64> = (0..n).map(|j| 0.5 * (path[j][i] + path[j][i + 1])).collect();
            let controls: Vec<f64> = log.controls.iter().map(|c| c[window.first + i]).collect();
            let time = log.time[window.first + i] + 0.5 * step;
            nominal.system.derivative(time, &middle, &controls, &mut simulated).ok()?;
            for j in 0..n {
                let rate = (path[j][i + 1] - path[j][i]) / step - simulated[j];
                rows[j].push(if rate.is_finite() { rate } else { 0.0 });
            }
        }
        rates.push(rows);
    }
    Some(Missing { rates, paths })
}

/// Share of the gap by nominal state: of every included effect what it removes, of the rest where a function without a name fits.
///
/// A column that rests has no share: what it misses is in units of an unknown noise.
fn shares(
    nominal: &Contestant,
    outcome: &Outcome,
    rivals: &[Rival],
    gains: &[(f64, usize)],
    resting: &[usize],
) -> Vec<f64> {
    let mut energy = vec![0.0; nominal.system.n_states()];
    for seat in &outcome.seats {
        energy[seat.hypothesis.state] += seat.removed.max(LISTED_AT_ALL);
    }
    if let Some(left) = &outcome.left {
        energy[rivals[left.rival].state] += left.energy;
    }
    if outcome.best.hypotheses.is_empty() {
        for (rival, &(gain, degrees)) in rivals.iter().zip(gains) {
            energy[rival.state] = energy[rival.state]
                .max(ORDERS * (gain - degrees as f64).max(0.0) / nominal.evidence.count().max(1) as f64);
        }
    }
    resting.iter().for_each(|&j| energy[j] = 0.0);
    let total: f64 = energy.iter().sum();
    if total > 0.0 { energy.iter().map(|e| e / total).collect() } else { energy }
}

/// Relative standard deviation of the first parameter of the effects in equation `j`; that of a function without a name says nothing of its size.
fn relative_error(corrected: &Contestant, j: usize) -> f64 {
    let own = corrected.hypotheses.iter().zip(&corrected.added).filter(|(h, _)| h.state == j && !h.is_nameless());
    let errors = own.filter_map(|(_, added)| {
        let (index, _) = added.first()?;
        Some((deviation(corrected, *index)? / corrected.refined.parameters[*index]).abs())
    });
    let largest = errors.filter(|e| e.is_finite()).fold(0.0, f64::max);
    largest.min(1.0)
}

fn root_mean_square(missing: &Missing, j: usize) -> f64 {
    let values = || missing.rates.iter().flat_map(|w| w[j].iter());
    (values().map(|v| v * v).sum::<f64>() / values().count().max(1) as f64).sqrt()
}

/// Values of a state or control with the missing rates of one window.
fn variable_along(nominal: &Contestant, missing: &Missing, window: usize, name: &str) -> Vec<f64> {
    let model = nominal.system.model();
    let count = missing.rates[window][0].len();
    if let Some(j) = model.state_index(name) {
        return missing.paths[window][j][..count].to_vec();
    }
    let span = &nominal.experiment.windows.get(window).or(nominal.experiment.windows.last());
    let (Some(c), Some(span)) = (model.control_index(name), span) else { return vec![0.0; count] };
    let values = &nominal.experiment.logs[span.log].controls[c];
    (0..count).map(|i| values.get(span.first + i).copied().unwrap_or(0.0)).collect()
}

/// Pairs of a variable and the missing rate, in rising order of the variable.
fn pairs(nominal: &Contestant, missing: &Missing, j: usize, name: &str) -> Vec<(f64, f64)> {
    let mut all: Vec<(f64, f64)> = (0..missing.rates.len())
        .flat_map(|w| variable_along(nominal, missing, w, name).into_iter().zip(missing.rates[w][j].clone()))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// The variable that moves whose bins explain most of the missing rate's variance.
fn strongest_variable(nominal: &Contestant, missing: &Missing, j: usize, resting: &[usize]) -> Option<String> {
    let model = nominal.system.model();
    let moving = (0..model.states.len()).filter(|i| !resting.contains(i)).map(|i| &model.states[i].name);
    let names = moving.chain(model.controls.iter().map(|c| &c.name));
    let explained = |name: &String| {
        let pairs = pairs(nominal, missing, j, name);
        let (low, high) = (pairs.first()?.0, pairs.last()?.0);
        if !(high - low > 1e-9 * low.abs().max(high.abs())) {
            return None;
        }
        let size = pairs.len().div_ceil(3 * BINS).max(1);
        let bins = pairs.chunks(size);
        Some(bins.map(|bin| bin.iter().map(|p| p.1).sum::<f64>().powi(2) / bin.len() as f64).sum::<f64>())
    };
    names.filter_map(|n| Some((n.clone(), explained(n)?))).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(name, _)| name)
}

fn regions(nominal: &Contestant, missing: &Missing, j: usize, variable: &str, share: f64, all: &mut Vec<GapRegion>) {
    let pairs = pairs(nominal, missing, j, variable);
    let total: f64 = pairs.iter().map(|p| p.1 * p.1).sum();
    if pairs.is_empty() || total <= 0.0 {
        return;
    }
    let size = pairs.len().div_ceil(BINS);
    for (first, last) in alike(&pairs.iter().map(|p| p.1).collect::<Vec<_>>(), size, |i| pairs[i].0 == pairs[i - 1].0) {
        let bin = &pairs[first..last];
        all.push(GapRegion {
            state: nominal.system.model().states[j].name.clone(),
            variable: variable.into(),
            from: bin[0].0,
            to: bin[bin.len() - 1].0,
            share: share * bin.iter().map(|p| p.1 * p.1).sum::<f64>() / total,
        });
    }
}

/// Parts of a list of about `size` values (first, and one after the last), neighbours that are alike taken together;
/// no part begins at a value that is `bound` to the one before it.
fn alike(values: &[f64], size: usize, bound: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mean =
        |(first, last): (usize, usize)| values[first..last].iter().map(|v| v * v).sum::<f64>() / (last - first) as f64;
    let mut parts: Vec<(usize, usize)> = Vec::new();
    let mut first = 0;
    while first < values.len() {
        let mut last = (first + size).min(values.len());
        while last < values.len() && bound(last) {
            last += 1;
        }
        let part = (first, last);
        first = last;
        match parts.last_mut() {
            Some(before) if mean(*before) <= ONE_PART * mean(part) && mean(part) <= ONE_PART * mean(*before) => {
                before.1 = last
            }
            _ => parts.push(part),
        }
    }
    parts
}

fn windows(nominal: &Contestant, missing: &Missing, j: usize, all: &mut Vec<GapWindow>) {
    let total: f64 = missing.rates.iter().flat_map(|w| w[j].iter()).map(|v| v * v).sum();
    if total <= 0.0 {
        return;
    }
    // Windows of the corrected fit follow each other as the logs do.
    for (rates, span) in missing.rates.iter().zip(&nominal.experiment.windows) {
        let log = &nominal.experiment.logs[span.log];
        let size = rates[j].len().div_ceil(BINS).max(1);
        for (begin, end) in alike(&rates[j], size, |_| false) {
            let bin = &rates[j][begin..end];
            let first = (span.first + begin).min(log.time.len() - 1);
            let last = (first + bin.len()).min(log.time.len() - 1);
            all.push(GapWindow {
                run: log.name.clone(),
                from: log.time[first],
                to: log.time[last],
                share: bin.iter().map(|v| v * v).sum::<f64>() / total,
            });
        }
    }
}

fn figure(nominal: &Contestant, missing: &Missing, j: usize, variable: &str, unit: String) -> ResidualFigure {
    let model = nominal.system.model();
    let pairs = pairs(nominal, missing, j, variable);
    let size = pairs.len().div_ceil(80).max(1);
    let bins: Vec<&[(f64, f64)]> = pairs.chunks(size).collect();
    let mean = |bin: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64| bin.iter().map(pick).sum::<f64>() / bin.len() as f64;
    let y: Vec<f64> = bins.iter().map(|b| mean(b, |p| p.1)).collect();
    let band = bins
        .iter()
        .zip(&y)
        .map(|(b, m)| {
            let variance = b.iter().map(|p| (p.1 - m).powi(2)).sum::<f64>() / b.len() as f64;
            BAND_95 * (variance / b.len() as f64).sqrt()
        })
        .collect();
    let variable_unit = model
        .state_index(variable)
        .map(|i| model.states[i].unit.clone())
        .or_else(|| model.control_index(variable).map(|i| model.controls[i].unit.clone()));
    let curve = ResidualCurve {
        variable: variable.into(),
        unit: variable_unit.unwrap_or_default(),
        x: bins.iter().map(|b| mean(b, |p| p.0)).collect(),
        y,
        band,
        explained: Vec::new(),
    };
    let traces = missing
        .rates
        .iter()
        .zip(&nominal.experiment.windows)
        .take(4)
        .map(|(rates, span)| {
            let log = &nominal.experiment.logs[span.log];
            let kept = thinned(rates[j].len());
            ResidualTrace {
                run: log.name.clone(),
                time: kept.iter().map(|&i| log.time[(span.first + i).min(log.time.len() - 1)]).collect(),
                y: kept.iter().map(|&i| rates[j][i]).collect(),
                band: vec![0.0; kept.len()],
            }
        })
        .collect();
    ResidualFigure { state: model.states[j].name.clone(), unit, curve: Some(curve), traces }
}
