//! Minimises the cost from the best of several starts, first on a subset of the points if the likelihood of all is expensive
//! and there are several inputs.
//!
//! The optimum of a subset is near that of all points, with nearly the same curvature per point. So the subset covers most of the
//! way, and all points need only a few steps of nearly Newton's length. If time is the only input nothing is left out: every fourth
//! sample of a fast signal is another signal, while among points spread over two inputs a fourth is half as dense. It does no harm
//! that neighbours in time are separated: differences of neighbouring samples share their noise, and a process over states would take
//! the shared part for structure.

use super::cost::Cost;
use super::settings::FitSettings;
use super::start::starts;
use crate::gp::kernel::Role;
use crate::gp::likelihood::Workspace;
use crate::gp::points::Points;
use crate::optimise::{Minimum, Optimiser};

/// Points over several inputs from which on a part of them is searched first.
const DEAR: usize = 128;
/// Share of the points in that part ...
const PART: f64 = 0.25;
/// ... which is no smaller than this.
const SMALLEST_PART: f64 = 64.0;
/// Starts that are followed to their end.
const FOLLOWED: usize = 2;
/// Two minima nearer to each other than this in every coordinate are one.
const SAME: f64 = 0.3;
/// A minimum of the part whose likelihood of all points is worse than the best by more than this is not followed.
const HOPELESS: f64 = 10.0;
/// Farthest that all points may lead away from the minimum of the part, in any coordinate.
const LONGEST: f64 = 8.0;
/// Noise above which the part is not believed to have found the signal.
const NEARLY_ALL_NOISE: f64 = 0.9;

/// The lowest minimum found; `None` where the cost is undefined at every start.
pub(super) fn search(cost: &Cost, settings: &FitSettings, workspace: &mut Workspace) -> Option<Minimum> {
    if let Some(part) = part(cost) {
        let coarse = Cost::new(cost.kernel, &part, cost.bounds, settings, cost.jitter);
        if let Some(found) = refine(cost, &coarse, workspace) {
            return Some(found);
        }
    }
    let ends = follow(cost, &Optimiser::default(), workspace);
    let evaluations = ends.iter().map(|m| m.evaluations).sum();
    ends.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|m| Minimum { evaluations, ..m })
}

/// The minimum near hyperparameters (log noise last) that are nearly right already.
pub(super) fn polish(cost: &Cost, hyper: &[f64], workspace: &mut Workspace) -> Option<Minimum> {
    let start = cost.compress(hyper);
    let optimiser = Optimiser { tolerance_gradient: 1e-4, ..Optimiser::default() };
    let free = Round { longest: f64::INFINITY, optimiser: &optimiser };
    free.descend(cost, &start, &sharpness(cost, &start), workspace)
}

/// Follows the best starts that are not alike.
fn follow(cost: &Cost, optimiser: &Optimiser, workspace: &mut Workspace) -> Vec<Minimum> {
    let mut ranked: Vec<(f64, Vec<f64>)> = starts(cost.kernel, cost.runs, cost.bounds)
        .into_iter()
        .map(|start| cost.compress(&start))
        .filter_map(|z| cost.evaluate(&z, &mut [], workspace).map(|c| (c, z)))
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<Vec<f64>> = Vec::new();
    for (_, z) in ranked {
        // A start close to one that was taken leads to the same place.
        if chosen.iter().all(|c| c.iter().zip(&z).any(|(a, b)| (a - b).abs() > 1.0)) {
            chosen.push(z);
        }
        if chosen.len() == FOLLOWED {
            break;
        }
    }
    let free = Round { longest: f64::INFINITY, optimiser };
    chosen.iter().filter_map(|z| free.descend(cost, z, &sharpness(cost, z), workspace)).collect()
}

/// How much finer than a factor of e each coordinate is known, as a diagonal factor of the curvature.
///
/// A period that is off by a share of itself is off by that share of every cycle in the log: of all hyperparameters it
/// alone is known to a fraction of a percent, and a descent in plain logarithms would zigzag.
fn sharpness(cost: &Cost, z: &[f64]) -> Vec<Vec<f64>> {
    let mut factor = identity(z.len());
    for (role, &c) in cost.roles.iter().zip(&cost.coordinate) {
        if *role == Role::Period {
            factor[c][c] = (4.0 * cost.bounds.cycles(z[c])).clamp(1.0, 1e3);
        }
    }
    factor
}

