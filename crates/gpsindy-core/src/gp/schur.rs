//! Cholesky factor of a symmetric positive definite Toeplitz matrix in O(n^2), where there is too little noise for the
//! recursion of Levinson and Durbin.
//!
//! `T - Z T Z' = a a' - b b'` with the shift Z. Each step turns (a, b) hyperbolically so that b begins with a zero; a then is
//! the next column of the factor L. The residual `T - L L'` is of the size of the rounding of T, as that of Cholesky's own
//! algorithm, where Levinson's error grows with the condition of T.
//! Source: Bojanczyk, Brent, de Hoog & Sweet 1995, On the stability of the Bareiss and related Toeplitz factorization
//! algorithms; Chandrasekaran & Sayed 1996, Stabilizing the generalized Schur algorithm (the order of the rotation).

/// Vectors and the factor, which a fit uses again and again.
#[derive(Default)]
pub(super) struct Schur {
    /// The part of a from its first element that is not zero: column k of L from the diagonal down, after step k.
    column: Vec<f64>,
    b: Vec<f64>,
    /// The columns of L from their diagonals down, one after the other; filled where the inverse is asked for.
    lower: Vec<f64>,
    /// `L^-1 y`, at the end `T^-1 y`.
    pub(super) solution: Vec<f64>,
    /// `L^-1 e_0`, at the end the first column of `T^-1`.
    pub(super) inverse: Vec<f64>,
}

impl Schur {
    /// Returns `ln|T|` and `y' T^-1 y` for the first column of T; fills `solution` and `inverse` where `solve` asks for them.
    ///
    /// `None` where T is not positive definite to rounding.
    pub(super) fn factorise(
        &mut self,
        first: impl DoubleEndedIterator<Item = f64> + ExactSizeIterator,
        targets: &[f64],
        solve: bool,
    ) -> Option<(f64, f64)> {
        let n = targets.len();
        self.column.clear();
        self.column.extend(first);
        self.b.clear();
        self.b.extend_from_slice(&self.column);
        self.lower.clear();
        self.solution.clear();
        self.solution.extend_from_slice(targets);
        self.inverse.clear();
        if solve {
            self.lower.reserve(n * (n + 1) / 2);
            self.inverse.resize(n, 0.0);
            self.inverse[0] = 1.0;
        }
        let Self { column, b, lower, solution, inverse } = self;
        let result = pulp::Arch::new().dispatch(Forward { column, b, lower, solution, inverse, solve })?;
        if solve {
            pulp::Arch::new().dispatch(Backward { lower, solution, inverse });
        }
        Some(result)
    }
}

/// The factorisation, and `L^-1` on both right-hand sides as its columns come.
struct Forward<'a> {
    column: &'a mut [f64],
    b: &'a mut [f64],
    lower: &'a mut Vec<f64>,
    solution: &'a mut [f64],
    inverse: &'a mut [f64],
    solve: bool,
}

impl pulp::WithSimd for Forward<'_> {
    type Output = Option<(f64, f64)>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
        let Self { column, b, lower, solution, inverse, solve } = self;
        let n = solution.len();
        let root = column.first()?.sqrt();
        // Negated, so that what is not a number fails too.
        if !(root > 0.0) {
            return None;
        }
        for (a, b) in column.iter_mut().zip(b.iter_mut()) {
            *a /= root;
            *b = *a;
        }
        b[0] = 0.0;
        let (mut log_determinant, mut fit) = (0.0, 0.0);
        for k in 0..n {
            let (a, b) = (&mut column[..n - k], &mut b[k..]);
            if k > 0 {
                let reflection = b[0] / a[0];
                let square = (1.0 - reflection) * (1.0 + reflection);
                if !(square > 0.0) {
                    return None;
                }
                let cosine = square.sqrt();
                let inverse = 1.0 / cosine;
                for (a, b) in a.iter_mut().zip(b) {
                    // The second from the new first: this order keeps the errors small.
                    *a = (*a - reflection * *b) * inverse;
                    *b = cosine * *b - reflection * *a;
                }
            }
            let pivot = a[0];
            if !(pivot > 0.0) {
                return None;
            }
            log_determinant += 2.0 * pivot.ln();
            let own = solution[k] / pivot;
            fit += own * own;
            solution[k] = own;
            let below = &a[1..];
            for (r, l) in solution[k + 1..].iter_mut().zip(below) {
                *r -= own * l;
            }
            if solve {
                let own = inverse[k] / pivot;
                inverse[k] = own;
                for (r, l) in inverse[k + 1..].iter_mut().zip(below) {
                    *r -= own * l;
                }
                lower.extend_from_slice(a);
            }
        }
        Some((log_determinant, fit))
    }
}

/// `L^-T` on both right-hand sides.
struct Backward<'a> {
    lower: &'a [f64],
    solution: &'a mut [f64],
    inverse: &'a mut [f64],
}

impl pulp::WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { lower, solution, inverse } = self;
        let n = solution.len();
        let mut end = lower.len();
        for k in (0..n).rev() {
            let column = &lower[end - (n - k)..end];
            end -= n - k;
            let [own, first] = super::dots::two_dots(&column[1..], &solution[k + 1..], &inverse[k + 1..]);
            solution[k] = (solution[k] - own) / column[0];
            inverse[k] = (inverse[k] - first) / column[0];
        }
    }
}
