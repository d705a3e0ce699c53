//! Of several equations that explain a log about as well, those that the others bear out where the log says nothing.
//!
//! Under a controller every control follows the states, and a relation of the loop (a speed that depends on the place where the
//! car always slows down) passes for an equation. Such relations break when the controls of one stretch of the log are given to
//! the states of another, each in its own way, while equations near the truth still move alike: the medoid of the rollouts
//! under exchanged controls is taken.
//!
//! Source for the loop: Ljung 1999, System Identification, section 13.4; for the medoid: Kaufman and Rousseeuw 1990, chapter 2.

use super::plan::Plan;
use super::second_look::Refinement;
use crate::data::{Channel, Run};
use crate::error::{Error, Result};
use crate::simulate::{Excitation, Simulate};
use faer::Mat;
use rayon::prelude::*;

/// Stretches of the logs whose states and controls are exchanged.
const STRETCHES: usize = 4;

/// Length of a stretch as a share of the longest run.
const LENGTH: f64 = 1.0 / 3.0;

/// Difference of a state, in units of its spread, beyond which two rollouts have nothing to do with each other.
const APART: f64 = 3.0;

/// A rollout's states by samples in units of their spread; none where it diverged.
type Path = Option<Vec<f64>>;

impl Plan {
    /// Place of the member whose rollouts under exchanged controls are nearest to those of the others; the first of equals.
    pub(super) fn consensus(&self, members: &[Refinement]) -> Result<usize> {
        let stretches = self.stretches();
        if stretches.len() < 2 {
            return Ok(0);
        }
        let paths = members.par_iter().map(|member| self.exchanged(member, &stretches)).collect::<Result<Vec<_>>>()?;
        let total = |own: &Vec<Path>| paths.iter().map(|other| apart(own, other)).sum::<f64>();
        let totals: Vec<f64> = paths.iter().map(total).collect();
        Ok((0..members.len()).min_by(|&a, &b| totals[a].total_cmp(&totals[b])).unwrap_or(0))
    }

    /// Run, first sample and number of samples of every stretch, spread over the logs.
    fn stretches(&self) -> Vec<(usize, usize, usize)> {
        let count = |k: usize| self.tracks[k].n_samples();
        let longest = (0..self.tracks.len()).map(count).max().unwrap_or(0);
        let length = ((LENGTH * longest as f64) as usize).max(2);
        let long: Vec<usize> = (0..self.tracks.len()).filter(|&k| count(k) > length).collect();
        let place = |k: usize| {
            let run = long[k * long.len() / STRETCHES];
            let own: Vec<usize> = (0..STRETCHES).filter(|&k| long[k * long.len() / STRETCHES] == run).collect();
            let before = own.iter().filter(|&&other| other < k).count();
            (run, before * (count(run) - length - 1) / (own.len() - 1).max(1), length)
        };
        if long.is_empty() { Vec::new() } else { (0..STRETCHES).map(place).collect() }
    }

    /// Rollouts from the smoothed start of every stretch under the controls of every other.
    fn exchanged(&self, member: &Refinement, stretches: &[(usize, usize, usize)]) -> Result<Vec<Path>> {
        let equations = &member.trial.equations;
        let system = equations.model(&equations.support(), false).compile()?;
        let channels: Vec<Channel> = equations.controls.iter().map(|(name, _)| Channel::new(name)).collect();
        let simulate = Simulate { hold: member.hold, ..Simulate::default() };
        let spread = self.spread();
        let mut paths = Vec::new();
        for (a, &(of_states, start, _)) in stretches.iter().enumerate() {
            let initial: Vec<f64> = (0..spread.len()).map(|s| self.tracks[of_states].mean[(start, s)]).collect();
            for &(of_controls, first, length) in stretches.iter().enumerate().filter(|(b, _)| *b != a).map(|(_, s)| s) {
                let track = &self.tracks[of_controls];
                let run = Run {
                    name: "exchanged".into(),
                    time: track.time[first..first + length].to_vec(),
                    values: Mat::from_fn(length, channels.len(), |i, k| track.controls[(first + i, k)]),
                };
                let excitation = Excitation::of_run(&system, &run, &channels, member.hold)?;
                let scaled = |i: usize, states: &Mat<f64>| {
                    (0..spread.len()).map(move |s| (i, s)).map(|(i, s)| states[(i, s)] / spread[s]).collect::<Vec<_>>()
                };
                paths.push(match simulate.rollout(&system, &excitation, &initial) {
                    Ok(rollout) => Some((0..length).flat_map(|i| scaled(i, &rollout.states)).collect()),
                    Err(Error::Cancelled) => return Err(Error::Cancelled),
                    Err(_) => None,
                });
            }
        }
        Ok(paths)
    }

