//! Moments: mean and covariance of a machine and its random processes along a known path, for `L` sets of processes at once.
//!
//! The machine's own matrices are the same in every lane, so that each product is a number times a register.

use super::decay::{Decay, add, add_product, add_series};
use super::{Acts, Process};
use nalgebra::DMatrix;

/// Products of variances stay between this and its inverse before their logarithm is taken, far from the ends of a double. Rounding.
const LARGE: f64 = 1e100;

/// A reading as a linear function of the machine's states.
pub(super) struct Reading {
    pub(super) slope: Vec<f64>,
    /// What was read, less what the slope does not explain.
    pub(super) value: f64,
    pub(super) column: usize,
}

/// The machine's next states as a linear function of those at a sample and of the processes there.
pub(super) struct Ahead {
    pub(super) time: f64,
    pub(super) carried: DMatrix<f64>,
    pub(super) offset: Vec<f64>,
    /// By process in a row: what it moves at the path's own correlation time, less the series below.
    pub(super) beyond: Vec<Vec<f64>>,
    /// By process in a row: `A^j e` for the rates `A` of the machine and the unit vector `e` of the row, n entries each.
    pub(super) powers: Vec<Vec<f64>>,
}

/// One process, a lane each.
struct Driver<const L: usize> {
    acts: Acts,
    /// Its number among the forces; nothing of coloured noise.
    force: Option<usize>,
    time: [f64; L],
    variance: [f64; L],
    /// Of the white noise that drives it: twice the variance over the time.
    density: [f64; L],
}

/// Mean and covariance of all states as the filter goes: those of the machine, then the processes.
pub(super) struct Moments<'a, const L: usize> {
    n: usize,
    size: usize,
    /// Standard deviations of the machine's start.
    scale: &'a [f64],
    /// Of the columns, squared.
    noise: &'a [f64],
    drivers: Vec<Driver<L>>,
    state: Vec<[f64; L]>,
    /// Row after row; symmetric.
    covariance: Vec<[f64; L]>,
    along: Vec<[f64; L]>,
    /// What each process moves of the machine's states in a step.
    moved: Vec<[f64; L]>,
    /// The machine's rows of the covariance, carried ahead on one side.
    carried: Vec<[f64; L]>,
    driven: Vec<[f64; L]>,
    decays: Vec<Decay<L>>,
    /// The length of a step that the decays are of.
    time: f64,
    count: usize,
    squares: [f64; L],
    logarithms: [f64; L],
    /// Of variances whose logarithms are not taken yet.
    product: [f64; L],
}

impl<'a, const L: usize> Moments<'a, L> {
    pub(super) fn new((scale, noise): (&'a [f64], &'a [f64]), lanes: &[&[Process]; L]) -> Self {
        let driver = |k: usize| {
            let (time, variance) = (lanes.map(|set| set[k].time), lanes.map(|set| set[k].deviation.powi(2)));
            let density = std::array::from_fn(|lane| 2.0 * variance[lane] / time[lane]);
            let is_force = |process: &Process| process.row().is_some();
            let force = is_force(&lanes[0][k]).then(|| lanes[0][..k].iter().filter(|p| is_force(p)).count());
            Driver { acts: lanes[0][k].acts, force, time, variance, density }
        };
        let drivers: Vec<Driver<L>> = (0..lanes[0].len()).map(driver).collect();
        let (n, size) = (scale.len(), scale.len() + drivers.len());
        let zeros = |count: usize| vec![[0.0; L]; count];
        Self {
            n,
            size,
            scale,
            noise,
            state: zeros(size),
            covariance: zeros(size * size),
            along: zeros(size),
            moved: zeros(n * drivers.len()),
            carried: zeros(n * size),
            driven: zeros(n + 1),
            drivers,
            decays: Vec::new(),
            time: f64::NAN,
            count: 0,
            squares: [0.0; L],
            logarithms: [0.0; L],
            product: [1.0; L],
        }
    }

