//! What an identification looks at: columns found, training part cut, states smoothed, rows of regression made.

use super::equations::{DelayValue, Equations, rate_name};
use super::rows::{Builder, Rows, integrals, stretches};
use super::structure::Search;
use super::structure::independent_share;
use super::track::Track;
use super::{Delay, Identify, Target};
use crate::data::{Channel, Dataset, Run};
use crate::differentiate::{Derivatives, Differentiation, SecondStage, central};
use crate::error::{Error, Result};
use crate::gp::Weakness;
use crate::library::Library;
use crate::progress::{Progress, step};
use crate::refine::Hold;
use crate::regress::{Reduced, Whitening};
use crate::smooth::{Noise, SmoothedRun, Smoother};
use faer::Mat;
use std::sync::Arc;

/// Rows at most in the regression that compares delays.
const DELAY_ROWS: usize = 3000;

pub(super) struct Plan {
    /// Training part: states, controls, then logged derivatives under their own names.
    data: Dataset,
    tracks: Vec<Track>,
    library: Arc<Library>,
    /// Pointwise derivatives, where the regression compares those.
    derivatives: Option<Derivatives>,
    /// Noise of every state's column, then of every logged derivative.
    pub(super) noise: Vec<f64>,
    pub(super) kernels: Vec<String>,
    pub(super) notes: Vec<String>,
    /// Typical size of each coefficient (n x p).
    scales: Vec<Vec<f64>>,
    /// Time in which the fastest state changes by its own spread, s.
    pace: f64,
    period: f64,
}

impl Plan {
    pub(super) fn new(settings: &Identify, data: &Dataset, progress: &dyn Progress) -> Result<Self> {
        let data = training(settings, data)?;
        let (n, m) = (settings.states.len(), settings.controls.len());
        let states: Vec<usize> = (0..n).collect();
        let controls: Vec<usize> = (n..n + m).collect();
        let derivatives: Vec<Option<usize>> =
            settings.states.iter().map(|s| data.index_of(&rate_name(s)).ok()).collect();
        let logged: Vec<usize> = derivatives.iter().flatten().copied().collect();
        let library = Arc::new(Library::new(&settings.states, &settings.controls, &settings.library)?);
        settings.constraints.check(&settings.states, &library)?;

        let mut notes = Vec::new();
        let (runs, mut noise, kernels) = match &settings.smoother {
            Some(smoother) => smooth(smoother, settings, &data, &states, &mut notes, progress)?,
            None => unsmoothed(&data, &states)?,
        };
        noise.extend(match &settings.smoother {
            Some(smoother) if !logged.is_empty() => {
                let smoother = Smoother { noise: Noise::Estimated, covariance: false, ..smoother.clone() };
                smoother.smooth(&data, &logged, progress)?.fits.iter().map(|f| f.noise).collect()
            }
            _ => roughness(&data, &logged),
        });
        let differentiation = match &settings.target {
            Target::Weak => None,
            Target::Derivative(differentiation) => Some(differentiation),
        };
        let derived = match differentiation {
            Some(Differentiation::Given(_)) | None => None,
            Some(method) => {
                let smoothed = runs.1.as_ref();
                let method = with_logged(method, &logged, n);
                let derived = method.differentiate(&data, &states, &controls, smoothed, progress)?;
                for (state, fit) in settings.states.iter().zip(&derived.fits) {
                    if fit.weak.contains(&Weakness::Thinned) {
                        notes.push(format!("second Gaussian process of `{state}`: {}", Weakness::Thinned));
                    }
                }
                Some(derived)
            }
        };
        let tracks = data
            .runs()
            .iter()
            .zip(&runs.0)
            .map(|(run, smoothed)| {
                Track::new(&data, run, smoothed, &states, &derivatives, &controls, settings.hold.unwrap_or_default())
            })
            .collect::<Result<Vec<_>>>()?;
        let (scales, pace) = sizes(&tracks, &library)?;
        let period = tracks.iter().map(period).fold(f64::INFINITY, f64::min);
        Ok(Self { data, tracks, library, derivatives: derived, noise, kernels, notes, scales, pace, period })
    }

    pub(super) fn n_states(&self) -> usize {
        self.kernels.len()
    }

