//! Removes terms without visible effect: if rollouts match the logs to rounding, keeps the fewest terms that still do.

use crate::error::Result;
use crate::identify::limits::{EXACT, MOVES};
use crate::identify::support::fit::{Fitter, Trial};

impl Fitter<'_> {
    /// `start` without the terms that its rollouts can do without, where they are exact.
    ///
    /// Evidence has no say there. What is left is the rounding and the integration error of whatever wrote the logs, and small
    /// terms that fit it look certain.
    pub(crate) fn simplify(&self, start: Trial, window: f64, keep_going: &dyn Fn() -> Result<()>) -> Result<Trial> {
        let mut best = start;
        while is_exact(&best) {
            keep_going()?;
            let linear = self.linearise(&best, window)?;
            let shorter = linear.drops().into_iter().take(MOVES);
            let mut exact =
                shorter.filter_map(|support| self.attempt(&best, &linear, &support, window)).filter(is_exact);
            match exact.next() {
                Some(trial) => best = trial,
                None => break,
            }
        }
        Ok(best)
    }
}

/// Whether the rollouts of every column that moves follow it within [`EXACT`].
fn is_exact(trial: &Trial) -> bool {
    let columns = trial.squares.iter().zip(&trial.counts).zip(&trial.sizes);
    let mut moving = columns.filter(|((_, count), size)| **count > 0.0 && **size > 0.0).peekable();
    moving.peek().is_some() && moving.all(|((square, count), size)| (square / count).sqrt() < EXACT * size)
}

#[cfg(test)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::identify::settings::Identify;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use faer::Mat;

    /// A pendulum by the classical Runge-Kutta method in steps of 0.1 s, that is with errors of a hundred-thousandth.
    fn pendulum() -> Dataset {
        let slope = |[q, w]: [f64; 2]| [w, -2.0 * f64::sin(q)];
        let along = |[q, w]: [f64; 2], [a, b]: [f64; 2], h: f64| [q + h * a, w + h * b];
        let (mut state, mut rows) = ([1.2, 0.0], Vec::new());
        for _ in 0..=150 {
            rows.push(state);
            let first = slope(state);
            let second = slope(along(state, first, 0.05));
            let third = slope(along(state, second, 0.05));
            let last = slope(along(state, third, 0.1));
            let mean = [0, 1].map(|k| (first[k] + 2.0 * second[k] + 2.0 * third[k] + last[k]) / 6.0);
            state = along(state, mean, 0.1);
        }
        let values = Mat::from_fn(rows.len(), 2, |i, j| rows[i][j]);
        let time = (0..rows.len()).map(|i| 0.1 * i as f64).collect();
        let run = Run { name: "swing".into(), time, values };
        Dataset::new(vec![Channel::new("q"), Channel::new("w")], vec![run]).unwrap()
    }

    #[test]
    fn the_errors_of_the_solver_that_made_a_log_bring_no_terms() {
        let library = LibrarySettings { degree: 3, trig: true, ..LibrarySettings::default() };
        let identify = Identify { states: vec!["q".into(), "w".into()], library, ..Identify::default() };
        let found = identify.fit(&pendulum(), &Silent).unwrap();
        let terms: Vec<Vec<String>> = found.states.into_iter().map(|state| state.terms).collect();
        assert_eq!(terms, [["w"], ["sin(q)"]]);
    }
}
