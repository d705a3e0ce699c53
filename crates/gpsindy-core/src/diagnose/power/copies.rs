//! Simulated copies of the user's logs: the same times, controls and gaps, the noise that the diagnosis found.

use crate::data::{Dataset, Run};
use crate::diagnose::catalogue::planting::Planted;
use crate::diagnose::fit::colours::colour::Colour;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::lagging::start_of;
use crate::diagnose::fit::tolerance::tolerated;
use crate::diagnose::limits::{Budget, CLOSE, COPIED, FAR_WEAKER, LEFT_LOG, RANGE, SHORTEST, STRONGER, WEAKER};
use crate::diagnose::report::PowerNoise;
use crate::diagnose::steps::logs::noise::resolution;
use crate::error::{Error, Result};
use crate::model::{Model, System};
use crate::random::normal;
use crate::refine::Experiment;
use crate::simulate::{Excitation, Simulate, StateReader};
use faer::Mat;
use rand_chacha::ChaCha8Rng;

/// A stretch of a log that is simulated from a state of its own.
#[derive(Debug, Clone)]
struct Piece {
    run: Run,
    initial: Vec<f64>,
    held_out: bool,
}

/// What the copies are made from.
pub(crate) struct Bench {
    nominal: System,
    channels: Vec<crate::data::Channel>,
    pieces: Vec<Piece>,
    /// (channel, state) of every logged column.
    columns: Vec<(usize, usize)>,
    noise: Vec<f64>,
    colours: Vec<Colour>,
    steps: Vec<f64>,
    simulate: Simulate,
    substeps: usize,
}

/// Clean readings of every piece: (r x n), one column a state.
pub(crate) type Readings = Vec<Mat<f64>>;

impl Bench {
    pub(crate) fn new(nominal: &Contestant, best: &Contestant, train: &Dataset, holdout: &Dataset) -> Result<Self> {
        let experiment = &best.experiment;
        let system = nominal.system.clone();
        let model = system.model();
        let columns = experiment
            .columns
            .iter()
            .map(|&state| Ok((train.index_of(&model.states[state].name)?, state)))
            .collect::<Result<Vec<_>>>()?;
        let steps = (0..columns.len()).map(|c| resolution(&experiment.logs, c)).collect();
        let mut bench = Self {
            nominal: system,
            channels: train.channels().to_vec(),
            pieces: Vec::new(),
            columns,
            noise: experiment.noise.clone(),
            colours: best.evidence.colours.clone(),
            steps,
            simulate: Simulate { hold: experiment.hold, tolerance: COPIED, ..Simulate::default() },
            substeps: experiment.substeps,
        };
        for (data, held_out) in [(train, false), (holdout, true)] {
            let names: Vec<&str> = train.channels().iter().map(|c| c.name.as_str()).collect();
            let order = data.indices_of(&names)?;
            for run in data.runs() {
                let values = Mat::from_fn(run.n_samples(), order.len(), |i, j| run.values[(i, order[j])]);
                bench.cut(&Run { values, ..run.clone() }, held_out)?;
            }
        }
        let missing = |held_out: bool| bench.pieces.iter().all(|p| p.held_out != held_out);
        if missing(false) || missing(true) {
            return Err(Error::model(
                "the nominal model leaves the logs within some samples, so its copies of them mean nothing; no power can be said",
            ));
        }
        Ok(bench)
    }

    /// Adds a run, in pieces short enough that the nominal model stays near the log.
    fn cut(&mut self, run: &Run, held_out: bool) -> Result<()> {
        let excitation = Excitation::of_run(&self.nominal, run, &self.channels, self.simulate.hold)?;
        let reader = StateReader::new(&self.nominal, run, &self.channels, &excitation)?;
        let mut parts = 1;
        loop {
            let pieces = (0..parts).map(|part| {
                let (first, last) = (part * run.n_samples() / parts, (part + 1) * run.n_samples() / parts);
                self.piece(run, first..last, &reader, held_out)
            });
            let pieces: Vec<Piece> = pieces.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
            let is_last = run.n_samples() / (2 * parts) < SHORTEST;
            if pieces.len() == parts || is_last {
                self.pieces.extend(pieces);
                return Ok(());
            }
            parts *= 2;
        }
    }

