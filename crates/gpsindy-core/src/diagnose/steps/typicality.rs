//! Typicality: whether logs simulated with the named causes would leave a rest like the one that these logs leave.
//!
//! The corrected model and its noise make new residuals; everything that is free is fitted to them along straight lines, and the same
//! functions without a name are screened in them as in the real ones. The rank of what the logs leave among what the simulations leave
//! needs no theory of the screening. Source: the Monte Carlo test, Barnard 1963; Besag and Clifford 1989, Biometrika 76(4).

use crate::diagnose::fit::basis::{Basis, Out};
use crate::diagnose::fit::colour::Colour;
use crate::diagnose::fit::contestant::{Contestant, Linearised};
use crate::diagnose::fit::gains::gains;
use crate::diagnose::limits::weigh::SIMULATED;
use crate::diagnose::limits::{NOISE, SKETCHED};
use crate::diagnose::steps::contest::Contest;
use crate::error::Result;
use crate::parallel::*;
use nalgebra::DVector;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// What the simulations say.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Typicality {
    /// Share of all logs, simulated or seen, that leave at least as much as the one seen.
    pub(crate) p_value: f64,
    /// How many were simulated.
    pub(crate) drawn: usize,
}

/// Of a winner; none where it is linear in nothing: a model that diverges where it stands.
pub(crate) fn of(contest: &Contest<'_>, best: &Contestant) -> Result<Typicality> {
    contest.run.begin("simulated logs");
    let whole = best.linearised()?;
    let sketch = whole.sketch(SKETCHED);
    let at = sketch.as_ref().map_or(whole, |sketch| sketch.linearised());
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let simulated: Vec<Out> = (0..SIMULATED).map(|_| drawn(&at, &mut random)).collect();
    let basis = Basis::new(&at, false, &simulated);
    let largest = |rival: &crate::diagnose::catalogue::rival::Rival| {
        let applied = rival.apply(at.contestant.system.model(), &contest.scene);
        let found = gains(&applied, &at, &[&basis]).into_iter().next().and_then(|start| start.into_iter().next());
        // By Akaike's criterion, so that large families do not win by their number.
        let left = |gain: crate::diagnose::fit::gains::Gain| gain.gain - 2.0 * gain.degrees as f64;
        found.map_or_else(Vec::new, |views| views.into_iter().map(left).collect::<Vec<f64>>())
    };
    let all: Vec<Vec<f64>> = contest.rivals.par_iter().map(largest).collect();
    let most = |view: usize| all.iter().filter_map(|left| left.get(view)).copied().fold(f64::NEG_INFINITY, f64::max);
    let seen = most(0);
    let above = (1..=SIMULATED).filter(|&view| most(view) >= seen).count();
    Ok(Typicality { p_value: (1 + above) as f64 / (1 + SIMULATED) as f64, drawn: SIMULATED })
}

/// A fit whose residuals are drawn: as a view, what is to be taken from those that were seen.
fn drawn(at: &Linearised<'_>, random: &mut ChaCha8Rng) -> Out {
    let colours = &at.contestant.evidence.colours;
    let one = |block: &crate::refine::Block| {
        let mut residual = DVector::zeros(block.residual.len());
        for (c, colour) in colours.iter().enumerate() {
            let mut series = noise(colour, random);
            residual.iter_mut().skip(c).step_by(colours.len()).for_each(|value| *value = series());
        }
        residual.iter_mut().zip(&block.present).filter(|(_, there)| !**there).for_each(|(value, _)| *value = 0.0);
        &block.residual - residual
    };
    Out { places: Vec::new(), free: Vec::new(), change: at.jacobian.blocks.iter().map(one).collect() }
}

/// Noise of a column, value by value: of its colour where it is of a sensor's size, else only what of it is new in each sample.
fn noise<'r>(colour: &Colour, random: &'r mut ChaCha8Rng) -> impl FnMut() -> f64 + 'r {
    let is_noise = colour.variance() <= NOISE;
    let coefficients = if is_noise { colour.coefficients.clone() } else { Vec::new() };
    let spread = colour.innovation.sqrt();
    let mut last = vec![0.0; coefficients.len()];
    let mut next = move || {
        let predicted: f64 = coefficients.iter().zip(&last).map(|(a, v)| a * v).sum();
        let value = predicted + spread * standard(random);
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

fn standard(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}
