//! Screen: linearised gains of every hypothesis, and of generic smooth functions, at a contestant.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis};
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::gains::{Basis, Gain, gains};
use crate::diagnose::fit::innovations::Innovations;
use crate::diagnose::fit::peaks::peaks;
use crate::diagnose::limits::{SCREENED, SKETCHED};
use crate::diagnose::run::Stage;
use crate::diagnose::steps::contest::Contest;
use crate::error::Result;
use crate::parallel::*;
use crate::refine::{Refined, tangent};
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

/// Hypotheses screened together (most alone): their gains by start, under white and under coloured noise.
pub(crate) struct Screened {
    pub(crate) members: Vec<usize>,
    pub(crate) applied: Applied,
    pub(crate) gains: Vec<Vec<Gain>>,
}

impl Screened {
    /// The largest gain of any start: under white (0) or coloured (1) noise, or of the innovations (2), where these are looked at.
    pub(crate) fn best(&self, basis: usize) -> f64 {
        self.gains.iter().filter_map(|g| g.get(basis)).map(|g| g.gain).fold(0.0, f64::max)
    }

    /// The noise models by which suspects are chosen: rollouts far from the log point nowhere, so that of a simulator that steps
    /// the innovations alone count.
    pub(crate) fn telling(&self) -> Range<usize> {
        let has_innovations = self.gains.first().is_some_and(|gains| gains.len() == BASES);
        if has_innovations { BASES - 1..BASES } else { 0..BASES - 1 }
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
///
/// Of a simulator that steps all are screened on a part of the windows first, and only those that lead there on all of them; the
/// others keep what the part says of the whole, but below the leaders. Its suspects have one more gain each, by the innovations.
pub(crate) fn screen(contest: &Contest<'_>, base: &Contestant, stage: &str) -> Result<Vec<Option<Screened>>> {
    let scene = Scene { peaks: peaks(base), ..contest.scene.clone() };
    let alone = (0..contest.hypotheses.len()).map(|h| vec![h]);
    let suspects: Vec<Vec<usize>> = alone.chain(contest.joint.iter().cloned()).collect();
    // Where there are innovations, all suspects have their turn with them, too.
    let turns = if base.system.engine().is_some() { 2 } else { 1 };
    let stage = contest.run.stage(stage, turns * suspects.len())?;
    let screening = Screening { contest, base, scene, suspects, stage };
    let at = base.linearised()?;
    if base.system.engine().is_some() {
        // Its derivatives along all windows serve for a part, too.
        let Refined { parameters, initial, .. } = &base.refined;
        tangent(&base.system, &base.experiment, parameters, initial);
    }
    let mut all = screening.run(&at, &[true, false])?;
    let innovations = Innovations::of(base, &at.jacobian);
    if let Some(innovations) = &innovations {
        for (all, more) in all.iter_mut().zip(screening.run(&innovations.linearised(), &[false])?) {
            let Some((all, more)) = all.as_mut().zip(more) else { continue };
            all.gains.iter_mut().zip(more.gains).for_each(|(all, more)| all.extend(more));
        }
    }
    Ok(all)
}

/// A screening of all suspects at a contestant.
struct Screening<'a> {
    contest: &'a Contest<'a>,
    base: &'a Contestant,
    scene: Scene,
    suspects: Vec<Vec<usize>>,
    stage: Stage<'a>,
}

impl Screening<'_> {
    /// Gains of all suspects under some noise models, white or not.
    fn run(&self, at: &Linearised<'_>, white: &[bool]) -> Result<Vec<Option<Screened>>> {
        let is_dear = self.base.system.engine().is_some();
        let Some(sketch) = is_dear.then(|| at.sketch(SKETCHED)).flatten() else { return self.on(at, white, &|_| true) };
        let mut rough = self.on(&sketch.linearised(), white, &|_| true)?;
        let leaders = leaders(self.contest, &rough, white.len());
        let mut whole = self.on(at, white, &|place| leaders.contains(&place))?;
        for basis in 0..white.len() {
            let last = whole.iter().flatten().map(|s| s.best(basis)).fold(f64::INFINITY, f64::min);
            for gain in rough.iter_mut().flatten().flat_map(|s| &mut s.gains).map(|g| &mut g[basis]) {
                gain.gain = (gain.gain / sketch.share).min(last);
                gain.deviation = gain.deviation.map(|deviation| deviation * sketch.share.sqrt());
            }
        }
        for (whole, rough) in whole.iter_mut().zip(rough) {
            if whole.is_none() {
                *whole = rough;
            }
        }
        Ok(whole)
    }

