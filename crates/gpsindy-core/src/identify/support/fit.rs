//! Fits equations by simulation to the raw measurements: coefficients, delays and initial states.
//!
//! Source: Bock 1983, Recent advances in parameter identification techniques for ODE.

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::identify::algorithm1::made::Made;
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::algorithm1::track::Track;
use crate::identify::equations::Equations;
use crate::identify::evidence::price;
use crate::identify::limits::{FLOOR, HOPELESS, NEAR_CLEAN, NO_WEIGHT, NOISE_ROUNDS, NOISE_SETTLED};
use crate::identify::prepare::Logs;
use crate::model::System;
use crate::refine::{Experiment, Free, Hold, Jacobian, Point, Window};

/// What equations are fitted to, and how.
pub(crate) struct Fitter<'a> {
    pub(crate) data: &'a Dataset,
    /// Substeps of the integration between two samples.
    pub(crate) substeps: usize,
    /// What controls do between samples.
    pub(crate) hold: Hold,
    /// Noise of every state's column (then of given derivatives) to start from.
    pub(crate) noise: Vec<f64>,
    /// The runs smoothed: rollouts start on them.
    pub(crate) tracks: &'a [Track],
    /// Typical size of each coefficient (n x p).
    pub(crate) scales: &'a [Vec<f64>],
    /// States that no sensor measured.
    pub(crate) unmeasured: &'a [usize],
    /// Standard deviation of every smoothed state, 0 for one that does not move.
    pub(crate) spread: &'a [f64],
    /// The fits that were made to these logs.
    pub(crate) made: &'a Made,
}

/// A fitted set of equations.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    pub(crate) equations: Equations,
    /// Standard error of each coefficient (n x p), 0 where a term is out.
    pub(crate) errors: Vec<Vec<f64>>,
    /// Probability of each term of being in (n x p), of [`Fitter::weigh_choice`]; none before.
    pub(crate) inclusion: Vec<Vec<f64>>,
    /// Standard error of each delay that was estimated, then of each free number.
    pub(crate) delay_errors: Vec<f64>,
    /// The windows that were rolled out.
    pub(crate) windows: Vec<Window>,
    /// Initial state of every window.
    pub(crate) initial: Vec<Vec<f64>>,
    /// Root mean square residual of each column, in its unit.
    pub(crate) noise: Vec<f64>,
    /// Sum of squares and number of values of each column, in the column's unit.
    pub(crate) squares: Vec<f64>,
    pub(crate) counts: Vec<f64>,
    /// What the integration errs by in each column, in its unit: residuals below it carry no information.
    pub(crate) floor: Vec<f64>,
    /// Spread of each column, in its unit.
    pub(crate) sizes: Vec<f64>,
    /// Number of values compared.
    pub(crate) n_values: f64,
    /// Share of the values that count as independent.
    pub(crate) share: f64,
    pub(crate) converged: bool,
}

impl Trial {
    /// What its residuals cost where the noise of the columns is `noise`.
    fn cost_at(&self, noise: &[f64]) -> f64 {
        self.squares.iter().zip(noise).map(|(square, noise)| square / noise.powi(2)).sum()
    }

    /// Lets the errors allow for `rival`, the same equations under another assumption, of weight `weight` compared with 1.
    pub(crate) fn allow_for(&mut self, rival: &Self, weight: f64) {
        for s in 0..self.errors.len() {
            for j in 0..self.errors[s].len() {
                let (own, other) = (self.errors[s][j], rival.errors[s][j]);
                if own > 0.0 && other > 0.0 && other.is_finite() {
                    let apart = self.equations.coefficients[s][j] - rival.equations.coefficients[s][j];
                    let square = own.powi(2) + weight * (other.powi(2) + apart.powi(2));
                    self.errors[s][j] = (square / (1.0 + weight)).sqrt();
                }
            }
        }
    }
}

impl<'a> Fitter<'a> {
    pub(crate) fn new(logs: &'a Logs, motion: &'a Motion, hold: Hold) -> Self {
        Self {
            data: &logs.measured,
            unmeasured: &logs.unmeasured,
            spread: &motion.spread,
            substeps: motion.substeps(),
            hold,
            noise: motion.noise.clone(),
            tracks: &motion.tracks,
            scales: &motion.scales,
            made: &motion.made,
        }
    }

