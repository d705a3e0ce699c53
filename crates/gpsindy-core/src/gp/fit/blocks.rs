//! Blocks of neighbouring points that represent long runs whose times are not uniform, where an exact likelihood costs the cube
//! of their number.
//!
//! Kernels have three or four hyperparameters, which a thousand points determine to a few percent. The sum of the exact likelihoods of
//! blocks errs by what the blocks share, that is where a block is not much longer than the process remembers: then every second
//! point makes a block, twice as long and no dearer.
//! Source: Varin, Reid and Firth 2011, An overview of composite likelihood methods, section 2.

use crate::gp::kernel::{Kernel, Role};
use crate::gp::points::Points;

/// Points of a block.
const SIZE: usize = 128;
/// Blocks of all runs together.
const MOST: usize = 8;
/// Cost, in cubes of points, up to which all points are taken together: three times that of the blocks.
const CHEAP: f64 = 3.0 * (MOST * SIZE * SIZE * SIZE) as f64;
/// Lengths of the process that a block must span: the ends, which know one side only, are then the smaller part of it.
const LENGTHS: f64 = 4.0;

/// Whether all points together cost too much for one of the kernels.
pub(super) fn are_needed(kernels: &[Kernel], runs: &[Points]) -> bool {
    let dear = |run: &&Points| run.ordered() && run.uniform_step().is_none();
    let cost: f64 = runs.iter().filter(dear).map(|run| (run.len() as f64).powi(3)).sum();
    cost > CHEAP && runs.iter().all(Points::ordered) && kernels.iter().any(|kernel| !kernel.has_state_space())
}

/// Blocks spread evenly over the runs, of every `stride`-th point each.
pub(super) fn of(runs: &[Points], stride: usize) -> Vec<Points> {
    let mut places: Vec<(usize, usize, usize)> = Vec::new();
    for (number, run) in runs.iter().enumerate().filter(|(_, run)| !run.is_empty()) {
        // Blocks that interlace leave no point out.
        let reach = (SIZE * stride).min(run.len());
        let spans = run.len() / reach;
        for span in 0..spans {
            let first = span * (run.len() - reach) / (spans - 1).max(1);
            places.extend((0..stride.min(reach)).map(|offset| (number, first + offset, first + reach)));
        }
    }
    let count = places.len().min(MOST);
    let chosen = (0..count).map(|k| places[(2 * k + 1) * places.len() / (2 * count)]);
    chosen.map(|(number, first, end)| every(&runs[number], first, end, stride)).collect()
}

fn every(run: &Points, first: usize, end: usize, stride: usize) -> Points {
    let pick =
        |column: &Vec<f64>| (first..end).step_by(stride).filter_map(|i| column.get(i).copied()).collect::<Vec<f64>>();
    Points {
        inputs: run.inputs.iter().map(pick).collect(),
        targets: pick(&run.targets),
        noise_weights: pick(&run.noise_weights),
    }
}

