//! Transition and process noise of the state-space engine over the steps of a log: one step at a
//! time while steps repeat, or many at once in loops that vectorise.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::matern::{Form, Matrix};
use crate::gp::kernel::exp::exp_negative;

/// `I_k = int_0^a s^k e^(-2 s) ds` for k = 0..4, each accurate relative to itself.
#[inline(always)]
pub(super) fn moments(a: f64, decay: f64) -> [f64; 5] {
    let end = decay * decay;
    let powers = [1.0, a, a * a, a * a * a, a * a * a * a];
    let mut i = [0.0; 5];
    if a > 2.0 {
        // By parts upwards: here nothing cancels.
        i[0] = 0.5 * (1.0 - end);
        for k in 1..5 {
            i[k] = 0.5 * (k as f64 * i[k - 1] - powers[k] * end);
        }
        return i;
    }
    // By parts the other way is a sum of positive terms; then downwards, positive again.
    let (mut term, mut sum, mut k) = (1.0, 1.0, 6.0);
    while term > 1e-17 * sum {
        term *= 2.0 * a / k;
        sum += term;
        k += 1.0;
    }
    i[4] = end * powers[4] * a / 5.0 * sum;
    for k in (1..5).rev() {
        i[k - 1] = (2.0 * i[k] + powers[k] * end) / k as f64;
    }
    i
}

/// Transition and process noise of the last step, kept while steps repeat.
pub(super) struct Step<const M: usize> {
    dt: f64,
    pub(super) a: f64,
    pub(super) transition: Matrix<M>,
    pub(super) noise: Matrix<M>,
}

impl<const M: usize> Step<M> {
    pub(super) fn new() -> Self {
        Self { dt: f64::NAN, a: 0.0, transition: [[0.0; M]; M], noise: [[0.0; M]; M] }
    }

    #[inline(always)]
    pub(super) fn set<S: Form<M>>(&mut self, lambda: f64, dt: f64) {
        // Steps of a uniform clock differ by rounding; a relative difference of 1e-12 changes nothing.
        if (dt - self.dt).abs() <= 1e-12 * self.dt {
            return;
        }
        self.dt = dt;
        // Beyond 300 the memory is gone (e^-300), and polynomials of a stay finite.
        self.a = (lambda * dt).min(300.0);
        let decay = (-self.a).exp();
        self.transition = S::transition(self.a, decay);
        self.noise = S::process_noise(moments(self.a, decay));
    }
}

/// Steps that are prepared at once.
const CHUNK: usize = 64;
/// Scaled step up to which the moments are summed as a series.
const SERIES: f64 = 2.0;

/// Steps side by side with their transitions and process noises, each entry with its neighbours.
pub(super) struct Table<const M: usize, const SIZE: usize> {
    /// Scaled lengths; beyond 300 the memory is gone (e^-300), and polynomials of a stay finite.
    pub(super) a: [f64; SIZE],
    /// `exp(-a)`.
    pub(super) decay: [f64; SIZE],
    pub(super) transition: [[[f64; SIZE]; M]; M],
    pub(super) noise: [[[f64; SIZE]; M]; M],
}

impl<const M: usize, const SIZE: usize> Table<M, SIZE> {
    /// Steps of no length.
    #[inline(always)]
    pub(super) fn new() -> Self {
        let zero = [[[0.0; SIZE]; M]; M];
        Self { a: [0.0; SIZE], decay: [1.0; SIZE], transition: zero, noise: zero }
    }

    /// Decays from the lengths.
    #[inline(always)]
    pub(super) fn decay(&mut self) {
        for (d, a) in self.decay.iter_mut().zip(&self.a) {
            *d = exp_negative(-a);
        }
    }

    /// Transitions from lengths and decays.
    #[inline(always)]
    pub(super) fn turn<S: Form<M>>(&mut self) {
        for l in 0..SIZE {
            let transition = S::transition(self.a[l], self.decay[l]);
            for i in 0..M {
                for j in 0..M {
                    self.transition[i][j][l] = transition[i][j];
                }
            }
        }
    }

    /// Process noises from lengths and decays.
    #[inline(always)]
    pub(super) fn drive<S: Form<M>>(&mut self) {
        let mut moment = [[0.0; SIZE]; 5];
        let longest = self.a.iter().copied().fold(0.0f64, f64::max);
        if longest > SERIES {
            for l in 0..SIZE {
                let each = moments(self.a[l], self.decay[l]);
                (0..5).for_each(|k| moment[k][l] = each[k]);
            }
        } else {
            series(&self.a, &self.decay, longest, &mut moment);
        }
        for l in 0..SIZE {
            let noise = S::process_noise(std::array::from_fn(|k| moment[k][l]));
            for i in 0..M {
                for j in 0..M {
                    self.noise[i][j][l] = noise[i][j];
                }
            }
        }
    }
}

/// Transitions and process noises of a chunk of steps.
pub(super) struct Steps<const M: usize> {
    table: Table<M, CHUNK>,
    /// The steps that end at points `first..first + CHUNK` are prepared; 0: none.
    first: usize,
}