    /// The same for some of the suspects, on all windows.
    fn on(&self, at: &Linearised<'_>, white: &[bool], which: &dyn Fn(usize) -> bool) -> Result<Vec<Option<Screened>>> {
        let bases: Vec<Basis> = white.iter().map(|&white| Basis::new(at, white)).collect();
        let bases: Vec<&Basis> = bases.iter().collect();
        let wanted: Vec<Option<&Vec<usize>>> =
            self.suspects.iter().enumerate().map(|(place, members)| which(place).then_some(members)).collect();
        wanted
            .into_par_iter()
            .map(|members| members.map_or(Ok(None), |members| self.one(members, at, &bases)))
            .collect()
    }

    fn one(&self, members: &[usize], at: &Linearised<'_>, bases: &[&Basis]) -> Result<Option<Screened>> {
        let Self { contest, base, .. } = self;
        let hypotheses: Vec<&Hypothesis> = members.iter().map(|&h| &contest.hypotheses[h]).collect();
        let known = hypotheses.iter().any(|h| base.hypotheses.contains(h) || is_freed(base, h));
        let is_too_many = members.len() > 1 && base.hypotheses.len() + members.len() > contest.most;
        if known || is_too_many || contest.run.is_out_of_time() {
            return Ok(None);
        }
        // An effect that can't be written into this model is none of its suspects.
        let Ok(applied) = joint::apply(&hypotheses, base.system.model(), &self.scene) else { return Ok(None) };
        let gains = gains(&applied, at, bases);
        self.stage.advance()?;
        Ok(Some(Screened { members: members.to_vec(), applied, gains }))
    }
}

/// The suspects with the largest gains by any of so many noise models, and the best of every family.
fn leaders(contest: &Contest<'_>, screened: &[Option<Screened>], models: usize) -> Vec<usize> {
    let mut all = Vec::new();
    for basis in 0..models {
        let mut order: Vec<(usize, &Screened)> =
            screened.iter().enumerate().filter_map(|(place, s)| Some((place, s.as_ref()?))).collect();
        order.sort_by(|a, b| b.1.best(basis).total_cmp(&a.1.best(basis)));
        let mut families = Vec::new();
        for (rank, (place, suspect)) in order.into_iter().enumerate() {
            let family = contest.hypotheses[suspect.members[0]].family();
            let is_first = !families.contains(&family);
            if is_first {
                families.push(family);
            }
            if rank < SCREENED || is_first {
                all.push(place);
            }
        }
    }
    all
}

/// Gain and degrees of freedom of every function without a name at `base`, under coloured noise; on a part of the windows first, as
/// in [`screen`].
pub(crate) fn nameless(contest: &Contest<'_>, base: &Contestant) -> Result<Vec<(f64, usize)>> {
    contest.run.begin("functions without a name");
    let at = base.linearised()?;
    let gain = |rival: &Rival, at: &Linearised<'_>, coloured: &Basis| {
        let applied = rival.apply(base.system.model(), &contest.scene);
        let found = gains(&applied, at, &[coloured]);
        found.first().map_or((0.0, 1), |g| (g[0].gain, g[0].degrees))
    };
    let coloured = Basis::new(&at, false);
    let is_dear = base.system.engine().is_some() && contest.rivals.len() > SCREENED;
    let Some(sketch) = is_dear.then(|| at.sketch(SKETCHED)).flatten() else {
        return Ok(contest.rivals.par_iter().map(|rival| gain(rival, &at, &coloured)).collect());
    };
    let part = sketch.linearised();
    let rough_noise = Basis::new(&part, false);
    let mut all: Vec<(f64, usize)> = contest.rivals.par_iter().map(|rival| gain(rival, &part, &rough_noise)).collect();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| all[b].0.total_cmp(&all[a].0));
    let leaders = &order[..SCREENED];
    let whole: Vec<(f64, usize)> =
        leaders.par_iter().map(|&place| gain(&contest.rivals[place], &at, &coloured)).collect();
    let last = whole.iter().map(|(gain, _)| *gain).fold(f64::INFINITY, f64::min);
    all.iter_mut().for_each(|(gain, _)| *gain = (*gain / sketch.share).min(last));
    for (&place, whole) in leaders.iter().zip(whole) {
        all[place] = whole;
    }
    Ok(all)
}

/// Whether the hypothesis frees a parameter that a hypothesis of this contestant has freed.
fn is_freed(base: &Contestant, hypothesis: &Hypothesis) -> bool {
    hypothesis.frees().is_some_and(|name| base.added.iter().flatten().any(|(_, added)| added.name == name))
}