    /// Equations without a term yet.
    pub(super) fn equations(&self, settings: &Identify) -> Result<Equations> {
        let (n, p) = (self.n_states(), self.library.n_terms());
        let channel = |j: usize| (self.data.channels()[j].name.clone(), self.data.channels()[j].unit.clone());
        let constraints = &settings.constraints;
        let fixed: Vec<_> = settings.states.iter().map(|s| constraints.fixed_equation(s).cloned()).collect();
        let mut allowed = Vec::with_capacity(n);
        let mut signs = Vec::with_capacity(n);
        let mut kept = Vec::with_capacity(n);
        for (s, state) in settings.states.iter().enumerate() {
            allowed.push(if fixed[s].is_some() { vec![] } else { constraints.allowed(state, &self.library)? });
            signs.push(constraints.signs(state, &self.library)?);
            kept.push(constraints.kept(state, &self.library)?);
        }
        let none = DelayValue { value: 0.0, free: false, period: self.period, most: f64::INFINITY };
        let mut delays = vec![none; settings.controls.len()];
        for (control, delay) in &settings.delays {
            let k = settings.controls.iter().position(|c| c == control);
            let k = k.ok_or_else(|| Error::unknown("control", control, &settings.controls))?;
            match *delay {
                Delay::Fixed(value) if value >= 0.0 && value.is_finite() => delays[k].value = value,
                Delay::Auto(most) if most > 0.0 && most.is_finite() => {
                    (delays[k].free, delays[k].most) = (true, most);
                }
                Delay::Fixed(value) | Delay::Auto(value) => {
                    return Err(Error::range("delay", "at least 0 and finite, in s", value));
                }
            }
        }
        Ok(Equations {
            library: Arc::clone(&self.library),
            states: (0..n).map(channel).collect(),
            controls: (n..n + settings.controls.len()).map(channel).collect(),
            coefficients: vec![vec![0.0; p]; n],
            allowed,
            kept,
            signs,
            fixed,
            delays,
            derivative_given: settings.states.iter().map(|s| self.data.index_of(&rate_name(s)).is_ok()).collect(),
        })
    }

    /// Length in s of the shortest rollouts that tell an equation from its neighbours; the longest run halved some times.
    pub(super) fn shortest_window(&self) -> f64 {
        let longest = self.longest_run();
        let wanted = (3.0 * self.pace).max(10.0 * self.period);
        longest / (longest / wanted).max(1.0).log2().floor().exp2()
    }

    /// Length of the longest run, s.
    pub(super) fn longest_run(&self) -> f64 {
        self.tracks.iter().map(|t| t.time[t.n_samples() - 1] - t.time[0]).fold(0.0, f64::max)
    }

    /// What the rows take the controls to do between samples.
    pub(super) fn hold(&self) -> Hold {
        self.tracks[0].hold
    }