impl<const M: usize> Steps<M> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { table: Table::new(), first: 0 }
    }

    /// Transition, process noise and scaled length of a prepared step.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> (Matrix<M>, Matrix<M>, f64) {
        let pick = |all: &[[[f64; CHUNK]; M]; M]| std::array::from_fn(|i| std::array::from_fn(|j| all[i][j][place]));
        (pick(&self.table.transition), pick(&self.table.noise), self.table.a[place])
    }

    /// Prepares the one step of a uniform clock; its place.
    #[inline(always)]
    pub(super) fn fill_once<S: Form<M>>(&mut self, lambda: f64, step: f64) -> usize {
        if self.first == 0 {
            let mut one = Step::<M>::new();
            one.set::<S>(lambda, step);
            (self.first, self.table.a[0]) = (1, one.a);
            for i in 0..M {
                for j in 0..M {
                    self.table.transition[i][j][0] = one.transition[i][j];
                    self.table.noise[i][j][0] = one.noise[i][j];
                }
            }
        }
        0
    }

    /// The place of the step that ends at point `i`, prepared with those after it where it was not yet.
    #[inline(always)]
    pub(super) fn reach<S: Form<M>>(&mut self, lambda: f64, time: &[f64], i: usize) -> usize {
        if self.first == 0 || i >= self.first + CHUNK {
            self.prepare::<S>(lambda, time, i);
        }
        i - self.first
    }

    /// The same on the way back: prepared with those before it.
    #[inline(always)]
    pub(super) fn reach_back<S: Form<M>>(&mut self, lambda: f64, time: &[f64], i: usize) -> usize {
        if self.first == 0 || i < self.first {
            self.prepare::<S>(lambda, time, (i + 1).saturating_sub(CHUNK).max(1));
        }
        i - self.first
    }

    fn prepare<S: Form<M>>(&mut self, lambda: f64, time: &[f64], first: usize) {
        self.first = first;
        self.table.a = [0.0; CHUNK];
        for ((a, now), past) in self.table.a.iter_mut().zip(&time[first..]).zip(&time[first - 1..]) {
            *a = (lambda * (now - past)).min(300.0);
        }
        pulp::Arch::new().dispatch(Prepare::<M, S> { table: &mut self.table, form: std::marker::PhantomData });
    }
}

/// The preparation of a chunk, compiled for the processor at hand.
struct Prepare<'a, const M: usize, S> {
    table: &'a mut Table<M, CHUNK>,
    form: std::marker::PhantomData<S>,
}

impl<const M: usize, S: Form<M>> pulp::WithSimd for Prepare<'_, M, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) {
        self.table.decay();
        self.table.turn::<S>();
        self.table.drive::<S>();
    }
}

/// [`moments`] of many steps no longer than [`SERIES`].
#[inline(always)]
fn series<const SIZE: usize>(a: &[f64; SIZE], decay: &[f64; SIZE], longest: f64, moment: &mut [[f64; SIZE]; 5]) {
    let (mut term, mut terms) = (1.0, 0);
    while term > 1e-17 {
        terms += 1;
        term *= 2.0 * longest / (terms + 5) as f64;
    }
    let mut sum = [1.0; SIZE];
    for k in (1..=terms).rev() {
        let share = 2.0 / (k + 5) as f64;
        for l in 0..SIZE {
            sum[l] = 1.0 + share * a[l] * sum[l];
        }
    }
    for l in 0..SIZE {
        let (a, end) = (a[l], decay[l] * decay[l]);
        let a2 = a * a;
        moment[4][l] = 0.2 * end * a2 * a2 * a * sum[l];
        moment[3][l] = (2.0 * moment[4][l] + a2 * a2 * end) / 4.0;
        moment[2][l] = (2.0 * moment[3][l] + a2 * a * end) / 3.0;
        moment[1][l] = (2.0 * moment[2][l] + a2 * end) / 2.0;
        moment[0][l] = 2.0 * moment[1][l] + a * end;
    }
}

#[cfg(test)]
mod tests {
    use super::super::matern::{FiveHalves, Half, ThreeHalves};
    use super::*;

    #[test]
    fn many_steps_at_once_are_the_steps_one_by_one() {
        fn check<const M: usize, S: Form<M>>() {
            for scale in [1e-5, 0.01, 0.3, 3.0] {
                let mut time = vec![0.0];
                (0..150).for_each(|i| time.push(time[i] + scale * (1.0 + (1.3 * i as f64).sin())));
                time[30] = time[29];
                let (mut steps, mut back) = (Steps::<M>::new(), Steps::<M>::new());
                for i in (1..time.len()).rev() {
                    let place = back.reach_back::<S>(1.0, &time, i);
                    assert_eq!(back.at(place).2, time[i] - time[i - 1]);
                }
                for i in 1..time.len() {
                    let place = steps.reach::<S>(1.0, &time, i);
                    let (transition, noise, a) = steps.at(place);
                    let mut one = Step::<M>::new();
                    one.set::<S>(1.0, time[i] - time[i - 1]);
                    assert_eq!(a, one.a);
                    for (row, exact) in transition.iter().flatten().zip(one.transition.iter().flatten()) {
                        assert!((row - exact).abs() < 1e-15);
                    }
                    for (found, exact) in noise.iter().flatten().zip(one.noise.iter().flatten()) {
                        // Two roundings of the exponential, and a few of the sums.
                        assert!(
                            (found - exact).abs() <= 1e-14 * exact.abs().max(noise[0][0].abs()),
                            "{found:e} {exact:e}"
                        );
                    }
                }
            }
        }
        check::<1, Half>();
        check::<2, ThreeHalves>();
        check::<3, FiveHalves>();
    }
}