    /// The logs cut into windows of about `window` seconds.
    pub(crate) fn experiment(&self, system: &System, window: f64, noise: &[f64]) -> Result<Experiment> {
        let mut experiment = Experiment::new(system, self.data, Some(noise))?.with_windows_of(window);
        experiment.substeps = self.substeps;
        experiment.hold = self.hold;
        // What no sensor measured has no column that gives its size.
        for &s in self.unmeasured.iter().filter(|s| self.spread[**s] > 0.0) {
            experiment.scale[s] = self.spread[s];
        }
        Ok(experiment)
    }

    /// The system of `trial`, the logs in its windows of `window` seconds, and where the fit ended.
    pub(crate) fn fitted(&self, trial: &Trial, window: f64) -> Result<(System, Experiment, Point)> {
        let system = trial.equations.model_with_parameters().compile()?;
        let experiment = self.experiment(&system, window, &trial.noise)?;
        let point = Point { parameters: system.parameter_values(), initial: trial.initial.clone() };
        Ok((system, experiment, point))
    }

    /// Fits coefficients, delays and initial states of `equations`; `near` is a fit to start from.
    pub(crate) fn fit(&self, equations: &Equations, window: f64, near: Option<&Trial>) -> Result<Trial> {
        self.fit_unless_beaten(equations, window, near, None)
    }

    /// The same, ended where the first noise shows already that `rival` is the better by far, since another noise would not change that;
    /// and where steps lower a cost by little that is far above the rival's.
    pub(crate) fn fit_unless_beaten(
        &self,
        equations: &Equations,
        window: f64,
        near: Option<&Trial>,
        rival: Option<&Trial>,
    ) -> Result<Trial> {
        let mut noise = near.map_or_else(|| self.noise.clone(), |trial| trial.noise.clone());
        let system = equations.model_with_parameters().compile()?;
        let mut experiment = self.experiment(&system, window, &noise)?;
        // A window that begins where one of the earlier fit began starts from what that one found.
        let found = |w: &Window| {
            let place =
                |trial: &Trial| trial.windows.iter().position(|other| (other.log, other.first) == (w.log, w.first));
            near.and_then(|trial| place(trial).map(|k| trial.initial[k].clone()))
        };
        let initial = experiment.windows.iter().map(|w| found(w).unwrap_or_else(|| self.start(&system, w))).collect();
        let free = self.free(equations);
        let mut point = Point { parameters: system.parameter_values(), initial };
        let sizes: Vec<f64> = experiment.columns.iter().map(|&column| experiment.scale[column]).collect();
        let least: Vec<f64> = sizes.iter().map(|size| FLOOR * size).collect();
        let mut floor = least.clone();
        // Once with the noise assumed, and again if the residuals show another.
        for round in 0..NOISE_ROUNDS {
            let hopeless = rival.map_or(f64::INFINITY, |rival| HOPELESS * rival.cost_at(&noise));
            let ended = self.ended(equations, (&system, &experiment), &point, &free, hopeless)?;
            point = ended.point;
            let (squares, counts) = (ended.squares, ended.counts);
            if round == 0 {
                floor = integration_errors(&system, &experiment, &point, (&squares, &counts), least.clone());
            }
            let found: Vec<f64> = (0..noise.len())
                .map(|c| {
                    if counts[c] == 0.0 {
                        return noise[c];
                    }
                    let freedom = (counts[c]
                        - (free.len() + point.initial.len() * experiment.scale.len()) as f64 / noise.len() as f64)
                        .max(1.0);
                    (squares[c] / freedom).sqrt().max(floor[c])
                })
                .collect();
            let settled = found.iter().zip(&noise).all(|(new, old)| (new / old - 1.0).abs() < NOISE_SETTLED);
            noise.clone_from(&found);
            experiment.noise.clone_from(&found);
            let n: f64 = counts.iter().sum();
            let mut fitted = equations.clone();
            fitted.take(&point.parameters);
            let mut errors = vec![vec![0.0; equations.n_terms()]; equations.n_states()];
            for (k, (s, j)) in equations.support.iter().enumerate() {
                errors[s][j] = ended.errors[k];
            }
            let delay_errors = ended.errors[equations.support.len()..].to_vec();
            let trial = Trial {
                equations: fitted,
                errors,
                inclusion: Vec::new(),
                delay_errors,
                windows: experiment.windows.clone(),
                initial: point.initial.clone(),
                noise: noise.clone(),
                squares,
                counts,
                floor: floor.clone(),
                sizes: sizes.clone(),
                n_values: n,
                share: ended.share,
                converged: ended.converged,
            };
            let is_beaten = || rival.is_some_and(|rival| self.lead(&trial, rival) < -NO_WEIGHT);
            if settled || round + 1 == NOISE_ROUNDS || is_beaten() {
                return Ok(trial);
            }
        }
        Err(Error::NotConverged { what: "refinement".into(), why: "the noise does not settle; give it".into() })
    }

