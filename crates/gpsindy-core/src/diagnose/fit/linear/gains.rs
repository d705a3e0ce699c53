//! Linearised gains: how far each hypothesis would improve the fit, with all free quantities projected out.
//!
//! A column is the change of the whitened outputs when the hypothesis is switched on at its start values.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Added, Applied, Combine, Start};
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::colours::noise::ByNoise;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::linear::basis::Basis;
use crate::diagnose::fit::linear::bounded::{bounded_gain, span_gain};
use crate::diagnose::fit::linear::responses::{LANES, responses, responses_to_terms};
use crate::diagnose::limits::{SHOWN, STEP};
use crate::refine::dots::squares;
use nalgebra::{DMatrix, DVector};

/// What a start of a hypothesis would gain.
#[derive(Debug, Clone)]
pub(crate) struct Gain {
    /// Decrease of twice the negative log likelihood, by a straight line.
    pub(crate) gain: f64,
    /// Start values of the added parameters for a fit.
    pub(crate) values: Vec<f64>,
    /// Degrees of freedom of this start.
    pub(crate) degrees: usize,
    /// Standard deviation of the size that the first column moves, where it moves one from where it does nothing; `None` where only sizes
    /// beyond the typical one would show.
    pub(crate) deviation: Option<f64>,
}

impl Basis {
    /// Best straight-line gain of columns that belong together, for each view.
    fn gains(&self, start: &Start, fitted: &[(usize, Added)], columns: &mut [Vec<DVector<f64>>]) -> Vec<Gain> {
        let before: Vec<f64> = columns.iter().map(|column| squares(column)).collect();
        let count = columns.len();
        let products = self.products(columns);
        products.into_iter().map(|products| self.gain(start, fitted, (&before, count), products)).collect()
    }

    /// The same for one view; nothing where a column is not finite.
    pub(crate) fn gain_in(
        &self,
        view: usize,
        start: &Start,
        fitted: &[(usize, Added)],
        columns: &mut [Vec<DVector<f64>>],
    ) -> Gain {
        let found = are_finite(columns).then(|| self.gains(start, fitted, columns).swap_remove(view));
        found.unwrap_or_else(|| Gain::nothing(start))
    }

    fn gain(
        &self,
        start: &Start,
        fitted: &[(usize, Added)],
        (before, count): (&[f64], usize),
        (gram, slope): (DMatrix<f64>, DVector<f64>),
    ) -> Gain {
        let nothing = Gain::nothing(start);
        // What is left after the projection must not be rounding error.
        let usable = |i: usize| gram[(i, i)] > 1e-9 * before[i] && gram[(i, i)].is_finite() && gram[(i, i)] > 0.0;
        match start.combine {
            Combine::Keep if usable(0) && self.is_strained() => {
                let bounds: Vec<(f64, f64)> = std::iter::once(STEP).chain(self.back()).collect();
                let (gain, _) = bounded_gain(&gram, &slope, &bounds);
                Gain { gain, ..nothing }
            }
            Combine::Keep if usable(0) => {
                // The column is a finite step: taken in full, half or double, not at any length.
                let length = (slope[0] / gram[(0, 0)]).clamp(STEP.0, STEP.1);
                let gain = 2.0 * length * slope[0] - length * length * gram[(0, 0)];
                Gain { gain, deviation: step_deviation(start, fitted, gram[(0, 0)]), ..nothing }
            }
            Combine::Amplitude => {
                let own = (0..count).map(|i| if usable(i) { length_bounds(start, fitted, i) } else { (0.0, 0.0) });
                let bounds: Vec<(f64, f64)> = own.chain(self.back()).collect();
                let (gain, mut lengths) = bounded_gain(&gram, &slope, &bounds);
                lengths.truncate(count);
                let values = start.at(&lengths);
                let (place, origin) = start.amplitudes[0];
                // From the value at which it does nothing: of a wrong parameter the size is its error.
                let deviation = usable(0).then(|| (start.columns[0][place] - origin).abs() / gram[(0, 0)].sqrt());
                let deviation = deviation.filter(|deviation| is_telling(*deviation, fitted.get(place)));
                let degrees = lengths.iter().filter(|l| **l != 0.0).count().max(1);
                Gain { gain, values, degrees, deviation }
            }
            Combine::Sinusoid if usable(0) && usable(1) => {
                let free = [(f64::NEG_INFINITY, f64::INFINITY); 2];
                let bounds: Vec<(f64, f64)> = free.into_iter().chain(self.back()).collect();
                let (gain, lengths) = bounded_gain(&gram, &slope, &bounds);
                let values = start.at(&lengths);
                let deviation = (gain > 0.0).then(|| (values[0] / gain.sqrt()).abs());
                let deviation = deviation.filter(|deviation| is_telling(*deviation, fitted.first()));
                Gain { gain, values, degrees: 2, deviation }
            }
            Combine::Span => {
                let k = before.len();
                let (gram, slope) = (gram.view((0, 0), (k, k)).into_owned(), slope.rows(0, k).into_owned());
                match span_gain(&gram, &slope, before) {
                    Some((gain, degrees)) => Gain { gain, degrees, ..nothing },
                    None => nothing,
                }
            }
            _ => nothing,
        }
    }
}

