//! Online identification, which the paper leaves open: every sample updates the smoothing and the model at a cost that does
//! not grow with the log.
//!
//! Gaussian processes of Matern kernels smooth the newest samples; their hyperparameters are fitted again as the log grows.
//! Once later samples no longer change a smoothed state, its row of the weak form is added to triangular factors, and terms
//! are selected from these factors alone. While the whole log fits into the window, each new fit starts over from all
//! samples, so that short logs lose no information.

mod accumulate;
mod estimate;
mod reach;
mod recent;
mod report;
mod settings;
mod smoothing;

use crate::data::{Channel, Dataset};
use crate::error::{Error, Result};
use crate::identify::equations::{DelayValue, Equations};
use crate::identify::limits::online::{FIRST_FIT, REACH};
use crate::identify::result::Identification;
use crate::library::Library;
use accumulate::Accumulator;
pub use estimate::Estimate;
use recent::{Recent, Sample};
pub use settings::OnlineSettings;
use smoothing::Smoothing;
use std::sync::Arc;

/// A model that follows a log as it grows.
///
/// ```
/// use gpsindy_core::{Channel, Online, OnlineSettings, library::LibrarySettings};
/// let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
/// let mut online = Online::new(OnlineSettings { states: vec![Channel::new("x")], library, ..Default::default() })?;
/// for i in 0..300 {
///     let t = 0.02 * f64::from(i);
///     online.update(t, &[3.0 * (-0.5 * t).exp()], &[])?;
/// }
/// let found = online.identification()?;
/// assert_eq!(found.states[0].terms, ["x"]);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Online {
    settings: OnlineSettings,
    /// Names, allowed terms and delays; coefficients are 0.
    frame: Equations,
    recent: Recent,
    smoothing: Option<Smoothing>,
    rows: Accumulator,
    /// Number of the first sample that was not taken in yet.
    next: usize,
    /// Samples of which all controls were known.
    n_samples: usize,
    /// Number of samples at the last fit of hyperparameters, and at the next.
    last_fit: usize,
    next_fit: usize,
    /// Length of the stretches by the first window of samples, s; a small change would only part the log otherwise.
    stretch: Option<f64>,
    /// Number of the run that the next sample belongs to.
    run: usize,
    /// Last values of states and controls, for angles and held controls; NaN before the first.
    last: Vec<f64>,
    /// Time of the last sample of this run, s.
    time: Option<f64>,
}

impl OnlineSettings {
    /// The same model from a whole log at once: one fit of hyperparameters to all of it, smoothing by all samples, the same
    /// rows and the same choice. What [`Online`] comes to is compared with this.
    ///
    /// # Errors
    /// As [`Online::new`] and [`Online::update`]; columns that the data lack.
    pub fn fit(&self, data: &Dataset) -> Result<Identification> {
        let mut online = Online::new(self.clone())?;
        let names = |channels: &[Channel]| channels.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        let states = data.indices_of(&names(&self.states))?;
        let controls = data.indices_of(&names(&self.controls))?;
        for run in data.runs() {
            online.begin_run()?;
            for (i, &t) in run.time.iter().enumerate() {
                let pick = |columns: &[usize]| columns.iter().map(|&c| run.values[(i, c)]).collect::<Vec<_>>();
                if online.push(t, &pick(&states), &pick(&controls))? && online.n_samples == self.window {
                    // The length of the stretches is that of the first window.
                    online.fit_again(usize::MAX)?;
                    online.smoothing = None;
                }
            }
        }
        online.fit_again(usize::MAX)?;
        online.identification()
    }
}

impl Online {
    /// Ready for the first sample.
    ///
    /// # Errors
    /// No state, a name twice or unknown, a setting out of its range, a term that can't be read.
    pub fn new(settings: OnlineSettings) -> Result<Self> {
        settings.check()?;
        let names = |channels: &[Channel]| channels.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        let (states, controls) = (names(&settings.states), names(&settings.controls));
        let library = Arc::new(Library::new(&states, &controls, &settings.library)?);
        let constraints = &settings.constraints;
        constraints.check(&states, &library)?;
        if !constraints.kept.is_empty() {
            return Err(Error::settings("online identification keeps no terms for certain; leave them out"));
        }
        let (n, m, p) = (states.len(), controls.len(), library.n_terms());
        let delays = settings.delay_values().iter().map(|&value| DelayValue::known(value, 0.0)).collect();
        let frame = Equations::new(&settings.states, &settings.controls, &library, constraints, delays)?;
        Ok(Self {
            rows: Accumulator::new(n, p, settings.memory),
            settings,
            frame,
            recent: Recent::default(),
            smoothing: None,
            next: 0,
            n_samples: 0,
            last_fit: 0,
            next_fit: FIRST_FIT,
            stretch: None,
            run: 0,
            last: vec![f64::NAN; n + m],
            time: None,
        })
    }

