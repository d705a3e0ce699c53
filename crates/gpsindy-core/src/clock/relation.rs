//! A relation between columns of two topics, and the shift at which it holds best.

use super::windows::{Trace, Windows};
use super::{BLOCKS, CLEAR, COARSE, DRIVEN, SAME};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// Derivatives of two columns that measure one motion: of the one that stays, and of the one that moves.
const PAIRS: [(usize, usize); 5] = [(1, 1), (1, 0), (0, 1), (2, 0), (0, 2)];

/// Most states whose powers count, and most columns of a regression as a share of the windows.
const MOST_STATES: usize = 6;
const LARGEST: f64 = 0.1;

/// Parts of a column that remain after those before it, or it adds nothing.
const NEW: f64 = 1e-6;

/// Steps of the fine search: 0.618^30 of a coarse one is far below a nanosecond.
const FINE: usize = 30;

/// What is regressed on what.
#[derive(Debug)]
pub(super) struct Relation<'a> {
    fixed: &'a Trace,
    moved: Vec<&'a Trace>,
    /// Derivative of the moved columns.
    order: usize,
    /// States whose level each moved column is taken times.
    factors: Vec<Vec<f64>>,
    driven: bool,
    /// The column that stays, less what the others explain.
    rest: Vec<f64>,
    /// What stays whatever the shift: orthonormal columns.
    basis: Vec<Vec<f64>>,
    /// Coarse shifts and the sums of squares there.
    coarse: Vec<(f64, f64)>,
}

/// The best shift of a relation.
#[derive(Debug)]
pub(super) struct Fit {
    pub(super) shift: f64,
    /// Its standard error.
    pub(super) error: f64,
    pub(super) moved: String,
    pub(super) fixed: String,
    pub(super) driven: bool,
}

impl<'a> Relation<'a> {
    /// The relation that explains most.
    ///
    /// # Errors
    /// None that explains enough, in words.
    pub(super) fn of(
        windows: &Windows,
        moved: &[&'a Trace],
        fixed: &[&'a Trace],
        driven: bool,
    ) -> Result<Self, String> {
        let mut found = if driven { driven_by(windows, moved, fixed) } else { pairs(windows, moved, fixed) };
        for relation in &mut found {
            relation.look(windows);
        }
        let best = found.into_iter().max_by(|a, b| a.explained().total_cmp(&b.explained()));
        let Some(best) = best else { return Err("too few samples for the states that there are".into()) };
        let (explained, least) = (best.explained(), if driven { DRIVEN } else { SAME });
        if explained < least {
            let (moved, fixed) = (best.moved_name(), &best.fixed.name);
            return Err(format!(
                "`{moved}` explains {:.0} % of what moves `{fixed}`, and nothing explains more; at least {:.0} % are needed",
                100.0 * explained,
                100.0 * least
            ));
        }
        Ok(best)
    }

    fn moved_name(&self) -> String {
        self.moved.iter().map(|t| t.name.as_str()).collect::<Vec<_>>().join("`, `")
    }

    /// The moved columns and their products with states, at a shift.
    fn columns(&self, windows: &Windows, shift: f64) -> Vec<Vec<f64>> {
        let mut columns = Vec::new();
        for trace in &self.moved {
            let level = windows.weak(trace, self.order, shift);
            columns.extend(self.factors.iter().map(|f| f.iter().zip(&level).map(|(f, v)| f * v).collect()));
            columns.push(level);
        }
        columns
    }

    /// What is left of the fixed column at a shift: the sum of squares.
    fn left(&self, windows: &Windows, shift: f64) -> f64 {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut column in self.columns(windows, shift) {
            let before = norm(&column);
            remove(&self.basis, &mut column);
            remove(&basis, &mut column);
            add(&mut basis, column, before);
        }
        let all = dot(&self.rest, &self.rest);
        basis.iter().fold(all, |left, column| left - dot(column, &self.rest).powi(2)).max(0.0)
    }

    fn look(&mut self, windows: &Windows) {
        let step = COARSE * windows.width;
        let count = (windows.reach / step).floor() as i64;
        let shifts = (-count..=count).map(|i| i as f64 * step);
        self.coarse = shifts.map(|shift| (shift, self.left(windows, shift))).collect();
    }

    fn best(&self) -> (f64, f64) {
        self.coarse.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, f64::INFINITY))
    }

    /// Share of the sum of squares that the moved columns explain at the best shift.
    fn explained(&self) -> f64 {
        let all = dot(&self.rest, &self.rest);
        if all > 0.0 { 1.0 - self.best().1 / all } else { 0.0 }
    }

