//! The cost of hyperparameters: negative log marginal likelihood of all runs and weak priors, by
//! the point, in the coordinates that are free.

use super::settings::FitSettings;
use super::start::Bounds;
use crate::gp::kernel::{Kernel, Role};
use crate::gp::likelihood::{Evaluation, Workspace};
use crate::gp::points::Points;

/// The cost as a function of free coordinates: tied lengths are one, a known noise is none.
pub(super) struct Cost<'a> {
    pub(super) kernel: &'a Kernel,
    pub(super) runs: &'a [Points],
    pub(super) bounds: &'a Bounds,
    pub(super) jitter: f64,
    pub(super) roles: Vec<Role>,
    /// Free coordinate behind each kernel hyperparameter.
    pub(super) coordinate: Vec<usize>,
    n_free: usize,
    pub(super) n_points: f64,
}

impl<'a> Cost<'a> {
    pub(super) fn new(
        kernel: &'a Kernel,
        runs: &'a [Points],
        bounds: &'a Bounds,
        settings: &FitSettings,
        jitter: f64,
    ) -> Self {
        let roles = kernel.roles(runs[0].dimension());
        let (mut coordinate, mut n_free): (Vec<usize>, usize) = (Vec::with_capacity(roles.len()), 0);
        for (i, role) in roles.iter().enumerate() {
            if settings.isotropic && matches!(role, Role::Length(d) if *d > 0) {
                coordinate.push(coordinate[i - 1]);
            } else {
                coordinate.push(n_free);
                n_free += 1;
            }
        }
        let n_points = runs.iter().map(Points::len).sum::<usize>() as f64;
        Self { kernel, runs, bounds, jitter, roles, coordinate, n_free, n_points }
    }

    /// Free coordinates of a full list of hyperparameters (log noise last).
    pub(super) fn compress(&self, hyper: &[f64]) -> Vec<f64> {
        let mut z = vec![0.0; self.n_free];
        for (&c, &h) in self.coordinate.iter().zip(hyper) {
            z[c] = h;
        }
        if self.bounds.known_noise.is_none() {
            z.push(hyper[self.roles.len()]);
        }
        z
    }

    /// Full list; the noise variance is that of the floor plus a free one.
    pub(super) fn expand(&self, z: &[f64]) -> Vec<f64> {
        let mut hyper: Vec<f64> = self.coordinate.iter().map(|&c| z[c]).collect();
        hyper.push(match self.bounds.known_noise {
            Some(noise) => noise.ln(),
            None => 0.5 * (self.bounds.noise_floor.powi(2) + (2.0 * z[self.n_free]).exp()).ln(),
        });
        hyper
    }

    pub(super) fn evaluate(&self, z: &[f64], gradient: &mut [f64], workspace: &mut Workspace) -> Option<f64> {
        if z.iter().any(|v| v.is_nan() || v.abs() > 200.0) {
            return None;
        }
        let hyper = self.expand(z);
        let evaluation = Evaluation { kernel: self.kernel, hyper: &hyper, jitter: self.jitter };
        let mut total = 0.0;
        let mut full = vec![0.0; if gradient.is_empty() { 0 } else { hyper.len() }];
        let mut sum = full.clone();
        for run in self.runs {
            total += evaluation.likelihood(run, &mut full, workspace)?;
            sum.iter_mut().zip(&full).for_each(|(s, g)| *s += g);
        }
        let mut slopes = vec![0.0; z.len()];
        for (i, role) in self.roles.iter().enumerate() {
            let c = self.coordinate[i];
            let (penalty, slope) = self.bounds.penalty(*role, z[c], self.n_points);
            total += penalty;
            slopes[c] += slope + sum.get(i).copied().unwrap_or(0.0);
        }
        if self.bounds.known_noise.is_none() {
            let c = self.n_free;
            let (penalty, slope) = self.bounds.noise_penalty(z[c], self.n_points);
            total += penalty;
            let free = (2.0 * z[c] - 2.0 * hyper[self.roles.len()]).exp();
            slopes[c] += slope + free * sum.last().copied().unwrap_or(0.0);
        }
        for (g, s) in gradient.iter_mut().zip(&slopes) {
            *g = s / self.n_points;
        }
        let cost = total / self.n_points;
        cost.is_finite().then_some(cost)
    }

    /// Negative log marginal likelihood of all runs where `cost` is the value at `z`.
    pub(super) fn likelihood(&self, cost: f64, z: &[f64]) -> f64 {
        let kernel: f64 =
            self.roles.iter().zip(&self.coordinate).map(|(r, &c)| self.bounds.penalty(*r, z[c], self.n_points).0).sum();
        let noise = z.get(self.n_free).map_or(0.0, |&z| self.bounds.noise_penalty(z, self.n_points).0);
        cost * self.n_points - kernel - noise
    }

    pub(super) fn at_bound(&self, z: &[f64]) -> bool {
        self.roles.iter().zip(&self.coordinate).any(|(role, &c)| self.bounds.reached(*role, z[c]))
    }
}