fn identity(p: usize) -> Vec<Vec<f64>> {
    (0..p).map(|i| (0..p).map(|j| f64::from(u8::from(i == j))).collect()).collect()
}

/// The search on a part, and from its minima on all points; `None` where the part carries no information.
fn refine(cost: &Cost, coarse: &Cost, workspace: &mut Workspace) -> Option<Minimum> {
    let mut small = Workspace::default();
    let loose = Optimiser { tolerance_gradient: 1e-4, tolerance_cost: 1e-6, ..Optimiser::default() };
    let mut ends = follow(coarse, &loose, &mut small);
    ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    ends.dedup_by(|b, a| a.point.iter().zip(&b.point).all(|(a, b)| (a - b).abs() < SAME));
    let stated = |m: &Minimum| {
        let noise = coarse.expand(&m.point).last().map_or(0.0, |n| n.exp());
        !coarse.at_bound(&m.point) && noise < NEARLY_ALL_NOISE
    };
    if !ends.first().is_some_and(stated) {
        return None;
    }
    let mut from: Vec<(f64, Vec<f64>)> =
        ends.into_iter().filter_map(|m| cost.evaluate(&m.point, &mut [], workspace).map(|c| (c, m.point))).collect();
    from.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = from.first()?.0;
    // Half the squared gradient is what a step of Newton's would still gain by the point.
    let optimiser = Optimiser { tolerance_gradient: 1e-4, longest_move: f64::MAX, ..Optimiser::default() };
    let near = Round { longest: LONGEST, optimiser: &optimiser };
    let mut evaluations = 0;
    let mut lowest: Option<Minimum> = None;
    for (_, point) in from.iter().filter(|(c, _)| (c - best) * cost.n_points < HOPELESS) {
        let curvature = curvature(coarse, point, &mut small);
        let Some(end) = near.descend(cost, point, &curvature, workspace) else { continue };
        evaluations += end.evaluations;
        if lowest.as_ref().is_none_or(|l| end.cost < l.cost) {
            lowest = Some(end);
        }
    }
    lowest.map(|m| Minimum { evaluations, ..m })
}

/// A part of the points that represents all, where the inputs are several and the points many.
fn part(cost: &Cost) -> Option<Vec<Points>> {
    if cost.runs.iter().all(|run| run.dimension() < 2 || run.len() < DEAR) {
        return None;
    }
    let total = cost.n_points;
    let share = (PART * total).max(SMALLEST_PART) / total;
    Some(cost.runs.iter().map(|run| spread(run, share)).collect())
}

/// About `share` of the points, evenly by their places.
fn spread(run: &Points, share: f64) -> Points {
    let n = run.len();
    let kept = ((share * n as f64).ceil() as usize).clamp(1.min(n), n);
    let rows: Vec<usize> = (0..kept).map(|k| (2 * k + 1) * n / (2 * kept)).collect();
    let pick = |column: &Vec<f64>| rows.iter().filter_map(|&i| column.get(i).copied()).collect::<Vec<f64>>();
    Points {
        inputs: run.inputs.iter().map(pick).collect(),
        targets: pick(&run.targets),
        noise_weights: pick(&run.noise_weights),
    }
}

/// Lower Cholesky factor of the Hessian by differences of the gradient, made safely positive.
fn curvature(cost: &Cost, at: &[f64], workspace: &mut Workspace) -> Vec<Vec<f64>> {
    let p = at.len();
    let mut base = vec![0.0; p];
    if cost.evaluate(at, &mut base, workspace).is_none() {
        return identity(p);
    }
    let mut hessian = vec![vec![0.0; p]; p];
    for i in 0..p {
        let (mut z, mut gradient) = (at.to_vec(), vec![0.0; p]);
        z[i] += DIFFERENCE;
        if cost.evaluate(&z, &mut gradient, workspace).is_none() {
            return identity(p);
        }
        for j in 0..p {
            let slope = (gradient[j] - base[j]) / DIFFERENCE;
            hessian[i][j] += 0.5 * slope;
            hessian[j][i] += 0.5 * slope;
        }
    }
    // The priors alone bend the cost by this much or more.
    let least = 0.1 / cost.n_points;
    for shift in [0.0, 0.01, 0.1, 1.0, 10.0] {
        let mut shifted = hessian.clone();
        (0..p).for_each(|i| shifted[i][i] += shift);
        if let Some(lower) = cholesky(shifted, least) {
            return lower;
        }
    }
    identity(p)
}

