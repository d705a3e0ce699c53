//! Screen: linearised gains of every hypothesis, and of generic smooth functions, at a contestant.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::colours::noise::{ByNoise, Noise};
use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::innovations::Innovations;
use crate::diagnose::fit::linear::basis::{Basis, Out, View};
use crate::diagnose::fit::linear::gains::{gains, gains_of_family};
use crate::diagnose::fit::linear::outs::{in_place, interact, outs};
use crate::diagnose::fit::peaks::peaks;
use crate::diagnose::fit::sampling::jitter::samplings;
use crate::diagnose::limits::{SCREENED, SKETCHED, SWAPPED};
use crate::diagnose::run::Stage;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::pairs::pairs;
use crate::diagnose::steps::attribution::survey::{Looked, Pair, Screened, Survey};
use crate::error::Result;
use crate::parallel;
use crate::refine::Kept;
use std::ops::Range;
use std::sync::Arc;

/// Straight-line gains of every hypothesis that is not in `base` already, besides its effects and in the place of each.
///
/// Of long logs all are screened on a part of the windows first, and only those that lead there on all of them; the others keep what
/// the part says of the whole, but below the leaders. Suspects of a simulator that steps have one more gain each, by the innovations.
///
/// With `only` the hypotheses of these numbers alone are screened.
pub(crate) fn screen(
    contest: &Contest<'_>,
    nominal: &Contestant,
    base: &Contestant,
    (stage, only): (&str, Option<Range<usize>>),
) -> Result<Survey> {
    let at = base.linearised()?.with_steps();
    let scene = contest.scene_of(base);
    // Holds that have no turn in this round need not be looked for.
    let asked =
        only.clone().map_or(Some(&contest.hypotheses[..]), |only| contest.hypotheses.get(only)).unwrap_or_default();
    let scene = Scene { peaks: peaks(base), holds: samplings(asked, &at, &scene), ..scene };
    let alone = (0..contest.hypotheses.len()).map(|h| vec![h]);
    let suspects: Vec<Vec<usize>> = alone.chain(contest.joint.iter().cloned()).collect();
    // Where there are innovations, all suspects have their turn with them, too.
    let turns = if base.system.engine().is_some() { 2 } else { 1 };
    let count = only.as_ref().map_or(suspects.len(), Range::len);
    let stage = contest.run.stage(stage, turns * count)?;
    let screening = Screening { contest, nominal, base, scene, suspects, only, stage };
    let mut all = screening.run(&at, &[Noise::White, Noise::Coloured])?;
    let innovations = Innovations::of(base, &at.jacobian);
    if let Some(innovations) = &innovations {
        let more = screening.run(&innovations.linearised(), &[Noise::Innovations])?;
        all.looked.extend(more.looked);
        all.pairs = more.pairs;
        for (all, more) in all.suspects.iter_mut().zip(more.suspects) {
            let Some((all, more)) = all.as_mut().zip(more) else { continue };
            all.gains.iter_mut().zip(more.gains).for_each(|(all, more)| all.extend(more));
        }
    }
    if base.system.engine().is_none() {
        all.kept = Some(Arc::new(Kept::new(at.jacobian, &base.system, &base.experiment, &base.free)));
    }
    Ok(all)
}

/// A screening of all suspects at a contestant.
struct Screening<'a> {
    contest: &'a Contest<'a>,
    nominal: &'a Contestant,
    base: &'a Contestant,
    scene: Scene,
    suspects: Vec<Vec<usize>>,
    only: Option<Range<usize>>,
    stage: Stage<'a>,
}

