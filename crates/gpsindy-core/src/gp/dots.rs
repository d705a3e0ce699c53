//! Dot products in several running sums.

/// Dot products of `row` with two vectors (the second may be empty), in sixteen running sums.
#[inline(always)]
pub(super) fn two_dots(row: &[f64], first: &[f64], second: &[f64]) -> [f64; 2] {
    const L: usize = 16;
    let (mut s1, mut s2) = ([0.0; L], [0.0; L]);
    let body = row.len() / L * L;
    let n = row.len();
    let first = &first[..n];
    if second.is_empty() {
        for (r, a) in row.chunks_exact(L).zip(first.chunks_exact(L)) {
            for l in 0..L {
                s1[l] += r[l] * a[l];
            }
        }
        let tail: f64 = row[body..].iter().zip(&first[body..]).map(|(r, a)| r * a).sum();
        return [s1.iter().sum::<f64>() + tail, 0.0];
    }
    let second = &second[..n];
    for ((r, a), b) in row.chunks_exact(L).zip(first.chunks_exact(L)).zip(second.chunks_exact(L)) {
        for l in 0..L {
            s1[l] += r[l] * a[l];
            s2[l] += r[l] * b[l];
        }
    }
    let tail = |v: &[f64]| row[body..].iter().zip(&v[body..]).map(|(r, a)| r * a).sum::<f64>();
    [s1.iter().sum::<f64>() + tail(first), s2.iter().sum::<f64>() + tail(second)]
}
