//! Fits a rival effect of one size to clean runs: how much of the truth's gap does it leave?
//!
//! Gauss-Newton on the readings in units of the noise, over the rival's size and the start of every run (or window of
//! an unstable plant). The starts are projected out run by run, so that the size is a single number.

use crate::effect::{Act, Effect};
use crate::gap::{Log, Ruler, least_squares};
use crate::simulate::{Commands, Machine, Setup};

/// A rival: an effect for every size; 0 is no effect at all.
pub struct Rival {
    /// Catalogue id.
    pub id: &'static str,
    /// The effect of a size.
    pub at: Box<dyn Fn(f64) -> Effect + Send + Sync>,
    /// A size at which it is well seen.
    pub usual: f64,
    /// Free numbers of the catalogue form.
    pub numbers: usize,
    /// Does it need the commands before a window?
    pub remembers: bool,
}

/// A piece of a run with its fitted start.
struct Piece {
    times: Vec<f64>,
    controls: Vec<Vec<f64>>,
    readings: Vec<Vec<f64>>,
    start: Vec<f64>,
    linear: bool,
}

/// Runs to which rivals are fitted.
pub struct Contest<'a> {
    ruler: &'a Ruler<'a>,
    pieces: Vec<Piece>,
    /// Residuals and start slopes of the nominal rollouts, by piece.
    nominal: Vec<(Vec<f64>, Vec<Vec<f64>>)>,
    /// Squares that the nominal model leaves.
    pub gap: f64,
    /// Values compared.
    pub count: usize,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// `b` without what the columns cover, and the coefficients of these.
fn project(columns: &[Vec<f64>], b: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let a = least_squares(columns, b)?;
    let mut rest = b.to_vec();
    for (column, a) in columns.iter().zip(&a) {
        for (r, c) in rest.iter_mut().zip(column) {
            *r -= a * c;
        }
    }
    Some((rest, a))
}

impl<'a> Contest<'a> {
    /// Opens a contest on some logs.
    pub fn new(ruler: &'a Ruler<'a>, logs: &[Log], linear: bool) -> Option<Self> {
        let mut pieces = Vec::new();
        for log in logs {
            for window in ruler.windows(log.times) {
                pieces.push(Piece {
                    times: log.times[window.clone()].to_vec(),
                    controls: log.trace.controls[window.clone()].to_vec(),
                    readings: log.trace.readings[window.clone()].to_vec(),
                    start: log.trace.states[window.start].clone(),
                    linear,
                });
            }
        }
        let mut contest = Self { ruler, pieces, nominal: Vec::new(), gap: 0.0, count: 0 };
        // The nominal model's own best starts first.
        for p in 0..contest.pieces.len() {
            for _ in 0..3 {
                let residual = contest.residual(p, &contest.pieces[p].start, &[])?;
                let slopes = contest.slopes(p, &contest.pieces[p].start.clone(), &[], &residual)?;
                let step = least_squares(&slopes, &residual)?;
                let moved = contest.moved(p, &step);
                let Some(there) = contest.residual(p, &moved, &[]) else { break };
                if dot(&there, &there) > 0.999 * dot(&residual, &residual) {
                    break;
                }
                contest.pieces[p].start = moved;
            }
            let residual = contest.residual(p, &contest.pieces[p].start, &[])?;
            let slopes = contest.slopes(p, &contest.pieces[p].start.clone(), &[], &residual)?;
            contest.gap += dot(&residual, &residual);
            contest.count += residual.len();
            contest.nominal.push((residual, slopes));
        }
        Some(contest)
    }

    fn moved(&self, p: usize, step: &[f64]) -> Vec<f64> {
        self.pieces[p].start.iter().zip(step).zip(self.ruler.scale).map(|((x, s), scale)| x - s * scale).collect()
    }

    fn residual(&self, p: usize, start: &[f64], effects: &[Effect]) -> Option<Vec<f64>> {
        let piece = &self.pieces[p];
        let setup = Setup {
            times: piece.times.clone(),
            start: start.to_vec(),
            commands: Commands::Open(piece.controls.clone()),
            linear: piece.linear,
        };
        let trace = Machine::new(self.ruler.plant, effects, self.ruler.scale, 1e-7).run(&setup)?;
        let mut residual = Vec::with_capacity(piece.times.len() * self.ruler.noise.len());
        for (model, real) in trace.readings.iter().zip(&piece.readings) {
            for (&i, noise) in self.ruler.plant.logged.iter().zip(self.ruler.noise) {
                residual.push((real[i] - model[i]) / noise);
            }
        }
        residual.iter().all(|r| r.is_finite()).then_some(residual)
    }

    /// Slopes of the residual by every start value, in units of its scale.
    fn slopes(&self, p: usize, start: &[f64], effects: &[Effect], here: &[f64]) -> Option<Vec<Vec<f64>>> {
        let h = 1e-4;
        (0..start.len())
            .map(|i| {
                let mut moved = start.to_vec();
                moved[i] += h * self.ruler.scale[i];
                let there = self.residual(p, &moved, effects)?;
                Some(there.iter().zip(here).map(|(a, b)| (a - b) / h).collect())
            })
            .collect()
    }

