//! Search: from one set of effects to a better one, a move at a time, on rollouts that grow as the model gets better.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, CONVINCING, MENDED, MOST_MOVES, NAMED, NO_REST, PILED, SWAP};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::lengthen::lengthen;
use crate::diagnose::steps::attribution::moves::scatter::with_scattered;
use crate::diagnose::steps::attribution::round::{Expansion, expand, expand_behind};
use crate::diagnose::steps::attribution::simplify::is_superfluous;
use crate::diagnose::steps::findings::counts;
use crate::diagnose::steps::logs::prepare::quieter;
use crate::error::{Result, unless_refused};
use crate::refine::Experiment;

/// What a search ends with.
pub(crate) struct Found {
    /// The nominal model on the rollouts that the search ended on.
    pub(crate) nominal: Contestant,
    /// The set of effects from which no move leads to a better one.
    pub(crate) best: Contestant,
    /// The round that found none.
    pub(crate) round: Expansion,
    /// The rounds before it on the same rollouts.
    pub(crate) rounds: Rounds,
    /// Whether the rollouts are longer than those of the first round.
    pub(crate) is_lengthened: bool,
    /// Whether a column has less noise than in the first round.
    pub(crate) is_quieter: bool,
}

/// Rounds on the same rollouts, each with the set of effects that it was made at.
#[derive(Default)]
pub(crate) struct Rounds(Vec<(Contestant, Expansion)>);

impl Rounds {
    /// The round at the effects of `best`, where there was one at a fit as good as it.
    pub(crate) fn at(&self, contest: &Contest<'_>, best: &Contestant) -> Option<&Expansion> {
        let is_it = |known: &Contestant| known.has_effects_of(best) && contest.lead(best, known).abs() < SWAP;
        self.0.iter().rfind(|(known, _)| is_it(known)).map(|(_, round)| round)
    }
}

/// Moves from the nominal model to better sets of effects until none is left; `first` is the round at the nominal model.
pub(crate) fn search(contest: &mut Contest<'_>, nominal: Contestant, first: Expansion) -> Result<Found> {
    let (mut nominal, mut best, mut round) = (nominal.clone(), nominal, first);
    let (mut is_lengthened, mut is_quieter) = (false, false);
    round.fits = with_scattered(contest, &nominal, round.fits)?;
    let (mut looked_at, mut rounds) = (nominal.evidence.misfit(), Rounds::default());
    for number in 1..=MOST_MOVES {
        let Some(next) = next(contest, &nominal, &best, &round)? else {
            let Some(more) = expand_behind(contest, &nominal, &best, &round)? else { break };
            round = more;
            continue;
        };
        let is_richer = next.hypotheses.len() > best.hypotheses.len();
        // A round that was cut short has fitted neither its leaders nor what they stand beside to the end.
        if is_richer && !best.hypotheses.is_empty() && contest.run.is_out_of_time() {
            round.fits.clear();
            break;
        }
        if is_exchange(contest, &best, &next) {
            round.fits.push(std::mem::replace(&mut best, next));
            break;
        }
        rounds.0.push((std::mem::replace(&mut best, next), round.clone()));
        if let Some(quieter) = with_less_noise(contest, &nominal, &best)? {
            (nominal, best) = quieter;
            looked_at = nominal.evidence.misfit();
            rounds = Rounds::default();
            is_quieter = true;
        }
        if contest.run.is_out_of_time() || best.evidence.misfit() < NO_REST {
            round.fits.clear();
            break;
        }
        // What is left of a gap that is mended for the most part shows better in longer rollouts.
        if best.evidence.misfit() < MENDED * looked_at {
            if let Some(longer) = lengthen(contest, &nominal, &best, PILED)? {
                (nominal, best) = longer;
                rounds = Rounds::default();
                is_lengthened = true;
            }
            looked_at = best.evidence.misfit();
        }
        round = expand(contest, &nominal, &best, &format!("move {number}"))?;
    }
    Ok(Found { nominal, best, round, rounds, is_lengthened, is_quieter })
}

/// Both on the noise that the better one leaves, where it was overstated: beside a gap the nominal model did not undercut it. Windows that a
/// fit has not passed through, and effects in the columns that this noise is of, show by it. `None` where it was overstated nowhere.
fn with_less_noise(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
) -> Result<Option<(Contestant, Contestant)>> {
    let Some(noise) = quieter(best).filter(|_| !contest.run.is_out_of_time()) else { return Ok(None) };
    let experiment = Experiment { noise, ..best.experiment.clone() };
    let on = |one: &Contestant| unless_refused(contest.fitter.on(one, &experiment, Budget::Usual));
    Ok(on(nominal)?.zip(on(best)?))
}

/// The best move, unless what it adds would be left out again at the end, for which there may be no time.
fn next(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    round: &Expansion,
) -> Result<Option<Contestant>> {
    let Some(next) = better(contest, best, &round.fits) else { return Ok(None) };
    let is_richer = next.hypotheses.len() > best.hypotheses.len();
    let leaves_a_rest = || next.evidence.leaves_a_rest() && !counts(nominal, next, best, NAMED);
    let is_left_out = is_richer && (leaves_a_rest() || is_superfluous(contest, nominal, next, best)?);
    Ok((!is_left_out).then(|| next.clone()))
}