    /// Nothing is known of the start but the size of the motion.
    #[inline(always)]
    pub(super) fn begin(&mut self, start: &[f64]) {
        let (n, size) = (self.n, self.size);
        self.state.fill([0.0; L]);
        self.state.iter_mut().zip(start).for_each(|(state, start)| *state = [*start; L]);
        self.covariance.fill([0.0; L]);
        for (j, scale) in self.scale.iter().enumerate() {
            self.covariance[j * size + j] = [scale * scale; L];
        }
        for (k, driver) in self.drivers.iter().enumerate() {
            self.covariance[(n + k) * size + n + k] = driver.variance;
        }
    }

    /// Takes in a reading.
    #[inline(always)]
    pub(super) fn read(&mut self, reading: &Reading) {
        let (n, size) = (self.n, self.size);
        let Self { state, covariance, along, drivers, .. } = self;
        let mut expected = [0.0; L];
        along.fill([0.0; L]);
        let machine = reading.slope.iter().copied().enumerate().filter(|(_, slope)| *slope != 0.0);
        let on_column = drivers.iter().enumerate().filter(|(_, driver)| driver.acts == Acts::Column(reading.column));
        let slopes = || machine.clone().chain(on_column.clone().map(|(k, _)| (n + k, 1.0)));
        for (j, slope) in slopes() {
            add(&mut expected, slope, &state[j]);
            for (along, entry) in along.iter_mut().zip(&covariance[j * size..(j + 1) * size]) {
                add(along, slope, entry);
            }
        }
        let mut variance = [self.noise[reading.column]; L];
        slopes().for_each(|(j, slope)| add(&mut variance, slope, &along[j]));
        let weight = variance.map(|variance| 1.0 / variance);
        for lane in 0..L {
            let innovation = reading.value - expected[lane];
            self.squares[lane] += innovation * innovation * weight[lane];
            self.product[lane] *= variance[lane];
            expected[lane] = innovation * weight[lane];
        }
        for i in 0..size {
            let share: [f64; L] = std::array::from_fn(|lane| -along[i][lane] * weight[lane]);
            add_product(&mut state[i], &along[i], &expected);
            for j in 0..size {
                add_product(&mut covariance[i * size + j], &share, &along[j]);
            }
        }
        self.count += 1;
        if self.product.iter().any(|product| !(1.0 / LARGE..LARGE).contains(product)) {
            self.settle();
        }
    }

    /// The logarithms of the variances so far.
    fn settle(&mut self) {
        (0..L).for_each(|lane| self.logarithms[lane] += self.product[lane].ln());
        self.product = [1.0; L];
    }

    /// To the next sample.
    #[inline(always)]
    pub(super) fn go(&mut self, ahead: &Ahead) {
        // Stamps are rounded.
        if !((ahead.time - self.time).abs() <= 1e-9 * ahead.time) {
            self.time = ahead.time;
            self.decays = self.drivers.iter().map(|driver| Decay::over(self.time, &driver.time)).collect();
        }
        let (n, size) = (self.n, self.size);
        for (driver, (decay, moved)) in self.drivers.iter().zip(self.decays.iter().zip(self.moved.chunks_exact_mut(n)))
        {
            let Some(force) = driver.force else { continue };
            moved.iter_mut().zip(&ahead.beyond[force]).for_each(|(moved, beyond)| *moved = [*beyond; L]);
            add_series(moved, &ahead.powers[force], &decay.moved);
        }
        for (next, offset) in self.along.iter_mut().zip(&ahead.offset) {
            *next = [*offset; L];
        }
        carry(&mut self.along[..n], &self.state, ahead, &self.moved);
        self.state[..n].copy_from_slice(&self.along[..n]);
        for (state, decay) in self.state[n..].iter_mut().zip(&self.decays) {
            (0..L).for_each(|lane| state[lane] *= decay.left[lane]);
        }
        // The covariance is symmetric: its rows are its columns, which the machine carries ahead.
        for (i, from) in self.covariance.chunks_exact(size).enumerate() {
            self.along[..n].fill([0.0; L]);
            carry(&mut self.along[..n], from, ahead, &self.moved);
            (0..n).for_each(|j| self.carried[j * size + i] = self.along[j]);
        }
        self.carry_columns(ahead);
        self.drive(ahead);
    }