    pub(super) fn search(&self, hold: Hold) -> Search<'_> {
        Search {
            data: &self.data,
            // A classical Runge-Kutta step of a twelfth of the pace errs by about 1e-6 of the state.
            substeps: ((12.0 * self.period / self.pace).ceil() as usize).clamp(1, 10),
            hold,
            noise: self.noise.clone(),
            tracks: &self.tracks,
            scales: &self.scales,
        }
    }

    /// Rows of the regression of every state whose equation is not given.
    pub(super) fn rows(&self, settings: &Identify, equations: &Equations) -> Result<Vec<Option<Rows>>> {
        let delays: Vec<f64> = equations.delays.iter().map(|d| d.value).collect();
        let p = self.library.n_terms();
        let n = self.n_states();
        let mut builders: Vec<Builder> = (0..n).map(|_| Builder::new(p)).collect();
        let weak = matches!(settings.target, Target::Weak);
        let logged = !matches!(settings.target, Target::Derivative(ref d) if !matches!(d, Differentiation::Given(_)));
        for (index, track) in self.tracks.iter().enumerate() {
            let length = (2.0 * self.shortest_window() / period(track)).round() as usize;
            let parts = stretches(track.n_samples(), length);
            let sums = if weak { Some(integrals(track, &self.library, &delays)?) } else { None };
            let terms = if weak && self.noise.len() == n {
                None
            } else {
                Some(self.library.evaluate(track.samples(&delays).as_ref(), &track.time)?)
            };
            let mut column = n;
            for (s, builder) in builders.iter_mut().enumerate() {
                let given = equations.derivative_given[s];
                if equations.fixed[s].is_none() {
                    for &part in &parts {
                        if let Some(sums) = &sums {
                            builder.weak(track.raw.col_as_slice(s), sums, part, self.noise[s]);
                        }
                        if let (true, true, Some(terms)) = (given, logged, &terms) {
                            builder.derivative(track.given.col_as_slice(s), terms, part, self.noise[column]);
                        }
                    }
                    if let (Some(derived), Some(terms)) = (&self.derivatives, &terms) {
                        pointwise(builder, derived, (index, s), terms, &parts)?;
                    }
                }
                column += usize::from(given);
            }
        }
        builders
            .into_iter()
            .enumerate()
            .map(|(s, builder)| match equations.fixed[s] {
                Some(_) => Ok(None),
                None => builder.finish(&equations.states[s].0).map(Some),
            })
            .collect()
    }

    /// What the controls may do between samples, with the delays that belong to it, best first: what leaves the smallest
    /// residual of the whole library. Whatever is decidedly worse is left out. The first is what the rows then take.
    pub(super) fn find_timings(
        &mut self,
        settings: &Identify,
        equations: &mut Equations,
        progress: &dyn Progress,
    ) -> Result<Vec<Timing>> {
        let holds = match settings.hold {
            Some(hold) => vec![hold],
            None if settings.controls.is_empty() => vec![Hold::Zero],
            None => vec![Hold::Zero, Hold::Linear],
        };
        let open = holds.len() > 1;
        let mut timings = Vec::with_capacity(holds.len());
        for hold in holds {
            self.tracks.iter_mut().for_each(|track| track.hold = hold);
            self.find_delays(settings, equations, progress)?;
            let misfit = if open { self.misfit(settings, equations)? } else { Misfit { value: 0.0, share: 1.0 } };
            timings.push(Timing { hold, delays: equations.delays.clone(), misfit });
        }
        timings.sort_by(|x, y| x.misfit.value.total_cmp(&y.misfit.value));
        let best = timings[0].misfit;
        timings.retain(|other| best.share * (other.misfit.value - best.value) <= DECIDED);
        self.tracks.iter_mut().for_each(|track| track.hold = timings[0].hold);
        equations.delays.clone_from(&timings[0].delays);
        Ok(timings)
    }

    /// Delays at which the whole library leaves the smallest residual, one control after the other, twice.
    fn find_delays(&self, settings: &Identify, equations: &mut Equations, progress: &dyn Progress) -> Result<()> {
        let free: Vec<(usize, f64)> = equations.free_delays().map(|(k, delay)| (k, delay.most)).collect();
        let rounds = if free.len() > 1 { 2 } else { 1 };
        for round in 0..rounds {
            for &(k, most) in &free {
                step(progress, "find delays", round, rounds)?;
                let count = ((most / self.period).round() as usize).clamp(4, 40);
                let grid: Vec<f64> = (0..=count).map(|i| most * i as f64 / count as f64).collect();
                let mut misfit_at = |value: f64| {
                    equations.delays[k].value = value;
                    self.misfit(settings, equations).map(|misfit| misfit.value)
                };
                let misfits = grid.iter().map(|&value| misfit_at(value)).collect::<Result<Vec<_>>>()?;
                let best = (0..grid.len()).min_by(|&a, &b| misfits[a].total_cmp(&misfits[b])).unwrap_or(0);
                equations.delays[k].value = vertex(&grid, &misfits, best);
            }
        }
        Ok(())
    }

    /// What all allowed terms leave: the sum over the states of `n ln(rss)`.
    fn misfit(&self, settings: &Identify, equations: &Equations) -> Result<Misfit> {
        let (mut sum, mut left) = (0.0, Vec::new());
        for (s, rows) in self.rows(settings, equations)?.iter().enumerate() {
            let Some(rows) = rows else { continue };
            let step = rows.target.len().div_ceil(DELAY_ROWS);
            let kept: Vec<usize> = (0..rows.target.len()).step_by(step).collect();
            let allowed = &equations.allowed[s];
            let theta = Mat::from_fn(kept.len(), allowed.len(), |i, j| rows.theta[(kept[i], allowed[j])]);
            let target: Vec<f64> = kept.iter().map(|&i| rows.target[i]).collect();
            let problem = Reduced::new(theta.as_ref(), &target)?;
            let all: Vec<usize> = (0..allowed.len()).collect();
            let fit = problem.refit(&all);
            sum += kept.len() as f64 * fit.residual.max(f64::MIN_POSITIVE).ln();
            let explained = |i: usize| (0..allowed.len()).map(|j| theta[(i, j)] * fit.coefficients[j]).sum::<f64>();
            let size = (fit.residual / kept.len() as f64).sqrt().max(f64::MIN_POSITIVE);
            left.push((0..kept.len()).map(|i| (target[i] - explained(i)) / size).collect());
        }
        Ok(Misfit { value: sum, share: independent_share(&left, 1) })
    }
}

