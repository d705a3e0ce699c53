//! The contest: its hypotheses, and the rules by which contestants are compared.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::invariance::broken;
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::place::Family;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::by_run::differing;
use crate::diagnose::fit::contestant::{Contestant, Entrant};
use crate::diagnose::fit::evidence::gain_tail;
use crate::diagnose::fit::fitter::{Fitter, standing_at};
use crate::diagnose::fit::own_sizes::inherited;
use crate::diagnose::limits::{Budget, CHANCE, CLOCK, CONVINCING, LEFT_OVER, MATERIAL, OWN_SIZES, SHOWN_CLOCK};
use crate::diagnose::run::Run;
use crate::diagnose::steps::attribution::survey::Summary;
use crate::diagnose::steps::attribution::suspects::Suspects;
use crate::error::{Result, unless_refused};
use std::collections::BTreeMap;
use std::ops::Range;

/// The suspects, and the rules by which one wins.
pub(crate) struct Contest<'a> {
    pub(crate) run: &'a Run<'a>,
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Those that become suspects where an effect that imitates them leads.
    behind: Vec<Hypothesis>,
    /// Sets of hypotheses that also apply together.
    pub(crate) joint: Vec<Vec<usize>>,
    /// Functions without a name.
    pub(crate) rivals: Vec<Rival>,
    pub(crate) scene: Scene,
    /// Variables that say where the machine is, and that no rate depends on.
    places: Vec<String>,
    /// Whether random forces are suspects.
    pub(crate) random: bool,
    /// Largest number of effects together.
    pub(crate) most: usize,
    pub(crate) fitter: Fitter,
}

impl<'a> Contest<'a> {
    /// A contest of so many suspects together at `most`.
    pub(crate) fn new(run: &'a Run<'a>, fitter: Fitter, suspects: Suspects, most: usize) -> Self {
        let Suspects { hypotheses, behind, joint, rivals, scene, places, random } = suspects;
        Self { run, hypotheses, behind, joint, rivals, scene, places, random, most, fitter }
    }

    /// Makes suspects of those that an effect of the `leaders` imitates, and where the first of them leaves more than noise of all others
    /// whose straight line is their own; their numbers.
    pub(crate) fn calls(&mut self, leaders: &[Contestant]) -> Range<usize> {
        let is_left =
            leaders.first().is_some_and(|leader| leader.evidence.rest() > LEFT_OVER * leader.evidence.count() as f64);
        let leading = || leaders.iter().flat_map(|leader| &leader.hypotheses);
        let is_called =
            |h: &Hypothesis| (is_left && !h.begins_as_imitator()) || leading().any(|leading| h.stands_behind(leading));
        self.call(&is_called)
    }

    /// Makes suspects of all that wait for an effect that imitates them: nothing that they could stand behind is there. Their numbers.
    pub(crate) fn calls_all(&mut self) -> Range<usize> {
        self.call(&Hypothesis::waits)
    }

    /// Makes suspects of those that come into question beside `best`, and of those that mark a place where more than noise is left; their
    /// numbers.
    pub(crate) fn calls_beside(&mut self, best: &Contestant) -> Range<usize> {
        // Beside the nominal model the others were called already.
        let is_news = best.hypotheses.len() > 1 || best.evidence.leaves_a_rest();
        let is_called = |h: &Hypothesis| {
            let comes = |leading| h.is_elsewhere(leading) || (is_news && h.stands_behind(leading));
            best.hypotheses.iter().any(comes) || (best.evidence.leaves_a_rest() && h.marks_a_place())
        };
        self.call(&is_called)
    }

    fn call(&mut self, is_called: &dyn Fn(&Hypothesis) -> bool) -> Range<usize> {
        let (called, behind) = std::mem::take(&mut self.behind).into_iter().partition::<Vec<_>, _>(is_called);
        self.behind = behind;
        let first = self.hypotheses.len();
        self.hypotheses.extend(called);
        first..self.hypotheses.len()
    }

    /// What was `screened` before some suspects were called, with a place for each of these.
    pub(crate) fn with_places(&self, screened: &mut Vec<Summary>) {
        // Sets that apply together come behind all hypotheses.
        let (wanted, place) = (self.hypotheses.len() + self.joint.len(), screened.len() - self.joint.len());
        let missing = wanted - screened.len();
        screened.splice(place..place, vec![Summary::default(); missing]);
    }

