//! Steps of co-simulation: the FMU's own, each from start values of its own.

use super::failure::Failure;
use super::unit::Unit;
use std::slice;

/// Share of a step by which the time that the FMU reached may miss it: rounding.
const ROUNDING: f64 = 1e-6;

/// What a step is computed in.
pub(super) struct CoSimulation {
    derivatives: Vec<f64>,
    found: Vec<f64>,
}

impl CoSimulation {
    pub(super) fn begin(unit: &Unit) -> Self {
        let states = vec![0.0; unit.references.states.len()];
        Self { derivatives: states.clone(), found: states }
    }

    /// Takes the states over `dt` s, the inputs held.
    ///
    /// # Errors
    /// [`Failure::Short`] when the FMU did not go so far, as its own steps are longer.
    pub(super) fn step(&mut self, unit: &mut Unit, x: &mut [f64], inputs: &[f64], dt: f64) -> Result<(), Failure> {
        unit.component.reset()?;
        unit.initialize(Some((x, inputs)))?;
        if unit.references.time.is_none() {
            unit.component.get(&unit.references.derivatives, &mut self.derivatives)?;
        }
        unit.component.do_step(dt)?;
        unit.component.get(&unit.references.states, &mut self.found)?;
        let reached = match &unit.references.time {
            Some(time) => {
                let mut reached = 0.0;
                unit.component.get(slice::from_ref(time), slice::from_mut(&mut reached))?;
                reached
            }
            None if self.is_stuck(x, dt) => 0.0,
            None => dt,
        };
        if (reached - dt).abs() > ROUNDING * dt {
            return Err(Failure::Short { asked: dt, reached });
        }
        x.copy_from_slice(&self.found);
        Ok(())
    }

    /// A derivative that moves no state is of an FMU that made no step; how far it went its own time says, where it shows it.
    fn is_stuck(&self, x: &[f64], dt: f64) -> bool {
        let mut states = x.iter().zip(&self.found).zip(&self.derivatives);
        states.any(|((x, found), rate)| found == x && rate.abs() * dt > ROUNDING * x.abs())
    }
}
