//! The Matern processes as linear stochastic differential equations `dz = F z da + e_last dw` in scaled time `a = lambda dt`.
//!
//! The state is (x, x'/lambda, x''/lambda^2), so that its stationary covariance is a constant matrix and the transition
//! over a is `exp(F a)`.
//! Source: Hartikainen & Sarkka 2010, Kalman filtering and smoothing solutions to temporal Gaussian process regression
//! models.

pub(super) type Matrix<const M: usize> = [[f64; M]; M];
pub(super) type Vector<const M: usize> = [f64; M];

/// A Matern process in scaled state-space form: `dz = F z da + e_last dw`, spectral density `Q`.
pub(super) trait Form<const M: usize> {
    /// lambda times the length of the kernel.
    const RATE: f64;
    /// Stationary covariance for unit amplitude.
    const STATIONARY: Matrix<M>;
    /// Density of the driving noise; it acts on the last component.
    const Q: f64;
    /// `exp(F a)`, given a and `exp(-a)`.
    fn transition(a: f64, decay: f64) -> Matrix<M>;
    /// Covariance that the driving noise adds over a, given `moments(a)`; accurate relative to each element, however small a is.
    fn process_noise(moments: [f64; 5]) -> Matrix<M>;
    /// `F x`.
    fn turn(x: Vector<M>) -> Vector<M>;
}

pub(super) struct Half;
pub(super) struct ThreeHalves;
pub(super) struct FiveHalves;

impl Form<1> for Half {
    const RATE: f64 = 1.0;
    const STATIONARY: Matrix<1> = [[1.0]];
    const Q: f64 = 2.0;

    #[inline(always)]
    fn transition(_: f64, decay: f64) -> Matrix<1> {
        [[decay]]
    }

    #[inline(always)]
    fn process_noise([i0, ..]: [f64; 5]) -> Matrix<1> {
        [[Self::Q * i0]]
    }

    #[inline(always)]
    fn turn([x]: Vector<1>) -> Vector<1> {
        [-x]
    }
}

impl Form<2> for ThreeHalves {
    const RATE: f64 = 1.732_050_807_568_877_2;
    const STATIONARY: Matrix<2> = [[1.0, 0.0], [0.0, 1.0]];
    const Q: f64 = 4.0;

    #[inline(always)]
    fn transition(a: f64, decay: f64) -> Matrix<2> {
        [[decay * (1.0 + a), decay * a], [-decay * a, decay * (1.0 - a)]]
    }

    #[inline(always)]
    fn process_noise([i0, i1, i2, ..]: [f64; 5]) -> Matrix<2> {
        // The impulse response is e^-s (s, 1 - s).
        let cross = Self::Q * (i1 - i2);
        [[Self::Q * i2, cross], [cross, Self::Q * (i0 - 2.0 * i1 + i2)]]
    }

    #[inline(always)]
    fn turn([x, y]: Vector<2>) -> Vector<2> {
        [y, -x - 2.0 * y]
    }
}

impl Form<3> for FiveHalves {
    const RATE: f64 = 2.236_067_977_499_79;
    const STATIONARY: Matrix<3> = [[1.0, 0.0, -1.0 / 3.0], [0.0, 1.0 / 3.0, 0.0], [-1.0 / 3.0, 0.0, 1.0]];
    const Q: f64 = 16.0 / 3.0;

    #[inline(always)]
    fn transition(a: f64, decay: f64) -> Matrix<3> {
        // exp(F a) = e^-a (1 + N a + N^2 a^2/2) with the nilpotent N = F + 1.
        let (l, q) = (decay * a, decay * a * a * 0.5);
        [
            [decay + l + q, l + 2.0 * q, q],
            [-q, decay + l - 2.0 * q, l - q],
            [q - l, 2.0 * q - 3.0 * l, decay - 2.0 * l + q],
        ]
    }

    #[inline(always)]
    fn process_noise([i0, i1, i2, i3, i4]: [f64; 5]) -> Matrix<3> {
        // The impulse response is e^-s (s^2/2, s - s^2/2, 1 - 2 s + s^2/2).
        let q00 = Self::Q * 0.25 * i4;
        let q01 = Self::Q * (0.5 * i3 - 0.25 * i4);
        let q02 = Self::Q * (0.5 * i2 - i3 + 0.25 * i4);
        let q11 = Self::Q * (i2 - i3 + 0.25 * i4);
        let q12 = Self::Q * (i1 - 2.5 * i2 + 1.5 * i3 - 0.25 * i4);
        let q22 = Self::Q * (i0 - 4.0 * i1 + 5.0 * i2 - 2.0 * i3 + 0.25 * i4);
        [[q00, q01, q02], [q01, q11, q12], [q02, q12, q22]]
    }

    #[inline(always)]
    fn turn([x, y, z]: Vector<3>) -> Vector<3> {
        [y, z, -x - 3.0 * (y + z)]
    }
}

#[cfg(test)]
// Indices of small matrices read as in the formulas.
#[allow(clippy::needless_range_loop)]
mod tests {
    use super::super::scaled::sandwich;
    use super::super::steps::moments;
    use super::*;

    #[test]
    fn the_process_noise_is_what_the_transition_takes_from_the_stationary_covariance() {
        fn check<const M: usize, S: Form<M>>() {
            for a in [0.3f64, 1.0, 1.9, 2.1, 5.0, 40.0] {
                let decay = (-a).exp();
                let kept = sandwich::<M, false>(&S::transition(a, decay), &S::STATIONARY);
                let added = S::process_noise(moments(a, decay));
                for i in 0..M {
                    for j in 0..M {
                        // A few roundings of numbers of order one.
                        assert!((kept[i][j] + added[i][j] - S::STATIONARY[i][j]).abs() < 2e-15, "{a} {i} {j}");
                    }
                }
            }
        }
        check::<1, Half>();
        check::<2, ThreeHalves>();
        check::<3, FiveHalves>();
    }

    #[test]
    fn a_short_step_adds_noise_of_the_right_order() {
        let a = 1e-4f64;
        let q = FiveHalves::process_noise(moments(a, (-a).exp()));
        // Leading term 16/3 a^5/20; the next is 1e-4 relative.
        assert!((q[0][0] / (16.0 / 3.0 * a.powi(5) / 20.0) - 1.0).abs() < 2e-4);
    }
}
