//! Copies of one MuJoCo model: many rows, each with parameters and a state of its own, shared out among threads.

use super::batch::Library;
use super::plan::Plan;
use super::simulations::Simulations;
use crate::native::length::Length;
use crate::native::rows::fit;
use crate::watch::lock;
use gpsindy_core::Rows;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Work of a call, s, from which on threads share it: handing a part over takes 6 us, and with 40 us of work two threads need two thirds of
/// the time of one.
const WORTH_THREADS: f64 = 4e-5;

/// Steps by which a model's cost is measured.
const TRIAL: usize = 100;

/// Copies of a MuJoCo model.
pub(crate) struct Copies {
    /// Of MuJoCo's package, which owns what the address is of.
    #[expect(dead_code, reason = "keeps the model")]
    model: Py<PyAny>,
    address: usize,
    plan: Arc<Plan>,
    library: Arc<Library>,
    /// What a step takes, s.
    cost: f64,
    /// Threads at most; 0: as many as there are.
    threads: usize,
    /// Simulations that no thread is stepping.
    idle: Mutex<Vec<Simulations>>,
}

impl Copies {
    pub(super) fn new(
        model: Py<PyAny>,
        address: usize,
        plan: Plan,
        library: Library,
        threads: usize,
    ) -> PyResult<Self> {
        let (plan, library) = (Arc::new(plan), Arc::new(library));
        let mut first = Simulations::new(&plan, &library, address)?;
        let begun = Instant::now();
        first.idle(TRIAL);
        let cost = begun.elapsed().as_secs_f64() / TRIAL as f64;
        // Where that left the engine's own states plays no part: only new ones have none.
        let idle = Mutex::new(vec![Simulations::new(&plan, &library, address)?]);
        Ok(Self { model, address, plan, library, cost, threads, idle })
    }

    /// States `next` (r x s x n) after each of `samples` s of `count` steps; `rows` has the commands and forces of each sample. Called
    /// without the interpreter.
    pub(crate) fn step(
        &self,
        rows: &Rows<'_>,
        (dt, samples, count): (&Length<'_>, usize, usize),
        next: &mut [f64],
    ) -> PyResult<()> {
        let n = self.plan.positions.len() + self.plan.velocities.len() + self.plan.activations;
        let columns = self.plan.base.as_ref().map_or(0, |base| base.columns);
        let (m, f, p) = (self.plan.commands.len() + columns, self.plan.velocities.len(), self.plan.settings.len());
        fit(rows, samples, [n, m, f, p], next).map_err(|why| PyValueError::new_err(format!("MuJoCo: {why}")))?;
        let work = (rows.count * samples * count) as f64 * self.cost;
        let threads = if self.threads == 0 { rayon::current_num_threads() } else { self.threads };
        let parts = if work < WORTH_THREADS { 1 } else { threads.clamp(1, rows.count.max(1)) };
        if parts == 1 || n == 0 {
            return self.alone(rows, (dt, samples, count), next);
        }
        let size = rows.count.div_ceil(parts);
        let part = |(part, next): (usize, &mut [f64])| {
            let (first, own) = (part * size, next.len() / (samples * n));
            let of = |all: &'_ [f64], width: usize| first * width..(first * width + own * width).min(all.len());
            let some = Rows {
                count: own,
                states: &rows.states[of(rows.states, n)],
                commands: &rows.commands[of(rows.commands, samples * m)],
                forces: &rows.forces[of(rows.forces, samples * f)],
                parameters: &rows.parameters[of(rows.parameters, p)],
            };
            let dt = match dt {
                Length::Of(dt) => Length::Of(*dt),
                Length::Each(dt) => Length::Each(&dt[first..first + own]),
            };
            self.alone(&some, (&dt, samples, count), next)
        };
        next.par_chunks_mut((size * samples * n).max(1)).enumerate().try_for_each(part)
    }

    /// The same by this thread.
    fn alone(&self, rows: &Rows<'_>, how: (&Length<'_>, usize, usize), next: &mut [f64]) -> PyResult<()> {
        let idle = lock(&self.idle).pop();
        let mut own = match idle {
            Some(idle) => idle,
            None => Simulations::new(&self.plan, &self.library, self.address)?,
        };
        let made = own.step(rows, how, next);
        lock(&self.idle).push(own);
        made
    }
}
