//! Singles: the effects of one size that explain most beside random forces.
//!
//! A rollout charges a random force to whatever may take it up, so those effects that are best without it say little of those that are best beside
//! it. The innovations of the filter do: an effect's straight line there, with everything that is free projected out.

use super::account::Account;
use super::tune::products;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::joint;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::fit::filter::{Filter, Filtered, Pace};
use crate::diagnose::fit::linear::elimination::eliminate;
use crate::diagnose::limits::forcing::{BESIDE_FORCES, SLOPED};
use crate::diagnose::limits::{Budget, CONVINCING, FLAT};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::Result;
use crate::model::System;
use crate::parallel;
use crate::refine::Free;

/// What an effect promises: twice the nats that it gains, and its size.
struct Promise<'a> {
    hypothesis: &'a Hypothesis,
    gain: f64,
    value: f64,
}

impl Account {
    /// The effects of one size that promise most beside the same processes, and are none of the `known`, after a step beside `nominal`.
    pub(super) fn singles(
        &self,
        contest: &Contest<'_>,
        nominal: &Contestant,
        known: &[Contestant],
    ) -> Result<Vec<Contestant>> {
        let Some(found) = self.passed(&self.fit.refined.parameters) else { return Ok(Vec::new()) };
        let Some(slopes) = self.slopes(&found.whitened()) else { return Ok(Vec::new()) };
        let is_open = |h: &&Hypothesis| {
            h.has_single_size() && h.added_states() == 0 && known.iter().all(|fit| !fit.hypotheses.contains(h))
        };
        let open: Vec<&Hypothesis> = contest.hypotheses.iter().filter(is_open).collect();
        let promises = parallel::try_map(open, |h| self.promise(contest, h, (&found, &slopes)))?;
        let searches = Searches::of(promises.len());
        let mut promises: Vec<Promise<'_>> =
            promises.into_iter().flatten().filter(|promise| promise.gain > 2.0 * CONVINCING).collect();
        promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        promises.truncate(BESIDE_FORCES);
        let fit = |Promise { hypothesis, value, .. }: Promise<'_>| {
            let entrant = Entrant::new(hypothesis, searches);
            contest.with_values(nominal, nominal, &[entrant], &[vec![value]], Budget::Glance)
        };
        Ok(nominal.each(promises, fit)?.into_iter().flatten().collect())
    }

    /// What an effect promises where the filter `found` these innovations, which the free parameters move by these `slopes`; nothing where it
    /// can't be filtered.
    fn promise<'h>(
        &self,
        contest: &Contest<'_>,
        hypothesis: &'h Hypothesis,
        (found, slopes): (&Filtered, &[Vec<f64>]),
    ) -> Result<Option<Promise<'h>>> {
        let scene = contest.scene_of(&self.fit);
        let Ok(applied) = joint::apply(&[hypothesis], self.fit.system.model(), &scene) else { return Ok(None) };
        let [(index, added)] = &applied.fitted[..] else { return Ok(None) };
        let system = System::new(&applied.model)?;
        let Some(filter) = Filter::new(&system, self.processes.iter().map(|process| process.acts))? else {
            return Ok(None);
        };
        let mut parameters = system.parameter_values();
        parameters[..self.fit.refined.parameters.len()].copy_from_slice(&self.fit.refined.parameters);
        let (from, step) = (parameters[*index], SLOPED * added.scale);
        parameters[*index] += step;
        let moved = self.filtered_by(&filter, &parameters, &self.processes, Pace::Path).map(|moved| moved.whitened());
        let own = found.whitened();
        let Some(moved) = moved.filter(|moved| moved.len() == own.len()) else { return Ok(None) };
        let column: Vec<f64> = moved.iter().zip(&own).map(|(moved, own)| (moved - own) / step).collect();
        let others = self.fit.free.iter().zip(slopes).filter(|(f, _)| f.parameter != *index);
        let (mut free, mut all): (Vec<Free>, Vec<&[f64]>) = others.map(|(f, slope)| (f.clone(), &slope[..])).unzip();
        free.push(Free::new(*index, added.scale));
        all.push(&column);
        let (mut gram, mut right) = products(&free, &parameters, (&own, &all), found.level);
        let last = free.len() - 1;
        let length = gram[(last, last)];
        (0..last).for_each(|i| eliminate(&mut gram, &mut right, i, 0.0));
        let (left, along) = (gram[(last, last)], right[last]);
        // What the others do as well is not seen.
        let is_seen = left > FLAT * length && along.is_finite();
        Ok(is_seen.then(|| Promise { hypothesis, gain: along * along / left, value: from + along / left }))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::fitted;
    use crate::diagnose::run::Run;
    use crate::diagnose::steps::attribution::forcing::tests::logs_of_boat;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::progress::Silent;

    #[test]
    fn a_weak_drive_shows_in_the_innovations_beside_gusts() {
        let named = |gain: f64| {
            let (mut model, data) = logs_of_boat(0.0, |_, gust| 0.6 * gust);
            model.parameters[1].value = 1.5 / gain;
            let (fitter, nominal) = fitted(&model, &data, 0.01);
            let run = Run::new(&Silent, None);
            let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
            let alone = Account::in_part(&contest, &nominal).unwrap().unwrap();
            assert!(alone.is_forced());
            let singles = alone.singles(&contest, &nominal, &[]).unwrap();
            let one = alone.of_one_near(&contest, &singles, f64::NEG_INFINITY).unwrap();
            one.map(|account| account.fit.hypotheses[0].id().to_string())
        };
        // The rudder's gain, or the parameter that it multiplies.
        let weak = named(0.8);
        assert!(weak.as_ref().is_some_and(|id| ["input_gain", "parameter_error"].contains(&id.as_str())), "{weak:?}");
        assert_eq!(named(1.0), None);
    }
}
