//! States and their derivatives with covariance from noisy logs: one Gaussian process over time
//! per channel, hyperparameters shared by all runs (the paper's first Gaussian process stage).

use crate::data::{Channel, Dataset, Run};
use crate::error::{Error, Result};
use crate::gp::{Conditioned, Fit, FitSettings, Kernel, Points, Posterior, Quantity, fit};
use crate::parallel;
use crate::progress::{Progress, step};
use faer::Mat;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Where the noise of the channels comes from.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub enum Noise {
    /// Estimated from the data, channel by channel.
    #[default]
    Estimated,
    /// Standard deviation of each channel smoothed, in the channel's unit, in the order of the channels.
    Given(Vec<f64>),
}

/// Settings of the smoother.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `kernels` | `se`, `matern52`, `matern32`, `rq`, `periodic` | tried on every channel; the lowest negative log marginal likelihood wins |
/// | `noise` | estimated | or known standard deviations |
/// | `noise_floor` | 1e-4 | lowest noise, relative to the standard deviation of the channel |
/// | `covariance` | `false` | whether the joint covariance of each derivative is kept: r^2 numbers a run and channel |
/// | `dense_limit` | 2000 | samples of one run above which only Matern kernels are tried |
///
/// ```
/// use gpsindy_core::{Channel, Dataset, Run, Silent, Smoother};
/// let time: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
/// let values = faer::Mat::from_fn(40, 1, |i, _| time[i].sin());
/// let data = Dataset::new(vec![Channel::new("x")], vec![Run { name: "a".into(), time, values }])?;
/// let smoothed = Smoother::default().smooth(&data, &[0], &Silent)?;
/// assert!((smoothed.runs[0].derivative[(20, 0)] - 2f64.cos()).abs() < 0.01);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Smoother {
    /// Kernels to try on every channel.
    pub kernels: Vec<Kernel>,
    /// Where the noise comes from.
    pub noise: Noise,
    /// Lowest noise, relative to the standard deviation of the channel.
    pub noise_floor: f64,
    /// Whether the joint posterior covariance of each derivative is kept.
    pub covariance: bool,
    /// Samples of one run above which only kernels of linear cost are tried.
    pub dense_limit: usize,
}

impl Default for Smoother {
    fn default() -> Self {
        let settings = FitSettings::default();
        Self {
            kernels: vec![
                Kernel::SquaredExponential,
                Kernel::Matern52,
                Kernel::Matern32,
                Kernel::RationalQuadratic,
                Kernel::Periodic,
            ],
            noise: Noise::Estimated,
            noise_floor: settings.noise_floor,
            covariance: false,
            dense_limit: settings.dense_limit,
        }
    }
}

/// Smoothed channels of all runs.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Smoothed {
    /// The channels smoothed, in the order asked for.
    pub channels: Vec<Channel>,
    /// One entry a run, in the order of the dataset.
    pub runs: Vec<SmoothedRun>,
    /// Kernel, hyperparameters and noise of each channel, with whatever makes them weak.
    pub fits: Vec<Fit>,
}

/// Smoothed channels of one run of r samples, c channels.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SmoothedRun {
    /// Name of the run.
    pub name: String,
    /// Sample times, s, r of them.
    pub time: Vec<f64>,
    /// (r x c), posterior mean at every sample, also where the value is missing.
    pub mean: Mat<f64>,
    /// (r x c), posterior standard deviation of the noise-free value.
    pub std: Mat<f64>,
    /// (r x c), posterior mean of the time derivative, channel unit per second. A channel whose
    /// kernel has no derivative (`matern12`) carries the mean slope over the neighbouring samples.
    pub derivative: Mat<f64>,
    /// (r x c), posterior standard deviation of `derivative`.
    pub derivative_std: Mat<f64>,
    /// One (r x r) posterior covariance of the derivative a channel; empty unless asked for.
    pub derivative_covariance: Vec<Mat<f64>>,
}

/// Most samples of a run with a joint covariance of derivatives: 3.2 GB a channel.
const LARGEST_JOINT: usize = 20_000;

