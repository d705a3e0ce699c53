//! Jitter: periods and phases of a held control, from what a fit leaves.
//!
//! A held control is late by half a period on average, which a delay or a lag is as well. What is its own is the rest: late by nothing where a
//! command is taken and by a whole period just before the next. How the outputs follow that at one period is known from rollouts at four
//! phases, a quarter of a period apart; at a period close by, the phase turns slowly along the logs. So one sum over all logs says how well
//! any such period and its best phase agree with what is left, whatever stands for the delay: a spectrum with the turning for its frequency.
//! Source: the matched filter and its ambiguity function, Van Trees 1971, Detection, Estimation, and Modulation Theory III, chapter 10.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::linear::responses::responses;
use crate::diagnose::limits::sampling::{LONGEST_SEEN, MOST_TURNS, NEAR, OF_RUN, SEEN, TURN_OF};
use crate::parallel;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Quarters of a period. Exact.
const QUARTERS: usize = 4;

/// Periods and phases, s, that each control may be held with, best first: those that agree best with what the fit leaves.
pub(crate) fn samplings(hypotheses: &[Hypothesis], at: &Linearised<'_>, scene: &Scene) -> Vec<Vec<(f64, f64)>> {
    let base = at.contestant;
    let mut found = vec![Vec::new(); base.system.n_controls()];
    if base.system.engine().is_some() {
        return found;
    }
    for hypothesis in hypotheses.iter().filter(|h| h.is(Effect::InputHold) && !base.hypotheses.contains(h)) {
        let control = hypothesis.variables.first().and_then(|name| base.system.model().control_index(name));
        if let Some(own) = control.and_then(|control| found.get_mut(control)) {
            *own = of(hypothesis, at, scene).unwrap_or_default();
        }
    }
    found
}

/// Those of one control.
fn of(hypothesis: &Hypothesis, at: &Linearised<'_>, scene: &Scene) -> Option<Vec<(f64, f64)>> {
    let base = at.contestant;
    let applied = hypothesis.apply(base.system.model(), scene).ok()?;
    let windows = base.experiment.windows.iter().zip(&at.jacobian.blocks);
    let whiteners: Vec<Whitener> = windows
        .map(|(window, block)| Whitener::new(&base.evidence.colours, &block.present, &base.experiment.repeats(window)))
        .collect();
    let white = |mut all: Vec<DVector<f64>>| {
        whiteners.iter().zip(&mut all).for_each(|(whitener, values)| whitener.whiten(values));
        all
    };
    let left = white(at.jacobian.blocks.iter().map(|block| block.residual.clone()).collect());
    let longest = (OF_RUN * scene.duration).min(LONGEST_SEEN * scene.period);
    let periods = std::iter::successors(Some(2.0 * scene.period), |period| Some(period * NEAR));
    let periods: Vec<f64> = periods.take_while(|&period| period <= longest).collect();
    let origin = scene.times.0;
    let best = parallel::map(&periods, |&period| -> Option<Turned> {
        let phases = (0..QUARTERS).map(|k| vec![period, origin + period * k as f64 / QUARTERS as f64]);
        let phases: Vec<Vec<f64>> = phases.collect();
        let columns = responses(&applied, at, &phases.iter().collect::<Vec<_>>())?;
        let [first, second, third, fourth] = <[_; QUARTERS]>::try_from(columns).ok()?;
        let half = |one: Vec<DVector<f64>>, other: Vec<DVector<f64>>| {
            white(one.into_iter().zip(other).map(|(one, other)| 0.5 * (one - other)).collect())
        };
        let (cosine, sine) = (half(first, third), half(second, fourth));
        let signal = signal(at, &left, [&cosine, &sine], origin);
        let power = 0.5 * [cosine, sine].iter().flatten().map(DVector::norm_squared).sum::<f64>();
        turned(&signal, period, power)
    });
    let mut best: Vec<Turned> = best.into_iter().flatten().collect();
    // Noise alone agrees with one of so many by as much.
    let by_chance = 2.0 * (best.iter().map(|turned| turned.tried).sum::<usize>().max(1) as f64).ln();
    best.retain(|turned| turned.gain > by_chance);
    best.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some(best.into_iter().take(SEEN).map(|turned| (turned.period, origin + turned.phase)).collect())
}

/// The best period near one, and its phase.
#[derive(Debug, Clone, Copy)]
struct Turned {
    /// By how much twice the log likelihood rises.
    gain: f64,
    period: f64,
    phase: f64,
    /// How many periods were tried.
    tried: usize,
}

