//! Gaps so small that the integrator of a model may be their cause.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::weigh::AN_INTEGRATORS;

/// One column of the nominal fit: what it leaves beyond noise, or beyond what the causes leave, its motion, and by how much it moves in a
/// sample, each a root mean square.
struct Column {
    gap: f64,
    motion: f64,
    step: f64,
}

/// The gap between the nominal model and the `best` as a share of the motion, of the column where it is largest, where an integrator that steps otherwise leaves as much in every column;
/// none where it is larger in one.
///
/// An integrator of first order runs ahead or behind by half a step: it solves another equation exactly, which differs by that (Hairer, Lubich and
/// Wanner 2006, Geometric Numerical Integration, chapter IX). So a gap of [`AN_INTEGRATORS`] of the way in a sample says nothing of the machine
/// where the logs are another simulator's.
pub(crate) fn of_an_integrator(nominal: &Contestant, best: &Contestant) -> Option<f64> {
    let columns: Vec<Column> = (0..nominal.experiment.columns.len()).map(|c| column((nominal, best), c)).collect();
    let is_small = columns.iter().all(|column| column.gap <= AN_INTEGRATORS * column.step);
    let share = columns.iter().filter(|column| column.motion > 0.0).map(|column| column.gap / column.motion);
    is_small.then(|| share.fold(0.0, f64::max))
}

fn column((nominal, best): (&Contestant, &Contestant), c: usize) -> Column {
    let (experiment, residuals) = (&nominal.experiment, &nominal.refined.residuals);
    let noise = experiment.noise[c];
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    let (mut moved, mut steps) = (0.0, 0.0);
    for (window, residuals) in experiment.windows.iter().zip(residuals) {
        let measured = &experiment.logs[window.log].measured[c][window.first..=window.last];
        let of_column = residuals.iter().skip(c).step_by(experiment.columns.len());
        let mut before: Option<f64> = None;
        for (measured, residual) in measured.iter().zip(of_column) {
            let output = Some(measured - residual * noise).filter(|output| output.is_finite());
            if let Some(output) = output {
                (sum, squares, count) = (sum + output, squares + output * output, count + 1.0);
            }
            if let (Some(now), Some(before)) = (output, before) {
                (moved, steps) = (moved + (now - before).powi(2), steps + 1.0);
            }
            before = output;
        }
    }
    let mean = sum / f64::max(count, 1.0);
    let variance = |fit: &Contestant| fit.evidence.colours[c].variance();
    Column {
        // What is no number is not small.
        gap: noise * (variance(nominal) - variance(best).min(1.0)).clamp(0.0, f64::INFINITY).sqrt(),
        motion: (squares / f64::max(count, 1.0) - mean * mean).max(0.0).sqrt(),
        step: (moved / f64::max(steps, 1.0)).sqrt(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::fixture::drive;
    use crate::diagnose::notes::Note;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;

    /// The share that a note states of a drive that loses `k x`, where its model loses `x`.
    fn stated(k: f64, noise: f64) -> Option<f64> {
        let (model, data) = drive(None, |x| k * x, noise, (4, 300));
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap();
        assert!(found.diagnosis.gap.detected);
        found.notes.iter().find_map(|note| if let Note::Small { share } = note { Some(*share) } else { None })
    }

    #[test]
    fn a_gap_that_an_integrator_leaves_is_stated_as_a_share_of_the_motion() {
        // Euler's method at a tenth of the sampling period loses 1 + k h/2 of what the equation does.
        let share = stated(1.0005, 1e-7);
        assert!(share.is_some_and(|share| (1e-7..1e-3).contains(&share)), "{share:?}");
        assert_eq!(stated(1.3, 1e-7), None);
        assert_eq!(stated(1.3, 2e-3), None);
    }

    #[test]
    fn what_nothing_explains_and_no_held_out_rollout_shows_is_no_gap_where_an_integrator_leaves_it() {
        let found = |k: f64, material: f64| {
            let (model, data) = drive(None, |x| k * x, 7e-4, (4, 300));
            let (train, holdout) = hold_out(&data).unwrap();
            let effects = vec!["periodic_disturbance".into()];
            let diagnose = Diagnose { effects, material, ..Diagnose::default() };
            let found = diagnose.run(&model, &train, &holdout, &Silent).unwrap();
            let is_noted = found.notes.iter().any(|note| matches!(note, Note::OfAnIntegrator { .. }));
            (found.diagnosis.verdict, found.diagnosis.gap.detected, is_noted)
        };
        assert_eq!(found(1.0006, 0.0), (Verdict::NoGap, false, true));
        // Too much for an integrator, unless the user does not mind.
        assert_eq!(found(1.02, 0.0), (Verdict::Unexplained, true, false));
        assert_eq!(found(1.02, 0.05), (Verdict::NoGap, false, false));
    }
}