impl Basis {
    /// Best straight-line gain of several suspects together, and the values of their parameters, of one after the other.
    pub(crate) fn gain_together(
        &self,
        starts: &[(&Start, &[(usize, Added)])],
        before: &[f64],
        (gram, slope): (DMatrix<f64>, DVector<f64>),
    ) -> Option<(f64, Vec<f64>)> {
        let usable = |i: usize| gram[(i, i)] > 1e-9 * before[i] && gram[(i, i)].is_finite();
        let mut bounds = Vec::with_capacity(gram.nrows());
        for (start, fitted) in starts {
            for i in 0..start.columns.len() {
                bounds.push(match start.combine {
                    _ if !usable(bounds.len()) => return None,
                    Combine::Amplitude => length_bounds(start, fitted, i),
                    Combine::Sinusoid => (f64::NEG_INFINITY, f64::INFINITY),
                    Combine::Keep => STEP,
                    Combine::Span => return None,
                });
            }
        }
        bounds.extend(self.back());
        let (gain, lengths) = bounded_gain(&gram, &slope, &bounds);
        let mut lengths = lengths.into_iter();
        let values = starts.iter().flat_map(|(start, _)| {
            let own: Vec<f64> = lengths.by_ref().take(start.columns.len()).collect();
            start.at(&own)
        });
        Some((gain, values.collect()))
    }
}

impl Start {
    /// The values at so many lengths of its columns.
    fn at(&self, lengths: &[f64]) -> Vec<f64> {
        let mut values = self.columns[0].clone();
        match self.combine {
            Combine::Amplitude => {
                for (i, &(place, origin)) in self.amplitudes.iter().enumerate() {
                    values[place] = origin + lengths[i] * (self.columns[i][place] - origin);
                }
            }
            Combine::Sinusoid => {
                values[0] *= lengths[0].hypot(lengths[1]);
                if let Some(phase) = values.last_mut() {
                    *phase += lengths[1].atan2(lengths[0]);
                }
            }
            Combine::Keep | Combine::Span => {}
        }
        values
    }
}

impl Gain {
    fn nothing(start: &Start) -> Self {
        Self { gain: 0.0, values: start.columns[0].clone(), degrees: 1, deviation: None }
    }
}

/// Whether a size that shows at this deviation is below the typical one, with which the effect would move its equation as much
/// as all else does together: a larger one shows in any log, so its exclusion says nothing.
fn is_telling(deviation: f64, added: Option<&(usize, Added)>) -> bool {
    added.is_none_or(|(_, added)| SHOWN * deviation < added.scale)
}

/// Standard deviation of the one parameter that a finite step moves from zero, as a delay: the response to a longer one grows by less.
fn step_deviation(start: &Start, fitted: &[(usize, Added)], gram: f64) -> Option<f64> {
    let [(_, added)] = fitted else { return None };
    let deviation = (added.lower == 0.0).then(|| start.columns[0][0].abs() / gram.sqrt())?;
    is_telling(deviation, fitted.first()).then_some(deviation)
}

