//! Screen: linearised gains of every hypothesis, and of generic smooth functions, at a contestant.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis};
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::gains::{Basis, Gain, gains};
use crate::diagnose::fit::peaks::peaks;
use crate::diagnose::steps::contest::Contest;
use crate::error::Result;
use crate::parallel::*;

/// What a screening says of one hypothesis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summary {
    pub(crate) gain: f64,
    pub(crate) degrees: usize,
    /// Standard deviation of the effect's size and its unit, where the size is what was screened.
    pub(crate) resolution: Option<(f64, String)>,
}

/// Hypotheses screened together (most alone): their gains by start, under white and under coloured noise.
pub(crate) struct Screened {
    pub(crate) members: Vec<usize>,
    pub(crate) applied: Applied,
    pub(crate) gains: Vec<Vec<Gain>>,
}

impl Screened {
    /// The largest gain of any start: under white (0) or coloured (1) noise.
    pub(crate) fn best(&self, basis: usize) -> f64 {
        self.gains.iter().map(|g| g[basis].gain).fold(0.0, f64::max)
    }

    pub(crate) fn summary(&self) -> Summary {
        let all = self.gains.iter().map(|g| &g[1]);
        let Some(best) = all.max_by(|a, b| a.gain.total_cmp(&b.gain)) else { return Summary::default() };
        let unit = self.applied.fitted.first().map(|(_, a)| a.unit.clone()).unwrap_or_default();
        let resolution = best.deviation.map(|deviation| (deviation, unit));
        Summary { gain: best.gain, degrees: best.degrees, resolution }
    }
}

/// Straight-line gains of every hypothesis that is not in `base` already.
pub(crate) fn screen(contest: &Contest<'_>, base: &Contestant, stage: &str) -> Result<Vec<Option<Screened>>> {
    let scene = Scene { peaks: peaks(base), ..contest.scene.clone() };
    let at = base.linearised()?;
    let bases = [&Basis::new(&at, true), &Basis::new(&at, false)];
    let alone = (0..contest.hypotheses.len()).map(|h| vec![h]);
    let suspects: Vec<Vec<usize>> = alone.chain(contest.joint.iter().cloned()).collect();
    let stage = contest.run.stage(stage, suspects.len())?;
    let one = |members: Vec<usize>| {
        let hypotheses: Vec<&Hypothesis> = members.iter().map(|&h| &contest.hypotheses[h]).collect();
        let known = hypotheses.iter().any(|h| base.hypotheses.contains(h) || is_freed(base, h));
        let is_too_many = members.len() > 1 && base.hypotheses.len() + members.len() > contest.most;
        if known || is_too_many || contest.run.is_out_of_time() {
            return Ok(None);
        }
        // An effect that can't be written into this model is none of its suspects.
        let Ok(applied) = joint::apply(&hypotheses, base.system.model(), &scene) else { return Ok(None) };
        let gains = gains(&applied, &at, &bases);
        stage.advance()?;
        Ok(Some(Screened { members, applied, gains }))
    };
    suspects.into_par_iter().map(one).collect()
}

/// Gain and degrees of freedom of every function without a name at `base`, under coloured noise.
pub(crate) fn nameless(contest: &Contest<'_>, base: &Contestant) -> Result<Vec<(f64, usize)>> {
    let at = base.linearised()?;
    let coloured = Basis::new(&at, false);
    let gain = |rival: &Rival| {
        let applied = rival.apply(base.system.model(), &contest.scene);
        let found = gains(&applied, &at, &[&coloured]);
        found.first().map_or((0.0, 1), |g| (g[0].gain, g[0].degrees))
    };
    Ok(contest.rivals.par_iter().map(gain).collect())
}

/// Whether the hypothesis frees a parameter that a hypothesis of this contestant has freed.
fn is_freed(base: &Contestant, hypothesis: &Hypothesis) -> bool {
    hypothesis.frees().is_some_and(|name| base.added.iter().flatten().any(|(_, added)| added.name == name))
}