    /// Smoothed states at the start of a window; 0 for what represents a logged derivative.
    pub(crate) fn start(&self, system: &System, window: &Window) -> Vec<f64> {
        let track = &self.tracks[window.log];
        let value = |s: usize| if s < track.mean.ncols() { track.mean[(window.first, s)] } else { 0.0 };
        (0..system.n_states()).map(value).collect()
    }

    /// Mean squared error, in units of the noise, of rollouts from the smoothed states; infinite where one diverges.
    pub(crate) fn rollout_error(&self, equations: &Equations, window: f64) -> Result<f64> {
        let system = equations.model_with_parameters().compile()?;
        let experiment = self.experiment(&system, window, &self.noise)?;
        let initial = experiment.windows.iter().map(|w| self.start(&system, w)).collect();
        let point = Point { parameters: system.parameter_values(), initial };
        match Jacobian::new(&system, &experiment, &point, &[]) {
            Ok(jacobian) => Ok(jacobian.cost(&experiment, &point, &[]) / experiment.n_values() as f64),
            Err(Error::Diverged { .. }) => Ok(f64::INFINITY),
            Err(error) => Err(error),
        }
    }

    /// Mean squared error of rollouts of `window` seconds from the smoothed states, each state in units of its variance; none
    /// where one diverges. And the same of standing still. Nothing where no measured state moves.
    pub(crate) fn distance(&self, equations: &Equations, window: f64) -> Result<Option<(Option<f64>, f64)>> {
        let system = equations.model_with_parameters().compile()?;
        let experiment = self.experiment(&system, window, &self.noise)?;
        let initial: Vec<Vec<f64>> = experiment.windows.iter().map(|w| self.start(&system, w)).collect();
        let still = |(w, initial): (&Window, &Vec<f64>)| {
            let log = &experiment.logs[w.log];
            let of = |i: usize| experiment.columns.iter().enumerate().map(move |(c, &s)| (i, c, s));
            let off = |(i, c, s): (usize, usize, usize)| (log.measured[c][i] - initial[s]) / experiment.noise[c];
            (w.first..=w.last).flat_map(of).map(off).collect::<Vec<f64>>()
        };
        let still: Vec<Vec<f64>> = experiment.windows.iter().zip(&initial).map(still).collect();
        let relative = |residuals: &[Vec<f64>]| {
            let (squares, counts) = sums(&experiment, residuals);
            let moves = |c: &usize| *c < self.spread.len() && counts[*c] > 0.0 && self.spread[*c] > 0.0;
            let moving: Vec<usize> = (0..counts.len()).filter(moves).collect();
            let each = moving.iter().map(|&c| squares[c] / counts[c] / experiment.scale[experiment.columns[c]].powi(2));
            (!moving.is_empty()).then(|| each.sum::<f64>() / moving.len() as f64)
        };
        let Some(still) = relative(&still) else { return Ok(None) };
        let point = Point { parameters: system.parameter_values(), initial };
        match Jacobian::new(&system, &experiment, &point, &[]) {
            Ok(jacobian) => Ok(Some((relative(&jacobian.residuals()).filter(|v| v.is_finite()), still))),
            Err(Error::Diverged { .. }) => Ok(Some((None, still))),
            Err(error) => Err(error),
        }
    }

    /// By how much the evidence of `trial` is better than that of `other`; both count their values alike, by the larger
    /// share of independent ones, which is that of the better model, and both down to the same floor.
    pub(crate) fn lead(&self, trial: &Trial, other: &Trial) -> f64 {
        let scale = Scale::of(&[trial, other]);
        scale.evidence(other) - scale.evidence(trial)
    }

