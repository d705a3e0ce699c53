//! The second look at the equations: coefficients by the integrator on the raw measurements, terms dropped, added and
//! exchanged by evidence.
//!
//! At a fit the trajectories are linear in all candidate coefficients to first order, so the search for a better support is
//! again a sparse regression, with the sensitivities of the trajectories as its columns; what it proposes is then fitted in full.
//!
//! Evidence: `sum_c n_c ln(rss_c / n_c) + sum_j (ln n + 2 ln p + 2 ln(a) (s_j - 1))`, n values, p candidate terms, s_j factors in
//! term j ([`crate::library::Term::complexity`]) and a symbols to write a factor with, one a variable and one for the end: the
//! length of the term's description. Of two terms that the logs can't tell apart the plainer one stays.
//!
//! Source: Bock 1983 (fit through the integrator); Chen and Chen 2008, Extended Bayesian information criteria.

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::identify::algorithm1::track::Track;
use crate::identify::support::equations::Equations;
use crate::identify::support::linear::Linear;
use crate::model::System;
use crate::refine::{Experiment, Free, Hold, Jacobian, Point, Refine, Window};

/// Rounds of drop, add and exchange.
pub(crate) const ROUNDS: usize = 25;

/// Evidence by which a support must lead to replace another: above the noise of the optimiser.
const LEAST_LEAD: f64 = 0.01;

/// Residuals below this share of a column's spread count as none: what is left is the integrator's.
const FLOOR: f64 = 1e-7;

/// Evidence by which equations must be worse to have no weight in the errors: odds of 1000.
const NEGLIGIBLE: f64 = 14.0;

/// How the search looks at the data.
pub(crate) struct Search<'a> {
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
}

/// A fitted set of equations.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    pub(crate) equations: Equations,
    /// Standard error of each coefficient (n x p), 0 where a term is out.
    pub(crate) errors: Vec<Vec<f64>>,
    /// Probability of each term of being in (n x p), of [`Search::weigh_choice`]; none before.
    pub(crate) inclusion: Vec<Vec<f64>>,
    /// Standard error of each delay that was estimated.
    pub(crate) delay_errors: Vec<f64>,
    /// The windows that were rolled out.
    pub(crate) windows: Vec<Window>,
    /// Initial state of every window.
    pub(crate) initial: Vec<Vec<f64>>,
    /// Root mean square residual of each column, in its unit.
    pub(crate) noise: Vec<f64>,
    /// `sum_c n_c ln(rss_c / n_c)`.
    misfit: f64,
    /// Number of values compared.
    n_values: f64,
    /// Share of the values that count as independent.
    pub(crate) share: f64,
    pub(crate) converged: bool,
}

impl Trial {
    /// Lets the errors allow for `rival`, the same equations under another assumption, of weight `weight` beside 1.
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

impl Search<'_> {
    /// The logs cut into windows of about `window` seconds.
    fn experiment(&self, system: &System, window: f64, noise: &[f64]) -> Result<Experiment> {
        let mut experiment = Experiment::new(system, self.data, Some(noise))?.with_windows_of(window);
        experiment.substeps = self.substeps;
        experiment.hold = self.hold;
        Ok(experiment)
    }

    /// The system of `trial`, the logs in its windows of `window` seconds, and where the fit ended.
    pub(crate) fn fitted(&self, trial: &Trial, window: f64) -> Result<(System, Experiment, Point)> {
        let system = trial.equations.model(&trial.equations.support(), true).compile()?;
        let experiment = self.experiment(&system, window, &trial.noise)?;
        let point = Point { parameters: system.parameter_values(), initial: trial.initial.clone() };
        Ok((system, experiment, point))
    }