/// How well what is left of each sample agrees with the two responses, and when that was, s from `origin`.
fn signal(
    at: &Linearised<'_>,
    left: &[DVector<f64>],
    [cosine, sine]: [&[DVector<f64>]; 2],
    origin: f64,
) -> Vec<(f64, f64, f64)> {
    let experiment = &at.contestant.experiment;
    let n_columns = experiment.columns.len();
    let mut all = Vec::new();
    for (w, window) in experiment.windows.iter().enumerate() {
        let time = &experiment.logs[window.log].time[window.first..=window.last];
        let rows = |of: &[DVector<f64>], sample: usize| -> f64 {
            let range = sample * n_columns..(sample + 1) * n_columns;
            range.map(|row| left[w][row] * of[w][row]).sum()
        };
        all.extend(time.iter().enumerate().map(|(i, t)| (t - origin, rows(cosine, i), rows(sine, i))));
    }
    all
}

/// The signal summed over every period, in whose time no turn that is tried changes by more than a sixteenth.
fn by_period(signal: &[(f64, f64, f64)], first: f64, period: f64) -> impl Iterator<Item = (f64, f64, f64)> {
    let mut sums: BTreeMap<u64, (f64, f64)> = BTreeMap::new();
    for &(t, cosine, sine) in signal {
        let sum = sums.entry(((t - first) / period) as u64).or_default();
        *sum = (sum.0 + cosine, sum.1 + sine);
    }
    sums.into_iter().map(move |(k, (cosine, sine))| (first + (k as f64 + 0.5) * period, cosine, sine))
}

/// The period near `period` and the phase at which the signal agrees best.
fn turned(signal: &[(f64, f64, f64)], period: f64, power: f64) -> Option<Turned> {
    let (first, last) = signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| (a.min(s.0), b.max(s.0)));
    // Half the way to the next period on either side.
    let reach = TAU / period * (NEAR.sqrt() - 1.0);
    let step = (TAU / (TURN_OF * (last - first).max(period))).max(2.0 * reach / MOST_TURNS as f64);
    let count = (2.0 * reach / step).ceil() as usize + 1;
    let turn = |by: f64, t: f64| (by * t).sin_cos();
    // (cosine - i sine) e^(i turn t), which goes on by one step at a time.
    let mut now: Vec<(f64, f64)> = Vec::new();
    let mut by: Vec<(f64, f64)> = Vec::new();
    for (t, cosine, sine) in by_period(signal, first, period) {
        let (s, c) = turn(-reach, t);
        now.push((cosine * c + sine * s, cosine * s - sine * c));
        by.push(turn(step, t));
    }
    let mut best: Option<Turned> = None;
    for k in 0..count {
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (value, (s, c)) in now.iter_mut().zip(&by) {
            real += value.0;
            imaginary += value.1;
            *value = (value.0 * c - value.1 * s, value.0 * s + value.1 * c);
        }
        let gain = 2.0 * real.hypot(imaginary) - power;
        if best.is_none_or(|best| gain > best.gain) {
            let own = (period.recip() - (k as f64 * step - reach) / TAU).recip();
            let phase = (-imaginary.atan2(real) / TAU * own).rem_euclid(own);
            best = Some(Turned { gain, period: own, phase, tried: count });
        }
    }
    best.filter(|best| best.gain.is_finite() && best.period > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_between_two_shows_by_how_its_phase_turns() {
        // What is left follows the first response as the phase of the true period has come there, and so the second.
        let (near, period, phase) = (0.2, 0.2071, 0.13);
        let signal: Vec<(f64, f64, f64)> = (0..4000)
            .map(|i| {
                let t = 0.01 * f64::from(i);
                let size = (0.7 * t).sin();
                let turn = TAU * (phase / period + t * (1.0 / near - 1.0 / period));
                (t, size * size * turn.cos(), size * size * turn.sin())
            })
            .collect();
        let power = 0.5 * signal.iter().map(|s| s.1.hypot(s.2)).sum::<f64>();
        let Some(found) = turned(&signal, near, power) else { panic!("nothing") };
        // An eighth of a turn at the end of 40 s, and at the beginning.
        assert!((found.period - period).abs() * 40.0 / period < period / 8.0, "{found:?}");
        assert!((found.phase - phase).abs() < period / 8.0, "{found:?}");
        assert!(found.gain > 0.9 * 3.0 * power, "{found:?} of {power}");
    }
}
