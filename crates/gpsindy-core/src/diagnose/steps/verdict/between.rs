//! Between runs: a size by run, pooled with what of its spread is the machine's and not the fit's.
//!
//! Random effects: the values `b` of r runs, with information W (r x r) of the fit, are the machine's own of each run with a variance
//! `tau^2` around a mean. `tau^2 = (Q - (r - 1)) / tr(P)` by moments, with `P = W - W 1 1'W / 1'W 1` and `Q = b'P b`: for runs that share
//! nothing, the estimator of DerSimonian and Laird 1986, Controlled Clinical Trials 7(3). The interval of the mean is that of Hartung
//! and Knapp 2001, Statistics in Medicine 20(24), never narrower than without their factor. The share is I^2 of Higgins and Thompson
//! 2002, Statistics in Medicine 21(11).

use crate::diagnose::fit::by_run::Pooled;
use crate::diagnose::fit::evidence::normal_quantile;
use crate::diagnose::limits::weigh::SHOWN_SIZE;
use crate::diagnose::report::{BetweenRuns, RunValue};
use crate::excerpt::recording;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use std::collections::HashSet;

/// A size of a cause by run.
pub(crate) struct Sizes {
    /// Its name in the catalogue's form.
    pub(crate) parameter: String,
    pub(crate) unit: String,
    /// Names of the logs of each run; several where there are too many for a value each.
    pub(crate) runs: Vec<Vec<String>>,
    /// In each of them, in `unit`.
    pub(crate) values: DVector<f64>,
    /// Inverse covariance of these values.
    pub(crate) information: DMatrix<f64>,
}

impl Sizes {
    /// By recording and pooled; `None` where fewer than two recordings show it. Windows of one recording have one value: their spread is
    /// none between runs.
    pub(crate) fn stated(&self, confidence: f64) -> Option<BetweenRuns> {
        let Self { runs: names, values, information, .. } = &self.by_recording()?.shown()?;
        let count = values.len();
        if count < 2 {
            return None;
        }
        let own = information.clone().cholesky()?.inverse();
        let freedom = (count - 1) as f64;
        let Pooled { mean: pooled, weight, factor, variance, excess } = self.pooled()?;
        let level = 0.5 + 0.5 * confidence;
        let width = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(level) * (factor / weight).sqrt();
        let normal = normal_quantile(level);
        let runs = names.iter().enumerate().map(|(i, run)| {
            let width = normal * own[(i, i)].sqrt();
            RunValue { run: named(run), value: values[i], low: values[i] - width, high: values[i] + width }
        });
        let found = BetweenRuns {
            parameter: self.parameter.clone(),
            unit: self.unit.clone(),
            runs: runs.collect(),
            pooled,
            low: pooled - width,
            high: pooled + width,
            spread: variance.sqrt(),
            share: if excess > 0.0 { ((excess - freedom) / excess).max(0.0) } else { 0.0 },
            p_value: ChiSquared::new(freedom).ok()?.sf(excess.max(0.0)),
        };
        [found.pooled, found.low, found.high, found.spread, found.share, found.p_value]
            .iter()
            .all(|v| v.is_finite())
            .then_some(found)
    }

    /// Without the runs that say nothing of the size: their errors are far larger than itself, and the straight lines that they come from do not
    /// hold so far.
    fn shown(self) -> Option<Self> {
        let most = SHOWN_SIZE * self.pooled()?.mean.abs();
        let covariance = self.information.clone().cholesky()?.inverse();
        let kept: Vec<usize> = (0..self.values.len()).filter(|&i| covariance[(i, i)].sqrt() <= most).collect();
        if kept.len() == self.values.len() {
            return Some(self);
        }
        let information = covariance.select_rows(&kept).select_columns(&kept).cholesky()?.inverse();
        let runs = kept.iter().map(|&i| self.runs[i].clone()).collect();
        Some(Self { runs, values: self.values.select_rows(&kept), information, ..self })
    }

    /// What is common to the recordings.
    pub(crate) fn pooled(&self) -> Option<Pooled> {
        let Self { values, information, .. } = self.by_recording()?;
        Pooled::of(&values, &information)
    }

