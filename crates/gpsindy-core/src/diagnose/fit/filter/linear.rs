//! The filter linearised about a known path: other sizes and times of the random processes cost no rollout.
//!
//! The extended Kalman filter rolls out the machine from its own estimates. Where another filter has already followed the logs, its
//! path is as near to the machine as a new one would come, and along it readings and steps are linear in what the estimates differ.
//!
//! Source: the linearised Kalman filter of Jazwinski 1970, Stochastic Processes and Filtering Theory, chapter 8.3.

use super::decay::{Decay, add, add_series, weights};
use super::driven::{TERMS, logarithm};
use super::{Acts, Filtered, Process, Sample};
use crate::refine::Experiment;
use nalgebra::{DMatrix, DVector};

/// A reading as a linear function of the machine's states.
struct Reading {
    slope: Vec<f64>,
    /// What was read, less what the slope does not explain.
    value: f64,
    column: usize,
}

/// A sample's readings and the step to the next sample.
struct Step {
    readings: Vec<Reading>,
    /// Nothing after the last sample.
    ahead: Option<Ahead>,
}

/// The machine's next states as a linear function of those at a sample and of the processes there.
struct Ahead {
    time: f64,
    carried: DMatrix<f64>,
    offset: Vec<f64>,
    /// By process in a row: what it moves at the path's own correlation time, less the series below.
    beyond: Vec<Vec<f64>>,
    /// By process in a row: `A^j e` for the rates `A` of the machine and the unit vector `e` of the row, n entries each.
    powers: Vec<Vec<f64>>,
}

/// A filter along a known path.
pub(crate) struct Linear {
    /// The machine's own states.
    n: usize,
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
            n,
            places: processes.iter().map(|p| p.acts).collect(),
            stretches: filtered.stretches.iter().map(one).collect(),
            scale: experiment.scale[..n].to_vec(),
            noise: experiment.noise.iter().map(|noise| noise * noise).collect(),
        }
    }

    /// Log likelihood of the first `most` samples, or a few more, with `processes` at the path's own places, up to the constant that
    /// all of one path share; not finite where the filter diverges.
    pub(crate) fn likelihood(&self, processes: &[Process], most: usize) -> f64 {
        debug_assert!(processes.iter().map(|p| p.acts).eq(self.places.iter().copied()));
        // The widest registers that the processor has.
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || self.along(processes, most),
        )
    }

    #[inline(always)]
    fn along(&self, processes: &[Process], most: usize) -> f64 {
        let mut filter = Moments::new(self, processes);
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
        let count = filter.count.max(1) as f64;
        -0.5 * (count * (filter.squares / count).max(f64::MIN_POSITIVE).ln() + filter.logarithms)
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
            let mut left: Vec<f64> = column.iter().take(n).copied().collect();
            add_series(&mut left, &all, &weights(time, process.time), -1.0);
            beyond.push(left);
            powers.push(all);
        }
        Self { time, carried, offset, beyond, powers }
    }
}

/// Mean and covariance of all states as the filter goes.
struct Moments<'a> {
    linear: &'a Linear,
    processes: &'a [Process],
    size: usize,
    state: Vec<f64>,
    covariance: Vec<f64>,
    along: Vec<f64>,
    /// Column after column.
    transition: Vec<f64>,
    product: Vec<f64>,
    driven: Vec<f64>,
    decays: Vec<Decay>,
    /// The length of a step that the decays are of.
    time: f64,
    count: usize,
    squares: f64,
    logarithms: f64,
}

impl<'a> Moments<'a> {
    fn new(linear: &'a Linear, processes: &'a [Process]) -> Self {
        let size = linear.n + processes.len();
        let (vector, matrix) = (vec![0.0; size], vec![0.0; size * size]);
        Self {
            linear,
            processes,
            size,
            state: vector.clone(),
            covariance: matrix.clone(),
            along: vector.clone(),
            transition: matrix.clone(),
            product: matrix,
            driven: vector,
            decays: Vec::new(),
            time: f64::NAN,
            count: 0,
            squares: 0.0,
            logarithms: 0.0,
        }
    }

    /// Nothing is known of the start but the size of the motion.
    fn begin(&mut self, start: &[f64]) {
        let (n, size) = (self.linear.n, self.size);
        self.state.fill(0.0);
        self.state[..n].copy_from_slice(start);
        self.covariance.fill(0.0);
        for j in 0..size {
            let deviation = if j < n { self.linear.scale[j] } else { self.processes[j - n].deviation };
            self.covariance[j * size + j] = deviation * deviation;
        }
    }