    /// Fits coefficients, delays and initial states of `equations`; `near` is a fit to start from.
    pub(crate) fn fit(&self, equations: &Equations, window: f64, near: Option<&Trial>) -> Result<Trial> {
        let mut noise = near.map_or_else(|| self.noise.clone(), |trial| trial.noise.clone());
        let support = equations.support();
        let model = equations.model(&support, true);
        let system = model.compile()?;
        let mut experiment = self.experiment(&system, window, &noise)?;
        // A window that begins where one of the earlier fit began starts from what that one found.
        let found = |w: &Window| {
            let place =
                |trial: &Trial| trial.windows.iter().position(|other| (other.log, other.first) == (w.log, w.first));
            near.and_then(|trial| place(trial).map(|k| trial.initial[k].clone()))
        };
        let mut initial: Vec<Vec<f64>> =
            experiment.windows.iter().map(|w| found(w).unwrap_or_else(|| self.start(&system, w))).collect();
        let free = self.free(equations, &support);
        let mut parameters = system.parameter_values();
        let refine = Refine { max_iterations: 25, tolerance: 1e-5 };
        // Once with the noise assumed, and again where the residuals tell another.
        for round in 0..3 {
            let refined = refine.fit(&system, &experiment, &parameters, &free, Some(&initial))?;
            parameters.clone_from(&refined.parameters);
            initial.clone_from(&refined.initial);
            let (squares, counts) = sums(&experiment, &refined.residuals);
            let spread = &experiment.scale;
            let found: Vec<f64> = (0..noise.len())
                .map(|c| {
                    let freedom =
                        (counts[c] - (free.len() + initial.len() * spread.len()) as f64 / noise.len() as f64).max(1.0);
                    (squares[c] / freedom).sqrt().max(FLOOR * spread[experiment.columns[c]])
                })
                .collect();
            let settled = found.iter().zip(&noise).all(|(new, old)| (new / old - 1.0).abs() < 0.15);
            noise.clone_from(&found);
            experiment.noise.clone_from(&found);
            if !(settled || round == 2) {
                continue;
            }
            let share = independent_share(&refined.residuals, noise.len());
            let n: f64 = counts.iter().sum();
            let misfit: f64 = (0..noise.len())
                .map(|c| {
                    let least = FLOOR * spread[experiment.columns[c]];
                    counts[c] * (squares[c] / counts[c].max(1.0)).max(least * least).ln()
                })
                .sum();
            let mut fitted = equations.clone();
            fitted.take(&support, &parameters);
            let scaled = |k: usize| refined.covariance[k][k].max(0.0).sqrt();
            let mut errors = vec![vec![0.0; equations.n_terms()]; equations.n_states()];
            let mut k = 0;
            for (s, terms) in support.iter().enumerate() {
                for &j in terms {
                    errors[s][j] = scaled(k);
                    k += 1;
                }
            }
            let delay_errors = (k..free.len()).map(scaled).collect();
            let converged = refined.converged;
            let windows = experiment.windows;
            return Ok(Trial {
                equations: fitted,
                errors,
                inclusion: Vec::new(),
                delay_errors,
                windows,
                initial,
                noise,
                misfit,
                n_values: n,
                share,
                converged,
            });
        }
        Err(Error::NotConverged { what: "refinement".into(), why: "the noise does not settle; give it".into() })
    }

    /// Smoothed states at the start of a window; 0 for what stands for a logged derivative.
    fn start(&self, system: &System, window: &Window) -> Vec<f64> {
        let track = &self.tracks[window.log];
        let value = |s: usize| if s < track.mean.ncols() { track.mean[(window.first, s)] } else { 0.0 };
        (0..system.n_states()).map(value).collect()
    }

    /// Mean squared error, in units of the noise, of rollouts from the smoothed states; infinite where one diverges.
    pub(crate) fn rollout_error(&self, equations: &Equations, window: f64) -> Result<f64> {
        let system = equations.model(&equations.support(), true).compile()?;
        let experiment = self.experiment(&system, window, &self.noise)?;
        let initial = experiment.windows.iter().map(|w| self.start(&system, w)).collect();
        let point = Point { parameters: system.parameter_values(), initial };
        match Jacobian::new(&system, &experiment, &point, &[]) {
            Ok(jacobian) => Ok(jacobian.cost(&experiment, &point, &[]) / experiment.n_values() as f64),
            Err(Error::Diverged { .. }) => Ok(f64::INFINITY),
            Err(error) => Err(error),
        }
    }

