//! The filter linearised about a known path: other sizes and times of the random processes cost no rollout.
//!
//! The extended Kalman filter rolls out the machine from its own estimates. Where another filter has already followed the logs, its
//! path is as near to the machine as a new one would come, and along it readings and steps are linear in what the estimates differ.
//!
//! Source: the linearised Kalman filter of Jazwinski 1970, Stochastic Processes and Filtering Theory, chapter 8.3.

use super::decay::{add_series, weights};
use super::driven::{TERMS, logarithm};
use super::moments::{Ahead, Moments, Reading};
use super::{Acts, Filtered, Process, Sample};
use crate::parallel;
use crate::refine::Experiment;
use nalgebra::DVector;

/// Sets of processes that are filtered at once. Exact.
const LANES: usize = 8;

/// A sample's readings and the step to the next sample.
struct Step {
    readings: Vec<Reading>,
    /// Nothing after the last sample.
    ahead: Option<Ahead>,
}

/// A filter along a known path.
pub(crate) struct Linear {
    places: Vec<Acts>,
    /// Of each stretch the start of the machine, and its samples.
    stretches: Vec<(Vec<f64>, Vec<Step>)>,
    /// Standard deviations of the start.
    scale: Vec<f64>,
    /// Of the columns, squared.
    noise: Vec<f64>,
}

impl Linear {
    /// About the path of `filtered`, which saw `processes`.
    pub(super) fn about(filtered: &Filtered, experiment: &Experiment, n: usize, processes: &[Process]) -> Self {
        let one = |(log, samples): &(usize, Vec<Sample>)| {
            let time = &experiment.logs[*log].time;
            let step = |(i, sample): (usize, &Sample)| {
                let mut state = DVector::from_column_slice(&sample.expected);
                let mut readings = Vec::with_capacity(sample.readings.len());
                for reading in &sample.readings {
                    let value = reading.innovation + reading.slope.dot(&state);
                    state.axpy(reading.innovation, &reading.gain, 1.0);
                    readings.push(Reading {
                        slope: reading.slope.rows(0, n).iter().copied().collect(),
                        value,
                        column: reading.column,
                    });
                }
                let next = samples.get(i + 1);
                let ahead = next.map(|next| {
                    let elapsed = time[next.number] - time[sample.number];
                    Ahead::about(sample, &next.expected, n, processes, elapsed)
                });
                Step { readings, ahead }
            };
            let start = samples.first().map_or_else(|| vec![0.0; n], |first| first.expected[..n].to_vec());
            (start, samples.iter().enumerate().map(step).collect())
        };
        Self {
            places: processes.iter().map(|p| p.acts).collect(),
            stretches: filtered.stretches.iter().map(one).collect(),
            scale: experiment.scale[..n].to_vec(),
            noise: experiment.noise.iter().map(|noise| noise * noise).collect(),
        }
    }

    /// Log likelihoods of the first `most` samples, or a few more, of several sets of processes at the path's own places, up to the
    /// constant that all of one path share; not finite where the filter diverges.
    pub(crate) fn likelihoods(&self, all: &[&[Process]], most: usize) -> Vec<f64> {
        debug_assert!(all.iter().all(|set| set.iter().map(|p| p.acts).eq(self.places.iter().copied())));
        let chunks: Vec<&[&[Process]]> = all.chunks(LANES).collect();
        let one = |chunk: &&[&[Process]]| match chunk.len() {
            1 => self.dispatched::<1>(chunk, most),
            2..=4 => self.dispatched::<4>(chunk, most),
            _ => self.dispatched::<LANES>(chunk, most),
        };
        parallel::map(&chunks, one).concat()
    }

    /// Of up to `L` sets, one a lane; lanes beyond the last repeat it.
    fn dispatched<const L: usize>(&self, sets: &[&[Process]], most: usize) -> Vec<f64> {
        let lanes: [&[Process]; L] = std::array::from_fn(|lane| sets[lane.min(sets.len() - 1)]);
        // The widest registers that the processor has.
        let all = pulp::Arch::new().dispatch(
            #[inline(always)]
            || self.along(&lanes, most),
        );
        all[..sets.len()].to_vec()
    }

    #[inline(always)]
    fn along<const L: usize>(&self, lanes: &[&[Process]; L], most: usize) -> [f64; L] {
        let mut filter = Moments::new((&self.scale, &self.noise), lanes);
        let mut left = most;
        for (start, steps) in &self.stretches {
            filter.begin(start);
            let count = steps.len().min(left);
            left -= count;
            for step in &steps[..count] {
                for reading in &step.readings {
                    filter.read(reading);
                }
                if let Some(ahead) = &step.ahead {
                    filter.go(ahead);
                }
            }
        }
        filter.likelihood()
    }
}

