//! Nearer: shorter rollouts, where ripples along a place show in them alone.
//!
//! A force that repeats along the place is out of step once a rollout is a fraction of a ripple off, and no straight line from there says which
//! ripples they are. So where nothing accounts for the logs they are looked for in rollouts so short that the nominal model has not left these.

use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::colours::noise::{ByNoise, Noise};
use crate::diagnose::fit::contestant::{Contestant, Entrant, Linearised, Searches};
use crate::diagnose::fit::linear::basis::Basis;
use crate::diagnose::fit::linear::gains::{Gain, gains};
use crate::diagnose::limits::{BETWEEN, Budget, FAR, SUBSTITUTE};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::round::Expansion;
use crate::diagnose::steps::logs::windows::halved;
use crate::error::{Result, unless_refused};

/// The nominal model on shorter rollouts in which ripples along a place leave only noise, where nothing does in its own; none where there are none.
pub(crate) fn nearer(contest: &Contest<'_>, nominal: &Contestant, first: &Expansion) -> Result<Option<Contestant>> {
    let is_open = first.fits.first().is_none_or(|leader| leader.evidence.leaves_a_rest());
    if !is_open || nominal.system.engine().is_some() || ripples(contest).next().is_none() {
        return Ok(None);
    }
    let mut near = nominal.clone();
    while near.evidence.misfit() > FAR {
        let Some(shorter) = halved(&near.experiment).filter(|_| !contest.run.is_out_of_time()) else { break };
        let Some(next) = unless_refused(contest.fitter.on(&near, &shorter, Budget::Usual))? else { break };
        near = next;
    }
    if near.experiment.windows.len() == nominal.experiment.windows.len() {
        return Ok(None);
    }
    Ok(explain(contest, &near)?.then_some(near))
}

/// Whether ripples along one of the places leave only noise beside `near`.
fn explain(contest: &Contest<'_>, near: &Contestant) -> Result<bool> {
    let scene = contest.scene_of(near);
    let at = near.linearised()?;
    let basis = Basis::new(&at, Noise::White, &[]);
    for hypothesis in ripples(contest) {
        let Ok(applied) = hypothesis.apply(near.system.model(), &scene) else { continue };
        let Some(values) = line(near, &applied, &at, &basis) else { continue };
        // The grid of frequencies is too coarse for a straight line to leave nothing.
        let entrant = Entrant::new(hypothesis, Searches::NONE);
        let fit = unless_refused(contest.fitter.with(near, &[entrant], &applied, &values, Budget::Usual))?;
        if fit.is_some_and(|fit| !fit.evidence.leaves_a_rest()) {
            return Ok(true);
        }
    }
    Ok(false)
}

fn ripples<'c>(contest: &'c Contest<'_>) -> impl Iterator<Item = &'c Hypothesis> {
    contest.hypotheses.iter().filter(|h| h.is(Effect::Cogging))
}

/// Values to start from at the frequency that gains most by a straight line; none where that is less than a straight line leaves of the truth.
///
/// Frequencies are tried between the neighbours of the best one, too: half a step off the ripples are out of step at the ends of a travel.
fn line(near: &Contestant, applied: &Applied, at: &Linearised<'_>, basis: &Basis) -> Option<Vec<Vec<f64>>> {
    let best = |applied: &Applied| {
        let gains = gains(applied, at, &[basis]);
        let of = |(place, gains): (usize, &ByNoise<Vec<Gain>>)| Some((place, gains.of(Noise::White)?.first()?.clone()));
        gains.iter().enumerate().filter_map(of).max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))
    };
    let (place, _) = best(applied)?;
    let starts = &applied.starts;
    let between = |other: usize| {
        let towards = move |share: f64| starts[place].towards(starts.get(other).unwrap_or(&starts[place]), share);
        (0..BETWEEN).map(move |k| towards(k as f64 / BETWEEN as f64))
    };
    let finer: Vec<Start> = between(place.saturating_sub(1)).chain(between(place + 1)).collect();
    let finer = Applied { starts: finer, ..applied.clone() };
    let (place, gain) = best(&finer)?;
    let is_enough = gain.gain > (1.0 - SUBSTITUTE) * near.evidence.squares();
    is_enough.then(|| finer.starts[place].shortened(&gain.values))
}

impl Start {
    /// The start a share of the way to another one of the same effect.
    fn towards(&self, other: &Self, share: f64) -> Self {
        let between = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
        Self { columns: self.columns.iter().zip(&other.columns).map(|(a, b)| between(a, b)).collect(), ..self.clone() }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::slider_model;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A table that a loop holds on its place, with twelve ripples to a radian; its command is that of the loop.
    fn table(seed: u64) -> Run {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (step, fine, count) = (0.005, 10, 1000);
        let (mut x, mut v, mut rows) = (0.0_f64, 0.0_f64, Vec::new());
        for i in 0..count {
            let time = step * f64::from(i);
            let wanted = (1.7 * time + seed as f64).sin() + 0.5 * (3.1 * time).cos();
            let command = 40.0 * (wanted - x) - 8.0 * v;
            rows.push([x + 2e-3 * normal(&mut random), v + 2e-2 * normal(&mut random), command]);
            for _ in 0..fine {
                let h = step / f64::from(fine);
                let rate = |x: f64, v: f64| command - 1.4 * v + 3.0 * (12.0 * x + 0.8).sin();
                let (mx, mv) = (x + 0.5 * h * v, v + 0.5 * h * rate(x, v));
                (x, v) = (x + h * mv, v + h * rate(mx, mv));
            }
        }
        Run {
            name: format!("{seed}"),
            time: (0..count).map(|i| step * f64::from(i)).collect(),
            values: Mat::from_fn(rows.len(), 3, |i, c| rows[i][c]),
        }
    }

    #[test]
    fn ripples_under_a_loop_are_found_where_rollouts_of_the_nominal_model_are_out_of_step() {
        let data = Dataset::new(["x", "v", "u"].map(Channel::new).into(), (0..4).map(table).collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&slider_model("u - 1.4*v"), &train, &holdout, &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["cogging"], "{:?}", found.verdict);
        let value = |name: &str| found.causes[0].parameters.iter().find(|p| p.name == name).unwrap().value;
        assert!((value("n") - 12.0).abs() < 0.05 && (value("c") - 3.0).abs() < 0.1, "{:?}", found.causes[0]);
    }
}