    /// Places of `trials`, the best evidence first.
    pub(crate) fn ranked<'t>(&self, trials: impl Iterator<Item = &'t Trial>) -> Vec<usize> {
        let trials: Vec<&Trial> = trials.collect();
        let scale = Scale::of(&trials);
        let evidence: Vec<f64> = trials.iter().map(|trial| scale.evidence(trial)).collect();
        let mut order: Vec<usize> = (0..trials.len()).collect();
        order.sort_by(|&x, &y| evidence[x].total_cmp(&evidence[y]));
        order
    }

    /// What a fit may change: the coefficients of the support, then the free delays, then the free numbers.
    pub(crate) fn free(&self, equations: &Equations) -> Vec<Free> {
        let mut free = Vec::new();
        for (s, j) in equations.support.iter() {
            let scale = self.scales[s][j].max(equations.coefficients[s][j].abs());
            let mut one = Free::new(free.len(), scale);
            match equations.signs[s][j] {
                Some(true) => one.lower = 0.0,
                Some(false) => one.upper = 0.0,
                None => {}
            }
            free.push(one);
        }
        for (_, delay) in equations.free_delays() {
            free.push(Free { lower: 0.0, upper: delay.most, ..Free::new(free.len(), delay.period) });
        }
        for k in equations.free_numbers() {
            let size = equations.library.numbers()[k].1.abs();
            let (lower, upper) = equations.bounds[k];
            let scale = if size > 0.0 { size } else { 1.0 };
            free.push(Free { lower, upper, ..Free::new(free.len(), scale) });
        }
        free
    }
}

/// What the evidence of several fits is counted by.
struct Scale {
    /// Share of the values that count as independent.
    share: f64,
    /// Root mean square residual below which nothing can be inferred, of each column.
    pub(crate) floor: Vec<f64>,
}

impl Scale {
    fn of(trials: &[&Trial]) -> Self {
        let columns = trials.first().map_or(0, |trial| trial.floor.len());
        let largest = |c: usize| trials.iter().map(|trial| trial.floor[c]).fold(0.0, f64::max);
        Self {
            share: trials.iter().map(|trial| trial.share).fold(0.0, f64::max),
            floor: (0..columns).map(largest).collect(),
        }
    }

    fn evidence(&self, trial: &Trial) -> f64 {
        let mean_square = |c: usize| (trial.squares[c] / trial.counts[c].max(1.0)).max(self.floor[c] * self.floor[c]);
        let misfit: f64 = (0..self.floor.len()).map(|c| trial.counts[c] * mean_square(c).ln()).sum();
        let equations = &trial.equations;
        let prices = equations.support.iter().map(|(_, j)| price(equations, j, self.share * trial.n_values));
        let numbers = equations.free_numbers().len() as f64 * (self.share * trial.n_values).max(2.0).ln();
        self.share * misfit + prices.sum::<f64>() + numbers
    }
}

/// Root mean square difference of the rollouts to those of half the steps, of each column; at least `least`.
///
/// Half the steps err by a sixteenth as much, so that the difference is the error itself. Where every column leaves far more
/// than any integration errs by, nothing is computed.
fn integration_errors(
    system: &System,
    experiment: &Experiment,
    point: &Point,
    (squares, counts): (&[f64], &[f64]),
    least: Vec<f64>,
) -> Vec<f64> {
    let size = |c: usize| experiment.scale[experiment.columns[c]];
    let is_small = |c: usize| counts[c] > 0.0 && (squares[c] / counts[c]).sqrt() < NEAR_CLEAN * size(c);
    if !(0..least.len()).any(is_small) {
        return least;
    }
    let finer = Experiment { substeps: 2 * experiment.substeps, ..experiment.clone() };
    let rolled = |experiment: &Experiment| Jacobian::new(system, experiment, point, &[]).map(|j| j.residuals());
    let (Ok(own), Ok(finer)) = (rolled(experiment), rolled(&finer)) else { return least };
    let pairs = own.iter().zip(&finer).map(|(own, finer)| own.iter().zip(finer).map(|(a, b)| a - b).collect());
    let (apart, counts) = sums(experiment, &pairs.collect::<Vec<Vec<f64>>>());
    least.into_iter().enumerate().map(|(c, least)| least.max((apart[c] / counts[c].max(1.0)).sqrt())).collect()
}

/// Sum of squares and number of values of each column, in the column's unit.
pub(crate) fn sums(experiment: &Experiment, residuals: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let columns = experiment.noise.len();
    let (mut squares, mut counts) = (vec![0.0; columns], vec![0.0; columns]);
    for window in residuals {
        for (i, value) in window.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            let c = i % columns;
            squares[c] += (value * experiment.noise[c]).powi(2);
            counts[c] += 1.0;
        }
    }
    (squares, counts)
}
