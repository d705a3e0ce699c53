//! Typicality: whether logs simulated with the named causes would leave a rest like the one that these logs leave.
//!
//! The corrected model and its noise make new residuals; everything that is free is fitted to them along straight lines, and the same
//! functions without a name are screened in them as in the real ones. The rank of what the logs leave among what the simulations leave
//! needs no theory of the screening; where none of them leaves as much, how far above them it lies gives the chance.
//! Source: the Monte Carlo test, Barnard 1963; Besag and Clifford 1989, Biometrika 76(4); the largest of many by Gumbel 1958,
//! Statistics of Extremes, chapter 5.

use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::colours::colour::Colour;
use crate::diagnose::fit::colours::noise::Noise;
use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::linear::basis::{Basis, Out};
use crate::diagnose::fit::linear::gains::{Gain, gains_of_family};
use crate::diagnose::limits::SKETCHED;
use crate::diagnose::limits::weigh::{MOST_SIMULATED, SIMULATED, TYPICAL_REST, UNDECIDED};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::Result;
use crate::parallel;
use crate::random::normal;
use crate::refine::{Block, Window};
use nalgebra::DVector;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// The constant of Euler and Mascheroni: the mean of the standard distribution of largest values. Exact.
const EULER: f64 = 0.577_215_664_901_532_9;

/// What the simulations say.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Typicality {
    /// Chance that a log of these causes leaves at least as much as the one seen.
    pub(crate) p_value: f64,
    /// How many were simulated.
    pub(crate) drawn: usize,
}

/// Of a winner; none where time is up before it is known.
pub(crate) fn of(contest: &Contest<'_>, best: &Contestant) -> Result<Option<Typicality>> {
    contest.run.begin("simulated logs");
    if contest.run.is_out_of_time() {
        return Ok(None);
    }
    let whole = best.linearised()?.with_steps();
    let sketch = whole.sketch(SKETCHED);
    let at = sketch.as_ref().map_or(whole, |sketch| sketch.linearised());
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let allowed = (TYPICAL_REST + best.evidence.model_error) * at.contestant.experiment.n_values() as f64;
    let (mut seen, mut simulated) = (0.0, Vec::new());
    while simulated.len() < SIMULATED || (simulated.len() < MOST_SIMULATED && is_undecided(seen, &simulated)) {
        let Some((own, more)) = left(contest, &at, &mut random) else { return Ok(None) };
        seen = own - allowed;
        simulated.extend(more);
    }
    Ok(Some(Typicality { p_value: chance(seen, &simulated), drawn: simulated.len() }))
}

/// The most that a function without a name explains of what the logs leave, and of so many simulated logs; none where time is up.
fn left(contest: &Contest<'_>, at: &Linearised<'_>, random: &mut ChaCha8Rng) -> Option<(f64, Vec<f64>)> {
    let simulated: Vec<Out> = (0..SIMULATED).map(|_| drawn(at, random)).collect();
    let basis = Basis::new(at, Noise::Coloured, &simulated);
    let largest = |rival: &Rival| {
        if contest.run.is_out_of_time() {
            return Vec::new();
        }
        // By Akaike's criterion, so that large families do not win by their number.
        let left = |gain: Gain| gain.gain - 2.0 * gain.degrees as f64;
        gains_of_family(rival, &contest.scene, at, &basis).into_iter().map(left).collect()
    };
    let all: Vec<Vec<f64>> = parallel::map(&contest.rivals, largest);
    if contest.run.is_out_of_time() {
        return None;
    }
    let most = |view: usize| all.iter().filter_map(|left| left.get(view)).copied().fold(f64::NEG_INFINITY, f64::max);
    Some((most(0), (1..=SIMULATED).map(most).collect()))
}

/// Whether more simulations may decide what is typical: none left as much as the logs, and the tail beyond them is not yet known.
fn is_undecided(seen: f64, simulated: &[f64]) -> bool {
    simulated.iter().all(|&one| one < seen) && chance(seen, simulated) >= UNDECIDED
}

