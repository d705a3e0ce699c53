//! Four numbers that are computed side by side: in one register where the processor has AVX2 with
//! fused multiplication and addition, else one by one.

/// Arithmetic on four numbers.
pub(super) trait Lanes: Copy {
    /// The four numbers.
    type V: Copy;
    fn four(self, x: [f64; 4]) -> Self::V;
    fn get(self, a: Self::V) -> [f64; 4];
    fn splat(self, x: f64) -> Self::V;
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn times(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`.
    fn plus(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c - a b`.
    fn minus(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    fn over(self, a: Self::V, b: Self::V) -> Self::V;

    /// The first of the four.
    #[inline(always)]
    fn first(self, a: Self::V) -> f64 {
        self.get(a)[0]
    }
}

/// One by one.
#[derive(Clone, Copy)]
pub(super) struct Portable;

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> [f64; 4] {
    std::array::from_fn(f)
}

impl Lanes for Portable {
    type V = [f64; 4];

    #[inline(always)]
    fn four(self, x: [f64; 4]) -> [f64; 4] {
        x
    }
    #[inline(always)]
    fn get(self, a: [f64; 4]) -> [f64; 4] {
        a
    }
    #[inline(always)]
    fn splat(self, x: f64) -> [f64; 4] {
        [x; 4]
    }
    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(|l| a[l] + b[l])
    }
    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(|l| a[l] - b[l])
    }
    #[inline(always)]
    fn times(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(|l| a[l] * b[l])
    }
    #[inline(always)]
    fn plus(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        each(|l| a[l] * b[l] + c[l])
    }
    #[inline(always)]
    fn minus(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        each(|l| c[l] - a[l] * b[l])
    }
    #[inline(always)]
    fn over(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(|l| a[l] / b[l])
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    type V = pulp::f64x4;

    #[inline(always)]
    fn four(self, [x, y, z, w]: [f64; 4]) -> pulp::f64x4 {
        pulp::f64x4(x, y, z, w)
    }
    #[inline(always)]
    fn get(self, a: pulp::f64x4) -> [f64; 4] {
        [a.0, a.1, a.2, a.3]
    }
    #[inline(always)]
    fn splat(self, x: f64) -> pulp::f64x4 {
        self.splat_f64x4(x)
    }
    #[inline(always)]
    fn add(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.add_f64x4(a, b)
    }
    #[inline(always)]
    fn sub(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.sub_f64x4(a, b)
    }
    #[inline(always)]
    fn times(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.mul_f64x4(a, b)
    }
    #[inline(always)]
    fn plus(self, a: pulp::f64x4, b: pulp::f64x4, c: pulp::f64x4) -> pulp::f64x4 {
        self.mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn minus(self, a: pulp::f64x4, b: pulp::f64x4, c: pulp::f64x4) -> pulp::f64x4 {
        self.negate_mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn over(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.div_f64x4(a, b)
    }
}
