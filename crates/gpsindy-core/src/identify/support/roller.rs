//! Rolls one set of equations out from any state under the controls of the logs, with the steps of the fits.

use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::equations::Equations;
use crate::model::System;
use crate::refine::Hold;
use crate::simulate::{Excitation, Method, Simulate};
use faer::Mat;
use std::ops::Range;

/// The states of a rollout, one row a sample; none where it diverged.
pub(crate) type Path = Option<Mat<f64>>;

/// One set of equations, compiled.
pub(crate) struct Roller<'a> {
    motion: &'a Motion,
    system: System,
    simulate: Simulate,
}

impl<'a> Roller<'a> {
    pub(crate) fn new(motion: &'a Motion, equations: &Equations, hold: Hold) -> Result<Self> {
        // The steps of the fits: an approximation may lead to where accurate ones would never end.
        let method = Method::RungeKutta4 { substeps: motion.substeps() };
        let logged =
            motion.tracks.iter().flat_map(|track| (0..track.mean.ncols()).flat_map(|s| track.mean.col_as_slice(s)));
        let largest = logged.fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let simulate = Simulate { hold, method, ..Simulate::default() }.beside(largest);
        Ok(Self { motion, system: equations.model().compile()?, simulate })
    }

    /// The samples `range` of run `run` from `initial` at the first of them.
    pub(crate) fn path(&self, run: usize, range: Range<usize>, initial: &[f64]) -> Result<Path> {
        let track = &self.motion.tracks[run];
        let controls = track.controls.subrows(range.start, range.len());
        let excitation = Excitation::new(&self.system, &track.time[range], controls, self.simulate.hold)?;
        let rollout = unless_cancelled(self.simulate.rollout(&self.system, &excitation, initial))?;
        let is_finite =
            |states: &Mat<f64>| (0..states.ncols()).all(|s| states.col_as_slice(s).iter().all(|v| v.is_finite()));
        Ok(rollout.map(|rollout| rollout.states).filter(is_finite))
    }
}