/// Whether a process with these log hyperparameters remembers too much of the longest block, and longer ones can be had.
pub(super) fn are_short(kernel: &Kernel, hyper: &[f64], runs: &[Points], stride: usize) -> bool {
    let lengths =
        kernel.roles(1).into_iter().zip(hyper).filter(|(role, _)| matches!(role, Role::Length(_) | Role::Period));
    let longest = lengths.map(|(_, value)| value.exp()).fold(0.0, f64::max);
    let run = runs.iter().max_by_key(|run| run.len());
    run.is_some_and(|run| {
        let time = &run.inputs[0];
        let span = (time[time.len() - 1] - time[0]) * (SIZE * stride) as f64 / time.len() as f64;
        SIZE * stride < time.len() && span < LENGTHS * longest
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gp::{FitSettings, fit};
    use crate::random::{normal, uniform};
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// Noisy values of two tones, `per_tone` points a second of the faster one, at times off a grid by up to a third of a step.
    fn jittered(n: usize, step: f64, seed: u64) -> Points {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let time: Vec<f64> = (0..n).map(|i| step * (i as f64 + 0.3 * uniform(&mut rng))).collect();
        let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.5 * (2.3 * t).cos() + 0.05 * normal(&mut rng)).collect();
        Points::in_time(&time, &values)
    }

    #[test]
    fn blocks_are_spread_over_all_runs_and_interlace() {
        let runs = [jittered(2000, 0.1, 1), jittered(700, 0.1, 2)];
        let whole = of(&runs, 1);
        assert_eq!(whole.iter().map(Points::len).collect::<Vec<_>>(), [SIZE; MOST]);
        assert!(whole[0].inputs[0][0] < 20.0 && whole[MOST - 3].inputs[0][SIZE - 1] > 150.0);
        let second = of(&runs, 2);
        assert_eq!(second[0].len(), SIZE);
        assert!(second[0].inputs[0][1] - second[0].inputs[0][0] > 0.13);
        // A run that is shorter than a block is one.
        assert_eq!(of(&[jittered(50, 0.1, 3)], 1)[0].len(), 50);
    }

    #[test]
    fn uniform_times_and_few_points_need_none() {
        let kernels = [Kernel::SquaredExponential];
        assert!(are_needed(&kernels, &[jittered(600, 0.1, 1)]));
        assert!(!are_needed(&[Kernel::Matern52], &[jittered(600, 0.1, 1)]));
        assert!(!are_needed(&kernels, &[jittered(300, 0.1, 1)]));
        let time: Vec<f64> = (0..600).map(|i| 0.1 * f64::from(i)).collect();
        assert!(!are_needed(&kernels, &[Points::in_time(&time, &time)]));
    }

    #[test]
    fn hyperparameters_of_blocks_are_those_of_all_points() {
        // Two samplings: in the finer one a block of neighbours spans hardly more than the process remembers.
        for step in [0.1, 0.01] {
            let points = jittered(700, step, 4);
            let found =
                fit(&[Kernel::SquaredExponential], std::slice::from_ref(&points), &FitSettings::default()).unwrap();
            assert!((found.noise / 0.05 - 1.0).abs() < 0.1, "{step}: noise {}", found.noise);
            let mut at = vec![0.0; found.hyper.len() + 1];
            let mean = points.targets.iter().sum::<f64>() / 700.0;
            let centred = Points { targets: points.targets.iter().map(|v| v - mean).collect(), ..points.clone() };
            let mut likelihood = |length: f64| {
                let hyper = [found.hyper[0], found.hyper[1] + length, found.noise.ln()];
                let evaluation = crate::gp::Evaluation { kernel: &found.kernel, hyper: &hyper, jitter: 0.0 };
                evaluation.likelihood(&centred, &mut at, &mut crate::gp::Workspace::default()).unwrap()
            };
            // Within half a factor of e on either side nothing explains all points better by more than odds of 20.
            let here = likelihood(0.0);
            for length in [-0.5, -0.25, 0.25, 0.5] {
                assert!(likelihood(length) > here - 3.0, "{step}: {length} {} {here}", likelihood(length));
            }
        }
    }

    #[test]
    fn a_period_is_told_by_all_points() {
        let mut points = jittered(700, 0.13, 5);
        let noise: Vec<f64> =
            points.targets.iter().zip(&points.inputs[0]).map(|(v, t)| v - t.sin() - 0.5 * (2.3 * t).cos()).collect();
        for ((value, t), noise) in points.targets.iter_mut().zip(&points.inputs[0]).zip(noise) {
            *value = (2.0 * t).sin().powi(3) + noise;
        }
        let found = fit(&[Kernel::Periodic], &[points], &FitSettings::default()).unwrap();
        // A hundredth of a cycle over the 29 of the log: blocks alone determine a tenth.
        let period = found.hyper[2].exp();
        assert!((period / std::f64::consts::PI - 1.0).abs() < 0.01 / 29.0, "{period}");
        assert!((found.noise / 0.05 - 1.0).abs() < 0.1, "{}", found.noise);
    }
}