/// What the controls do between samples, and when they act.
#[derive(Debug, Clone)]
pub(super) struct Timing {
    pub(super) hold: Hold,
    /// One a control.
    pub(super) delays: Vec<DelayValue>,
    misfit: Misfit,
}

/// What a regression leaves.
#[derive(Debug, Clone, Copy)]
struct Misfit {
    /// Twice the negative logarithm of the likelihood, but for a constant.
    value: f64,
    /// Share of the values that count as independent.
    share: f64,
}

/// Twice the logarithm of a likelihood ratio that decides between held and interpolated controls before any term is chosen:
/// odds of 20,000.
const DECIDED: f64 = 20.0;

/// The method, with logged derivatives as the targets of a second stage where every state has one.
fn with_logged(method: &Differentiation, logged: &[usize], n_states: usize) -> Differentiation {
    let given = (logged.len() == n_states).then(|| logged.to_vec());
    match method {
        Differentiation::GpState(stage) => Differentiation::GpState(SecondStage { given, ..stage.clone() }),
        Differentiation::GpControl(stage) => Differentiation::GpControl(SecondStage { given, ..stage.clone() }),
        other => other.clone(),
    }
}

/// The minimum of the parabola through the best point and its neighbours.
fn vertex(grid: &[f64], values: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 == grid.len() {
        return grid[best];
    }
    let (left, middle, right) = (values[best - 1], values[best], values[best + 1]);
    let bend = left - 2.0 * middle + right;
    let shift = if bend > 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
    grid[best] + shift.clamp(-1.0, 1.0) * (grid[best + 1] - grid[best])
}

/// The columns in use, under the names of the model, of the first part of every run.
fn training(settings: &Identify, data: &Dataset) -> Result<Dataset> {
    if settings.states.is_empty() {
        return Err(Error::invalid("no state named; say which columns are states"));
    }
    let fraction = settings.train_fraction;
    if !(fraction > 0.0 && fraction <= 1.0) {
        return Err(Error::range("train-fraction", "above 0 and at most 1", fraction));
    }
    for (state, _) in &settings.derivatives {
        if !settings.states.contains(state) {
            return Err(Error::unknown("state", state, &settings.states));
        }
    }
    let mut columns = data.indices_of(&settings.states)?;
    columns.extend(data.indices_of(&settings.controls)?);
    let mut channels: Vec<Channel> = columns.iter().map(|&c| data.channels()[c].clone()).collect();
    for state in &settings.states {
        if let Some((_, column)) = settings.derivatives.iter().find(|(s, _)| s == state) {
            columns.push(data.index_of(column)?);
            channels.push(Channel::new(rate_name(state)));
        }
    }
    let runs = data.runs().iter().map(|run| {
        let (from, to) = (run.time[0], run.time[run.n_samples() - 1]);
        let end = run.time.partition_point(|&t| t <= from + fraction * (to - from));
        Run {
            name: run.name.clone(),
            time: run.time[..end].to_vec(),
            values: Mat::from_fn(end, columns.len(), |i, j| run.values[(i, columns[j])]),
        }
    });
    let runs: Vec<Run> = runs.collect();
    let longest = runs.iter().map(Run::n_samples).max().unwrap_or(0);
    let runs: Vec<Run> = runs.into_iter().filter(|run| run.n_samples() >= 4).collect();
    if runs.is_empty() {
        return Err(Error::TooFewSamples {
            what: "training part of the longest run".into(),
            needed: 4,
            found: longest,
        });
    }
    Dataset::new(channels, runs)
}

type SmoothedRuns = ((Vec<SmoothedRun>, Option<crate::smooth::Smoothed>), Vec<f64>, Vec<String>);

