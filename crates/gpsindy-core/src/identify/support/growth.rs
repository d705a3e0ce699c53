//! How much small differences grow along rollouts.

use crate::error::Result;
use crate::identify::equations::Equations;
use crate::identify::support::fit::{Fitter, Trial};
use crate::model::System;
use crate::refine::{Block, Experiment, Jacobian, Point};

impl Fitter<'_> {
    /// How much a difference between two starts grows up to the ends of the windows of `trial`, at most, each state in units of
    /// its spread.
    pub(crate) fn amplification(&self, trial: &Trial, window: f64) -> Result<f64> {
        let (system, experiment, point) = self.fitted(trial, window)?;
        let ends = growth(&system, &experiment, &point)?.into_iter().filter_map(|window| window.last().copied());
        Ok(ends.fold(0.0, f64::max))
    }

    /// The same of equations that were not fitted, from the smoothed states; the largest on the way where what has grown comes again.
    pub(crate) fn amplification_of(&self, equations: &Equations, window: f64) -> Result<f64> {
        let system = equations.model_with_parameters().compile()?;
        let experiment = self.experiment(&system, window, &self.noise)?;
        let initial = experiment.windows.iter().map(|w| self.start(&system, w)).collect();
        let point = Point { parameters: system.parameter_values(), initial };
        let windows = growth(&system, &experiment, &point)?;
        Ok(windows.iter().map(|window| lasting(window)).fold(0.0, f64::max))
    }
}

/// The largest growth where the second half of a window reaches it: differences that grow throughout, steadily or in bursts between which
/// they are small, are largest late. Otherwise the growth at the end: the motion takes back what has grown once.
fn lasting(growth: &[f64]) -> f64 {
    let largest = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    let (early, late) = growth.split_at(growth.len() / 2);
    let (early, late) = (largest(early), largest(late));
    if late < early { growth.last().copied().unwrap_or(0.0) } else { late }
}

/// How much a difference between two starts has grown at every sample of every window, at most, each state in units of its spread.
fn growth(system: &System, experiment: &Experiment, point: &Point) -> Result<Vec<Vec<f64>>> {
    let jacobian = Jacobian::new(system, experiment, point, &[])?;
    let (columns, scale) = (&experiment.columns, &experiment.scale);
    let of_window = |block: &Block| {
        let mut grown = vec![0.0_f64; block.residual.len() / columns.len()];
        for (c, &column) in columns.iter().enumerate().filter(|(_, column)| **column < jacobian.n_states) {
            for (j, from) in scale.iter().enumerate() {
                let slopes = block.derivative.column(j);
                for (sample, grown) in grown.iter_mut().enumerate() {
                    let slope = slopes[sample * columns.len() + c].abs();
                    *grown = grown.max(slope * experiment.noise[c] * from / scale[column]);
                }
            }
        }
        grown
    };
    Ok(jacobian.blocks.iter().map(of_window).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_grown_once_is_taken_back_and_what_comes_again_is_not() {
        assert_eq!(lasting(&[1.0, 2.0, 4.0, 8.0]), 8.0);
        assert_eq!(lasting(&[1.0, 30.0, 2.0, 1.0, 40.0, 2.0]), 40.0);
        assert_eq!(lasting(&[1.0, 200.0, 30.0, 20.0, 10.0, 5.0]), 5.0);
        assert_eq!(lasting(&[]), 0.0);
    }
}