    /// One value for all runs that share a recording, by generalised least squares.
    fn by_recording(&self) -> Option<Self> {
        let mut groups: Vec<(Vec<String>, Vec<usize>)> = Vec::new();
        for (i, run) in self.runs.iter().enumerate() {
            let (mut names, mut members): (Vec<String>, Vec<usize>) =
                (run.iter().map(|log| recording(log).to_string()).collect(), vec![i]);
            // Groups of which this run has a recording become one with it.
            let shares = |group: &(Vec<String>, Vec<usize>)| group.0.iter().any(|name| names.contains(name));
            let (met, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(shares);
            for (others, more) in met.into_iter().rev() {
                names.splice(0..0, others);
                members.extend(more);
            }
            let mut seen = HashSet::new();
            names.retain(|name| seen.insert(name.clone()));
            groups = apart;
            groups.push((names, members));
        }
        let belongs =
            DMatrix::from_fn(self.values.len(), groups.len(), |i, g| f64::from(u8::from(groups[g].1.contains(&i))));
        let information = belongs.tr_mul(&(&self.information * &belongs));
        let seen = belongs.tr_mul(&(&self.information * &self.values));
        let values = information.clone().cholesky()?.solve(&seen);
        let runs = groups.into_iter().map(|(names, _)| names).collect();
        Some(Self { parameter: self.parameter.clone(), unit: self.unit.clone(), runs, values, information })
    }
}

/// Runs by their names, as a sentence takes them: a file's name or "run 3" says enough, a bare number does not.
pub(crate) fn named<S: AsRef<str>>(runs: &[S]) -> String {
    let runs = runs.iter().map(AsRef::as_ref).collect::<Vec<&str>>().join(", ");
    if runs.contains(char::is_alphabetic) { runs } else { format!("run {runs}") }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn sizes(values: &[f64], information: DMatrix<f64>) -> Sizes {
        let runs = (0..values.len()).map(|i| vec![format!("run_{i}")]).collect();
        Sizes { parameter: "c".into(), unit: "N m".into(), runs, values: DVector::from_row_slice(values), information }
    }

    #[test]
    fn runs_that_share_nothing_are_pooled_as_by_dersimonian_and_laird() {
        // By hand: W = diag(100, 25, 400), fixed mean 1.1762, Q = 18.0762, C = 525 - 170625/525 = 200,
        // tau^2 = (18.0762 - 2) / 200, weights 1 / (1/W + tau^2).
        let values = [1.0, 1.5, 1.2];
        let weights = [100.0, 25.0, 400.0];
        let found = sizes(&values, DMatrix::from_diagonal(&DVector::from_row_slice(&weights))).stated(0.95).unwrap();
        let mean = weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>() / 525.0;
        let q: f64 = weights.iter().zip(values).map(|(w, v)| w * (v - mean) * (v - mean)).sum();
        let tau2: f64 = (q - 2.0) / (525.0 - (1e4 + 625.0 + 16e4) / 525.0);
        assert!((found.spread - tau2.sqrt()).abs() < 1e-12, "{found:?}");
        assert!((found.share - (q - 2.0) / q).abs() < 1e-12);
        let star: Vec<f64> = weights.iter().map(|w| 1.0 / (1.0 / w + tau2)).collect();
        let pooled = star.iter().zip(values).map(|(w, v)| w * v).sum::<f64>() / star.iter().sum::<f64>();
        assert!((found.pooled - pooled).abs() < 1e-12);
        // Three runs: Student's factor of two degrees of freedom, 4.303.
        assert!(found.high - found.pooled > 4.3 / star.iter().sum::<f64>().sqrt());
        assert!((found.runs[1].high - 1.5 - 1.96 * 0.2).abs() < 1e-3);
    }

    #[test]
    fn a_run_without_a_word_is_named_as_a_run() {
        assert_eq!(named(&["run 1"]), "run 1");
        assert_eq!(named(&["log.csv:3", "log.csv:4"]), "log.csv:3, log.csv:4");
        assert_eq!(named(&["7"]), "run 7");
    }

    #[test]
    fn windows_of_one_recording_are_one_run() {
        let mut found = sizes(&[1.0, 1.5], DMatrix::identity(2, 2));
        assert!(found.stated(0.95).is_some());
        found.runs = vec![vec!["arm.csv from 2.000 s".into()], vec!["arm.csv from 7.500 s".into()]];
        assert!(found.stated(0.95).is_none());
        found.runs = vec![vec!["arm.csv from 2.000 s".into()], vec!["wrist.csv from 7.500 s".into()]];
        assert!(found.stated(0.95).is_some());
        // Where there are too many for a value each, a run is several windows.
        let window = |recording: &str, from: f64| format!("{recording} from {from:.3} s");
        found.runs = vec![vec![window("arm.csv", 2.0), window("arm.csv", 4.0)], vec![window("arm.csv", 6.0)]];
        assert!(found.stated(0.95).is_none());
        found.runs = vec![vec![window("arm.csv", 2.0), window("arm.csv", 4.0)], vec![window("wrist.csv", 6.0)]];
        assert!(found.stated(0.95).is_some());
        assert_eq!(found.stated(0.95).unwrap().runs[0].run, "arm.csv");
        // Two windows of one and one of another: the two have their weighted mean, the other keeps its own.
        let mut found =
            sizes(&[1.0, 1.6, 1.2], DMatrix::from_diagonal(&DVector::from_row_slice(&[100.0, 200.0, 400.0])));
        found.runs = vec![vec![window("arm.csv", 2.0)], vec![window("arm.csv", 4.0)], vec![window("wrist.csv", 6.0)]];
        let stated = found.stated(0.95).unwrap();
        let rows: Vec<(&str, f64)> = stated.runs.iter().map(|run| (run.run.as_str(), run.value)).collect();
        assert!((rows[0].1 - 1.4).abs() < 1e-12 && (rows[1].1 - 1.2).abs() < 1e-12, "{rows:?}");
        assert_eq!([rows[0].0, rows[1].0], ["arm.csv", "wrist.csv"]);
        assert!((stated.runs[0].high - 1.4 - 1.96 / 300_f64.sqrt()).abs() < 1e-3);
    }

    #[test]
    fn what_runs_share_is_no_spread_of_theirs() {
        // Two runs whose errors are nearly one: a difference of a tenth is many deviations of the difference.
        let covariance = DMatrix::from_row_slice(2, 2, &[1.0, 0.9999, 0.9999, 1.0]);
        let shared = sizes(&[1.0, 1.1], covariance.try_inverse().unwrap()).stated(0.95).unwrap();
        assert!(shared.p_value < 1e-6 && shared.spread > 0.05, "{shared:?}");
        let alone = sizes(&[1.0, 1.1], DMatrix::identity(2, 2)).stated(0.95).unwrap();
        assert!(alone.p_value > 0.9 && alone.spread == 0.0 && alone.share == 0.0, "{alone:?}");
    }

    #[test]
    fn a_run_that_says_nothing_of_a_size_is_not_listed() {
        let found =
            sizes(&[18.0, -1.1e6, 17.9], DMatrix::from_diagonal(&DVector::from_row_slice(&[10.0, 1e-12, 12.0])));
        let stated = found.stated(0.95).unwrap();
        let names: Vec<&str> = stated.runs.iter().map(|run| run.run.as_str()).collect();
        assert!(names == ["run_0", "run_2"] && (stated.pooled - 17.95).abs() < 0.01, "{stated:?}");
        // One that is known badly is.
        let found = sizes(&[18.0, 30.0, 17.9], DMatrix::from_diagonal(&DVector::from_row_slice(&[10.0, 1e-3, 12.0])));
        assert_eq!(found.stated(0.95).unwrap().runs.len(), 3);
    }

    #[test]
    fn a_single_run_has_no_spread() {
        assert!(sizes(&[1.0], DMatrix::identity(1, 1)).stated(0.95).is_none());
    }
}