impl Screening<'_> {
    /// Gains of all suspects by some noise models.
    fn run(&self, at: &Linearised<'_>, models: &[Noise]) -> Result<Survey> {
        let Some(sketch) = at.sketch(SKETCHED) else { return self.on(at, models, &|_| true, false) };
        let mut rough = self.on(&sketch.linearised(), models, &|_| true, true)?.suspects;
        let leaders = leaders(self.contest, &rough, models);
        let mut whole = self.on(at, models, &|place| leaders.contains(&place), false)?;
        for &noise in models {
            for view in 0..whole.looked.of(noise).map_or(0, Vec::len) {
                let last =
                    whole.suspects.iter().flatten().map(|s| s.best_in(noise, view)).fold(f64::INFINITY, f64::min);
                let all = rough.iter_mut().flatten().flat_map(|s| &mut s.gains);
                for gain in all.filter_map(|gains| gains.of_mut(noise)?.get_mut(view)) {
                    gain.gain = (gain.gain / sketch.share).min(last);
                    gain.deviation = gain.deviation.map(|deviation| deviation * sketch.share.sqrt());
                }
            }
        }
        for (whole, rough) in whole.suspects.iter_mut().zip(rough) {
            if whole.is_none() {
                *whole = rough;
            }
        }
        Ok(whole)
    }

    /// The same for some of the suspects; of a part of the windows, `is_rough`, no pairs.
    fn on(
        &self,
        at: &Linearised<'_>,
        models: &[Noise],
        which: &dyn Fn(usize) -> bool,
        is_rough: bool,
    ) -> Result<Survey> {
        let outs = outs(self.nominal, at, &self.contest.scene);
        let bases: Vec<Basis> = models.iter().map(|&noise| Basis::new(at, noise, &outs)).collect();
        let looked = |basis: &Basis| {
            let of = |view: &View| Looked { places: view.places.clone(), loss: view.loss };
            (basis.noise, basis.views().iter().map(of).collect())
        };
        let looked = bases.iter().map(looked).collect();
        let bases: Vec<&Basis> = bases.iter().collect();
        let is_wanted = |place: usize| which(place) && self.only.as_ref().is_none_or(|only| only.contains(&place));
        let wanted: Vec<Option<&Vec<usize>>> =
            self.suspects.iter().enumerate().map(|(place, members)| is_wanted(place).then_some(members)).collect();
        let suspects = parallel::try_map(wanted, |members| {
            members.map_or(Ok(None), |members| self.one(members, at, (&bases, &outs)))
        })?;
        let looked: ByNoise<Vec<Looked>> = looked;
        let mut found: Vec<Pair> = Vec::new();
        for (basis, (_, looked)) in bases.iter().zip(looked.iter()).filter(|_| !is_rough) {
            for pair in pairs(&suspects, basis, looked, at) {
                if !found.iter().any(|known| (&known.members, &known.places) == (&pair.members, &pair.places)) {
                    found.push(pair);
                }
            }
        }
        Ok(Survey { suspects, looked, pairs: found, kept: None, is_behind: false })
    }

    fn one(
        &self,
        members: &[usize],
        at: &Linearised<'_>,
        (bases, outs): (&[&Basis], &[Out]),
    ) -> Result<Option<Screened>> {
        let Self { contest, nominal, base, .. } = self;
        let hypotheses: Vec<&Hypothesis> = members.iter().map(|&h| &contest.hypotheses[h]).collect();
        let known = hypotheses.iter().any(|h| base.hypotheses.contains(h) || is_freed(base, h));
        let is_too_many = members.len() > 1 && base.hypotheses.len() + members.len() > contest.most;
        if known || is_too_many || contest.run.is_out_of_time() {
            return Ok(None);
        }
        // An effect that can't be written into this model is none of its suspects.
        let Ok(applied) = joint::apply(&hypotheses, base.system.model(), &self.scene) else { return Ok(None) };
        let mut gains = gains(&applied, at, bases);
        // What acts on the same control or column as an effect that is there does something else in its place.
        for (number, out) in outs.iter().enumerate() {
            let [hypothesis] = hypotheses[..] else { break };
            if out.places.len() > 1 || !interact(hypothesis, &base.hypotheses[out.places[0]]) {
                continue;
            }
            let Some(columns) = in_place(nominal, at, hypothesis, out, (&self.scene, &contest.scene)) else { continue };
            for ((gains, start), columns) in gains.iter_mut().zip(&applied.starts).zip(columns) {
                for basis in bases {
                    let Some(gains) = gains.of_mut(basis.noise) else { continue };
                    gains[1 + number] = basis.gain_in(1 + number, start, &applied.fitted, &mut columns.clone());
                }
            }
        }
        self.stage.advance()?;
        Ok(Some(Screened { members: members.to_vec(), applied, gains }))
    }
}

/// The suspects with the largest gains in any view by any of these noise models, and the best of every family.
fn leaders(contest: &Contest<'_>, screened: &[Option<Screened>], models: &[Noise]) -> Vec<usize> {
    let views = |noise: Noise| {
        let count = |s: &Screened| s.gains.iter().filter_map(|gains| Some(gains.of(noise)?.len())).max();
        screened.iter().flatten().filter_map(count).max().unwrap_or(0)
    };
    let mut all = Vec::new();
    for (noise, view) in models.iter().flat_map(|&noise| (0..views(noise)).map(move |view| (noise, view))) {
        let mut order: Vec<(usize, &Screened)> =
            screened.iter().enumerate().filter_map(|(place, s)| Some((place, s.as_ref()?))).collect();
        order.sort_by(|a, b| b.1.best_in(noise, view).total_cmp(&a.1.best_in(noise, view)));
        let mut families = Vec::new();
        let most = if view == 0 { SCREENED } else { SWAPPED };
        for (rank, (place, suspect)) in order.into_iter().enumerate() {
            let family = contest.hypotheses[suspect.members[0]].family();
            let is_first = view == 0 && !families.contains(&family);
            if is_first {
                families.push(family);
            }
            if rank < most || is_first {
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
    if contest.run.is_out_of_time() {
        return Ok(vec![(0.0, 1); contest.rivals.len()]);
    }
    let at = base.linearised()?.with_steps();
    let gain = |rival: &Rival, at: &Linearised<'_>, coloured: &Basis| {
        if contest.run.is_out_of_time() {
            return (0.0, 1);
        }
        let found = gains_of_family(rival, &contest.scene, at, coloured);
        found.first().map_or((0.0, 1), |g| (g.gain, g.degrees))
    };
    let coloured = Basis::new(&at, Noise::Coloured, &[]);
    let is_dear = contest.rivals.len() > SCREENED;
    let Some(sketch) = is_dear.then(|| at.sketch(SKETCHED)).flatten() else {
        return Ok(parallel::map(&contest.rivals, |rival| gain(rival, &at, &coloured)));
    };
    let part = sketch.linearised();
    let rough_noise = Basis::new(&part, Noise::Coloured, &[]);
    let mut all: Vec<(f64, usize)> = parallel::map(&contest.rivals, |rival| gain(rival, &part, &rough_noise));
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| all[b].0.total_cmp(&all[a].0));
    let leaders = &order[..SCREENED];
    let whole: Vec<(f64, usize)> = parallel::map(leaders, |&place| gain(&contest.rivals[place], &at, &coloured));
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