    /// The best shift and its standard error.
    ///
    /// # Errors
    /// Another shift that fits as well, in words.
    pub(super) fn fit(&self, windows: &Windows) -> Result<Fit, String> {
        let step = COARSE * windows.width;
        let shift = self.fine(windows, self.best().0, step);
        if let Some(other) = self.rival(windows, shift) {
            return Err(format!(
                "shifts by {shift:.3} s and by {other:.3} s fit equally well, as in a motion that repeats itself"
            ));
        }
        let mut error = self.jackknife(windows, shift, step);
        // A parabola through shifts that lie apart as far as the estimate scatters.
        if error > step {
            error = self.jackknife(windows, shift, error.min(windows.reach - shift.abs()).max(step));
        }
        let (moved, fixed) = (self.moved_name(), self.fixed.name.clone());
        Ok(Fit { shift, error, moved, fixed, driven: self.driven })
    }

    /// Golden section around a coarse shift.
    fn fine(&self, windows: &Windows, coarse: f64, step: f64) -> f64 {
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (coarse - step, coarse + step);
        let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
        let (mut at_a, mut at_b) = (self.left(windows, a), self.left(windows, b));
        for _ in 0..FINE {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = high - golden * (high - low);
                at_a = self.left(windows, a);
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = low + golden * (high - low);
                at_b = self.left(windows, b);
            }
        }
        0.5 * (low + high)
    }

    /// Another valley that is not clearly higher: block by block against the best shift.
    fn rival(&self, windows: &Windows, shift: f64) -> Option<f64> {
        let valleys = self.coarse.windows(3).filter(|w| w[1].1 < w[0].1 && w[1].1 < w[2].1).map(|w| w[1]);
        let apart = valleys.filter(|(other, _)| (other - shift).abs() > windows.width);
        let (other, _) = apart.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let other = self.fine(windows, other, COARSE * windows.width);
        let (here, there) = (self.by_block(windows, shift), self.by_block(windows, other));
        // As ratios, so that a block with much motion does not speak for all.
        let worse: Vec<f64> = here.iter().zip(&there).map(|(a, b)| (b / a).ln()).collect();
        let mean = worse.iter().sum::<f64>() / BLOCKS as f64;
        let spread = worse.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (BLOCKS - 1) as f64;
        (mean < CLEAR * (spread / BLOCKS as f64).sqrt()).then_some(other)
    }

    /// Sums of squares of each block, fitted without it.
    fn by_block(&self, windows: &Windows, shift: f64) -> Vec<f64> {
        let grams = Grams::new(self, windows, shift);
        (0..BLOCKS).map(|block| grams.outside(block)).collect()
    }

    /// Standard error of the shift: without each block the lowest point of a parabola through three shifts.
    fn jackknife(&self, windows: &Windows, shift: f64, step: f64) -> f64 {
        let grams = [-step, 0.0, step].map(|d| Grams::new(self, windows, shift + d));
        let lowest: Vec<f64> = (0..BLOCKS)
            .map(|block| {
                let [a, b, c] = [0, 1, 2].map(|i| grams[i].without(block));
                let bend = a - 2.0 * b + c;
                if bend > 0.0 { 0.5 * step * (a - c) / bend } else { f64::INFINITY }
            })
            .collect();
        let mean = lowest.iter().sum::<f64>() / BLOCKS as f64;
        let spread = lowest.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        (spread * (BLOCKS - 1) as f64 / BLOCKS as f64).sqrt()
    }
}