/// Least and greatest length of column `i` for which its parameter stays within its bounds: a friction that would
/// have to push is refused here already.
fn length_bounds(start: &Start, fitted: &[(usize, Added)], i: usize) -> (f64, f64) {
    let (place, origin) = start.amplitudes[i];
    let Some((_, added)) = fitted.get(place) else { return (f64::NEG_INFINITY, f64::INFINITY) };
    let step = start.columns[i][place] - origin;
    let (a, b) = ((added.lower - origin) / step, (added.upper - origin) / step);
    if a.is_nan() || b.is_nan() { (f64::NEG_INFINITY, f64::INFINITY) } else { (a.min(b), a.max(b)) }
}

pub(crate) fn are_finite(columns: &[Vec<DVector<f64>>]) -> bool {
    // Without a branch for each value.
    columns.iter().flatten().all(|values| values.as_slice().iter().fold(true, |all, value| all & value.is_finite()))
}

/// Gains of every start of an applied hypothesis: by start, noise model and view of its basis.
pub(crate) fn gains(applied: &Applied, at: &Linearised<'_>, bases: &[&Basis]) -> Vec<ByNoise<Vec<Gain>>> {
    let per_pass = |starts: &[Start]| starts.iter().map(|s| s.columns.len()).sum::<usize>();
    let mut all = Vec::with_capacity(applied.starts.len());
    let mut rest = &applied.starts[..];
    while !rest.is_empty() {
        let count = (1..=rest.len()).rev().find(|&c| per_pass(&rest[..c]) <= LANES).unwrap_or(1);
        let (now, later) = rest.split_at(count);
        let wanted: Vec<&Vec<f64>> = now.iter().flat_map(|s| &s.columns).collect();
        let Some(mut columns) = responses(applied, at, &wanted) else {
            // It can't be made beside what is there, but perhaps in its place.
            let none = |basis: &Basis, start: &Start| vec![Gain::nothing(start); basis.views().len()];
            let nothing = |start: &Start| bases.iter().map(|basis| (basis.noise, none(basis, start))).collect();
            return applied.starts.iter().map(nothing).collect();
        };
        for start in now {
            let own: Vec<Vec<DVector<f64>>> = columns.drain(..start.columns.len()).collect();
            let finite = are_finite(&own);
            let of = |basis: &&Basis| match finite {
                true => basis.gains(start, &applied.fitted, &mut own.clone()),
                false => vec![Gain::nothing(start); basis.views().len()],
            };
            let gains = bases.iter().map(|basis| (basis.noise, of(basis)));
            all.push(gains.collect());
        }
        rest = later;
    }
    all
}