impl Ahead {
    fn about(sample: &Sample, next: &[f64], n: usize, processes: &[Process], time: f64) -> Self {
        let transition = &sample.transition;
        let carried = transition.view((0, 0), (n, n)).into_owned();
        let rates = logarithm(&carried) / time;
        let moved = &carried * DVector::from_column_slice(&sample.state[..n]);
        let mut offset: Vec<f64> = (0..n).map(|j| next[j] - moved[j]).collect();
        let (mut beyond, mut powers) = (Vec::new(), Vec::new());
        for (k, process) in processes.iter().enumerate() {
            let Acts::Row(row) = process.acts else { continue };
            let column = transition.column(n + k);
            (0..n).for_each(|j| offset[j] -= column[j] * sample.state[n + k]);
            let mut power = DVector::zeros(n);
            power[row] = 1.0;
            let mut all = Vec::with_capacity(TERMS * n);
            for _ in 0..TERMS {
                all.extend(power.iter());
                power = &rates * power;
            }
            let mut series = vec![[0.0]; n];
            add_series(&mut series, &all, &weights(time, &[process.time]));
            beyond.push(column.iter().zip(series).map(|(column, [series])| column - series).collect());
            powers.push(all);
        }
        Self { time, carried, offset, beyond, powers }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::{Filter, Pace};
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Control, Model, State, System};
    use faer::Mat;

    /// A driven pendulum, logged in its angle and its rate, whose rate of the rate is `load` besides.
    fn pendulum(load: &str) -> (System, Experiment, Vec<Vec<f64>>) {
        let load = Expression::parse(load).unwrap();
        let model = Model {
            states: vec![
                State::new("q", Expression::parse("w").unwrap()),
                State::new("w", load.plus(Expression::parse("u - 0.4*w").unwrap())),
            ],
            controls: vec![Control::new("u")],
            ..Model::default()
        };
        let time: Vec<f64> = (0..300).map(|i| 0.05 * f64::from(i)).collect();
        let value = |t: f64| [(1.3 * t).sin() + 0.2 * (4.1 * t).cos(), 1.3 * (1.3 * t).cos(), (0.9 * t).cos()];
        let values = Mat::from_fn(time.len(), 3, |i, c| value(time[i])[c]);
        let channels = ["q", "w", "u"].map(Channel::new);
        let data = Dataset::new(channels.into(), vec![Run { name: "one".into(), time, values }]).unwrap();
        let system = System::new(&model).unwrap();
        let mut experiment = Experiment::new(&system, &data, None).unwrap();
        experiment.noise = vec![0.02, 0.05];
        (system, experiment, vec![vec![0.2, 1.3]])
    }

    /// The likelihood by rolling out and by the path of processes that are two and three times as strong and last half as long, for a
    /// force in the row of `w` and coloured noise on `q`.
    fn compared(load: &str) -> (f64, f64) {
        let (system, experiment, starts) = pendulum(load);
        let places = [Acts::Row(1), Acts::Column(0)];
        let filter = Filter::new(&system, places).unwrap().unwrap();
        let processes = |strong: f64, long: f64| {
            let [force, error] = places;
            [
                Process { acts: force, deviation: 2.0 * strong, time: 0.5 * long },
                Process { acts: error, deviation: 0.1 * strong * strong, time: 0.8 * long },
            ]
        };
        let machine: (&[f64], &[Vec<f64>]) = (&[], &starts);
        let path = filter.linear((&experiment, usize::MAX), machine, &processes(1.0, 1.0)).unwrap();
        let other = processes(1.7, 0.5);
        let rolled = filter.run((&experiment, usize::MAX), machine, &other, Pace::Likelihood).unwrap();
        assert_eq!(rolled.count, 600);
        (rolled.likelihood, path.likelihoods(&[&other], usize::MAX)[0])
    }

    #[test]
    fn along_a_path_a_linear_machine_has_the_likelihood_that_rolling_out_tells() {
        let (rolled, along) = compared("-9*q");
        // Slopes are finite differences, and series end.
        assert!((rolled - along).abs() < 0.01, "{rolled} {along}");
    }

    #[test]
    fn along_a_path_a_bent_machine_has_nearly_the_likelihood_that_rolling_out_tells() {
        let (rolled, along) = compared("-9*sin(q)");
        assert!((rolled - along).abs() < 1.0, "{rolled} {along}");
    }
}