    /// Takes one sample at time `t` (s): `states` (n) and `controls` (m), NaN where a value is missing.
    ///
    /// A missing control holds its last value; samples before the first value of every control are left out. Returns
    /// whether rows were added to the regression, so that a look at the model pays.
    ///
    /// # Errors
    /// Another number of values, an infinite one, a time that does not increase within a run; a term that has no finite
    /// value. A sample that was refused for its size, values or time changes nothing.
    pub fn update(&mut self, t: f64, states: &[f64], controls: &[f64]) -> Result<bool> {
        if !self.push(t, states, controls)? {
            return Ok(false);
        }
        if self.n_samples >= self.next_fit {
            self.fit_again(self.settings.window / REACH)?;
            self.drop_old();
            return Ok(self.smoothing.is_some());
        }
        let news = self.take_settled()?;
        self.drop_old();
        Ok(news)
    }

    /// Ends the run: the next sample may have any time and is not joined to the last one.
    ///
    /// # Errors
    /// A term that has no finite value at the last samples.
    pub fn begin_run(&mut self) -> Result<()> {
        let end = self.recent.end();
        self.take(end)?;
        self.rows.close();
        self.run += 1;
        self.time = None;
        self.last.fill(f64::NAN);
        Ok(())
    }

    /// Samples taken so far.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Samples by which the regression is behind, and that a smoothed value depends on; 0 before the first fit.
    pub fn lag(&self) -> usize {
        self.smoothing.as_ref().map_or(0, |s| s.lag)
    }

    /// Samples that are held; bounded, whatever the length of the log.
    pub fn n_kept(&self) -> usize {
        self.recent.len()
    }

    /// Where every state is at the newest sample, by all samples so far.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`] before the first fit of hyperparameters.
    pub fn estimate(&self) -> Result<Vec<Estimate>> {
        self.smoothing.as_ref().ok_or_else(|| self.too_few())?.newest(&self.recent)
    }

    /// The model of all samples so far, the newest included.
    ///
    /// While the window holds the whole log this is what [`OnlineSettings::fit`] finds in it, but for the lag.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`] before the first fit of hyperparameters; those of [`Regressor::path`](crate::regress::Regressor::path).
    pub fn identification(&self) -> Result<Identification> {
        if self.recent.first() == 0 && self.n_samples > self.last_fit.max(FIRST_FIT) {
            let mut fresh = self.clone();
            fresh.fit_again(self.settings.window / REACH)?;
            return fresh.identification();
        }
        let Some(smoothing) = &self.smoothing else { return Err(self.too_few()) };
        let mut rows = self.rows.clone();
        if self.next < self.recent.end() {
            let tail = (self.next, self.recent.end());
            let block = smoothing.block_of(&self.recent, &self.frame.library, &self.settings, tail)?;
            rows.take(&block, smoothing.stretch)?;
        }
        report::report(&self.settings, &self.frame, smoothing, &rows)
    }

    fn too_few(&self) -> Error {
        let needed = FIRST_FIT.max(self.n_samples + 1);
        Error::TooFewSamples { what: "online identification".into(), needed, found: self.n_samples }
    }