impl Smoother {
    /// Smooths `channels` (indices into the dataset's) of all runs.
    ///
    /// # Errors
    /// A channel that does not exist or has no value at all, a given noise that does not match
    /// the channels, no kernel, a run of more than 20000 samples where `covariance` is asked for; a request to stop.
    pub fn smooth(&self, data: &Dataset, channels: &[usize], progress: &dyn Progress) -> Result<Smoothed> {
        self.check(data, channels)?;
        let done = AtomicUsize::new(0);
        let results = parallel::try_map(0..channels.len(), |c| {
            let result = self.channel(data, channels[c], self.fit_settings(c))?;
            step(progress, "smooth", done.fetch_add(1, Ordering::Relaxed) + 1, channels.len())?;
            Ok(result)
        })?;
        let runs = (0..data.runs().len()).map(|r| self.assemble(&data.runs()[r], r, &results)).collect();
        Ok(Smoothed {
            channels: channels.iter().map(|&c| data.channels()[c].clone()).collect(),
            runs,
            fits: results.into_iter().map(|r| r.fit).collect(),
        })
    }

    fn check(&self, data: &Dataset, channels: &[usize]) -> Result<()> {
        let n_channels = data.channels().len();
        if let Some(c) = channels.iter().find(|c| **c >= n_channels) {
            return Err(Error::range("channel", &format!("below {n_channels}"), c));
        }
        if let Noise::Given(noise) = &self.noise {
            if noise.len() != channels.len() {
                return Err(Error::shape("noise", format!("{} values, one a channel", channels.len()), noise.len()));
            }
            if let Some(n) = noise.iter().find(|n| !(**n > 0.0 && n.is_finite())) {
                return Err(Error::range("noise", "above 0", n));
            }
        }
        if self.covariance
            && let Some(run) = data.runs().iter().find(|run| run.n_samples() > LARGEST_JOINT)
        {
            return Err(Error::data(format!(
                "run `{}` has {} samples; a joint covariance of derivatives is kept for at most {LARGEST_JOINT}, thin the samples",
                run.name,
                run.n_samples()
            )));
        }
        for &c in channels {
            if data.runs().iter().all(|r| r.column(c).iter().all(|v| v.is_nan())) {
                let what = format!("channel `{}`", data.channels()[c].name);
                return Err(Error::TooFewSamples { what, needed: 1, found: 0 });
            }
        }
        Ok(())
    }

    fn fit_settings(&self, channel: usize) -> FitSettings {
        let noise = match &self.noise {
            Noise::Estimated => None,
            Noise::Given(noise) => Some(noise[channel]),
        };
        FitSettings { noise, noise_floor: self.noise_floor, dense_limit: self.dense_limit, ..FitSettings::default() }
    }

    fn channel(&self, data: &Dataset, channel: usize, settings: FitSettings) -> Result<ChannelResult> {
        let points: Vec<Points> = data.runs().iter().map(|r| Points::in_time(&r.time, r.column(channel))).collect();
        let fit = fit(&self.kernels, &points, &settings)?;
        let laws =
            data.runs().iter().zip(&points).map(|(run, points)| self.law(&fit, run, points)).collect::<Result<_>>()?;
        Ok(ChannelResult { fit, laws })
    }

    /// Law of value and derivative at the samples of a run.
    fn law(&self, fit: &Fit, run: &Run, points: &Points) -> Result<[Posterior; 2]> {
        let process = Conditioned::new(fit, points)?;
        let at = std::slice::from_ref(&run.time);
        if fit.kernel.differentiable() {
            let both = process.predict(at, &[Quantity::Value, Quantity::Derivative], false)?;
            let [value, mut derivative] = halves(&both);
            if self.covariance {
                derivative.covariance = process.predict(at, &[Quantity::Derivative], true)?.covariance;
            }
            return Ok([value, derivative]);
        }
        if self.covariance {
            let value = process.predict(at, &[Quantity::Value], true)?;
            let slope = mean_slope(&run.time, &value);
            return Ok([value, slope]);
        }
        let (value, neighbours) = process.with_neighbours(&run.time)?;
        let slope = mean_slope_of_band(&run.time, &value, &neighbours);
        Ok([value, slope])
    }

