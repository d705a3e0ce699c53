//! Selects the tuning parameter of the regression by the rollout error.

use crate::error::Result;
use crate::identify::algorithm1::Algorithm1;
use crate::identify::algorithm1::regress::Regressed;
use crate::identify::settings::{Choice, Identify};
use crate::identify::support::scope::Scope;
use crate::progress::Progress;

impl Identify {
    /// `done` with the candidates that rollouts choose, where the settings ask for that.
    pub(crate) fn chosen(&self, mut done: Algorithm1, progress: &dyn Progress) -> Result<Algorithm1> {
        if self.choice == Choice::Rollout {
            let mut regressed = done.regressed.clone();
            Scope::new(self, &done, progress).choose_by_rollout(&mut regressed)?;
            done.regressed = regressed;
        }
        Ok(done)
    }
}

impl Scope<'_> {
    /// State by state, the candidate of the path with which rollouts come closest to the logs.
    fn choose_by_rollout(&self, regressed: &mut Regressed) -> Result<()> {
        let fitter = self.fitter(self.timings.best.hold);
        let window = self.settings.window.unwrap_or_else(|| self.motion.shortest_window());
        let trial = &mut regressed.equations;
        for (s, chosen) in regressed.chosen.iter_mut().enumerate() {
            let Some(chosen) = chosen else { continue };
            let mut best = (f64::INFINITY, chosen.coefficients.clone());
            for candidate in &chosen.path {
                trial.set(s, candidate);
                let error = fitter.rollout_error(trial, window)?;
                if error < best.0 {
                    best = (error, candidate.clone());
                }
            }
            trial.set(s, &best.1);
            (chosen.score, chosen.coefficients) = best;
        }
        Ok(())
    }
}