    /// A stretch of a run; `None` where the nominal model leaves the log.
    fn piece(
        &self,
        run: &Run,
        range: std::ops::Range<usize>,
        reader: &StateReader,
        held_out: bool,
    ) -> Result<Option<Piece>> {
        let initial = reader.at(range.start)?;
        let rows: Vec<usize> = range.clone().collect();
        let is_whole = rows.len() == run.n_samples();
        let name = if is_whole { run.name.clone() } else { format!("{} from {} s", run.name, run.time[range.start]) };
        let part = Run {
            name,
            time: run.time[range].to_vec(),
            values: Mat::from_fn(rows.len(), self.channels.len(), |i, j| run.values[(rows[i], j)]),
        };
        let piece = Piece { run: part, initial, held_out };
        let Ok(readings) = self.readings_of(&self.nominal, &piece) else { return Ok(None) };
        let near = self.columns.iter().all(|&(channel, state)| {
            let column = || piece.run.column(channel).iter().copied().filter(|v| v.is_finite());
            let (low, high) = column().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            let reach = LEFT_LOG * (high - low).max(RANGE * self.noise_of(state));
            (0..readings.nrows()).all(|i| (low - reach..=high + reach).contains(&readings[(i, state)]))
        });
        Ok(near.then_some(piece))
    }

    fn noise_of(&self, state: usize) -> f64 {
        self.columns.iter().zip(&self.noise).find(|(c, _)| c.1 == state).map_or(0.0, |(_, &noise)| noise)
    }

    fn readings_of(&self, system: &System, piece: &Piece) -> Result<Mat<f64>> {
        let excitation = Excitation::of_run(system, &piece.run, &self.channels, self.simulate.hold)?;
        let mut initial = piece.initial.clone();
        let model = system.model();
        let known = initial.clone();
        let first = |c: usize| {
            let channel = self.channels.iter().position(|channel| channel.name == model.controls[c].name);
            channel.and_then(|c| piece.run.column(c).iter().copied().find(|v| v.is_finite())).unwrap_or(0.0)
        };
        initial.extend(model.states[known.len()..].iter().map(|state| start_of(model, state, &known, first)));
        Ok(self.simulate.rollout(system, &excitation, &initial)?.outputs)
    }

    /// What the sensors would read of `model` without noise.
    pub(crate) fn readings(&self, model: &Model) -> Result<Readings> {
        let system = System::with_simulator(model, self.nominal.simulator().cloned())?;
        self.pieces.iter().map(|piece| self.readings_of(&system, piece)).collect()
    }

    /// Gap of readings to the nominal model, starts and tolerated parameters fitted, on the logs to learn from:
    /// root mean square over samples and columns in units of the noise. Infinite where the numbers refuse.
    pub(crate) fn gap(&self, planted: &Planted, strength: f64) -> f64 {
        let measure = || -> Result<f64> {
            let readings = self.readings(&planted.model(strength))?;
            let (data, _) = self.copies(&readings, None)?;
            let mut experiment = Experiment::new(&self.nominal, &data, Some(&self.noise))?;
            experiment.hold = self.simulate.hold;
            experiment.substeps = self.substeps;
            let initial: Vec<Vec<f64>> =
                self.pieces.iter().filter(|p| !p.held_out).map(|p| p.initial.clone()).collect();
            let values = self.nominal.parameter_values();
            let free = tolerated(self.nominal.model());
            let fit = Budget::Rough.refine().fit(&self.nominal, &experiment, &values, &free, Some(&initial))?;
            let residuals = || fit.residuals.iter().flatten().filter(|e| e.is_finite());
            Ok((residuals().map(|e| e * e).sum::<f64>() / residuals().count().max(1) as f64).sqrt())
        };
        measure().unwrap_or(f64::INFINITY)
    }