    /// Share of the nominal gap that the rival leaves to first order: `sin^2` of the angle between the two.
    pub fn screen(&self, rival: &Rival) -> Option<(f64, f64)> {
        let small = 0.05 * rival.usual;
        let (mut rr, mut rj, mut jj) = (0.0, 0.0, 0.0);
        for p in 0..self.pieces.len() {
            let (residual, slopes) = &self.nominal[p];
            let there = self.residual(p, &self.pieces[p].start, &[(rival.at)(small)])?;
            let slope: Vec<f64> = there.iter().zip(residual).map(|(a, b)| (a - b) / small).collect();
            let (slope, _) = project(slopes, &slope)?;
            let (rest, _) = project(slopes, residual)?;
            rr += dot(&rest, &rest);
            rj += dot(&rest, &slope);
            jj += dot(&slope, &slope);
        }
        if jj <= 0.0 || rr <= 0.0 {
            return None;
        }
        Some((1.0 - rj * rj / (rr * jj), -rj / jj))
    }

    /// Squares left by the rival at its best size, from a first guess of it.
    pub fn fit(&self, rival: &Rival, guess: f64) -> Option<f64> {
        let mut size = guess;
        let mut starts: Vec<Vec<f64>> = self.pieces.iter().map(|p| p.start.clone()).collect();
        let total = |size: f64, starts: &[Vec<f64>]| -> Option<(f64, Vec<Vec<f64>>)> {
            let effects = [(rival.at)(size)];
            let list: Option<Vec<Vec<f64>>> =
                (0..starts.len()).map(|p| self.residual(p, &starts[p], &effects)).collect();
            let list = list?;
            Some((list.iter().map(|r| dot(r, r)).sum(), list))
        };
        let (mut left, mut residuals) = total(size, &starts)?;
        for _ in 0..12 {
            let effects = [(rival.at)(size)];
            let h = 1e-4 * size.abs().max(1e-2 * rival.usual);
            let beside = [(rival.at)(size + h)];
            let (mut rj, mut jj) = (0.0, 0.0);
            let mut parts = Vec::new();
            for p in 0..self.pieces.len() {
                let slopes = self.slopes(p, &starts[p], &effects, &residuals[p])?;
                let there = self.residual(p, &starts[p], &beside)?;
                let slope: Vec<f64> = there.iter().zip(&residuals[p]).map(|(a, b)| (a - b) / h).collect();
                let (slope, b) = project(&slopes, &slope)?;
                let (rest, a) = project(&slopes, &residuals[p])?;
                rj += dot(&rest, &slope);
                jj += dot(&slope, &slope);
                parts.push((a, b));
            }
            let step = if jj > 0.0 { rj / jj } else { 0.0 };
            let mut better = None;
            for shorter in [1.0, 0.5, 0.2, 0.05] {
                let moved: Vec<Vec<f64>> = starts
                    .iter()
                    .zip(&parts)
                    .map(|(start, (a, b))| {
                        let shift = |i: usize| shorter * (a[i] - b[i] * step) * self.ruler.scale[i];
                        (0..start.len()).map(|i| start[i] - shift(i)).collect()
                    })
                    .collect();
                if let Some((new, list)) = total(size - shorter * step, &moved)
                    && new < left
                {
                    better = Some((size - shorter * step, moved, new, list));
                    break;
                }
            }
            let Some((new_size, moved, new, list)) = better else { break };
            let done = new > 0.999 * left || left - new < 0.05;
            (size, starts, left, residuals) = (new_size, moved, new, list);
            if done {
                break;
            }
        }
        Some(left)
    }
}

/// The amplitude of an act times a factor.
pub fn scaled(act: Act, f: f64) -> Act {
    match act {
        Act::Constant { c } => Act::Constant { c: c * f },
        Act::Linear { z, c } => Act::Linear { z, c: c * f },
        Act::Quadratic { z, c } => Act::Quadratic { z, c: c * f },
        Act::Cubic { z, c } => Act::Cubic { z, c: c * f },
        Act::Sine { z, c, n, phase } => Act::Sine { z, c: c * f, n, phase },
        Act::Product { z, w, c } => Act::Product { z, w, c: c * f },
        Act::Periodic { c, omega, phase } => Act::Periodic { c: c * f, omega, phase },
        Act::Step { c, t0 } => Act::Step { c: c * f, t0 },
        Act::Drift { c } => Act::Drift { c: c * f },
        Act::Contact { z, c, edge, side } => Act::Contact { z, c: c * f, edge, side },
        Act::Exponential { z, c, edge, w } => Act::Exponential { z, c: c * f, edge, w },
        Act::Inverse { z, c, w } => Act::Inverse { z, c: c * f, w },
        Act::Triple { a, b, d, c } => Act::Triple { a, b, d, c: c * f },
        other => other,
    }
}
