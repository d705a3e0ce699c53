//! When a unit changed: tests a step or a drift of one unit, with the covariates held, against a constant.
//!
//! `r_j = level + delta g(t_j) + e_j`, with g a step at t0 or a straight rise from t0 on, `delta ~ N(0, size^2)`, and e with the covariance
//! of `held.rs`, which covers all that the covariates may explain of this unit. The level is
//! integrated out, every day between two periods and both shapes weigh alike, and the share of series that change is learnt from the
//! fleet (empirical Bayes). The listed changes keep the expected share of false ones below the rate that was asked for.
//!
//! Source: Barry and Hartigan 1993 (product partition models); Efron 2008, section 3 (two groups, Bayesian false discovery rate).

use super::Quantity;
use super::held::{Inverse, Series};
use super::limits::{PRIOR_CHANGE, SIZES, TAIL};
use super::report::{Change, Shape};
use nalgebra::DVector;

/// A possible change and its weight compared with a constant.
struct Candidate {
    shape: Shape,
    day: f64,
    /// Logarithm of the ratio of its evidence to that of a constant.
    factor: f64,
    level: f64,
    delta: f64,
}

/// The changes of all series, the surest first.
pub(super) fn changes(quantities: &[Quantity], series: &[Vec<Series>], rate: f64) -> Vec<Change> {
    let all: Vec<(usize, &Series, Vec<Candidate>)> = series
        .iter()
        .enumerate()
        .flat_map(|(q, list)| list.iter().map(move |s| (q, s, s.candidates())))
        .filter(|(_, _, candidates)| !candidates.is_empty())
        .collect();
    let factors: Vec<f64> = all.iter().map(|(_, _, c)| mean_factor(c)).collect();
    let share = share_that_changes(&factors);
    let described = all.iter().zip(&factors).map(|((q, series, candidates), &factor)| {
        series.change(&quantities[*q], candidates, probability(share, factor))
    });
    let mut found: Vec<Change> = described.collect();
    found.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut doubt = 0.0;
    let listed = found.iter().enumerate().take_while(|(k, change)| {
        doubt += 1.0 - change.probability;
        doubt / (k + 1) as f64 <= rate
    });
    let count = listed.count();
    found.truncate(count);
    found
}

/// Logarithm of the mean ratio.
fn mean_factor(candidates: &[Candidate]) -> f64 {
    let largest = largest(candidates);
    let sum: f64 = candidates.iter().map(|c| (c.factor - largest).exp()).sum();
    largest + (sum / candidates.len() as f64).ln()
}

fn largest(candidates: &[Candidate]) -> f64 {
    candidates.iter().map(|c| c.factor).fold(f64::NEG_INFINITY, f64::max)
}

/// Probability of a change, of which a share of the series has one, at the logarithm of its evidence.
fn probability(share: f64, factor: f64) -> f64 {
    1.0 / (1.0 + (1.0 - share) / share * (-factor).exp())
}

/// Share of the series that change, by expectation maximisation with the prior as so many series seen before.
fn share_that_changes(factors: &[f64]) -> f64 {
    let (expected, worth) = PRIOR_CHANGE;
    let mut share = expected;
    for _ in 0..100 {
        let sum: f64 = factors.iter().map(|&factor| probability(share, factor)).sum();
        share = (sum + expected * worth) / (factors.len() as f64 + worth);
    }
    share
}

impl Series {
    /// Every shape on every day between two periods, with two periods at least on either side.
    fn candidates(&self) -> Vec<Candidate> {
        let Some(inverse) = self.inverse() else { return Vec::new() };
        let weighed = inverse.times(&DVector::repeat(self.time.len(), 1.0));
        let mut all = Vec::new();
        for k in 2..=self.time.len() - 2 {
            let day = 0.5 * (self.time[k - 1] + self.time[k]);
            let last = self.time[self.time.len() - 1];
            let step = |t: f64| if t > day { 1.0 } else { 0.0 };
            let drift = |t: f64| (t - day).max(0.0) / (last - day);
            let form =
                |g: &dyn Fn(f64) -> f64| DVector::from_iterator(self.time.len(), self.time.iter().map(|&t| g(t)));
            all.extend(self.candidate(Shape::Step, day, &form(&step), (&inverse, &weighed)));
            all.extend(self.candidate(Shape::Drift, day, &form(&drift), (&inverse, &weighed)));
        }
        all
    }

    /// `ones` is the inverse of the covariance times a one for every period.
    fn candidate(
        &self,
        shape: Shape,
        day: f64,
        form: &DVector<f64>,
        (inverse, ones): (&Inverse, &DVector<f64>),
    ) -> Option<Candidate> {
        let total = ones.sum();
        let (level, middle) = (ones.dot(&self.value) / total, ones.dot(form) / total);
        let weighed = inverse.times(form);
        let information = weighed.dot(form) - total * middle * middle;
        if information.is_nan() || information <= 0.0 {
            return None;
        }
        let delta = (weighed.dot(&self.value) - total * middle * level) / information;
        let variance = 1.0 / information;
        let scatter = self.variance.len() as f64 / self.variance.iter().map(|v| 1.0 / v).sum::<f64>();
        let of = |size: &f64| {
            let prior = size * size * scatter;
            let exponent = 0.5 * delta * delta * (1.0 / variance - 1.0 / (variance + prior));
            exponent + 0.5 * (variance / (variance + prior)).ln()
        };
        let each: Vec<f64> = SIZES.iter().map(of).collect();
        let top = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let factor = top + (each.iter().map(|f| (f - top).exp()).sum::<f64>() / each.len() as f64).ln();
        Some(Candidate { shape, day, factor, level: level - delta * middle, delta })
    }

    fn change(&self, quantity: &Quantity, candidates: &[Candidate], probability: f64) -> Change {
        let top = largest(candidates);
        let weigh = |c: &Candidate| (c.factor - top).exp();
        let total: f64 = candidates.iter().map(weigh).sum();
        let weight = |shape: Shape| candidates.iter().filter(|c| c.shape == shape).map(weigh).sum::<f64>();
        let shape = if weight(Shape::Drift) > weight(Shape::Step) { Shape::Drift } else { Shape::Step };
        let own: Vec<&Candidate> = candidates.iter().filter(|c| c.shape == shape).collect();
        let sum = weight(shape);
        let average = |pick: &dyn Fn(&Candidate) -> f64| own.iter().map(|c| weigh(c) * pick(c)).sum::<f64>() / sum;
        // Days of either shape: the shape itself is uncertain where both weigh.
        let mut days: Vec<(f64, f64)> = candidates.iter().map(|c| (c.day, weigh(c) / total)).collect();
        days.sort_by(|a, b| a.0.total_cmp(&b.0));
        let quantile = |p: f64| {
            let mut seen = 0.0;
            let place = days.iter().position(|(_, weight)| {
                seen += weight;
                seen >= p
            });
            place.map_or(self.time[self.time.len() - 1], |k| days[k].0)
        };
        Change {
            unit: self.unit.clone(),
            effect: quantity.effect.clone(),
            state: quantity.state.clone(),
            parameter: quantity.parameter.clone(),
            shape,
            since: average(&|c| c.day),
            date: String::new(),
            interval: (quantile(TAIL), quantile(1.0 - TAIL)),
            from: average(&|c| c.level),
            to: average(&|c| c.level + c.delta),
            probability,
            held: quantity.covariates.clone(),
        }
    }
}
