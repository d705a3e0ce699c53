//! Lines 1 to 3 of Algorithm 1: smoothed states, their derivatives, and typical sizes.

use crate::data::{Channel, Dataset, Run};
use crate::differentiate::{Derivatives, Differentiation, SecondStage, central};
use crate::error::{Error, Result};
use crate::gp::Weakness;
use crate::identify::algorithm1::made::Made;
use crate::identify::algorithm1::second_opinion::smooth_columns;
use crate::identify::algorithm1::track::Track;
use crate::identify::limits::{LEAST_NOISE, MOST_STEPS, STEPS_PER_PACE, WINDOW_PACES, WINDOW_SAMPLES};
use crate::identify::notes::Note;
use crate::identify::prepare::{Logs, mean_period};
use crate::identify::settings::{Identify, Target};
use crate::library::Library;
use crate::progress::Progress;
use crate::refine::Hold;
use crate::smooth::{Noise, Smoothed, SmoothedRun, Smoother};
use faer::Mat;
use std::sync::Arc;

/// Median of the absolute value of a standard normal variable. Exact.
const MEDIAN: f64 = 0.6745;

/// The logs smoothed.
#[derive(Clone)]
pub(crate) struct Motion {
    /// One a run.
    pub(crate) tracks: Vec<Track>,
    /// Derivatives at the samples, where the regression compares those.
    pub(crate) derivatives: Option<Derivatives>,
    /// Noise of every state's column, then of every logged derivative.
    pub(crate) noise: Vec<f64>,
    /// Kernel of every state, empty without smoother.
    pub(crate) kernels: Vec<String>,
    /// Typical size of each coefficient (n x p): what would make its term as large as the state's rate.
    pub(crate) scales: Vec<Vec<f64>>,
    /// Standard deviation of every smoothed state over all runs, in its unit; 0 for one that does not move.
    pub(crate) spread: Vec<f64>,
    /// Time in which the fastest state changes by its own spread, s.
    pub(crate) pace: f64,
    /// Shortest mean sampling period of a run, s.
    pub(crate) period: f64,
    pub(crate) notes: Vec<Note>,
    /// The fits that were made to it, whatever the library.
    pub(crate) made: Arc<Made>,
}

/// Smooths the states and, where the regression compares derivatives, differentiates them.
pub(crate) fn smooth(settings: &Identify, logs: &Logs, progress: &dyn Progress) -> Result<Motion> {
    let (data, states) = (&logs.data, logs.states());
    let mut notes = Vec::new();
    let Smooth { runs, whole, mut noise, kernels } = match &settings.smoother {
        Some(smoother) => smoothed(smoother, settings, data, &mut notes, progress)?,
        None => unsmoothed(data, &states)?,
    };
    let rates: Vec<usize> = logs.rates.iter().flatten().copied().collect();
    noise.extend(match &settings.smoother {
        Some(smoother) if !rates.is_empty() => {
            let smoother = Smoother { noise: Noise::Estimated, covariance: false, ..smoother.clone() };
            smooth_columns(&smoother, data, &rates, progress)?.fits.iter().map(|f| f.noise).collect()
        }
        _ => roughness(data, &rates),
    });
    let derivatives = match &settings.target {
        Target::Weak | Target::Derivative(Differentiation::Given(_)) => None,
        Target::Derivative(method) => {
            let method = with_logged(method, &rates, states.len());
            let derived = method.differentiate(data, &states, &logs.controls(), whole.as_ref(), progress)?;
            let thinned =
                settings.states.iter().zip(&derived.fits).filter(|(_, f)| f.weak.contains(&Weakness::Thinned));
            notes.extend(thinned.map(|(state, _)| Note::ThinnedSecondStage { state: state.clone() }));
            Some(derived)
        }
    };
    let pairs = data.runs().iter().zip(&runs);
    let tracks = pairs.map(|(run, smoothed)| Track::new(logs, run, smoothed)).collect::<Result<Vec<_>>>()?;
    let spread = spreads(&tracks);
    let (scales, pace) = sizes(&tracks, &logs.frame.library, &spread, settings.hold.unwrap_or_default())?;
    let period = tracks.iter().map(|track| mean_period(&track.time)).fold(f64::INFINITY, f64::min);
    Ok(Motion { tracks, derivatives, noise, kernels, scales, spread, pace, period, notes, made: Arc::default() })
}

