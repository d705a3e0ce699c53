//! Copies of a simulator that steps in native code, whichever it is.

use crate::native::length::Length;
use crate::native::{fmu, mujoco};
use gpsindy_core::Rows;
use pyo3::prelude::*;
use std::sync::Arc;

/// Copies of a simulator that are stepped without the interpreter.
#[derive(Clone)]
pub(crate) enum Native {
    Fmu(Arc<fmu::Copies>),
    Mujoco(Arc<mujoco::Copies>),
}

impl<'py> FromPyObject<'_, 'py> for Native {
    type Error = PyErr;

    fn extract(copies: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(fmu) = copies.cast::<fmu::PyFmuCopies>() {
            return Ok(Self::Fmu(fmu.get().0.clone()));
        }
        Ok(Self::Mujoco(copies.cast::<mujoco::PyMujocoCopies>()?.get().0.clone()))
    }
}

impl Native {
    /// Whether so many steps are worth processes, which the interpreter shares them out to.
    pub(crate) fn is_long(&self, steps: usize) -> bool {
        match self {
            Self::Fmu(copies) => copies.is_long(steps),
            Self::Mujoco(_) => false,
        }
    }

    /// States `next` (r x s x n) after each of `samples` s of `count` steps; `rows` has the commands and forces of each sample.
    pub(crate) fn step(&self, rows: &Rows<'_>, how: (&Length<'_>, usize, usize), next: &mut [f64]) -> PyResult<()> {
        match self {
            Self::Fmu(copies) => copies.step(rows, how, next),
            Self::Mujoco(copies) => copies.step(rows, how, next),
        }
    }
}
