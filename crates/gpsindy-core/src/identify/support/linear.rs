//! Rollouts linearised in every candidate coefficient at a fit: which supports promise a better fit, and its start values.

use crate::error::Result;
use crate::identify::equations::Equations;
use crate::identify::evidence::price;
use crate::identify::limits::outlook::EXCHANGEABLE;
use crate::identify::limits::{EXCHANGES, MOVES, ROUNDING, ROUNDS, WORTH_A_TRY};
use crate::identify::outlook::Exchange;
use crate::identify::support::fit::{Fitter, Trial};
use crate::identify::support::sensitivity::Course;
use crate::refine::Jacobian;
use crate::regress::{Gains, Reduced};
use faer::Mat;
use nalgebra::{DMatrix, DVector};

impl Fitter<'_> {
    /// Trajectories around `trial` as a linear function of every candidate coefficient, initial states projected out.
    pub(crate) fn linearise(&self, trial: &Trial, window: f64) -> Result<Linear> {
        let equations = &trial.equations;
        let (system, experiment, point) = self.fitted(trial, window)?;
        let delays = self.free(equations).split_off(equations.support.len());
        let jacobian = Jacobian::new(&system, &experiment, &point, &delays)?;
        let course = Course { equations, system: &system, experiment: &experiment, tracks: self.tracks };
        let sensitivities = course.sensitivities(&point)?;
        let all = &equations.allowed;
        let candidates: Vec<(usize, usize)> =
            all.iter().enumerate().flat_map(|(s, terms)| terms.iter().map(move |&j| (s, j))).collect();
        let (n, q) = (system.n_states(), candidates.len() + delays.len());
        let is_in = |k: usize| equations.support.contains(candidates[k].0, candidates[k].1);
        let now: Vec<f64> = candidates.iter().map(|&(s, j)| equations.coefficients[s][j]).collect();
        let kept = (0..candidates.len()).filter(|&k| equations.kept[candidates[k].0].contains(&candidates[k].1));
        let kept: Vec<usize> = kept.collect();
        let rows: usize = jacobian.blocks.iter().map(|b| b.residual.len()).sum();
        let mut theta = Mat::zeros(rows, q);
        let mut target = Vec::with_capacity(rows);
        let mut top = 0;
        let mut blocks = Vec::with_capacity(jacobian.blocks.len());
        for (block, sensitivity) in jacobian.blocks.into_iter().zip(sensitivities) {
            let mut derivative = DMatrix::zeros(block.residual.len(), q);
            derivative.columns_mut(0, candidates.len()).copy_from(&sensitivity);
            derivative
                .columns_mut(candidates.len(), delays.len())
                .copy_from(&block.derivative.columns(n, delays.len()));
            for (i, _) in block.present.iter().enumerate().filter(|(_, present)| !**present) {
                derivative.row_mut(i).fill(0.0);
            }
            let mut residual = block.residual.clone();
            for (k, value) in now.iter().enumerate() {
                residual.axpy(*value, &derivative.column(k), 1.0);
            }
            // Columns of initial states that nothing measures are zero and stay out.
            let seen: Vec<usize> = (0..n).filter(|&j| block.derivative.column(j).norm() > 0.0).collect();
            if !seen.is_empty() {
                let factors = block.derivative.select_columns(&seen).qr();
                let basis = factors.q();
                // What the initial states take of a residual, and of each column's.
                let upper = factors.r();
                let of_residual = upper.solve_upper_triangular(&basis.tr_mul(&residual));
                let of_columns = upper.solve_upper_triangular(&basis.tr_mul(&derivative));
                blocks.push(of_residual.zip(of_columns).map(|(r, c)| (seen.clone(), r, c)));
                derivative -= &basis * basis.tr_mul(&derivative);
                residual -= &basis * basis.tr_mul(&residual);
            } else {
                blocks.push(None);
            }
            // Where the derivatives by the initial states overflow, the window carries no information.
            if residual.iter().chain(derivative.iter()).any(|value| !value.is_finite()) {
                residual.fill(0.0);
                derivative.fill(0.0);
                blocks.pop();
                blocks.push(None);
            }
            for k in 0..q {
                for (i, value) in derivative.column(k).iter().enumerate() {
                    theta[(top + i, k)] = *value;
                }
            }
            target.extend(residual.iter());
            top += block.residual.len();
        }
        let n_values = experiment.n_values() as f64;
        let problem = Reduced::new(theta.as_ref(), &target)?;
        Ok(Linear {
            gains: Gains::new(&problem),
            problem,
            active: (0..candidates.len()).filter(|&k| is_in(k) || kept.contains(&k)).collect(),
            kept,
            always: (candidates.len()..q).collect(),
            prices: candidates
                .iter()
                .map(|&(_, j)| price(equations, j, n_values * trial.share) / trial.share)
                .collect(),
            candidates,
            shape: (equations.n_states(), equations.n_terms()),
            blocks,
        })
    }
}

/// The initial states of a window that are seen, the step that fits the target alone, and its fall per candidate.
type Eliminated = (Vec<usize>, DVector<f64>, DMatrix<f64>);