impl Motion {
    /// The same motion with the typical sizes of the terms of another library.
    pub(crate) fn with_library(&self, settings: &Identify, library: &Library) -> Result<Self> {
        let (scales, _) = sizes(&self.tracks, library, &self.spread, settings.hold.unwrap_or_default())?;
        Ok(Self { scales, ..self.clone() })
    }

    /// Length in s of the shortest rollouts that distinguish an equation from its neighbours; the longest run halved some times.
    pub(crate) fn shortest_window(&self) -> f64 {
        let longest = self.longest_run();
        let wanted = shortest_window(self.pace, self.period);
        longest / (longest / wanted).max(1.0).log2().floor().exp2()
    }

    /// Length of the longest run, s.
    pub(crate) fn longest_run(&self) -> f64 {
        self.tracks.iter().map(|t| t.time[t.n_samples() - 1] - t.time[0]).fold(0.0, f64::max)
    }

    /// Runge-Kutta steps between two samples.
    pub(crate) fn substeps(&self) -> usize {
        (STEPS_PER_PACE * self.period / self.pace).ceil().clamp(1.0, MOST_STEPS) as usize
    }
}

/// Length in s of rollouts that show a turn of the fastest state, and enough samples of it.
pub(crate) fn shortest_window(pace: f64, period: f64) -> f64 {
    (WINDOW_PACES * pace).max(WINDOW_SAMPLES * period)
}

/// The method, with logged derivatives as the targets of a second stage where every state has one.
fn with_logged(method: &Differentiation, logged: &[usize], n_states: usize) -> Differentiation {
    let given = (logged.len() == n_states).then(|| logged.to_vec());
    match method {
        Differentiation::GpState(stage) => Differentiation::GpState(SecondStage { given, ..stage.clone() }),
        Differentiation::GpControl(stage) => Differentiation::GpControl(SecondStage { given, ..stage.clone() }),
        other => other.clone(),
    }
}

/// Smoothed runs with the noise and the kernel of each state; `whole` is the smoother's own answer.
struct Smooth {
    runs: Vec<SmoothedRun>,
    whole: Option<Smoothed>,
    noise: Vec<f64>,
    kernels: Vec<String>,
}

/// The states smoothed; what makes a fit weak becomes a note.
fn smoothed(
    smoother: &Smoother,
    settings: &Identify,
    data: &Dataset,
    notes: &mut Vec<Note>,
    progress: &dyn Progress,
) -> Result<Smooth> {
    let covariance = matches!(settings.target, Target::Derivative(Differentiation::GpTime));
    let states: Vec<usize> = (0..settings.states.len()).collect();
    let whole = smooth_columns(&Smoother { covariance, ..smoother.clone() }, data, &states, progress)?;
    for (fit, channel) in whole.fits.iter().zip(&whole.channels).filter(|(fit, _)| !fit.weak.is_empty()) {
        notes.push(Note::WeakSmoothing { column: channel.name.clone(), reasons: fit.weak.clone() });
    }
    Ok(Smooth {
        runs: whole.runs.clone(),
        noise: whole.fits.iter().map(|f| f.noise).collect(),
        kernels: whole.fits.iter().map(|f| f.kernel.to_string()).collect(),
        whole: Some(whole),
    })
}

/// The samples as they are: gaps closed by straight lines, slopes by parabolas.
fn unsmoothed(data: &Dataset, states: &[usize]) -> Result<Smooth> {
    let mut runs = Vec::with_capacity(data.runs().len());
    for run in data.runs() {
        let r = run.n_samples();
        let mut mean = Mat::zeros(r, states.len());
        let mut derivative = Mat::zeros(r, states.len());
        for (j, &c) in states.iter().enumerate() {
            let filled = filled(run, c, &data.channels()[c])?;
            derivative.col_as_slice_mut(j).copy_from_slice(&central(&run.time, &filled));
            mean.col_as_slice_mut(j).copy_from_slice(&filled);
        }
        let zeros = Mat::zeros(r, states.len());
        runs.push(SmoothedRun {
            name: run.name.clone(),
            time: run.time.clone(),
            mean,
            std: zeros.clone(),
            derivative,
            derivative_std: zeros,
            derivative_covariance: Vec::new(),
        });
    }
    Ok(Smooth { runs, whole: None, noise: roughness(data, states), kernels: vec![String::new(); states.len()] })
}

