//! The contest: screen every hypothesis at a contestant, refit the promising ones, go on from the best.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis, Start};
use crate::diagnose::catalogue::peaks::peaks;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::steps::screen::{Basis, Gain, gains};
use crate::error::Result;
use crate::parallel::*;
use crate::progress::{Progress, step};
use crate::refine::Refine;
use std::collections::BTreeMap;

/// How many contestants go on to the next round.
const BEAM: usize = 3;

/// Steps of a first fit, how many contestants are fitted to the end, and how many nats behind the best they may be.
const ROUGH: usize = 4;
const FINALISTS: usize = 5;
pub(crate) const NEAR: f64 = 30.0;

/// How many hypotheses are refitted at a contestant.
const SHORTLIST: usize = 14;

/// How many sets of effects that promise more together than any of them alone are refitted at a contestant.
const TOGETHER: usize = 4;

/// Most effects in one equation: more of them fit any curve.
const MOST_PER_EQUATION: usize = 4;

/// Mean squared residual (in noise units) that one more effect must remove to be worth a name.
///
/// An effect below a fifth of the sensor's noise changes no decision, and the smoothed corners of
/// Coulomb friction, or a coarse integration, can feign one of that size in a long log.
pub(crate) const MATERIAL: f64 = 0.04;

/// Evidence (nats beyond BIC) that one more effect must bring.
pub(crate) const CONVINCING: f64 = 5.0;

/// All that a contest needs to know.
pub(crate) struct Contest<'a> {
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Sets of hypotheses that also apply together.
    pub(crate) joint: Vec<Vec<usize>>,
    /// Largest number of effects together.
    pub(crate) most: usize,
    pub(crate) scene: Scene,
    pub(crate) settings: Refine,
    pub(crate) progress: &'a dyn Progress,
}

/// What a screening says of one hypothesis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summary {
    pub(crate) gain: f64,
    pub(crate) degrees: usize,
    /// Standard deviation of the effect's size and its unit, where the size is what was screened.
    pub(crate) resolution: Option<(f64, String)>,
}

/// What was found one step on from a contestant.
pub(crate) struct Expansion {
    /// Contestants with one more effect, best first.
    pub(crate) fits: Vec<Fitted>,
    /// Straight-line gain of every hypothesis under coloured noise, in their order.
    pub(crate) screened: Vec<Summary>,
    /// How many starts were tried in all: what the search must pay for.
    pub(crate) tried: usize,
}

impl Expansion {
    fn of(screened: &[Option<Screened>]) -> Self {
        let summary = screened.iter().map(|s| s.as_ref().map_or_else(Summary::default, Screened::summary)).collect();
        let tried = screened.iter().flatten().map(|s| s.gains.len()).sum();
        Self { fits: Vec::new(), screened: summary, tried }
    }

    /// Chance that noise and negligible structure give as large a gain somewhere in the search (Bonferroni).
    pub(crate) fn p_value(&self, at: &Fitted) -> f64 {
        let (count, spent) = (at.count(), at.spent());
        let allowed = at.negligible() * count as f64;
        let best = self
            .screened
            .iter()
            .map(|s| gain_tail(with_fitted_level(s.gain - allowed, count), s.degrees, count, spent));
        (best.fold(1.0, f64::min) * self.tried as f64).min(1.0)
    }
}

/// Contestants that differ by one effect from a set of effects; kept so that a set is tried once only.
pub(crate) struct Known {
    pub(crate) with: Vec<Hypothesis>,
    pub(crate) fits: Vec<Fitted>,
}

impl Known {
    pub(crate) fn new(with: &Fitted, fits: &[Fitted]) -> Self {
        Self { with: with.hypotheses.clone(), fits: fits.iter().map(Fitted::slim).collect() }
    }

    /// Whether these are the contestants one step on from `base`.
    pub(crate) fn is_of(&self, base: &Fitted) -> bool {
        self.with.len() == base.hypotheses.len() && base.hypotheses.iter().all(|h| self.with.contains(h))
    }
}

/// Hypotheses screened together (most alone): their gains by start, under white and under coloured noise.
struct Screened {
    members: Vec<usize>,
    applied: Applied,
    gains: Vec<Vec<Gain>>,
}

impl Screened {
    fn best(&self, basis: usize) -> f64 {
        self.gains.iter().map(|g| g[basis].gain).fold(0.0, f64::max)
    }
}