    /// How much a difference between two starts grows up to the ends of the windows of `trial`, at most, each state in units of
    /// its spread.
    pub(crate) fn amplification(&self, trial: &Trial, window: f64) -> Result<f64> {
        let (system, experiment, point) = self.fitted(trial, window)?;
        let jacobian = Jacobian::new(&system, &experiment, &point, &[])?;
        let (columns, scale) = (&experiment.columns, &experiment.scale);
        let mut largest = 0.0_f64;
        for block in &jacobian.blocks {
            let last = block.residual.len() - columns.len();
            for (c, &column) in columns.iter().enumerate().filter(|(_, column)| **column < jacobian.n_states) {
                for (j, from) in scale.iter().enumerate() {
                    let growth = block.derivative[(last + c, j)].abs() * experiment.noise[c] * from / scale[column];
                    largest = largest.max(growth);
                }
            }
        }
        Ok(largest)
    }

    /// By how much the evidence of `trial` is better than that of `other`; both count their values alike, by the larger
    /// share of independent ones, which is that of the better model.
    pub(crate) fn lead(&self, trial: &Trial, other: &Trial) -> f64 {
        let share = trial.share.max(other.share);
        self.evidence(other, share) - self.evidence(trial, share)
    }

    /// Places of `trials`, the best evidence first.
    pub(crate) fn ranked<'t>(&self, trials: impl Iterator<Item = &'t Trial>) -> Vec<usize> {
        let trials: Vec<&Trial> = trials.collect();
        let share = trials.iter().map(|trial| trial.share).fold(0.0, f64::max);
        let evidence: Vec<f64> = trials.iter().map(|trial| self.evidence(trial, share)).collect();
        let mut order: Vec<usize> = (0..trials.len()).collect();
        order.sort_by(|&x, &y| evidence[x].total_cmp(&evidence[y]));
        order
    }

    fn evidence(&self, trial: &Trial, share: f64) -> f64 {
        let support = trial.equations.support();
        let terms = support.iter().flatten();
        share * trial.misfit + terms.map(|&j| self.price(&trial.equations, j, share * trial.n_values)).sum::<f64>()
    }

    /// What term `j` must bring, in evidence.
    pub(crate) fn price(&self, equations: &Equations, j: usize, n: f64) -> f64 {
        let complexity = equations.library.terms()[j].complexity() as f64;
        let symbols = (equations.states.len() + equations.controls.len() + 1) as f64;
        let candidates = equations.n_candidates().max(1) as f64;
        n.max(2.0).ln() + 2.0 * candidates.ln() + 2.0 * symbols.ln() * (complexity - 1.0)
    }

    pub(crate) fn free(&self, equations: &Equations, terms: &[Vec<usize>]) -> Vec<Free> {
        let mut free = Vec::new();
        for (s, terms) in terms.iter().enumerate() {
            for &j in terms {
                let scale = self.scales[s][j].max(equations.coefficients[s][j].abs());
                let mut one = Free::new(free.len(), scale);
                match equations.signs[s][j] {
                    Some(true) => one.lower = 0.0,
                    Some(false) => one.upper = 0.0,
                    None => {}
                }
                free.push(one);
            }
        }
        for (_, delay) in equations.free_delays() {
            free.push(Free { lower: 0.0, upper: delay.most, ..Free::new(free.len(), delay.period) });
        }
        free
    }

    /// Drops, adds and exchanges terms while that lowers the evidence.
    pub(crate) fn improve(&self, start: Trial, window: f64, keep_going: &dyn Fn() -> Result<()>) -> Result<Trial> {
        let mut best = start;
        for _ in 0..ROUNDS {
            keep_going()?;
            let linear = self.linearise(&best, window)?;
            let mut found = None;
            for support in linear.proposals() {
                let Some(trial) = self.attempt(&best, &linear, &support, window) else { continue };
                if self.lead(&trial, &best) > LEAST_LEAD {
                    found = Some(trial);
                    break;
                }
            }
            match found {
                Some(trial) => best = trial,
                None => break,
            }
        }
        Ok(best)
    }

    /// The full fit of `support`, from where the linear problem has its optimum; where no term leaves also from where
    /// `best` stands, since the linear optimum may lie too far away to be one.
    fn attempt(&self, best: &Trial, linear: &Linear, support: &[usize], window: f64) -> Option<Trial> {
        let (solution, initial) = linear.solution(support, &best.initial);
        let mut equations = best.equations.clone();
        equations.set_support(support, &solution);
        let near = Trial { initial, ..best.clone() };
        let far = self.fit(&equations, window, Some(&near)).ok();
        if linear.active.iter().any(|k| !support.contains(k)) {
            return far;
        }
        let mut coefficients = best.equations.coefficients.clone();
        for &k in support {
            let (s, j) = linear.candidates[k];
            if coefficients[s][j] == 0.0 {
                coefficients[s][j] = 1e-9 * self.scales[s][j].copysign(solution[s][j]);
            }
        }
        let mut equations = best.equations.clone();
        equations.set_support(support, &coefficients);
        let close = self.fit(&equations, window, Some(best)).ok();
        match (far, close) {
            (Some(far), Some(close)) => Some(if self.lead(&far, &close) >= 0.0 { far } else { close }),
            (far, close) => far.or(close),
        }
    }

    /// Lets the standard errors allow for the choice of the terms: over the equations one move away that hold the term,
    /// weighted by their evidence, `sqrt(sum_m w_m (error_m^2 + (value_m - value)^2))`. And the probability of every term by
    /// the same weights: `1 / (1 + sum of w over the moves that take it out)`, `1 - 1 / (1 + sum of w over those that bring it)`.
    ///
    /// Source: Buckland, Burnham and Augustin 1997, Model selection: an integral part of inference.
    pub(crate) fn weigh_choice(&self, trial: &mut Trial, window: f64) -> Result<()> {
        let linear = self.linearise(trial, window)?;
        let mut moved = vec![0.0; linear.candidates.len()];
        let told = |support: &[usize]| {
            let terms = linear.with_always(support);
            let errors = linear.problem.standard_errors(&terms, 1.0);
            (linear.problem.refit(&terms).coefficients, terms.into_iter().zip(errors).collect::<Vec<_>>())
        };
        let (best, _) = told(&linear.active);
        let mut sums: Vec<(f64, f64)> = linear
            .candidates
            .iter()
            .map(|&(s, j)| if trial.errors[s][j] > 0.0 { (1.0, trial.errors[s][j].powi(2)) } else { (0.0, 0.0) })
            .collect();
        let rivals = linear.moves(&linear.active).into_iter().map(|(change, support)| (trial.share * change, support));
        for (change, support) in rivals.take_while(|(change, _)| *change < NEGLIGIBLE) {
            let weight = (-0.5 * change).exp().min(1.0);
            for (k, sum) in moved.iter_mut().enumerate() {
                *sum += if linear.active.contains(&k) == support.contains(&k) { 0.0 } else { weight };
            }
            let (values, errors) = told(&support);
            let known = |k: usize, error: f64| error.is_finite() && sums.get(k).is_some_and(|sum| sum.0 > 0.0);
            let known: Vec<(usize, f64)> = errors.into_iter().filter(|&(k, error)| known(k, error)).collect();
            for (k, error) in known {
                sums[k].0 += weight;
                sums[k].1 += weight * (error.powi(2) + (values[k] - best[k]).powi(2));
            }
        }
        for (&(s, j), (weight, square)) in linear.candidates.iter().zip(sums).filter(|(_, sum)| sum.0 > 0.0) {
            trial.errors[s][j] = (square / weight).sqrt();
        }
        trial.inclusion = vec![vec![0.0; trial.equations.n_terms()]; trial.equations.n_states()];
        for (k, (&(s, j), sum)) in linear.candidates.iter().zip(moved).enumerate() {
            let stays = 1.0 / (1.0 + sum);
            trial.inclusion[s][j] = if linear.active.contains(&k) { stays } else { 1.0 - stays };
        }
        Ok(())
    }
}

/// Sum of squares and number of values of each column, in the column's unit.
fn sums(experiment: &Experiment, residuals: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
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

/// `(1 - rho) / (1 + rho)` with rho the lag-one autocorrelation of the residuals, between 0.02 and 1.
///
/// Where the model is not the truth its residuals are slow, and n of them tell less than n.
pub(crate) fn independent_share(residuals: &[Vec<f64>], columns: usize) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for window in residuals {
        for (now, next) in window.iter().zip(window.iter().skip(columns)) {
            if now.is_finite() && next.is_finite() {
                product += now * next;
                square += 0.5 * (now * now + next * next);
            }
        }
    }
    let rho = if square > 0.0 { (product / square).clamp(0.0, 0.99) } else { 0.0 };
    ((1.0 - rho) / (1.0 + rho)).max(0.02)
}