    /// Standard deviation of every smoothed state over all runs.
    fn spread(&self) -> Vec<f64> {
        let of = |s: usize| {
            let values = || self.tracks.iter().flat_map(move |t| (0..t.n_samples()).map(move |i| t.mean[(i, s)]));
            let count = values().count() as f64;
            let mean = values().sum::<f64>() / count;
            (values().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE)
        };
        (0..self.n_states()).map(of).collect()
    }
}

/// Root mean square difference of rollouts in units of the spread, none beyond [`APART`], as a mean over the rollouts.
fn apart(own: &[Path], other: &[Path]) -> f64 {
    let pair = |(own, other): (&Path, &Path)| match (own, other) {
        (Some(own), Some(other)) => {
            let squares = own.iter().zip(other).map(|(a, b)| (a - b).abs().min(APART).powi(2));
            (squares.sum::<f64>() / own.len().max(1) as f64).sqrt()
        }
        _ => APART,
    };
    own.iter().zip(other).map(pair).sum::<f64>() / own.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::Identify;
    use super::*;
    use crate::data::Dataset;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use crate::refine::Hold;

    #[test]
    fn a_relation_of_the_loop_is_outvoted_by_equations_that_know_the_control() {
        // x' = u - x; the control keeps x on a path that climbs, so that its mean slope passes for an equation.
        let time: Vec<f64> = (0..121).map(|i| 0.1 * i as f64).collect();
        let x = |t: f64| t + t.sin() + t.cos();
        let control = |t: f64| 1.0 + t.cos() - t.sin() + x(t);
        let values = Mat::from_fn(121, 2, |i, j| if j == 0 { x(time[i]) } else { control(time[i]) });
        let run = Run { name: "a".into(), time, values };
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], vec![run]).unwrap();
        let identify = Identify {
            states: vec!["x".into()],
            controls: vec!["u".into()],
            library: LibrarySettings { degree: 1, ..LibrarySettings::default() },
            smoother: None,
            ..Identify::default()
        };
        let plan = Plan::new(&identify, &data, &Silent).unwrap();
        let empty = plan.equations(&identify).unwrap();
        let search = plan.search(Hold::Linear);
        let member = |terms: &[&str]| {
            let mut equations = empty.clone();
            for term in terms {
                equations.coefficients[0][empty.library.index_of(term).unwrap()] = 0.5;
            }
            let trial = search.fit(&equations, 12.0, None).unwrap();
            Refinement { trial, window: 12.0, hold: Hold::Linear, rival: None }
        };
        // The mean slope alone, the truth, and the truth with a constant too many.
        let members = [member(&["1"]), member(&["x", "u"]), member(&["1", "x", "u"])];
        assert_ne!(plan.consensus(&members).unwrap(), 0);
    }

    #[test]
    fn rollouts_are_apart_by_their_difference_up_to_a_limit() {
        let path = |value: f64| vec![Some(vec![value; 6])];
        assert_eq!(apart(&path(1.0), &path(1.5)), 0.5);
        assert_eq!(apart(&path(1.0), &path(50.0)), APART);
        assert_eq!(apart(&path(1.0), &[None]), APART);
    }
}