    /// The strength at which the gap is `target` times the noise, and that gap; `None` where none within reach is.
    pub(crate) fn strength(&self, planted: &Planted, target: f64, known: &mut Vec<(f64, f64)>) -> Option<(f64, f64)> {
        let (first, most) = planted.range();
        if !(first > 0.0 && most > 0.0) {
            return None;
        }
        let close = |gap: f64| (gap / target).ln().abs() < CLOSE;
        let mut next = first.min(most);
        for _ in 0..16 {
            if let Some(&hit) = known.iter().find(|k| close(k.1)) {
                return Some(hit);
            }
            // The gap grows with the strength: stay between the last one too small and the first too large.
            let below = known
                .iter()
                .filter(|k| k.1 < target)
                .fold(None, |best: Option<(f64, f64)>, k| if best.is_none_or(|b| k.0 > b.0) { Some(*k) } else { best });
            let above = known.iter().filter(|k| k.1 >= target).map(|k| k.0).fold(f64::INFINITY, f64::min);
            if let Some((strength, gap)) = below {
                if strength >= most {
                    return None;
                }
                let guess = strength * (target / gap.max(1e-9 * target)).clamp(STRONGER.0, STRONGER.1);
                next = if guess < above { guess.min(most) } else { (strength * above).sqrt() };
            } else if let Some(&(strength, gap)) = known.iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
                next = strength * if gap.is_finite() { (target / gap).clamp(WEAKER.0, WEAKER.1) } else { FAR_WEAKER };
            }
            known.push((next, self.gap(planted, next)));
        }
        // What no step hits (a delay of whole samples under a held control) is taken from the nearest above.
        known
            .iter()
            .copied()
            .filter(|k| k.1.is_finite() && k.1 > target && k.1 < 2.0 * target)
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Copies of the logs to learn from and of those to verify on, with noise where `random` gives some.
    pub(crate) fn copies(
        &self,
        readings: &Readings,
        mut random: Option<&mut ChaCha8Rng>,
    ) -> Result<(Dataset, Dataset)> {
        let (mut train, mut holdout) = (Vec::new(), Vec::new());
        for (piece, readings) in self.pieces.iter().zip(readings) {
            let mut run = piece.run.clone();
            for (c, &(channel, state)) in self.columns.iter().enumerate() {
                let noise = random.as_mut().map(|random| self.noise(c, run.n_samples(), random));
                for (i, value) in run.values.col_as_slice_mut(channel).iter_mut().enumerate() {
                    // A sample that the log misses is missing in its copy.
                    if value.is_finite() {
                        *value = readings[(i, state)];
                        if let Some(noise) = &noise {
                            *value = rounded(*value + noise[i], self.steps[c]);
                        }
                    }
                }
            }
            if piece.held_out { &mut holdout } else { &mut train }.push(run);
        }
        Ok((Dataset::new(self.channels.clone(), train)?, Dataset::new(self.channels.clone(), holdout)?))
    }

    /// Noise of column `c` in its unit, as coloured as the winner's residual where that is noise.
    fn noise(&self, c: usize, count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let colour = &self.colours[c];
        if !self.is_noise(c) {
            return (0..count).map(|_| self.noise[c] * normal(random)).collect();
        }
        let order = colour.coefficients.len();
        let run_in = 20 * order;
        let mut series: Vec<f64> = Vec::with_capacity(run_in + count);
        for _ in 0..run_in + count {
            let past = colour.coefficients.iter().zip(series.iter().rev());
            let predicted: f64 = past.map(|(a, e)| a * e).sum();
            series.push(predicted + colour.innovation.sqrt() * normal(random));
        }
        series[run_in..].iter().map(|e| e * self.noise[c]).collect()
    }

    fn is_noise(&self, c: usize) -> bool {
        self.colours[c].is_of_a_sensor()
    }

    /// The noise of the copies, for the report.
    pub(crate) fn noise_levels(&self) -> Vec<PowerNoise> {
        let states = &self.nominal.model().states;
        let one = |(c, &(_, state)): (usize, &(usize, usize))| {
            let variance = if self.is_noise(c) { self.colours[c].variance() } else { 1.0 };
            PowerNoise {
                state: states[state].name.clone(),
                rms: self.noise[c] * variance.sqrt(),
                coloured: self.is_noise(c) && !self.colours[c].coefficients.is_empty(),
                unit: states[state].unit.clone(),
            }
        };
        self.columns.iter().enumerate().map(one).collect()
    }
}

/// As a sensor of this step reads it; 0 is a sensor without steps.
fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}
