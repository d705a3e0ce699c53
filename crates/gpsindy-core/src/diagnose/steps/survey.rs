//! Survey: what a screening says of every suspect at a contestant.

use crate::diagnose::catalogue::hypothesis::{Applied, Start};
use crate::diagnose::fit::gains::Gain;
use std::ops::Range;

/// What a screening says of one hypothesis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summary {
    pub(crate) gain: f64,
    pub(crate) degrees: usize,
    /// Standard deviation of the effect's size and its unit, where the size is what was screened.
    pub(crate) resolution: Option<(f64, String)>,
}

/// Noise models of a screening: white, coloured, and a filter's innovations, which only a simulator that steps has.
pub(crate) const BASES: usize = 3;

/// Hypotheses screened together (most alone): their gains by start, noise model and view.
pub(crate) struct Screened {
    pub(crate) members: Vec<usize>,
    pub(crate) applied: Applied,
    pub(crate) gains: Vec<Vec<Vec<Gain>>>,
}

/// What a screening looks for: one more effect, or another one in the place of some.
#[derive(Debug, Clone)]
pub(crate) struct Looked {
    /// The places that are left out.
    pub(crate) places: Vec<usize>,
    /// What leaving them out costs in twice the log likelihood, by a straight line.
    pub(crate) loss: f64,
}

/// A screening of all suspects at a contestant.
pub(crate) struct Survey {
    /// In the order of the hypotheses, then of the sets that apply together.
    pub(crate) suspects: Vec<Option<Screened>>,
    /// By noise model and view.
    pub(crate) looked: Vec<Vec<Looked>>,
    /// Two suspects together, by the noise models that tell.
    pub(crate) pairs: Vec<Pair>,
}

impl Screened {
    /// The largest gain of any start: under white (0) or coloured (1) noise, or of the innovations (2), where these are looked at.
    pub(crate) fn best(&self, basis: usize) -> f64 {
        self.best_in(basis, 0)
    }

    /// The same in the place of the effects that a view leaves out.
    pub(crate) fn best_in(&self, basis: usize, view: usize) -> f64 {
        let of = |gains: &Vec<Vec<Gain>>| Some(gains.get(basis)?.get(view)?.gain);
        self.gains.iter().filter_map(of).fold(0.0, f64::max)
    }

    /// The noise models by which suspects are chosen: rollouts far from the log point nowhere, so that of a simulator that steps
    /// the innovations alone count.
    pub(crate) fn telling(&self) -> Range<usize> {
        let has_innovations = self.gains.first().is_some_and(|gains| gains.len() == BASES);
        if has_innovations { BASES - 1..BASES } else { 0..BASES - 1 }
    }

    pub(crate) fn summary(&self) -> Summary {
        let all = self.gains.iter().map(|g| &g[1][0]);
        let Some(best) = all.max_by(|a, b| a.gain.total_cmp(&b.gain)) else { return Summary::default() };
        let unit = self.applied.fitted.first().map(|(_, a)| a.unit.clone()).unwrap_or_default();
        // Of a wrong parameter finite steps are tried, too, and one of them may be best: how well it is known the straight line says.
        let is_straight = |start: &Start| start.amplitudes.first().is_some_and(|(_, origin)| *origin != 0.0);
        let straight = self.applied.starts.iter().zip(&self.gains).find(|(start, _)| is_straight(start));
        let deviation = best.deviation.or_else(|| straight.and_then(|(_, gains)| gains[1][0].deviation));
        let resolution = deviation.map(|deviation| (deviation, unit));
        Summary { gain: best.gain, degrees: best.degrees, resolution }
    }
}

/// Two suspects besides the effects of a contestant, or in the place of some.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    /// Numbers of the hypotheses.
    pub(crate) members: [usize; 2],
    /// The places that are left out.
    pub(crate) places: Vec<usize>,
    /// Start values of their parameters, those of the first before those of the second.
    pub(crate) values: Vec<f64>,
    /// By how much twice the log likelihood grows, by a straight line.
    pub(crate) gain: f64,
}
