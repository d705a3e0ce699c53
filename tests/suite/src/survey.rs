//! What the nominal plant does in its runs: the sizes by which effects and noise are measured.

use crate::plant::Plant;
use crate::simulate::{Machine, Trace};

/// Ranges and sizes over all runs of a plant.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    /// Mean of each state.
    pub mean: Vec<f64>,
    /// Standard deviation of each state.
    pub spread: Vec<f64>,
    /// Smallest value of each state.
    pub low: Vec<f64>,
    /// Largest value of each state.
    pub high: Vec<f64>,
    /// Standard deviation of each derivative.
    pub slope: Vec<f64>,
    /// Smallest value of each control.
    pub control_low: Vec<f64>,
    /// Largest value of each control.
    pub control_high: Vec<f64>,
    /// States and controls that were visited.
    pub points: Vec<(Vec<f64>, Vec<f64>)>,
}

/// Looks at the nominal runs.
pub fn survey(plant: &Plant, traces: &[Trace]) -> Survey {
    let (n, m) = (plant.states.len(), plant.controls.len());
    let machine = Machine::new(plant, &[], &vec![1.0; n], 1e-8);
    let mut points = Vec::new();
    for trace in traces {
        let thin = (trace.states.len() / 60).max(1);
        for (x, u) in trace.states.iter().zip(&trace.controls).step_by(thin) {
            points.push((x.clone(), u.clone()));
        }
    }
    let slopes: Vec<Vec<f64>> = points.iter().map(|(x, u)| machine.derivative(0.0, x, u)).collect();
    let count = points.len().max(1) as f64;
    let mut survey = Survey::default();
    for i in 0..n {
        let column: Vec<f64> = points.iter().map(|(x, _)| x[i]).collect();
        let (mean, spread) = moments(&column, count);
        survey.mean.push(mean);
        survey.spread.push(spread);
        survey.low.push(column.iter().copied().fold(f64::INFINITY, f64::min));
        survey.high.push(column.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        survey.slope.push(moments(&slopes.iter().map(|d| d[i]).collect::<Vec<_>>(), count).1);
    }
    for j in 0..m {
        survey.control_low.push(points.iter().map(|(_, u)| u[j]).fold(f64::INFINITY, f64::min));
        survey.control_high.push(points.iter().map(|(_, u)| u[j]).fold(f64::NEG_INFINITY, f64::max));
    }
    survey.points = points;
    survey
}

fn moments(values: &[f64], count: f64) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt())
}