    /// The covariance from the machine's rows that were carried ahead: its columns carried, too, and what the processes keep.
    #[inline(always)]
    fn carry_columns(&mut self, ahead: &Ahead) {
        let (n, size) = (self.n, self.size);
        let Self { covariance, carried, moved, decays, .. } = self;
        for (i, from) in carried.chunks_exact(size).enumerate() {
            let to = &mut covariance[i * size..i * size + n];
            to.fill([0.0; L]);
            carry(to, from, ahead, moved);
            for (k, decay) in decays.iter().enumerate() {
                let kept: [f64; L] = std::array::from_fn(|lane| from[n + k][lane] * decay.left[lane]);
                covariance[i * size + n + k] = kept;
                covariance[(n + k) * size + i] = kept;
            }
        }
        for (k, one) in decays.iter().enumerate() {
            for (l, other) in decays.iter().enumerate() {
                let entry = &mut covariance[(n + k) * size + n + l];
                (0..L).for_each(|lane| entry[lane] *= one.left[lane] * other.left[lane]);
            }
        }
        // Rounding makes the two triangles differ.
        for i in 0..n {
            for j in 0..i {
                let (below, above) = (covariance[i * size + j], covariance[j * size + i]);
                let mean = std::array::from_fn(|lane| 0.5 * (below[lane] + above[lane]));
                (covariance[i * size + j], covariance[j * size + i]) = (mean, mean);
            }
        }
    }

    /// What the white noise of the processes adds over a step.
    #[inline(always)]
    fn drive(&mut self, ahead: &Ahead) {
        let (n, size) = (self.n, self.size);
        for (k, (decay, driver)) in self.decays.iter().zip(&self.drivers).enumerate() {
            // The machine's states, then the process itself.
            let first = if driver.force.is_some() { 0 } else { n };
            let place = |i: usize| if i < n { i } else { n + k };
            for (weight, left, moved) in &decay.points {
                self.driven.fill([0.0; L]);
                self.driven[n] = *left;
                if let Some(force) = driver.force {
                    add_series(&mut self.driven[..n], &ahead.powers[force], moved);
                }
                for i in first..=n {
                    let share: [f64; L] =
                        std::array::from_fn(|lane| driver.density[lane] * weight * self.driven[i][lane]);
                    for j in first..=n {
                        add_product(&mut self.covariance[place(i) * size + place(j)], &share, &self.driven[j]);
                    }
                }
            }
        }
    }

    /// Log likelihood of what was read, up to a constant; the white noise of the sensors is known up to one factor, which is fitted.
    pub(super) fn likelihood(mut self) -> [f64; L] {
        self.settle();
        let count = self.count.max(1) as f64;
        std::array::from_fn(|lane| {
            -0.5 * (count * (self.squares[lane] / count).max(f64::MIN_POSITIVE).ln() + self.logarithms[lane])
        })
    }
}

/// Adds where a step carries `from`, the machine's states and then the processes: by the machine itself and by what each process moves of
/// it (`moved`, zero for coloured noise).
#[inline(always)]
fn carry<const L: usize>(to: &mut [[f64; L]], from: &[[f64; L]], ahead: &Ahead, moved: &[[f64; L]]) {
    let (states, processes) = from.split_at(to.len());
    for (column, from) in ahead.carried.column_iter().zip(states) {
        for (factor, to) in column.iter().zip(&mut *to).filter(|(factor, _)| **factor != 0.0) {
            add(to, *factor, from);
        }
    }
    for (moved, from) in moved.chunks_exact(to.len()).zip(processes) {
        to.iter_mut().zip(moved).for_each(|(to, moved)| add_product(to, moved, from));
    }
}
