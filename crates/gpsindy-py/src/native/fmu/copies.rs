//! Copies of one FMU: many rows, each with parameters and a state of its own.

use super::component::Component;
use super::failure::Failure;
use super::instance::Instance;
use super::unit::References;
use crate::native::length::Length;
use crate::native::rows::fit;
use crate::watch::lock;
use gpsindy_core::Rows;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Instances that are kept at most, each with parameters of its own.
const KEPT: usize = 64;

/// Work of a call, s, from which on processes share it: ten times what it takes to hand a thousand rows over and back.
const WORTH_PROCESSES: f64 = 5e-3;

/// What a step takes at least, s, where processes share them: ten times what it takes to hand its row over. The processes also take a third
/// of a second to start, which shorter steps would hardly earn back.
const SHARED_STEP: f64 = 5e-6;

/// Instances of an unpacked FMU, as many as there are parameters.
pub(crate) struct Copies {
    /// Makes an instance of fmpy.
    pub(super) instantiate: Py<PyAny>,
    pub(super) name: String,
    /// Of FMI 2, not 3.
    pub(super) two: bool,
    pub(super) references: Arc<References>,
    /// Number of event indicators of model exchange; None as co-simulation.
    pub(super) indicators: Option<usize>,
    /// Bits of what a step takes, s: the least of all calls, as some make instances. NaN before the first, which is not shared.
    pub(super) cost: AtomicU64,
    /// Waited for without the interpreter only: an FMU calls back into Python.
    pub(super) kept: Mutex<Kept>,
}

/// Instances by the bits of their parameters.
#[derive(Default)]
pub(super) struct Kept {
    instances: HashMap<Vec<u64>, (Instance, usize)>,
    /// How often an instance was asked for.
    uses: usize,
}

impl Copies {
    /// Whether so many steps are worth processes.
    pub(crate) fn is_long(&self, steps: usize) -> bool {
        let cost = f64::from_bits(self.cost.load(Ordering::Relaxed));
        cost >= SHARED_STEP && steps as f64 * cost >= WORTH_PROCESSES
    }

    /// States `next` (r x s x n) after each of `samples` s of `count` steps; `rows` has the commands and forces of each sample. Called
    /// without the interpreter.
    pub(crate) fn step(
        &self,
        rows: &Rows<'_>,
        (dt, samples, count): (&Length<'_>, usize, usize),
        next: &mut [f64],
    ) -> PyResult<()> {
        let n = self.references.states.len();
        let m = self.references.n_controls;
        let f = self.references.inputs.len() - m;
        let p = self.references.parameters.len();
        let held = rows.count * samples;
        fit(rows, samples, [n, m, f, p], next).map_err(|why| PyValueError::new_err(format!("{}: {why}", self.name)))?;
        let kept = &mut *lock(&self.kept);
        let begun = Instant::now();
        let (mut state, mut inputs) = (vec![0.0; n], Vec::with_capacity(m + f));
        let mut row = 0;
        while row < rows.count {
            let own = |row: usize| &rows.parameters[row * p..(row + 1) * p];
            let instance = kept.instance(self, own(row))?;
            let first = row;
            while row < rows.count && own(row).iter().zip(own(first)).all(|(a, b)| a.to_bits() == b.to_bits()) {
                let dt = dt.of(row);
                state.copy_from_slice(&rows.states[row * n..(row + 1) * n]);
                for sample in row * samples..(row + 1) * samples {
                    inputs.clear();
                    inputs.extend_from_slice(&rows.commands[sample * m..(sample + 1) * m]);
                    inputs.extend_from_slice(&rows.forces[sample * f..(sample + 1) * f]);
                    for _ in 0..count {
                        instance.step(&mut state, &inputs, dt).map_err(|failure| self.error(failure))?;
                    }
                    next[sample * n..(sample + 1) * n].copy_from_slice(&state);
                }
                row += 1;
            }
        }
        let steps = held * count;
        if steps > 0 {
            let taken = begun.elapsed().as_secs_f64() / steps as f64;
            // Of two, one of which is not a number, the least is the other.
            let least = taken.min(f64::from_bits(self.cost.load(Ordering::Relaxed)));
            self.cost.store(least.to_bits(), Ordering::Relaxed);
        }
        Ok(())
    }

    /// An instance of fmpy, stepped here.
    fn instance(&self, parameters: &[f64]) -> PyResult<Instance> {
        let component = Python::attach(|py| {
            let fmu = self.instantiate.bind(py).call0()?;
            Component::of(&fmu, self.two)
        })?;
        let made = Instance::new(component, &self.references, parameters, self.indicators);
        made.map_err(|failure| self.error(failure))
    }

    fn error(&self, failure: Failure) -> PyErr {
        PyValueError::new_err(format!("{}: {failure}", self.name))
    }
}

impl Kept {
    /// The instance of such parameters.
    fn instance(&mut self, copies: &Copies, parameters: &[f64]) -> PyResult<&mut Instance> {
        self.uses += 1;
        let key: Vec<u64> = parameters.iter().map(|value| value.to_bits()).collect();
        let instance = match self.instances.remove(&key) {
            Some((instance, _)) => instance,
            None => {
                let spare = if self.instances.len() < KEPT { None } else { self.oldest() };
                let changed = spare.map(|spare| changed(spare, parameters)).transpose()?.flatten();
                changed.map_or_else(|| copies.instance(parameters), Ok)?
            }
        };
        Ok(&mut self.instances.entry(key).or_insert((instance, self.uses)).0)
    }

    /// Takes out the instance that was not asked for the longest.
    fn oldest(&mut self) -> Option<Instance> {
        let key = self.instances.iter().min_by_key(|(_, (_, used))| *used).map(|(key, _)| key.clone())?;
        self.instances.remove(&key).map(|(instance, _)| instance)
    }
}

/// An instance with other parameters, which takes far less time than a new one; None where its reset fails.
fn changed(mut instance: Instance, parameters: &[f64]) -> PyResult<Option<Instance>> {
    if instance.reset(parameters).is_ok() {
        return Ok(Some(instance));
    }
    // It can still be instantiated anew; and where the parameters are at fault, that says so.
    Python::attach(|py| instance.free(py)).map(|()| None)
}