/// The best move: one more effect that convinces or another one that explains more, else one in the place of two that convince no more.
pub(crate) fn better<'f>(contest: &Contest<'_>, best: &Contestant, fits: &'f [Contestant]) -> Option<&'f Contestant> {
    let own = best.hypotheses.len();
    let is_other = |fit: &&Contestant| fit.hypotheses.len() == own && contest.lead(fit, best) > SWAP;
    let other = contest.best(fits.iter().filter(is_other));
    let is_simpler = |fit: &&Contestant| fit.hypotheses.len() < own && !contest.is_convincing(best, fit);
    let richer = richer(contest, other.unwrap_or(best), fits.iter());
    richer.or(other).or_else(|| contest.best(fits.iter().filter(is_simpler)))
}

/// Whether `next` is only another name for one of several effects: what is one move away from the one set is one move away from the other.
pub(crate) fn is_exchange(contest: &Contest<'_>, best: &Contestant, next: &Contestant) -> bool {
    let own = best.hypotheses.len();
    own > 1 && next.hypotheses.len() == own && contest.lead(next, best) <= CONVINCING
}

/// The best of the fits with more effects that convince beside `leader`, the best with as many as there are: two in the place of a
/// wrong one must say more than the right one does.
pub(crate) fn richer<'f>(
    contest: &Contest<'_>,
    leader: &Contestant,
    fits: impl Iterator<Item = &'f Contestant>,
) -> Option<&'f Contestant> {
    let own = leader.hypotheses.len();
    let is_richer = |fit: &&Contestant| fit.hypotheses.len() > own && contest.is_convincing(fit, leader);
    contest.best(fits.filter(is_richer))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::Diagnose;
    use crate::diagnose::fixture::{drive, fitted, slider_model};
    use crate::diagnose::run::Run as Progress;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A gimbal whose motor follows its command in 20 ms, while the clock of its encoder is slow by half a percent.
    fn gimbal(seed: u64) -> Run {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (step, fine, count) = (0.01, 10, 400);
        let h = step / f64::from(fine);
        let command = |time: f64| {
            let level = if ((time / 0.7 + 0.3 * seed as f64).floor() as i64) % 2 == 0 { 0.04 } else { -0.04 };
            level + 0.03 * (7.0 * time + seed as f64).sin()
        };
        // Place and speed at every fine step, and before the log.
        let (mut torque, mut state, mut path) = (command(0.0), (0.0_f64, 0.0_f64), vec![(0.0, 0.0)]);
        for i in 0..count * fine {
            torque += h / 0.02 * (command(step * f64::from(i / fine)) - torque);
            let speed = state.1 + h * (torque - 0.012 * state.1) / 0.004;
            state = (state.0 + 0.5 * h * (state.1 + speed), speed);
            path.push(state);
        }
        let time: Vec<f64> = (0..count).map(|i| step * f64::from(i)).collect();
        let mut values = Mat::zeros(time.len(), 3);
        for (i, &at) in time.iter().enumerate() {
            let (late, exact) = ((0.995 * at / h).floor() as usize, (at / h).round() as usize);
            values[(i, 0)] = path[late].0 + 0.002 * normal(&mut random);
            values[(i, 1)] = path[exact].1 + 0.02 * normal(&mut random);
            values[(i, 2)] = command(at);
        }
        Run { name: format!("{seed}"), time, values }
    }

    #[test]
    fn noise_that_a_gap_hid_is_lowered_to_what_the_winner_leaves() {
        let found = |noise: f64| {
            let (model, data) = drive(None, |x| x + 0.8 * x * x.abs(), 0.002, (2, 300));
            let (fitter, nominal) = fitted(&model, &data, noise);
            let run = Progress::new(&Silent, None);
            let suspects = suspects(&nominal, &Choice::default()).unwrap().0;
            let mut contest = Contest::new(&run, fitter, suspects, 6);
            let first = expand(&contest, &nominal, &nominal, "suspects").unwrap();
            search(&mut contest, nominal, first).unwrap()
        };
        let right = found(0.002);
        assert!(!right.is_quieter && right.best.experiment.noise == [0.002]);
        let overstated = found(0.02);
        let noise = overstated.best.experiment.noise[0];
        assert!(overstated.is_quieter && (noise / 0.002 - 1.0).abs() < 0.1, "{noise}");
        assert_eq!(overstated.nominal.experiment.noise[0], noise);
        assert_eq!(overstated.best.hypotheses[0].id(), "quadratic_drag");
    }

    #[test]
    fn a_slow_clock_is_asked_behind_the_delay_that_leads_beside_a_lag() {
        let logs = |seeds: std::ops::Range<u64>| {
            Dataset::new(["x", "v", "u"].map(Channel::new).into(), seeds.map(gimbal).collect()).unwrap()
        };
        let model = slider_model("(u - 0.012*v)/0.004");
        let found = Diagnose::default().run(&model, &logs(0..3), &logs(3..4), &Silent).unwrap().diagnosis;
        let mut named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        named.sort_unstable();
        assert_eq!(named, ["clock", "input_lag"], "{:?}", found.causes);
    }
}