    fn assemble(&self, run: &Run, index: usize, results: &[ChannelResult]) -> SmoothedRun {
        let column = |pick: fn(&[Posterior; 2], usize) -> f64| {
            Mat::from_fn(run.n_samples(), results.len(), |i, c| pick(&results[c].laws[index], i))
        };
        let covariance = |r: &ChannelResult| r.laws[index][1].covariance.clone();
        SmoothedRun {
            name: run.name.clone(),
            time: run.time.clone(),
            mean: column(|l, i| l[0].mean[i]),
            std: column(|l, i| l[0].variance[i].sqrt()),
            derivative: column(|l, i| l[1].mean[i]),
            derivative_std: column(|l, i| l[1].variance[i].sqrt()),
            derivative_covariance: if self.covariance {
                results.iter().filter_map(covariance).collect()
            } else {
                Vec::new()
            },
        }
    }
}

struct ChannelResult {
    fit: Fit,
    /// Value and derivative, one pair a run.
    laws: Vec<[Posterior; 2]>,
}

/// Laws of value and derivative out of one prediction of both.
fn halves(both: &Posterior) -> [Posterior; 2] {
    let n = both.mean.len() / 2;
    [0..n, n..2 * n].map(|part| Posterior {
        mean: both.mean[part.clone()].to_vec(),
        variance: both.variance[part].to_vec(),
        covariance: None,
    })
}

/// The samples whose difference approximates the slope at sample i of n: its neighbours, one-sided at the ends.
fn ends(i: usize, n: usize) -> (usize, usize) {
    (i.saturating_sub(1), (i + 1).min(n - 1))
}

/// Slope of `f` over the neighbours of sample i; 0 where there is but one sample.
fn slope_over(time: &[f64], i: usize, f: impl Fn(usize) -> f64) -> f64 {
    let (a, b) = ends(i, time.len());
    if a == b { 0.0 } else { (f(b) - f(a)) / (time[b] - time[a]) }
}

/// Law of the slope over the neighbouring samples, a linear map of the values, with its joint covariance.
fn mean_slope(time: &[f64], value: &Posterior) -> Posterior {
    let n = time.len();
    let mean = (0..n).map(|i| slope_over(time, i, |k| value.mean[k])).collect();
    let covariance = match &value.covariance {
        Some(c) => Mat::from_fn(n, n, |i, j| slope_over(time, i, |a| slope_over(time, j, |b| c[(a, b)]))),
        None => Mat::zeros(n, n),
    };
    let variance = (0..n).map(|i| covariance[(i, i)].max(0.0)).collect();
    Posterior { mean, variance, covariance: Some(covariance) }
}

