//! Derivatives that one fit hands on to the next.

use super::slopes::Scene;
use crate::refine::jacobian::{Block, Jacobian};
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
        self.windows == experiment.windows && self.columns == experiment.columns && self.noise == experiment.noise
    }

    /// Fills a column of a window's block in; whether it is known.
    pub(super) fn fill(&self, scene: Scene<'_>, (window, column): (usize, usize), block: &mut Block) -> bool {
        let n = scene.system.n_states();
        let place = match column.checked_sub(n) {
            None => Some(column).filter(|&column| column < self.jacobian.n_states),
            Some(free) => {
                let name = name(scene, &scene.free[free]);
                self.parameters.iter().position(|p| *p == name).map(|place| self.jacobian.n_states + place)
            }
        };
        let Some(place) = place else { return false };
        block.derivative.set_column(column, &self.jacobian.blocks[window].derivative.column(place));
        true
    }
}

fn name(scene: Scene<'_>, free: &Free) -> String {
    scene.system.model().parameters[free.parameter].name.clone()
}