/// The linearised problem: unit noise, one column a candidate, then the delays.
pub(crate) struct Linear {
    pub(crate) problem: Reduced,
    gains: Gains,
    pub(crate) candidates: Vec<(usize, usize)>,
    pub(crate) active: Vec<usize>,
    /// Candidates that stay in.
    kept: Vec<usize>,
    always: Vec<usize>,
    /// Fall of the sum of squares that each candidate must bring.
    prices: Vec<f64>,
    shape: (usize, usize),
    /// One a window; none where no initial state is seen.
    blocks: Vec<Option<Eliminated>>,
}

impl Linear {
    pub(crate) fn with_always(&self, active: &[usize]) -> Vec<usize> {
        active.iter().chain(&self.always).copied().collect()
    }

    /// Sum of squares that the terms in use leave, and the one that all candidates together leave.
    pub(crate) fn residuals(&self) -> (f64, f64) {
        let left = |terms: &[usize]| self.problem.refit(terms).residual;
        (left(&self.with_always(&self.active)), left(&(0..self.problem.n_terms()).collect::<Vec<usize>>()))
    }

    /// All single moves from `active` with what they would change in the evidence, best first.
    pub(crate) fn moves(&self, active: &[usize]) -> Vec<(f64, Vec<usize>)> {
        self.moves_of(&self.gains, active)
    }

    /// The same where the target is another one.
    fn moves_of(&self, gains: &Gains, active: &[usize]) -> Vec<(f64, Vec<usize>)> {
        let (gain, now) = gains.beside(&self.with_always(active));
        let mut moves = Vec::new();
        let open = |j: &usize| !active.contains(j);
        for j in (0..self.candidates.len()).filter(open) {
            let mut next = active.to_vec();
            next.push(j);
            moves.push((self.prices[j] - gain[j], next));
        }
        for place in (0..active.len()).filter(|&place| !self.kept.contains(&active[place])) {
            let mut without = active.to_vec();
            without.remove(place);
            let (gain, left) = gains.beside(&self.with_always(&without));
            let saved = left - now - self.prices[active[place]];
            moves.push((saved, without.clone()));
            let mut order: Vec<usize> = (0..self.candidates.len()).filter(open).collect();
            let cost = |j: usize| self.prices[j] - gain[j];
            order.sort_by(|&x, &y| cost(x).total_cmp(&cost(y)));
            for j in order.into_iter().take(EXCHANGES) {
                let mut next = without.clone();
                next.push(j);
                moves.push((saved + cost(j), next));
            }
        }
        moves.sort_by(|x, y| x.0.total_cmp(&y.0));
        moves
    }

    /// The supports with one term fewer, the one that misses the least first.
    pub(crate) fn drops(&self) -> Vec<Vec<usize>> {
        let droppable = (0..self.active.len()).filter(|&place| !self.kept.contains(&self.active[place]));
        let mut drops: Vec<(f64, Vec<usize>)> = droppable
            .map(|place| {
                let mut without = self.active.clone();
                without.remove(place);
                (self.gains.beside(&self.with_always(&without)).1, without)
            })
            .collect();
        drops.sort_by(|x, y| x.0.total_cmp(&y.0));
        drops.into_iter().map(|(_, support)| support).collect()
    }

    /// The support (numbers of candidates) and the coefficients (n x p) that the linear problem would have led to with other noise;
    /// `noise` draws errors of the rows.
    pub(crate) fn redrawn(&self, noise: impl FnMut() -> f64) -> (Vec<usize>, Vec<Vec<f64>>) {
        let problem = self.problem.redrawn(&self.with_always(&self.active), noise);
        let gains = self.gains.of_target(&problem);
        let mut support = self.active.clone();
        for _ in 0..ROUNDS {
            match self.moves_of(&gains, &support).into_iter().next() {
                Some((change, next)) if change < -ROUNDING => support = next,
                _ => break,
            }
        }
        let fit = problem.refit(&self.with_always(&support));
        let coefficients = self.by_equation(&support, &fit.coefficients);
        (support, coefficients)
    }

    /// Pairs of terms of one equation that explain the logs about as well, `share` of their values being independent.
    pub(crate) fn exchangeable(&self, share: f64, equations: &Equations) -> Vec<Exchange> {
        let names = equations.library.names();
        let near = self.moves(&self.active).into_iter().take_while(|(change, _)| share * change < EXCHANGEABLE);
        let pair = |(_, support): (f64, Vec<usize>)| {
            let out = self.active.iter().copied().find(|k| !support.contains(k))?;
            let new = support.iter().copied().find(|k| !self.active.contains(k))?;
            let ((s, term), (other_state, other)) = (self.candidates[out], self.candidates[new]);
            let state = equations.states[s].0.clone();
            (s == other_state).then(|| Exchange { state, term: names[term].into(), other: names[other].into() })
        };
        near.filter_map(pair).collect()
    }