/// Step of the differences of the gradient.
const DIFFERENCE: f64 = 1e-3;

/// Lower factor in place; `None` where a pivot is below `least`.
fn cholesky(mut a: Vec<Vec<f64>>, least: f64) -> Option<Vec<Vec<f64>>> {
    let p = a.len();
    for j in 0..p {
        let pivot = a[j][j] - (0..j).map(|k| a[j][k] * a[j][k]).sum::<f64>();
        // Negated, so that what is not a number fails, too.
        if !(pivot >= least) {
            return None;
        }
        a[j][j] = pivot.sqrt();
        for i in j + 1..p {
            let sum = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            a[i][j] = sum / a[j][j];
        }
    }
    Some(a)
}

/// A descent in coordinates w, `z = origin + L'^-1 w`, in which the cost is nearly round.
struct Round<'a> {
    /// Farthest from the origin in any coordinate of z.
    longest: f64,
    optimiser: &'a Optimiser,
}

impl Round<'_> {
    fn descend(&self, cost: &Cost, origin: &[f64], lower: &[Vec<f64>], workspace: &mut Workspace) -> Option<Minimum> {
        let p = origin.len();
        let step = |w: &[f64]| {
            let mut d = w.to_vec();
            for i in (0..p).rev() {
                d[i] = (d[i] - (i + 1..p).map(|k| lower[k][i] * d[k]).sum::<f64>()) / lower[i][i];
            }
            d
        };
        let round = |w: &[f64], gradient: &mut [f64]| {
            let step = step(w);
            if !step.iter().all(|d| d.abs() <= self.longest) {
                return None;
            }
            let z: Vec<f64> = origin.iter().zip(&step).map(|(o, d)| o + d).collect();
            let value = cost.evaluate(&z, gradient, workspace)?;
            for i in 0..gradient.len() {
                gradient[i] = (gradient[i] - (0..i).map(|k| lower[i][k] * gradient[k]).sum::<f64>()) / lower[i][i];
            }
            Some(value)
        };
        let end = self.optimiser.minimise(&vec![0.0; p], round)?;
        let point = origin.iter().zip(step(&end.point)).map(|(o, d)| o + d).collect();
        Some(Minimum { point, ..end })
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::{Scale, standardise};
    use super::super::start::Bounds;
    use super::*;
    use crate::gp::kernel::Kernel;
    use crate::gp::likelihood::Evaluation;
    use crate::random::{normal, uniform};
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    #[test]
    fn two_hundred_random_starts_reach_the_best_likelihood() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let time: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
        let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.5 * (2.3 * t).cos() + 0.15 * normal(&mut rng)).collect();
        let settings = FitSettings::default();
        let runs = [Points::in_time(&time, &values)];
        let scale = Scale::of(&runs, &settings).unwrap();
        let runs = standardise(&runs, &scale).unwrap();
        let bounds = Bounds::of(&runs, &scale, &settings);
        let cost = Cost::new(&Kernel::SquaredExponential, &runs, &bounds, &settings, 0.0);
        let mut workspace = Workspace::default();
        let ends: Vec<Minimum> = (0..200)
            .map(|_| {
                // Amplitude and noise within a factor of e^3 of one, lengths from one spacing to twice the span:
                // below one spacing all points are independent and no gradient leads out.
                let start =
                    [6.0 * uniform(&mut rng) - 3.0, 5.3 * uniform(&mut rng) - 2.3, 6.0 * uniform(&mut rng) - 3.0];
                Optimiser::default().minimise(&start, |z, gradient| cost.evaluate(z, gradient, &mut workspace)).unwrap()
            })
            .collect();
        let best = ends.iter().map(|m| m.cost).fold(f64::INFINITY, f64::min);
        let elsewhere: Vec<&Minimum> = ends.iter().filter(|m| m.cost > best + 1e-6).collect();
        assert!(elsewhere.len() <= 1, "{} of 200 stopped elsewhere: {elsewhere:?}", elsewhere.len());
        let evaluations: usize = ends.iter().map(|m| m.evaluations).sum();
        assert!(evaluations < 200 * 60, "{evaluations} evaluations");
    }

    /// Where a bare likelihood (no priors, no floor) ends from random starts; a length without end is an optimum of its
    /// own there, into which one start in thirty falls.
    fn bare_ends(seed: u64, leave_plateaus: bool) -> Vec<Minimum> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let time: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
        let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.5 * (2.3 * t).cos() + 0.15 * normal(&mut rng)).collect();
        let (run, mut workspace) = (Points::in_time(&time, &values), Workspace::default());
        let mut bare = |z: &[f64], gradient: &mut [f64]| {
            let evaluation = Evaluation { kernel: &Kernel::SquaredExponential, hyper: z, jitter: 0.0 };
            let inside = z.iter().all(|v| v.abs() < 200.0);
            let nll = if inside { evaluation.likelihood(&run, gradient, &mut workspace)? } else { return None };
            gradient.iter_mut().for_each(|g| *g /= 100.0);
            Some(nll / 100.0)
        };
        let optimiser = Optimiser { leave_plateaus, ..Optimiser::default() };
        (0..200)
            .map(|_| {
                let start =
                    [6.0 * uniform(&mut rng) - 3.0, 5.3 * uniform(&mut rng) - 2.3, 6.0 * uniform(&mut rng) - 3.0];
                optimiser.minimise(&start, &mut bare).unwrap()
            })
            .collect()
    }

    #[test]
    fn two_hundred_random_starts_reach_the_best_bare_likelihood_where_plateaus_are_left() {
        for seed in [7, 8, 9] {
            let ends = bare_ends(seed, true);
            let best = ends.iter().map(|m| m.cost).fold(f64::INFINITY, f64::min);
            let elsewhere = ends.iter().filter(|m| m.cost > best + 1e-6).count();
            assert!(elsewhere <= 1, "seed {seed}: {elsewhere} of 200 stopped elsewhere");
            // Without that look there are such ends, or the test could not fail.
            assert!(bare_ends(seed, false).iter().filter(|m| m.cost > best + 1e-6).count() >= 2);
        }
    }

    #[test]
    fn a_long_log_of_a_fast_signal_is_not_taken_for_noise() {
        // Correlated over ten samples of a hundred thousand: far below a hundredth of the span.
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let time: Vec<f64> = (0..100_000).map(|i| 0.1 * f64::from(i)).collect();
        let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.5 * (2.3 * t).cos() + 0.01 * normal(&mut rng)).collect();
        for kernel in [Kernel::Matern32, Kernel::Matern52] {
            let found = super::super::fit(
                std::slice::from_ref(&kernel),
                &[Points::in_time(&time, &values)],
                &FitSettings::default(),
            );
            let found = found.unwrap();
            // A rougher process than the signal takes some of its bends for noise, and none of the noise for signal.
            assert!((0.005..0.02).contains(&found.noise), "{kernel}: {}", found.noise);
        }
    }

    #[test]
    fn a_part_of_the_points_leads_to_the_minimum_of_all() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let places: Vec<Vec<f64>> = (0..2).map(|_| (0..200).map(|_| 4.0 * uniform(&mut rng)).collect()).collect();
        let value = |i: usize| (1.5 * places[0][i]).sin() * places[1][i];
        let targets = (0..200).map(|i| value(i) + 0.1 * normal(&mut rng)).collect();
        let settings = FitSettings::default();
        let runs = [Points { inputs: places.clone(), targets, noise_weights: vec![] }];
        let scale = Scale::of(&runs, &settings).unwrap();
        let runs = standardise(&runs, &scale).unwrap();
        let bounds = Bounds::of(&runs, &scale, &settings);
        for kernel in [Kernel::SquaredExponential, Kernel::Matern32, Kernel::RationalQuadratic] {
            let cost = Cost::new(&kernel, &runs, &bounds, &settings, 0.0);
            let found = search(&cost, &settings, &mut Workspace::default()).unwrap();
            let whole = follow(&cost, &Optimiser::default(), &mut Workspace::default());
            let best = whole.iter().map(|m| m.cost).fold(f64::INFINITY, f64::min);
            // The tolerance of the descents is 1e-8 by the point; flat valleys leave some more.
            assert!((found.cost - best).abs() < 1e-6, "{kernel}: {} {best}", found.cost);
            assert!(2 * found.evaluations < whole.iter().map(|m| m.evaluations).sum(), "{kernel}");
        }
    }
}