/// Column `c` of a run, which `channel` names, with its gaps closed by straight lines.
pub(crate) fn filled(run: &Run, c: usize, channel: &Channel) -> Result<Vec<f64>> {
    fill(&run.time, run.column(c)).ok_or_else(|| Error::TooFewSamples {
        what: format!("channel `{}` in run `{}`", channel.name, run.name),
        needed: 1,
        found: 0,
    })
}

fn fill(time: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let there: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    let (&first, &last) = (there.first()?, there.last()?);
    let between = |i: usize| {
        if values[i].is_finite() {
            return values[i];
        }
        let after = there.partition_point(|&k| k < i);
        if i < first || i > last {
            return values[if i < first { first } else { last }];
        }
        let (a, b) = (there[after - 1], there[after]);
        values[a] + (values[b] - values[a]) * (time[i] - time[a]) / (time[b] - time[a])
    };
    Some((0..values.len()).map(between).collect())
}

/// Noise of channels from their second differences (of variance 6 for white noise of variance 1), at least a small share of the
/// spread.
fn roughness(data: &Dataset, channels: &[usize]) -> Vec<f64> {
    let of = |c: usize| {
        let mut bends: Vec<f64> = Vec::new();
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for run in data.runs() {
            let values: Vec<f64> = run.column(c).iter().copied().filter(|v| v.is_finite()).collect();
            bends.extend(values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()));
            for v in values {
                sum += v;
                square += v * v;
                count += 1.0;
            }
        }
        bends.sort_by(f64::total_cmp);
        let middle = bends.get(bends.len() / 2).copied().unwrap_or(0.0);
        let spread = if count > 0.0 { (square / count - (sum / count).powi(2)).max(0.0).sqrt() } else { 0.0 };
        (middle / (MEDIAN * 6f64.sqrt())).max(LEAST_NOISE * spread).max(f64::MIN_POSITIVE.sqrt())
    };
    channels.iter().map(|&c| of(c)).collect()
}

/// Standard deviation of every smoothed state over all runs.
fn spreads(tracks: &[Track]) -> Vec<f64> {
    let of = |s: usize| {
        let values = || tracks.iter().flat_map(move |t| (0..t.n_samples()).map(move |i| t.mean[(i, s)]));
        let count = values().count() as f64;
        let mean = values().sum::<f64>() / count;
        (values().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
    };
    (0..tracks[0].mean.ncols()).map(of).collect()
}

/// Typical size of every coefficient (n x p): what would make its term as large as the state's rate. And the pace.
fn sizes(tracks: &[Track], library: &Library, spread: &[f64], hold: Hold) -> Result<(Vec<Vec<f64>>, f64)> {
    let (n, p) = (tracks[0].mean.ncols(), library.n_terms());
    let m = tracks[0].controls.ncols();
    let mut terms = vec![0.0; p];
    let mut rates = vec![0.0; n];
    let mut count = 0.0;
    for track in tracks {
        let theta = library.evaluate(track.samples(hold, &vec![0.0; m]).as_ref(), &track.time)?;
        for i in 0..track.n_samples() {
            (0..p).for_each(|j| terms[j] += theta[(i, j)].powi(2));
            for (s, rate) in rates.iter_mut().enumerate() {
                *rate += track.slope[(i, s)].powi(2);
            }
        }
        count += track.n_samples() as f64;
    }
    let rms = |sum: f64| (sum / count).sqrt();
    let scales = rates.iter().map(|&rate| {
        let size = |&term: &f64| if term > 0.0 && rate > 0.0 { rms(rate) / rms(term) } else { 1.0 };
        terms.iter().map(size).collect()
    });
    let pace = (0..n).map(|s| if rates[s] > 0.0 { spread[s] / rms(rates[s]) } else { f64::INFINITY });
    let pace = pace.fold(f64::INFINITY, f64::min);
    let scales = scales.collect();
    let whole = tracks.iter().map(|t| t.time[t.n_samples() - 1] - t.time[0]).fold(0.0, f64::max);
    Ok((scales, if pace.is_finite() && pace > 0.0 { pace } else { whole }))
}