/// Gains of a family of functions without a name, for each view of a basis.
pub(crate) fn gains_of_family(rival: &Rival, scene: &Scene, at: &Linearised<'_>, basis: &Basis) -> Vec<Gain> {
    let start = rival.start(scene);
    if let Some(mut columns) = responses_to_terms(at, rival.state, rival.members(), rival.size(scene)) {
        return match are_finite(&columns) {
            true => basis.gains(&start, &[], &mut columns),
            false => vec![Gain::nothing(&start); basis.views().len()],
        };
    }
    let applied = rival.apply(at.contestant.system.model(), scene);
    gains(&applied, at, &[basis])[0].of(basis.noise).cloned().unwrap_or_default()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::enumerate::enumerate;
    use crate::diagnose::fit::colours::noise::Noise;
    use crate::diagnose::fit::contestant::Contestant;
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fit::linear::basis::Out;
    use crate::diagnose::fit::moved::is_strained;
    use crate::diagnose::fit::outputs::scene_of;
    use crate::diagnose::fit::tolerance::tolerated;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::limits::Budget;
    use crate::model::System;
    use crate::refine::Experiment;

    /// Straight-line gain of a viscous friction for a drive whose tolerated rate (1 per second, 2 %) is another one.
    fn relaxation(rate: f64) -> (f64, Contestant) {
        let (model, data) = drive(Some(0.02), |x| rate * x, 0.0, (1, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap();
        let fitter = Fitter::default();
        let fitted = fitter.nominal(system.clone(), experiment, tolerated(&model), Budget::Thorough).unwrap();
        let scene = scene_of(&fitted);
        let all = enumerate(&model, &scene, &[0], &[]).unwrap();
        let friction = all.iter().find(|h| h.id() == "viscous_friction").unwrap();
        let applied = friction.apply(&model, &scene).unwrap();
        let gain = {
            let at = fitted.linearised().unwrap();
            gains(&applied, &at, &[&Basis::new(&at, Noise::White, &[])])[0].of(Noise::White).unwrap()[0].gain
        };
        (gain, fitted)
    }

    #[test]
    fn a_part_of_the_windows_tells_its_share_of_the_gain() {
        let (model, data) = drive(None, |x| 1.3 * x, 1e-3, (4, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap().with_windows_of(1.0);
        let fitted = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let scene = scene_of(&fitted);
        let all = enumerate(&model, &scene, &[0], &[]).unwrap();
        let applied = all.iter().find(|h| h.id() == "viscous_friction").unwrap().apply(&model, &scene).unwrap();
        let gain = |at: &Linearised<'_>| {
            gains(&applied, at, &[&Basis::new(at, Noise::White, &[])])[0].of(Noise::White).unwrap()[0].gain
        };
        let at = fitted.linearised().unwrap();
        let readings = fitted.experiment.n_values();
        let sketch = at.sketch(readings.div_ceil(3)).unwrap();
        assert!((sketch.share - 1.0 / 3.0).abs() < 0.06, "{}", sketch.share);
        let (whole, part) = (gain(&at), gain(&sketch.linearised()) / sketch.share);
        assert!((part / whole - 1.0).abs() < 0.2, "{part} of {whole}");
        // There is no part of what is few already.
        assert!(at.sketch(readings).is_none());
    }

    #[test]
    fn another_residual_of_the_same_fit_is_a_view_of_its_own() {
        let (model, data) = drive(None, |x| 1.3 * x, 1e-3, (2, 300));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap();
        let fitted = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let at = fitted.linearised().unwrap();
        // As logs that are simulated with the same causes: here without the residual, and with a third of it.
        let less = |share: f64| Out {
            places: Vec::new(),
            free: Vec::new(),
            change: at.jacobian.blocks.iter().map(|block| &block.residual * share).collect(),
        };
        let views = [less(1.0), less(2.0 / 3.0)];
        let basis = Basis::new(&at, Noise::White, &views);
        let losses: Vec<f64> = basis.views().iter().map(|view| view.loss).collect();
        assert!(losses[0] == 0.0 && losses[1] < -1e3, "{losses:?}");
        assert!((losses[2] / losses[1] - 8.0 / 9.0).abs() < 1e-9, "{losses:?}");
    }

    #[test]
    fn an_effect_gains_the_strain_of_a_tolerated_parameter_that_it_relieves() {
        let (gain, fitted) = relaxation(1.04);
        // The rate is two tolerances off and the friction is the same term: the belief's square of two comes free.
        assert!((gain - 4.0).abs() < 0.05, "{gain}");
        assert!(fitted.evidence.strain > 1.0, "{}", fitted.evidence.strain);
    }

    #[test]
    fn an_effect_lets_a_parameter_back_from_the_end_of_its_tolerance() {
        let (gain, fitted) = relaxation(1.061);
        assert!(is_strained(&fitted, 0));
        // The friction explains all: what the end of the tolerance leaves, and the belief's square of three. Straight
        // lines lose about a twentieth of the residual's part (the rate moves by 6 %).
        let left = fitted.refined.cost - 9.0;
        assert!(left > 5.0, "{left}");
        assert!((gain - fitted.refined.cost).abs() < 0.2 * left + 0.5, "{gain} of {}", fitted.refined.cost);
    }
}