    /// Checks a sample and puts it among the recent ones; whether it can be used.
    fn push(&mut self, t: f64, states: &[f64], controls: &[f64]) -> Result<bool> {
        let (n, m) = (self.settings.states.len(), self.settings.controls.len());
        if (states.len(), controls.len()) != (n, m) {
            let found = format!("{} and {}", states.len(), controls.len());
            return Err(Error::shape("sample", format!("{n} states and {m} controls"), found));
        }
        if !t.is_finite() {
            return Err(Error::NotFinite { what: "time of a sample".into() });
        }
        if let Some(before) = self.time.filter(|before| t <= *before) {
            return Err(Error::data(format!(
                "time must increase, but a sample at {before} s is followed by one at {t} s; sort the samples or begin a run"
            )));
        }
        let channels = self.settings.states.iter().chain(&self.settings.controls);
        for (channel, value) in channels.clone().zip(states.iter().chain(controls)) {
            if value.is_infinite() {
                return Err(Error::NotFinite { what: format!("`{}` at t = {t} s", channel.name) });
            }
        }
        self.time = Some(t);
        let mut values: Vec<f64> = states.iter().chain(controls).copied().collect();
        for ((channel, value), last) in channels.zip(&mut values).zip(&mut self.last) {
            if last.is_finite() && value.is_finite() && self.settings.angles.contains(&channel.name) {
                *value -= std::f64::consts::TAU * ((*value - *last) / std::f64::consts::TAU).round();
            }
            if value.is_finite() {
                *last = *value;
            }
        }
        if self.last[n..].iter().any(|v| v.is_nan()) {
            return Ok(false);
        }
        values.truncate(n);
        self.recent.push(Sample { time: t, run: self.run, states: values, controls: self.last[n..].to_vec() });
        self.n_samples += 1;
        Ok(true)
    }

    /// Fits hyperparameters to the recent samples; goes through them again where they are the whole log.
    fn fit_again(&mut self, most_lag: usize) -> Result<()> {
        let most = self.settings.window;
        self.last_fit = self.n_samples;
        // Exactly when the window is full, and then by half windows.
        self.next_fit = if self.n_samples < most {
            (self.n_samples * 3 / 2).clamp(FIRST_FIT, most)
        } else {
            self.n_samples.saturating_add(most / 2)
        };
        let old = self.smoothing.as_ref();
        let Some(found) = Smoothing::new(&self.settings, &self.recent, old, self.stretch, most_lag)? else {
            return Ok(());
        };
        if self.n_samples == most {
            self.stretch = Some(found.stretch);
        }
        self.smoothing = Some(found);
        if self.recent.first() == 0 {
            let (n, p) = (self.frame.states.len(), self.frame.library.n_terms());
            self.rows = Accumulator::new(n, p, self.settings.memory);
            self.next = 0;
        }
        // Runs that have ended wait for nothing.
        while self.next < self.recent.end() && self.recent.get(self.next).run < self.run {
            self.take(self.recent.run_of(self.next).1)?;
            self.rows.close();
        }
        self.take_settled()?;
        Ok(())
    }

    /// Takes in the samples whose smoothed states no later sample changes; whether there were any.
    fn take_settled(&mut self) -> Result<bool> {
        let Some((lag, block)) = self.smoothing.as_ref().map(|s| (s.lag, s.block())) else { return Ok(false) };
        let mut news = false;
        while self.next.saturating_add(block).saturating_add(lag) <= self.recent.end() {
            self.take(self.next + block)?;
            news = true;
        }
        Ok(news)
    }

    /// Takes in the samples before number `to`, which are of one run.
    fn take(&mut self, to: usize) -> Result<()> {
        let Some(smoothing) = self.smoothing.as_ref().filter(|_| self.next < to) else { return Ok(()) };
        let block = smoothing.block_of(&self.recent, &self.frame.library, &self.settings, (self.next, to))?;
        self.rows.take(&block, smoothing.stretch)?;
        self.next = to;
        Ok(())
    }

    /// Drops samples that no step needs any more.
    fn drop_old(&mut self) {
        let spare = self.recent.end().saturating_sub(self.settings.window);
        if spare <= self.recent.first() {
            return;
        }
        let Some(smoothing) = &self.smoothing else {
            self.recent.drop_before(spare);
            self.next = self.next.max(spare);
            return;
        };
        let begin = self.next.saturating_sub(1).max(self.recent.first());
        let (start, _) = self.recent.run_of(begin.min(self.recent.end() - 1));
        let latest = self.settings.delay_values().into_iter().fold(0.0, f64::max);
        let late = self.recent.at_or_before(self.recent.get(begin).time - latest, start);
        self.recent.drop_before(spare.min(begin.saturating_sub(smoothing.lag)).min(late));
    }
}

#[cfg(test)]
mod tests;