fn smooth(
    smoother: &Smoother,
    settings: &Identify,
    data: &Dataset,
    states: &[usize],
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<SmoothedRuns> {
    let wants_covariance = matches!(settings.target, Target::Derivative(Differentiation::GpTime));
    let smoother = Smoother { covariance: wants_covariance, ..smoother.clone() };
    let smoothed = smoother.smooth(data, states, progress)?;
    let mut kernels = Vec::new();
    for (fit, channel) in smoothed.fits.iter().zip(&smoothed.channels) {
        let weak: Vec<String> = fit.weak.iter().map(ToString::to_string).collect();
        if !weak.is_empty() {
            notes.push(format!("smoothing of `{}`: {}", channel.name, weak.join("; ")));
        }
        kernels.push(format!("{:?}", fit.kernel));
    }
    let noise = smoothed.fits.iter().map(|f| f.noise).collect();
    Ok(((smoothed.runs.clone(), Some(smoothed)), noise, kernels))
}

/// The samples as they are: gaps closed by straight lines, slopes by parabolas.
fn unsmoothed(data: &Dataset, states: &[usize]) -> Result<SmoothedRuns> {
    let mut runs = Vec::with_capacity(data.runs().len());
    for run in data.runs() {
        let r = run.n_samples();
        let mut mean = Mat::zeros(r, states.len());
        let mut derivative = Mat::zeros(r, states.len());
        for (j, &c) in states.iter().enumerate() {
            let filled = fill(&run.time, run.column(c)).ok_or_else(|| Error::TooFewSamples {
                what: format!("channel `{}` in run `{}`", data.channels()[c].name, run.name),
                needed: 1,
                found: 0,
            })?;
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
    Ok(((runs, None), roughness(data, states), vec![String::new(); states.len()]))
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

/// Noise of channels from their second differences (of variance 6 for white noise of variance 1), at least 1e-4 of the spread.
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
        (middle / (0.6745 * 6f64.sqrt())).max(1e-4 * spread).max(f64::MIN_POSITIVE.sqrt())
    };
    channels.iter().map(|&c| of(c)).collect()
}

/// Rows from derivatives at the samples; whitened by their covariance where there is one.
fn pointwise(
    builder: &mut Builder,
    derived: &Derivatives,
    (run, state): (usize, usize),
    terms: &Mat<f64>,
    parts: &[(usize, usize)],
) -> Result<()> {
    let derivatives = &derived.runs[run];
    let values = derivatives.dx.col_as_slice(state);
    for &(first, end) in parts {
        match derivatives.covariance.get(state) {
            Some(covariance) => {
                let size = end - first;
                let mean = (first..end).map(|i| covariance[(i, i)]).sum::<f64>() / size as f64;
                // A smooth process is sure of directions in which the equation errs a little; a hundredth of the mean
                // variance in every direction keeps them from ruling the fit.
                let part = Mat::from_fn(size, size, |i, j| {
                    covariance[(first + i, first + j)] + if i == j { 0.01 * mean } else { 0.0 }
                });
                let whitening = Whitening::from_covariance(&part)?;
                let mut theta = Mat::from_fn(size, terms.ncols(), |i, j| terms[(first + i, j)]);
                let mut target = values[first..end].to_vec();
                whitening.apply(&mut theta);
                whitening.apply_column(&mut target);
                builder.whitened(&theta, &target);
            }
            None => builder.derivative(values, terms, (first, end), 1.0),
        }
    }
    Ok(())
}

/// Typical size of every coefficient (n x p): what would make its term as large as the state's rate. And the pace.
fn sizes(tracks: &[Track], library: &Library) -> Result<(Vec<Vec<f64>>, f64)> {
    let (n, p) = (tracks[0].mean.ncols(), library.n_terms());
    let m = tracks[0].controls.ncols();
    let mut terms = vec![0.0; p];
    let mut rates = vec![0.0; n];
    let mut moments = vec![(0.0, 0.0); n];
    let mut count = 0.0;
    for track in tracks {
        let theta = library.evaluate(track.samples(&vec![0.0; m]).as_ref(), &track.time)?;
        for i in 0..track.n_samples() {
            (0..p).for_each(|j| terms[j] += theta[(i, j)].powi(2));
            for (s, rate) in rates.iter_mut().enumerate() {
                *rate += track.slope[(i, s)].powi(2);
                moments[s].0 += track.mean[(i, s)];
                moments[s].1 += track.mean[(i, s)].powi(2);
            }
        }
        count += track.n_samples() as f64;
    }
    let rms = |sum: f64| (sum / count).sqrt();
    let scales = rates.iter().map(|&rate| {
        let size = |&term: &f64| if term > 0.0 && rate > 0.0 { rms(rate) / rms(term) } else { 1.0 };
        terms.iter().map(size).collect()
    });
    let pace = (0..n).map(|s| {
        let spread = (moments[s].1 / count - (moments[s].0 / count).powi(2)).max(0.0).sqrt();
        if rates[s] > 0.0 { spread / rms(rates[s]) } else { f64::INFINITY }
    });
    let pace = pace.fold(f64::INFINITY, f64::min);
    let scales = scales.collect();
    let whole = tracks.iter().map(|t| t.time[t.n_samples() - 1] - t.time[0]).fold(0.0, f64::max);
    Ok((scales, if pace.is_finite() && pace > 0.0 { pace } else { whole }))
}

/// Mean sampling period, s.
fn period(track: &Track) -> f64 {
    (track.time[track.n_samples() - 1] - track.time[0]) / (track.n_samples() - 1) as f64
}
