//! What suspects are screened against: a fit's residuals, whitened, with everything that is free projected out.
//!
//! Initial states and free parameters are eliminated first (Frisch and Waugh 1933), so that an effect which another parameter value
//! or initial state could imitate has no gain. The same is done for the fit without one or two of its effects, each a [`View`]: what
//! any suspect would do in their place then follows from products of columns alone.

use crate::diagnose::fit::colours::colour::Colour;
use crate::diagnose::fit::colours::noise::Noise;
use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::fitter::starts;
use crate::diagnose::fit::guide::whiten;
use crate::diagnose::fit::moved::is_strained;
use crate::diagnose::limits::MOST_STRAINED;
use crate::refine::Starts;
use crate::refine::dots::{dots, reject};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Residuals of a fit after whitening and projection, and what is needed to treat columns alike.
pub(crate) struct Basis {
    pub(crate) noise: Noise,
    windows: Vec<Projected>,
    first: First,
    /// The fit as it stands, then without some of its effects.
    views: Vec<View>,
    /// Parameters that stand where their tolerance ends: an effect may let them back, never further out.
    strained: Vec<Strained>,
}

/// Effects of a fit that are left out, and what that does to the outputs.
pub(crate) struct Out {
    /// Their places, and those of their parameters among the free ones.
    pub(crate) places: Vec<usize>,
    pub(crate) free: Vec<usize>,
    /// Change of the noise-scaled outputs, a list for each window.
    pub(crate) change: Vec<DVector<f64>>,
}

/// A fit without some of its effects, all other free quantities at their best.
pub(crate) struct View {
    /// The places that are left out.
    pub(crate) places: Vec<usize>,
    /// By how much twice the negative log likelihood is above that of the whole fit, by a straight line.
    pub(crate) loss: f64,
    /// Its residual as a sum of those of the windows, each so many times.
    weights: DVector<f64>,
    /// The free parameters that it has.
    kept: Vec<usize>,
    /// Inverse of their Gram matrix, and their product with the residual.
    inverse: DMatrix<f64>,
    slope: DVector<f64>,
}

/// The values of a window's first samples, and by how much they count more than the others.
struct First {
    values: usize,
    weight: f64,
}

impl First {
    fn weigh(&self, values: &mut DVector<f64>) {
        values.iter_mut().take(self.values).for_each(|value| *value *= self.weight);
    }
}

/// A tolerated parameter at the end of its tolerance, as a column that points back.
struct Strained {
    /// Its place among the free parameters, and the way back to its nominal value.
    place: usize,
    back: f64,
    /// What its belief adds to the column's product with itself, and as much to that with the residual.
    belief: f64,
    /// Per window, whitened and projected like the free directions.
    column: Vec<DVector<f64>>,
}

/// One window.
struct Projected {
    whitening: Whitening,
    /// Orthonormal directions of the initial state.
    directions: DMatrix<f64>,
    /// That of the fit, then of all that is left out but for two effects: what they do is the sum of what each does.
    residuals: Vec<DVector<f64>>,
    /// Directions of the free parameters.
    free: DMatrix<f64>,
}

impl Projected {
    fn project(&self, first: &First, values: &mut DVector<f64>) {
        self.whitening.apply(values);
        first.weigh(values);
        reject(&self.directions, values);
    }
}

/// What makes a window's values white.
enum Whitening {
    /// Noise with a memory, column by column.
    Noise(Whitener),
    /// The innovations of a filter, sample by sample.
    Innovations(Arc<Vec<DMatrix<f64>>>),
}

impl Whitening {
    fn apply(&self, values: &mut DVector<f64>) {
        match self {
            Self::Noise(whitener) => whitener.whiten(values),
            Self::Innovations(by_sample) => whiten(by_sample, values),
        }
    }
}