    /// Values one a candidate as one a term of each equation (n x p), 0 outside `support`.
    fn by_equation(&self, support: &[usize], values: &[f64]) -> Vec<Vec<f64>> {
        let mut coefficients = vec![vec![0.0; self.shape.1]; self.shape.0];
        for &k in support {
            let (s, j) = self.candidates[k];
            coefficients[s][j] = values[k];
        }
        coefficients
    }

    fn least_price(&self) -> f64 {
        self.prices.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Supports worth a full fit: where single moves lead to in the linear problem, then the best single moves.
    pub(crate) fn proposals(&self) -> Vec<Vec<usize>> {
        let mut far = self.active.clone();
        for _ in 0..ROUNDS {
            match self.moves(&far).into_iter().next() {
                Some((change, next)) if change < -ROUNDING => far = next,
                _ => break,
            }
        }
        let mut proposals = Vec::new();
        let mut add = |mut support: Vec<usize>| {
            support.sort_unstable();
            if support != self.active && !proposals.contains(&support) {
                proposals.push(support);
            }
        };
        add(far);
        // A move that the linear problem holds for slightly worse may still win in full.
        for (_, next) in
            self.moves(&self.active).into_iter().take_while(|m| m.0 < WORTH_A_TRY * self.least_price()).take(MOVES)
        {
            add(next);
        }
        proposals
    }

    /// The linear problem's coefficients on `support` (n x p), and the initial states that belong to them.
    pub(crate) fn solution(&self, support: &[usize], initial: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let fit = self.problem.refit(&self.with_always(support));
        let coefficients = self.by_equation(support, &fit.coefficients);
        let all = DVector::from_column_slice(&fit.coefficients);
        let mut moved = initial.to_vec();
        for (start, block) in moved.iter_mut().zip(&self.blocks) {
            if let Some((seen, of_residual, of_columns)) = block {
                let step = of_residual - of_columns * &all;
                for (&state, change) in seen.iter().zip(step.iter()) {
                    start[state] += change;
                }
            }
        }
        (coefficients, moved)
    }
}

#[cfg(test)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::identify::algorithm1::smooth::smooth;
    use crate::identify::prepare::prepare;
    use crate::identify::settings::Identify;
    use crate::identify::support::fit::Fitter;
    use crate::identify::tests::log;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use crate::random::normal;
    use crate::refine::Hold;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    #[test]
    fn a_rollout_whose_derivatives_overflow_tells_nothing_and_stops_nothing() {
        let time: Vec<f64> = (0..41).map(|i| 0.1 * i as f64).collect();
        let values = Mat::from_fn(41, 1, |i, _| (-time[i]).exp());
        let data = Dataset::new(vec![Channel::new("x")], vec![Run { name: "a".into(), time, values }]).unwrap();
        let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
        let identify = Identify { states: vec!["x".into()], library, smoother: None, ..Identify::default() };
        let logs = prepare(&identify, &data, &Silent).unwrap();
        let motion = smooth(&identify, &logs, &Silent).unwrap();
        let mut equations = logs.frame.clone();
        let x = equations.library.index_of("x").unwrap();
        let coefficients = (0..equations.n_terms()).map(|j| if j == x { -1.0 } else { 0.0 }).collect::<Vec<_>>();
        equations.set(0, &coefficients);
        let fitter = Fitter::new(&logs, &motion, Hold::Zero);
        let mut trial = fitter.fit(&equations, 4.0, None).unwrap();
        // From 0 this stays at 0, but its derivative by the start grows like exp(1000 t).
        trial.equations.coefficients[0][x] = 1000.0;
        trial.initial.iter_mut().flatten().for_each(|start| *start = 0.0);
        let linear = fitter.linearise(&trial, 4.0).unwrap();
        assert!(linear.solution(&[x], &trial.initial).1.iter().flatten().all(|start| *start == 0.0));
    }

    #[test]
    fn the_same_terms_come_back_without_noise_and_others_with_much_of_it() {
        let rate = |_: f64, x: &[f64]| vec![-x[0]];
        let data = log(&["x"], &[1.0], &rate, (0.1, 40), 0.02, &|_| vec![], 1);
        let identify = Identify { states: vec!["x".into()], smoother: None, ..Identify::default() };
        let logs = prepare(&identify, &data, &Silent).unwrap();
        let motion = smooth(&identify, &logs, &Silent).unwrap();
        let mut equations = logs.frame.clone();
        let x = equations.library.index_of("x").unwrap();
        let coefficients: Vec<f64> = (0..equations.n_terms()).map(|j| if j == x { -1.0 } else { 0.0 }).collect();
        equations.set(0, &coefficients);
        let fitter = Fitter::new(&logs, &motion, Hold::Zero);
        let linear = fitter.linearise(&fitter.fit(&equations, 4.0, None).unwrap(), 4.0).unwrap();
        let (support, coefficients) = linear.redrawn(|| 0.0);
        assert_eq!(support, linear.active);
        assert!((coefficients[0][x] + 1.0).abs() < 0.05, "{coefficients:?}");
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn: Vec<_> = (0..20).map(|_| linear.redrawn(|| 20.0 * normal(&mut rng)).0).collect();
        assert!(drawn.iter().any(|support| *support != linear.active), "{drawn:?}");
    }
}