impl Screened {
    fn summary(&self) -> Summary {
        let all = self.gains.iter().map(|g| &g[1]);
        let Some(best) = all.max_by(|a, b| a.gain.total_cmp(&b.gain)) else { return Summary::default() };
        let unit = self.applied.fitted.first().map(|(_, a)| a.unit.clone()).unwrap_or_default();
        let resolution = best.deviation.map(|deviation| (deviation, unit));
        Summary { gain: best.gain, degrees: best.degrees, resolution }
    }
}

impl Contest<'_> {
    /// Log prior odds: families alike, members alike within their family.
    pub(crate) fn log_prior(&self, hypothesis: &Hypothesis) -> f64 {
        let mut families: BTreeMap<_, usize> = BTreeMap::new();
        for h in &self.hypotheses {
            *families.entry(h.family()).or_default() += 1;
        }
        let members = families.get(&hypothesis.family()).copied().unwrap_or(1);
        -((families.len().max(1) * members) as f64).ln()
    }

    /// Score with prior odds.
    pub(crate) fn score(&self, fitted: &Fitted) -> f64 {
        fitted.score() + fitted.hypotheses.iter().map(|h| self.log_prior(h)).sum::<f64>()
    }

    /// Screens everything at `base` and refits what is promising.
    pub(crate) fn expand(&self, base: &Fitted, stage: &str) -> Result<Expansion> {
        let screened = self.screen(base, stage)?;
        let mut fits = self.refit(base, &screened);
        let surveyed = Expansion::of(&screened);
        fits.iter_mut().for_each(|fit| fit.tried = surveyed.tried);
        step(self.progress, stage, 2, 2)?;
        Ok(Expansion { fits, ..surveyed })
    }

    /// As [`Contest::expand`] without the refits: what straight lines say.
    pub(crate) fn survey(&self, base: &Fitted, stage: &str) -> Result<Expansion> {
        let screened = self.screen(base, stage)?;
        step(self.progress, stage, 2, 2)?;
        Ok(Expansion::of(&screened))
    }

    /// Straight-line gains of every hypothesis that is not in `base` already.
    fn screen(&self, base: &Fitted, stage: &str) -> Result<Vec<Option<Screened>>> {
        let scene = Scene { peaks: peaks(base), ..self.scene.clone() };
        let white = Basis::new(base, true);
        let coloured = Basis::new(base, false);
        step(self.progress, stage, 0, 2)?;
        let alone = (0..self.hypotheses.len()).map(|h| vec![h]);
        let suspects: Vec<Vec<usize>> = alone.chain(self.joint.iter().cloned()).collect();
        let screened = suspects
            .into_par_iter()
            .map(|members| {
                let hypotheses: Vec<&Hypothesis> = members.iter().map(|&h| &self.hypotheses[h]).collect();
                let known = hypotheses.iter().any(|h| base.hypotheses.contains(h) || base.refit_already(h));
                if known || (members.len() > 1 && base.hypotheses.len() + members.len() > self.most) {
                    return None;
                }
                let applied =
                    crate::diagnose::catalogue::joint::apply(&hypotheses, base.system.model(), &scene).ok()?;
                let gains = gains(&applied, base, &[&white, &coloured]);
                Some(Screened { members, applied, gains })
            })
            .collect();
        step(self.progress, stage, 1, 2)?;
        Ok(screened)
    }

    /// Contestants with one more effect, best first: those whose straight-line gain is promising.
    fn refit(&self, base: &Fitted, screened: &[Option<Screened>]) -> Vec<Fitted> {
        let promising = screened.iter().flatten().any(|s| self.is_promising(base, s.best(0).max(s.best(1))));
        let has_room = |members: &[usize]| {
            members.iter().all(|&m| {
                let state = self.hypotheses[m].state;
                let more = members.iter().filter(|&&h| self.hypotheses[h].state == state).count();
                let room = base.hypotheses.iter().filter(|h| h.state == state).count() + more <= MOST_PER_EQUATION;
                // Frictions that only show together are one law of that equation.
                room || (members.len() > 1 && base.hypotheses.is_empty())
            })
        };
        let mut jobs = if promising { self.jobs(screened) } else { Vec::new() };
        jobs.retain(|(h, _)| screened[*h].as_ref().is_some_and(|s| has_room(&s.members)));
        let rough = Refine { max_iterations: ROUGH, ..self.settings.clone() };
        let mut fits: Vec<Fitted> = jobs
            .par_iter()
            .filter_map(|(h, values)| {
                let screened = screened[*h].as_ref()?;
                let members: Vec<&Hypothesis> = screened.members.iter().map(|&h| &self.hypotheses[h]).collect();
                base.with_all(&members, &screened.applied, values, &rough).ok()
            })
            .collect();
        sort_by_score(&mut fits, |f| self.score(f));
        keep_first_of_each(&mut fits);
        // Those that may still win are fitted to the end.
        let last = fits.get(FINALISTS - 1).map_or(f64::NEG_INFINITY, |f| self.score(f));
        let near = fits.first().map_or(0.0, |f| self.score(f)) - NEAR;
        fits = fits
            .into_par_iter()
            .map(|fit| match self.score(&fit) >= last.min(near) && !fit.refined.converged {
                true => fit.again(&self.settings),
                false => fit,
            })
            .collect();
        sort_by_score(&mut fits, |f| self.score(f));
        // The next round goes on from the leader, so its fit is worth every step.
        if let Some(leader) = fits.first_mut() {
            let to_the_end = Refine { max_iterations: 60, ..self.settings.clone() };
            let carried_on = if leader.refined.converged { leader.clone() } else { leader.clone().again(&to_the_end) };
            *leader = carried_on.restarted(&self.settings);
        }
        fits
    }

    /// Contestants one step on from `base`, tried now where they are not `known` yet.
    pub(crate) fn expand_once(&self, base: &Fitted, stage: &str, known: &mut Vec<Known>) -> Result<Vec<Fitted>> {
        if let Some(known) = known.iter().find(|k| k.is_of(base)) {
            return Ok(known.fits.clone());
        }
        let fits = self.expand(base, stage)?.fits;
        known.push(Known::new(base, &fits));
        Ok(fits)
    }

    /// Whether a straight-line gain is large enough for one more effect to be convincing and material.
    ///
    /// Half of what would be needed, because a straight line underrates a curved effect.
    fn is_promising(&self, base: &Fitted, gain: f64) -> bool {
        // What tolerated parameters have taken up may be this effect's.
        let hidden = base.strain() > MATERIAL;
        gain > CONVINCING && (hidden || gain > 0.5 * MATERIAL * base.count() as f64 * base.misfit().min(1.0))
    }

    /// Which hypotheses are refitted, and from which values: the best by either noise model, the best of each family,
    /// and those that promise together what none of them does alone.
    fn jobs(&self, screened: &[Option<Screened>]) -> Vec<(usize, Vec<Vec<f64>>)> {
        let mut chosen: Vec<usize> = Vec::new();
        let (alone, joint) = screened.split_at(self.hypotheses.len());
        for basis in [0, 1] {
            let best = |h: usize| screened[h].as_ref().map_or(0.0, |s| s.best(basis));
            let mut together: Vec<(usize, f64)> = Vec::new();
            for (place, suspect) in joint.iter().enumerate() {
                let Some(suspect) = suspect else { continue };
                let members = suspect.members.iter().map(|&h| best(h)).fold(0.0, f64::max);
                if suspect.best(basis) > members + CONVINCING {
                    together.push((alone.len() + place, suspect.best(basis)));
                }
            }
            together.sort_by(|a, b| b.1.total_cmp(&a.1));
            chosen.extend(together.iter().take(TOGETHER).map(|t| t.0));
            let mut order: Vec<(usize, f64)> =
                alone.iter().enumerate().filter_map(|(h, s)| Some((h, s.as_ref()?.best(basis)))).collect();
            order.sort_by(|a, b| b.1.total_cmp(&a.1));
            let largest = order.first().map_or(0.0, |o| o.1);
            chosen.extend(order.iter().take(SHORTLIST).filter(|o| o.1 > 0.0).map(|o| o.0));
            let mut families = Vec::new();
            for (h, gain) in order {
                if gain > 0.2 * largest && !families.contains(&self.hypotheses[h].family()) {
                    families.push(self.hypotheses[h].family());
                    chosen.push(h);
                }
            }
        }
        chosen.sort_unstable();
        chosen.dedup();
        let starts = |h: usize| {
            let mut order: Vec<(&Start, &Vec<Gain>)> =
                screened[h].iter().flat_map(|s| s.applied.starts.iter().zip(&s.gains)).collect();
            order.sort_by(|a, b| b.1[0].gain.total_cmp(&a.1[0].gain));
            order.into_iter().take(2).map(move |(start, g)| (h, start.shortened(&g[0].values))).collect::<Vec<_>>()
        };
        chosen.into_iter().flat_map(starts).collect()
    }

    /// Adds effects as long as they convince; returns the winner, and what was tried on the way.
    pub(crate) fn run(&self, nominal: &Fitted, first: Expansion, most: usize) -> Result<(Fitted, Vec<Known>)> {
        let mut best = nominal.clone();
        let mut known = vec![Known::new(nominal, &first.fits)];
        let mut beam = different(first.fits);
        for round in 1..=most {
            let Some(leader) = beam.first() else { break };
            if !self.is_convincing(leader, &best) {
                break;
            }
            best = leader.clone();
            if round == most || best.hypotheses.len() >= most || best.misfit() < 1e-12 {
                break;
            }
            let mut next = Vec::new();
            for (place, contestant) in beam.iter().filter(|f| f.hypotheses.len() < most).enumerate() {
                // Where nothing is left at the leader, the others need not be tried with more.
                if place > 0 && next.is_empty() {
                    break;
                }
                let stage = format!("effects together: {}", round + 1);
                let fits = self.expand(contestant, &stage)?.fits;
                known.push(Known::new(contestant, &fits));
                next.extend(fits.into_iter().take(2 * BEAM));
            }
            sort_by_score(&mut next, |f| self.score(f));
            keep_first_of_each(&mut next);
            beam = different(next);
        }
        Ok((best, known))
    }

    /// Whether `richer` says enough more than `simpler` to be preferred.
    pub(crate) fn is_convincing(&self, richer: &Fitted, simpler: &Fitted) -> bool {
        let evidence = self.score(richer) - self.score(simpler);
        // An effect also removes what tolerated parameters had to take up without it.
        let released = (simpler.strain() - richer.strain()).max(0.0);
        let removed = simpler.misfit() - richer.misfit() + released;
        let material = removed > MATERIAL * richer.misfit().min(1.0) + simpler.model_error;
        evidence > CONVINCING && material && self.is_significant(richer, simpler)
    }

    /// Whether noise would rarely give such a gain anywhere in the search; BIC alone is lenient in short logs.
    fn is_significant(&self, richer: &Fitted, simpler: &Fitted) -> bool {
        const CHANCE: f64 = 0.05;
        let gain = 2.0 * (richer.evidence() - simpler.evidence());
        let degrees = richer.complexity().saturating_sub(simpler.complexity());
        gain_tail(gain, degrees, richer.count(), simpler.spent()) * richer.tried as f64 <= CHANCE
    }

    /// Gain and degrees of freedom of every rival at `base`, under coloured noise.
    pub(crate) fn rivals(&self, base: &Fitted, rivals: &[Rival]) -> Vec<(f64, usize)> {
        let coloured = Basis::new(base, false);
        rivals
            .par_iter()
            .map(|rival| {
                let applied = rival.apply(base.system.model(), &self.scene);
                let found = gains(&applied, base, &[&coloured]);
                found.first().map_or((0.0, 1), |g| (g[0].gain, g[0].degrees))
            })
            .collect()
    }
}