impl Basis {
    /// Noise as white as the residual is large where `white`, else of the residual's colours; a filter's innovations are what it
    /// expects. One view for each of `outs`, behind that of the fit as it stands.
    pub(crate) fn new(at: &Linearised<'_>, noise: Noise, outs: &[Out]) -> Self {
        let Linearised { contestant: fitted, jacobian, guide, .. } = at;
        let plain = |c: &Colour| Colour {
            coefficients: Vec::new(),
            innovation: 1.0,
            error: 1.0,
            covariance: vec![1.0],
            count: c.count,
        };
        let colours: Vec<Colour> =
            fitted.evidence.colours.iter().map(|c| if noise == Noise::White { plain(c) } else { c.clone() }).collect();
        let (n, q) = (jacobian.n_states, fitted.free.len());
        let mut strained: Vec<Strained> = (0..q)
            .filter(|&place| is_strained(fitted, place))
            .filter_map(|place| {
                let (mean, sd) = fitted.free[place].prior?;
                let back = mean - fitted.refined.parameters[fitted.free[place].parameter];
                Some(Strained { place, back, belief: (back / sd).powi(2), column: Vec::new() })
            })
            .take(MOST_STRAINED)
            .collect();
        let starts = if guide.is_some() { Starts::default() } else { starts(fitted) };
        let first = First { values: starts.samples * fitted.experiment.columns.len(), weight: starts.weight(0).sqrt() };
        let alone: Vec<&Out> = outs.iter().filter(|out| !is_sum(out)).collect();
        let projected = |(window, block): (usize, &crate::refine::Block)| {
            let whitening = match guide {
                Some(guide) => Whitening::Innovations(guide.whitening[window].clone()),
                None => Whitening::Noise(Whitener::new(
                    &colours,
                    &block.present,
                    &fitted.experiment.repeats(&fitted.experiment.windows[window]),
                )),
            };
            let mut derivative = block.derivative.clone();
            for mut column in derivative.column_iter_mut() {
                let mut values = column.clone_owned();
                whitening.apply(&mut values);
                first.weigh(&mut values);
                column.copy_from(&values);
            }
            let directions = orthonormal(derivative.columns(0, n).into_owned());
            let mut free = derivative.columns(n, q).into_owned();
            free -= &directions * directions.tr_mul(&free);
            for strained in &mut strained {
                strained.column.push(free.column(strained.place) * strained.back);
            }
            // What stands where its tolerance ends does not go further for an effect.
            (0..q).filter(|&i| is_strained(fitted, i)).for_each(|i| free.column_mut(i).fill(0.0));
            let mut own = Projected { whitening, directions, residuals: Vec::new(), free };
            let without = alone.iter().map(|out| &block.residual - &out.change[window]);
            for mut residual in std::iter::once(block.residual.clone()).chain(without) {
                own.project(&first, &mut residual);
                own.residuals.push(residual);
            }
            own
        };
        let windows: Vec<Projected> = jacobian.blocks.iter().enumerate().map(projected).collect();
        let mut gram = DMatrix::zeros(q, q);
        windows.iter().for_each(|w| gram += w.free.tr_mul(&w.free));
        let mut belief = DVector::zeros(q);
        for (i, free) in fitted.free.iter().enumerate() {
            if let Some((mean, sd)) = free.prior {
                // A belief is one more measurement, of the parameter itself.
                gram[(i, i)] += 1.0 / (sd * sd);
                belief[i] = (mean - fitted.refined.parameters[free.parameter]) / (sd * sd);
            }
        }
        let count = 1 + alone.len();
        let mut squares = DMatrix::zeros(count, count);
        let mut products = DMatrix::from_fn(q, count, |i, _| belief[i]);
        for Projected { residuals, free, .. } in &windows {
            let all = DMatrix::from_columns(residuals);
            products += free.tr_mul(&all);
            squares += all.tr_mul(&all);
        }
        let mut views: Vec<View> = Vec::with_capacity(1 + outs.len());
        let mut whole = 0.0;
        for number in 0..=outs.len() {
            let out = number.checked_sub(1).map(|place| &outs[place]);
            let weights = weights(&alone, out);
            let kept: Vec<usize> = (0..q).filter(|i| out.is_none_or(|out| !out.free.contains(i))).collect();
            let own = DMatrix::from_fn(kept.len(), kept.len(), |i, j| gram[(kept[i], kept[j])]);
            let ridge = if kept.is_empty() { 0.0 } else { own.diagonal().max() * 1e-12 } + f64::MIN_POSITIVE;
            let unit = DMatrix::identity(kept.len(), kept.len());
            let inverse = (own + &unit * ridge).try_inverse().unwrap_or_else(|| DMatrix::zeros(kept.len(), kept.len()));
            let product = &products * &weights;
            let slope = DVector::from_iterator(kept.len(), kept.iter().map(|&i| product[i]));
            let cost = weights.dot(&(&squares * &weights)) - slope.dot(&(&inverse * &slope));
            if number == 0 {
                whole = cost;
            }
            let places = out.map_or_else(Vec::new, |out| out.places.clone());
            views.push(View { places, loss: cost - whole, weights, kept, inverse, slope });
        }
        Self { noise, windows, first, views, strained }
    }