    #[inline(always)]
    fn read(&mut self, reading: &Reading) {
        let (n, size) = (self.linear.n, self.size);
        let Self { state, covariance, along, processes, .. } = self;
        let on_column = |k: usize| processes[k].acts == Acts::Column(reading.column);
        let slopes = || {
            let own = reading.slope.iter().copied().enumerate().filter(|(_, slope)| *slope != 0.0);
            own.chain((n..size).filter(|&j| on_column(j - n)).map(|j| (j, 1.0)))
        };
        // The covariance is symmetric: its rows are its columns.
        let mut expected = 0.0;
        along.fill(0.0);
        for (j, slope) in slopes() {
            expected += slope * state[j];
            add(along, slope, &covariance[j * size..(j + 1) * size]);
        }
        let variance = slopes().map(|(j, slope)| slope * along[j]).sum::<f64>() + self.linear.noise[reading.column];
        let innovation = reading.value - expected;
        add(state, innovation / variance, along);
        for (i, row) in covariance.chunks_exact_mut(size).enumerate() {
            add(row, -along[i] / variance, along);
        }
        self.logarithms += variance.ln();
        self.squares += innovation * innovation / variance;
        self.count += 1;
    }

    #[inline(always)]
    fn go(&mut self, ahead: &Ahead) {
        // Stamps are rounded.
        if !((ahead.time - self.time).abs() <= 1e-9 * ahead.time) {
            self.time = ahead.time;
            self.decays = self.processes.iter().map(|process| Decay::over(self.time, process.time)).collect();
        }
        let (n, size) = (self.linear.n, self.size);
        // Column after column: those of the machine, then those of the processes.
        self.transition.fill(0.0);
        for (column, carried) in self.transition.chunks_exact_mut(size).zip(ahead.carried.column_iter()) {
            column[..n].copy_from_slice(carried.as_slice());
        }
        let mut row = 0;
        for (k, decay) in self.decays.iter().enumerate() {
            let column = &mut self.transition[(n + k) * size..(n + k + 1) * size];
            column[n + k] = decay.left;
            if self.processes[k].row().is_some() {
                column[..n].copy_from_slice(&ahead.beyond[row]);
                add_series(&mut column[..n], &ahead.powers[row], &decay.moved, 1.0);
                row += 1;
            }
        }
        carry(&mut self.along, &self.state, &self.transition);
        self.state.copy_from_slice(&self.along);
        add(&mut self.state[..n], 1.0, &ahead.offset);
        // Rows of the covariance are carried, then those of what came of it turned: it is symmetric.
        for (i, row) in self.covariance.chunks_exact(size).enumerate() {
            carry(&mut self.along, row, &self.transition);
            (0..size).for_each(|j| self.product[j * size + i] = self.along[j]);
        }
        for (to, row) in self.covariance.chunks_exact_mut(size).zip(self.product.chunks_exact(size)) {
            carry(to, row, &self.transition);
        }
        // Rounding makes the two triangles differ.
        for i in 0..size {
            for j in 0..i {
                let mean = 0.5 * (self.covariance[i * size + j] + self.covariance[j * size + i]);
                self.covariance[i * size + j] = mean;
                self.covariance[j * size + i] = mean;
            }
        }
        self.drive(ahead);
    }

    /// What the white noise of the processes adds over a step.
    #[inline(always)]
    fn drive(&mut self, ahead: &Ahead) {
        let (n, size) = (self.linear.n, self.size);
        let mut row = 0;
        for (k, (decay, process)) in self.decays.iter().zip(self.processes).enumerate() {
            let density = 2.0 * process.deviation * process.deviation / process.time;
            let is_force = process.row().is_some();
            for (weight, left, moved) in &decay.points {
                self.driven.fill(0.0);
                self.driven[n + k] = *left;
                if is_force {
                    add_series(&mut self.driven[..n], &ahead.powers[row], moved, 1.0);
                }
                for (row, a) in self.covariance.chunks_exact_mut(size).zip(&self.driven) {
                    if *a != 0.0 {
                        add(row, density * weight * a, &self.driven);
                    }
                }
            }
            row += usize::from(is_force);
        }
    }
}

/// A square matrix (column after column) times a vector.
#[inline(always)]
fn carry(to: &mut [f64], vector: &[f64], columns: &[f64]) {
    to.fill(0.0);
    for (column, v) in columns.chunks_exact(to.len()).zip(vector) {
        if *v != 0.0 {
            add(to, *v, column);
        }
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
        (rolled.likelihood, path.likelihood(&other, usize::MAX))
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
