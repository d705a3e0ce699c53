//! One accepted step and the solution inside it.

/// A step from `start` over `length` with a polynomial through it.
///
/// With `s = (t - start)/length` and `z = 1 - s` the state is
/// `c0 + s (c1 + z (c2 + s (c3 + z c4)))`; with `c4 = 0` this is the cubic through both ends' values and slopes.
///
/// Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.6.
#[derive(Debug, Clone, Default)]
pub(super) struct DenseStep {
    pub(super) start: f64,
    pub(super) length: f64,
    pub(super) coefficients: [Vec<f64>; 5],
}

impl DenseStep {
    pub(super) fn new(n: usize) -> Self {
        Self { start: 0.0, length: 0.0, coefficients: std::array::from_fn(|_| vec![0.0; n]) }
    }

    /// The cubic through states `x0`, `x1` with rates `f0`, `f1`.
    pub(super) fn set_cubic(&mut self, start: f64, length: f64, x0: &[f64], x1: &[f64], f0: &[f64], f1: &[f64]) {
        (self.start, self.length) = (start, length);
        for j in 0..x0.len() {
            let rise = x1[j] - x0[j];
            let c2 = length * f0[j] - rise;
            self.coefficients[0][j] = x0[j];
            self.coefficients[1][j] = rise;
            self.coefficients[2][j] = c2;
            self.coefficients[3][j] = rise - length * f1[j] - c2;
            self.coefficients[4][j] = 0.0;
        }
    }

    pub(super) fn end(&self) -> f64 {
        self.start + self.length
    }

    /// State `j` at time `t`, s.
    pub(super) fn value(&self, t: f64, j: usize) -> f64 {
        let s = if self.length == 0.0 { 0.0 } else { (t - self.start) / self.length };
        let z = 1.0 - s;
        let [c0, c1, c2, c3, c4] = &self.coefficients;
        c0[j] + s * (c1[j] + z * (c2[j] + s * (c3[j] + z * c4[j])))
    }
}
