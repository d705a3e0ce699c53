//! Survey: what a screening says of every suspect at a contestant.

use crate::diagnose::catalogue::hypothesis::{Applied, Start};
use crate::diagnose::fit::colours::noise::{ByNoise, Noise};
use crate::diagnose::fit::linear::gains::Gain;
use crate::diagnose::limits::{FINEST, SHOWN};
use crate::refine::Kept;
use std::sync::Arc;

/// What a screening says of one hypothesis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summary {
    pub(crate) gain: f64,
    pub(crate) degrees: usize,
    /// Standard deviation of the effect's size and its unit, where the size is what was screened.
    pub(crate) resolution: Option<(f64, String)>,
}

/// Hypotheses screened together (most alone): their gains by start, noise model and view.
pub(crate) struct Screened {
    pub(crate) members: Vec<usize>,
    pub(crate) applied: Applied,
    pub(crate) gains: Vec<ByNoise<Vec<Gain>>>,
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
    pub(crate) looked: ByNoise<Vec<Looked>>,
    /// Two suspects together, by the noise models that show.
    pub(crate) pairs: Vec<Pair>,
    /// Derivatives at the contestant, for first steps from it; none of a simulator that steps, whose fits hand on their own.
    pub(crate) kept: Option<Arc<Kept>>,
    /// Whether a suspect has a turn only in the place of an effect that it stands behind, or where it marks a place.
    pub(crate) is_behind: bool,
}

impl Screened {
    /// The largest gain of any start by one noise model; none by one that was not looked at.
    pub(crate) fn best(&self, noise: Noise) -> f64 {
        self.best_in(noise, 0)
    }

    /// The same in the place of the effects that a view leaves out.
    pub(crate) fn best_in(&self, noise: Noise, view: usize) -> f64 {
        let of = |gains: &ByNoise<Vec<Gain>>| Some(gains.of(noise)?.get(view)?.gain);
        self.gains.iter().filter_map(of).fold(0.0, f64::max)
    }

    /// The noise models by which suspects are chosen: rollouts far from the log point nowhere, so that of a simulator that steps
    /// the innovations alone count.
    pub(crate) fn telling(&self) -> &'static [Noise] {
        let has_innovations = self.gains.first().is_some_and(|gains| gains.of(Noise::Innovations).is_some());
        if has_innovations { &[Noise::Innovations] } else { &[Noise::White, Noise::Coloured] }
    }

    pub(crate) fn summary(&self) -> Summary {
        let all = self.gains.iter().filter_map(|gains| gains.of(Noise::Coloured)?.first());
        let Some(best) = all.max_by(|a, b| a.gain.total_cmp(&b.gain)) else { return Summary::default() };
        let unit = self.applied.fitted.first().map(|(_, a)| a.unit.clone()).unwrap_or_default();
        // Of a wrong parameter finite steps are tried, too, and one of them may be best: how well it is known the straight line says.
        let is_straight = |start: &Start| start.amplitudes.first().is_some_and(|(_, origin)| *origin != 0.0);
        let straight = self.applied.starts.iter().zip(&self.gains).find(|(start, _)| is_straight(start));
        let deviation = match straight {
            Some((_, gains)) => gains.of(Noise::Coloured).and_then(|gains| gains.first()?.deviation),
            None => best.deviation,
        };
        // Nothing is known better than what integrators and the digits of a log agree to, whatever a straight line says where something sticks.
        let finest = FINEST * self.applied.fitted.first().map_or(0.0, |(_, added)| added.scale.abs());
        let resolution = deviation.map(|deviation| (deviation.max(finest / SHOWN), unit));
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
