//! Derivatives that one fit hands on to the next.

use super::slopes::{Scene, Slopes};
use crate::error::Result;
use crate::model::System;
use crate::refine::jacobian::{Block, Jacobian, Point};
use crate::refine::{Experiment, Free, Window};

/// Derivatives of a fit, for another one of the same windows with other effects.
#[derive(Debug)]
pub(crate) struct Kept {
    jacobian: Jacobian,
    /// The parameters whose columns are behind those of the states.
    parameters: Vec<String>,
    windows: Vec<Window>,
    columns: Vec<usize>,
    noise: Vec<f64>,
}

impl Kept {
    pub(super) fn new(jacobian: Jacobian, scene: Scene<'_>) -> Self {
        let Scene { experiment, free, .. } = scene;
        Self {
            jacobian,
            parameters: free.iter().map(|f| name(scene, f)).collect(),
            windows: experiment.windows.clone(),
            columns: experiment.columns.clone(),
            noise: experiment.noise.clone(),
        }
    }

    /// Whether these are the derivatives of the same readings.
    pub(super) fn serves(&self, experiment: &Experiment) -> bool {
        self.windows == experiment.windows && self.columns == experiment.columns
    }

    /// Fills a column of a window's block in; whether it is known, for the window itself or one that begins alike and goes on for longer.
    pub(super) fn fill(&self, scene: Scene<'_>, (window, column): (usize, usize), block: &mut Block) -> bool {
        let n = scene.system.n_states();
        let wanted = scene.experiment.windows[window];
        let begins = |own: &Window| own.log == wanted.log && own.first == wanted.first && own.last >= wanted.last;
        let own = match self.windows.get(window) {
            Some(same) if begins(same) => Some(window),
            _ => self.windows.iter().position(begins),
        };
        let place = match column.checked_sub(n) {
            None => Some(column).filter(|&column| column < self.jacobian.n_states),
            Some(free) => {
                let name = name(scene, &scene.free[free]);
                self.parameters.iter().position(|p| *p == name).map(|place| self.jacobian.n_states + place)
            }
        };
        let Some((own, place)) = own.zip(place) else { return false };
        let known = self.jacobian.blocks[own].derivative.column(place);
        // In units of the noise, which may have been another.
        let noise = &scene.experiment.noise;
        for (row, (value, known)) in block.derivative.column_mut(column).iter_mut().zip(known.iter()).enumerate() {
            let of = row % noise.len();
            *value = known * self.noise[of] / noise[of];
        }
        true
    }
}

/// Residuals and derivatives of every window, those of an earlier fit as far as it has them.
pub(in crate::refine) fn jacobian(
    system: &System,
    experiment: &Experiment,
    point: &Point,
    free: &[Free],
    kept: Option<&Kept>,
) -> Result<Jacobian> {
    let scene = Scene { system, experiment, free };
    let mut blocks = scene.blocks(point)?;
    let mut wanted = scene.all_of(0..experiment.windows.len());
    if let Some(kept) = kept {
        wanted.retain(|&(window, column)| !kept.fill(scene, (window, column), &mut blocks[window]));
    }
    scene.differentiate(point, Slopes::Fine, &wanted, &mut blocks);
    Ok(Jacobian { blocks, n_states: system.n_states() })
}

fn name(scene: Scene<'_>, free: &Free) -> String {
    scene.system.model().parameters[free.parameter].name.clone()
}