/// Chance of one at least as large as `seen`: its rank, and beyond all that were simulated the tail of the distribution of largest
/// values with their mean and deviation.
fn chance(seen: f64, simulated: &[f64]) -> f64 {
    let count = simulated.len() as f64;
    let above = simulated.iter().filter(|&&one| one >= seen).count() as f64;
    let rank = (1.0 + above) / (1.0 + count);
    if above > 0.0 {
        return rank;
    }
    let mean = simulated.iter().sum::<f64>() / count;
    let spread = (simulated.iter().map(|one| (one - mean) * (one - mean)).sum::<f64>() / (count - 1.0)).sqrt();
    let scale = spread * 6f64.sqrt() / std::f64::consts::PI;
    let place = mean - EULER * scale;
    // 1 - exp(-e), exact where e is small.
    let tail = -(-(-(seen - place) / scale).exp()).exp_m1();
    if tail.is_finite() { tail.min(rank) } else { rank }
}

/// A fit whose residuals are drawn: as a view, what is to be taken from those that were seen.
fn drawn(at: &Linearised<'_>, random: &mut ChaCha8Rng) -> Out {
    let (colours, experiment) = (&at.contestant.evidence.colours, &at.contestant.experiment);
    let one = |(window, block): (&Window, &Block)| {
        let repeats = experiment.repeats(window);
        let mut residual = DVector::zeros(block.residual.len());
        for (c, colour) in colours.iter().enumerate() {
            let mut series = noise(colour, random);
            let mut last = 0.0;
            let samples = residual.as_mut_slice().chunks_exact_mut(colours.len());
            samples.enumerate().for_each(|(i, sample)| {
                // A repeat has the noise of the reading that it repeats.
                if !repeats.get(i * colours.len() + c).is_some_and(|&repeats| repeats) {
                    last = series();
                }
                sample[c] = last;
            });
        }
        residual.iter_mut().zip(&block.present).filter(|(_, there)| !**there).for_each(|(value, _)| *value = 0.0);
        &block.residual - residual
    };
    Out {
        places: Vec::new(),
        free: Vec::new(),
        change: experiment.windows.iter().zip(&at.jacobian.blocks).map(one).collect(),
    }
}

/// Noise of a column, value by value: of its colour where it is of a sensor's size, else only what of it is new in each sample.
fn noise<'r>(colour: &Colour, random: &'r mut ChaCha8Rng) -> impl FnMut() -> f64 + 'r {
    let is_noise = colour.is_of_a_sensor();
    let coefficients = if is_noise { colour.coefficients.clone() } else { Vec::new() };
    let spread = colour.innovation.sqrt();
    let mut last = vec![0.0; coefficients.len()];
    let mut next = move || {
        let predicted: f64 = coefficients.iter().zip(&last).map(|(a, v)| a * v).sum();
        let value = predicted + spread * normal(random);
        if !last.is_empty() {
            last.rotate_right(1);
            last[0] = value;
        }
        value
    };
    // The series has forgotten its start by then.
    (0..50).for_each(|_| _ = next());
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_logs_are_simulated_where_few_do_not_decide() {
        let simulated: Vec<f64> = (1..=30).map(|i| -(-(f64::from(i) / 31.0).ln()).ln()).collect();
        // Within what was simulated, near the level, and far beyond.
        assert!(!is_undecided(3.0, &simulated));
        assert!(is_undecided(5.0, &simulated), "{}", chance(5.0, &simulated));
        assert!(!is_undecided(12.0, &simulated), "{}", chance(12.0, &simulated));
    }

    #[test]
    fn the_chance_of_a_largest_value_is_its_rank_and_beyond_all_the_tail_of_such_values() {
        // The standard distribution of largest values, by its quantiles.
        let simulated: Vec<f64> = (1..=300).map(|i| -(-(f64::from(i) / 301.0).ln()).ln()).collect();
        assert!((chance(0.0, &simulated[..]) - 0.632).abs() < 0.01);
        let tail = |x: f64| -(-(-x).exp()).exp_m1();
        for seen in [7.0, 9.0] {
            let found = chance(seen, &simulated) / tail(seen);
            assert!((0.7..1.5).contains(&found), "{found}");
        }
    }
}