    /// The fit as it stands, and without some of its effects.
    pub(crate) fn views(&self) -> &[View] {
        &self.views
    }

    /// Bounds of the lengths of the strained columns: anywhere back, nowhere further out.
    pub(super) fn back(&self) -> impl Iterator<Item = (f64, f64)> {
        self.strained.iter().map(|_| (0.0, f64::INFINITY))
    }

    /// Products of columns (one list of windows each) among themselves and with the residual, for each view; the strained
    /// parameters are further columns.
    pub(crate) fn products(&self, columns: &mut [Vec<DVector<f64>>]) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        for column in columns.iter_mut() {
            self.windows.iter().zip(column).for_each(|(window, values)| window.project(&self.first, values));
        }
        let all: Vec<&Vec<DVector<f64>>> = columns.iter().chain(self.strained.iter().map(|s| &s.column)).collect();
        let (own, k) = (columns.len(), all.len());
        let q = self.windows.first().map_or(0, |w| w.free.ncols());
        // Of every column the products with the residuals, with the free directions and with the columns up to itself.
        let alone = self.windows.first().map_or(0, |w| w.residuals.len());
        let mut products: Vec<Vec<f64>> = (1..=k).map(|upto| vec![0.0; alone + q + upto]).collect();
        for (w, Projected { residuals, free, .. }) in self.windows.iter().enumerate() {
            let mut others: Vec<&[f64]> = residuals.iter().map(DVector::as_slice).collect();
            others.extend(free.as_slice().chunks_exact(free.nrows().max(1)));
            for (column, products) in all.iter().zip(&mut products) {
                others.push(column[w].as_slice());
                dots(column[w].as_slice(), &others, products);
            }
        }
        let (first, behind) = (alone, alone + q);
        let mut gram = DMatrix::from_fn(k, k, |i, j| products[i.max(j)][behind + i.min(j)]);
        let mixed = DMatrix::from_fn(q, k, |i, j| products[j][first + i]);
        let mut slopes = DMatrix::from_fn(k, first, |i, residual| products[i][residual]);
        for (i, strained) in self.strained.iter().enumerate() {
            gram[(own + i, own + i)] += strained.belief;
            slopes.row_mut(own + i).add_scalar_mut(strained.belief);
        }
        let of = |view: &View| {
            let slope = &slopes * &view.weights;
            let mixed = DMatrix::from_fn(view.kept.len(), k, |i, j| mixed[(view.kept[i], j)]);
            let eliminated = &view.inverse * &mixed;
            (&gram - mixed.tr_mul(&eliminated), slope - eliminated.tr_mul(&view.slope))
        };
        self.views.iter().map(of).collect()
    }

    /// Whether a parameter stands where its tolerance ends.
    pub(super) fn is_strained(&self) -> bool {
        !self.strained.is_empty()
    }
}

/// Whether what is left out is two effects, of which each is left out alone, too.
fn is_sum(out: &Out) -> bool {
    out.places.len() == 2
}

/// The residual of a view as a sum of that of the fit and those of what is left out `alone`.
fn weights(alone: &[&Out], out: Option<&Out>) -> DVector<f64> {
    let mut weights = DVector::zeros(1 + alone.len());
    weights[0] = 1.0;
    let mut less = |is_it: &dyn Fn(&Out) -> bool| {
        if let Some(own) = alone.iter().position(|other| is_it(other)) {
            weights[1 + own] += 1.0;
            weights[0] -= 1.0;
        }
    };
    match out {
        Some(out) if is_sum(out) => out.places.iter().for_each(|place| less(&|other| other.places == [*place])),
        Some(out) => less(&|other| std::ptr::eq(other, out)),
        None => {}
    }
    weights
}

/// Orthonormal basis of the columns that are not negligible (modified Gram-Schmidt).
fn orthonormal(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut kept: Vec<DVector<f64>> = Vec::new();
    for column in matrix.column_iter_mut() {
        let size = column.norm();
        let mut values = column.clone_owned();
        for _ in 0..2 {
            for other in &kept {
                let part = other.dot(&values);
                values.axpy(-part, other, 1.0);
            }
        }
        let left = values.norm();
        if left > 1e-8 * size && left > 0.0 {
            kept.push(values / left);
        }
    }
    if kept.is_empty() { DMatrix::zeros(matrix.nrows(), 0) } else { DMatrix::from_columns(&kept) }
}