impl Fitted {
    /// Whether the hypothesis frees a parameter that a hypothesis of this contestant has freed.
    fn refit_already(&self, hypothesis: &Hypothesis) -> bool {
        hypothesis.frees().is_some_and(|name| self.added.iter().flatten().any(|(_, added)| added.name == name))
    }
}

pub(crate) fn sort_by_score(fits: &mut [Fitted], score: impl Fn(&Fitted) -> f64) {
    fits.sort_by(|a, b| score(b).total_cmp(&score(a)));
}

/// The first contestants whose outputs differ: what cannot be told apart now need not be carried on twice, and
/// leaves room for another account of the logs. The final swaps bring the twins back.
fn different(fits: Vec<Fitted>) -> Vec<Fitted> {
    /// Mean squared difference, as a share of what is left to explain, below which two contestants are one.
    const ALIKE: f64 = 1e-3;
    let mut kept: Vec<Fitted> = Vec::with_capacity(BEAM);
    for fit in fits {
        if kept.len() == BEAM {
            break;
        }
        let is_known = |other: &Fitted| other.distance(&fit) < ALIKE * other.misfit().min(fit.misfit());
        if !kept.iter().any(is_known) {
            kept.push(fit);
        }
    }
    kept
}

/// Keeps the first contestant with each set of hypotheses.
pub(crate) fn keep_first_of_each(fits: &mut Vec<Fitted>) {
    let mut seen: Vec<Vec<Hypothesis>> = Vec::new();
    fits.retain(|fit| {
        let same = |other: &Vec<Hypothesis>| {
            other.len() == fit.hypotheses.len() && fit.hypotheses.iter().all(|h| other.contains(h))
        };
        if seen.iter().any(same) {
            return false;
        }
        seen.push(fit.hypotheses.clone());
        true
    });
}