    /// The suspects, and those that wait.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Hypothesis> {
        self.hypotheses.iter().chain(&self.behind)
    }

    /// Whether it is no suspect yet.
    pub(crate) fn is_waiting(&self, hypothesis: &Hypothesis) -> bool {
        self.behind.contains(hypothesis)
    }

    /// Lets those of the `called` wait again that are none of the leaders: every later round is the shorter for it. Says which stay. The few that
    /// mark a place stay, for they may only show beside a leader.
    pub(crate) fn dismisses(&mut self, called: Range<usize>, leaders: &[Contestant]) -> Vec<usize> {
        let leads = |h: &Hypothesis| h.marks_a_place() || leaders.iter().any(|leader| leader.hypotheses.contains(h));
        let stay: Vec<usize> = called.clone().filter(|&h| leads(&self.hypotheses[h])).collect();
        for (number, hypothesis) in called.clone().zip(self.hypotheses.split_off(called.start)) {
            let kept = if stay.contains(&number) { &mut self.hypotheses } else { &mut self.behind };
            kept.push(hypothesis);
        }
        stay
    }

    /// The scene in the windows of `base`, in which the size and the pace of some effects have their ends.
    pub(crate) fn scene_of(&self, base: &Contestant) -> Scene {
        Scene { window: base.experiment.longest_window(), ..self.scene.clone() }
    }

    /// Log prior odds: families alike, members alike within their family. What depends on the time is less expected, and on a place just so where
    /// the model is the same at every place.
    pub(crate) fn log_prior(&self, hypothesis: &Hypothesis) -> f64 {
        let mut families: BTreeMap<_, usize> = BTreeMap::new();
        for h in &self.hypotheses {
            *families.entry(h.family()).or_default() += 1;
        }
        let members = families.get(&hypothesis.family()).copied().unwrap_or(1);
        let is_unlike = hypothesis.family() == Family::Time || broken(hypothesis, &self.places).is_some();
        let unlike = match (is_unlike, self.scene.clocks.is_empty()) {
            (true, true) => CLOCK,
            (true, false) => SHOWN_CLOCK,
            (false, _) => 0.0,
        };
        -((families.len().max(1) * members) as f64).ln() - unlike
    }

    /// Log prior odds of a contestant's effects.
    pub(crate) fn prior(&self, fitted: &Contestant) -> f64 {
        let own = differing(&fitted.experiment).len() as f64;
        fitted.hypotheses.iter().map(|h| self.log_prior(h)).sum::<f64>() - OWN_SIZES * own
    }

    /// Score with prior odds.
    pub(crate) fn score(&self, fitted: &Contestant) -> f64 {
        fitted.evidence.score() + self.prior(fitted)
    }

    /// The same where only a share of the values counts.
    pub(crate) fn score_of(&self, fitted: &Contestant, alone: f64) -> f64 {
        fitted.evidence.score_of(alone) + self.prior(fitted)
    }

    /// Nats by which `one` beats `other`, counted as often as the likelier of them leaves values that count alone.
    pub(crate) fn lead(&self, one: &Contestant, other: &Contestant) -> f64 {
        let likelier = if one.evidence.likelihood() >= other.evidence.likelihood() { one } else { other };
        let alone = likelier.evidence.alone();
        self.score_of(one, alone) - self.score_of(other, alone)
    }

    /// The best of some, counted as often as the likeliest of them leaves values that count alone.
    pub(crate) fn best<'f>(&self, fits: impl Iterator<Item = &'f Contestant>) -> Option<&'f Contestant> {
        let fits: Vec<&Contestant> = fits.collect();
        let likelihood = |f: &&&Contestant| f.evidence.likelihood();
        let likeliest = fits.iter().max_by(|a, b| likelihood(a).total_cmp(&likelihood(b)))?;
        let alone = likeliest.evidence.alone();
        fits.into_iter().max_by(|a, b| self.score_of(a, alone).total_cmp(&self.score_of(b, alone)))
    }

    /// The best first.
    pub(crate) fn sort(&self, fits: &mut [Contestant]) {
        fits.sort_by(|a, b| self.score(b).total_cmp(&self.score(a)));
    }

    /// Whether `richer` says enough more than `simpler` to be preferred.
    pub(crate) fn is_convincing(&self, richer: &Contestant, simpler: &Contestant) -> bool {
        let evidence = self.lead(richer, simpler);
        let (more, less) = (&richer.evidence, &simpler.evidence);
        // An effect also removes what tolerated parameters had to take up without it.
        let released = (less.strain - more.strain).max(0.0);
        let removed = less.misfit() - more.misfit() + released;
        let material = removed > MATERIAL * more.misfit().min(1.0) + less.model_error;
        evidence > CONVINCING && material && is_significant(richer, simpler)
    }

    /// `base` with effects and their values, fitted all at once from where `best` is: one at a time, the first would
    /// be fitted without the others and might not find back. Nothing where they can't be simulated, or written together.
    pub(crate) fn again_with(
        &self,
        base: &Contestant,
        best: &Contestant,
        effects: &[(Entrant<'_>, Vec<f64>)],
    ) -> Result<Option<Contestant>> {
        self.again_by(base, best, effects, Budget::Usual)
    }

    fn again_by(
        &self,
        base: &Contestant,
        best: &Contestant,
        effects: &[(Entrant<'_>, Vec<f64>)],
        budget: Budget,
    ) -> Result<Option<Contestant>> {
        let entrants: Vec<Entrant<'_>> = effects.iter().map(|e| e.0).collect();
        let values: Vec<f64> = effects.iter().flat_map(|e| e.1.iter().copied()).collect();
        let again = self.with_values(base, best, &entrants, &[values], budget)?;
        again.map(|fit| if budget.only_ranks() { Ok(fit) } else { self.fitter.with_begun(fit, budget) }).transpose()
    }

    /// The same from the best of several values of all effects together.
    pub(crate) fn with_values(
        &self,
        base: &Contestant,
        best: &Contestant,
        entrants: &[Entrant<'_>],
        values: &[Vec<f64>],
        budget: Budget,
    ) -> Result<Option<Contestant>> {
        let hypotheses: Vec<&Hypothesis> = entrants.iter().map(|e| e.hypothesis).collect();
        // Effects that can't be written together, as a delay of what another effect made a state, are no set.
        let written = joint::apply(&hypotheses, base.system.model(), &self.scene_of(base));
        let Some(applied) = written.ok().filter(|applied| applied.model.check().is_ok()) else { return Ok(None) };
        let base = standing_at(base, best);
        let Some(fit) = unless_refused(self.fitter.with(&base, entrants, &applied, values, budget))? else {
            return Ok(None);
        };
        inherited(self.fitter, best, fit, budget).map(Some)
    }

    /// `best` without each of its effects in turn, fitted again from the nominal model; none where the others can't be fitted.
    pub(crate) fn without_each(
        &self,
        nominal: &Contestant,
        best: &Contestant,
        budget: Budget,
    ) -> Result<Vec<Option<Contestant>>> {
        let without = |place| self.again_by(nominal, best, &best.entrants_without(&[place]), budget);
        nominal.each((0..best.hypotheses.len()).collect(), without)
    }
}

/// Whether noise would rarely give such a gain anywhere in the search; BIC alone is lenient in short logs.
fn is_significant(richer: &Contestant, simpler: &Contestant) -> bool {
    let (more, less) = (&richer.evidence, &simpler.evidence);
    let alone = more.alone();
    let gain = 2.0 * alone * (more.likelihood() - less.likelihood());
    let degrees = more.complexity().saturating_sub(less.complexity());
    let chance = gain_tail(gain, degrees, (alone * more.count() as f64) as usize, less.spent());
    richer.searches_beyond(simpler).pay(chance) <= CHANCE
}

/// Keeps the first contestant with each set of hypotheses.
pub(crate) fn keep_first_of_each(fits: Vec<Contestant>) -> Vec<Contestant> {
    let mut kept: Vec<Contestant> = Vec::with_capacity(fits.len());
    for fit in fits {
        if !kept.iter().any(|other| other.has_effects_of(&fit)) {
            kept.push(fit);
        }
    }
    kept
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fit::fitter::unsearched;
    use crate::diagnose::fixture::{drive, fitted, slider, slider_model};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::System;
    use crate::progress::Silent;
    use crate::refine::Experiment;

    #[test]
    fn effects_that_can_not_be_written_together_are_no_set_and_no_error() {
        let (model, data) = drive(None, |x| 1.3 * x, 0.002, (2, 200));
        let (fitter, nominal) = fitted(&model, &data, 0.002);
        let run = Run::new(&Silent, None);
        let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
        let find = |id: &str| contest.hypotheses.iter().find(|h| h.id() == id).unwrap();
        let entrant = |id: &str, value: f64| (unsearched(find(id)), vec![value]);
        // A delay works on a control; one that lags is a state.
        let both = [entrant("input_delay", 0.02), entrant("input_lag", 0.05)];
        assert!(contest.again_with(&nominal, &nominal, &both).unwrap().is_none());
        for one in &both {
            assert!(contest.again_with(&nominal, &nominal, std::slice::from_ref(one)).unwrap().is_some());
        }
    }

    #[test]
    fn what_marks_a_place_is_called_where_more_than_noise_is_left() {
        let called = |ripple: f64| {
            let rate = |x: f64, v: f64, u: f64| u - 3.0 * v - ripple * (25.0 * x).sin();
            let input = |time: f64, run: f64| 8.0 * (0.9 * time + run).sin();
            let data = slider(1, rate, input, [0.003, 0.01], 100);
            let mut model = slider_model("u - 3*v");
            model.states[0].unit = "m".into();
            model.states[1].unit = "m/s".into();
            let system = System::new(&model).unwrap();
            let experiment = Experiment::new(&system, &data, Some(&[0.003, 0.01])).unwrap();
            let fitter = Fitter::default();
            let nominal = fitter.nominal(system, experiment, Vec::new(), Budget::Usual).unwrap();
            let run = Run::new(&Silent, None);
            let mut contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
            let new = contest.calls_beside(&nominal);
            if let Some(spring) = contest.hypotheses.iter().find(|h| h.id() == "linear_stiffness").cloned() {
                let prior = contest.log_prior(&spring);
                contest.places.clear();
                assert!((contest.log_prior(&spring) - prior - CLOCK).abs() < 1e-9);
            }
            contest.hypotheses[new].iter().map(|h| h.id().to_string()).collect::<Vec<_>>()
        };
        assert!(called(0.0).is_empty());
        let called = called(4.0);
        let marks = ["cogging", "end_stop", "linear_stiffness", "cubic_stiffness"];
        assert!(marks.iter().all(|id| called.iter().any(|found| found == id)), "{called:?}");
    }

    #[test]
    fn a_spring_that_pulls_a_slider_back_beside_dry_friction_is_named_where_no_rate_depends_on_its_place() {
        let rate = |x: f64, v: f64, u: f64| u - 3.0 * v - 1.5 * x - 0.4 * (v / 0.02).tanh();
        let data = slider(3, rate, |time, run| 2.0 * (0.9 * time + run).sin(), [0.002, 0.004], 300);
        let (train, holdout) = hold_out(&data).unwrap();
        let mut model = slider_model("u - 3*v");
        model.states[0].unit = "m".into();
        model.states[1].unit = "m/s".into();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let mut named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        named.sort_unstable();
        assert_eq!((found.verdict, named), (Verdict::Explained, vec!["coulomb_friction", "linear_stiffness"]));
    }

    #[test]
    fn a_lag_follows_what_a_rate_limit_lets_pass_in_either_order() {
        let (model, data) = drive(None, |x| 1.3 * x, 0.002, (2, 200));
        let (fitter, nominal) = fitted(&model, &data, 0.002);
        let run = Run::new(&Silent, None);
        let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
        let find = |id: &str| contest.hypotheses.iter().find(|h| h.id() == id).unwrap();
        let entrant = |id: &str, value: f64| (unsearched(find(id)), vec![value]);
        let orders = [["input_rate_limit", "input_lag"], ["input_lag", "input_rate_limit"]];
        let written = orders.map(|ids| {
            let hypotheses = ids.map(&find);
            let applied = joint::apply(&hypotheses, nominal.system.model(), &contest.scene_of(&nominal)).unwrap();
            applied.model.states.iter().map(|s| s.equation.to_string()).collect::<Vec<_>>()
        });
        assert_eq!(written[0], written[1]);
        let both = [entrant("input_rate_limit", 5.0), entrant("input_lag", 0.05)];
        assert!(contest.again_with(&nominal, &nominal, &both).unwrap().is_some());
    }
}
