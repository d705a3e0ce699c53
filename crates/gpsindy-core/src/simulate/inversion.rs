//! States that no log carries, from the given equation of a state that is logged: `y' = f(y, h)` is solved for `h` at every sample.

use crate::data::Run;
use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Tape};

/// Powers of ten on both sides of 1 that a hidden state is looked for in: single precision has few more. Convention.
const DECADES: i32 = 8;
/// Values in a power of ten between which it is looked for. Convention.
const PER_DECADE: i32 = 4;
/// Halvings of a bracket: 2^-50 of it is rounding. Argument.
const BISECTIONS: usize = 50;

/// The equation of a logged state, as one for a hidden state in it.
#[derive(Debug, Clone)]
pub(crate) struct Inversion {
    tape: Tape,
    /// Column of every variable but the hidden one; none for that.
    columns: Vec<Option<usize>>,
    hidden: usize,
    /// Values of the hidden state that are tried, ascending.
    grid: Vec<f64>,
}

impl Inversion {
    /// `equation` solved for `hidden`; `column` says where another name is logged, and `numbers` have these values.
    ///
    /// # Errors
    /// A further name that no log carries, or an equation with a memory.
    pub(crate) fn new(
        equation: &Expression,
        hidden: &str,
        numbers: &[(String, f64)],
        column: &dyn Fn(&str) -> Option<usize>,
    ) -> Result<Self> {
        let valued = |all: Expression, (name, value): &(String, f64)| all.substitute(name, &Expression::Number(*value));
        let equation = numbers.iter().fold(equation.clone(), valued);
        let names = equation.variables();
        let columns: Vec<Option<usize>> = names.iter().map(|name| column(name)).collect();
        if let Some(other) = (0..names.len()).find(|&k| names[k] != hidden && columns[k].is_none()) {
            let other = &names[other];
            return Err(Error::settings(format!(
                "neither `{hidden}` nor `{other}` is in the logs, and one equation says nothing of both; give each an equation of a logged state, or let one be a free number"
            )));
        }
        let magnitudes = -DECADES * PER_DECADE..=DECADES * PER_DECADE;
        let magnitudes: Vec<f64> = magnitudes.map(|k| 10f64.powf(f64::from(k) / f64::from(PER_DECADE))).collect();
        let negative = magnitudes.iter().rev().map(|value| -value);
        let grid = negative.chain([0.0]).chain(magnitudes.iter().copied()).collect();
        let place = names.iter().position(|name| name == hidden).unwrap_or(0);
        Ok(Self { tape: Tape::new(&[equation], &names)?, columns, hidden: place, grid })
    }

    /// The hidden state at every sample, from `slopes` of the state whose equation it is and `values` of all columns. Between several
    /// solutions the one nearest to the sample before counts, where there is none what comes nearest.
    pub(crate) fn solve(&self, run: &Run, slopes: &[f64], value: &dyn Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut before = None;
        (0..run.n_samples())
            .map(|i| {
                let found = self.at_sample(self.values(&|c| value(i, c)), run.time[i], slopes[i], before);
                before = Some(found);
                found
            })
            .collect()
    }

    /// The hidden state where the columns have these values.
    pub(crate) fn at(&self, value: &dyn Fn(usize) -> f64, time: f64, slope: f64) -> f64 {
        self.at_sample(self.values(value), time, slope, None)
    }

    fn values(&self, value: &dyn Fn(usize) -> f64) -> Vec<f64> {
        self.columns.iter().map(|c| c.map_or(0.0, value)).collect()
    }

    /// The same at one sample, `values` one a variable of the equation.
    fn at_sample(&self, mut values: Vec<f64>, time: f64, slope: f64, before: Option<f64>) -> f64 {
        let mut off = |hidden: f64| {
            values[self.hidden] = hidden;
            self.tape.evaluate_once(&values, time)[0] - slope
        };
        let misses: Vec<f64> = self.grid.iter().map(|&hidden| off(hidden)).collect();
        let near = |value: f64| (value - before.unwrap_or(0.0)).abs();
        let crossing = |k: &usize| misses[*k] * misses[k + 1] <= 0.0;
        let bracket = (0..self.grid.len() - 1).filter(crossing).min_by(|&a, &b| {
            let distance = |k: usize| near(self.grid[k]).min(near(self.grid[k + 1]));
            distance(a).total_cmp(&distance(b))
        });
        let Some(k) = bracket else {
            // Of what comes equally near, the smallest: a root of what may not be negative ends at 0.
            let places = (0..self.grid.len()).filter(|&k| misses[k].is_finite());
            let best = places.min_by(|&a, &b| {
                misses[a].abs().total_cmp(&misses[b].abs()).then(self.grid[a].abs().total_cmp(&self.grid[b].abs()))
            });
            return best.map_or(0.0, |k| self.grid[k]);
        };
        let (mut low, mut high, above) = (self.grid[k], self.grid[k + 1], misses[k + 1]);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if off(middle) * above > 0.0 { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }
}

/// Whether a sensor shows its own state up to an end, such as `min(y, 10)`.
pub(super) fn ends(measured: &Expression, name: &str) -> bool {
    match measured {
        Expression::Variable(own) => own == name,
        Expression::Call(Function::Min | Function::Max, parts) => {
            ends(&parts[0], name) && matches!(parts[1], Expression::Number(_))
        }
        _ => false,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use faer::Mat;

    fn solved(equation: &str, slopes: &[f64]) -> Vec<f64> {
        let numbers = [("b".to_string(), 0.5)];
        let equation = Expression::parse(equation).unwrap();
        let inversion = Inversion::new(&equation, "h", &numbers, &|name| (name == "y").then_some(0)).unwrap();
        let time = (0..slopes.len()).map(|i| i as f64).collect();
        let run = Run { name: "a".into(), time, values: Mat::from_fn(slopes.len(), 1, |_, _| 4.0) };
        inversion.solve(&run, slopes, &|i, c| run.values[(i, c)])
    }

    #[test]
    fn a_hidden_level_follows_from_what_it_lets_out() {
        // sqrt(h) = slope + 0.5 * sqrt(4).
        for (found, truth) in solved("sqrt(h) - b*sqrt(y)", &[1.0, 0.5, -0.9]).iter().zip([4.0, 2.25, 0.01]) {
            assert!((found - truth).abs() < 1e-9, "{found} {truth}");
        }
        assert_eq!(solved("sqrt(max(h, 0)) - b*sqrt(y)", &[-2.0]), [0.0], "no level lets less than nothing out");
    }

    #[test]
    fn of_two_solutions_the_nearer_one_continues() {
        let found = solved("h^2 - b*y", &[-1.0, 2.0, 7.0]);
        let signs: Vec<f64> = found.iter().map(|value| value.signum()).collect();
        assert!(signs.iter().all(|sign| *sign == signs[0]), "{found:?}");
    }

    #[test]
    fn two_unknowns_in_one_equation_are_refused() {
        let equation = Expression::parse("h - q").unwrap();
        let error = Inversion::new(&equation, "h", &[], &|_| None).err().unwrap().to_string();
        assert!(error.contains("`h` nor `q`"), "{error}");
    }
}
