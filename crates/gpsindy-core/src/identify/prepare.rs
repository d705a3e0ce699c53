//! What an identification looks at: columns found, training part cut, states smoothed, rows of regression made.

use crate::data::{Channel, Dataset, Run};
use crate::differentiate::{Derivatives, Differentiation, SecondStage};
use crate::error::{Error, Result};
use crate::gp::Weakness;
use crate::identify::algorithm1::rows::{Builder, Rows, integrals, stretches};
use crate::identify::algorithm1::smooth::{roughness, smooth, unsmoothed};
use crate::identify::algorithm1::track::Track;
use crate::identify::support::equations::{DelayValue, Equations, rate_name};
use crate::identify::support::search::Search;
use crate::identify::{Delay, Identify, Target};
use crate::library::Library;
use crate::progress::Progress;
use crate::refine::Hold;
use crate::regress::Whitening;
use crate::smooth::{Noise, Smoother};
use faer::Mat;
use std::sync::Arc;

pub(crate) struct Plan {
    /// Training part: states, controls, then logged derivatives under their own names.
    data: Dataset,
    pub(crate) tracks: Vec<Track>,
    library: Arc<Library>,
    /// Pointwise derivatives, where the regression compares those.
    derivatives: Option<Derivatives>,
    /// Noise of every state's column, then of every logged derivative.
    pub(crate) noise: Vec<f64>,
    pub(crate) kernels: Vec<String>,
    pub(crate) notes: Vec<String>,
    /// Typical size of each coefficient (n x p).
    scales: Vec<Vec<f64>>,
    /// Standard deviation of every smoothed state over all runs, in its unit; 0 for one that stands still.
    pub(crate) spread: Vec<f64>,
    /// Time in which the fastest state changes by its own spread, s.
    pace: f64,
    /// Shortest mean sampling period of a run, s.
    pub(crate) period: f64,
}

impl Plan {
    pub(crate) fn new(settings: &Identify, data: &Dataset, progress: &dyn Progress) -> Result<Self> {
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
        let spread = spreads(&tracks);
        let (scales, pace) = sizes(&tracks, &library, &spread)?;
        let period = tracks.iter().map(period).fold(f64::INFINITY, f64::min);
        Ok(Self { data, tracks, library, derivatives: derived, noise, kernels, notes, scales, spread, pace, period })
    }

    pub(crate) fn n_states(&self) -> usize {
        self.kernels.len()
    }

    /// Equations without a term yet.
    pub(crate) fn equations(&self, settings: &Identify) -> Result<Equations> {
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
    pub(crate) fn shortest_window(&self) -> f64 {
        let longest = self.longest_run();
        let wanted = (3.0 * self.pace).max(10.0 * self.period);
        longest / (longest / wanted).max(1.0).log2().floor().exp2()
    }

    /// Length of the longest run, s.
    pub(crate) fn longest_run(&self) -> f64 {
        self.tracks.iter().map(|t| t.time[t.n_samples() - 1] - t.time[0]).fold(0.0, f64::max)
    }

    /// What the rows take the controls to do between samples.
    pub(crate) fn hold(&self) -> Hold {
        self.tracks[0].hold
    }

    /// Runge-Kutta steps between two samples; one of a twelfth of the pace errs by about 1e-6 of the state.
    pub(crate) fn substeps(&self) -> usize {
        ((12.0 * self.period / self.pace).ceil() as usize).clamp(1, 10)
    }

    pub(crate) fn search(&self, hold: Hold) -> Search<'_> {
        Search {
            data: &self.data,
            substeps: self.substeps(),
            hold,
            noise: self.noise.clone(),
            tracks: &self.tracks,
            scales: &self.scales,
        }
    }

    /// Rows of the regression of every state whose equation is not given.
    pub(crate) fn rows(&self, settings: &Identify, equations: &Equations) -> Result<Vec<Option<Rows>>> {
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
fn sizes(tracks: &[Track], library: &Library, spread: &[f64]) -> Result<(Vec<Vec<f64>>, f64)> {
    let (n, p) = (tracks[0].mean.ncols(), library.n_terms());
    let m = tracks[0].controls.ncols();
    let mut terms = vec![0.0; p];
    let mut rates = vec![0.0; n];
    let mut count = 0.0;
    for track in tracks {
        let theta = library.evaluate(track.samples(&vec![0.0; m]).as_ref(), &track.time)?;
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

/// Mean sampling period, s.
fn period(track: &Track) -> f64 {
    (track.time[track.n_samples() - 1] - track.time[0]) / (track.n_samples() - 1) as f64
}