/// Columns that measure one motion, two by two.
fn pairs<'a>(windows: &Windows, moved: &[&'a Trace], fixed: &[&'a Trace]) -> Vec<Relation<'a>> {
    let mut found = Vec::new();
    let ones = vec![vec![1.0 / (windows.len() as f64).sqrt(); windows.len()]];
    for (of_fixed, order) in PAIRS {
        for trace in fixed {
            let mut rest = windows.weak(trace, of_fixed, 0.0);
            remove(&ones, &mut rest);
            for other in moved {
                found.push(Relation {
                    fixed: trace,
                    moved: vec![*other],
                    order,
                    factors: Vec::new(),
                    driven: false,
                    rest: rest.clone(),
                    basis: ones.clone(),
                    coarse: Vec::new(),
                });
            }
        }
    }
    found
}

/// Controls that drive the states: each state's first and second derivative.
fn driven_by<'a>(windows: &Windows, moved: &[&'a Trace], fixed: &[&'a Trace]) -> Vec<Relation<'a>> {
    let states = &fixed[..fixed.len().min(MOST_STATES)];
    let levels: Vec<Vec<f64>> = states.iter().map(|t| windows.weak(t, 0, 0.0)).collect();
    let most = LARGEST * windows.len() as f64;
    let times = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let mut own: Vec<Vec<f64>> = vec![vec![1.0; windows.len()]];
    own.extend(levels.clone());
    let (n, m) = (levels.len(), moved.len());
    if (1 + n + n * (n + 1) / 2 + 3 * n + m * (n + 1)) as f64 <= most {
        // A column that is an angle acts through its sine and cosine.
        let waves = states.iter().flat_map(|t| [t.through(f64::sin), t.through(f64::cos)]).flatten();
        own.extend(waves.map(|wave| windows.weak(&wave, 0, 0.0)));
        for (i, a) in levels.iter().enumerate() {
            own.extend(levels[i..].iter().map(|b| times(a, b)));
            own.push(times(&times(a, a), a));
        }
    }
    if (own.len() + m) as f64 > most {
        return Vec::new();
    }
    let factors = if (own.len() + m * (n + 1)) as f64 <= most { levels.clone() } else { Vec::new() };
    let mut found = Vec::new();
    for of_fixed in [1, 2] {
        if of_fixed == 2 {
            own.extend(states.iter().map(|t| windows.weak(t, 1, 0.0)));
        }
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for column in &own {
            let mut column = column.clone();
            let before = norm(&column);
            remove(&basis, &mut column);
            add(&mut basis, column, before);
        }
        for trace in fixed {
            let mut rest = windows.weak(trace, of_fixed, 0.0);
            let before = norm(&rest);
            remove(&basis, &mut rest);
            // The derivative of a state that is logged itself: nothing is left that a control could explain.
            if norm(&rest) <= NEW * before {
                continue;
            }
            found.push(Relation {
                fixed: trace,
                moved: moved.to_vec(),
                order: 0,
                factors: factors.clone(),
                driven: true,
                rest,
                basis: basis.clone(),
                coarse: Vec::new(),
            });
        }
    }
    found
}

/// Products of all columns, block by block; the last one is the column that stays.
struct Grams {
    blocks: Vec<Mat<f64>>,
    all: Mat<f64>,
}

impl Grams {
    fn new(relation: &Relation<'_>, windows: &Windows, shift: f64) -> Self {
        let mut columns = relation.basis.clone();
        let moved = relation.columns(windows, shift);
        // Of length 1, so that the ridge below means the same for all.
        columns.extend(moved.into_iter().map(|column| {
            let size = norm(&column).max(f64::MIN_POSITIVE);
            column.into_iter().map(|v| v / size).collect()
        }));
        columns.push(relation.rest.clone());
        let p = columns.len();
        let mut blocks = vec![Mat::zeros(p, p); BLOCKS];
        for window in 0..windows.len() {
            let block = &mut blocks[windows.block(window)];
            for i in 0..p {
                for j in 0..=i {
                    block[(i, j)] += columns[i][window] * columns[j][window];
                }
            }
        }
        let all = blocks.iter().fold(Mat::zeros(p, p), |sum: Mat<f64>, block| sum + block);
        Self { blocks, all }
    }

    /// Coefficients of a fit without a block, and the sum of squares there.
    fn fitted(&self, block: usize) -> (Mat<f64>, f64) {
        let gram = &self.all - &self.blocks[block];
        let p = gram.nrows() - 1;
        let left = Mat::from_fn(p, p, |i, j| {
            let product = gram[(i.max(j), i.min(j))];
            if i == j { product + 1e-12 } else { product }
        });
        let right = Mat::from_fn(p, 1, |i, _| gram[(p, i)]);
        let Ok(cholesky) = left.llt(Side::Lower) else { return (Mat::zeros(p, 1), f64::INFINITY) };
        let found = cholesky.solve(&right);
        let explained: f64 = (0..p).map(|i| found[(i, 0)] * right[(i, 0)]).sum();
        (found, gram[(p, p)] - explained)
    }

    fn without(&self, block: usize) -> f64 {
        self.fitted(block).1
    }

    /// The sum of squares in a block under the fit without it.
    fn outside(&self, block: usize) -> f64 {
        let (found, _) = self.fitted(block);
        let gram = &self.blocks[block];
        let p = found.nrows();
        let of = |i: usize| if i == p { -1.0 } else { found[(i, 0)] };
        let mut sum = 0.0;
        for i in 0..=p {
            for j in 0..=i {
                sum += of(i) * of(j) * gram[(i, j)] * if i == j { 1.0 } else { 2.0 };
            }
        }
        sum
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Takes away what orthonormal columns explain, twice for the digits.
fn remove(basis: &[Vec<f64>], column: &mut [f64]) {
    for _ in 0..2 {
        for known in basis {
            let part = dot(known, column);
            column.iter_mut().zip(known).for_each(|(v, k)| *v -= part * k);
        }
    }
}

/// Adds what is new in a column of length `before` to orthonormal ones.
fn add(basis: &mut Vec<Vec<f64>>, mut column: Vec<f64>, before: f64) {
    let size = norm(&column);
    if size > NEW * before {
        column.iter_mut().for_each(|v| *v /= size);
        basis.push(column);
    }
}