/// The same without the joint covariance, from the covariances of each value with the next two.
fn mean_slope_of_band(time: &[f64], value: &Posterior, neighbours: &[[f64; 2]]) -> Posterior {
    let n = time.len();
    let mean = (0..n).map(|i| slope_over(time, i, |k| value.mean[k])).collect();
    let variance = |i: usize| {
        let (a, b) = ends(i, n);
        if a == b {
            return 0.0;
        }
        let difference = value.variance[a] + value.variance[b] - 2.0 * neighbours[a][b - a - 1];
        (difference / (time[b] - time[a]).powi(2)).max(0.0)
    };
    Posterior { mean, variance: (0..n).map(variance).collect(), covariance: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::random::normal;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    fn data(n: usize, noise: f64, missing: usize) -> Dataset {
        let time: Vec<f64> = (0..n).map(|i| 10.0 * i as f64 / n as f64).collect();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let values = Mat::from_fn(n, 2, |i, j| {
            let v = if j == 0 { time[i].sin() } else { 50.0 * (0.7 * time[i]).cos() };
            if missing > 0 && i % missing == j {
                f64::NAN
            } else {
                v + noise * normal(&mut random) * if j == 0 { 1.0 } else { 50.0 }
            }
        });
        Dataset::new(vec![Channel::new("a"), Channel::new("b")], vec![Run { name: "r".into(), time, values }]).unwrap()
    }

    #[test]
    fn smoothing_finds_the_noise_and_beats_it() {
        let data = data(200, 0.1, 0);
        let out = Smoother { covariance: true, ..Smoother::default() }.smooth(&data, &[0, 1], &Silent).unwrap();
        // 200 samples give a standard deviation within about 5 %; 20 % is four of them.
        assert!((out.fits[0].noise - 0.1).abs() < 0.02, "{}", out.fits[0].noise);
        assert!((out.fits[1].noise - 5.0).abs() < 1.0, "{}", out.fits[1].noise);
        let run = &out.runs[0];
        let error = |f: &dyn Fn(usize) -> f64| ((0..200).map(|i| f(i).powi(2)).sum::<f64>() / 200.0).sqrt();
        assert!(error(&|i| run.mean[(i, 0)] - run.time[i].sin()) < 0.05);
        assert!(error(&|i| run.derivative[(i, 0)] - run.time[i].cos()) < 0.15);
        // Standardised errors of the derivative are of order one.
        let z = error(&|i| (run.derivative[(i, 0)] - run.time[i].cos()) / run.derivative_std[(i, 0)]);
        assert!(z < 2.0, "{z}");
        for i in 0..200 {
            let variance = run.derivative_covariance[0][(i, i)];
            assert!((variance.sqrt() - run.derivative_std[(i, 0)]).abs() < 1e-6 * run.derivative_std[(i, 0)]);
        }
    }

    #[test]
    fn missing_values_are_left_out_and_filled() {
        let out = Smoother::default().smooth(&data(120, 0.02, 5), &[0, 1], &Silent).unwrap();
        for i in 0..120 {
            assert!((out.runs[0].mean[(i, 0)] - out.runs[0].time[i].sin()).abs() < 0.1);
        }
    }

    #[test]
    fn a_kernel_without_derivative_carries_slopes_with_their_exact_covariance() {
        let smoother = Smoother { kernels: vec![Kernel::Matern12], covariance: true, ..Smoother::default() };
        let out = smoother.smooth(&data(60, 0.02, 0), &[0], &Silent).unwrap();
        let run = &out.runs[0];
        let slope = (run.mean[(11, 0)] - run.mean[(9, 0)]) / (run.time[11] - run.time[9]);
        assert!((run.derivative[(10, 0)] - slope).abs() < 1e-12);
        assert!(run.derivative_std[(10, 0)] > 0.0);
    }
    #[test]
    fn slopes_of_a_long_log_have_the_same_law_without_the_joint_covariance() {
        for missing in [0, 7] {
            let data = data(90, 0.05, missing);
            let with = |covariance| Smoother { kernels: vec![Kernel::Matern12], covariance, ..Smoother::default() };
            let [joint, band] = [true, false].map(|c| with(c).smooth(&data, &[0], &Silent).unwrap());
            for i in 0..90 {
                let (joint, band) = (&joint.runs[0], &band.runs[0]);
                assert!((joint.derivative[(i, 0)] - band.derivative[(i, 0)]).abs() < 1e-12);
                // The variance of a difference of values that go together loses a few digits.
                assert!((joint.derivative_std[(i, 0)] / band.derivative_std[(i, 0)] - 1.0).abs() < 1e-9, "{i}");
            }
        }
    }

    #[test]
    fn a_hundred_thousand_samples_are_smoothed_without_a_derivative_in_linear_memory() {
        // Their joint covariance would take 80 GB.
        let smoother = Smoother { kernels: vec![Kernel::Matern12], ..Smoother::default() };
        let out = smoother.smooth(&data(100_000, 0.1, 0), &[0], &Silent).unwrap();
        assert!(out.runs[0].derivative_std.col_as_slice(0).iter().all(|s| *s > 0.0));
        assert!((out.fits[0].noise - 0.1).abs() < 0.01, "{}", out.fits[0].noise);
        let joint = Smoother { covariance: true, ..smoother };
        let error = joint.smooth(&data(100_000, 0.1, 0), &[0], &Silent).unwrap_err();
        assert!(error.to_string().contains("100000 samples"), "{error}");
    }
}
